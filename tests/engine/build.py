"""Studies for the tests of the engine, from a few words."""

from collections.abc import Mapping
from typing import Any

from engine.model.timeline import build_timeline
from engine.scene.study import Study
from engine.unreduced.march import Course
from engine.unreduced.scene import Unreduced

Table = dict[str, Any]


def beam(**changes: Any) -> Table:
    """A beam with L = E I = rho A = 1, pinned, four modes, undamped; `changes` replace keys."""
    numbers = dict.fromkeys(("length", "area", "second_moment", "youngs_modulus", "density"), 1.0)
    return {"kind": "beam", **numbers, "supports": "pinned-pinned", "modes": 4} | changes


def steel(length: float, **changes: Any) -> Table:
    """A pinned steel beam of a length in m; `changes` replace keys."""
    table: Table = {"area": 0.01, "second_moment": 8.33e-6, "youngs_modulus": 2.1e11, "density": 7850.0}
    return {"kind": "beam", "length": length, "supports": "pinned-pinned"} | table | changes


def cruise(start: float, end: float, speed: float, after: float = 0.0) -> Table:
    """A motion at constant speed."""
    return {"kind": "cruise", "start": start, "end": end, "speed": speed, "after": after}


def shuttle(start: float, end: float, speed: float, turn: float, cycles: int) -> Table:
    """An out-and-back motion."""
    return {"kind": "out-and-back", "start": start, "end": end, "speed": speed, "turn": turn, "cycles": cycles}


def swing(centre: float, amplitude: float, frequency: float, cycles: int) -> Table:
    """A sinusoidal motion."""
    law = {"centre": centre, "amplitude": amplitude, "frequency": frequency}
    return {"kind": "sinusoidal", **law, "cycles": cycles}


def mass(kilograms: float, motion: Table, **changes: Any) -> Table:
    """A rigid mass on the bed."""
    return {"on": "bed", "kind": "mass", "mass": kilograms, "motion": motion} | changes


def force(newtons: float, motion: Table, **changes: Any) -> Table:
    """A moving force on the bed."""
    return {"on": "bed", "kind": "force", "force": newtons, "motion": motion} | changes


def oscillator(kilograms: float, stiffness: float, motion: Table, **changes: Any) -> Table:
    """A sprung mass on the bed."""
    return {"on": "bed", "kind": "oscillator", "mass": kilograms, "stiffness": stiffness, "motion": motion} | changes


def fixed(at: float, quantity: str = "displacement", body: str = "bed") -> Table:
    """A sensor at a place."""
    return {"body": body, "at": at, "quantity": quantity}


def under(carriage: str, quantity: str = "displacement") -> Table:
    """A sensor at the point that a carriage touches."""
    return {"under": carriage, "quantity": quantity}


def aboard(carriage: str, quantity: str = "displacement") -> Table:
    """A sensor of a carriage's sprung mass."""
    return {"carriage": carriage, "quantity": quantity}


def study(bed: Table, carriages: Table | Mapping[str, Table], **changes: Any) -> Study:
    """A study of one bed (or of `body` among the changes) with carriages by name, or one carriage called "car"."""
    riding = {"car": carriages} if "kind" in carriages else dict(carriages)
    tables: Table = {
        "schema_version": 1,
        "kind": "passage",
        "gravity": 9.81,
        "body": {"bed": bed},
        "carriage": riding,
        "sensor": {"midspan": fixed(0.5 * bed["length"])},
        "output": {"histories": "none"},
    }
    return Study(**(tables | changes))


def study_of_steps(bed: Table, carriages: Table | Mapping[str, Table], **changes: Any) -> Study:
    """The same for tests that ask for no errors: one march with fixed steps, which has all terms whatever the
    tolerance, so loosely that the first reference will do."""
    solver = changes.get("solver", {})
    if "steps" in solver and "sweep" not in changes:
        changes["solver"] = {"tolerance": 0.5} | solver
    return study(bed, carriages, **changes)


def course_of(model: Unreduced, steps: int) -> Course:
    """The whole way of a study's carriages in so many steps per passage or cycle; no free vibration afterwards."""
    timeline = build_timeline(model.riders, steps, "whole")
    return Course(timeline, model.study.carriage[model.study.clock].motion.time_scale)
