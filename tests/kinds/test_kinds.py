"""What each kind refuses and declares."""

import numpy as np
import pytest

import studies
from results_schema.errors import ArchiveError, BadInput
from results_schema.variables import registered
from studies.protocol import study as running
from studies.protocol.study import kind_of
from tests.studies import at_rest, scenes

KINDS = tuple(scenes.MOTIONS)
MEASURING = (
    *("eigenfrequencies", "influence", "stability", "work-precision", "moving-frames", "sliding-mass", "portal"),
)


def test_all_kinds_are_found_by_their_files() -> None:
    assert set(KINDS) <= set(studies.kind_names()) <= {*KINDS, *MEASURING}
    for name in studies.kind_names():
        kind = studies.kind_named(name)
        assert kind.name == name and kind.summary and kind.question.endswith("?")
        assert name in registered()


def test_an_unknown_kind_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(BadInput, match=r'unknown kind of study.*did you mean "asymmetry"'):
        studies.run(scenes.study("asymmetry").with_values({"kind": "asymetry"}))


@pytest.mark.parametrize("kind", KINDS)
def test_results_are_as_declared(kind: str) -> None:
    dataset = scenes.run(kind, scenes.pace(kind) if scenes.PACE[kind] else "")
    assert dataset.attrs["study_kind"] == kind and "[body.bed]" in dataset.attrs["study"]
    assert list(dataset["sensor"].values) == ["midspan", "moment"]
    assert list(dataset["sensor_unit"].values) == ["m", "N m"]
    assert "midspan_static" not in dataset


def test_a_result_that_is_missing_is_noticed() -> None:
    study = scenes.study("asymmetry")
    dataset = studies.run(study)
    with pytest.raises(ArchiveError, match="lag: expected in every asymmetry"):
        running.compared(dataset.drop_vars("lag"), study)


HISTORIES = '[output]\nhistories = "all"\n'
SWEPT_SPEED = '[sweep]\ntable_speed = { of = "carriage.table.mass", values = [0.1, 0.2] }'
SPEED_READ = '[sensor.table_speed]\nbody = "bed"\nat = 3.0'


@pytest.mark.parametrize(
    ("given", "changes", "extra", "words"),
    [
        ("passage", {"kind": "asymmetry"}, "", r'table.motion.kind: .*comes back.*"out-and-back".*"cruise"'),
        (  # before what else does not suit it
            "passage",
            {"kind": "asymmetry"},
            "[question]\namplification = 1.5",
            r'motion.kind: .*comes back.*kind = "passage" with way = . of = "carriage.table.motion.direction"',
        ),
        (
            "double-peak",
            {"kind": "asymmetry"},
            "",
            r'kind: .*between the turns.*constant speed; .*"out-and-back".*"sinusoidal"; remedy: kind = "double-peak"',
        ),
        ("passage", {"kind": "double-peak"}, "", r'motion.kind: .*repeats.*"cruise"'),
        (
            "asymmetry",
            {},
            '[sensor.rate]\nbody = "bed"\nat = 3.0\nquantity = "velocity"',
            r"sensor.rate.quantity: .*static response.*velocity",
        ),
        ("trajectory", {}, '[output]\nhistories = "none"', r"output.histories: a trajectory is its histories"),
        ("trajectory", {}, HISTORIES + SWEPT_SPEED, r"sweep\.table_speed: a result has this name"),
        ("trajectory", {}, HISTORIES + SPEED_READ, r"table_speed: two results would get this name"),
    ],
)
def test_what_does_not_suit_a_kind_is_refused(given: str, changes: dict[str, str], extra: str, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        kind_of(scenes.study(given, extra=extra).with_values(changes))


@pytest.mark.parametrize(
    ("sweep", "received"),
    [("", "0.26"), ('turn = { of = "carriage.table.motion.turn", values = [0.1, 0.3] }', "0.3")],
)
def test_asymmetry_needs_half_the_stroke_at_constant_speed(sweep: str, received: str) -> None:
    study = scenes.study("asymmetry", sweep)
    if not sweep:
        study = study.with_values({"carriage.table.motion.turn": 0.26})
    with pytest.raises(BadInput, match=rf"motion.turn: .*less than half.*at most 0.25, received {received}"):
        studies.run(study)


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_measured_is_refused(kind: str) -> None:
    text = scenes.text_of(kind)
    start, end = text.index("[sensor.midspan]"), text.index("[carriage.table.motion]")
    with pytest.raises(BadInput, match="nothing is measured"):
        studies.run(scenes.engine.load(text[:start] + text[end:]))


def test_a_sensor_that_never_moves_has_no_indices() -> None:
    extra = '[sensor.support]\nbody = "bed"\nat = 0.0'
    found = scenes.run("asymmetry", extra=extra)
    assert np.isnan(found.lag.sel(sensor="support")) and np.isfinite(found.lag.sel(sensor="midspan"))


def test_amplification_is_largest_over_static() -> None:
    found = scenes.run("passage", scenes.pace("passage"))
    gain = found.dynamic_amplification.sel(sensor="midspan")
    weight, stiffness = 100.0 * 9.80665, 210e9 * 8e-6
    modes = sum(2.0 / (n * np.pi) ** 4 * np.sin(n * np.pi / 2) ** 2 for n in range(1, 2000))
    largest = np.maximum(abs(found.midspan_max), abs(found.midspan_min))
    np.testing.assert_allclose(gain, largest / (weight * 10.0**3 / stiffness * modes), rtol=1e-5)


def test_histories_of_different_stations_are_told_as_such() -> None:
    """Those of the first one are not those of all."""
    masses = 'mass = { of = "carriage.table.mass", values = [50, 100] }'
    dataset = scenes.run("trajectory", masses, extra='[output]\nhistories = "all"')
    count = dataset.sizes["station"]
    assert f"on {count:,} stations." in "\n".join(studies.answer(dataset))
    dataset["midspan"].values[1, 100:] = np.nan
    assert f"on 100 to {count:,} stations." in (said := "\n".join(studies.answer(dataset)))
    assert said.count(" over all variants") == 2
    some = scenes.with_failures(dataset, 2)
    assert "\n".join(studies.answer(some)).count(" over 1 variant with values") == 2


@pytest.mark.parametrize("kind", at_rest.KINDS)
def test_carriages_that_stay_while_the_first_one_is_moved_are_remarked(kind: str) -> None:
    """Wheels of a coach were left behind without a word; an absorber that stands is where it is."""
    other = {"on": "bed", "kind": "mass", "mass": 4.0, "motion": at_rest.study(kind).data["carriage"]["car"]["motion"]}
    standing = other | {"motion": {"kind": "standing", "at": 2.0}}
    said = {
        name: kind_of(given).remarks(given)
        for name, given in (
            ("alone", at_rest.study(kind)),
            ("absorber", at_rest.study(kind).with_values({"carriage.absorber": standing})),
            ("wheel", at_rest.study(kind).with_values({"carriage.wheel": other})),
        )
    }
    words = "the first carriage alone, car, is put from place to place; wheel stays at the start"
    assert words in said["wheel"] and not any("is put from place" in text for text in said["alone"] + said["absorber"])
