"""What swept numbers do one by one, from sweeps whose answer is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import studies
from engine.scene.study import Study
from results_schema.status import Status
from studies.findings.amplification import sizes
from studies.findings.effects import told_both_ways, told_effects, unchanged
from studies.reporting import answers
from studies.results.results import Results
from tests.engine.build import beam, cruise, fixed, mass, oscillator, study
from tests.studies import scenes

MASS = 'mass = { of = "carriage.table.mass", values = [200, 50, 100] }'
DEAD = 'place = { of = "sensor.dead.at", values = [1.0, 2.0] }'
IT = "the largest displacement"
ELSEWHERE = '[sensor.dead]\nbody = "bed"\nat = 1.0'


WAY = 'way = { of = "carriage.table.motion.direction", values = ["forward", "backward"] }'


def test_forward_is_compared_with_backward() -> None:
    """In words; the values are those of two studies, one with the ends of the way exchanged, to the last bit."""
    clamped = {"body.bed.supports": "clamped-free", "solver.steps": 800, "solver.scheme": "average-acceleration"}
    exchanged = {"carriage.table.motion.start": 10.0, "carriage.table.motion.end": 0.0}
    both = studies.run(scenes.study("passage", f"{WAY}\n{MASS}").with_values(clamped))
    there, back = (
        studies.run(scenes.study("passage", MASS).with_values(own)) for own in (clamped, clamped | exchanged)
    )
    for name in ("midspan_max", "midspan_min", "moment_min", "table_contact_force_max"):
        np.testing.assert_array_equal(both[name].sel(way=1), there[name])
        np.testing.assert_array_equal(both[name].sel(way=-1), back[name])
    assert (abs(there["midspan_max"] / back["midspan_max"] - 1.0) > 0.01).all()
    said = answers.answer(both)[0]
    assert " forward, " in said and " backward." in said and "over way" not in said


@pytest.mark.parametrize(
    ("backward", "error", "words"),
    [
        ([1.0, 2.0, 3.0], 0.0, " Forward and backward it is the same."),
        ([1.0, 2.1, 3.0], 0.1, " Forward and backward it is the same within its estimated error."),
        ([1.0, 2.1, 3.0], 0.03, " Forward and backward it is the same within its estimated error."),
        ([1.0, 2.1, 3.2], 0.0, " Forward and backward it differs most at mass 100 kg: 3 m forward, 3.2 m backward."),
        ([1.0, 2.0001, 3.0], 0.0, " Forward and backward it hardly differs: by at most 0.005 %, at mass 50 kg."),
        ([1.0, np.nan, 2.9], 0.0, " Forward and backward it differs most at mass 100 kg: 3 m forward, 2.9 m backward."),
    ],
)
def test_both_ways_in_words(backward: list[float], error: float, words: str) -> None:
    """Of masses 200, 50 and 100 kg."""
    results = Results.of(scenes.run("passage", f"{WAY}\n{MASS}"))
    assert results.dims == ("way", "mass")
    assert told_both_ways(results, np.array([[1.0, 2.0, 3.0], backward]), "it", "m", error) == words


def test_directions_are_words_along_an_axis_too() -> None:
    figures = {one.name: one for one in answers.figures(scenes.run("passage", WAY, extra=ELSEWHERE))}
    axes = [one for figure in figures.values() for one in figure.drawing.axes if one.get_xlabel() == "way"]
    assert axes and all([tick.get_text() for tick in one.get_xticklabels()] == ["forward", "backward"] for one in axes)


def test_without_a_swept_direction_nothing_is_said_of_both_ways() -> None:
    results = Results.of(scenes.run("passage", MASS))
    assert told_both_ways(results, np.ones(3), "it", "m") == ""


def test_each_number_is_told_by_itself() -> None:
    """A heavier table deflects the bed more, in proportion at a crawl; where another sensor reads changes nothing."""
    crawl = 'pace = { of = "carriage.table.motion.speed", from = 0.02, to = 0.04, count = 3 }'
    results = Results.of(scenes.run("passage", f"{crawl}\n{MASS}\n{DEAD}", extra=ELSEWHERE))
    said = told_effects(results, sizes(results, "midspan"), "it")
    assert said.startswith("With the worst of all else that is swept, it ")
    assert "grows 4 times over mass 50 to 200 kg" in said and "stays the same over place 1 to 2 m" in said
    assert answers.answer(results.dataset)[0].endswith(told_effects(results, sizes(results, "midspan"), IT))


def test_the_largest_over_all_others_counts() -> None:
    """Not what lies in the middle of their sweeps, where more mass looks as if it changed nothing."""
    results = Results.of(scenes.run("passage", f"{scenes.pace('passage')}\n{MASS}"))
    values = np.ones((4, 3))
    values[3] = 2.0, 5.0, 4.0  # masses 200, 50 and 100 kg
    said = told_effects(results, values, "it")
    assert said == (
        "With the worst of all else that is swept, it grows 5 times over pace 1 to 8 m/s and falls to 1/2.5 over mass "
        "50 to 200 kg."
    )
    values[0] = 5.0, 0.0, 0.0
    assert "changes by up to 25 % over mass" in told_effects(results, values, "it")


def test_what_may_be_an_error_is_no_effect() -> None:
    """ "Changes by up to 41 % over rope stiffness" was told of 62 +- 7, 51 +- 12 and 72 +- 8 um."""
    results = Results.of(scenes.run("passage", f"{scenes.pace('passage')}\n{MASS}"))
    values, error = np.ones((4, 3)), np.full((4, 3), 0.1)
    values[3] = 2.0, 2.3, 2.15
    said = told_effects(results, values, "it", 1.6 * error)
    assert "grows 2.3 times over pace" in said and "changes within its estimated error over mass" in said
    assert "falls by 13 % over mass" in told_effects(results, values, "it", error)


@pytest.mark.parametrize("place", range(12))
def test_where_a_contact_opens_what_is_largest_is_not_known(place: int) -> None:
    dataset, values = scenes.run("passage", f"{scenes.pace('passage')}\n{MASS}"), np.arange(1.0, 13.0).reshape(4, 3)
    assert told_effects(Results.of(dataset), values, "it") != ""
    assert told_effects(Results.of(dataset), np.where(values == place + 1.0, np.nan, values), "it") == ""
    dataset["status"].values.reshape(-1)[place] = Status.SEPARATED
    assert told_effects(Results.of(dataset), values, "it") == ""


def test_a_number_at_which_all_is_zero_is_not_compared() -> None:
    results = Results.of(scenes.run("passage", f"{scenes.pace('passage')}\n{MASS}"))
    values = np.outer(np.ones(4), [2.0, 0.0, 1.0])
    assert (
        told_effects(results, values, "it")
        == "With the worst of all else that is swept, it stays the same over pace 1 to 8 m/s."
    )


def test_one_number_or_a_sample_has_no_effects_of_its_own() -> None:
    one = Results.of(scenes.run("passage", MASS))
    assert told_effects(one, sizes(one, "midspan"), "it") == ""
    sampled = scenes.run(
        "passage", f"zip = true\n{MASS}\n{DEAD.replace('[1.0, 2.0]', '[1.0, 2.0, 3.0]')}", extra=ELSEWHERE
    )
    assert told_effects(Results.of(sampled), np.ones(3), "it") == ""


def test_what_nothing_changes_is_said_so() -> None:
    dataset = scenes.run("passage", DEAD, extra=ELSEWHERE)
    results = Results.of(dataset)
    assert unchanged(results, sizes(results, "midspan")) == "does not change over place 1 to 2 m"
    assert unchanged(results, sizes(results, "dead")) == ""
    told = next(text for text in answers.answer(dataset) if text.startswith("midspan:"))
    assert told.count("does not change over place 1 to 2 m") == 1 and " at place " not in told


def test_what_nothing_changes_is_not_drawn() -> None:
    found = {figure.name for figure in answers.figures(scenes.run("passage", DEAD, extra=ELSEWHERE))}
    assert "largest-displacement" in found and "largest-bending-moment" not in found


def test_a_history_that_stays_where_it_is_is_titled_so() -> None:
    dataset = scenes.run("trajectory", MASS)
    noise = 1e-13 * np.arange(dataset["midspan"].size).reshape(dataset["midspan"].shape) / dataset["midspan"].size
    dataset["midspan"].values[...] = 2e-3 + noise
    sensors = answers.figures(dataset)[0]
    assert sensors.title == "Displacement at 5 m of bed stays at 2 mm"
    assert np.ptp(sensors.drawing.axes[0].get_ylim()) > 0.1


def test_a_study_of_frames_draws_its_sweep_and_no_rounding_of_its_energy() -> None:
    joint = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "spin-up", "rate": 1.0, "time": 1.0}}
    arm = {"kind": "beam", "length": 10.0, "area": 4e-4, "second_moment": 2e-7, "youngs_modulus": 7e10}
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"arm": arm | {"density": 3000.0, "supports": "clamped-free", "modes": 2}},
        frame={"arm": {"joints": [joint], "stiffening": True}},
        sensor={"tip": {"body": "arm", "at": 10.0}},
        sweep={"rate": {"of": "frame.arm.joints.0.motion.rate", "values": [0.5, 1.0]}},
        question={"duration": 1.5},
    )
    dataset = studies.run(study)
    first, *others = answers.figures(dataset)
    (axes,) = first.drawing.axes
    largest = np.maximum(abs(dataset["tip_max"]), abs(dataset["tip_min"])).values
    np.testing.assert_allclose(axes.get_lines()[0].get_ydata(), largest)
    assert axes.get_xlabel() == "rate (rad/s)" and first.name == "largest-displacement"
    assert any("changes by at most" in figure.title for figure in others)
    dataset["energy_change"].values[...] = 1e-12
    titles = [figure.title for figure in answers.figures(dataset)]
    assert "The energy of everything does not change" in titles


@pytest.mark.parametrize("more", ["", "zip"])
def test_the_absorber_that_helps_most_is_told(more: str) -> None:
    """At the worst of all else, or among samples of it alone; the answer told the worst one."""
    sweep: dict[str, Any] = {"stiffness": {"of": "carriage.absorber.stiffness", "values": [0.5, 2.0, 4.0]}}
    if more == "zip":
        sweep["damping"] = {"of": "carriage.absorber.damping", "values": [0.1, 0.2, 0.3]}
        sweep["zip"] = ["stiffness", "damping"]
    else:
        sweep["speed"] = {"of": "carriage.car.motion.speed", "values": [0.2, 0.4]}
    standing = {"kind": "standing", "at": 0.5}
    cars = {"car": mass(0.1, cruise(0.0, 1.0, 0.5)), "absorber": oscillator(0.1, 2.0, standing, damping=0.1)}
    found = studies.run(study(beam(), cars, sensor={"middle": fixed(0.5)}, sweep=sweep))
    found["middle_min"].values[...] = 0.0
    found["middle_max"].values[...] = [5.0, 3.0, 4.0] if more else [[1.0, 5.0], [2.0, 3.0], [0.5, 4.0]]
    (said,) = (text for text in studies.answer(found) if text.startswith("middle: the largest displacement"))
    where = "at stiffness 2 N/m, damping 0.2 N s/m." if more else "at the worst of all else, at stiffness 2 N/m."
    assert f"The largest displacement is least, 3 m{',' if more else ''} {where}" in said
