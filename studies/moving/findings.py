"""What studies of bodies in moving frames answer, in sentences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from studies.results.findings_common import in_words, told_statuses
from studies.results.formatting import quantity
from studies.results.results import extreme

if TYPE_CHECKING:
    from studies.results.results import Results

MOST_SENSORS = 4
FAST = 0.2  # of the lowest frequency: stiffening by rotation changes that by some 2 % there


def answer(results: Results) -> list[str]:
    """Carriages that slide, sensors, ends of tracks, statuses."""
    return [*sliding(results), *others(results)]


def others(results: Results) -> Iterator[str]:
    """All but carriages that slide."""
    yield from _sensors(results)
    yield from _ends(results)
    yield from _beyond_theory(results)
    yield from told_statuses(results)


def _span(low: np.ndarray, high: np.ndarray, units: str) -> str:
    ends = float(np.nanmin(low)), float(np.nanmax(high))
    return " to ".join(quantity(end, units, beside=max(map(abs, ends))) for end in ends)


def sliding(results: Results) -> Iterator[str]:
    """Where carriages slide, how fast they swing, and how hard they press."""
    dataset = results.dataset
    for name, carriage in results.study.carriage.items():
        if not carriage.motion.slides or np.isnan(dataset[f"{name}_position_max"].values).all():
            continue
        over = " over all variants" if results.size > 1 else ""
        way = _span(dataset[f"{name}_position_min"].values, dataset[f"{name}_position_max"].values, "m")
        swings = dataset[f"{name}_period"].values
        said = f"{name} slides over {way}{over}"
        if np.isfinite(swings).any():
            many = results.size > 1
            said += f", with a period of {_span(swings, swings, 's') if many else quantity(float(swings), 's', 4)}"
        yield f"{said}."
        force = dataset[f"{name}_contact_force_max"]
        index = extreme(force)
        if index is not None:
            span = _span(dataset[f"{name}_contact_force_min"].values, force.values, "N")
            yield f"Its contact force goes from {span}, the largest{in_words(results, index)}."


def _sensors(results: Results) -> Iterator[str]:
    for sensor, units in list(results.sensors.items())[:MOST_SENSORS]:
        low, high = (results.dataset[f"{sensor}_{end}"] for end in ("min", "max"))
        if np.isnan(low.values).all():
            yield f"{sensor}: no variant has values."
            continue
        largest = np.maximum(np.abs(low), np.abs(high))
        index = extreme(largest)
        assert index is not None
        span = _span(low.values[index], high.values[index], units)
        yield f"{sensor}: from {span}{in_words(results, index)}."


def _ends(results: Results) -> Iterator[str]:
    """How far the ends of tracks swing over the ground."""
    moves = [name for name, frame in results.study.frame.items() if frame.joints]
    for name in moves[:MOST_SENSORS]:
        spans = (results.dataset["end_max"] - results.dataset["end_min"]).sel(frame=name)
        if not np.isfinite(spans.values).any():
            continue
        widest = [quantity(float(np.nanmax(spans.sel(component=axis))), "m") for axis in ("x", "y", "z")]
        yield f"The far end of {name} moves over {widest[0]}, {widest[1]} and {widest[2]} along x, y and z."


def _beyond_theory(results: Results) -> Iterator[str]:
    """Bodies that turn fast without getting stiffer by it."""
    if "frame_rate" not in results.dataset:
        return
    for name, frame in results.study.frame.items():
        modal = results.recorded(name)
        rate = np.abs(results.dataset["frame_rate"].sel(frame=name).values)
        if frame.stiffening or not frame.joints or modal is None or not np.isfinite(rate).any():
            continue
        frequency = modal["frequency"].values
        lowest = 2.0 * np.pi * float(frequency[frequency > 0.0].min(initial=np.inf))
        part = float(np.nanmax(rate)) / lowest
        if part > FAST:
            yield (
                f"{name} turns with up to {quantity(float(np.nanmax(rate)), 'rad s-1')}, {part:.2g} times its lowest "
                f"natural frequency: without frame.{name}.stiffening that is beyond the theory."
            )
