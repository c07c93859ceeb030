"""Marches with more and more modes and steps until what they report stays where it is: the truth that errors are
measured against, and the answer of studies of few variants.

The levels double the modes and take four times as many steps each. d being what a result still changed to a level, and
r the ratio of two changes in a row, d (r + r^2 + ...) = d r/(1 - r) is left. As ratios vary by chance, five times that
is told where it is far below d, and no less than a half of d.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.grids import MODES, SceneGrid, open_scheme, unit_steps
from engine.accuracy.jobs import InTurn, Job, Share
from engine.accuracy.results import between_peaks, deciding, differences, results_of, worst_held
from engine.accuracy.shown import Shown
from engine.kernels.schemes import Scheme
from engine.march.outcome import NOWHERE, USED, Flat, Outcome, number_of, outcome, used
from engine.march.step_rules import least_steps, pace_of_waves
from engine.model.numerics import Numerics, open_bodies
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts

#: Modes x steps over a passage or cycle of one march at most: some ten milliseconds. 24 modes and 4,800 steps hold 1e-3
#: for the hardest passage of accuracy.md; undamped loads that step on free ends needed a hundred times that at 1e-4.
MOST_WORK = 3e7
#: Where a study fixes steps: times its own that levels take at most, so that a sixteenth of what these are off by is
#: left; and times their first level's work, which lets the modes double twice with these. Where every level took twice
#: the steps, up to the work above, a million steps that were right to 1e-12 were told to be off by 3e-2.
MOST_OF_FIXED, MOST_WORK_OF_FIXED = 4.0, 16.0
FIRST_PERIODS = 20  # steps per first period of schemes without a limit at level 0: 8e-3 of phase at most
#: The same up to which no mode takes mass (four of a beam need 50 to 110): where loads step onto a free end, with 20 to
#: 80 and no such rule, 5 to 8 % of variants that hold 1e-3 were marked.
FIRST_WHOLE = 80
USUAL_LEVEL = 2  # to which most pilots and answers go; for expected times only
MARGIN = 1.25  # times the rules that no march may break: bands of growth end at 1.1, and 1.1 to 1.6 chose alike
#: Times d that is left: at least, at most, and where no change came before. Of 1,350 estimated errors in 240 random
#: scenes as studies of 8 1.7 % were below the true ones, 3.0 % more than 30 times these; with 3/4 at least 1.0 and
#: 3.6 %, with 1 1.0 and 4.3 %. 1 for the first told 3 to 13 % below.
LEAST_LEFT, MOST_LEFT, FIRST_LEFT = 0.5, 3.0, 2.0
#: Of the error by forces along a track, with twice the modes (a tenth with static correction, without it a half in the
#: end). Of 5,372 errors of heads on, above and below 100 beams and gantries 0.1 % were told too small, by the rule for
#: other loads alone 1.3 %.
STAYS, STAYS_UNCORRECTED = 0.125, 0.5
CAUTION = 5.0  # times what two changes foretell, up to d: with 3 2.5 and 0.9 % were below, 4 to 6 told alike
#: Of the phase speed of the highest wave kept, beyond which a mass outruns what would bend under it, and no change by
#: more modes tells of an error. Of beams under masses at 2 to 32 times the critical speed errors stayed with 1 and more
#: (14 % of statics), with 0.5 they were a fourth to a thirtieth of those with 1, and fell as fast with each doubling.
OUTRUN = 0.6
#: Of what twice the elements change: all there is where errors fall by the second power of an element's length (lumped
#: masses), a quarter more where by the fourth. Of 1,918 told errors in 36 random scenes 99.1 % were no less than the
#: true ones, a half of them 1.5 times these; by 16/15 92.3 %, as phases drift by more than a part of a swing.
LEFT_BY_ELEMENTS = 4.0 / 3.0


@dataclass(frozen=True, eq=False)
class Converged:
    """What V variants report by the last of their levels: error (R, V) of every result, NaN where no estimate exists;
    used (V,) by the names of the archive; settled (V,): whether the held results changed by less than was wanted; spent
    (V,): modes x steps of all levels; level (V,): the last one's number."""

    outcome: Outcome
    error: Array
    used: Flat
    settled: NDArray[np.bool_]
    spent: Array
    level: Counts


class Beyond(NamedTuple):
    """So many levels more than are needed, unless the next one takes more than so many modes x steps over the whole
    time."""

    levels: int
    dear: float


NO_FURTHER, IN_TURN = Beyond(0, np.inf), InTurn()


class Levels(NamedTuple):
    """What is marched level by level; steps: whether these grow too, or are as the study says."""

    numerics: tuple[Numerics, ...]
    steps: Literal["grow", "as the study says"]


