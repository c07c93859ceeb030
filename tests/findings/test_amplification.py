"""Errors of what a study derives from other results."""

import numpy as np
import pytest
import xarray as xr

import studies
from engine.scene.study import Study, load
from studies.commands import screens
from studies.findings.amplification import beside, sizes, with_derived_errors
from studies.findings.contacts import told_uplift
from studies.protocol.study import kind_of
from studies.reporting import answers, summary
from studies.results.formatting import quantity
from studies.results.results import Results
from tests.engine.build import beam, cruise, fixed, force, mass
from tests.engine.build import study as built
from tests.studies import scenes


@pytest.mark.parametrize("kind", ["passage", "double-peak"])
@pytest.mark.parametrize("swept", [True, False])
def test_the_error_of_an_amplification_is_the_larger_of_both_extremes(kind: str, swept: bool) -> None:
    found = scenes.run(kind, scenes.pace(kind) if swept else "")
    for sensor in ("midspan", "moment"):
        own = found.estimated_error.sel(result=f"dynamic_amplification {sensor}")
        ends = [found.estimated_error.sel(result=f"{sensor}_{end}").values for end in ("max", "min")]
        np.testing.assert_array_equal(own.values, np.maximum(*ends))
        assert np.isfinite(own.values).all() and own.dims == found.status.dims
        assert float(found.tolerance.sel(result=f"dynamic_amplification {sensor}")) == 1e-3
    assert found.estimated_error.dtype == np.float32 and found.estimated_error.dims[-1] == "result"
    assert found.result.attrs["long_name"] == "reported number"


@pytest.mark.parametrize("kind", ["passage", "double-peak"])
def test_the_answer_says_that_own_weight_counts_in_an_amplification(kind: str) -> None:
    """With the sag 5 rho A g L^4/(384 E I) of a pinned beam in the static value too."""
    light, heavy = (study_of(kind, own) for own in ("false", "true"))
    static = []
    for study in (light, heavy):
        found = Results.of(studies.run(study))
        gain = float(found.dataset["dynamic_amplification"].sel(sensor="midspan"))
        static.append(float(sizes(found, "midspan")) / gain)
        (said,) = (one for one in kind_of(study).findings(found) if "times the static" in one and "midspan" in one)
        assert ("(own weight in both)" in said) == (study is heavy)
    sag = 5.0 * 7850.0 * 0.01 * 9.80665 * 10.0**4 / (384.0 * 210e9 * 8e-6)
    assert static[1] - static[0] == pytest.approx(sag, rel=1e-3)


def test_an_answer_says_as_large_where_nothing_is_amplified() -> None:
    """A static passage of masses was told to be "1 times the static 35.7 µm"."""
    masses = 'mass = { of = "carriage.table.mass", values = [50, 100] }'
    dataset = studies.run(load(scenes.text_of("passage", masses, extra="[solver]\nfidelity = 'static'")))
    (said,) = (one for one in answers.answer(dataset) if one.startswith("midspan"))
    assert " as large as the static " in said and " 1 times" not in said


def test_no_place_is_told_of_what_is_the_same_everywhere_as_it_is_told() -> None:
    """A largest value that differs by less than its three digits, and an amplification that does."""
    masses = 'mass = { of = "carriage.table.mass", values = [50, 100] }'
    dataset = studies.run(load(scenes.text_of("passage", masses)))
    gain = dataset["dynamic_amplification"].sel(sensor="midspan")
    dataset["midspan_max"][:], dataset["midspan_min"][:], gain[:] = [1.23e-5, 1.2304e-5], 0.0, [1.3, 1.2]
    (said,) = (one for one in answers.answer(dataset) if one.startswith("midspan"))
    assert " and hardly changes over mass 50 to 100 kg; relative to statics it is largest at mass 50 kg: 1.3" in said
    assert "at mass 100 kg" not in said and said.count("hardly changes") == 1
    ends = {f"{one.name} {one.sensor}": screens._where(one) for one in summary.in_tables(Results.of(dataset))}
    assert ends["midspan_max "] == "" and ends["dynamic_amplification midspan"] == "largest at mass 50 kg"
    gain[:] = [1.0001, 1.0]
    (said,) = (one for one in answers.answer(dataset) if one.startswith("midspan"))
    assert ", as large as the static 12.3 µm, and hardly changes over mass 50 to 100 kg." in said
    dataset["midspan_max"][:] = [1.23e-5, 1.44e-5]
    (said,) = (one for one in answers.answer(dataset) if one.startswith("midspan"))
    assert ", as large as the static 14.4 µm, at mass 100 kg." in said
    dataset["midspan_max"][:], gain[:] = [1.23e-5, 1.4451e-5], [1.0, 1.0016]
    (said,) = (one for one in answers.answer(dataset) if one.startswith("midspan"))
    assert " is 14.5 µm" in said and ", 1.002 times the static 14.4 µm, at mass 100 kg." in said


