"""One chunk of variants: their results, what these were computed with, how far they may be off, and kept histories; and
what stands in an archive of variants that end every process that computes them: a status, and no values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.grids import SceneGrid
from engine.accuracy.groups import Found, Group, marches_again
from engine.accuracy.jobs import NOBODY, Halted, Job, Share
from engine.accuracy.results import Result, results_of, worst_held
from engine.accuracy.shown import stations_shown
from engine.kernels.layout import LANES
from engine.linear_algebra import one_thread
from engine.march.outcome import USED, Asked, Flat, Outcome, histories
from engine.march.settling import change_within, names_of_times, told_part
from engine.observation.cycle_reduction import HISTORY_PART
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.errors import WorkersGaveUp
from results_schema.gravest_status import gravest, lost
from results_schema.status import Status
from results_schema.store.rows import Arrays, Chunk, Rows, joined
from results_schema.variables import WHERE_OR_WHEN, axes

if TYPE_CHECKING:
    from engine.batch.plan import Plan

#: Jobs of short chunks, at least, and chunks of one: handed over one by one to two processes 600 scenes took 20.8 s in
#: place of 11.4, as that takes as long as what each computes.
LEAST_JOBS, MOST_IN_JOB = 32, 16
OF_CRASHED = {"status": np.int8(Status.CRASHED), "diverged_step": np.int64(-1)}  # other whole numbers are 0


def jobs_of(plan: Plan, done: Counts | None, chunk: int | None, beside: int) -> list[Job[Chunk]]:
    """The chunks that are left as jobs, of which so many are done ``beside`` each other; ``chunk`` fixes the variants
    of each. Where many have fewer variants than a block, several are one job."""
    chunks, bundles = list(plan.chunks(done, chunk)), list[list[tuple[int, Counts]]]()
    most = int(np.clip(sum(part.size < LANES for _, part in chunks) // LEAST_JOBS, 1, MOST_IN_JOB))
    for one in chunks:
        alone = not bundles or len(bundles[-1]) == most or max(one[1].size, bundles[-1][-1][1].size) >= LANES
        bundles += [[]] if alone else []
        bundles[-1].append(one)
    longest = beside * max(map(len, bundles), default=1)
    return [_job_of(bundle, longest) for bundle in bundles]


def _job_of(chunks: Sequence[tuple[int, Counts]], beside: int) -> Job[Chunk]:
    """Some chunks, each with the number of its group, as one job."""
    groups, parts = zip(*chunks, strict=True)
    if len(groups) == 1:
        return Job(partial(march_chunk, group=groups[0], beside=beside), parts[0])
    return Job(partial(march_chunks, groups=groups, beside=beside), np.concatenate(parts))


def march_chunk(plan: Plan, variants: Counts, halted: Halted, group: int, beside: int) -> Chunk:
    """One chunk of a group, by its number, as a job; beside: chunks that are marched side by side, of which each may be
    of another group. Raises Halted."""
    plan.forget_before(group - beside)
    arrays, selected = run_chunk(plan, plan.groups[group], variants, halted)
    return plan.reduce(plan, Chunk(Rows(variants, arrays), selected))


def march_chunks(plan: Plan, variants: Counts, halted: Halted, groups: Sequence[int], beside: int) -> Chunk:
    """Chunks of several groups as one job, each of which is so short that handing it over would take as long;
    beside: as many groups as may be marched side by side. Raises Halted."""
    parts = [(group, variants[np.isin(variants, plan.groups[group].variants)]) for group in groups]
    found = [march_chunk(plan, own, halted, group, beside) for group, own in parts if own.size]
    rows = joined([one.rows for one in found])
    assert rows is not None
    return Chunk(rows, joined([one.selected for one in found if one.selected is not None]))


def run_chunk(
    plan: Plan, group: Group, variants: Counts, halted: Callable[[], bool] = lambda: False
) -> tuple[Flat, Rows | None]:
    """The results (V, ...) of some variants of a group by name, and the histories of those that are kept. Raises
    Halted."""
    values = plan.values(group, variants)
    kept = np.flatnonzero(np.isin(variants, plan.shown))
    found = group.found(values, variants, plan.choice, halted, shown=kept)
    results = results_of(plan.asked)
    error, status = told_errors(found, plan.asked), _status(plan, group, found)
    missing = lost(status)
    error[:, missing] = np.nan
    flat = _in_si(plan, values, dict(found.outcome.numbers)) | {
        "status": status,
        "diverged_step": found.outcome.diverged_step,
        **found.used,
        "work": np.where(missing, np.nan, found.used["work"]),
        "estimated_error": np.ascontiguousarray(error.T, dtype=np.float32),
        "error_estimate": _worst(error, results),
    }
    known = [Rows(variants[lanes], _in_si(plan, values.part(lanes), arrays)) for lanes, arrays in found.shown]
    left = np.setdiff1d(kept, [lane for lanes, _ in found.shown for lane in lanes]).astype(np.int64)
    again = _marched_again(plan, group.grid, variants[left], _of(found.used, left), halted)
    return flat, joined([*known, *again])


def _in_si(plan: Plan, values: VariantValues, arrays: Arrays) -> Arrays:
    """Arrays (V, ...) of results of some variants in SI, in which these may not be counted."""
    if values.units is None:
        return arrays
    sensors = plan.study.sensor_units
    known, found = {**axes(), **plan.declared}, dict[str, NDArray[Any]]()
    for name, array in arrays.items():
        variable = known.get(name)
        if variable is None:  # what the study's own summary is made of
            found[name] = values.in_si(sensors.get(name.removesuffix("_static"), "1"), array)
        elif variable.units is not None:
            found[name] = values.in_si(variable.units, array)
        else:  # of every sensor in its own unit
            place = 1 + variable.dims.index("sensor")
            own = (values.in_si(units, array.take(number, place)) for number, units in enumerate(sensors.values()))
            found[name] = np.stack(list(own), axis=place)
    return found


def told_errors(found: Found, asked: Asked) -> Array:
    """(R, V) the estimated errors; of places and times of extremes no less than a step, and no more than the track
    and the passage; of times that sensors take to settle as `_told_of_times` has them."""
    error, results = np.where(np.isfinite(found.error), found.error, np.nan), results_of(asked)
    steps = np.maximum(found.used["steps_used"], 1)
    for number, result in enumerate(results):
        if result.name.endswith(WHERE_OR_WHEN):
            least = np.where(found.used["steps_used"] > 0, 1.0 / steps, 0.0)
            error[number] = np.minimum(np.maximum(error[number], least), 1.0)
    _told_of_times(found.outcome, asked, {result.name: error[n] for n, result in enumerate(results)})
    return error


def _told_of_times(outcome: Outcome, asked: Asked, error: Mapping[str, Array]) -> None:
    """Errors (V,) by result, changed in place: by how much a settling time changes where its band is wider or narrower
    by what the readings may be off; none where a sensor surely stays within its band from the stop on; no estimate
    where it does not settle, or may not, or by as much as it takes."""
    for j, (name, sensor) in enumerate(asked.study.sensor.items()):
        if sensor.settling_band is None:
            continue
        residual, off = outcome.numbers[f"{name}_residual"], error[f"{name}_residual"] * outcome.scale[:, j]
        settling_time, _ = own = names_of_times(name)
        parts = off / HISTORY_PART / sensor.settling_band
        change = change_within(outcome.other_bands[name], parts, outcome.numbers[settling_time])
        for result in own:
            stays = residual + off < sensor.settling_band
            error[result][:] = told_part(change, outcome.numbers[result], stays)


def _worst(error: Array, results: tuple[Result, ...]) -> Array:
    """(V,) the largest error of what is held; NaN where nothing is, or one is not known."""
    held = [number for number, result in enumerate(results) if np.isfinite(result.tolerance)]
    return np.max(error[held], axis=0) if held else np.full(error.shape[1], np.nan)


def _status(plan: Plan, group: Group, found: Found) -> NDArray[np.int8]:
    """(V,) what the march says, and whether what is held is within its tolerance."""
    held = found.held
    missed = np.where(held > 1.0, np.int8(Status.TOLERANCE_MISSED), np.int8(Status.OK))
    known = worst_held(found.error, results_of(plan.asked))
    # Where the study leaves nothing open, no error of its variants is the program's.
    fixed = group.grid.fixed and not group.grid.chooses
    none = np.isnan(found.error).all(axis=0)  # also where nothing is held
    unknown = np.isnan(held) | ((np.isnan(known) | none) & (not fixed))
    missed = np.where(unknown, np.int8(Status.UNRESOLVED), missed)
    return gravest(found.outcome.status, missed)


@one_thread()
def histories_of(plan: Plan, variants: Counts, used: Flat) -> Rows | None:
    """Histories of some variants of any scenes, from what these (by the names of the archive) were computed with."""
    rows: list[Rows] = []
    for grid, members in zip(plan.grids, plan.members, strict=True):
        lanes = np.flatnonzero(np.isin(variants, members))
        rows += _marched_again(plan, grid, variants[lanes], _of(used, lanes), lambda: False)
    return joined(rows)


def _of(used: Flat, lanes: Counts) -> Flat:
    return {name: used[name][lanes] for name in USED}


def _marched_again(
    plan: Plan, grid: SceneGrid, variants: Counts, used: Flat, halted: Callable[[], bool]
) -> Iterator[Rows]:
    """Histories of some variants of a scene, marched again with samples. Raises Halted."""
    if not variants.size:
        return
    values = VariantValues.of(grid.scene.study, plan.cases, variants)
    for tables, own in marches_again(grid, used):
        counts, part = stations_shown(plan.asked, tables), values.part(own)
        yield Rows(variants[own], _in_si(plan, part, histories(tables, part, counts, halted)))


def crashed_chunks(plan: Plan, crashed: Sequence[Counts], share: Share) -> Iterator[Chunk]:
    """The chunks of such variants: as of another variant, whose results say what there would be, emptied. Raises
    WorkersGaveUp where there is no other."""
    variants = np.unique(np.concatenate([NOBODY, *crashed]))
    if not variants.size:
        return
    others = np.setdiff1d(np.arange(plan.size), variants)
    if not others.size:
        raise WorkersGaveUp("every variant ends the process that computes it", remedy="try the study without workers")
    shown = np.isin(variants, plan.shown)
    of_shown = np.intersect1d(others, plan.shown)
    for own, like in ((variants[shown], of_shown if of_shown.size else others), (variants[~shown], others)):
        if own.size:
            (found,) = share(plan, [_alone(plan, int(like[0]))])
            yield Chunk(_emptied(found.rows, own), None if found.selected is None else _emptied(found.selected, own))


def _alone(plan: Plan, variant: int) -> Job[Chunk]:
    """The chunk of one variant."""
    (group,) = (number for number, group in enumerate(plan.groups) if variant in group.variants)
    return Job(partial(march_chunk, group=group, beside=len(plan.groups)), np.array([variant], dtype=np.int64))


def _emptied(rows: Rows, variants: Counts) -> Rows:
    """Rows of so many variants, of the same arrays without values."""
    found: Arrays = {}
    for name, array in rows.arrays.items():
        shape = (variants.size, *array.shape[1:])
        empty = np.nan if array.dtype.kind == "f" else OF_CRASHED.get(name, 0)
        found[name] = np.full(shape, empty, dtype=array.dtype)
    return Rows(variants, found)
