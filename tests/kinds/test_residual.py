"""What answers say of residual vibrations, and of the documentation's own study of them."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.scene.study import Study, load
from results_schema.errors import BadInput
from studies.commands import screens
from studies.findings import theory
from studies.findings.absolute_errors import absolute_errors
from studies.protocol.study import kind_of
from studies.reporting import answers, summary
from studies.results.formatting import quantity
from studies.results.results import Results
from tests.engine.build import aboard, beam, cruise, fixed, force, oscillator, study

PAGE = Path(__file__).parents[2] / "docs" / "study-file.md"
MOVE = {"kind": "point-to-point", "start": 0.2, "end": 0.7, "speed": 3.0, "acceleration": 9.0, "dwell": 1.5}
STEPS = [2, 6, 12, 20, 30]
SWEPT = {"acceleration": {"of": "carriage.car.motion.acceleration", "values": STEPS}}


def stops(kind: str = "passage", **changes: Any) -> Study:
    """A force that stops on an undamped beam of one mode, with a swept acceleration."""
    tables = {"output": {"histories": "all", "residual": True}, "solver": {"steps": 2000}, "sweep": SWEPT}
    return study(beam(modes=1), force(2.0, MOVE), kind=kind, **(tables | changes))


@pytest.mark.parametrize("kind", ["passage", "trajectory"])
def test_it_is_said_where_a_limit_is_exceeded(kind: str) -> None:
    """With the largest, for which variant; between two accelerations, and not from one on, where it rises and falls."""
    found = studies.run(stops(kind))
    sizes = found.midspan_residual.values
    assert np.argmax(sizes) == 1 and (sizes > 17e-3).tolist() == [False, True, True, False, False]
    limited = studies.run(stops(kind, question={"residual": {"displacement": 17e-3}}))
    np.testing.assert_array_equal(limited.midspan_residual.values, sizes)
    (said,) = (text for text in answers.answer(limited) if "after the stop it" in text)
    where = "over acceleration it exceeds 17 mm at 6 to 12 m/s²"
    swings = "19.3 mm at acceleration 6 m/s², and least, by up to 9.91 mm, at acceleration 2 m/s²"
    assert said.endswith(f"after the stop it still swings by up to {swings}; {where}.")
    (short,) = (text for text in answers.answer(found) if "after the stop it" in text)
    assert short == said.replace(f"; {where}", "")


def test_its_error_stands_beside_it_in_its_own_unit() -> None:
    """Told errors are parts of the static value, which may be far from what still swings."""
    found = studies.run(stops())
    static = float((found.midspan_max / found.dynamic_amplification.sel(sensor="midspan"))[1])
    found["estimated_error"].loc[{"result": "midspan_residual"}] = 5e-3 / static
    (said,) = (text for text in answers.answer(found) if "after the stop it" in text)
    assert "up to 19.3 mm ± 5 mm at acceleration 6 m/s²" in said
    found["estimated_error"].loc[{"result": "midspan_residual"}] = 1e-3 / static
    (said,) = (text for text in answers.answer(found) if "after the stop it" in text)
    assert "up to 19.3 mm at acceleration 6 m/s²" in said


LIMIT = {"residual": {"displacement": 17e-3}}


def test_the_answer_begins_with_the_time_after_the_stop_where_that_is_asked_for() -> None:
    banded = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    for asked, first in (
        ({}, "midspan: the largest displacement"),
        ({"question": LIMIT}, "midspan: after the stop it still swings"),
        ({"sensor": banded}, "midspan: after the stop it still swings"),
    ):
        assert answers.answer(studies.run(stops(**asked)))[0].startswith(first)


def drawn(found: Any) -> dict[str, Any]:
    """The figures of residual vibrations by name."""
    return {one.name: one for one in studies.figures(found) if one.name in ("residual", "ringing")}


@pytest.mark.parametrize("kind", ["passage", "trajectory"])
def test_it_is_drawn_with_its_error_and_its_limit(kind: str) -> None:
    """Against the swept number that changes it most, not the first of the file, at the other's value of the answer."""
    twice = {"zeta": {"of": "body.bed.damping_ratio", "values": [0.0, 0.01]}} | SWEPT
    found = studies.run(stops(kind, sweep=twice, question=LIMIT))
    told = found["estimated_error"].loc[{"result": "midspan_residual"}]
    told[:] = 1e-9
    scale = absolute_errors(Results.of(found), "midspan_residual") / 1e-9
    told[:] = 1e-3 / (scale + 1e-3 * (kind == "trajectory"))  # over the true largest value, where no statics are known
    figure = drawn(found)["residual"]
    assert figure.title == (
        "midspan still swings by up to 19.3 mm after the stop, beyond the limit of 17 mm, at zeta 0, "
        "acceleration 6 m/s²"
    )
    (axes,) = figure.drawing.axes
    *curves, limit = axes.lines
    for line, band, own in zip(curves, axes.collections, found.midspan_residual.values * 1e3, strict=True):
        np.testing.assert_allclose(line.get_xdata(), STEPS)
        np.testing.assert_allclose(line.get_ydata(), own)
        np.testing.assert_allclose(band.get_paths()[0].vertices[1:6, 1], own - 1.0, rtol=1e-6)
    assert limit.get_ydata()[0] == pytest.approx(17.0)