def test_rounding_is_not_told_as_a_number() -> None:
    """Of a sensor beside one that reads a billion times as much in its unit, and of halves of a cycle."""
    other = "[sensor.quiet]\nbody = 'bed'\nat = 2.0\n"
    dataset = studies.run(load(scenes.text_of("passage", extra=other)))
    dataset["quiet_max"][...], dataset["quiet_min"][...] = 1e-25, -2e-25
    (said,) = (one for one in answers.answer(dataset) if one.startswith("quiet"))
    assert said == "quiet: it reads nothing but rounding."
    told = {one.name: one.said(one.extreme) for one in summary.in_tables(Results.of(dataset)) if not one.is_loose}
    assert told["quiet_max"] == told["quiet_min"] == "0 m" != told["midspan_max"]
    halves = studies.run(load(scenes.text_of("double-peak")))
    for ratio, told in ((4e-16, "are alike."), (0.01, "are alike; odd harmonics are at most 1 % of the even.")):
        halves["odd_even_ratio"][...] = ratio
        assert any(one.endswith(f"midspan: the two halves of a cycle {told}") for one in answers.answer(halves))


@pytest.mark.parametrize("kind", ["passage", "asymmetry", "double-peak", "trajectory"])
def test_sentences_about_one_variant_end_without_a_comma(kind: str) -> None:
    """Where nothing is swept there is no place in the sweep to name: "1.12 times the static 39.4 mm,."."""
    assert not [said for said in answers.answer(scenes.run(kind, "")) if ",." in said or ", ." in said]


def study_of(kind: str, own_weight: str) -> Study:
    return load(scenes.text_of(kind).replace("modes = 3", f"modes = 3\nown_weight = {own_weight}"))


def test_an_error_that_is_not_known_stays_so() -> None:
    given = xr.Dataset(
        {
            "estimated_error": (("speed", "result"), np.float32([[1e-3, np.nan], [2e-3, 1e-3]])),
            "tolerance": ("result", [1e-2, 1e-2]),
        },
        coords={"result": ["a", "b"]},
    )
    found = with_derived_errors(given, {"a over b": ("a", "b")})
    np.testing.assert_array_equal(found.estimated_error.sel(result="a over b"), np.float32([np.nan, 2e-3]))
    xr.testing.assert_identical(found.sel(result=["a", "b"]), given)


def test_other_sensors_that_exceed_statics_are_told_with_the_first() -> None:
    """Near an end the vibration is larger beside the little deflection there."""
    sensors = {"midspan": fixed(0.5), "end": fixed(0.02)}
    speeds = {"speed": {"of": "carriage.car.motion.speed", "values": [0.02, 0.9]}}
    found = studies.run(built(beam(), mass(0.3, cruise(0.0, 1.0, 0.1)), sensor=sensors, sweep=speeds))
    gain = {name: float(found.dynamic_amplification.sel(sensor=name).max()) for name in sensors}
    assert gain["end"] > 1.1
    assert (
        f"Of the other sensors end (up to {gain['end']:.3g}) exceeds a dynamic amplification of 1.1."
        in answers.answer(found)[0]
    )


def test_sensors_beyond_their_limits_and_supports_that_pull_are_told() -> None:
    """An acceleration of 3.9 m/s2 where 3.5 were allowed stood in the report alone, and uplift nowhere."""
    sensors = {"left": fixed(0.0, "support_reaction"), "middle": fixed(0.5), "quarter": fixed(0.25)}
    speeds = {"speed": {"of": "carriage.car.motion.speed", "values": [0.5, 2.0, 4.0]}}
    asked = {"displacement": 1e-3, "support_reaction": 10.0}
    jib = beam(supports=[{"at": 0.0, "stiffness": 1e4}, {"at": 0.7, "stiffness": 1e4}])
    found = studies.run(built(jib, force(3.0, cruise(0.0, 1.0, 0.1)), sensor=sensors, sweep=speeds, question=asked))
    told = "\n".join(answers.answer(found))
    least = float(found.left_min.min())
    assert least < -0.5
    assert f"It pulls by up to {quantity(-least, 'N')} at speed" in told and "own weight not counted" in told
    quarter = float(np.maximum(found.quarter_max, -found.quarter_min).max())
    other = "middle" if told.startswith("quarter") else "quarter"
    size = float(np.maximum(found[f"{other}_max"], -found[f"{other}_min"]).max())
    assert quarter > 1e-3 and f"Of the other sensors {other} (up to {quantity(size, 'm')}) exceeds its limit." in told


