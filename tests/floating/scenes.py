"""Small scenes with frames that move, and their marches with fixed steps."""

from pathlib import Path
from types import ModuleType

import numpy as np

from engine.floating.march import Marched, march
from engine.floating.model import FloatingModel, build
from engine.kernels.floating.layout import Weights
from engine.scene.study import Study
from engine.scene.variants import VariantValues

AVERAGE_ACCELERATION = Weights(0.25, 0.5, 0.0, 0.0)
FOX_GOODWIN = Weights(1.0 / 12.0, 0.5, 0.0, 0.0)

PAPER_BEAM = {
    "kind": "beam",
    "length": 15.0,
    "area": 0.01,
    "second_moment": 8.33e-6,
    "youngs_modulus": 2.1e11,
    "density": 7850.0,
    "supports": "pinned-pinned",
    "damping_ratio": 0.02,
    "modes": 1,
    "own_weight": True,
}
ARM = {
    "kind": "beam",
    "length": 10.0,
    "area": 4e-4,
    "second_moment": 2e-7,
    "youngs_modulus": 7e10,
    "density": 3000.0,
    "supports": "clamped-free",
    "modes": 6,
}
FLYER = {
    "kind": "beam",
    "length": 10.0,
    "area": 4e-3,
    "second_moment": 2e-5,
    "youngs_modulus": 7e9,
    "density": 3000.0,
    "supports": "free-free",
    "modes": 3,
}
SPIN_UP = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "spin-up", "rate": 6.0, "time": 15.0}}


def sliding_mass(**beam: object) -> Study:
    """Section 2.3 of Hartweg and Heckmann (2012)."""
    return Study(
        kind="moving-frames",
        gravity=9.81,
        body={"beam": PAPER_BEAM | beam},
        carriage={"load": {"kind": "mass", "on": "beam", "mass": 100.0, "motion": {"kind": "free", "start": 2.0}}},
        question={"duration": 60.0},
    )


def steps(
    study: Study, duration: float, count: int, every: int = 1, scheme: Weights = AVERAGE_ACCELERATION
) -> tuple[FloatingModel, Marched]:
    """The march of a study of one variant."""
    model = build(study)
    stations = np.arange(0, count + 1, every)
    return model, march(model, VariantValues(study, {}, 1), np.array([duration]), count, stations, scheme)


def history(model: FloatingModel, marched: Marched, group: str, first: int = 0, count: int = 1) -> np.ndarray:
    """(stations, count) signals of a group."""
    start = model.signal_of(group) + first
    return marched.history[0, :, start : start + count]


def largest_drift(study: Study, count: int) -> float:
    """Of energy and of both momenta of everything that flies over 1 s, as parts of what they begin with."""
    model, marched = steps(study, 1.0, count, 40)
    energy = history(model, marched, "whole", 0, 2).sum(axis=1)
    momentum = history(model, marched, "whole", 2, 6)
    size = np.repeat([np.abs(momentum[0, :3]).max(), np.abs(momentum[0, 3:]).max()], 3)
    return float(max(np.ptp(energy) / energy[0], (np.ptp(momentum, axis=0) / size).max()))


def mutated(module: ModuleType, old: str, new: str, *below: ModuleType) -> ModuleType:
    """A module of kernels that are not compiled, with another text; below: modules that it takes functions from, each
    after those that it needs, in one of which the text may stand instead."""
    changed: dict[str, object] = {}
    for one in (*below, module):
        source = Path(str(one.__file__)).read_text(encoding="utf-8")
        found = ModuleType("mutated")
        exec(compile(source.replace(old, new), "mutated", "exec"), found.__dict__)
        found.__dict__.update({name: changed[name] for name in changed.keys() & one.__dict__.keys()})
        own = [name for name, value in one.__dict__.items() if getattr(value, "__module__", "") == one.__name__]
        if old in source or any(name in changed for name in one.__dict__):
            changed |= {name: found.__dict__[name] for name in own}
    assert changed, old
    return found


def given_arm(scale: float = 1.0, curved: bool = False) -> Study:
    """An arm in space on two driven joints, with a mass and an oscillator on given ways, and loads; curved: with
    stiffening, a mode along it and torques. scale: of all motions and loads, without gravity where not 1."""
    swing = {"kind": "swing", "amplitude": 0.3 * scale, "frequency": 0.7}
    shake = {"kind": "swing", "amplitude": 0.05 * scale, "frequency": 1.3}
    push = {"on": "arm", "force": [3.0 * scale, 2.0 * scale, -4.0 * scale], "axes": "body"}
    torque = {"torque": [30.0 * scale, -60.0 * scale, -70.0 * scale]} if curved else {}
    ways = (
        {"kind": "waypoints", "times": [0, 1, 2], "positions": [1, 6, 3]},
        {"kind": "waypoints", "times": [0, 2], "positions": [2, 8]},
    )
    return Study(
        kind="moving-frames",
        gravity=9.81 if scale == 1.0 else 0.0,
        body={"arm": ARM | {"own_weight": True, "modes": 3, "damping_ratio": 0.01, "second_moment": 2e-6}},
        frame={
            "arm": {
                "lateral_second_moment": 3e-6,
                "lateral_modes": 2,
                "axial_modes": int(curved),
                "stiffening": curved,
                "turned": [0.1, -0.2, 0.3],
                "position": [0.1, 0.2, 0.3],
                "joints": [
                    {"kind": "revolute", "axis": [0.2, 1.0, 0.3], "motion": swing},
                    {"kind": "prismatic", "axis": [0.3, 0.1, 1.0], "motion": shake},
                ],
            }
        },
        carriage={
            "load": {"kind": "mass", "on": "arm", "mass": 2.0, "motion": ways[0]},
            "cart": {
                "kind": "oscillator",
                "on": "arm",
                "mass": 1.5,
                "wheel_mass": 0.2,
                "stiffness": 300.0,
                "damping": 4.0,
                "motion": ways[1],
            },
        },
        load={"wind": {"on": "arm", "between": [2, 8], "force_per_metre": [0, 0.2 * scale, 0]}, "push": push | torque},
        sensor={"tip": {"body": "arm", "at": 10.0}},
        question={"duration": 2.0},
    )