def in_full(grid: SceneGrid) -> Levels:
    """The levels with all terms, whatever the study fixes."""
    scheme, modes = open_scheme(grid), grid.mode_levels
    return Levels(tuple(Numerics("full", scheme, True, count, 2**level) for level, count in enumerate(modes)), "grow")


def as_fixed(grid: SceneGrid) -> Levels:
    """The levels within what the study fixes."""
    study, own = grid.scene.study, grid.scene.numerics
    scheme: Scheme = own.scheme
    if study.solver.scheme == "auto" and not grid.fixed:
        scheme = open_scheme(grid)
    levels = list(grid.mode_levels) if open_bodies(study) else [0] * (1 if grid.fixed else len(MODES))
    numerics = tuple(own._replace(scheme=scheme, modes=modes) for modes in levels)
    return Levels(numerics, "as the study says" if grid.fixed else "grow")


def is_free(grid: SceneGrid) -> bool:
    """Whether the study fixes nothing that the levels in full would change."""
    study = grid.scene.study
    closed = [study.body[part.name] for part in grid.scene.bodies if part.name not in open_bodies(study)]
    whole = all(body.with_more_modes(2) == body for body in closed)
    terms = study.solver.fidelity in ("auto", "full") and study.solver.static_correction
    return whole and terms and study.solver.scheme == "auto" and not grid.fixed


class Level(NamedTuple):
    """What variants (by their places) report by a level, and the steps that each took in one of the grid's."""

    numerics: Numerics
    lanes: Counts
    by: Counts
    outcome: Outcome


class Marches(NamedTuple):
    """Variants that are marched level by level, and what keeps histories of some."""

    grid: SceneGrid
    values: VariantValues
    levels: Levels
    shown: Shown | None = None


def converge(
    marches: Marches,
    part: float,
    beyond: Beyond = NO_FURTHER,
    share: Share = IN_TURN,
    seen: Callable[[Level], object] = lambda level: None,
) -> Converged:
    """March variants level by level until what is held is off by no more than ``part`` of its tolerance, and
    levels ``beyond``; ``share`` does the marches of a level, ``seen`` is shown what they find. Raises Halted, and
    Crashed by the places of variants."""
    grid, values, levels, _ = marches
    asked, results = grid.asked, results_of(grid.asked)
    decisive = deciding(results, asked.study.solver.tolerance)
    march = partial(_march, marches, share, seen=seen)
    pushes_along = any("along" in carriage.pushes for carriage in asked.study.carriage.values())
    is_corrected, modes = levels.numerics[0].static_correction, grid.model(levels.numerics[0]).body_modes
    slow = np.array([result.slow for result in results])
    least = np.where(slow, MOST_LEFT, LEAST_LEFT)[:, None]
    now, spent = march(np.arange(values.size), 0)
    found = Converged(
        now,
        np.full((len(results), values.size), np.nan),
        spent,
        np.zeros(values.size, dtype=np.bool_),
        spent["work"].copy(),
        np.zeros(values.size, dtype=np.int64),
    )
    change, left = np.full((len(results), values.size), np.nan), np.full(values.size, beyond.levels, dtype=np.int64)
    active = np.arange(values.size)
    for level in range(1, len(levels.numerics)):
        active = active[_may_march(grid, values.part(active), levels, level)]
        if not active.size:
            break
        own = values.part(active)
        now, spent = march(active, level)
        model = grid.model(levels.numerics[level])
        apart = differences(asked, model, own, found.outcome.of(active), now)
        remaining = left_over(apart, change[:, active], least)
        remaining[slow] = np.maximum(
            remaining[slow], left_by_modes(apart, found.error[:, active], modes / model.body_modes)[slow]
        )
        modes = model.body_modes
        if pushes_along and not (is_corrected and level == 1):
            stays = STAYS if is_corrected else STAYS_UNCORRECTED
            remaining = np.maximum(remaining, left_along(apart, change[:, active], stays))
        remaining = np.maximum(remaining, between_peaks(asked, now))
        if levels.numerics[level].modes or levels.numerics[level].more > 1:  # what a study fixes has its error by more
            remaining[:, pace_of_waves(model, own) > OUTRUN] = np.nan
        found = _updated(found, active, now, spent, remaining)
        change[:, active] = apart
        off = worst_held(remaining, decisive, own.tighter)
        too_dear = _work_in_all(grid, own, levels, level + 1) > beyond.dear
        settled = off <= part
        found.settled[active] = settled
        found.spent[active] += spent["work"]
        found.level[active] = level
        done = settled & ((left[active] == 0) | too_dear)
        left[active] -= settled
        active = active[~done]
    return found


