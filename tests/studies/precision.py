"""A small study of work and precision, run once for all tests that look at it."""

from functools import lru_cache

import xarray as xr

import engine
import studies

SCHEMES = ("average-acceleration", "fox-goodwin", "richardson", "lagged-inertia", "lagged-convective")
TEXT = f"""\
schema_version = 1
title = "small"
kind = "work-precision"

[body.bed]
kind = "beam"
length = 10.0
area = 0.01
second_moment = 8e-6
youngs_modulus = "210 GPa"
density = 7850
supports = "pinned-pinned"
damping_ratio = 0.03
modes = 2

[carriage.table]
on = "bed"
kind = "mass"
mass = 50.0
motion = {{ kind = "cruise", start = 0.0, end = 10.0, speed = 15.0 }}

[sensor.midspan]
body = "bed"
at = 5.0

[sensor.moment]
under = "table"
quantity = "bending_moment"

[question]
schemes = [{", ".join(f'"{scheme}"' for scheme in SCHEMES)}]
step_counts = [8, 40, 80, 160, 320, 640]
mode_counts = [1, 2]
reference_modes = 6
tolerances = [1e-2, 1e-1]

[question.scenes.light]

[question.scenes."heavy and slow"]
"carriage.table.mass" = 1500.0
"carriage.table.motion.speed" = 5.0
"""


@lru_cache(maxsize=1)
def small() -> xr.Dataset:
    """Its dataset."""
    return studies.run(engine.load(TEXT), threads=1)


def with_question(lines: str) -> str:
    """The study with other lines in the table [question]."""
    return f"{TEXT.partition('[question]')[0]}[question]\n{lines}\n"