def supported(middle: float, right: float, own_weight: bool) -> Study:
    """A beam on three springs, the first at its end, each of which is read."""
    reads = {"displacement": fixed(0.5), "moment": fixed(0.5, "bending_moment"), "rate": fixed(0.5, "velocity")}
    reads |= {"quarter": fixed(0.25), "more": fixed(0.25, "bending_moment")}
    reads |= {name: fixed(at, "support_reaction") for name, at in (("middle", middle), ("right", right), ("left", 0.0))}
    bed = beam(supports=[{"at": at, "stiffness": 1e4} for at in (0.0, middle, right)], own_weight=own_weight)
    speeds = {"speed": {"of": "carriage.car.motion.speed", "values": [0.2, 0.4]}}
    return built(bed, force(0.5, cruise(0.0, 1.0, 0.1)), sensor=reads, sweep=speeds)


def test_supports_that_pull_are_told_though_others_press_more() -> None:
    """The largest reaction is of the right one, and that of all which pulls most was left out."""
    found = studies.run(supported(0.4, 0.8, own_weight=False))
    told = "\n".join(answers.answer(found))
    pull = {name: quantity(-float(found[f"{name}_min"].min()), "N") for name in ("left", "middle", "right")}
    assert f"It pulls by up to {pull['right']} at speed 0.4 m/s, own weight not counted. Of the other supports" in told
    assert f"middle pulls by up to {pull['middle']} at speed 0.2 m/s and left by up to {pull['left']} at speed" in told
    assert told.count("own weight not counted") == 1 and "\nleft:" not in told and "\nmiddle:" not in told
    heavy = studies.run(supported(0.5, 1.0, own_weight=True))
    lowest = min(("left", "middle", "right"), key=lambda name: float(heavy[f"{name}_min"].min()))
    assert float(heavy[f"{lowest}_min"].min()) > 0.0
    told = "\n".join(answers.answer(heavy))
    of = "" if f"\n{lowest}:" in told else f" of {lowest}"
    assert (
        f"No support lifts: the smallest reaction{of} is {quantity(float(heavy[f'{lowest}_min'].min()), 'N')}" in told
    )


def test_the_support_that_pulls_most_is_told_with_the_first_of_them() -> None:
    """Though it has a sentence of its own further on, which short answers leave out."""
    found = studies.run(supported(0.4, 0.8, own_weight=False))
    results, names = Results.of(found), ("left", "middle", "right")
    least = {name: float(found[f"{name}_min"].min()) for name in names}
    most = min(names, key=lambda name: least[name])
    first = next(name for name in names if name != most)
    said = told_uplift(results, first, [first, most])
    assert f"Of the other supports {most} pulls by up to {quantity(-least[most], 'N')}" in said


def test_dynamic_parts_of_reactions_lift_nothing() -> None:
    """They swing about 0 while the support presses."""
    own = {"left": fixed(0.0, "support_reaction"), "swings": fixed(0.0, "support_reaction") | {"part": "dynamic"}}
    own["right"] = fixed(1.0, "support_reaction")
    speeds = {"speed": {"of": "carriage.car.motion.speed", "values": [0.2, 0.4]}}
    bed = beam(supports=[{"at": at, "stiffness": 1e4} for at in (0.0, 1.0)], own_weight=True)
    found = studies.run(built(bed, force(0.5, cruise(0.0, 1.0, 0.1)), sensor=own, sweep=speeds))
    assert float(found.swings_min.min()) < 0.0 < float(found.left_min.min())
    told = "\n".join(answers.answer(found))
    assert "No support lifts: the smallest reaction" in told and "pulls" not in told