def _work_in_all(grid: SceneGrid, values: VariantValues, levels: Levels, level: int) -> Array:
    """(V,) modes x steps of a level over the whole time; nothing beyond the last one."""
    if level == len(levels.numerics):
        return np.zeros(values.size)
    return passages(grid) * level_work(grid, values, levels, level)


def left_over(change: Array, before: Array, least: Array | float = LEAST_LEFT) -> Array:
    """(R, V) the error of a level from the change that led to it, and the one before that (NaN where there is none), at
    least so many times the change."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.clip(change / before, 0.0, 0.99)
    foretold = ratio / (1.0 - ratio)
    foretold = np.clip(np.maximum(foretold, np.minimum(CAUTION * foretold, 1.0)), least, MOST_LEFT)
    known = np.where(np.isfinite(ratio), foretold, np.maximum(FIRST_LEFT, least))
    return np.where(np.isinf(change), np.nan, change * known)


def left_by_modes(change: Array, before: Array, fewer: float) -> Array:
    """(R, V) what is left of an error that falls as the number of modes grows, ``fewer`` of which the level before had,
    and no faster: what it changed tells by how much, and steps alone change nothing of it (before: NaN where unknown).
    """
    found = fewer * before
    return found if fewer == 1.0 else np.fmax(found, change * fewer / (1.0 - fewer))


def left_along(change: Array, before: Array, stays: float) -> Array:
    """(R, V) what is left of forces along a track, of whose error ``stays`` is left with twice the modes: as much as
    the change, or that part of the one before it where a level happened to bring none of the modes that matter. One
    change alone (NaN before it) tells nothing where these converge as slowly as without static correction."""
    return np.where(np.isinf(change), np.nan, np.maximum(change, stays * before))


def _updated(found: Converged, lanes: Counts, now: Outcome, spent: Flat, error: Array) -> Converged:
    whole = lanes.size == found.settled.size
    everything = now if whole else found.outcome.replaced(lanes, now)
    errors, used_ = found.error.copy(), {name: column.copy() for name, column in found.used.items()}
    errors[:, lanes] = error
    for name, column in used_.items():
        column[lanes] = spent[name]
    return replace(found, outcome=everything, error=errors, used=used_)


def _march(
    marches: Marches, share: Share, lanes: Counts, level: int, seen: Callable[[Level], object] = lambda level: None
) -> tuple[Outcome, Flat]:
    """One level of some of the variants, ascending, each with its own number of steps."""
    grid, values, levels, _ = marches
    by = _by(grid, values.part(lanes), levels, level)
    cuts = [int(cut) for cut in np.unique(by)[::-1]]
    marched = list(share(marches, [Job(partial(_on_cut, level=level, cut=cut), lanes[by == cut]) for cut in cuts]))
    found, spent = marched[0][1:] if len(marched) == 1 else _together(marched, lanes)
    seen(Level(levels.numerics[level], lanes, by, found))
    return found, spent


def left_by_elements(marches: Marches, found: Converged, share: Share) -> Array:
    """(R, V) of every result that variants report by the last of their levels, NaN where no estimate exists; nothing
    where no body is cut into elements. Raises Halted, and Crashed by the places of variants.

    By the level before, at a quarter of the work, 6 % of the errors of lone variants were told too small, not 1.5 %."""
    grid, values, levels, _ = marches
    error: Array = np.zeros((len(results_of(grid.asked)), values.size))
    if not grid.is_meshed:
        return error
    finer = Levels(tuple(numerics._replace(elements=2) for numerics in levels.numerics), levels.steps)
    for level in np.unique(found.level):
        lanes = np.flatnonzero(found.level == level)
        now, _ = _march(Marches(grid, values, finer), share, lanes, int(level))
        model, own = grid.model(finer.numerics[level]), found.outcome.of(lanes)
        error[:, lanes] = LEFT_BY_ELEMENTS * differences(grid.asked, model, values.part(lanes), own, now)
    return np.where(np.isinf(error), np.nan, error)


def _together(marched: Sequence[tuple[Counts, Outcome, Flat]], lanes: Counts) -> tuple[Outcome, Flat]:
    """Marches of parts of variants as one."""
    found, spent = marched[0][1].of(np.zeros(lanes.size, dtype=np.int64)), Flat()  # as large, yet to be filled
    for own, now, taken in marched:
        here = np.searchsorted(lanes, own)
        found = found.replaced(here, now)
        for name, column in taken.items():
            spent.setdefault(name, np.zeros(lanes.size, dtype=column.dtype))[here] = column
    return found, spent


def _on_cut(
    marches: Marches, lanes: Counts, halted: Callable[[], bool], *, level: int, cut: int
) -> tuple[Counts, Outcome, Flat]:
    """Variants of a level that take as many steps."""
    grid, values, levels, shown = marches
    model = grid.model(levels.numerics[level])
    tables = grid.once(model, cut)
    kept = NOWHERE if shown is None else shown.stations(grid, tables, cut, lanes)
    now = outcome(grid.asked, tables, values.part(lanes), grid.stations(model, cut), halted, kept)
    tables.forget()
    if shown is not None:
        shown.keep(lanes, now.shown)
    return lanes, replace(now, shown={}), used(tables, lanes.size)


def _by(grid: SceneGrid, values: VariantValues, levels: Levels, level: int) -> Counts:
    """(V,) steps of a level in one of the grid's: powers of two, so that variants share tables."""
    if levels.steps == "as the study says":
        return np.ones(values.size, dtype=np.int64)
    model = grid.model(levels.numerics[level])
    # Of steps that the study fixes twice as many at first: levels that all took its own would not tell their error.
    most = grid.unit * (MOST_OF_FIXED if grid.fixed else np.inf)
    wanted = np.full(values.size, max(unit_steps(grid.scene) * 4.0**level, min(grid.unit * 2.0**level, most)))
    own = MARGIN * least_steps(model, values)
    if level:  # what few modes decide tells of steps alone, also where the last modes are hardly more than those before
        own = np.maximum(own, np.minimum(2.0 * grid.unit * _by(grid, values, levels, level - 1), most))
    periods = values.scene_time_scale * model.first_omega / (2.0 * np.pi)
    if np.isfinite(model.scheme.scaled_from):
        whole = float(model.omega.max()) * values.scene_time_scale / model.scheme.scaled_from
        first = FIRST_WHOLE if open_bodies(grid.scene.study) else FIRST_PERIODS  # of modes that a study fixes few move
        own = np.maximum(own, np.minimum(whole, first * 4.0**level * periods))
    elif not np.isfinite(model.scheme.stability_limit):
        own = np.maximum(own, FIRST_PERIODS * 4.0**level * periods)
    return np.asarray(np.exp2(np.ceil(np.log2(np.maximum(wanted, own) / grid.unit).clip(0.0) - 1e-9)), dtype=np.int64)


