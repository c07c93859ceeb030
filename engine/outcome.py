"""From what a march observed to the numbers of each variant: extremes, places, statuses, the study's own reduction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.bucket import Bucket
from engine.choice import scheme_used
from engine.contacts import contact_forces
from engine.cycles import counts_sampled, reduced
from engine.envelopes import MOST_KEPT, envelope_names
from engine.estimates import Estimator, Observed, extremes_of, pair_errors
from engine.improving import improvements
from engine.kernels.layout import (
    BELOW_AT,
    DIVERGED_AT,
    LARGEST,
    LARGEST_AT,
    SMALLEST,
    SMALLEST_AT,
    SQUARES,
)
from engine.lanes import LaneValues, padded, weights
from engine.march import Marched
from engine.model import SceneModel
from engine.moving_load import STILL
from engine.plan import Plan, reads_accelerations
from engine.richardson import march_chosen
from engine.signals import silent
from engine.tables import SceneTables
from results_schema.parts import Rows, joined
from results_schema.status import Fidelity, Status

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Flat = dict[str, NDArray[Any]]


def run_chunk(
    plan: Plan, bucket: Bucket, variants: Counts, halted: Callable[[], bool] = lambda: False
) -> tuple[Flat, Rows | None]:
    """March some variants of a bucket; their results (V, ...) by name, and the histories of those that are kept.

    Those that miss their tolerance are marched again with more modes or steps, where the study leaves these open.
    Raises Halted when ``halted`` says so between two segments.
    """
    flat = _computed(plan, bucket, variants, halted)
    improved, rows = np.zeros(variants.size, dtype=np.bool_), []
    for finer, lanes in improvements(plan, bucket, variants, flat):
        better, more = run_chunk(plan, finer, variants[lanes], halted)
        better["relative_cost"] = better["relative_cost"] + flat["relative_cost"][lanes]
        for name, array in flat.items():
            array[lanes] = better[name]
        improved[lanes] = True
        rows.append(more)
    rows.append(_histories(plan, bucket, variants[~improved], halted))
    return flat, joined([part for part in rows if part is not None])


def _computed(plan: Plan, bucket: Bucket, variants: Counts, halted: Callable[[], bool]) -> Flat:
    """The results (V, ...) of some variants of a bucket with their errors."""
    tables, size = bucket.tables, variants.size
    counts = counts_sampled(plan, tables)
    marched, gap = march_chosen(tables, plan.values(bucket, padded(variants)), counts, size, halted)
    envelopes = _envelopes(bucket, plan.values(bucket, padded(variants)), size, halted)
    values = plan.values(bucket, variants)
    own = reduced(plan, tables, values, counts, marched.history)
    flat: Flat = {
        **_extremes(tables, marched),
        **_contact_forces(tables, marched),
        **envelopes,
        **_statics(tables, values),
        **own,
    }
    status, diverged_step = _status(tables.model, marched)
    scale = _scale(tables, values, flat)
    missed = None if gap is None else pair_errors(tables, values, gap, scale)
    observed = Observed(tables, counts, marched.history, extremes_of(tables, marched), own)
    errors = Estimator(plan, bucket, variants, scale, halted).errors(observed, missed)
    status = np.maximum(status, errors.status(plan.study, values, bucket.chosen))
    flat |= {f"error_{part}": column for part, column in errors._asdict().items()} | {"error_estimate": errors.total}
    flat["relative_cost"] = bucket.cost / bucket.full_cost[bucket.of(variants)]
    for name, array in flat.items():
        if array.dtype == np.float64:
            array[status >= Status.NOT_CONVERGED] = np.nan
        flat[name] = array
    return flat | {
        "status": status.astype(np.int8),
        "diverged_step": diverged_step,
        "fidelity_used": np.full(size, int(tables.model.fidelity), dtype=np.int8),
        "scheme_used": np.full(size, int(scheme_used(tables.model.study)), dtype=np.int8),
        "modes_used": np.full(size, 0 if _knows_all(tables) else tables.model.body_modes, dtype=np.int32),
        "steps_used": np.full(size, 0 if _rests(tables) else tables.steps, dtype=np.int32),
    }


def _knows_all(tables: SceneTables) -> bool:
    """Whether these are statics of the whole body, whatever modes it keeps."""
    return _rests(tables) and tables.model.study.solver.static_correction


def _rests(tables: SceneTables) -> bool:
    """Whether nothing is marched."""
    return tables.model.fidelity is Fidelity.STATIC


def _extremes(tables: SceneTables, marched: Marched) -> Flat:
    """Largest and smallest value of every sensor, where the first carriage was then, and the root mean square."""
    found: Flat = {}
    counted = _counted(tables)
    for j, sensor in enumerate(tables.sensors):
        marks = marched.marks[j]
        seen = np.isfinite(marks[LARGEST]) | np.isnan(marks[LARGEST])
        found[f"{sensor.name}_max"] = np.where(seen, marks[LARGEST], np.nan)
        found[f"{sensor.name}_min"] = np.where(seen, marks[SMALLEST], np.nan)
        found[f"{sensor.name}_max_position"] = tables.timeline.positions(0, marks[LARGEST_AT])
        found[f"{sensor.name}_min_position"] = tables.timeline.positions(0, marks[SMALLEST_AT])
        found[f"{sensor.name}_rms"] = np.sqrt(marks[SQUARES] / max(1, counted[j]))
    return found


def _envelopes(bucket: Bucket, values: LaneValues, size: int, halted: Callable[[], bool]) -> Flat:
    """(V, places) largest and smallest values of every envelope, from marches that watch its places alone."""
    found: dict[str, list[Array]] = {name: [] for name in envelope_names(bucket.scene.study)}
    nothing = np.zeros(0, dtype=np.int64)
    for tables in bucket.envelopes:
        marched, _ = march_chosen(tables, values, nothing, size, halted)
        for j, place in enumerate(tables.sensors):
            for end, mark in (("max", LARGEST), ("min", SMALLEST)):
                found[f"{place.name}_envelope_{end}"].append(marched.marks[j, mark])
        if len(bucket.envelopes) > MOST_KEPT:
            tables.forget()
    return {name: np.stack(readings, axis=1) for name, readings in found.items()}


def _counted(tables: SceneTables) -> list[int]:
    """Number of steps at which every sensor counts."""
    segments = [segment for segment in tables.timeline.segments if segment.recorded]
    return [
        sum(s.steps for s in segments if sensor.under is None or s.active[sensor.under]) for sensor in tables.sensors
    ]


def _contact_forces(tables: SceneTables, marched: Marched) -> Flat:
    """Extremes of every contact force, and where it first was negative."""
    found: Flat = {}
    for c, carriage in enumerate(tables.model.carriages):
        marks = marched.marks[[len(tables.sensors) + k for k in _contacts_of(tables.model, c)]]
        seen = (marks[:, LARGEST_AT] >= 0.0).any(axis=0)
        least = np.argmin(marks[:, SMALLEST], axis=0)[None]  # where a contact never counts, its smallest is infinite
        found[f"{carriage.name}_contact_force_max"] = np.where(seen, marks[:, LARGEST].max(axis=0), np.nan)
        found[f"{carriage.name}_contact_force_min"] = np.where(seen, marks[:, SMALLEST].min(axis=0), np.nan)
        place = tables.timeline.positions(c, np.take_along_axis(marks[:, SMALLEST_AT], least, axis=0)[0])
        found[f"{carriage.name}_contact_force_min_position"] = place
        opened = _opened_at(tables, marched, c)
        found[f"{carriage.name}_separation_position"] = tables.timeline.positions(c, opened)
    return found


def _opened_at(tables: SceneTables, marched: Marched, carriage: int) -> Array:
    """(V,) count of the first station with a negative contact force of a carriage with inertia, or -1."""
    contacts = _contacts_of(tables.model, carriage)
    if not tables.model.reacts(carriage):
        return np.full(marched.marks.shape[-1], -1.0)
    after = [len(tables.sensors) + number for number in contacts]
    below = np.concatenate([marched.guard[contacts, BELOW_AT], marched.marks[after, BELOW_AT]])
    first = np.min(np.where(below >= 0.0, below, np.inf), axis=0)
    return np.asarray(np.where(np.isfinite(first), first, -1.0))


def _contacts_of(model: SceneModel, carriage: int) -> list[int]:
    """Numbers of the contact forces of a carriage among all contact forces."""
    return [number for number, force in enumerate(contact_forces(model)) if force.carriage == carriage]


def _status(model: SceneModel, marched: Marched) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """Status of every variant, and the first step at which it had diverged, or -1."""
    bad = np.concatenate([marched.marks[:, DIVERGED_AT], marched.guard[:, DIVERGED_AT]])
    first = np.min(np.where(bad >= 0.0, bad, np.inf), axis=0)
    diverged = np.isfinite(first) | ~marched.finite
    sensors = len(marched.marks) - len(marched.guard)
    reacting = [number for number, force in enumerate(contact_forces(model)) if model.reacts(force.carriage)]
    below = np.concatenate(
        [marched.marks[[sensors + c for c in reacting], BELOW_AT], marched.guard[reacting, BELOW_AT]]
    )
    separated = (below >= 0.0).any(axis=0)
    status = np.where(separated, np.int8(Status.SEPARATED), np.int8(Status.OK))
    status = np.where(diverged, np.int8(Status.DIVERGED), status).astype(np.int8)
    return status, np.where(np.isfinite(first), first, -1.0).astype(np.int64)


def _statics(tables: SceneTables, values: LaneValues) -> Flat:
    """The largest absolute static reading of every sensor while the carriages go their way, by the same model."""
    unit = tables.static_over_window
    loads, gravity = weights(tables.model, values), values.of("gravity")
    found: Flat = {}
    for j, sensor in enumerate(tables.sensors):
        if loads.shape[0] == 1 and not np.any(unit.gravity[:, j]):
            found[f"{sensor.name}_static"] = np.abs(unit.force[:, j, 0]).max() * np.abs(loads[0])
        else:
            found[f"{sensor.name}_static"] = _largest_static(unit.force[:, j], unit.gravity[:, j], loads, gravity)
    return found


def _largest_static(force: Array, offset: Array, loads: Array, gravity: Array) -> Array:
    """(V,) largest |sum of unit readings times weights + offset times gravity|, in pieces of variants."""
    found = np.empty(gravity.size)
    for first in range(0, gravity.size, 1024):
        part = slice(first, first + 1024)
        reading = offset[:, None] * gravity[part]
        for r in range(loads.shape[0]):
            reading = reading + force[:, r, None] * loads[r, part]
        found[part] = np.abs(reading).max(axis=0)
    return found


def _scale(tables: SceneTables, values: LaneValues, flat: Flat) -> Array:
    """(V, J) the largest static value of every sensor, no less than `STILL` of what is usual on its body; of a rate its
    own largest; infinite where nothing is but rounding."""
    columns, weight = [], np.abs(weights(tables.model, values)).sum(axis=0)
    for sensor, usual in zip(tables.sensors, tables.static_scales, strict=True):
        static = np.asarray(flat[f"{sensor.name}_static"], dtype=np.float64)
        own = np.maximum(*(np.abs(np.asarray(flat[f"{sensor.name}_{end}"])) for end in ("max", "min")))
        columns.append(own if sensor.offset_order else np.maximum(static, STILL * usual * weight))
    found = np.stack(columns, axis=1) if columns else np.zeros((tables.model.ties, 0))
    found[:, silent(tables.model, tables.sensors)] = np.inf
    return np.where(found > 0.0, found, np.inf)


def _histories(plan: Plan, bucket: Bucket, variants: Counts, halted: Callable[[], bool]) -> Rows | None:
    """Histories of the kept ones among some variants, marched again with samples."""
    kept = np.intersect1d(variants, plan.shown)
    if kept.size == 0:
        return None
    tables = bucket.tables.with_accelerations if reads_accelerations(plan.study) else bucket.tables
    counts = plan.counts_shown(bucket)
    values = plan.values(bucket, padded(kept))
    marched, _ = march_chosen(tables, values, counts, kept.size, halted)
    time_scale = plan.values(bucket, kept).time_scale(tables.model.carriages[0].name)
    elapsed = _elapsed(tables, counts, time_scale)
    arrays: dict[str, Array] = {"elapsed": elapsed}
    for j, sensor in enumerate(tables.sensors):
        arrays[sensor.name] = marched.history[:, j].T
    for c, carriage in enumerate(tables.model.carriages):
        path = tables.timeline.motion(c, counts.astype(np.float64))
        arrays[f"{carriage.name}_position"] = np.repeat(path.S[None, :], kept.size, axis=0)
        arrays[f"{carriage.name}_speed"] = path.dS / time_scale[:, None]
        arrays[f"{carriage.name}_acceleration_along"] = path.ddS / time_scale[:, None] ** 2
    status, _ = _status(tables.model, marched)
    for name, array in arrays.items():
        if name != "elapsed":
            array[status >= Status.NOT_CONVERGED] = np.nan
    size = plan.stations_shown
    return Rows(kept, {name: _filled(np.ascontiguousarray(array), size) for name, array in arrays.items()})


def _filled(array: Array, stations: int) -> Array:
    return np.pad(array, ((0, 0), (0, stations - array.shape[1])), constant_values=np.nan)


def _elapsed(tables: SceneTables, counts: Counts, time_scale: Array) -> Array:
    """(V, H) seconds since time 0 of stations by their count."""
    timeline = tables.timeline
    index, tau = timeline.moments(counts.astype(np.float64))
    found = tau * time_scale[:, None]
    free = np.array([segment.free for segment in timeline.segments])[index]
    if free.any():
        start = next(segment.first for segment in timeline.segments if segment.free)
        steps = timeline.steps - start
        period = 2.0 * np.pi / tables.model.first_omega
        rest = (counts - start) * (timeline.free_periods * period / steps)
        found = found + np.where(free, rest, 0.0)
    return found