def test_a_remark_stands_once_in_an_answer() -> None:
    sensors = {"midspan": fixed(0.5), "quarter": fixed(0.25), "moment": fixed(0.5, "bending_moment")}
    speeds = {"speed": {"of": "carriage.car.motion.speed", "values": [0.02, 0.03]}}
    told = "\n".join(
        studies.answer(studies.run(built(beam(), force(0.3, cruise(0.0, 1.0, 0.1)), sensor=sensors, sweep=speeds)))
    )
    assert told.count("exceeds 1.1 nowhere") == 3 and told.count("It compares largest values") == 1


def test_contacts_of_many_carriages_are_one_sentence() -> None:
    """Eight axles had eight sentences."""
    train = mass(0.01, cruise(0.0, 1.0, 0.3)) | {"axles": 5, "spacing": 0.1}
    speeds = {"speed": {"of": "train.tram.motion.speed", "values": [0.2, 0.3]}}
    found = studies.run(built(beam(), {}, train={"tram": train}, sweep=speeds))
    least = {f"tram_{n}": float(found[f"tram_{n}_contact_force_min"].min()) for n in range(1, 6)}
    lowest = min(least, key=lambda name: least[name])
    (said,) = (text for text in studies.answer(found) if "keep" in text)
    assert said.startswith(
        f"5 carriages keep their contact everywhere; the smallest contact force, that of {lowest}, is "
    )
    assert quantity(least[lowest], "N") in said


def test_neighbours_in_a_sweep_are_those_of_its_values_in_order() -> None:
    """Of values in any order; none at the ends, and where one has no value."""
    sweep = 'mass = { of = "carriage.table.mass", values = [50, 100] }\n'
    sweep += 'speed = { of = "carriage.table.motion.speed", values = [3, 1, 2, 4] }'
    results = Results.of(scenes.run("passage", sweep))
    axis = next(axis for axis in results.axes if axis.name == "speed")
    assert results.dims == ("mass", "speed")
    values = np.array([[0.0, 0.0, 0.0, 0.0], [0.8, 0.5, 1.0, np.nan]])
    assert beside(results, values, (1, 2), axis).tolist() == [0.5, 0.8]
    assert all(beside(results, values, (1, entry), axis).size == 0 for entry in (0, 1, 3))


def test_the_answer_tells_where_a_peak_between_speeds_may_be_higher() -> None:
    """Of nine forces on a bridge, whose largest deflection is 5 % larger between four speeds."""
    train = force(2.0, cruise(0.0, 1.0, 1.0)) | {"axles": 9, "spacing": 0.3}

    def run(speeds: list[float]) -> xr.Dataset:
        sweep = {"speed": {"of": "train.tram.motion.speed", "values": speeds}}
        sensor = {"middle": fixed(0.5)}
        return studies.run(built(beam(damping_ratio=0.01), {}, train={"tram": train}, sensor=sensor, sweep=sweep))

    coarse, fine = run([0.43, 0.4625, 0.4975, 0.53]), run(np.linspace(0.46, 0.52, 61).tolist())
    assert float(fine["middle_max"].max()) > 1.04 * float(coarse["middle_max"].max())
    less = 100.0 * (1.0 - float(coarse["middle_max"][3] / coarse["middle_max"][2]))
    words = f"({less:.0f} % less at a speed beside it: peaks between may be higher)"
    assert words in " ".join(studies.answer(coarse)) and less > 5.0
    assert "less at a speed" not in " ".join(studies.answer(fine))


def test_a_contact_force_is_told_as_a_part_of_the_weight_too_where_masses_differ() -> None:
    """The lightest mass presses least, the heaviest is nearest to lifting off."""
    found = scenes.run("passage", 'mass = { of = "carriage.table.mass", values = ["20 kg", "200 kg"] }')
    force = found.table_contact_force_min.values
    light, heavy = force / (9.81 * np.array([20.0, 200.0]))
    assert force[0] < force[1] and heavy < light
    (told,) = (text for text in studies.answer(found) if "keeps its contact" in text)
    assert f"the smallest contact force is {quantity(float(force[0]), 'N')}" in told
    assert told.endswith(f"at mass 20 kg; over the weight it is smallest at mass 200 kg: {heavy:.3g}.")


def test_a_body_that_nothing_holds_has_no_static_value() -> None:
    """It moves away: "44,200 times the static value" was said of it."""
    for supports, says in (("free-free", False), ("pinned-pinned", True)):
        said = " ".join(studies.answer(studies.run(built(beam(supports=supports), mass(0.2, cruise(0.0, 1.0, 0.5))))))
        assert ("times the static" in said) == says, said
