"""What part of a difference between two marches their errors are: by marches of many times the steps and modes.

Every coefficient is used and then made half of itself: the estimates hold with it and not without.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import engine.estimates as estimates
import engine.improving as improving
from engine.choice import AIM
from engine.execution import run
from engine.scene import Study
from tests.engine.build import Table, beam, cruise, fixed, force, mass, study

Array = NDArray[np.float64]

STATIONS = 200


def crossing(bed: Table, carriage: Table, speeds: Array, steps: int, **changes: Any) -> Study:
    """A study of all speeds with fixed steps, read in the middle or as ``sensor`` says, by one scheme."""
    swept = {"speed": {"of": "carriage.car.motion.speed", "values": speeds.tolist()}}
    solver = {"scheme": "average-acceleration", "fidelity": "full", "steps": steps, "audit": 0}
    return study(bed, carriage, sweep=swept, solver=solver, **changes)


def extremes(found: Any) -> Array:
    """(V, 2) largest and smallest value of the sensor over its largest static one."""
    return np.stack([found[f"read_{end}"].values / found.read_static.values for end in ("max", "min")], axis=1)


def halved(monkeypatch: pytest.MonkeyPatch, coefficient: str) -> None:
    monkeypatch.setattr(estimates, coefficient, 0.5 * getattr(estimates, coefficient))


def of_steps(bed: Table, carriage: Table, speeds: Array, steps: int) -> Array:
    """(V,) what is told of so many steps, over what extremes miss beside those of eight times as many."""
    found, fine = (
        run(crossing(bed, carriage, speeds, many, sensor={"read": fixed(0.5)}), threads=1)
        for many in (steps, 8 * steps)
    )
    truth = np.max(np.abs(extremes(found) - extremes(fine)), axis=1)
    assert truth.min() > 0.0
    return np.asarray(found.error_steps.values / truth)


def test_extremes_may_agree_by_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 96 speeds some have two marches whose extremes hardly differ, and both are wrong: there a part of what their
    histories differ by tells of it."""
    bed, carriage = beam(damping_ratio=0.01), mass(0.2, cruise(0.0, 1.0, 1.0))
    speeds = np.geomspace(0.15, 1.2, 96)
    told = of_steps(bed, carriage, speeds, 800)
    assert told.min() > 0.8 and np.median(told) < 4.0
    halved(monkeypatch, "HISTORY_PART")
    fewer = of_steps(bed, carriage, speeds, 800)
    assert fewer.min() < 0.65 and np.sum(fewer < 0.9) >= 6
    monkeypatch.setattr(estimates, "RESOLVED", np.inf)  # lost phases, which ask for more by themselves, left alone
    halved(monkeypatch, "HISTORY_PART")
    fewest = of_steps(bed, carriage, speeds, 800)
    assert fewest.min() < 0.35 and np.sum(fewest < 0.5) >= 4


def test_a_march_that_has_lost_the_phase_tells_nothing_of_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ringing that lasts: of what separates 1,600 steps from 800 more than a third is missed where the 800 have turned
    it out of phase, though the 1,600 have not."""
    bed, carriage = beam(damping_ratio=0.002), mass(0.05, cruise(0.0, 1.0, 1.0))
    speeds = np.geomspace(0.05, 0.4, 96)
    assert of_steps(bed, carriage, speeds, 1600).min() > 1.0
    monkeypatch.setattr(estimates, "RESOLVED", 4.0 * estimates.RESOLVED)  # of the finer one instead
    assert of_steps(bed, carriage, speeds, 1600).min() < 0.6


def of_modes(carriage: Table, sensor: Mapping[str, Any], speeds: Array) -> Array:
    """(V,) what is told of the modes that are chosen for every speed, over what their histories miss."""
    output: Table = {"histories": {"every": 3200 // STATIONS}}
    loose = {"solver.tolerance": 1e-3 / AIM}
    few, many = (
        run(
            crossing(beam(modes=modes), carriage, speeds, 3200, sensor=sensor, output=output).with_values(loose),
            threads=1,
        )
        for modes in ("auto", 24)
    )
    assert few.modes_used.values.max() <= 12
    off = np.max(np.abs(few.read.values - many.read.values), axis=1) / many.read_static.values
    found = few.error_modes.values / off
    assert np.isfinite(found).all()
    return np.asarray(found)


LOADS: dict[str, tuple[Table, Table, Array]] = {
    "DOUBTED": (force(2.0, cruise(0.2, 0.8, 1.0)), fixed(0.3), np.geomspace(0.05, 1.0, 24)),
    "COUPLED_PART": (mass(0.3, cruise(0.0, 1.0, 1.0)), fixed(0.4, "bending_moment"), np.geomspace(0.05, 0.5, 24)),
}


@pytest.mark.parametrize("coefficient", LOADS)
def test_what_modes_miss_of_a_difference(coefficient: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A force that sets off on the beam, whose modes miss what was told beforehand; and a mass, which couples them."""
    carriage, sensor, speeds = LOADS[coefficient]
    monkeypatch.setattr(estimates, "HISTORY_PART", 1.0)  # histories are compared here, and no extremes
    monkeypatch.setattr(improving, "ROUNDS", 0)  # and what was chosen first
    told = of_modes(carriage, {"read": sensor}, speeds)
    assert told.min() >= 1.0 and np.median(told) < 4.0
    halved(monkeypatch, coefficient)
    fewer = of_modes(carriage, {"read": sensor}, speeds)
    assert fewer.min() < 0.8 and np.mean(fewer < 0.95) > 0.3
