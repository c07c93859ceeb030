"""The audit of a run: what some variants report against the same variants computed again with more of everything."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from results_schema.errors import BadInput, Interrupted
from results_schema.status import Status
from results_schema.variables import axes, declarations
from studies.choices import is_marched
from studies.measuring import Work, described
from studies.results import Results
from studies.words import counted, scientific

if TYPE_CHECKING:
    import xarray as xr

    from engine.audit import Sample
    from engine.lanes import LaneValues
    from engine.plan import Plan
    from engine.reduction import Compared, Reduction
    from engine.scene import Study

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Arrays = Mapping[str, NDArray[Any]]

GROUP = "/audit"
EXTREMES = ("max", "min")
NONE_AUDITED = "no variant was audited: it would have taken too long; audit = N asks for N variants all the same"
AT_REST = 1e-9  # of what a sensor reads: statics of less are rounding


@dataclass(frozen=True, eq=False)
class Pair:
    """What n variants report, and what they report when they are computed again, by the names of results.

    scale (n, J): of every sensor, by which its differences are divided. silent (n, J): sensors that read but rounding.
    values: the study's numbers in these variants.
    """

    sensors: tuple[str, ...]
    reported: Arrays
    again: Arrays
    scale: Array
    silent: NDArray[np.bool_]
    values: LaneValues

    @property
    def compared(self) -> Compared:
        """Both, as the study's reduction compares them."""
        from engine.reduction import Compared

        return Compared(self.reported, self.again, self.scale, self.values)


class Again:
    """A sink that keeps the results of some variants, given by ascending flat numbers."""

    def __init__(self, variants: Counts) -> None:
        self.arrays: dict[str, NDArray[Any]] = {}
        self._variants = variants

    def add(self, variants: Counts, arrays: Mapping[str, NDArray[Any]], selected: object) -> None:
        """Take one chunk's results."""
        here = np.searchsorted(self._variants, variants)
        for name, array in arrays.items():
            if name not in self.arrays:
                self.arrays[name] = np.zeros((self._variants.size, *array.shape[1:]), dtype=array.dtype)
            self.arrays[name][here] = array


def refuse_audit(study: Study) -> None:
    """Refuse an audit of a study that marches no variants. Raises BadInput."""
    if study.solver.audit not in ("auto", 0):
        where = study.source.where("solver.audit")
        raise BadInput("a study of this kind marches no variants to audit", where=where, expected='0 or "auto"')


def planned_audit(plan: Plan) -> Sample | None:
    """The variants that are to be audited, if any are. Raises BadInput."""
    from engine.audit import sampled

    sample = sampled(plan)
    return sample if sample.variants.size else None


def audit_group(plan: Plan, sample: Sample | None, dataset: xr.Dataset, work: Work) -> dict[str, xr.Dataset]:
    """The group of an archive by its path; {} where nothing is audited, or no audited variant has values.

    sample: of `planned_audit`. dataset: the study's own. Raises Interrupted.
    """
    if sample is None:
        return {}
    from engine.audit import Used, audit_plan

    names = (f"{name}_used" for name in Used._fields)
    used = Used(*(_flat(plan, dataset, name, np.arange(plan.size)) for name in names))
    kept = _flat(plan, dataset, "status", sample.variants) < int(Status.NOT_CONVERGED)
    finer = audit_plan(plan, sample._replace(variants=sample.variants[kept]), used)
    if finer is None:
        return {}
    picked = np.sort(np.concatenate([bucket.variants for bucket in finer.buckets]))
    pair = _pair(plan, dataset, picked, _march(finer, picked, work), _silent(finer, picked))
    return {GROUP: _dataset(plan, dataset, picked, pair, int(np.count_nonzero(~kept)))}


def _march(finer: Plan, variants: Counts, work: Work) -> dict[str, NDArray[Any]]:
    """Results (n, ...) of the audit's plan."""
    from engine.execution import execute

    found = Again(variants)
    try:
        execute(finer, found.add, threads=work.threads, stop=work.stop.event)
    except Interrupted:
        work.check()
        raise
    return found.arrays


