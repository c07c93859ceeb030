"""What an archive of cells of variants says: extremes of sensors and contact forces, and how many variants it is of."""

from collections.abc import Mapping

import numpy as np

from results_schema.arrays import Array, Mask
from results_schema.status import Status
from studies.findings.absolute_errors import LEAST_PART
from studies.findings.beyond import LIMIT, limits_of
from studies.findings.contacts import reads_support_force
from studies.results.axes import Axis
from studies.results.cells import CellRange, End, cell_ranges, words_of
from studies.results.findings_common import LOOSE, told_statuses
from studies.results.formatting import ROUNDING, counted, listed, percent, quantity, spanned
from studies.results.results import Results

MOST_TOLD = 3


def findings_of_cells(results: Results) -> list[str]:
    """The answer in sentences: first what the question names a limit of."""
    ranges, limits = {one.name: one for one in cell_ranges(results)}, _limits(results)
    sensors = sorted(results.sensors, key=lambda name: name not in limits)
    shown = [f"{sensor}_max" for sensor in limits]
    shown += [name for sensor in sensors for name in (f"{sensor}_max", f"{sensor}_min") if name not in shown]
    shown += [f"{name}_contact_force_min" for name, one in results.study.carriage.items() if one.inertial]
    judged = {f"{sensor}_max": _judged(results, sensor, limit) for sensor, limit in limits.items()}
    shown = [name for name in shown if name in ranges][:MOST_TOLD]
    told = [f"{_told(results, ranges[name])}{judged.get(name, '')}" for name in shown]
    told += _other_limits(results, ranges, {name: own for name, own in limits.items() if f"{name}_max" not in shown})
    told += _uplift(results, ranges)
    residual = "residual" in results.study.question
    kept = ["the extremes of every result", "the variants that have them", "the numbers of variants by status"]
    kept += ["percentiles"] if results.study.output.percentiles else []
    cells = f" of each of {counted(results.size, 'cell')} ({listed(results.dims)})" if results.dims else ""
    return [
        *told,
        f"Of {counted(results.variants, 'variant')} the archive keeps {listed(kept)}{cells}.",
        *(["Limits of residual vibrations are judged where all variants are kept."] * residual),
        *told_statuses(results),
    ]


def _limits(results: Results) -> dict[str, float]:
    """The limits that the question names, by sensor."""
    named = limits_of(results.study)
    limits = {name: named.of(sensor) for name, sensor in results.study.sensor.items()}
    return {name: limit for name, limit in limits.items() if limit is not None}


def _judged(results: Results, sensor: str, limit: float) -> str:
    """In which cells some variant of a sensor is beyond its limit, from the extremes of the cells: a sentence."""
    ends = (("largest", f"{sensor}_max"), ("smallest", f"{sensor}_min"))
    sizes = [np.abs(results.dataset[side].sel(result=name).transpose(*results.dims).values) for side, name in ends]
    errors = [results.dataset[f"{side}_error"].sel(result=name).transpose(*results.dims).values for side, name in ends]
    beyond = np.nan_to_num(np.maximum(*sizes)) > limit
    said = f"{LIMIT}{quantity(limit, results.sensors[sensor])}"
    # As parts of the true value, which may be larger by as much; where no estimate exists by any part.
    off = [np.nan_to_num(error, nan=1.0) for error in errors]
    most = [size / np.maximum(1.0 - error, LEAST_PART) for size, error in zip(sizes, off, strict=True)]
    perhaps = ~beyond & (np.nan_to_num(np.maximum(*most)) > limit)
    doubt = _doubt(perhaps, np.maximum(*errors), "in more of them" if beyond.any() else "somewhere", sensor)
    opened = "; those whose contact opens count too" if Status.SEPARATED in results.status_counts else ""
    if not beyond.any():
        return f"{said} nowhere{doubt}."
    if not results.dims:
        return f"{said} in some of the variants{opened}."
    many = f"{int(beyond.sum()):,}" if not beyond.all() else "all"
    return (
        f"{said} in some variants of {many} of {counted(results.size, 'cell')}{_along(results, beyond)}{opened}{doubt}."
    )


