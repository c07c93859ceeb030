"""Figures of sizes have an axis of their own range where that is small, and titles the numbers of the archive."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from studies.pictures.common.figures import Figure
from studies.reporting import answers
from studies.results.formatting import quantity
from studies.results.results import Results
from tests.studies import scenes

ABOARD = """\
[carriage.cart]
on = "bed"
kind = "oscillator"
mass = 10.0
stiffness = 1000.0
motion = { kind = "cruise", start = 0.0, end = 10.0, speed = 8.0 }

[sensor.aboard]
carriage = "cart"
quantity = "acceleration"
"""


def passage(sizes: list[float], question: str = "", **more: str) -> xr.Dataset:
    """A passage at four speeds whose middle sinks by so many mm at most."""
    dataset = scenes.run("passage", scenes.pace("passage"), extra=question, **more)
    dataset["midspan_max"].values[:], dataset["midspan_min"].values[:] = 1e-3 * np.array(sizes), 0.0
    return dataset


def drawn(dataset: xr.Dataset, name: str = "largest-displacement") -> Figure:
    return next(figure for figure in answers.figures(dataset) if figure.name == name)


@pytest.mark.parametrize(
    ("sizes", "question", "ends"),
    [
        ([7.7, 7.72, 7.9, 7.8], "", (7.68, 7.92)),
        ([7.7, 7.701, 7.7, 7.701], "", (7.7 - 0.05 * 7.701 - 1e-4, 7.701 * 1.05 + 1e-4)),
        ([7.0, 7.7, 9.0, 8.0], "", (0.0, None)),
        ([7.7, 7.72, 7.9, 7.8], '[question]\ndisplacement = "8.2 mm"', (7.65, 8.25)),
        ([7.7, 7.72, 7.9, 7.8], '[question]\ndisplacement = "15 mm"', (0.0, None)),
    ],
)
def test_what_changes_by_a_few_per_cent_has_an_axis_of_its_own(
    sizes: list[float], question: str, ends: tuple[float, float | None]
) -> None:
    """Limits that are drawn stay on it; what is the same within 1 % is a line in its middle."""
    figure = drawn(passage(sizes, question))
    axes = figure.drawing.axes[0]
    low, high = sorted(axes.get_ylim())
    assert low == pytest.approx(ends[0], abs=2e-3) and (ends[1] is None or high == pytest.approx(ends[1], abs=2e-3))
    assert ("The axis of midspan does not begin at 0." in figure.caption) == (low > 0.0) and axes.yaxis_inverted()


@pytest.mark.parametrize("place", [4.0, np.nan])
def test_histories_are_titled_with_the_largest_value_of_all_steps(place: float) -> None:
    """Also where the carriage has left by then: its place is that of the history."""
    dataset = passage([7.0, 7.2, 7.4, 7.9])
    dataset["midspan_max_position"].values[:] = place
    title = drawn(dataset, "response").title
    assert title.startswith("midspan reaches 7.9 mm when table has come to ")
    assert title.endswith("4 m") == np.isfinite(place)


def test_the_carriage_that_left_is_told_to_go_on() -> None:
    moves = scenes.text_of("passage", scenes.pace("passage")).replace("speed = 8.0", "speed = 8.0\nafter = 1.0")
    import studies

    caption = drawn(studies.run(moves), "response").caption
    assert "Grey: table has left, and the axis goes on at its last speed." in caption


def test_sensors_aboard_read_the_sprung_mass() -> None:
    results = Results.of(scenes.run("passage", extra=ABOARD))
    assert results.place("aboard") == "of the sprung mass of cart" and results.place("moment") == "under table"
    assert any(
        "the largest acceleration of the sprung mass of cart is" in text for text in answers.answer(results.dataset)
    )


def test_values_below_zero_are_told_to_be_magnitudes() -> None:
    dataset = passage([0.0] * 4)
    dataset["midspan_min"].values[:] = -1e-3 * np.array([1.0, 2.0, 3.0, 2.5])
    said = next(text for text in answers.answer(dataset) if text.startswith("midspan"))
    assert f"the largest displacement at 5 m of bed is {quantity(-3e-3, 'm')} (largest in magnitude)" in said


def test_one_place_is_not_told_twice() -> None:
    """Of the largest value and the largest amplification, where both are in variants of the same words."""
    sweep = f"{scenes.pace('passage')}\nmass = {{ of = 'carriage.table.mass', values = [100.0, 100.001] }}"
    dataset = scenes.run("passage", sweep)
    dataset["dynamic_amplification"].values[...] = 1.0
    top = np.unravel_index(int(np.argmax(dataset["midspan_max"].values)), dataset["midspan_max"].shape)
    dataset["dynamic_amplification"].values[(top[0], 1 - top[1])] = 1.5
    said = next(text for text in answers.answer(dataset) if text.startswith("midspan"))
    assert "relative to statics" not in said and "1.5 times the static" in said


def test_rounding_is_no_panel() -> None:
    """A sway of 5e-20 m, across a track that nothing pushes across, was drawn beside millimetres."""
    other = '[sensor.still]\nbody = "bed"\nat = 2.0'
    dataset = scenes.run("passage", scenes.pace("passage"), extra=other)
    for side in ("max", "min"):
        dataset[f"still_{side}"].values[:] = [3e-20, 5e-20, 4e-20, 1e-20]
    (figure,) = (one for one in answers.figures(dataset) if one.name == "largest-displacement")
    assert "Not drawn: still, 0 m but for rounding." in figure.caption
    assert not any("2 m of bed" in axes.get_ylabel() for axes in figure.drawing.axes)


def test_level_lines_are_a_sentence() -> None:
    """Of sizes and amplifications that are the same all over, below another figure; drawn where there is a limit."""
    for question, is_drawn in (("", False), ('[question]\ndisplacement = "8 mm"', True)):
        dataset = passage([7.7, 7.701, 7.7, 7.701], question)
        dataset["dynamic_amplification"].values[:] = 1.0
        found = {figure.name: figure for figure in answers.figures(dataset)}
        assert ("largest-displacement" in found) == is_drawn
        if is_drawn:  # without a place, which would be that of the last digits
            title = "The largest displacement at 5 m of bed is 7.7 mm, within the limit of 8 mm"
            assert found["largest-displacement"].title == title
        words = "Not drawn: midspan, 7.7 mm, the same within 1 % for pace 1 to 8 m/s."
        words += " Dynamic amplification of midspan: 1 throughout."
        assert any(words in figure.caption for figure in found.values()) != is_drawn