def _flat(plan: Plan, dataset: xr.Dataset, name: str, variants: Counts) -> NDArray[Any]:
    """(n, ...) a result of some variants by their flat numbers."""
    array = dataset[name].transpose(*plan.cases.dims, ...)
    return np.asarray(array.values).reshape(plan.size, *array.shape[len(plan.cases.dims) :])[variants]


def _silent(finer: Plan, variants: Counts) -> NDArray[np.bool_]:
    """(n, J) sensors that read but rounding."""
    from engine.signals import silent

    found = np.zeros((variants.size, len(finer.study.sensor)), dtype=np.bool_)
    for bucket in finer.buckets:
        found[np.searchsorted(variants, bucket.variants)] = silent(bucket.scene, bucket.tables.sensors)
    return found


def _pair(plan: Plan, dataset: xr.Dataset, variants: Counts, again: Arrays, silent: NDArray[np.bool_]) -> Pair:
    from engine.lanes import LaneValues

    sensors = tuple(plan.study.sensor)
    names = [name for name in again if name in dataset]
    reported = {name: _flat(plan, dataset, name, variants) for name in names}
    values = LaneValues(plan.study, plan.cases.columns_of(variants), variants.size)
    return Pair(sensors, reported, again, _scale(sensors, again), silent, values)


def _scale(sensors: Iterable[str], again: Arrays) -> Array:
    """(n, J) the largest static value of every sensor; of one that statics leave at rest, but for rounding, its own."""
    columns = []
    for name in sensors:
        static = np.asarray(again[f"{name}_static"], dtype=np.float64)
        own = np.maximum(*(np.abs(again[f"{name}_{end}"]) for end in EXTREMES))
        columns.append(np.where(static > AT_REST * own, static, own))
    return np.stack(columns, axis=1)


def _differences(pair: Pair, reduction: Reduction | None) -> dict[str, Array]:
    """(n, J) by the names of results: extremes of all sensors, and what the kind of study makes of its cycles."""
    compared = pair.compared
    found = {
        end: compared.relative(np.stack([compared.gap(f"{sensor}_{end}") for sensor in pair.sensors], axis=1))
        for end in EXTREMES
    }
    found |= {} if reduction is None else dict(reduction.differences(compared))
    return {name: np.where(pair.silent, 0.0, gaps) for name, gaps in found.items()}


def _dataset(plan: Plan, dataset: xr.Dataset, variants: Counts, pair: Pair, left_out: int) -> xr.Dataset:
    import xarray as xr

    found = _differences(pair, plan.reduction)
    gaps = np.stack(list(found.values()), axis=1).reshape(variants.size, -1)  # results, then sensors
    names = [_named(name, sensor) for name in found for sensor in pair.sensors]
    known = pair.again["status"] < int(Status.NOT_CONVERGED)
    arrays: dict[str, NDArray[Any]] = {
        "observed_error": np.where(known, gaps.max(axis=1), np.nan),
        "estimated_error": _estimated(plan, dataset, variants),
        "tolerance_asked": pair.values.of("solver.tolerance"),
        "worst_result": np.array([names[place] for place in np.nan_to_num(gaps).argmax(axis=1)]),
        "modes_used": pair.again["modes_used"],
        "steps_used": pair.again["steps_used"],
        "variant_status": _flat(plan, dataset, "status", variants),
        "left_out": np.array(left_out),
    }
    declared = {variable.name: variable for variable in declarations(GROUP)}
    own = {
        axis.name: ("sample", axis.values[plan.cases.positions(variants)[axis.dim]], dataset[axis.name].attrs)
        for axis in plan.cases.axes
    }
    return xr.Dataset(
        {name: described(declared[name], declared[name].dims, array) for name, array in arrays.items()},
        coords={"sample": ("sample", variants, axes()["sample"].attributes())} | own,
    )


def _named(name: str, sensor: str) -> str:
    """A result of a sensor in words, extremes as in the archive."""
    return f"{sensor}_{name}" if name in EXTREMES else f"{name} of {sensor}"


def _estimated(plan: Plan, dataset: xr.Dataset, variants: Counts) -> Array:
    """(n,) what the archive itself estimates; NaN where it does not."""
    name = next((name for name in ("error_estimate", "error_steps") if name in dataset), None)
    return np.full(variants.size, np.nan) if name is None else _flat(plan, dataset, name, variants)


