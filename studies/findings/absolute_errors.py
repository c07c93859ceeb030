"""Estimated errors of results in their own units: an archive has them as parts of a scale of each result's own."""

from __future__ import annotations

from functools import partial, reduce
from typing import Any

import numpy as np

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.quantities import AFTER_STOP
from studies.findings.theory import body_mass
from studies.protocol.study import kind_named
from studies.results.findings_common import LOOSE
from studies.results.formatting import percent, quantity
from studies.results.kept import kept
from studies.results.places import Index
from studies.results.results import Results

LOOSE_PART = 0.1  # of a value: an estimated error above stands beside it
LEAST_PART = 0.1  # of the true value, that what is reported counts as at least: beyond nothing is known
DYNAMIC_AMPLIFICATION = "dynamic_amplification"
OF_TOOLS = ("error_moving", "error_working", "error_holding")
BEYOND_REST = tuple(name.replace("error", "beyond_rest") for name in OF_TOOLS)
OF_RAILS = ("deflection_largest", "stress_largest")


def absolute_errors(results: Results, name: str, sensor: str = "", told_as: str = "") -> Array:
    """The estimated error of a result, of one sensor (or robot or rail) where it is over these, in its unit and the
    sweep's shape; NaN where none is known. told_as: another result than its own that is told over the same scale, as
    the history whose largest value it is.

    Errors of sensors are told over their largest static value, or their own where that is larger and something pushes
    their body along its track. An archive tells the static one where it has their dynamic amplification; else their own
    largest value stands for it, which is not far from it but near a resonance.
    """
    error, (known, reported) = (
        results.estimated_error(told_as or told_as_of(name, sensor)),
        _scales(results, name, sensor),
    )
    # What is reported is off itself: the true one, which errors are parts of, may be larger by as much.
    return error * np.fmax(
        results.everywhere(known), results.everywhere(reported) / np.maximum(1.0 - error, LEAST_PART)
    )


def told_as_of(name: str, sensor: str) -> str:
    """The name of a result among those whose errors are estimated."""
    if name in (*OF_TOOLS, *BEYOND_REST):
        return f"largest error of {sensor}"
    of_rails = {"deflection_largest": f"largest deflection of {sensor}", "stress_largest": f"stress of {sensor}"}
    return of_rails.get(name, f"{name} {sensor}".strip())


def errors_of_size(results: Results, sensor: str) -> Array:
    """The estimated error of a sensor's largest absolute value, in its unit: that of the extreme which is larger."""
    sides = [np.abs(results.everywhere(results.dataset[f"{sensor}_{side}"])) for side in ("max", "min")]
    return np.where(sides[0] >= sides[1], *(absolute_errors(results, f"{sensor}_{side}") for side in ("max", "min")))


def told_error(error: float, value: float, units: str) -> str:
    """What a value may be off, to stand behind it: "" where that is little of it, or not known."""
    return f" ± {quantity(error, units, 2)}" if error > LOOSE_PART * abs(value) else ""


def uncertainty(results: Results, result: str, place: Index, beside: float = 0.0) -> str:
    """How loosely a named value is known, for the sentence that names it; "" where its estimated error is a small part
    of it, or of a larger value ``beside`` it.

    result: as in the archive's `result`. What is held to no tolerance, though a sensor's could hold it, is told so.
    """
    part = _part_of_itself(results, result, place, beside)
    if not part > LOOSE:
        return ""
    ends = ("max", "min")
    sensor = next((name for name in results.sensors if result in [f"{name}_{end}" for end in ends]), "")
    free = sensor and np.isnan(float(results.dataset["tolerance"].sel(result=result)))
    asks = "a tolerance of its own"
    if free and results.study.sensor[sensor].takes_limit and not results.study.sensor[sensor].frequency_limit:
        asks = f"a frequency_limit or {asks}"
    remedy = f"; {asks} on sensor {sensor} asks for more" if free else ""
    return f" (estimated to within {percent(part)}{remedy})"


