"""How long moves take to settle: the best motion, and the bands of errors in the figure."""

import re
from itertools import product

import numpy as np
import pytest

import studies
from results_schema.errors import BadInput
from studies.reporting import answers
from studies.reporting.summary import in_tables
from studies.results.formatting import listed, quantity
from studies.results.results import Results
from tests.engine.build import beam, cruise, fixed, force, study
from tests.kinds.test_residual import MOVE, STEPS, SWEPT, stops


def test_no_band_of_errors_reaches_below_the_time_of_the_move() -> None:
    """Whatever is told of how long it takes to settle; that of one variant reached down to 0.6 s of a move of 2.3 s."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    given = study(
        beam(modes=1, damping_ratio=0.03), force(2.0, MOVE | {"dwell": 6.0}), sensor=sensors, sweep=SWEPT,
        output={"residual": True}, solver={"steps": 2000, "tolerance": 0.5},
    )  # fmt: skip
    found = studies.run(given)
    whole, settling = (found[f"midspan_{name}_time"].values for name in ("move_and_settle", "settling"))
    found["estimated_error"].loc[{"result": "midspan_move_and_settle_time"}] = 0.9
    (figure,) = (one for one in studies.figures(found) if one.name == "settling")
    (axes,) = figure.drawing.axes
    vertices = axes.collections[0].get_paths()[0].vertices[:, 1]
    assert vertices.min() == pytest.approx((whole - settling).min(), rel=1e-6) and (settling < 0.9 * whole).any()
    assert vertices.max() > 1.5 * whole.max()


def test_the_best_motion_is_told_for_each_mass_and_way_at_the_worst_damping() -> None:
    """Not one of all, which is that of the lightest mass and the strongest damping; and what each number does to the
    swing, the most first."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    sweep = SWEPT | {
        "way": {"of": "carriage.car.motion.direction", "values": ["forward", "backward"]},
        "push": {"of": "carriage.car.force", "values": [1.0, 2.0]},
        "zeta": {"of": "body.bed.damping_ratio", "values": [0.02, 0.04, 0.06]},
    }
    found = studies.run(stops(sweep=sweep, sensor=sensors, output={"residual": True, "histories": "none"}))
    told = [end.words["way"] for one in in_tables(Results.of(found)) for end in (one.smallest, one.largest)]
    assert set(told) == {"forward", "backward"}
    dims = ("acceleration", "way", "push", "zeta")
    times = found.midspan_move_and_settle_time.transpose(*dims)
    known = np.random.default_rng(5).permutation(times.size).reshape(times.shape) / 1000.0 + 1.0
    known += np.array([0.0, 1.0])[:, None, None] + np.array([0.0, 0.4])[:, None]  # the way changes them most
    known[0, :, :, 0], known[3, 0, 0, 2] = np.nan, np.nan  # these do not settle
    found["midspan_move_and_settle_time"] = times.copy(data=known)
    found["midspan_settling_time"] = times.copy(data=0.5 * known)
    (said,) = (text for text in answers.answer(found) if text.startswith("Until midspan has settled, "))
    (swings,) = (text for text in answers.answer(found) if "after the stop it" in text)
    plain, words = re.sub(r" ± \S+ \S+", "", said), list[str]()
    for way, push in product((1, 0), (0, 1)):  # backward first
        worst = {step: max(known[step, way, push]) for step in range(5) if np.isfinite(known[step, way, push]).all()}
        step = min(worst, key=lambda one: worst[one])
        where = f"way {('forward', 'backward')[way]}, push {push + 1} N"
        end = ", an end of the swept acceleration" * (step in (0, 4))
        words.append(f"{worst[step]:.3g} s at acceleration {STEPS[step]} m/s²{end} ({where})")
    assert f"move and settling take at least {listed(words)}, at the worst zeta" in plain
    told = swings.partition("With the worst of all else that is swept, the largest such swing ")[2]
    swing = found.midspan_residual.transpose(*dims).values
    ratio = {
        dim: (most := swing.max(axis=tuple(n for n in range(4) if n != place))).max() / most.min()
        for place, dim in enumerate(dims)
        if dim != "way"
    }
    assert sorted(ratio, key=lambda dim: told.index(f"over {dim}")) == sorted(ratio, key=lambda dim: -ratio[dim])
    found["midspan_move_and_settle_time"][{"zeta": 0}] = np.nan
    said = answers.answer(found)[0]
    plain = re.sub(r" ± \S+ \S+", "", said)
    assert (
        "(zeta 0.06), at the worst way and push; no motion has settled when the run ends at "
        "zeta 0.02; 21 of 60 variants have not settled when the run ends." in plain
    )
    for way, push, zeta in ((0, 0, 0), (1, 0, 1), (0, 1, 2), (1, 1, 0)):
        known[:, way, push, zeta] = np.nan
    found["midspan_move_and_settle_time"] = times.copy(data=known)
    said = answers.answer(found)[0]
    assert said == "midspan: no motion has settled when the run ends, at the worst zeta."
    known = np.random.default_rng(5).permutation(times.size).reshape(times.shape) / 1000.0 + 1.0
    known[:, :, :, :] = known[:, :1, :, :1]
    known[:, :, 1] = 1.5 * known[:, :, 0]
    found["midspan_move_and_settle_time"] = times.copy(data=known)
    found["midspan_settling_time"] = times.copy(data=0.5 * known)
    said = answers.answer(found)[0]
    assert "(push 1 N)" in said and "(push 2 N), whatever way and zeta" in re.sub(r" ± \S+ \S+", "", said)
    known[:, :, 1] = known[:, :, 0]
    found["midspan_move_and_settle_time"] = times.copy(data=known)
    said = answers.answer(found)[0]
    assert ", whatever push, way and zeta" in said and "(push" not in said.partition("whatever")[0]


