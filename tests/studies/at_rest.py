"""Small studies of the kinds that compute a scene at rest."""

from functools import lru_cache

import xarray as xr

import engine
import studies
from engine.scene.study import Study

KINDS = ("eigenfrequencies", "influence")
MASS = 'mass = { of = "carriage.car.mass", values = [20.0, 50.0] }'
TABLE = """\
[body.table]
kind = "beam"
length = 1.0
area = 0.01
second_moment = 1e-5
youngs_modulus = "210 GPa"
density = 7850
supports = "free-free"
modes = 6

[carriage.car]
on = "bed"
kind = "body"
body = "table"
contacts.rear = { at = 0.2, stiffness = 1e7 }
contacts.middle = { at = 0.5, stiffness = 1e7 }
contacts.front = { at = 0.9, stiffness = 2e7 }
"""
CAR = """\
[carriage.car]
on = "bed"
kind = "mass"
mass = 40.0
"""

#: A girder on two columns; its lowest mode sways out of its plane, the next one in it.
PORTAL = {
    "kind": "frame",
    "node": {"foot": [0, 0, 0], "left": [0, 0, 2], "right": [4, 0, 2], "end": [4, 0, 0]},
    "section": {
        "box": {
            "area": 0.02,
            "second_moment": 6e-4,
            "second_moment_lateral": 5e-4,
            "torsion_constant": 9e-4,
            "youngs_modulus": 2.1e11,
            "shear_modulus": 8.1e10,
            "density": 7850.0,
        }
    },
    "member": {
        "column": {"nodes": ["foot", "left"], "section": "box", "up": [1, 0, 0], "elements": 2},
        "girder": {"nodes": ["left", "right"], "section": "box", "elements": 4},
        "other": {"nodes": ["right", "end"], "section": "box", "up": [1, 0, 0], "elements": 2},
    },
    "supports": {"foot": "clamped", "end": "clamped"},
    "track": {"members": ["girder"]},
}


def text_of(kind: str, question: str = "positions = 5", sweep: str = "", carriage: str = CAR) -> str:
    """A study file of a pinned beam of 4 m; question, sweep: lines of their tables."""
    return f"""\
schema_version = 1
title = "at rest"
kind = "{kind}"

[question]
{question}

[body.bed]
kind = "beam"
length = 4.0
area = 0.01
second_moment = 8e-6
youngs_modulus = "210 GPa"
density = 7850
supports = "pinned-pinned"
modes = 10
own_weight = true

{carriage}
[carriage.car.motion]
kind = "cruise"
start = 1.0
end = 3.0
speed = 1.0

[sensor.middle]
body = "bed"
at = 2.0

[sensor.moment]
under = "car"
quantity = "bending_moment"

{f"[sweep]{chr(10)}{sweep}" if sweep else ""}
"""


def study(kind: str, question: str = "positions = 5", sweep: str = "", carriage: str = CAR) -> Study:
    return engine.load(text_of(kind, question, sweep, carriage))


@lru_cache(maxsize=16)
def run(kind: str, question: str = "positions = 5", sweep: str = "", carriage: str = CAR) -> xr.Dataset:
    return studies.run(study(kind, question, sweep, carriage))