def test_it_is_drawn_over_the_time_after_the_stop() -> None:
    """With stations enough: a run mostly of motion has as many for its rest as a run of rest."""
    motion = MOVE | {"speed": 0.01, "dwell": 0.6}
    solver = {"steps": 120_000, "tolerance": 0.5}
    found = studies.run(study(beam(modes=1), force(2.0, motion), output={"residual": True}, solver=solver))
    (axes,) = drawn(found)["ringing"].drawing.axes
    (line,) = axes.lines
    seconds, values = line.get_data()
    assert seconds[0] == 0.0 and seconds[-1] == pytest.approx(0.6)
    assert seconds.size == pytest.approx(1201, abs=5) and np.ptp(np.diff(seconds)) < np.diff(seconds).max()
    assert np.ptp(values) == pytest.approx(2e3 * float(found.midspan_residual), rel=0.01)


def test_its_title_has_the_number_of_the_archive_and_its_caption_that_stations_are_few() -> None:
    """Seven stations to a period miss what every step has; all of them miss nothing."""
    every = studies.run(stops(sweep={}))
    results = Results.of(every)
    steps = results.trace("midspan", ()).times
    seldom = round(2.0 * np.pi / (7.0 * float(theory.first_omega(results)) * (steps[1] - steps[0])))
    few = studies.run(stops(sweep={}, output={"residual": True, "histories": {"every": seldom}}))
    size = quantity(float(few.midspan_residual), "m")
    for found, too_few in ((few, True), (every, False)):
        figure = drawn(found)["ringing"]
        assert figure.title == f"midspan swings by up to {size} about its static value after the stop"
        counted = re.search(r"Stations are too few for midspan, ([\d.]+) to a period", figure.caption)
        assert float(counted[1]) == pytest.approx(7.0, abs=0.6) if counted else not too_few
        assert bool(counted) == too_few


@pytest.mark.parametrize("question", [LIMIT, {}])
def test_sensors_nearest_to_their_limits_or_that_swing_most_come_first(question: dict[str, Any]) -> None:
    sensors = {"quarter": {"body": "bed", "at": 0.25}, "midspan": {"body": "bed", "at": 0.5}}
    found = studies.run(stops(sensor=sensors, question=question))
    told = [text.partition(":")[0] for text in answers.answer(found) if "after the stop it" in text]
    assert told == ["midspan", "quarter"]


def test_the_history_of_the_largest_is_kept() -> None:
    given = stops(question=LIMIT)
    results = Results.of(studies.run(given))
    assert (1,) in kind_of(given).named(results)