def _other_limits(results: Results, ranges: Mapping[str, CellRange], limits: Mapping[str, float]) -> list[str]:
    """Which sensors that have no sentence of their own are beyond their limits in some variant, and by what; and which
    may be by their estimated errors, or have no estimate."""
    ends = {name: _size(ranges, name) for name in limits if f"{name}_max" in ranges}
    beyond = {name: end for name, end in ends.items() if abs(end.value) > limits[name]}
    perhaps = {
        name: "As no estimate exists" if np.isnan(end.error) else "By its estimated errors"
        for name, end in ends.items()
        if name not in beyond and not abs(end.value) / max(1.0 - end.error, LEAST_PART) <= limits[name]
    }
    told = [f"{name} (up to {quantity(abs(end.value), results.sensors[name])})" for name, end in beyond.items()]
    said = [f"Of the other sensors with a limit {listed(told)} exceed{'s' * (len(told) == 1)} it too."] * bool(told)
    return said + [f"{why} {name} perhaps exceeds its limit." for name, why in perhaps.items()]


def _size(ranges: Mapping[str, CellRange], sensor: str) -> End:
    """The extreme of a sensor that is farther from 0."""
    return max(
        ranges[f"{sensor}_max"].largest, ranges[f"{sensor}_min"].smallest, key=lambda end: float(np.abs(end.value))
    )


def _uplift(results: Results, ranges: Mapping[str, CellRange]) -> list[str]:
    """By how much supports pull in some variant, by more than rounding."""
    least = {
        name: -ranges[f"{name}_min"].smallest.value
        for name, sensor in results.study.sensor.items()
        if reads_support_force(sensor) and f"{name}_min" in ranges
    }
    pulls = [
        f"{name} by up to {quantity(pull, 'N')}"
        for name, pull in sorted(least.items(), key=lambda one: -one[1])
        if pull > ROUNDING * abs(_size(ranges, name).value)
    ]
    return [f"Supports pull: {listed(pulls)}."] * bool(pulls)


def _doubt(perhaps: Mask, errors: Array, where: str, sensor: str) -> str:
    """That cells of a sensor may be beyond a limit by what their extremes are off; "" where none may. errors: of these,
    NaN where no estimate exists."""
    if not perhaps.any():
        return ""
    most = float(errors[perhaps].max())
    why = "where no estimate exists" if np.isnan(most) else f"by estimated errors of up to {percent(most)}"
    return f"; {why} perhaps {where}, which a tolerance of its own on sensor {sensor} tells"


def _along(results: Results, beyond: Array) -> str:
    """Of cells along one swept number, which these are where they lie side by side."""
    axes: list[Axis] = [axis for axis in results.axes if axis.dim in results.dims]
    if len(axes) != 1 or beyond.ndim != 1 or beyond.all():
        return ""
    values = np.sort(axes[0].values[beyond])
    between = (axes[0].values >= values[0]) & (axes[0].values <= values[-1])
    return f", {axes[0].noun} {spanned(values, axes[0].in_words)}" if between.sum() == values.size else ""


def _told(results: Results, found: CellRange) -> str:
    """The range of a result and the variants at its ends."""
    ends = (f"{_value(found, end)}{_where(results, end)}" for end in (found.smallest, found.largest))
    return f"{found.name}: from {' to '.join(ends)}."


def _value(found: CellRange, end: End) -> str:
    size = max(abs(found.smallest.value), abs(found.largest.value))
    loose = f" (estimated to within {percent(end.error)})" if end.error > LOOSE else ""
    return f"{quantity(end.value, found.units, beside=size)}{loose}"


def _where(results: Results, end: End) -> str:
    words = (f"{name.replace('_', ' ')} {word}" for name, word in words_of(results, end.at).items())
    return f" at {', '.join(words)} (variant {end.variant:,})"