def _may_march(grid: SceneGrid, values: VariantValues, levels: Levels, level: int) -> NDArray[np.bool_]:
    """(V,) whether a level is worth its work, and within the rules that no march may break."""
    if levels.steps == "as the study says":
        numerics = levels.numerics[level]
        return np.asarray(least_steps(grid.model(numerics), values) <= grid.unit * numerics.scheme.stride)
    first = grid.model(levels.numerics[0])
    own = first.body_modes * grid.unit * first.scheme.stride if grid.fixed else 0
    return level_work(grid, values, levels, level) <= max(MOST_WORK, MOST_WORK_OF_FIXED * own)


def is_last(grid: SceneGrid, values: VariantValues, levels: Levels, used: Flat) -> NDArray[np.bool_]:
    """(V,) whether variants were computed (``used``, by the names of the archive) with their last level, beyond which
    no march is worth its work."""
    last, more = np.zeros(values.size, dtype=np.int64), np.ones(values.size, dtype=np.bool_)
    for level in range(1, len(levels.numerics)):
        more &= _may_march(grid, values, levels, level)
        last[more] = level
    found = np.zeros(values.size, dtype=np.bool_)
    for level in np.unique(last):
        model = grid.model(levels.numerics[level])
        steps = grid.unit * model.scheme.stride * _by(grid, values, levels, level)
        taken = int(model.fidelity), int(number_of(model.scheme)), model.body_modes, steps
        found |= (last == level) & np.all([used[name] == own for name, own in zip(USED, taken, strict=True)], axis=0)
    return found


def usual_work(grid: SceneGrid, values: VariantValues, dear: float) -> Array:
    """(V,) about what an audit's last level takes of modes x steps: one beyond that of most references, where that is
    not dear."""
    levels = in_full(grid)
    usual = min(USUAL_LEVEL, len(levels.numerics) - 1)
    more = min(usual + 1, len(levels.numerics) - 1)
    least, most = (_work_in_all(grid, values, levels, level) for level in (usual, more))
    return np.where(most > dear, least, most)


def passages(grid: SceneGrid) -> float:
    """Passages or cycles of the whole time."""
    return max(rider.end for rider in grid.scene.riders)


def level_work(grid: SceneGrid, values: VariantValues, levels: Levels, level: int) -> Array:
    """(V,) modes x steps of a level over one passage or cycle."""
    model = grid.model(levels.numerics[level])
    return np.asarray(model.body_modes * grid.unit * model.scheme.stride * _by(grid, values, levels, level), np.float64)
