"""Sweeps for whose variants something is chosen."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from engine.accuracy.choice import Choice
from engine.accuracy.reference import Marches, converge, in_full
from engine.accuracy.results import differences, results_of
from engine.batch.execution import execute
from engine.batch.executors import Shared, Threads
from engine.batch.plan import Plan, make_plan
from engine.bodies.modal.description import MAX_MODES
from engine.march.outcome import Flat
from engine.scene.study import Study
from results_schema.arrays import Array
from results_schema.store.rows import Collector
from tests.accuracy.passages import OPEN, SPEED, WEIGHT, axis, passages
from tests.engine.build import Table, aboard, beam, cruise, fixed, oscillator, steel, study

TOLERANCE = "solver.tolerance"
LENGTHS = {"length": {"of": "body.bed.length", "values": [1.0, 1.1, 1.2]}}
SPEEDS = {"speed": axis(SPEED, 0.3, 1.2, 30)}
WEIGHTS = {"weight": {"of": WEIGHT, "values": [0.05, 0.15, 0.25]}}
ALL_FIXED = {"steps": 200, "scheme": "fox-goodwin", "fidelity": "full"}


def sweep(tolerance: float = 1e-2, **changes: Any) -> Study:
    """300 passages."""
    return passages(20, 15, **({"solver": {"tolerance": tolerance}} | changes))


def midspan(tolerance: float | str) -> Table:
    """One sensor with a tolerance of its own."""
    return {"midspan": fixed(0.5) | {"tolerance": tolerance}}


STUDIES: dict[str, Study] = {
    "passages": sweep(),
    "tight": sweep(2e-3),
    "wide": sweep(5e-2),
    "swept tolerance": sweep(sweep=SPEEDS | WEIGHTS | {"wanted": {"of": TOLERANCE, "values": [2e-4, 2e-3, 5e-2]}}),
    "more modes than its steps need": sweep(1e-3, bed=beam(modes=MAX_MODES, damping_ratio=0.02)),
    "numbers of modes": sweep(
        bed=OPEN,
        sweep=SPEEDS | WEIGHTS | {"kept": {"of": "body.bed.modes", "values": [4, 8, MAX_MODES]}},
    ),
    "stiffnesses": study(
        steel(15.0, second_moment=8.33e-5, damping_ratio=0.02, modes="auto"),
        oscillator(100.0, 2e4, cruise(0.0, 15.0, 8.0, after=2.0), damping=150.0, wheel_mass=15.0),
        sensor={"midspan": fixed(7.5), "aboard": aboard("car")},
        sweep={
            "stiffness": axis("carriage.car.stiffness", 1e3, 1e8, 20) | {"spacing": "log"},
            "speed": axis(SPEED, 2.0, 30.0, 20),
        },
    ),
    "lengths": sweep(sweep=LENGTHS | SPEEDS | WEIGHTS, sensor={"quarter": fixed(0.25)}),
    "told only": sweep(sensor=midspan("told")),
    "told only, out of reach": sweep(1e-9, sensor=midspan("told"), bed=beam(modes=3)),
    "own tolerance": sweep(sensor=midspan(5e-2)),
    "own tolerance, others swept": sweep(
        sweep=SPEEDS | WEIGHTS | {"wanted": {"of": TOLERANCE, "values": [1e-2, 3e-2, 1e-1]}},
        sensor=midspan(2e-3) | {"quarter": fixed(0.25)},
    ),
    "all is fixed": sweep(bed=beam(modes=3), solver=ALL_FIXED),
}


PILOTS = 48  # fewer than usual, so that sweeps of some hundred variants are quick


def chosen_plan(given: Study, threads: int = 2) -> Plan:
    """The plan of a sweep with what is chosen for it."""
    plan = make_plan(given)
    assert not plan.converges
    plan.choose(Shared(Threads(threads)), PILOTS)
    return plan


class Run(NamedTuple):
    """What a run of a sweep found, by the names of the archive (V, ...)."""

    plan: Plan
    arrays: Flat

    @property
    def choice(self) -> Choice:
        assert self.plan.choice is not None
        return self.plan.choice

    def told(self, name: str) -> Array:
        """(V,) the error told of a result."""
        names = [result.name for result in results_of(self.plan.asked)]
        return np.asarray(self.arrays["estimated_error"][:, names.index(name)], dtype=np.float64)


def executed(given: Study, chunk: int | None = None, threads: int = 2) -> Run:
    """Run a sweep."""
    plan = chosen_plan(given, threads)
    collector = Collector(plan.size)
    execute(plan, collector.add, Threads(threads), chunk=chunk)
    return Run(plan, collector.arrays)


@cache
def run_of(name: str) -> Run:
    """The run of one of the sweeps above."""
    return executed(STUDIES[name])


@cache
def observed(name: str) -> Array:
    """(R, V) how far the results of such a sweep are off."""
    run = run_of(name)
    found = np.full((len(results_of(run.plan.asked)), run.plan.size), np.nan)
    for group in run.plan.groups:
        values = run.plan.values(group, group.variants)
        own = group.found(values, group.variants, run.choice, lambda: False, "histories").outcome
        truth = converge(Marches(group.grid, values, in_full(group.grid)), 0.01)
        found[:, group.variants] = differences(run.plan.asked, group.scene, values, own, truth.outcome)
    return found
