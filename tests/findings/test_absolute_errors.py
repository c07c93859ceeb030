"""Told errors in the units of results: against errors that two marches of the same study differ by."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import studies
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.findings.absolute_errors import absolute_errors
from studies.reporting import answers
from studies.reporting.comparison import compared
from studies.reporting.summary import Range, in_tables
from studies.results.findings_common import remedy
from studies.results.kept import kept
from studies.results.results import Results
from tests.engine import build
from tests.engine.build import beam, cruise, mass
from tests.observation.test_off_track import study
from tests.studies import scenes

MASS = 'mass = { of = "carriage.table.mass", values = [50, 100] }'
MASS_KEY = "carriage.car.mass"
STILL = '[sensor.still]\nbody = "bed"\nat = 0.0'


def found(kind: str, **options: str) -> Results:
    return Results.of(scenes.run(kind, f"{scenes.pace(kind)}\n{MASS}", **options))


def rows(results: Results) -> dict[str, Range]:
    return {f"{one.name} {one.sensor}".strip(): one for one in in_tables(results)}


def with_error(results: Results, result: str, error: float) -> Results:
    """The same with one told error everywhere."""
    return Results(scenes.with_errors(results.dataset, error, result), results.study, results.models)


def test_errors_are_over_what_the_archive_says() -> None:
    """Of sensors the largest static value, of contact forces the weight, of lags the cruise; of indices 1."""
    passage = found("passage")
    size = np.maximum(abs(passage.dataset.midspan_max), abs(passage.dataset.midspan_min)).values
    static = size / passage.numbers("dynamic_amplification", "midspan")
    np.testing.assert_allclose(
        absolute_errors(with_error(passage, "midspan_max", 0.25), "midspan_max"), 0.25 * static, rtol=1e-6
    )
    weights = np.broadcast_to(passage.dataset.mass.values, passage.shape) * 9.80665
    pressed = with_error(passage, "table_contact_force_min", 0.5)
    np.testing.assert_allclose(absolute_errors(pressed, "table_contact_force_min"), 0.5 * weights, rtol=1e-6)
    both_ways = found("asymmetry")
    cruise = abs(9.6 - 5.0) * (1.0 - 2.0 * 0.1)
    for result, scale in (("lag", cruise), ("odd_rms", 1.0)):
        told = absolute_errors(with_error(both_ways, f"{result} midspan", 1e-3), result, "midspan")
        np.testing.assert_allclose(told, 1e-3 * scale, rtol=1e-6)
    assert np.isnan(absolute_errors(passage, "midspan_max_position", "none")).all()


def test_errors_of_a_body_that_is_pushed_are_over_the_largest_value() -> None:
    """As the march divides them: statics do not look at forces along a track, which sway a portal most."""
    motion = {"kind": "point-to-point", "start": 0.4, "end": 2.8, "speed": 1.5, "acceleration": 6.0, "dwell": 0.1}
    sensors = {"sway": {"node": "b", "direction": [1.0, 0.0, 0.0]}}
    car = mass(400.0, motion, on="portal", inertia_along=True)
    given = study(sensors, carriage={"car": car}, solver={"steps": 400}, sweep={"m": {"of": MASS_KEY, "values": [400]}})
    results = Results.of(studies.run(given))
    own = np.maximum(abs(results.dataset.sway_max), abs(results.dataset.sway_min)).values
    assert np.all(results.numbers("dynamic_amplification", "sway") > 2.0)
    told = absolute_errors(with_error(results, "sway_max", 0.25), "sway_max")
    np.testing.assert_allclose(told, 0.25 * own / 0.75, rtol=1e-6)
    many = "dynamic_amplification"
    told = absolute_errors(with_error(results, f"{many} sway", 0.25), many, "sway")
    np.testing.assert_allclose(told, 0.25 * results.numbers(many, "sway") / 0.75, rtol=1e-6)


def test_no_answer_compares_sway_by_braking_with_what_weights_alone_make() -> None:
    """Sentences, tables and figures told it to be 8.9 times the static 3 um; down it is compared as ever."""
    motion = {"kind": "point-to-point", "start": 0.4, "end": 2.8, "speed": 1.5, "acceleration": 6.0, "dwell": 0.1}
    sensors = {"sway": {"node": "b", "direction": [1.0, 0.0, 0.0]}, "down": {"node": "b", "direction": "z"}}
    sensors |= {"knee": {"point": "knee"}}  # along x
    swept = {"m": {"of": MASS_KEY, "values": [200, 400]}}
    for inertia in (True, False):
        car = mass(400.0, motion, on="portal", inertia_along=inertia)
        dataset = studies.run(study(sensors, carriage={"car": car}, solver={"steps": 400}, sweep=swept))
        told = {one.split(":")[0]: one for one in answers.answer(dataset)}
        assert all(("the static" in told[name]) != inertia for name in ("sway", "knee"))
        assert "the static" in told["down"]
        for name in ("sway", "knee"):
            assert (f"dynamic_amplification {name}" in rows(Results.of(dataset))) != inertia
        labels = [axes.get_ylabel() for one in studies.figures(dataset) for axes in one.drawing.axes]
        assert not (inertia and any("amplification\nat b along (1, 0, 0)" in label for label in labels))


def test_who_misses_a_tolerance_by_braking_at_once_is_told_of_the_jerk() -> None:
    """Not where one is set."""
    motion = {"kind": "point-to-point", "start": 0.4, "end": 2.8, "speed": 1.5, "acceleration": 6.0, "dwell": 0.1}
    sensors, said = {"sway": {"node": "b", "direction": [1.0, 0.0, 0.0]}}, []
    for more in ({}, {"jerk": 300.0}):
        car = mass(400.0, motion | more, on="portal", inertia_along=True)
        dataset = studies.run(study(sensors, carriage={"car": car}, solver={"steps": 400}))
        dataset["status"].values[...] = Status.TOLERANCE_MISSED
        said.append(remedy(Results.of(dataset)))
    assert said[0].endswith(
        "larger tolerance; or carriage.car.motion.jerk, as forces of inertia that jump strike every mode."
    )
    assert said[1].endswith("or a larger tolerance.")


def test_errors_over_a_value_of_its_own_know_that_it_is_off_itself() -> None:
    """An acceleration that is 45 % too small is told to be off by as much as it is: 0.45 of the true one."""
    extra = """
    [sensor.shaken]
    body = "bed"
    at = 5.0
    quantity = "acceleration"
    """
    true = found("passage", extra=extra)
    small = Results(true.dataset.assign(shaken_max=0.55 * true.dataset.shaken_max), true.study, true.models)
    small = Results(small.dataset.assign(shaken_min=0.55 * true.dataset.shaken_min), true.study, true.models)
    own = np.maximum(abs(true.dataset.shaken_max), abs(true.dataset.shaken_min)).values
    told = absolute_errors(with_error(small, "shaken_max", 0.45), "shaken_max")
    np.testing.assert_allclose(told, 0.45 * own, rtol=1e-6)
    assert np.isfinite(absolute_errors(with_error(small, "shaken_max", 1.3), "shaken_max")).all()


def test_told_errors_are_as_large_as_what_finer_steps_change() -> None:
    """In the unit of the result: most cover it, none by more than a thousand times."""
    coarse, fine = (found("passage", extra=f"[solver]\nsteps = {steps}\naudit = 0") for steps in (80, 1280))
    off = np.abs(coarse.dataset.midspan_max - fine.dataset.midspan_max).values
    told = absolute_errors(coarse, "midspan_max")
    assert np.mean(off <= told) > 0.75 and (off <= 2.0 * told).all() and (off > 1e-3 * told).all()


def test_an_answer_that_is_less_than_its_error_is_told_so() -> None:
    """A lag of 0.1 mm is known to within 1e-3 of the cruise: 3.7 mm."""
    results = Results.of(scenes.run("asymmetry", MASS))
    lag = float(np.abs(results.numbers("lag", "midspan")).max())
    cruise = 4.6 * 0.8
    loose = with_error(results, "lag midspan", 2.0 * lag / cruise)
    sentences = answers.answer(loose.dataset)
    told = next(text for text in sentences if text.startswith("midspan") and "lag" in text)
    assert "is less than what it may be off" in told
    half = with_error(results, "lag midspan", 0.5 * lag / cruise)
    assert any(" ± " in text for text in answers.answer(half.dataset) if text.startswith("midspan"))
    assert rows(loose)["lag midspan"].is_loose and rows(half)["lag midspan"].is_loose
    end = rows(half)["lag midspan"].extreme
    assert end.error == pytest.approx(0.5 * lag, rel=1e-6)
    assert " ± " in rows(half)["lag midspan"].said(end) and not rows(results)["midspan_max"].is_loose


def test_what_does_not_change_is_rounding_and_said_so() -> None:
    dataset = found("passage", extra=STILL).dataset
    noisy = dataset.copy(deep=True)
    noisy["moment_max"].values[...] = 7.0 * (
        1.0 + 1e-12 * np.arange(noisy.moment_max.size).reshape(noisy.moment_max.shape)
    )
    noisy["moment_min"].values[...] = -1e-14
    noisy["moment_min"].values[0, 0] = 2e-15
    told = rows(Results.of(noisy))
    assert told["moment_max"].is_constant and told["moment_min"].is_constant
    assert told["moment_min"].value(-1e-14) == "0 N m"
    assert not told["midspan_max"].is_constant and told["still_max"].is_constant


def blurred(error: float) -> tuple[xr.Dataset, xr.Dataset]:
    """Two datasets that differ by a thousandth, with told errors of so much."""
    first = scenes.with_errors(scenes.run("passage", scenes.pace("passage")), error)
    second = first.copy(deep=True)
    second["midspan_max"] = second["midspan_max"] * 1.001
    return first, second


@pytest.mark.parametrize(("error", "says_nothing"), [(1.5, True), (0.1, False)])
def test_to_lie_within_errors_larger_than_the_values_says_nothing(error: float, says_nothing: bool) -> None:
    result = compared(*map(Results.of, blurred(error)))
    told = next(one for one in result.differences if one.name == "midspan_max")
    assert result.agree and told.beyond == 0
    assert told.blurred == says_nothing and told.allowed > 2.0 * error * 0.5 * abs(told.largest)


def test_of_a_value_that_is_the_same_everywhere_the_largest_error_is_told() -> None:
    """Statics that a study asks for do not change with the speed; how far from them the bed is does."""
    speeds = {"speed": {"of": "carriage.car.motion.speed", "from": 0.1, "to": 1.5, "count": 5}}
    solver = {"fidelity": "static", "audit": 0}
    found = studies.run(build.study(beam(), mass(0.3, cruise(0.0, 1.0, 1.0)), solver=solver, sweep=speeds))
    error = found.estimated_error.sel(result="midspan_max").values
    (top,) = (one for one in in_tables(Results.of(found)) if one.name == "midspan_max")
    assert top.is_constant and top.is_loose and error[0] < 0.1 < error.max()
    assert top.extreme.error == pytest.approx(error.max() * float(found.midspan_max[0]), rel=1e-6)


def test_studies_of_other_axes_have_nothing_to_compare() -> None:
    down, steps = {"down": {"node": "b", "direction": "z"}}, {"steps": 400}
    one = studies.run(study(down, solver=steps))
    other = studies.run(study(down, solver=steps, sweep={"m": {"of": MASS_KEY, "values": [200, 400]}}))
    with pytest.raises(BadInput, match=r"(?s)none in the first, m in the second.*run both over the same axes"):
        studies.compare(one, other)


def test_errors_of_settling_times_are_parts_of_the_time_that_is_told() -> None:
    """3.5 s were told of 0.37 s, though the run rested for 2.5 s: the told time was made longer by its own error."""
    rest = {"kind": "point-to-point", "start": 0.4, "end": 2.8, "speed": 1.5, "acceleration": 6.0, "dwell": 8.0}
    sensors = {"sway": {"node": "b", "direction": "x", "settling_band": 2e-4}}
    car = mass(400.0, rest, on="portal", inertia_along=True)
    given = study(sensors, carriage={"car": car}, solver={"steps": 2000}, output={"residual": True})
    results = Results.of(studies.run(given))
    name, took = "sway_settling_time", results.dataset.sway_settling_time.values
    assert np.isfinite(took).all() and (took > 0.0).all()
    np.testing.assert_allclose(absolute_errors(with_error(results, name, 0.9), name), 0.9 * took, rtol=1e-6)


def test_what_no_error_is_told_of_is_counted_apart() -> None:
    """43 settling times counted as beyond errors that were not known, by values that lay within theirs."""
    first, second = blurred(0.1)
    first, second = first.copy(deep=True), second.copy(deep=True)
    row = first["result"].values.tolist().index("midspan_max")
    first["estimated_error"].values[0, row] = np.nan
    told = next(one for one in studies.compare(first, second).differences if one.name == "midspan_max")
    assert (told.beyond, told.unknown) == (0, 1) and not studies.compare(first, second).agree
    second["midspan_max"].values[2] *= 0.5
    told = next(one for one in studies.compare(first, second).differences if one.name == "midspan_max")
    assert (told.beyond, told.unknown) == (1, 1) and told.largest == pytest.approx(
        float(second.midspan_max[2] - first.midspan_max[2])
    )


def test_numbers_of_variants_are_not_rounded() -> None:
    """ "variant 1580" was told of 1578, which is another one."""
    axes = {"zip": True, "speed": {"of": "carriage.car.motion.speed", "values": np.linspace(0.1, 1.0, 1234)}}
    solver = {"fidelity": "static", "audit": 0, "steps": 50}
    given = build.study(beam(), mass(0.3, cruise(0.0, 1.0, 1.0)), solver=solver, sweep=axes)
    results = Results.of(studies.run(given))
    worst = results.dataset.copy(deep=True)
    worst["midspan_max"].values[1231] *= 2.0
    told = rows(Results.of(worst))["midspan_max"].largest.where
    assert "variant 1231" in told, told


def test_what_is_asked_again_of_results_is_kept_with_these_alone() -> None:
    asked = list[str]()

    @kept
    def find(results: Results, name: str) -> list[str]:
        asked.append(name)
        return [name]

    one, other = (Results.of(scenes.run("double-peak")) for _ in range(2))
    assert find(one, "a") is find(one, "a") and asked == ["a"]
    assert find(one, "b") == ["b"] and find(one, "a") == ["a"] and asked == ["a", "b"]
    assert find(other, "a") is not find(one, "a") and asked == ["a", "b", "a"]