def test_no_variant_beyond_a_limit_is_said_so() -> None:
    twice = SWEPT | {"zeta": {"of": "body.bed.damping_ratio", "values": [0.01, 0.02]}}
    found = studies.run(stops(sweep=twice, question={"residual": {"displacement": 1.0}}))
    (said,) = (text for text in answers.answer(found) if "after the stop it" in text)
    assert "over acceleration it exceeds 1 m nowhere in the sweep. With the worst of all else that is swept" in said


def test_a_limit_in_another_unit_is_doubted() -> None:
    """3000 for 3000 um, of residual vibrations and of readings."""
    found = studies.run(stops(question={"displacement": 3000.0, "residual": {"displacement": 3000.0}}))
    doubt = re.compile(r"exceeds 3000 m \((\d+) times the largest value: is its unit right\?\) nowhere")
    told = [float(seen[1]) for text in answers.answer(found) if (seen := doubt.search(text))]
    largest = found.midspan_residual.max(), found.midspan_max.max()
    assert told == pytest.approx([3000.0 / float(size) for size in largest], rel=5e-3)


def test_what_leaves_is_said_not_to_be_read_then() -> None:
    sensors = {"midspan": fixed(0.5), "load": aboard("car")}
    car = oscillator(0.3, 30.0, cruise(0.0, 1.0, 1.0, after=3.0), wheel_mass=0.05)
    found = studies.run(study(beam(), car, kind="passage", sensor=sensors, output={"residual": True}))
    told = [text for text in answers.answer(found) if "once car has left" in text]
    assert told == ["load: it is not read once car has left, so that no residual vibration is told."]


def test_what_is_not_asked_is_not_told() -> None:
    found = studies.run(stops(output={"histories": "none"}))
    assert not [name for name in found.variables if "residual" in str(name)]
    assert not [text for text in answers.answer(found) if "after the stop" in text]


def test_limits_without_results_are_refused() -> None:
    given = stops(output={"histories": "none"}, question={"residual": {"displacement": 1e-3}})
    with pytest.raises(BadInput, match=r"question.residual.*residual = true"):
        kind_of(given)


@pytest.mark.parametrize("kind", ["asymmetry", "eigenfrequencies"])
def test_other_kinds_have_none(kind: str) -> None:
    motion = {"kind": "out-and-back", "start": 0.2, "end": 0.7, "speed": 1.0, "turn": 0.2, "cycles": 2}
    given = study(beam(), force(1.0, motion), kind=kind, output={"residual": True})
    with pytest.raises(BadInput, match=r"output.residual"):
        kind_of(given).parts(given)


def test_the_study_of_the_documentation() -> None:
    """A gantry after a stop: half the swing is as an engineer's own finite-element model had it, 2 % damping apart."""
    block = next(b for b in re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S) if "residual" in b)
    given = load(re.sub(r"from = 1, to = 8, count = 8", "values = [1, 2, 4]", block))
    found = engine.run(given)
    half_swing = np.array([2.99, 4.84, 0.95]) * 1e-6
    first = 1.0 + 0.5 * np.pi * 0.02  # over half of the swing, which spans half a period more
    assert found.sway_residual.values == pytest.approx(half_swing * first, rel=0.01)


