"""Variants of robots that missed their tolerance: which result, by how much, when, and what helps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from results_schema.status import Status, label
from studies.findings.absolute_errors import OF_TOOLS, absolute_errors
from studies.results.findings_common import in_words
from studies.results.formatting import counted, listed, percent, quantity
from studies.results.places import Index

if TYPE_CHECKING:
    from engine.robots.model import RobotModel
    from studies.results.results import Results

MOST_NAMED = 3
SOON = 10.0  # first periods of the rails after a payload is picked up, in which it may be what is seen


class _Missed(NamedTuple):
    """A result beyond its tolerance where it is the furthest: its error over its largest value, and when (s)."""

    name: str
    at: Index
    error: float
    time: float


def told_missed(results: Results) -> Iterator[str]:
    """Which results missed the tolerance in which variants, and what helps; nothing where none did."""
    missed = results.dataset["status"].values == int(Status.TOLERANCE_MISSED)
    each = list(_missed(results, missed))[:MOST_NAMED]
    found, doubted = [worst for worst, *_ in each], [one for variants in each for one in variants]
    if not found:
        return
    asked, variants = percent(results.study.solver.tolerance), counted(results.size, "variant")
    parts = listed([_in_words(results, one) for one in found])
    struck = dict.fromkeys(text for one in doubted for text in _picked_up(model_of(results, one.at), one.time))
    fixed = [] if results.study.solver.steps == "auto" else ['What helps: more solver.steps, or "auto".']
    helps = " ".join([*fixed, *struck]) or _refined(results, found[0].at)
    said = f"In {int(missed.sum()):,} of {variants} the tolerance of {asked} is missed by {parts}"
    yield f"{said}; they are {label(Status.TOLERANCE_MISSED)}, with values kept. {helps}"


def _missed(results: Results, among: np.ndarray) -> Iterator[list[_Missed]]:
    """Of each result that missed it the variants that are the furthest off, which need not be so by what struck."""
    times, asked = results.dataset["estimated_error_time"], results.dataset["tolerance"]
    for name in map(str, results.dataset["result"].values[np.isfinite(asked.values)]):
        error = np.where(among, results.estimated_error(name), np.nan)
        worst = [
            _Missed(name, at, float(error[at]), float(times.sel(result=name).transpose(*results.dims).values[at]))
            for at in (np.unravel_index(flat, error.shape) for flat in np.argsort(-error, axis=None)[:MOST_NAMED])
            if error[at] > results.study.solver.tolerance
        ]
        if worst:
            yield worst


def _in_words(results: Results, one: _Missed) -> str:
    """The result, how far it may be off, where, and when."""
    kind, name = one.name.split(" of ", 1)
    if kind == "error":
        error, noun, units = absolute_errors(results, OF_TOOLS[0], name, one.name), f"the tool error of {name}", "m"
    else:
        error = absolute_errors(results, f"{kind}_largest", name, one.name)
        noun, units = f"the {kind} of {name}", "Pa" if kind == "stress" else "m"
    off = quantity(float(error[one.at]), units, 2)
    when = f", most in doubt at {quantity(one.time, 's')}" if np.isfinite(one.time) else ""
    where = in_words(results, one.at)
    return f"{noun} (estimated to within {percent(one.error)}, {off}{where and ','}{where}{when})"


def model_of(results: Results, at: Index) -> RobotModel:
    """The model of a variant."""
    from engine.robots.model import build
    from engine.robots.modes import with_open_modes
    from engine.scene.sweep import expand

    flat = int(np.ravel_multi_index(at, results.shape)) if at else 0
    return build(with_open_modes(expand(results.study).study_of(results.study, flat)))


def _refined(results: Results, at: Index) -> str:
    """What helps where nothing else is known."""
    modes, steps = (int(results.dataset[f"{name}_used"].values[at]) for name in ("modes", "steps"))
    return (
        f"What was marched there, {modes} modes of all rails and {steps:,} steps, is the most that is tried. "
        "What helps: a larger solver.tolerance, slower moves, smaller payloads, or more steps (solver.steps)."
    )


def _picked_up(model: RobotModel, time: float) -> Iterator[str]:
    """Robots whose rigid joints picked up a payload shortly before a time (s)."""
    from engine.kernels.robots.layout import START

    system, soon = model.system, SOON * 2.0 * np.pi / model.first_omega
    for r, (name, robot) in enumerate(model.study.robot.items()):
        drives = model.study.arm[robot.arm].drives
        rigid = [f"link {j}" if j else "rail" for j, drive in enumerate(drives) if drive.is_rigid]
        carried = system.stays[r, :, -2]
        for m in range(len(robot.moves)):
            since = time - system.moves[r, m, START]
            if rigid and carried[m + 1] > carried[m] and 0.0 <= since <= soon:
                at = quantity(float(system.moves[r, m, START]), "s")
                yield (
                    f"At {at} {name} picks up its payload by rigid joints ({listed(rigid)}), so that it strikes the "
                    "rails. What helps: a stiffness of these joints, or a larger solver.tolerance."
                )
