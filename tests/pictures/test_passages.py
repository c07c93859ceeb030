"""Pages of passages draw every quantity, and what the question asks for first, with its limits."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_hex

from studies.findings.in_step import speeds_in_step, trains_in_step
from studies.pictures.common.figures import VERMILION, Figure
from studies.pictures.common.sizes import MOST_MARKED
from studies.reporting import answers
from studies.reporting.report import MOST_OPEN
from studies.results.formatting import listed, number, quantity
from studies.results.results import Results
from studies.runs import datasets
from studies.runs.archived import results_of
from tests.studies import scenes

PLACES = (1.0, 2.0, 3.0, 4.0, 6.0)
SENSORS = "\n".join(f'[sensor.place_{at:g}]\nbody = "bed"\nat = {at}' for at in PLACES)
SHAKEN = '[sensor.shaken]\nbody = "bed"\nat = 5.0\nquantity = "acceleration"'
LIMITED = 'quantity = "acceleration"\nfrequency_limit = "30 Hz"'
MASS = 'mass = { of = "carriage.table.mass", values = [50, 100] }'


def run(question: str) -> xr.Dataset:
    """Seven sensors of three quantities; the acceleration stands last."""
    return scenes.run("passage", f"{scenes.pace('passage')}\n{MASS}", extra=f"{SENSORS}\n{SHAKEN}\n{question}")


def figures(dataset: xr.Dataset) -> dict[str, Figure]:
    """The figures of the question by name, in their order."""
    return {figure.name: figure for figure in answers.figures(dataset) if not figure.on_method}


def panels(figure: Figure) -> dict[str, Axes]:
    """The panels that tell a sensor, by its title."""
    return {title: axes for axes in figure.drawing.axes if (title := axes.get_title("left"))}


def limits(axes: Axes) -> list[float]:
    """The heights of the lines of limits."""
    lines = [line for line in axes.get_lines() if to_hex(line.get_color()) == VERMILION]
    return [float(np.asarray(line.get_ydata())[0]) for line in lines]


def test_every_quantity_is_drawn_and_the_largest_of_many_sensors() -> None:
    found = figures(run(""))
    assert next(iter(found)) == "largest-displacement"
    assert {"largest-acceleration", "largest-bending-moment"} <= set(found)
    drawn = panels(found["largest-displacement"])
    assert list(drawn) == ["midspan", "place 4", "place 6", "place 3"]
    assert "2 more sensors with smaller values." in found["largest-displacement"].caption
    assert {"midspan", "moment", "shaken"} < set(panels(found["response"]))
    assert not [line for figure in found.values() for axes in panels(figure).values() for line in limits(axes)]


def test_what_has_a_limit_comes_first_with_its_limit_as_a_line_and_in_words() -> None:
    dataset = run('[question]\nacceleration = 0.1\ndisplacement = "11 mm"')
    found, results = figures(dataset), Results.of(dataset)
    first = list(found)[:2]
    assert set(first) == {"largest-acceleration", "largest-displacement"}
    for name, sensor, line, words in (
        ("largest-acceleration", "shaken", 0.1, "limit 0.1 m/s²"),
        ("largest-displacement", "midspan", 11.0, "limit 11 mm"),
    ):
        for own in (found[name], found["response"]):
            axes = panels(own)[sensor]
            assert np.abs(limits(axes)) == pytest.approx(line) and words in [text.get_text() for text in axes.texts]
        size = max(np.abs(dataset[f"{sensor}_{end}"].values).max() for end in ("max", "min"))
        beyond = size > line * (1e-3 if sensor == "midspan" else 1.0)
        assert f"{'beyond' if beyond else 'within'} the limit of" in found[name].title
    told = [sentence.partition(":")[0] for sentence in answers.answer(dataset)]
    assert "shaken" in told and results.sensors["shaken"] == "m s-2"


def test_labels_of_panels_are_whole_and_apart() -> None:
    """Of four stacked panels, beside which what is read takes three lines."""
    places = "\n".join(f"[sensor.up_{at}]\nbody = 'bed'\nat = {at}.5\n{LIMITED}" for at in (2, 4, 6, 7))
    found = figures(scenes.run("passage", scenes.pace("passage"), extra=places))
    for name in ("largest-acceleration-of-modes-up-to-30-hz", "response"):
        found[name].drawing.draw_without_rendering()
        labels = [axes.yaxis.label for axes in panels(found[name]).values()]
        boxes = sorted((label.get_window_extent() for label in labels), key=lambda box: box.y0)
        whole = found[name].drawing.bbox
        assert len(boxes) == 4 and boxes[0].y0 >= whole.y0 and boxes[-1].y1 <= whole.y1
        assert all(lower.y1 < upper.y0 for lower, upper in pairwise(boxes))
        assert all(box.x0 >= whole.x0 for box in boxes)
    assert any("\nof modes up to 30 Hz\n" in label.get_text() for label in labels)


def test_a_limit_far_off_is_told_and_does_not_flatten_the_curves() -> None:
    found = figures(run("[question]\ndisplacement = 2.0"))
    for name in ("largest-displacement", "response"):
        axes = panels(found[name])["midspan"]
        assert not limits(axes) and "limit 2 m, beyond this panel" in axes.get_title("right")
    assert "within the limit of 2 m" in found["largest-displacement"].title


def test_a_trajectory_draws_and_tells_every_quantity() -> None:
    dataset = scenes.run("trajectory", extra=f"{SENSORS}\n{SHAKEN}")
    sensors = next(figure for figure in answers.figures(dataset) if figure.name == "sensors")
    assert list(panels(sensors)) == ["midspan", "moment", "shaken", "place 4"]
    told = [sentence.partition(":")[0] for sentence in answers.answer(dataset)]
    assert [name for name in told if name in Results.of(dataset).sensors] == ["midspan", "moment", "shaken", "place_4"]


def test_limited_quantities_stand_unfolded() -> None:
    found = list(figures(run('[question]\nbending_moment = "1 kN m"\nacceleration = 1.0')))
    assert {"largest-bending-moment", "largest-acceleration"} <= set(found[:2])
    assert set(found[:2]) <= set(found[:MOST_OPEN])


TRAIN = """\
[train.tram]
on = "bed"
kind = "force"
force = 500.0
axles = 6
spacing = 3.0
motion = { kind = "cruise", start = 0.0, end = 10.0, speed = "30 km/h" }