def test_it_is_said_how_long_it_takes_to_settle() -> None:
    """At most, for which variant, and how many have not settled."""
    damped, sensors = beam(modes=1, damping_ratio=0.03), {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    given = {"output": {"residual": True}, "sensor": sensors, "sweep": SWEPT}
    by_dwell = [studies.run(study(damped, force(2.0, MOVE | {"dwell": dwell}), **given)) for dwell in (1.5, 3.0, 6.0)]
    brief, times, told = (found.midspan_settling_time.values for found in by_dwell)
    found = by_dwell[1]
    assert np.isnan(brief).sum() == 4 and np.isnan(told).sum() == 0  # what swings out again has not settled
    assert np.isnan(times).sum() == 2 and np.nanmax(times) > 2.0
    known = np.isfinite(times)
    doubt = sum(studies.errors(one).midspan_settling_time.values[known] for one in by_dwell[1:])
    assert np.all(np.abs(times - told)[known] <= doubt) and np.all(doubt <= 0.05 * told[known])
    closely = [
        studies.run(study(damped, force(2.0, MOVE | {"dwell": dwell}), solver={"tolerance": 1e-4}, **given))
        for dwell in (3.0, 6.0)
    ]
    short, long = (one.midspan_settling_time.values for one in closely)
    np.testing.assert_allclose(short[known], long[known], atol=1e-4)
    (said,) = (text for text in answers.answer(found) if "after the stop it" in text)
    longest, latest = STEPS[int(np.nanargmax(times))], f"{np.nanmax(times):.3g} s after the stop at the latest"
    assert f"it has settled within 8 mm of its static value {latest} at acceleration {longest} m/s²" in said
    left = "2 variants have not settled by the end of the run, or too late to tell that it is for good"
    np.testing.assert_array_equal(np.isnan(times), [acceleration in (6, 12) for acceleration in STEPS])
    assert said.endswith(f"; {left}, over acceleration at 6 to 12 m/s²: a longer rest tells when.")
    (figure,) = (one for one in studies.figures(found) if one.name == "settling")
    whole = found.midspan_move_and_settle_time.values
    fastest = f"{np.nanmin(whole):.3g} s"
    where = f"at acceleration {STEPS[int(np.nanargmin(whole))]} m/s²"
    until = f"Until midspan has settled, move and settling take {fastest} at least {where}"
    assert answers.answer(found)[0].startswith(until) and "move and settling" not in said
    assert figure.title.startswith(f"move and settling of midspan take at least {fastest}, {where}")
    assert "Gaps: not settled" in figure.caption
    (axes,) = figure.drawing.axes
    np.testing.assert_allclose(axes.lines[0].get_ydata(), whole, rtol=1e-6)
    assert axes.get_ylabel() == "time of move and settling (s)"


def test_where_all_stop_at_the_same_time_settling_times_are_drawn() -> None:
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    swept = {"force": {"of": "carriage.car.force", "values": [1.0, 2.0, 3.0]}}
    moves = force(2.0, MOVE | {"dwell": 6.0})
    given = study(beam(modes=1, damping_ratio=0.03), moves, output={"residual": True}, sensor=sensors, sweep=swept)
    found = studies.run(given)
    times = found.midspan_settling_time.values
    (figure,) = (one for one in studies.figures(found) if one.name == "settling")
    assert figure.title.startswith(f"midspan takes up to {times.max():.3g} s to settle")
    (axes,) = figure.drawing.axes
    np.testing.assert_allclose(axes.lines[0].get_ydata(), times, rtol=1e-6)
    assert axes.get_ylabel() == "settling time (s)" and axes.get_ylim()[0] == 0.0
    assert not any("move and settling" in text for text in answers.answer(found))


def test_what_has_not_settled_everywhere_is_not_the_same_everywhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A settling time that one of two variants lacks: both sentences and tables tell of how many it is."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 17.5e-3}}
    swept = {"acceleration": SWEPT["acceleration"] | {"values": [2, 6]}}
    found = studies.run(stops(sensor=sensors, sweep=swept))
    np.testing.assert_array_equal(found.midspan_settling_time, [0.0, np.nan])
    (said,) = (text for text in answers.answer(found) if "after the stop it" in text)
    assert said.endswith(
        "; in 1 of 2 variants it is within 17.5 mm of its static value from the stop on; 1 variant has not settled by "
        "the end of the run, or too late to tell that it is for good, over acceleration at 6 m/s²: a longer rest tells "
        "when."
    )
    (time,) = (one for one in summary.in_tables(Results.of(found)) if one.name == "midspan_settling_time")
    assert time.is_constant and time.partly == "in 1 of 2 variants"
    screens.show_ranges([time], [], "every variant")
    assert " ".join(capsys.readouterr().out.split()).endswith(
        "The same where there is one: midspan_settling_time 0 s in 1 of 2 variants."
    )
    page = studies.report(found, tmp_path / "page").read_text(encoding="utf-8")
    assert page.count('<span class="at">in 1 of 2 variants</span>') == 4  # of both times, smallest and largest


def told_of(sizes: list[float]) -> str:
    """What is said of residual vibrations (m) over ever faster accelerations."""
    steps = {"acceleration": {"of": "carriage.car.motion.acceleration", "values": list(range(2, 2 + len(sizes)))}}
    found = studies.run(stops(sweep=steps))
    found["midspan_residual"][:] = sizes
    (said,) = (text for text in answers.answer(found) if "after the stop it" in text)
    return said


def test_values_that_go_up_and_down_from_one_to_the_next_are_swept_too_coarsely() -> None:
    """Towards the end, where they are far apart for how it swings; not for two turns, nor for small ones."""
    hint = (
        ". From one acceleration to the next it goes up and down, so peaks between them may be higher: sweep them more "
        "closely."
    )
    assert told_of([1e-6, 2e-6, 6.3e-6, 4.6e-6, 7.4e-6, 4.1e-6, 8.2e-6, 6.7e-6]).endswith(hint)
    for calm in ([1e-6, 2e-6, 4e-6, 3e-6, 2e-6, 1e-6, 5e-6], [1e-6, 4e-6, 3.8e-6, 4.0e-6, 3.8e-6, 4.1e-6, 3.9e-6]):
        assert "goes up and down" not in told_of(calm)


def test_that_values_go_up_and_down_is_said_once() -> None:
    steps = {"acceleration": {"of": "carriage.car.motion.acceleration", "values": list(range(2, 10))}}
    found = studies.run(stops(sweep=steps, sensor={"quarter": fixed(0.25), "midspan": fixed(0.5)}))
    for sensor in ("quarter", "midspan"):
        found[f"{sensor}_residual"][:] = [1e-6, 2e-6, 6.3e-6, 4.6e-6, 7.4e-6, 4.1e-6, 8.2e-6, 6.7e-6]
    told = [text for text in answers.answer(found) if "after the stop it still swings" in text]
    assert len(told) == 2 and " ".join(told).count("goes up and down") == 1


def test_what_is_left_as_rounding_does_not_swing() -> None:
    """It is told and drawn without a number."""
    found = studies.run(stops(sensor={"quarter": {"body": "bed", "at": 0.25}, "midspan": {"body": "bed", "at": 0.5}}))
    found["quarter_residual"][:] = 1e-10 * float(found["quarter_max"].max())
    told = [text for text in answers.answer(found) if "after the stop it" in text]
    assert "quarter: after the stop it does not swing." in told and "midspan: after the stop it still swings" in told[0]
    figure = drawn(found)["residual"]
    assert len(figure.drawing.axes) == 1 and figure.title.startswith("midspan still swings")


def test_of_samples_a_limit_is_exceeded_in_so_many_variants() -> None:
    """Of no swept number: they lie along none."""
    swept = {"acceleration": {"of": "carriage.car.motion.acceleration", "from": 2, "to": 30, "sobol": 4}}
    found = studies.run(stops(sweep=swept, question={"residual": {"displacement": 17e-3}}))
    found["midspan_residual"].values[:] = [18e-3, 1e-3, 1e-3, 1e-3]
    (said,) = (text for text in answers.answer(found) if "after the stop it" in text)
    assert "it exceeds 17 mm in 1 variant of 4." in said


@pytest.mark.parametrize(("most", "said"), [(4, "Bars: the estimated error."), (3, "errors of midspan: at most ")])
def test_of_samples_errors_are_drawn_as_long_as_they_do_not_hide_the_points(
    monkeypatch: pytest.MonkeyPatch, most: int, said: str
) -> None:
    monkeypatch.setattr("studies.pictures.common.residual.MOST_BARS", most)
    swept = {"acceleration": {"of": "carriage.car.motion.acceleration", "from": 2, "to": 30, "sobol": 4}}
    figure = drawn(studies.run(stops(sweep=swept)))["residual"]
    bars = [part for part in figure.drawing.axes[0].collections if part.__class__.__name__ == "LineCollection"]
    assert said in figure.caption and bool(bars) == (most == 4)


@pytest.mark.parametrize("kind", ["passage", "trajectory"])
def test_it_is_said_where_it_takes_longer_to_settle_than_is_asked(kind: str) -> None:
    """Where it has not settled it takes longer too; the figure of settling times has the limit."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    swept = {"force": {"of": "carriage.car.force", "values": [0.5, 1.0, 1.5, 2.0, 8.0]}}
    moves = force(2.0, MOVE | {"dwell": 4.0})
    given = study(
        beam(modes=1, damping_ratio=0.03),
        moves,
        kind=kind,
        output={"residual": True},
        sensor=sensors,
        sweep=swept,
        question={"settling_time": 1.5},
    )
    found = studies.run(given)
    times = found.midspan_settling_time.values
    assert np.isnan(times[-1]) and times[0] < times[1] < 1.5 < times[2] < times[3]
    (said,) = (text for text in answers.answer(found) if "after the stop it" in text)
    assert "; it takes longer than 1.5 s at 1.5 to 2 and 8 N;" in said
    (figure,) = (one for one in studies.figures(found) if one.name == "settling")
    (axes,) = figure.drawing.axes
    assert any(np.ptp(line.get_ydata()) == 0.0 and line.get_ydata()[0] == 1.5 for line in axes.lines)
    del sensors["midspan"]["settling_band"]
    with pytest.raises(BadInput, match=r"question.settling_time.*settling_band"):
        studies.run(given.with_values({"sensor": sensors}))


def test_what_surely_stays_within_its_band_has_settled_at_once_without_an_error() -> None:
    """Whatever neighbours tell of those that swing out of it."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    swept = {"force": {"of": "carriage.car.force", "from": 0.05, "to": 2.0, "count": 400}}
    moves = force(2.0, MOVE | {"dwell": 4.0})
    bed = beam(modes="auto", damping_ratio=0.03)
    found = studies.run(study(bed, moves, output={"residual": True}, sensor=sensors, sweep=swept))
    inside = found.midspan_residual.values < 0.98 * 8e-3
    error = found.estimated_error.sel(result=["midspan_settling_time", "midspan_move_and_settle_time"]).values
    assert 20 < inside.sum() < 380
    assert (error.reshape(-1, 2)[inside] == 0.0).all() and (error.reshape(-1, 2)[~inside] > 0.0).any()
    assert (found.midspan_settling_time.values[inside] == 0.0).all()


def test_what_has_not_settled_has_no_error_though_it_is_within_its_band() -> None:
    """Of a rest shorter than a period, in which it hardly swings."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 1.0}}
    moves = force(2.0, MOVE | {"dwell": 0.05})
    found = studies.run(study(beam(modes=1), moves, output={"residual": True}, sensor=sensors))
    assert float(found.midspan_residual) < 1.0 and np.isnan(float(found.midspan_settling_time))
    for name in ("midspan_settling_time", "midspan_move_and_settle_time"):
        assert np.isnan(float(found.estimated_error.sel(result=name)))


def test_how_many_share_an_end_is_told_in_place_of_one_of_them() -> None:
    """0 s in 446 of 576 variants read like a best."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    loads = {"load": {"of": "carriage.car.force", "values": [0.1, 0.2, 0.3, 0.4, 0.5, 2.0]}}
    damped = beam(modes=1, damping_ratio=0.05)
    given = study(damped, force(2.0, MOVE | {"dwell": 6.0}), output={"residual": True}, sensor=sensors, sweep=loads)
    ranges = {one.name: one for one in summary.shown(Results.of(studies.run(given)))}
    time = ranges["midspan_settling_time"]
    assert (time.smallest.value, time.smallest.where) == (0.0, "in 5 of 6 variants")
    assert time.largest.where == "load 2 N" and time.largest.at == "at load 2 N"
    few = studies.run(given.with_values({"sweep.load.values": [0.1, 0.2, 2.0]}))
    time = next(one for one in summary.shown(Results.of(few)) if one.name == "midspan_settling_time")
    assert time.smallest.at == "at load 100 mN and 1 more"