def test_of_several_sensors_the_time_is_told_until_all_have_settled() -> None:
    """That of the last one in each variant, with its error; one that has not settled settles nothing."""
    sensors = {name: {"body": "bed", "at": at, "settling_band": 8e-3} for name, at in (("middle", 0.5), ("near", 0.3))}
    found = studies.run(stops(sweep=SWEPT, sensor=sensors, output={"residual": True, "histories": "none"}))
    names = [f"{sensor}_move_and_settle_time" for sensor in sensors]
    for name, known in zip(names, ([5.0, 3.0, 1.0, 2.0, 6.0], [1.0, 4.0, np.nan, 5.0, 7.0]), strict=True):
        found[name] = found[name].copy(data=np.array(known))
        found[name.replace("move_and_settle", "settling")] = found[name].copy(data=0.5 * np.array(known))
    for name, error in zip(names, (0.5, 0.01), strict=True):
        found["estimated_error"].loc[{"result": name}] = error
    told = [text for text in answers.answer(found) if "have settled" in text]
    assert len(told) == 1 and told[0].startswith(
        "Until all of middle and near have settled, move and settling take 4 s"
    )
    assert (
        told[0].endswith(
            f"at least at acceleration {STEPS[1]} m/s²; 1 of 5 variants has not settled when the run ends."
        )
        and "± 2 s" not in told[0]
    )
    assert not any("; move and settling" in text for text in answers.answer(found))


@pytest.mark.parametrize("beside", [False, True])
def test_limits_and_settling_of_a_dynamic_part_are_told(beside: bool) -> None:
    """At rest it swings as the whole does: its limit of residual vibrations counts, and so does its own time to settle
    where the whole beside it has none."""
    sensors = {"part": {"body": "bed", "at": 0.5, "settling_band": 8e-3, "part": "dynamic"}}
    sensors |= {"whole": {"body": "bed", "at": 0.5}} if beside else {}
    asked = {"residual": {"displacement": 1e-3}}
    given = stops(sensor=sensors, output={"residual": True, "histories": "none"}, question=asked)
    (told,) = (text for text in answers.answer(studies.run(given)) if text.startswith("part: after the stop"))
    assert "it exceeds 1 mm" in told and "settled" in told


def test_a_dynamic_part_and_its_whole_settle_as_one() -> None:
    """Both have a band, and one of them tells the time."""
    place = {"body": "bed", "at": 0.5, "settling_band": 0.025}
    sensors = {"part": place | {"part": "dynamic"}, "whole": place}
    told = answers.answer(studies.run(stops(sensor=sensors, output={"residual": True, "histories": "none"})))
    assert not any("have settled" in text for text in told)
    assert sum("move and settling take" in text for text in told) == 1


