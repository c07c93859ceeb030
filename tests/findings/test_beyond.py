"""Which sensors an answer names first, and where in a sweep they are beyond a limit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from results_schema.arrays import Array
from results_schema.status import Status
from studies.findings.beyond import told_limit, where_beyond
from studies.findings.effects import by_effect
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


def test_what_comes_near_its_limit_is_told_with_its_largest_value() -> None:
    """3.487 m/s2 at 101 speeds exceeded 3.5 "nowhere", and 3.502 between two of them."""
    near, far = (" ".join(answers.answer(passage(f"[question]\nacceleration = {limit}"))) for limit in (6.05, 20.0))
    assert "Its absolute value exceeds 6.05 m/s² nowhere from 1 to 8 m/s; at most it is 6 m/s²." in near
    assert "exceeds 20 m/s² nowhere from 1 to 8 m/s." in far


@pytest.mark.parametrize(
    ("quantity", "limit", "said"), [("contact_force", 1200.0, "1.2 kN"), ("suspension_force", 5.0, "5 N")]
)
def test_forces_of_carriages_have_limits_too(quantity: str, limit: float, said: str) -> None:
    sensor = f'[sensor.pressed]\ncarriage = "cart"\nquantity = "{quantity}"'
    question = f"{SENSORS}\n{sensor}\n[question]\n{quantity} = {limit}"
    dataset = scenes.run("passage", scenes.pace("passage"), extra=question)
    for end, value in (("max", 2.0 * limit), ("min", 0.0)):
        dataset[f"pressed_{end}"].values[:] = [0.0, 0.0, value, 0.0]
    first = answers.answer(dataset)[0]
    assert first.startswith("pressed: ") and f"Its absolute value exceeds {said} at 5.67 m/s" in first


def test_titles_name_the_largest_of_their_quantity() -> None:
    titles = {figure.name: figure.title for figure in answers.figures(passage())}
    assert titles["largest-displacement"].startswith("The largest displacement at 2.5 m of bed is 3 mm, at pace")
    assert titles["largest-bending-moment"].startswith("The largest bending moment at 1 m of bed is 4 N m, at pace")


MASSES = 'mass = { of = "carriage.table.mass", values = [50, 60, 70, 80, 90] }'


def beyond(*speeds: int, count: int = 20, masses: tuple[int, ...] = ()) -> str:
    """Where values exceed a limit that do so at these of so many speeds in km/h, at each for one of four masses."""
    pace = f'speed = {{ of = "carriage.table.motion.speed", from = "1 km/h", to = "{count} km/h", count = {count} }}'
    results = Results.of(scenes.run("passage", f"{pace}\n{MASSES}" if masses else pace))
    values = np.zeros(results.shape)
    for place, speed in enumerate(speeds):
        values[(speed - 1, masses[place]) if masses else speed - 1] = 1.0
    return where_beyond(results, values, 0.5, results.axes[0])


@pytest.mark.parametrize(
    ("speeds", "words"),
    [
        ((3,), "at 3 km/h"),
        ((3, 4), "at 3 to 4 km/h"),
        ((1, 5, 7, 8, 9, 20), "at 1, 5, 7 to 9 and 20 km/h"),
        ((1, 3, 5, 7, 9, 11, 13, 14, 17), "at 1, 3, 5, 7, 9, 11, 13 to 14 and 17 km/h"),
        ((3, 19, 20), "at 3 km/h and from 19 km/h to the end of the sweep, 20 km/h"),
        ((1, 3, 19, 20), "at 1 and 3 km/h, and from 19 km/h to the end of the sweep, 20 km/h"),
        ((1, 2, 5, 7, 9, 11, 13, 15, 17), "at 1 to 2, 5, 7, 9, 11, 13, 15 and 17 km/h"),
        ((1, 3, 5, 7, 9, 11, 13, 15, 17), "in 9 parts of the sweep, first at 1 km/h, last at 17 km/h"),
        (
            (1, 2, 4, 6, 8, 10, 12, 14, 16, 19, 20),
            "in 9 parts of the sweep, first at 1 to 2 km/h, last from 19 km/h to the end of the sweep, 20 km/h",
        ),
    ],
)
def test_up_to_eight_parts_of_a_sweep_are_listed_with_one_unit(speeds: tuple[int, ...], words: str) -> None:
    assert beyond(*speeds) == words


def test_what_else_is_swept_stands_with_few_parts_or_once_behind_all() -> None:
    assert beyond(1, 3, masses=(2, 2)) == "at 1 and 3 km/h (mass 70 kg)"
    assert beyond(1, 3, masses=(2, 3)) == "at 1 km/h (mass 70 kg) and at 3 km/h (mass 80 kg)"
    assert beyond(1, 3, 5, 7, masses=(2, 2, 1, 2)) == "at 1, 3, 5 and 7 km/h (mass 60 to 70 kg, not throughout)"


def part_of(values: str, exceeded: list[list[bool]]) -> str:
    """Where values exceed a limit that do so for these of a number's values and of four masses."""
    swept = f'speed = {{ of = "carriage.table.motion.speed", {values} }}\n{MASSES}'
    results = Results.of(scenes.run("passage", swept))
    return where_beyond(results, np.array(exceeded, dtype=np.float64), 0.5, results.axes[0])


