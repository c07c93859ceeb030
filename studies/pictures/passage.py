"""Figures of a passage: the largest values, their amplification, the contact force, the response on the way."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial, reduce
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

from studies.findings.absolute_errors import weight
from studies.findings.amplification import largest, sizes
from studies.findings.beyond import AskedOfPassages, ranked
from studies.findings.effects import unchanged
from studies.findings.residual import crosses
from studies.pictures.common import figures as look
from studies.pictures.common import residual
from studies.pictures.common.figures import Figure, colour_bar, draw, legend_beside, zero_line
from studies.pictures.common.maps import MANY, Mapped, maps
from studies.pictures.common.response import response
from studies.pictures.common.sizes import gain, peak, sizes_of, speed_ratio, told_flat
from studies.pictures.common.sweep_view import (
    DAMPING,
    MOST_CURVES,
    SPEEDS,
    View,
    alone,
    along_axis,
    draw_curves,
    draw_map,
    view,
)
from studies.pictures.common.traces import picked
from studies.protocol.study import question_of
from studies.results.formatting import number, quantity
from studies.results.places import Index
from studies.results.results import Results

MOST_HISTORIES = 4
CURVES = (".mass", *DAMPING, ".force")  # by what they tell: a force multiplies all that it does by the same factor
FLAT = 0.1  # a map of ratios that vary less shows nothing
DOTTED, SAME = re.compile(r"Dotted: .*?\.(?= |$)"), "Dotted: the speeds of the figure before."


class _Below(NamedTuple):
    """What carriages do where their contact force is negative; name: of the figure of several."""

    name: str
    title: str
    caption: str
    legend: str


RESTING = _Below("contact", "would lift off", "the carriage would lift off", "contact opens")
GUIDED = _Below("contact-guided", "is held down by its guide", "the guide of the carriage pulls", "its guide pulls")


def pictures(results: Results) -> list[Figure]:
    """All figures that the sweep and the kept histories allow: what rings on, where that is told, sizes of the first
    quantity and of those with a limit come first, those of others last. What rings on after a crossing comes behind
    these sizes."""
    limits = question_of(results.study, AskedOfPassages)
    sensors = [name for name in ranked(results, limits) if np.isfinite(sizes(results, name)).any()]
    if not sensors:
        return []
    top = _top(results, sensors[0])
    seen, first, others, level = _view(results, top), list[Figure](), list[Figure](), list[str]()
    if seen.x is not None:
        for name in dict.fromkeys(results.study.sensor[sensor].words for sensor in sensors):
            own = [sensor for sensor in sensors if results.study.sensor[sensor].words == name]
            limit = limits.of(results.study.sensor[own[0]])
            if all(unchanged(results, sizes(results, sensor)) for sensor in own):
                continue  # the findings say so
            if said := told_flat(_view(results, _top(results, own[0])), own, limit):
                level.append(said)
                continue
            asked = not first or limit is not None
            (first if asked else others).append(_sizes(results, own, limit))
        many = seen.y is not None and len(seen.y.values) > MANY
        telling = many and _is_telling(seen, gain(results, sensors[0]))
        if not telling or _amplified_elsewhere(results, sensors[0], top):
            first += _map_of_sizes(results, sensors[0], limits)
        first += [_map(seen, sensors[0])] if telling else []
        touching = [name for name in results.study.carriage if _has_contact(seen, name)]
        resting = [name for name in touching if results.study.carriage[name].may_lift]
        guided = [name for name in touching if name not in resting]
        first += [_contact(seen, some, words) for some, words in ((resting, RESTING), (guided, GUIDED)) if some]
    size = np.where(results.with_values, sizes(results, sensors[0]), np.nan)
    shown = picked(results, size, MOST_HISTORIES)
    on_the_way = [response(results, sensors, limits, shown, top)] if shown else []
    found = [*first, *on_the_way, *others]
    if level and found:
        found[0] = replace(found[0], caption=" ".join([found[0].caption, *level]))
    rings, found = residual.pictures(results, limits), _dotted_once(found)
    place = len(first) if crosses(results) else 0
    return [*found[:place], *rings, *found[place:]]


def _dotted_once(figures: list[Figure]) -> list[Figure]:
    """Figures of which the first alone lists the speeds at its dotted lines, where others have the same."""
    lists = [found[0] if (found := DOTTED.search(figure.caption)) else "" for figure in figures]
    again = [bool(text) and text in lists[:place] for place, text in enumerate(lists)]
    return [
        replace(figure, caption=figure.caption.replace(text, SAME)) if repeated else figure
        for figure, text, repeated in zip(figures, lists, again, strict=True)
    ]


def _top(results: Results, sensor: str) -> Index:
    """The variant with the largest value of a sensor that has values."""
    top = largest(results, sizes(results, sensor))
    assert top is not None
    return top


def _sizes(results: Results, sensors: list[str], limit: float | None) -> Figure:
    """The sizes of sensors of one quantity, where those of the first one are largest."""
    top = _top(results, sensors[0])
    return sizes_of(_view(results, top), sensors, limit, top)


def _view(results: Results, at: Index) -> View:
    return view(results, SPEEDS, CURVES, at)


def _varies(seen: View, values: Any) -> bool:
    """Whether ratios differ over the shown part of the sweep by more than an eye sees in colours."""
    known = seen.plane(values)
    known = known[np.isfinite(known)]
    return bool(known.size and np.ptp(known) > FLAT)


def _amplified_elsewhere(results: Results, sensor: str, top: Index) -> bool:
    """Whether another variant than the one with the largest value of a sensor is amplified most."""
    return largest(results, gain(results, sensor).values) != top


def _is_telling(seen: View, values: Any) -> bool:
    """Whether ratios differ so along both axes: a map with stripes says no more than curves."""
    return all(seen.most_along(axis, values) > FLAT for axis in (seen.x, seen.y) if axis is not None)


def _has_contact(seen: View, carriage: str) -> bool:
    """Whether there is a force of a carriage that varies; what is the same everywhere the findings say."""
    inertial = seen.results.study.carriage[carriage].inertial
    has = inertial and f"{carriage}_contact_force_min" in seen.results.dataset
    return has and _varies(seen, _relative_force(seen, carriage))


def _map(seen: View, sensor: str) -> Figure:
    results = seen.results
    shown, status = seen.plane(gain(results, sensor)), results.dataset["status"].transpose(*results.dims)
    counting = seen.plane(status.copy(data=results.with_values)) > 0.0
    opened = bool((np.isfinite(shown) & ~counting).any())
    counting = counting if np.isfinite(shown[counting]).any() else np.isfinite(shown)
    title = f"{sensor.replace('_', ' ')}: dynamic over static is {number(float(np.nanmax(shown[counting])))} at most"
    caption = seen.caption("While the contact holds the title counts; the map goes on beyond." if opened else "")
    return draw("amplification-map", title, caption, 3.4, partial(_draw_map, seen, sensor))


def _map_of_sizes(results: Results, sensor: str, limits: AskedOfPassages) -> list[Figure]:
    """Of a sensor whose amplification is not known, or varies little, the largest values themselves."""
    values = np.where(results.with_values, sizes(results, sensor), np.nan)
    limit, label = limits.of(results.study.sensor[sensor]), partial(results.label, sensor, of="largest")
    most = quantity(peak(results, sensor), results.sensors[sensor])
    title = f"{sensor.replace('_', ' ')} over two swept numbers: at most {most}"
    mapped = Mapped(values, results.sensors[sensor], label, limit)
    return maps(results, mapped, f"largest-{results.noun(sensor)}", title, "Largest absolute values.")


def _draw_map(seen: View, sensor: str, drawing: Drawing) -> None:
    axes = drawing.subplots()
    mesh = draw_map(axes, seen, gain(seen.results, sensor), cmap="viridis")
    speed_ratio(axes, seen)
    colour_bar(axes, mesh, "dynamic amplification")


def _contact(seen: View, carriages: list[str], words: _Below) -> Figure:
    """One figure for all carriages: a curve for each, or of many, and in maps, the smallest of all."""
    force, several = _smallest_force(seen, carriages), len(carriages) > 1
    alike = ""
    if seen.y is not None and not seen.is_sampled and seen.most_along(seen.y, force) <= FLAT:
        alike, seen = f"Nearly the same for {seen.y.noun} {seen.y.span}.", alone(seen)
    line = "; the line is where that begins" if _has_line(seen, force) else ""
    caption = seen.caption(
        "Smallest contact force over the weight, without the last 2 % of a way towards a held end.",
        f"Of {len(carriages)} carriages the smallest." if several and not _apart(seen, carriages) else "",
        f"Below zero {words.caption}{line}.",
        alike,
    )
    least = float(np.nanmin(seen.plane(force)))
    who, keeps, its = (f"{len(carriages)} carriages", "keep", "their") if several else (carriages[0], "keeps", "its")
    title = f"{who} {keeps} {its} contact, with at least {number(least, 2)} of {its} weight"
    if least < 0.0:
        title = f"{f'The first of {who}' if several else who} {words.title}{_from(seen, force)}"
    elif float(np.nanmin(force)) < 0.0:
        title = f"{who} {keeps} {its} contact in this part of the sweep, and {words.title} in another"
    height = 3.4 if _in_plane(seen) else 2.8
    name = words.name if several else f"contact-{who}"
    return draw(name, title, caption, height, partial(_draw_contact, seen, carriages, words))


def _apart(seen: View, carriages: list[str]) -> bool:
    """Whether each carriage has a curve of its own."""
    return seen.y is None and not seen.is_sampled and len(carriages) <= MOST_CURVES


def _smallest_force(seen: View, carriages: list[str]) -> Any:
    """Of all carriages the smallest contact force over the weight."""
    return reduce(np.fmin, (_relative_force(seen, carriage) for carriage in carriages))


def _from(seen: View, force: Any) -> str:
    """From which value of the horizontal axis on a force turns negative anywhere in the shown part; where first if it
    does not at every value beyond."""
    assert seen.x is not None
    grid = seen.plane(force)
    known = np.isfinite(grid).reshape(len(grid), -1).any(axis=1)
    opened = np.asarray((np.nan_to_num(grid) < 0.0).reshape(len(grid), -1).any(axis=1))
    along = seen.along(seen.x)
    first = float(along[opened].min())
    at = f"{seen.x.noun} {seen.x.in_words(first / seen.x.factor)}"
    return f" from {at} on" if opened[known & (along >= first)].all() else f", first at {at}"


def _relative_force(seen: View, carriage: str) -> Any:
    """Smallest contact force over the weight."""
    return seen.results.dataset[f"{carriage}_contact_force_min"] / weight(seen.results, carriage)


def _has_line(seen: View, force: Any) -> bool:
    """Whether a map of the force has a line of zero: where both signs occur."""
    grid = seen.plane(force)
    known = grid[np.isfinite(grid)]
    return bool(
        _in_plane(seen)
        and not seen.is_sampled
        and min(grid.shape) >= 2
        and known.size
        and known.min() < 0.0 < known.max()
    )


def _in_plane(seen: View) -> bool:
    """Whether a force is drawn in colours over two axes: of samples, and of more values than curves show."""
    return seen.y is not None and (seen.is_sampled or len(seen.y.values) > MANY)


def _draw_contact(seen: View, carriages: list[str], words: _Below, drawing: Drawing) -> None:
    force = _smallest_force(seen, carriages)
    axes = drawing.subplots()
    if len(carriages) > 1 and _apart(seen, carriages):
        each = [(name, seen.curves(_relative_force(seen, name))) for name in carriages]
        draw_curves(axes, seen, [curve._replace(label=name) for name, (curve,) in each])
        legend_beside(axes, "carriage")
    elif not _in_plane(seen):
        draw_curves(axes, seen, seen.curves(force))
    if not _in_plane(seen):
        zero_line(axes)
        along_axis(axes, seen)
        axes.set_ylabel("smallest contact force / weight")
    else:
        mesh = draw_map(axes, seen, force, cmap="PuOr", vmin=-1.0, vmax=1.0)
        colour_bar(axes, mesh, "smallest contact force / weight", extend="both")
    speed_ratio(axes, seen)
    if _has_line(seen, force):
        assert seen.x is not None and seen.y is not None
        x, y = seen.along(seen.x), seen.along(seen.y)
        axes.contour(x, y, seen.plane(force).T, [0.0], colors=look.VERMILION, linewidths=1.8)
        line = Line2D([], [], color=look.VERMILION, linewidth=1.8)
        axes.legend([line], [words.legend], loc="lower right", framealpha=0.85, frameon=True)
