"""A finished run in one table: the range of every result, and which variants it belongs to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from engine.scene.trains import axle_name
from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.status import Status, label
from studies.at_rest.told_errors import errors_along
from studies.findings.absolute_errors import absolute_errors, told_error
from studies.findings.amplification import DYNAMIC_AMPLIFICATION, sizes, told_amplification
from studies.findings.numerics_used import ERROR, WORK, is_marched
from studies.findings.residual import has_whole
from studies.protocol.study import kind_named
from studies.results.axes import VARIANT
from studies.results.cells import End, cell_ranges, counts_of, single_numbers, words_of
from studies.results.formatting import ALIKE, NOISE, counted, quantity
from studies.results.results import Results
from studies.runs.audit_findings import Verdict
from studies.runs.audit_findings import as_json as audit_as_json

if TYPE_CHECKING:
    from studies.results.results import Results
    from studies.runs.runner import Outcome

SOME_NOT_OK = 3
ENERGY = "energy_change"  # of frames that move
CONTACT_FORCE = "_contact_force_"
MOVE_AND_SETTLE = "_move_and_settle_time"
MOST_TIED = 3  # variants with the same value of which the first is named
LEAST_TOLD = 1e-5  # of a value: smaller errors say nothing beside four digits of it


@dataclass(frozen=True)
class Extreme:
    """One end of a result's range: its value, the swept numbers (or names) of that variant by name, and in words.

    error: the estimated one, in the unit of the value; NaN where none is known. alike: how many variants have this very
    value, and how many have any: one of many says nothing.
    """

    value: float
    variant: Mapping[str, float | str]
    words: Mapping[str, str]
    error: float = np.nan
    alike: tuple[int, int] = (1, 1)

    @property
    def where(self) -> str:
        """The variant in words, or how many have the same value."""
        first, (own, of) = ", ".join(f"{name} {words}" for name, words in self.words.items()), self.alike
        if own > MOST_TIED:
            return f"in {own:,} of {counted(of, 'variant')}"
        return f"{first} and {own - 1} more" if own > 1 else first

    @property
    def at(self) -> str:
        """The same, to stand behind what it is."""
        return self.where if self.alike[0] > MOST_TIED else f"at {self.where}"


@dataclass(frozen=True)
class Range:
    """Smallest and largest of a result over all variants that have one. sensor: "" where it is of no sensor.

    percentiles: its value at each of `output.percentiles`. beside: the largest magnitude of that of which it is an end.
    having: how many variants have it, and how many have results: a settling time is not there where none has settled.
    """

    name: str
    sensor: str
    units: str
    smallest: Extreme
    largest: Extreme
    percentiles: tuple[float, ...] = ()
    beside: float = 0.0
    having: tuple[int, int] = (0, 0)

    @property
    def extreme(self) -> Extreme:
        """The end of larger magnitude."""
        return max(self.largest, self.smallest, key=lambda end: abs(end.value))

    @property
    def telling(self) -> Extreme:
        """The end that is looked for: the smallest of what is smallest over time, such as a contact force, and of the
        time of move and settling, the largest of what is largest, and of others that of larger magnitude."""
        sides = {"_min": self.smallest, "_max": self.largest, MOVE_AND_SETTLE: self.smallest}
        return next((end for ending, end in sides.items() if self.name.endswith(ending)), self.extreme)

    @property
    def is_constant(self) -> bool:
        """Whether its values differ by rounding alone."""
        return self.largest.value - self.smallest.value <= max(ALIKE * abs(self.extreme.value), NOISE * self.beside)

    @property
    def partly(self) -> str:
        """In how many variants it is where some of them lack it; "" else."""
        own, of = self.having
        return f"in {own:,} of {counted(of, 'variant')}" if own < of else ""

    @property
    def is_loose(self) -> bool:
        """Whether its end of larger magnitude may be off by much of itself; the smallest over time of what is much
        larger at other times, as of a distance, by much of that, but for contact forces, which tell of lifting off."""
        known, least = self.extreme.error > NOISE * self.beside, self.name.endswith("_min")
        size = self.beside if least and not self.name.endswith("contact_force_min") else 0.0
        return known and bool(told_error(self.extreme.error, max(abs(self.extreme.value), size), self.units))

    def value(self, value: float, digits: int = 3) -> str:
        """One of its values with the unit."""
        return quantity(value, self.units, digits, beside=max(abs(self.extreme.value), self.beside))

    def said(self, end: Extreme, digits: int = 3) -> str:
        """One of its ends with the unit, and what that may be off where that is known and not beneath its digits."""
        beneath = max(LEAST_TOLD * abs(end.value), NOISE * self.beside)
        off = f" ± {quantity(end.error, self.units, 2)}" if np.isfinite(end.error) and end.error > beneath else ""
        return f"{self.value(end.value, digits)}{off}"


def is_measured(results: xr.Dataset) -> bool:
    """Whether these are results of a study that measures: its grid is no sweep."""
    return not kind_named(str(results.attrs["study_kind"])).sweeps


def noun(results: xr.Dataset) -> str:
    """What a status belongs to."""
    return "point" if is_measured(results) else "variant"


def every(results: Results) -> str:
    """All of which a result can be told to be the same, in words: of what has no values nothing is known."""
    lost = sum(count for status, count in results.status_counts.items() if not status.values_kept)
    known, own = results.variants - lost, noun(results.dataset)
    if not lost or not known:
        return f"every {own}"
    return f"all {counted(known, own)} with values" if known > 1 else f"the one {own} with values"


def counts(results: xr.Dataset) -> dict[str, int]:
    """Number of variants by status, those that occur."""
    return {label(status): count for status, count in counts_of(results).items()}


def exit_code(outcome: Outcome) -> int:
    """Exit code of a finished run: 3 where some variants are not ok, or an audit found the tolerance missed.

    Statuses that the study expects belong to its answer. A study that measures asks where methods fail: a method that
    diverges is its answer, and nothing that a script has to look after. So it ends with 0.
    """
    if outcome.audit is not None and not Verdict.of(outcome.audit).held:
        return SOME_NOT_OK
    expected = {label(Status.OK), *Results.of(outcome.results).study.expected}
    return 0 if is_measured(outcome.results) or set(counts(outcome.results)) <= expected else SOME_NOT_OK


def ranges(study_results: Results) -> Iterator[Range]:
    """The range of every result that is one number per variant, or one per variant and sensor or place; of studies
    in pieces of every result, but where they take a sweep without what belongs to no variant."""
    results = study_results.dataset
    if not study_results.study.output.keeps_variants:
        for one in cell_ranges(study_results):
            low, high = _of_cells(study_results, one.smallest), _of_cells(study_results, one.largest)
            yield Range(one.name, one.sensor, one.units, low, high, one.percentiles)
        return
    if not is_marched(results):
        declared = {} if is_measured(results) else study_results.study.results(study_results.study.kind)
        beside = {name for name, variable in declared.items() if variable.lead != "grid"} | {"estimated_error"}
        for name, array in results.data_vars.items():
            if array.dtype.kind == "f" and name not in beside:
                yield from _range(study_results, str(name), "", array)
        return
    for name, sensor, array in single_numbers(speaking(study_results).dataset):
        yield from _range(study_results, name, sensor, array)


def speaking(results: Results) -> Results:
    """Results without those of variants whose contact opens, but for contact forces and what tells of the march."""
    counting = xr.DataArray(results.with_values, dims=results.dims)
    if (counting == results.kept).all():
        return results
    names = {name for name, _, _ in single_numbers(results.dataset) if name not in (ERROR, WORK)}
    found = {name: results.dataset[name].where(counting) for name in names if CONTACT_FORCE not in name}
    return replace(results, dataset=results.dataset.assign(found))


def left_out(results: Results) -> str:
    """Which variants ranges leave out, or count though they say little, in a sentence; "" where none."""
    lost = any(not status.values_kept for status in results.status_counts)
    if not results.study.output.keeps_variants:
        opened = results.status_counts.get(Status.SEPARATED, 0)
        counting = f'Values count {counted(opened, "variant")} whose contact opens, which keep = "all" leaves out.'
        without = f"{noun(results.dataset).capitalize()}s without values are left out."
        return " ".join([without] * lost + [counting] * (opened > 0))
    opened = is_marched(results.dataset) and bool((results.with_values != results.kept.values).any())
    beside = ", and those whose contact opens of all but contact forces" if opened else ""
    if lost:
        return f"{noun(results.dataset).capitalize()}s without values are left out{beside}."
    return "Variants whose contact opens are left out of all but contact forces." if opened else ""


def _of_cells(results: Results, end: End) -> Extreme:
    """An extreme that an archive of cells has."""
    words = words_of(results, end.at) | {VARIANT: str(end.variant)}
    return Extreme(end.value, {**end.at, VARIANT: end.variant}, words)


def as_json(outcome: Outcome, exit_code: int) -> dict[str, Any]:
    """What `run --json` prints."""
    results, told = outcome.results, Results.of(outcome.results)
    return {
        "archive": str(outcome.archive),
        "kind": results.attrs["study_kind"],
        "title": results.attrs["title"],
        "variants": told.variants,
        "status": counts(results),
        "was_finished": outcome.was_finished,
        "resumed": outcome.resumed,
        "seconds": outcome.seconds,
        "exit_code": exit_code,
        "remarks": list(outcome.remarks),
        "audit": None if outcome.audit is None else audit_as_json(outcome.audit, told),
        "results": [
            {
                "name": found.name,
                "sensor": found.sensor or None,
                "units": found.units,
                "smallest": _end_as_json(found.smallest),
                "largest": _end_as_json(found.largest),
                "percentiles": dict(zip(map(str, told.percentiles), found.percentiles, strict=True)),
            }
            for found in ranges(told)
        ],
    }


def _end_as_json(end: Extreme) -> dict[str, Any]:
    return {"value": end.value, "error": end.error, "at": dict(end.variant)}


def shown(study_results: Results) -> list[Range]:
    """The ranges that people read: without contact forces of plain forces, which press as they are written, and
    amplifications of what statics are no measure of."""
    carriages = study_results.study.carriage.items()
    plain = {f"{name}_contact_force_{end}" for name, one in carriages if not one.inertial for end in ("max", "min")}
    return [one for one in ranges(study_results) if one.name not in plain and not _untold(study_results, one)]


def asked(study_results: Results) -> list[Range]:
    """The ranges that answer: what has a limit, the results of the kind of study, extremes and contact forces, last the
    times of these; without means of squares, estimated errors, work and the energy, which answers tell in words."""
    beside = {f"{sensor}_rms" for sensor in study_results.sensors} | {ERROR, WORK, ENERGY}
    first = tuple(f"{name}_" for name in _limited(study_results))
    found = [one for one in shown(study_results) if one.name not in beside]
    return sorted(
        found,
        key=lambda one: (
            one.name.endswith("_time"),
            not (f"{one.sensor}_".startswith(first) or one.name.startswith(first)),
            not one.sensor,
        ),
    )


def _limited(results: Results) -> list[str]:
    """The sensors of which the study names a limit."""
    return [name for name, sensor in results.study.sensor.items() if sensor.quantity in results.study.question]


def in_tables(study_results: Results) -> list[Range]:
    """The same, but of the axles of a train those alone whose contact forces are the largest and the smallest, and of a
    dynamic part beside its whole no residual vibration, which is the same."""
    alike = {f"{name}_residual" for name in study_results.sensors if has_whole(study_results, name)}
    found = [one for one in asked(study_results) if one.name not in alike]
    for name, train in study_results.study.train.items():
        for end, sign in (("max", 1.0), ("min", -1.0)):
            names = {f"{axle_name(name, axle)}_contact_force_{end}" for axle in range(train.count)}
            own = [one for one in found if one.name in names]
            worst = max(own, key=lambda one: max(sign * one.smallest.value, sign * one.largest.value), default=None)
            found = [one for one in found if one not in own or one is worst]
    return found


def _untold(results: Results, found: Range) -> bool:
    """Whether it is an amplification of what statics are no measure of."""
    own = found.name == DYNAMIC_AMPLIFICATION.name
    return (
        own and results.study.output.keeps_variants and bool(np.isnan(told_amplification(results, found.sensor)).all())
    )


def _range(study_results: Results, name: str, sensor: str, array: xr.DataArray) -> Iterator[Range]:
    array = array.transpose(*(dim for dim in study_results.dims if dim in array.dims), ...)
    values, results = array.values, study_results.dataset
    if not np.isfinite(values).any():
        return
    units = str(array.attrs.get("units") or (results["sensor_unit"].sel(sensor=sensor).item() if sensor else "1"))
    errors = absolute_errors(study_results, name, sensor) if array.dims == study_results.dims else None
    if "position" in array.dims:
        errors = errors_along(study_results, name)
    ends = [np.nanargmin(values), np.nanargmax(values)]
    if errors is not None and np.isfinite(errors).any() and np.nanmin(values) == np.nanmax(values):
        ends = [np.nanargmax(errors)] * 2  # of one value that is the same everywhere the largest error is told
    smallest, largest = (_extreme(study_results, array, end, errors) for end in ends)
    kept = study_results.with_values
    having = (int(np.isfinite(values[kept]).sum()), int(kept.sum())) if array.dims == study_results.dims else (0, 0)
    percentiles = np.nanpercentile(values, study_results.study.output.percentiles)
    stem = name.removesuffix("_max").removesuffix("_min")
    both = [results[f"{stem}_{end}"].values for end in ("max", "min") if f"{stem}_{end}" in results]
    beside = max((float(np.nanmax(np.abs(one), initial=0.0)) for one in both), default=0.0)
    beside = max(beside, _largest_alike(study_results, stem.removesuffix("_residual").removesuffix("_rms")))
    yield Range(name, sensor, units, smallest, largest, tuple(map(float, percentiles)), beside, having)


def _largest_alike(results: Results, sensor: str) -> float:
    """The largest magnitude of all sensors of its unit: what is rounding beside it is nothing."""
    units = results.sensors.get(sensor)
    known = results.dataset.data_vars.keys()
    alike = [name for name, own in results.sensors.items() if own == units and {f"{name}_max", f"{name}_min"} <= known]
    return max((float(np.nanmax(sizes(results, name), initial=0.0)) for name in alike), default=0.0)


def _extreme(results: Results, array: xr.DataArray, flat: np.intp, errors: Array | None) -> Extreme:
    place = dict(zip(array.dims, np.unravel_index(flat, array.shape), strict=True))
    swept_axes = {axis.name: axis for axis in results.axes}
    variant: dict[str, float | str] = {}
    words: dict[str, str] = {}
    for name, coordinate in results.dataset.coords.items():
        swept = len(coordinate.dims) == 1 and coordinate.dims[0] in place and coordinate.dtype.kind in "ifU"
        if swept and name not in _DERIVED:
            variant[str(name)] = value = coordinate.variable[place[coordinate.dims[0]]].values.item()
            if coordinate.size == 1 and name not in swept_axes:
                continue  # the one scene of a study of schemes, say
            if name in swept_axes:
                words[str(name)] = swept_axes[str(name)].in_words(value)
            elif isinstance(value, str | int):  # numbers of variants and modes are never rounded
                words[str(name)] = str(value)
            else:
                words[str(name)] = quantity(value, str(coordinate.attrs.get("units", "1")))
    error = np.nan if errors is None else float(errors.reshape(-1)[flat])
    value, alike = float(array.values.reshape(-1)[flat]), (1, 1)
    if array.dims == results.dims:
        alike = int(np.count_nonzero(array.values == value)), int(np.count_nonzero(np.isfinite(array.values)))
    return Extreme(value, variant, words, error, alike)


_DERIVED = ("speed_ratio", "mass_ratio", "frequency_ratio")