@pytest.mark.parametrize(("exceeded", "words"), [((1, 1), "both ways"), ((0, 0), "neither way"), ((0, 1), "backward")])
def test_ways_are_told_as_ways(exceeded: tuple[int, int], words: str) -> None:
    swept = 'way = { of = "carriage.table.motion.direction", values = ["forward", "backward"] }'
    results = Results.of(scenes.run("passage", swept))
    assert words in where_beyond(results, np.array(exceeded, dtype=np.float64), 0.5, results.axes[0])


def test_not_every_combination_is_told() -> None:
    """Each mass exceeds it at some speed, and none at all of them."""
    none, some, full = [False] * 5, [True, True, False, False, False], [True] * 5
    three = "values = [1, 2, 3]"
    assert part_of(three, [none, some, full]) == "from 2 m/s to the end of the sweep, 3 m/s (not with every mass)"
    assert part_of(three, [some, some, full]) == "everywhere from 1 to 3 m/s (not with every mass)"
    assert part_of(three, [none, full, full]) == "from 2 m/s to the end of the sweep, 3 m/s"


def test_values_that_grow_by_a_factor_are_no_further_apart_where_they_are_large() -> None:
    """Of a number that is left out between them it is told as before."""
    none, full = [False] * 5, [True] * 5
    even = 'from = 1, to = 32, count = 6, spacing = "log"'
    assert part_of(even, [none, *[full] * 5]) == "from 2 m/s to the end of the sweep, 32 m/s"
    holed = "values = [1, 2, 3, 4, 11, 12]"
    assert part_of(holed, [none, *[full] * 5]) == "at 2 to 4 m/s and from 11 m/s to the end of the sweep, 12 m/s"


def test_of_samples_the_part_of_the_variants_is_told_at_few_values_of_another_number() -> None:
    """Not "everywhere (not with every mass)", which hides how many."""
    pace = 'speed = { of = "carriage.table.motion.speed", values = [5, 10] }'
    mass = 'mass = { of = "carriage.table.mass", sobol = 10, from = 50, to = 90 }'
    results = Results.of(scenes.run("passage", f"{pace}\n{mass}"))
    speed = next(axis for axis in results.axes if axis.name == "speed")
    own = results.everywhere(results.dataset["speed"])
    some = "at 5 m/s in 30 % and at 10 m/s in 0 % of the variants"
    for beside, words in ((7, some), (0, "everywhere from 5 to 10 m/s")):
        values = np.where(own == 10.0, float(beside == 0), 1.0)
        values[(own == 5.0) & (np.cumsum(own == 5.0).reshape(own.shape) <= beside)] = 0.0
        assert where_beyond(results, values, 0.5, speed).startswith(words)
    assert where_beyond(results, np.zeros(results.shape), 0.5, speed) == "nowhere in the sweep"


