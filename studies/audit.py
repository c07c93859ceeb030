"""The audit of a run: what some variants report against the same variants computed again with more of everything."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from results_schema.errors import BadInput, Interrupted
from results_schema.status import Status
from results_schema.variables import axes, declarations
from studies.measuring import Work, described
from studies.results import Results
from studies.words import counted

if TYPE_CHECKING:
    import xarray as xr

    from engine.lanes import LaneValues
    from engine.plan import Plan
    from engine.scene import Study

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Arrays = Mapping[str, NDArray[Any]]

GROUP = "/audit"
EXTREMES = ("max", "min")


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

    def gap(self, name: str) -> Array:
        """|difference| of a result; 0 where neither has a number, NaN where only one has."""
        one, other = (np.asarray(part[name], dtype=np.float64) for part in (self.reported, self.again))
        return np.where(np.isnan(one) & np.isnan(other), 0.0, np.abs(one - other))

    def relative(self, gap: Array) -> Array:
        """(n, J) a gap (n, J) in the sensors' units over the scale; NaN where that is 0 and the gap is not."""
        flat = np.where(gap > 0.0, np.nan, gap)
        return np.divide(gap, self.scale, out=flat, where=self.scale > 0.0)


@runtime_checkable
class Audited(Protocol):
    """A kind of study with results besides extremes that an audit compares."""

    def differences(self, pair: Pair) -> Mapping[str, Array]:
        """Relative differences (n, J) by the result's name; NaN where they are unknown."""


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


def planned_audit(plan: Plan) -> Plan | None:
    """How the study is to be audited, if it is. Raises BadInput."""
    from engine.audit import audit_plan, audited

    variants = audited(plan)
    return audit_plan(plan, variants) if variants.size else None


def audit_group(plan: Plan, finer: Plan | None, dataset: xr.Dataset, work: Work) -> dict[str, xr.Dataset]:
    """The group of an archive by its path; {} where nothing is audited, or no audited variant has values.

    finer: of `planned_audit`. dataset: the study's own. Raises Interrupted.
    """
    if finer is None:
        return {}
    picked = np.sort(np.concatenate([bucket.variants for bucket in finer.buckets]))
    kept = picked[_flat(plan, dataset, "status", picked) < int(Status.NOT_CONVERGED)]
    if not kept.size:
        return {}
    again = {name: array[np.isin(picked, kept)] for name, array in _march(finer, picked, work).items()}
    pair = _pair(plan, dataset, kept, again, _silent(finer, picked)[np.isin(picked, kept)])
    return {GROUP: _dataset(plan, dataset, kept, pair, picked.size - kept.size)}


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
    from engine.audit import silent

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
    """(n, J) the largest static value of every sensor; of one without any, velocity and acceleration, its own."""
    columns = []
    for name in sensors:
        static = np.asarray(again[f"{name}_static"], dtype=np.float64)
        own = np.maximum(*(np.abs(again[f"{name}_{end}"]) for end in EXTREMES))
        columns.append(np.where(static > 0.0, static, own))
    return np.stack(columns, axis=1)


def _differences(pair: Pair, kind: object) -> dict[str, Array]:
    """(n, J) by the names of results: extremes of all sensors, and what the kind of study adds."""
    found = {
        end: pair.relative(np.stack([pair.gap(f"{sensor}_{end}") for sensor in pair.sensors], axis=1))
        for end in EXTREMES
    }
    found |= dict(kind.differences(pair)) if isinstance(kind, Audited) else {}
    return {name: np.where(pair.silent, 0.0, gaps) for name, gaps in found.items()}


def _dataset(plan: Plan, dataset: xr.Dataset, variants: Counts, pair: Pair, left_out: int) -> xr.Dataset:
    import xarray as xr

    from studies.study import kind_named

    found = _differences(pair, kind_named(plan.study.kind))
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
    """What an audit found.

    asked: the tolerance, the smallest where it varies. worst: the largest observed error beside its tolerance, NaN
    where none is known; place: its number in the group. missed: variants beyond their tolerance. unknown: those
    without a number.
    """

    count: int
    left_out: int
    asked: float
    worst: float
    place: int
    missed: int
    unknown: int

    @property
    def held(self) -> bool:
        """Whether every audited variant is known to be within its tolerance."""
        return not (self.missed or self.unknown)

    @classmethod
    def of(cls, group: xr.Dataset) -> Verdict:
        """The verdict of the archive's group."""
        observed, tolerance = (np.asarray(group[name].values) for name in ("observed_error", "tolerance_asked"))
        known = np.isfinite(observed)
        place = int(np.argmax(np.where(known, observed / tolerance, -1.0)))
        return cls(
            count=observed.size,
            left_out=int(group["left_out"]),
            asked=float(tolerance.min()),
            worst=float(observed[place]),
            place=place,
            missed=int(np.count_nonzero(observed[known] > tolerance[known])),
            unknown=int(np.count_nonzero(~known)),
        )


def told_audit(group: xr.Dataset | None, results: Results) -> list[str]:
    """What the group says, in sentences; [] where there is none."""
    if group is None:
        return []
    verdict = Verdict.of(group)
    said = f"asked {_error(verdict.asked)}, audit of {counted(verdict.count, 'variant')} found "
    if np.isfinite(verdict.worst):
        at = results.at(results.index_of(int(group["sample"].values[verdict.place])))
        result = str(group["worst_result"].values[verdict.place])
        said += f"at most {_error(verdict.worst)}, worst{f' at {at}' if at else ''} ({result})"
    else:
        said += "no number to compare"
    told = [said]
    if verdict.left_out:
        told.append(f"{counted(verdict.left_out, 'further variant')} picked for the audit had no values")
    if verdict.missed:
        told.append(f"the tolerance was not held: {verdict.missed} of {counted(verdict.count, 'variant')} missed it")
    if verdict.unknown:
        told.append(f"{counted(verdict.unknown, 'variant')} could not be compared, which counts as not held")
    return told


def _error(value: float) -> str:
    """A relative error with two digits.

    >>> _error(1e-3), _error(2.14e-4), _error(0.0)
    ('1e-3', '2.1e-4', '0')
    """
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa.removesuffix('.0')}e{int(exponent)}" if value else "0"


def as_json(group: xr.Dataset, results: Results) -> dict[str, Any]:
    """What `run --json` says of it."""
    verdict = Verdict.of(group)
    place = dict(zip(results.dims, results.index_of(int(group["sample"].values[verdict.place])), strict=True))
    return {
        "variants": verdict.count,
        "left_out": verdict.left_out,
        "not_compared": verdict.unknown,
        "tolerance": verdict.asked,
        "largest_observed_error": verdict.worst,
        "worst_result": str(group["worst_result"].values[verdict.place]),
        "at": {axis.name: float(axis.values[place[axis.dim]]) for axis in results.axes},
        "held": verdict.held,
    }
