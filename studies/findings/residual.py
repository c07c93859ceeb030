"""How far sensors swing about their static values after all carriages have come to rest or left, in sentences."""

import numpy as np

from engine.scene.study import Study
from studies.findings.absolute_errors import absolute_errors, told_error
from studies.findings.beyond import LIMITED, Limits, where_beyond
from studies.results.axes import PACES, Axis
from studies.results.findings_common import in_words
from studies.results.formatting import quantity
from studies.results.places import extreme
from studies.results.results import Results

MOST_SENSORS = 4


def check_residual(study: Study, limits: Limits) -> None:
    """Refuse limits of residual vibrations that are not told. Raises BadInput."""
    if any(limits.limit(name) is not None for name in LIMITED) and not study.output.residual:
        what = "a limit of residual vibrations, which this study does not tell"
        raise study.source.fault("question.residual", what, expected="[output] residual = true beside it")


def residuals(results: Results, limits: Limits) -> list[str]:
    """The largest residual vibration of sensors, and where limits are exceeded, those with a limit first; nothing where
    the study does not tell it."""
    told = list(results.sensors) if results.study.output.residual else []
    told.sort(key=lambda sensor: limits.limit(results.study.sensor[sensor].quantity) is None)
    return [_residual(results, sensor, limits) for sensor in told[:MOST_SENSORS]]


def _residual(results: Results, sensor: str, limits: Limits) -> str:
    name, units = f"{sensor}_residual", results.sensors[sensor]
    values = np.asarray(results.dataset[name].transpose(*results.dims).values, dtype=np.float64)
    place = extreme(np.where(results.with_values, values, np.nan))
    if place is None:
        return f"{sensor}: no variant has a residual vibration."
    size = float(values[place])
    off = told_error(float(absolute_errors(results, name)[place]), size, units)  # parts of a static value mislead here
    said = f"{sensor}: at rest it still swings by up to {quantity(size, units)}{off}{in_words(results, place)}"
    limit = limits.limit(results.study.sensor[sensor].quantity)
    if limit is None:
        return f"{said}."
    axis = _axis(results)
    over = f" of {axis.noun}" if axis is not None else ""
    return f"{said}; it exceeds {quantity(limit, units)} {where_beyond(results, values, limit, axis)}{over}."


def _axis(results: Results) -> Axis | None:
    """The swept pace, or the one number that is swept at all."""
    varied = [axis for axis in results.axes if axis.values.size > 1]
    return results.axis(*PACES) or (varied[0] if len(varied) == 1 else None)