def _part_of_itself(results: Results, result: str, place: Index, beside: float) -> float:
    """The estimated error of one variant's result over its own size; of an envelope's largest that is what is told."""
    error, (name, _, sensor) = results.error_at(result, place), result.partition(" ")
    told = results.of_sensor(name, sensor) if sensor else results.dataset[name]
    if not np.isfinite(error) or set(told.dims) - set(results.dims):
        return error
    size = max(beside, abs(float(results.everywhere(told)[place])))
    return float(absolute_errors(results, name, sensor)[place]) / size if size else error


def weight(results: Results, carriage: str) -> Any:
    """Of all masses of a carriage, or of the body that rides (without sweep), N."""
    spec = results.study.carriage[carriage]
    if spec.riding_body is not None:
        return body_mass(results, spec.riding_body) * results.parameter("gravity")
    masses = [results.parameter(f"carriage.{carriage}.{key}") for key in spec.masses]
    return sum(masses) * results.parameter("gravity")


def _scales(results: Results, name: str, sensor: str) -> tuple[Any, Any]:
    """What the estimated error of a result is a part of, in the result's unit: what is known, and what the variant
    reports itself; the larger one counts, NaN is none."""
    dataset, stem = results.dataset, name.rpartition("_")[0]
    if name in (*OF_TOOLS, *BEYOND_REST):
        return np.nan, _largest([results.of_sensor(one, sensor) for one in OF_TOOLS])
    if name in OF_RAILS:
        return np.nan, results.of_sensor(name, sensor)
    if name == DYNAMIC_AMPLIFICATION and _is_pushed(results, sensor):
        return 1.0, results.of_sensor(name, sensor)
    if name == "lag":
        return _cruise(results), np.nan
    if name.endswith(("_settling_time", "_move_and_settle_time")):
        return dataset[name], np.nan  # over the time that is told, not the true one
    if f"{stem}_max" in dataset and f"{stem}_min" in dataset:
        return _scales_of_ends(results, stem)
    return 1.0, np.nan  # an index


@kept
def _scales_of_ends(results: Results, stem: str) -> tuple[Any, Any]:
    """The same of what has a largest and a smallest value."""
    own = _largest([results.dataset[f"{stem}_max"], results.dataset[f"{stem}_min"]])
    moves = kind_named(results.study.kind).moves_frames
    if stem in results.sensors and "dynamic_amplification" in results.dataset:
        static = own / results.of_sensor("dynamic_amplification", stem)
        known = np.isfinite(static)
        if _is_pushed(results, stem):
            return static.where(known), own
        return static.where(known), own.where(~known)
    whole = stem.removesuffix(AFTER_STOP)
    if whole != stem and whole in results.sensors:
        return np.nan, _largest([results.dataset[f"{whole}_max"], results.dataset[f"{whole}_min"]])
    carriage = next((one for one in results.study.carriage if stem.startswith(f"{one}_")), "")
    what = stem.removeprefix(f"{carriage}_")
    if what == "contact_force" and not moves and not results.study.carriage[carriage].pulsates:
        return weight(results, carriage), np.nan
    if what == "position" and moves:
        track = results.models.get(results.study.carriage[carriage].on)
        return (np.nan if track is None else float(track["length"])), np.nan
    return np.nan, own


def _is_pushed(results: Results, sensor: str) -> bool:
    """Whether a carriage pushes a sensor's body as statics do not count, along its track or by a force that pulsates:
    its errors are over its own largest value then."""
    on = [own for own in results.study.carriage.values() if own.on == results.study.body_of(sensor)]
    return any("along" in carriage.pushes or carriage.pulsates for carriage in on)


def _largest(parts: list[xr.DataArray]) -> xr.DataArray:
    """The largest magnitude of some results."""
    return reduce(partial(xr.apply_ufunc, np.fmax), map(abs, parts))


def _cruise(results: Results) -> Any:
    """The length of the part of a cycle at constant speed, m."""
    start, end, turn = (
        results.parameter(f"carriage.{results.carriage_name}.motion.{key}") for key in ("start", "end", "turn")
    )
    return np.abs(end - start) * (1.0 - 2.0 * turn)