[sensor.quarter]
body = "bed"
at = 2.5

[solver]
steps = 400
tolerance = 0.5
audit = 0
"""
SPEED = 'speed = { of = "train.tram.motion.speed", from = "6 km/h", to = "144 km/h", count = 5 }'


def test_speeds_at_which_axles_push_in_step_are_marked() -> None:
    """The four strongest of those that `check` tells, in every panel, in the unit of the sweep, with one entry."""
    archive = datasets.archive_of(scenes.run("passage", SPEED, extra=TRAIN), "tram.nc")
    results = results_of(archive)
    readers = [results.study.sensor[name] for name in ("midspan", "quarter")]
    told = speeds_in_step(results.study, "tram", archive.groups["/model/bed"], (6.0 / 3.6, 40.0), readers)
    strongest = sorted(told, key=lambda one: one.swing)[-4:]
    assert len(told) > 4
    (figure,) = (one for one in answers.figures_of(results) if one.name == "largest-displacement")
    for axes in figure.drawing.axes[:4]:
        marks = [float(np.asarray(line.get_xdata())[0]) for line in axes.get_lines() if line.get_linestyle() == ":"]
        assert marks == pytest.approx([3.6 * one.speed for one in strongest])
    dotted = [
        f"{number(3.6 * one.speed, 4)} km/h (tram, every {quantity(one.way, 'm')} with {number(one.frequency)} Hz)"
        for one in sorted(strongest)
    ]
    assert f"Dotted: axles in step with a frequency of the body, {listed(dotted)}." in figure.caption
    (legend,) = figure.drawing.legends
    assert [text.get_text() for text in legend.get_texts()] == ["axles in step with a frequency"]
    assert not [one for one in figures(run("")).values() if one.drawing.legends and one.name != "response"]


def test_the_speeds_at_dotted_lines_are_listed_once() -> None:
    """The sentence stood under five figures."""
    moment = '[sensor.bending]\nbody = "bed"\nat = 2.5\nquantity = "bending_moment"\n'
    archive = datasets.archive_of(scenes.run("passage", SPEED, extra=f"{TRAIN}\n{moment}"), "tram.nc")
    captions = [one.caption for one in answers.figures_of(results_of(archive)) if "Dotted" in one.caption]
    assert len(captions) > 1 and "axles in step with a frequency" in captions[0]
    assert all("Dotted: the speeds of the figure before." in one and "axles in step" not in one for one in captions[1:])


def test_axles_are_marked_as_far_apart_as_the_figure_has_them() -> None:
    """At the spacing that it holds, which is that of the answer, not that of the study file; at none of several."""
    spacing = 'spacing = { of = "train.tram.spacing", values = [2.0, 4.0] }'
    load = 'load = { of = "train.tram.force", values = [400, 500] }'
    for other, is_held in ((load, True), ("", False)):
        archive = datasets.archive_of(scenes.run("passage", f"{SPEED}\n{spacing}\n{other}", extra=TRAIN), "tram.nc")
        results = results_of(archive)
        (figure,) = (one for one in answers.figures_of(results) if one.name == "largest-displacement")
        told = [float(text) for text in re.findall(r"tram, every ([\d.]+) m with", figure.caption)]
        held = re.findall(r"Held at spacing ([\d.]+) m", figure.caption)
        assert bool(told) == bool(held) == is_held
        if is_held:
            ways = {at: ways_of(results, at) for at in (float(held[0]), 3.0)}
            assert told == pytest.approx(ways[float(held[0])], rel=5e-3) and told != pytest.approx(ways[3.0], rel=0.05)


def test_axles_are_marked_for_the_bridge_that_the_figure_holds() -> None:
    """Of several it marks none; they were those of the bridge as the study file has it, whatever was swept."""
    soft = 'modulus = { of = "body.bed.youngs_modulus", values = ["210 GPa", "52.5 GPa"] }'
    results = results_of(datasets.archive_of(scenes.run("passage", f"{SPEED}\n{soft}", extra=TRAIN), "tram.nc"))
    (figure,) = (one for one in answers.figures_of(results) if one.name == "largest-displacement")
    assert "axles in step" not in figure.caption
    axis = next(axis for axis in results.axes if axis.name == "speed")
    between, sensors = (float(axis.values.min()), float(axis.values.max())), results.study.sensor.values()
    stiff, half = (trains_in_step(results, axis, {"modulus": place}, between, sensors)["tram"] for place in (0, 1))
    assert stiff[0][1].frequency == pytest.approx(2.0 * half[0][1].frequency)


def ways_of(results: Results, spacing: float) -> list[float]:
    """m in a period at the speeds at which axles so far apart swing a mode most, by ascending speed."""
    given = results.study.without_sweep().with_values({"train.tram.spacing": spacing})
    speeds = results.dataset["speed"].values
    between = float(speeds.min()), float(speeds.max())
    told = speeds_in_step(given, "tram", results.models["bed"], between, given.sensor.values())
    return [one.way for one in sorted(sorted(told, key=lambda one: one.swing)[-MOST_MARKED:])]