def test_what_swings_on_after_a_crossing_stands_behind_how_far_it_bent() -> None:
    """Nothing stops then, and the shortest crossing and settling is no question of a bridge."""
    sensors = {"midspan": fixed(0.5) | {"settling_band": 8e-3}, "quarter": fixed(0.25)}
    given = study(
        beam(modes=1, damping_ratio=0.03), force(2.0, cruise(0.0, 1.0, 1.0, after=20.0)), sensor=sensors,
        sweep={"speed": {"of": "carriage.car.motion.speed", "values": [0.4, 0.7, 1.0]}},
        output={"residual": True}, solver={"steps": 2000, "tolerance": 0.5},
    )  # fmt: skip
    found = studies.run(given)
    first, swings, other = answers.answer(found)[:3]
    assert first.startswith("midspan: the largest displacement") and other.startswith("quarter: the largest")
    times = found.midspan_settling_time.values
    assert swings.startswith("midspan: after the last carriage has left it still swings by up to ")
    assert f"{times.max():.3g} s after the last carriage has left at the latest" in re.sub(r" ± \S+ \S+", "", swings)
    assert np.ptp(found.midspan_move_and_settle_time.values) > 0.0
    assert not any("move and settling" in text or "the stop" in text for text in answers.answer(found))
    titles = {one.name: one.title for one in studies.figures(found)}
    one, two = list(titles)[:2]
    assert one.startswith("largest-displacement") and two == "residual"
    assert titles["settling"].startswith("midspan takes up to ") and "has left" in titles["residual"]


def test_errors_of_an_amplification_have_no_unit() -> None:
    """As itself."""
    errors = studies.errors(studies.run(stops(output={"histories": "none"})))
    assert errors.dynamic_amplification.attrs["units"] == "1" and errors.midspan_max.attrs["units"] == "m"


def test_what_a_variant_has_not_has_no_error() -> None:
    found = studies.run(stops(output={"residual": True, "histories": "none"}))
    whole = studies.errors(found).midspan_residual.values
    found.midspan_residual[1] = np.nan
    assert np.isfinite(whole).all()
    np.testing.assert_array_equal(
        np.isnan(studies.errors(found).midspan_residual.values), np.isnan(found.midspan_residual)
    )


def test_statics_tell_no_residual_vibration() -> None:
    with pytest.raises(BadInput, match=r"solver\.fidelity: statics do not swing on"):
        studies.run(stops(solver={"fidelity": "static"}))


def test_of_many_values_those_are_told_at_which_something_settles() -> None:
    """Four of nine evenly spread were looked at, none of which settled, and so it was said of all."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    sweep = SWEPT | {"push": {"of": "carriage.car.force", "from": 1.0, "to": 2.0, "count": 9}}
    found = studies.run(stops(sweep=sweep, sensor=sensors, output={"residual": True, "histories": "none"}))
    dims = ("acceleration", "push")
    times = found.midspan_move_and_settle_time.transpose(*dims)
    known = np.full(times.shape, np.nan)
    known[:, 7] = 3.0 + 0.1 * np.arange(times.shape[0])
    found["midspan_move_and_settle_time"], found["midspan_settling_time"] = (
        times.copy(data=known * k) for k in (1, 0.5)
    )
    said = re.sub(r" ± \S+ \S+", "", answers.answer(found)[0])
    assert f"move and settling take at least 3 s at acceleration {STEPS[0]} m/s²" in said and "(push 1.88 N)" in said
    assert "no motion has settled when the run ends at 8 other values of push" in said


def test_when_a_carriage_sets_off_is_there_to_choose() -> None:
    """The best delay is told as the best acceleration is, and not one for each."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 8e-3}}
    sweep = {"delay": {"of": "carriage.other.delay", "from": 0.0, "to": 0.2, "count": 3}}
    both = {"car": force(2.0, MOVE), "other": force(1.0, MOVE)}
    output = {"residual": True, "histories": "none"}
    given = study(beam(modes=1, damping_ratio=0.1), both, sensor=sensors, sweep=sweep, output=output)
    (said,) = (text for text in answers.answer(studies.run(given)) if "move and settling take" in text)
    assert "at least at delay" in said and "(delay" not in said


def test_the_motion_with_the_least_swing_is_told_at_the_worst_of_all_else() -> None:
    sweep = SWEPT | {"zeta": {"of": "body.bed.damping_ratio", "values": [0.02, 0.04]}}
    found = studies.run(stops(sweep=sweep, output={"residual": True, "histories": "none"}))
    (said,) = (text for text in answers.answer(found) if "after the stop it" in text)
    swings = found.midspan_residual.transpose("acceleration", "zeta").values
    best = int(np.argmin(swings.max(axis=1)))
    least = quantity(float(swings.max(axis=1)[best]), "m")
    told = f", and least, by up to {least} at the worst of all else, at acceleration {STEPS[best]} m/s²"
    assert told in said
    found["midspan_residual"] = found.midspan_residual.where(False, 1e-3)
    assert "and least" not in " ".join(answers.answer(found))
