"""Small scenes of robots on rails."""

from typing import Any

import numpy as np

from engine.kernels.layout import Newmark
from engine.kernels.robots.layout import Record
from engine.robots.march import march, stretches
from engine.robots.model import RobotModel, build
from engine.scene.study import Study

AVERAGE_ACCELERATION, FOX_GOODWIN = Newmark(0.25, 0.5), Newmark(1 / 12, 0.5)


def rail(y: float, modes: int = 6, stiffer: float = 1.0, elements: int = 8) -> dict[str, Any]:
    """A beam of 12 m on springs at both ends, at a place across."""
    spring = {"stiffness": [4e6 * stiffer, 4e6 * stiffer, 2e8 * stiffer], "rotational": [2e7, 5e6, 5e6]}
    return {
        "kind": "frame",
        "node": {"west": [0, y, 5], "east": [12, y, 5]},
        "section": {
            "box": {
                "area": 0.03,
                "second_moment": 1e-3,
                "second_moment_lateral": 5e-4,
                "torsion_constant": 6e-4,
                "youngs_modulus": 2.1e11 * stiffer,
                "poissons_ratio": 0.3,
                "density": 7850,
            }
        },
        "member": {"beam": {"nodes": ["west", "east"], "section": "box", "elements": elements}},
        "spring": {end: {"node": end, **spring} for end in ("west", "east")},
        "track": {"members": ["beam"]},
        "damping_ratio": 0.02,
        "modes": modes,
    }


def drive(stiffness: float | None = None, damping: float = 0.0) -> dict[str, Any]:
    """A drive, rigid unless a stiffness is given."""
    soft = {} if stiffness is None else {"stiffness": stiffness, "damping": damping}
    return {"speed": 1.5, "acceleration": 2.0, "jerk": 10.0, **soft}


GANTRY = {
    "mass": 900.0,
    "centre": [0.1, 0.2, -0.1],
    "inertia": [900, 400, 1000],
    "rail": drive(8e6, 3e4),
    "tool": [0.05, 0, -0.3],
    "links": [
        {"kind": "prismatic", "axis": [0, 1, 0], "mass": 250, "inertia": [20, 20, 20], **drive(6e6, 2e4)},
        {"kind": "prismatic", "axis": [0, 0, 2], "mass": 120, "centre": [0, 0, -1], "inertia": [40, 40, 2], **drive()},
        {
            "kind": "revolute",
            "axis": [0, 1, 1],
            "place": [0.1, 0, -2],
            "turned": [0.3, 0, 0.2],
            "mass": 60,
            "centre": [0.2, 0.1, -0.3],
            "inertia": [3, 2, 2.5],
            **drive(3e5, 800),
        },
        {"kind": "revolute", "axis": [1, 0, 0], "place": [0, 0, -0.5], "mass": 25, "inertia": [1, 0.5, 0.8], **drive()},
    ],
}
ARM = {
    "mass": 200.0,
    "inertia": [20, 30, 30],
    "rail": drive(),
    "tool": [0.1, 0, -0.2],
    "links": [
        {
            "kind": "revolute",
            "axis": [0, 0, -1],
            "place": [0, 0, -0.4],
            "mass": 90,
            "centre": [0.1, 0, -0.2],
            "inertia": [4, 5, 3],
            **drive(8e5, 4e3),
        },
        {
            "kind": "revolute",
            "axis": [0, 1, 0],
            "place": [0.3, 0, -0.3],
            "mass": 60,
            "centre": [0, 0, -0.5],
            "inertia": [6, 6, 1],
            **drive(8e5, 4e3),
        },
    ],
}
MOVES = [
    {"to": [7.0, 1.0, -0.8, 0.6, 0.4], "hold": 0.3, "process": True},
    {"to": [4.0, -1.0, 0.0, -0.4, -0.5], "payload": 80.0, "hold": 0.2},
    {"to": [5.0, 0.0, 0.2, 0.0, 0.0], "payload": 10.0, "hold": 0.2},
]


def scene(rail_more: dict[str, Any] | None = None, **more: Any) -> Study:
    """A gantry on two rails, and an arm that hangs beside one of them."""
    tables: dict[str, Any] = {
        "kind": "portal",
        "gravity": 9.81,
        "body": {name: rail(y, **(rail_more or {})) for name, y in (("left", -3.0), ("right", 3.0))},
        "arm": {"gantry": GANTRY, "swinger": ARM},
        "robot": {
            "portal": {
                "arm": "gantry",
                "rails": ["left", "right"],
                "offset": [0.1, 0.4, 0.5],
                "start": [3.0, 0.0, 0.0, 0.0, 0.0],
                "moves": MOVES,
            },
            "hanging": {
                "arm": "swinger",
                "rails": ["right"],
                "offset": [0.2, -0.3, -0.4],
                "start": [9.0, 0.0, 0.0],
                "delay": 0.4,
                "moves": [{"to": [6.0, 1.2, 0.7]}, {"to": [8.0, -0.5, 0.0]}],
            },
        },
    }
    return Study(**(tables | more))


def marched(
    study: Study,
    step: float,
    duration: float | None = None,
    every: int = 1,
    scheme: Newmark = AVERAGE_ACCELERATION,
) -> tuple[RobotModel, Record]:
    """A scene marched with a step (s)."""
    model = build(study)
    until = float(model.done.max()) + 0.5 if duration is None else duration
    return model, march(model, stretches(model, until, step, every), scheme)[0]


def errors(record: Record) -> np.ndarray:
    """(S, R, 3) of tool centre points."""
    return np.asarray(record.robots[:, :, 3:6] - record.robots[:, :, :3])
