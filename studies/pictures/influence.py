"""Figures of statics: readings over the position, contact forces, deflected shapes, and how many modes they take."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from studies.at_rest.findings import READING_WANTED, ROUNDING, contacts_vary, reading_errors
from studies.pictures import at_rest
from studies.pictures.common.figures import BLUE, INK, Figure, draw, legend_beside, legend_of_all, shades, widen
from studies.pictures.common.sweep_view import Curve
from studies.results.findings_common import told_hanging
from studies.results.formatting import quantity, scale_for
from studies.results.places import chosen, spread
from studies.results.results import Results

MOST_SENSORS = 5
PANELS = 4  # of errors
SHAPES = 5  # positions with a deflected shape


def pictures(results: Results) -> list[Figure]:
    """All figures that the dataset allows."""
    sensors = list(chosen(list(results.sensors), MOST_SENSORS))
    contacts = [_contacts(results)] if contacts_vary(results) else []
    found = [_readings(results, sensors), *contacts, _shapes(results)]
    if "mode_count" in results.dataset.dims:
        counts = [int(count) for count in results.dataset["mode_count"].values]
        errors = {name: reading_errors(results, name) for name in chosen(list(results.sensors), PANELS)}
        panels = [at_rest.Errors(name.replace("_", " "), counts, error) for name, (error, _) in errors.items()]
        against = next(words for _, words in errors.values())
        words = f"Difference from {against}, over the largest reading."
        found.append(at_rest.error_figure(results, panels, READING_WANTED, words))
    return found


def _curves(results: Results, name: str) -> list[Curve]:
    """One curve without a sweep, else some along its first axis."""
    found, seen = results.dataset[name], at_rest.swept(results)
    if seen is not None and not seen.is_sampled:
        return at_rest.sweep_curves(seen, found)
    flat = np.asarray(found.values).reshape(-1, found.sizes["position"])
    return [Curve("", found["position"].values, flat[i]) for i in spread(len(flat), 6)]


def _readings(results: Results, sensors: list[str]) -> Figure:
    seen = at_rest.swept(results)
    texts = ["Everything at rest.", told_hanging(results, sensors)]
    if any(f"{name}_unreduced" in results.dataset for name in sensors):
        texts.append("Circles are the unreduced finite-element model" + (", without the sweep." if seen else "."))
    if seen is not None:
        texts.append(at_rest.held_words(seen))
    height = 0.7 + 1.7 * len(sensors)
    caption = " ".join(text for text in texts if text)
    return draw("readings", _title(results, sensors[0]), caption, height, partial(_draw, results, sensors))


def _title(results: Results, sensor: str) -> str:
    """Between which readings a sensor lies, and whether the way or the sweep changes them."""
    found, units = results.dataset[sensor], results.sensors[sensor]
    low, high = (quantity(float(end), units) for end in (np.nanmin(found.values), np.nanmax(found.values)))
    said = f"The static {results.noun(sensor)} {results.place(sensor)}"
    if low == high:
        return f"{said} is {low} all along the way"
    if results.size == 1:
        return f"{said} goes from {low} to {high} along the way"
    largest = float(np.nanmax(np.abs(found.values)))
    way = float((found.max("position") - found.min("position")).max())
    if way <= ROUNDING * largest:
        return f"{said} lies between {low} and {high} over the sweep, each all along the way"
    return f"{said} lies between {low} and {high} over the way and the sweep"


def _draw(results: Results, sensors: list[str], drawing: Drawing) -> None:
    rows, seen = drawing.subplots(len(sensors), 1, squeeze=False, sharex=True)[:, 0], at_rest.swept(results)
    for axes, name in zip(rows, sensors, strict=True):
        curves = _curves(results, name)
        scale = scale_for(float(np.nanmax([np.abs(curve.y).max() for curve in curves])), results.sensors[name])
        for curve, colour in zip(curves, shades(len(curves)), strict=True):
            noun = seen.x.noun if seen is not None and seen.x is not None else ""
            axes.plot(curve.x, curve.y * scale.factor, color=colour, label=f"{noun} {curve.label}")
        if f"{name}_unreduced" in results.dataset:
            full = results.dataset[f"{name}_unreduced"]
            where, style = full["unreduced_position"], {"markersize": 4.5, "markerfacecolor": "none", "color": INK}
            axes.plot(where, full * scale.factor, "o", **style)
        widen(axes, [curve.y * scale.factor for curve in curves])
        axes.set_ylabel(results.label(name, scale.unit))
        axes.set_title(name.replace("_", " "))
        if results.hangs(name):
            axes.invert_yaxis()
    rows[-1].set_xlabel(at_rest.position_title(results))
    drawing.align_ylabels()
    if len(rows[0].lines) > 2:
        legend_of_all(drawing, rows[0])


def _contacts(results: Results) -> Figure:
    one = results.size > 1
    caption = "At rest; below zero a contact would lift off." + (" Of the middle of the sweep." if one else "")
    forces = results.dataset["contact_force"].values
    low, high = (quantity(float(end), "N") for end in (np.nanmin(forces), np.nanmax(forces)))
    title = f"Contact forces lie between {low} and {high}"
    return draw("contacts", title, caption, 2.8, partial(_draw_contacts, results))


def _draw_contacts(results: Results, drawing: Drawing) -> None:
    axes, found = drawing.subplots(), results.dataset["contact_force"]
    middle = found.isel({dim: size // 2 for dim, size in zip(results.dims, results.shape, strict=True)})
    scale = scale_for(float(np.nanmax(np.abs(middle.values))), "N")
    names = [str(name) for name in middle["contact"].values]
    for name, colour in zip(names, shades(len(names)), strict=True):
        axes.plot(middle["position"], middle.sel(contact=name) * scale.factor, color=colour, label=name)
    widen(axes, list(np.asarray(middle.values).T * scale.factor))
    axes.set(xlabel=at_rest.position_title(results), ylabel=f"contact force ({scale.unit})")
    if len(names) > 1:
        legend_beside(axes)


def _shapes(results: Results) -> Figure:
    bodies = at_rest.places(results)
    positions = len(spread(results.dataset.sizes["position"], SHAPES))
    caption = (
        f"With the carriage at {positions} positions, down as gravity points"
        + ("; a body that rides counts from where it stands on level rigid ground." if len(bodies) > 1 else ".")
        + (" Of the scene without its sweep." if results.size > 1 else "")
    )
    height = 0.7 + 2.1 * len(bodies)
    sag = float(np.nanmax(np.abs(results.dataset["deflection"].values)))
    title = f"The bodies deflect by up to {quantity(sag, 'm')}"
    return draw("deflection", title, caption, height, partial(_draw_shapes, results))


def _draw_shapes(results: Results, drawing: Drawing) -> None:
    found, bodies = results.dataset["deflection"], at_rest.places(results)
    rows = drawing.subplots(len(bodies), 1, squeeze=False, sharex=True)[:, 0]
    chosen_places = spread(found.sizes["position"], SHAPES)
    for number, (axes, body) in enumerate(zip(rows, bodies, strict=True)):
        lines = np.asarray(found.isel(on_body=number).values)
        scale = scale_for(float(np.abs(lines).max()), "m")
        for place, colour in zip(chosen_places, shades(len(chosen_places)), strict=True):
            position = float(found["position"][place])
            x, y = body.at(position), lines[place] * scale.factor
            label = f"{results.carriage_name} at {quantity(position, 'm')}"
            axes.plot(x, y, color=colour if len(chosen_places) > 1 else BLUE, label=label)
            if body.name == results.carriage.on and x.min() <= position <= x.max():  # the first axle of a train leaves
                at_rest.carriage_marks(axes, results, position, float(np.interp(position, x, y)))
        axes.set_ylabel(f"deflection\nof {body.name} ({scale.unit})")
        axes.invert_yaxis()
    rows[-1].set_xlabel(at_rest.way_title(results))
    legend_of_all(drawing, rows[0])
