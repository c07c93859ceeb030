"""Marches with more and more steps, and modes of rails where these are open, until what they report stays where it
is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.accuracy.reference import left_over
from engine.kernels.layout import Newmark
from engine.kernels.schemes import NewmarkScheme
from engine.march.stepper import Halted
from engine.robots.march import march, rest, stretches
from engine.robots.model import build
from engine.robots.results import beyond_rest, differences, outcome
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.status import Status
from results_schema.statuses import gravest

if TYPE_CHECKING:
    from engine.robots.model import RobotModel
    from engine.robots.results import Outcome
    from engine.scene.study import Study

#: Steps per first period of the rails on the coarsest level, and modes of each rail where these are open; both double.
FIRST_STEPS, FIRST_MODES = 16, 6
LEVELS, MOST_MODES, MOST_STEPS = 7, 64, 2_000_000
ENOUGH = 0.5  # of the tolerance, as in marches of bodies that stand


class Level(NamedTuple):
    """A model, the longest step (s), and how many steps there are between stations."""

    model: RobotModel
    step: float
    every: int


@dataclass(frozen=True, eq=False)
class Converged:
    """What a variant reports: its outcome with the model, the error of every result, steps, status."""

    model: RobotModel
    outcome: Outcome
    error: Array
    steps: int
    status: Status


def scheme_of(study: Study) -> NewmarkScheme:
    """The scheme of the march: of Newmark's family, without a limit of its steps, as joints are stiff. Raises
    BadInput."""
    scheme = study.solver.integration
    if isinstance(scheme, NewmarkScheme) and scheme.stride == 1 and np.isinf(scheme.stability_limit):
        return scheme
    raise BadInput(
        "this scheme does not march robots",
        where=study.source.where("solver.scheme"),
        expected="auto, average-acceleration, or newmark with beta >= 1/4 (gamma + 1/2)^2",
        received=study.solver.scheme,
    )


def with_open_modes(study: Study, count: int) -> Study:
    """The study with so many modes of all bodies whose number is open."""
    is_open = [name for name, body in study.body.items() if body.modes == "auto"]
    return study.with_values({f"body.{name}.modes": min(count, MOST_MODES) for name in is_open}) if is_open else study


def levels(study: Study, duration: float) -> Iterator[Level]:
    """Coarse to fine, for a time (s)."""
    is_open = any(body.modes == "auto" for body in study.body.values())
    model, fixed = build(with_open_modes(study, FIRST_MODES)), study.solver.steps
    step = 2.0 * np.pi / model.first_omega / FIRST_STEPS if fixed == "auto" else duration / int(fixed)
    for level in range(LEVELS if fixed == "auto" else 2):
        modes = FIRST_MODES * 2**level
        if duration / step * 2**level > MOST_STEPS or (is_open and modes > MOST_MODES):
            return
        yield Level(build(with_open_modes(study, modes)) if is_open and level else model, step / 2**level, 2**level)


def converge(
    study: Study, duration: float | None, after: float, zero: str, halted: Callable[[], bool] = lambda: False
) -> Converged:
    """March a study without sweep level by level, for a duration (s), or until all is done and some time ``after``.
    Raises Halted."""
    scheme, tolerance = scheme_of(study), study.solver.tolerance
    coefficients = Newmark(scheme.beta, scheme.gamma)
    until = build(with_open_modes(study, FIRST_MODES)).done.max() + after if duration is None else duration
    found: Converged | None = None
    change = np.zeros(0)
    for model, step, every in levels(study, until):
        if halted():
            raise Halted
        times = stretches(model, until, step, every)
        record, status = march(model, times, coefficients)
        now, steps = outcome(model, record, status, zero), int(times.steps.sum())
        if found is None:
            change = np.full(len(model.robots) + len(model.rails), np.nan)
            found = Converged(model, now, change, steps, Status.UNRESOLVED)
            continue
        apart = differences(model, found.outcome, now)
        error = left_over(apart, change)
        change = apart
        known = bool(np.isfinite(error).all())
        held = known and bool(error.max() <= tolerance)
        judged = Status.OK if held else Status.TOLERANCE_MISSED if known else Status.UNRESOLVED
        found = Converged(model, now, error, steps, Status(int(gravest(judged, now.status))))
        if known and error.max() <= ENOUGH * tolerance:
            break
    assert found is not None
    resting, status = rest(model, times)
    whole = Status(int(gravest(found.status, status)))
    return replace(found, outcome=beyond_rest(found.outcome, record, resting), status=whole)