def test_of_samples_that_are_told_loosely_both_parts_are_told() -> None:
    """14 % was told where 2 to 46 % were known, and 28 % were true."""
    pace = 'speed = { of = "carriage.table.motion.speed", values = [5, 10] }'
    mass = 'mass = { of = "carriage.table.mass", sobol = 10, from = 50, to = 90 }'
    results = Results.of(scenes.run("passage", f"{pace}\n{mass}"))
    own, speed = results.everywhere(results.dataset["speed"]), results.axis(".motion.speed")
    rank = np.where(own == 5.0, np.cumsum(own == 5.0).reshape(own.shape), 0)
    said = told_limit(results, 0.1 * rank, 0.55, "m", speed, np.where(rank > 0, 0.2, 0.0))
    words = [f"at 5 m/s in {part} % and at 10 m/s in 0 % of the variants" for part in (50, 70, 30)]
    assert "within 1 %" not in told_limit(results, np.where(own == 5.0, 0.549, 0.0), 0.55, "m", speed)
    assert said.endswith(f"exceeds 550 mm {words[0]}; with its estimated error perhaps {words[1]}, surely {words[2]}.")


def test_values_just_below_a_limit_are_told_where_none_beside_is_above() -> None:
    """An acceleration of 3.498 at 278 km/h was 3.503 at 277.5; the ends of what is exceeded say nothing new."""
    pace = 'speed = { of = "carriage.table.motion.speed", from = "1 km/h", to = "9 km/h", count = 9 }'
    results = Results.of(scenes.run("passage", pace))
    values = np.array([1.0, 3.6, 3.49, 1.0, 3.49, 3.46, 1.0, 3.495, 1.0]).reshape(results.shape)
    said = told_limit(results, values, 3.5, "m s-2")
    assert "exceeds 3.5 m/s² at 2 km/h; within 1 % of it, so perhaps beyond between" in said
    assert said.endswith("it comes at 5 km/h and 8 km/h.")
    assert "within 1 %" not in told_limit(results, values, 2.0, "m s-2")


def test_what_lies_between_others_and_is_not_among_them_is_left_out() -> None:
    """Of masses 50 to 90 kg that all but 60 kg exceed a limit."""
    three, some = "values = [1, 2, 3]", [True, False, True, True, True]
    assert part_of(three, [[False] * 5, some, some]) == (
        "from 2 m/s to the end of the sweep, 3 m/s (mass 50 and 70 to 90 kg)"
    )


def samples() -> Results:
    """Sixty of a damping ratio and a mass, in this order of the file."""
    zeta = 'zeta = { of = "body.bed.damping_ratio", sobol = 60, from = 0.01, to = 0.02 }'
    mass = 'mass = { of = "carriage.table.mass", sobol = 60, from = 50, to = 90 }'
    return Results.of(scenes.run("passage", f"{zeta}\n{mass}"))


def test_shares_are_of_the_variants_that_count() -> None:
    """610 of those whose contact holds were told as 41 % of all, of which 170 were left out."""
    given = samples()
    assert where_beyond(given, np.arange(60.0), 44.5, None) == "in 15 variants of 60 (25 %)"
    status = given.dataset["status"].copy()
    status[:10] = int(Status.SEPARATED)
    opened = Results.of(given.dataset.assign(status=status))
    assert where_beyond(opened, np.arange(60.0), 44.5, None) == "in 15 variants of the 50 that count (30 %)"


@pytest.mark.parametrize("shape", [lambda mass: mass, lambda mass: np.cos((mass - 70.0) / 6.0)])
def test_of_samples_that_number_is_first_which_tells_most(shape: Callable[[Array], Array]) -> None:
    """Maps were over the first two numbers of the file, which changed nothing."""
    results = samples()
    zeta, mass = (results.everywhere(results.dataset[name]) for name in ("zeta", "mass"))
    found = by_effect(results, shape(mass) + 10.0 * (zeta - 0.01))
    assert [axis.name for axis in found] == ["mass", "zeta"]
