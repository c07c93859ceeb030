"""A study that uses many keys at once."""

SAMPLE = """\
schema_version = 1
title = "a table on a bed, {{7*7}} <script>"
kind = "asymmetry"
gravity = 9.81
initial = "equilibrium"

[body.bed]
kind = "beam"
length = 15.0
area = 0.01
second_moment = 8.33e-6
youngs_modulus = "210 GPa"
density = 7850
supports = [{ at = 0.2, stiffness = 2.0e8, rotational = 1.0, damping = 3.0 }, { at = 14.9, stiffness = "200 kN/mm" }]
damping_ratio = 0.02
modes = 12
own_weight = true
fibre_distance = 0.1

[carriage.table]
on = "bed"
kind = "mass"
mass = 100.0
delay = 0.5

[carriage.table.motion]
kind = "out-and-back"
start = 7.5
end = 14.7
speed = 5.0
turn = 0.1
cycles = 3

[carriage.load]
on = "bed"
kind = "force"
force = 1000.0
headway = 2.0

[carriage.load.motion]
kind = "cruise"
start = -1.0
end = 16.0
speed = "20 km/h"
after = 2

[carriage.probe]
on = "bed"
kind = "force"
force = -5

[carriage.probe.motion]
kind = "sinusoidal"
centre = 7.5
amplitude = 7.0
frequency = 0.5
cycles = 2

[carriage.gripper]
on = "bed"
kind = "mass"
mass = 10.0

[carriage.gripper.motion]
kind = "waypoints"
times = [0.0, 1.0, 3.0]
positions = [1.0, 7.0, 5.0]

[sensor.midspan]
body = "bed"
at = 7.5
quantity = "displacement"

[sensor.table_moment]
under = "table"
quantity = "bending_moment"

[sweep]
speed = { of = "carriage.table.motion.speed", from = 0.5, to = 10.0, count = 40, spacing = "log" }
mass = { of = ["carriage.table.mass", "carriage.gripper.mass"], values = [50, "0.1 t", 200, 400] }

[solver]
scheme = "newmark"
beta = 0.25
gamma = 0.5
fidelity = "auto"
steps = 500
tolerance = 1e-3
static_correction = true
audit = 0

[output]
histories = { every = 10 }
"""

MINIMAL = """\
schema_version = 1
kind = "passage"
[body.bed]
kind = "beam"
length = 15.0
area = 0.01
second_moment = 8.33e-6
youngs_modulus = 2.1e11
density = 7850.0
supports = "pinned-pinned"
[carriage.table]
on = "bed"
kind = "mass"
mass = 100.0
motion = { kind = "cruise", start = 0.0, end = 15.0, speed = 5.0 }
[sensor.midspan]
body = "bed"
at = 7.5
"""