@dataclass(frozen=True)
class Verdict:
    """What an audit found among the variants that the archive calls ok.

    asked: the tolerance, the smallest where it varies. worst: the largest observed error beside its tolerance, NaN
    where none is known; place: its number in the group. missed: variants beyond their tolerance. unknown: those
    without a number. marked: variants to which the archive itself gives another status than ok, and so no promise;
    marked_worst: the largest observed error among them, NaN where none is known.
    """

    count: int
    left_out: int
    asked: float
    worst: float
    place: int
    missed: int
    unknown: int
    marked: int
    marked_worst: float

    @property
    def held(self) -> bool:
        """Whether every audited variant that the archive calls ok is known to be within its tolerance."""
        return not (self.missed or self.unknown)

    @classmethod
    def of(cls, group: xr.Dataset) -> Verdict:
        """The verdict of the archive's group."""
        observed, tolerance = (np.asarray(group[name].values) for name in ("observed_error", "tolerance_asked"))
        ours = np.asarray(group["variant_status"].values) == int(Status.OK)
        known = np.isfinite(observed)
        place = int(np.argmax(np.where(known & ours, observed / tolerance, -1.0)))
        return cls(
            count=int(np.count_nonzero(ours)),
            left_out=int(group["left_out"]),
            asked=float(tolerance.min()),
            worst=float(observed[place]) if ours[place] else np.nan,
            place=place,
            missed=int(np.count_nonzero(observed[known & ours] > tolerance[known & ours])),
            unknown=int(np.count_nonzero(~known & ours)),
            marked=int(np.count_nonzero(~ours)),
            marked_worst=float(observed[known & ~ours].max(initial=-1.0)) if (known & ~ours).any() else np.nan,
        )


def told_audit(group: xr.Dataset | None, results: Results) -> list[str]:
    """What the group says, in sentences; where there is none, that no variant was audited if the study left it open."""
    if group is None:
        left_open = is_marched(results) and results.study.solver.audit == "auto"
        return [NONE_AUDITED] if left_open and bool(results.kept.any()) else []
    verdict = Verdict.of(group)
    told = [_told(group, verdict, results)] if verdict.count else []
    if verdict.missed:
        told.append(f"the tolerance was not held: {verdict.missed} of {counted(verdict.count, 'variant')} missed it")
    if verdict.unknown:
        told.append(f"{counted(verdict.unknown, 'variant')} could not be compared, which counts as not held")
    if verdict.marked:
        found = f"; there it found at most {scientific(verdict.marked_worst)}" if verdict.marked_worst >= 0.0 else ""
        also = "further " if verdict.count else ""
        told.append(f"audit of {counted(verdict.marked, f'{also}variant')} that the archive marks itself{found}")
    if verdict.left_out:
        told.append(f"{counted(verdict.left_out, 'further variant')} picked for the audit had no values")
    return told


def _told(group: xr.Dataset, verdict: Verdict, results: Results) -> str:
    """The sentence on variants that the archive calls ok."""
    said = f"asked {scientific(verdict.asked)}, audit of {counted(verdict.count, 'variant')} found "
    if not np.isfinite(verdict.worst):
        return f"{said}no number to compare"
    at = results.at(results.index_of(int(group["sample"].values[verdict.place])))
    result = str(group["worst_result"].values[verdict.place])
    return f"{said}at most {scientific(verdict.worst)}, worst{f' at {at}' if at else ''} ({result})"


def as_json(group: xr.Dataset, results: Results) -> dict[str, Any]:
    """What `run --json` says of it."""
    verdict = Verdict.of(group)
    place = dict(zip(results.dims, results.index_of(int(group["sample"].values[verdict.place])), strict=True))
    return {
        "variants": verdict.count,
        "marked": verdict.marked,
        "left_out": verdict.left_out,
        "not_compared": verdict.unknown,
        "tolerance": verdict.asked,
        "largest_observed_error": verdict.worst,
        "worst_result": str(group["worst_result"].values[verdict.place]),
        "at": {axis.name: float(axis.values[place[axis.dim]]) for axis in results.axes},
        "held": verdict.held,
    }
