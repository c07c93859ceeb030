"""Which sensors an answer names first, and where in a sweep they are beyond a limit."""

from __future__ import annotations

import numpy as np
import xarray as xr

from studies.reporting import answers
from studies.results.results import Results
from tests.studies import scenes

SENSORS = """\
[sensor.quarter]
body = "bed"
at = 2.5
[sensor.hogging]
body = "bed"
at = 1.0
quantity = "bending_moment"
[sensor.shaken]
body = "bed"
at = 5.0
quantity = "acceleration"
[sensor.shaken_most]
body = "bed"
at = 2.5
quantity = "acceleration"
[sensor.aboard]
carriage = "cart"
quantity = "acceleration"

[carriage.cart]
on = "bed"
kind = "oscillator"
mass = 1.0
stiffness = 1000.0
headway = 2.0
motion = { kind = "cruise", start = 0.0, end = 10.0, speed = 8.0 }
"""
LARGEST = {  # the first sensor of a quantity is nowhere the largest
    "midspan": 1e-3,
    "moment": 2.0,
    "quarter": 3e-3,
    "hogging": -4.0,
    "shaken": 5.0,
    "shaken_most": -6.0,
    "aboard": 7.0,
}


def passage(question: str = "", **largest: float) -> xr.Dataset:
    """A passage at four speeds whose sensors reach these values at the third."""
    dataset = scenes.run("passage", scenes.pace("passage"), extra=f"{SENSORS}\n{question}")
    for name, value in (LARGEST | largest).items():
        high, low = (dataset[f"{name}_{end}"].values for end in ("max", "min"))
        high[:], low[:] = np.where(np.isfinite(high), 0.0, high), 0.0
        (high if value > 0.0 else low)[2] = value
    return dataset


def subjects(dataset: xr.Dataset) -> list[str]:
    """The sensors of the answer in their order."""
    named = [text.partition(":")[0] for text in answers.answer(dataset)]
    return [name for name in named if name in Results.of(dataset).sensors]


def test_the_largest_of_every_quantity_is_told_before_a_second_sensor_of_any() -> None:
    """By absolute values; what a carriage's own mass does is no quantity of the bed."""
    dataset = passage()
    assert subjects(dataset) == ["quarter", "hogging", "shaken_most", "aboard", "midspan", "moment"]
    said = answers.answer_of(Results.of(dataset))
    assert said[0].startswith("quarter: the largest displacement at 2.5 m of bed is 3 mm")
    assert said[1].startswith("hogging: the largest bending moment at 1 m of bed is -4 N m")
    assert said[2].startswith("shaken_most: the largest acceleration at 2.5 m of bed is -6 m/s²")
    assert [text.partition(":")[0] for text in said] == ["quarter", "hogging", "shaken_most", "aboard"]


def test_quantities_with_a_limit_come_first_and_then_their_other_sensors() -> None:
    dataset = passage("[question]\nacceleration = 10.0\nbending_moment = 5.0", aboard=6.5)
    assert subjects(dataset) == ["hogging", "aboard", "shaken_most", "quarter", "shaken", "moment"]


def test_titles_name_the_largest_of_their_quantity() -> None:
    titles = {figure.name: figure.title for figure in answers.figures(passage())}
    assert titles["largest-displacement"].startswith("The largest displacement at 2.5 m of bed is 3 mm, at pace")
    assert titles["largest-bending-moment"].startswith("The largest bending moment at 1 m of bed is 4 N m, at pace")
