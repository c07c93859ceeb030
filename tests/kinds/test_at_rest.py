"""The kinds `eigenfrequencies` and `influence`: grids, refusals, comparisons, sentences, figures, commands."""

from pathlib import Path

import numpy as np
import pytest

import engine
import studies
from engine.bodies.reduced.body import save_body
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.status import Fidelity, Status
from studies.at_rest.findings import frequency_errors, reading_errors
from studies.protocol.library import find_study
from studies.protocol.study import kind_of
from studies.reporting import answers
from studies.reporting.summary import ranges
from studies.results.formatting import scientific
from studies.results.results import Results
from studies.runs.audit_findings import told_accuracy
from tests.bodies.frames import body
from tests.engine.build import steel
from tests.studies import at_rest as small
from tests.studies.at_rest import KINDS, MASS, TABLE

COMPARED = "positions = 5\nmode_counts = [3, 6, 10]\nunreduced = 3"
UNIT = np.sqrt(210e9 * 8e-6 / 78.5)  # of omega (L = pi): sqrt(E I / rho A)


# ---- results ----


def test_frequencies_on_the_grid() -> None:
    found = small.run("eigenfrequencies", "positions = 5\nmodes = 4", MASS)
    assert found.frequency.dims == ("mass", "position", "mode") and found.frequency.shape == (2, 5, 4)
    assert found.position.values.tolist() == [1.0, 1.5, 2.0, 2.5, 3.0]
    bare = (np.pi / 4.0) ** 2 * UNIT / (2.0 * np.pi)
    for mass in (20.0, 50.0):
        first = float(found.frequency.sel(mass=mass, position=2.0, mode=1))
        assert first == pytest.approx(bare / np.sqrt(1.0 + 2.0 * mass / 314.0), rel=2e-3)  # Rayleigh's, a little above
    assert found.mode_shape.dims == ("on_body", "position", "mode", "body_place")
    assert (found.fidelity_used == Fidelity.MASS).all() and (found.steps_used == 0).all()
    assert (found.status == Status.OK).all() and (found.modes_used == 10).all()


def test_readings_on_the_grid() -> None:
    found = small.run("influence", sweep=MASS)
    assert found.middle.dims == ("mass", "position") and found.contact.values.tolist() == ["car"]
    stiffness, own = 210e9 * 8e-6, 5.0 * 78.5 * 9.80665 * 4.0**4 / (384.0 * 210e9 * 8e-6)
    expected = 50.0 * 9.80665 * 4.0**3 / (48.0 * stiffness) + own
    assert float(found.middle.sel(mass=50.0, position=2.0)) == pytest.approx(expected, rel=1e-9)
    assert float(found.middle_influence.sel(mass=20.0, position=2.0)) == pytest.approx(4.0**3 / 48.0 / stiffness)
    assert found.middle_influence.attrs["units"] == "m N-1"
    np.testing.assert_allclose(found.contact_force.sel(mass=20.0), 20.0 * 9.80665)
    shape = found.deflection.sel(on_body="bed", position=2.0, body_place=0.5)
    base = float(small.run("influence").middle.sel(position=2.0))
    assert float(shape) == pytest.approx(base, rel=1e-12)
    assert (found.fidelity_used == Fidelity.STATIC).all() and (found.steps_used == 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_variants_are_what_they_are_alone(kind: str) -> None:
    """A sweep over what changes the scene and what does not."""
    stiffness = 'stiffness = { of = "body.bed.youngs_modulus", values = [1e11, 2e11, 3e11] }'
    found = small.run(kind, sweep=f"{stiffness}\n{MASS}")
    one = studies.run(small.study(kind).with_values({"body.bed.youngs_modulus": 2e11, "carriage.car.mass": 20.0}))
    for name in ("frequency",) if kind == "eigenfrequencies" else ("middle", "moment", "moment_influence"):
        np.testing.assert_allclose(found[name].sel(stiffness=2e11, mass=20.0), one[name], rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_positions_where_a_variant_is_off_its_body_have_no_values(kind: str) -> None:
    found = small.run(
        kind, sweep='length = { of = "body.bed.length", values = [3.0, 4.0] }', question="positions = [1.0, 3.5]"
    )
    name = "frequency" if kind == "eigenfrequencies" else "middle"
    known = np.isfinite(found[name].values.reshape(2, 2, -1)).all(axis=2)
    assert known.tolist() == [[True, False], [True, True]]


def relative(kind: str, given: Study, truth: Study) -> tuple[np.ndarray, np.ndarray]:
    """Told and true errors (result,) of two studies of one scene."""
    found, right = studies.run(given), studies.run(truth)
    told, true = found.estimated_error, []
    for name in told.result.values:
        if kind == "eigenfrequencies":
            mode = int(name.removeprefix("frequency "))
            one, other = (ds.frequency.sel(mode=mode) for ds in (found, right))
            true.append(float(abs(one / other - 1.0).max()))
        elif not name.startswith("contact_force"):
            true.append(float(abs(found[name] - right[name]).max() / abs(right[name]).max()))
        else:
            true.append(0.0)
    assert np.isnan(found.tolerance).all()
    return told.values, np.array(true)


def check_told(told: np.ndarray, true: np.ndarray) -> None:
    assert np.isfinite(told).all() and (told >= 1e-8).all() and (told >= true).all()
    seen = true > 1e-7
    assert (told[seen] <= 1.6 * true[seen]).all()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("modes", "correction"), [(2, True), (8, True), (8, False), (40, True)])
def test_told_errors_are_the_true_ones(kind: str, modes: int, correction: bool) -> None:
    """Of the modes that are left out; statics with their correction are exact whatever is kept."""
    given = small.study(kind, f"positions = 7{f'{chr(10)}modes = {min(modes, 8)}' if kind != 'influence' else ''}")
    given = given.with_values({"body.bed.modes": modes, "solver.static_correction": correction})
    truth = given.with_values({"body.bed.modes": 64, "solver.static_correction": True})
    told, true = relative(kind, given, truth)
    check_told(told, true)
    assert (told.max() <= 1e-8) == (kind == "influence" and correction)
    assert told.max() > 1e-3 or correction


@pytest.mark.parametrize(("elements", "largest"), [(2, 0.2), (4, 0.05)])
def test_errors_of_elements_are_told(elements: int, largest: float) -> None:
    """Of frames that are cut too coarsely; frequencies alone have such."""
    for kind in KINDS:
        base = small.study(kind, "positions = 5").with_values({"body.bed": small.PORTAL | {"modes": 20}})
        cut = {f"body.bed.member.{name}.elements": elements for name in small.PORTAL["member"]}
        truth = {f"body.bed.member.{name}.elements": 32 for name in small.PORTAL["member"]} | {"body.bed.modes": 60}
        told, true = relative(kind, base.with_values(cut), base.with_values(truth))
        check_told(told, true)
        assert (told.max() <= 1e-8) if kind == "influence" else 0.01 < told.max() < largest


def test_errors_of_a_sweep_are_those_of_its_variants() -> None:
    """Told in words, in tables in the unit of each frequency, and with each result of its own name."""
    found = small.run("eigenfrequencies", "positions = 5\nmodes = 4", MASS)
    assert found.estimated_error.dims == ("mass", "result")
    assert found.result.values.tolist() == [f"frequency {mode}" for mode in (1, 2, 3, 4)]
    alone = studies.run(
        small.study("eigenfrequencies", "positions = 5\nmodes = 4").with_values({"carriage.car.mass": 50})
    )
    np.testing.assert_allclose(found.estimated_error.sel(mass=50.0), alone.estimated_error, rtol=1e-6)
    results = Results.of(found)
    worst = found.estimated_error.values.max()
    assert told_accuracy(None, results).startswith(f"estimated errors at most {scientific(worst)} (frequency ")
    (row,) = (one for one in ranges(results) if one.name == "frequency")
    part = float(found.estimated_error.sel(result="frequency 4", mass=row.largest.variant["mass"]))
    assert row.largest.error == pytest.approx(part * row.largest.value, rel=1e-6)


def test_a_scene_without_a_finer_one_has_no_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(model: object) -> None:
        raise BadInput("no finer one")

    monkeypatch.setattr("studies.at_rest.at_rest.finer", refuse)
    found = studies.run(small.study("influence", "positions = 3"))
    assert np.isnan(found.estimated_error).all() and "accuracy" not in told_accuracy(None, Results.of(found))


def test_saved_bodies_with_all_their_modes_have_no_errors(tmp_path: Path) -> None:
    """What these leave out is not in the file; with some of them it is told."""
    save_body(body(small.PORTAL | {"modes": 8}), tmp_path / "body.nc")
    for modes, known in ((8, False), (3, True)):
        table = {"kind": "reduced", "file": str(tmp_path / "body.nc"), "modes": modes}
        given = small.study("eigenfrequencies", "positions = 3\nmodes = 2").with_values({"body.bed": table})
        assert np.isfinite(studies.run(given).estimated_error).all() == known


def test_a_contact_that_would_lift_is_flagged() -> None:
    """A table much stiffer than its three contacts on a soft bed that hogs between supports: one of them pulls."""
    text = small.text_of("influence", carriage=TABLE).replace('"pinned-pinned"', '"clamped-free"')
    text = text.replace("at = 2.0\n", "at = 2.0\n").replace("second_moment = 8e-6", "second_moment = 8e-7")
    found = studies.run(engine.load(text))
    opened = bool((found.contact_force < 0.0).any())
    assert opened and int(found.status) == Status.SEPARATED
    assert any("separated" in text for text in answers.answer(found))


def test_a_table_on_contacts() -> None:
    found = small.run("influence", COMPARED, carriage=TABLE)
    weight = 78.5 * 9.80665
    np.testing.assert_allclose(found.contact_force.sum("contact"), weight, rtol=1e-9)
    assert found.contact.values.tolist() == ["car.rear", "car.middle", "car.front"]
    assert found.on_body.values.tolist() == ["bed", "table"]
    assert "Contact forces lie between" in " ".join(answers.answer(found))


# ---- comparisons ----


@pytest.mark.parametrize("carriage", [small.CAR, TABLE], ids=["mass", "table"])
def test_frequencies_agree_with_the_unreduced_model(carriage: str) -> None:
    found = small.run("eigenfrequencies", f"{COMPARED}\nmodes = 5", carriage=carriage)
    assert found.unreduced_position.values.tolist() == [1.0, 2.0, 3.0]
    assert np.abs(found.frequency_difference).max() < 2e-3
    ratio = found.frequency.sel(position=[1.0, 2.0, 3.0]).values / found.frequency_unreduced.values - 1.0
    np.testing.assert_allclose(found.frequency_difference.values, ratio, atol=1e-12)
    error, against = frequency_errors(Results.of(found))
    assert against == "the unreduced model" and error.shape == (2, 3, 2)
    assert (error[0, 1:] < error[1, 1:]).all() and error[0, 2].max() < 2e-3
    assert np.isnan(error[:, 0]).all() == (carriage == small.CAR)  # three modes and a mass have four frequencies
    assert found.checked_position.values.tolist() == [2.0, 3.0]


@pytest.mark.parametrize("carriage", [small.CAR, TABLE], ids=["mass", "table"])
def test_readings_agree_with_the_unreduced_model(carriage: str) -> None:
    found = small.run("influence", COMPARED, carriage=carriage)
    for sensor in ("middle", "moment"):
        assert float(np.abs(found[f"{sensor}_difference"]).max()) < 1e-4
        error, against = reading_errors(Results.of(found), sensor)
        assert against == "the unreduced model" and error[0].max() < 1e-4 < error[1, 0].max()
    assert float(np.abs(found.contact_force_difference).max()) < 1e-4
    text = " ".join(answers.answer(found))
    assert "with static correction from 3 modes of every body on" in text


@pytest.mark.parametrize(("count", "places"), [(1, [2.0]), (2, [2.0, 3.0]), (3, [1.0, 2.0, 3.0])])
def test_positions_of_the_unreduced_model(count: int, places: list[float]) -> None:
    found = small.run("influence", f"positions = 5\nunreduced = {count}")
    assert found.unreduced_position.values.tolist() == places


def test_the_machine_bed_agrees_with_its_full_model() -> None:
    """Coupled frequencies up to the 8th within 0.2 %, static deflections within 0.01 %, at five positions."""
    for name in ("machine-bed-frequencies", "machine-bed-statics"):
        case = engine.load(find_study(name)).with_values({"question.positions": 5, "question.mode_counts": []})
        found = studies.run(case)
        assert found.unreduced_position.values.tolist() == pytest.approx([0.4, 0.95, 1.5, 2.05, 2.6])
        if "frequency" in found:
            assert found.frequency.shape == (5, 8) and float(np.abs(found.frequency_difference).max()) < 2e-3
        else:
            for sensor in ("bed_middle", "table_centre", "under_table"):
                assert float(np.abs(found[f"{sensor}_difference"]).max()) < 1e-4, sensor
            assert float(np.ptp(found.bed_middle.values)) > 5e-6


# ---- refusals ----


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("question", "words"),
    [
        ("positions = 1", r"question\.positions"),
        ("positions = 2.5", r"question\.positions"),
        ("positions = [2.0, 1.0]", r"question\.positions: a list in ascending order"),
        ("positions = [2.0, 4.5]", r"question\.positions: a position where the carriage is off its body.*0 to 4 m"),
        ('positions = ["2 m", "1 kg"]', r"question\.positions\.1"),
        ("mode_counts = [5, 3]", r"question\.mode_counts"),
        ("mode_counts = [0]", r"question\.mode_counts"),
        ("unreduced = -1", r"question\.unreduced"),
        ("position = 5", r'question\.position: unknown key.*did you mean "positions"'),
    ],
)
def test_bad_questions_are_refused(kind: str, question: str, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        studies.run(small.study(kind, question))


AWAY = {"kind": "cruise", "start": 3.7, "end": 4.5, "speed": 1.0}
PUSH = {"on": "bed", "kind": "force", "force": 5.0, "motion": AWAY}
PULL = {"of": "gravity", "values": [1.0, 2.0]}
LOOSE = steel(4.0, supports="free-free")


@pytest.mark.parametrize(
    ("kind", "changes", "words"),
    [
        ("eigenfrequencies", {"solver.fidelity": "force"}, r"solver\.fidelity: forces have no inertia"),
        ("eigenfrequencies", {"solver.fidelity": "static"}, r"solver\.fidelity: forces have no inertia"),
        ("eigenfrequencies", {"carriage.car": PUSH}, r"carriage: forces have no inertia"),
        ("eigenfrequencies", {"carriage": {}, "sensor": {}}, r"carriage: nothing moves"),
        ("influence", {"sensor.middle.quantity": "velocity"}, r"sensor\.middle\.quantity: .*no static reading"),
        ("influence", {"sensor": {}}, r"sensor: nothing is measured"),
        ("eigenfrequencies", {"body.bed": LOOSE, "question.unreduced": 1}, r"body\.bed\.supports: nothing holds"),
        ("influence", {"body.bed": LOOSE}, r"body\.bed\.supports: nothing holds this body"),
        ("influence", {"sensor.deflection": {"body": "bed", "at": 1.0}}, r"deflection: two results"),
        ("influence", {"sweep.contact": PULL}, r"sweep\.contact: a result has this name"),
        ("influence", {"envelope": {"all": {"body": "bed", "quantity": "displacement"}}}, r"envelope"),
    ],
)  # fmt: skip
def test_scenes_that_do_not_suit_are_refused(kind: str, changes: dict[str, object], words: str) -> None:
    with pytest.raises(BadInput, match=words):
        studies.run(small.study(kind).with_values(changes))


def test_a_table_must_stand_on_its_body() -> None:
    case = small.study("influence", carriage=TABLE).with_values({"carriage.car.motion": AWAY})
    with pytest.raises(BadInput, match=r"carriage\.car\.motion: the carriage never stands.*within 0\.3 to 3\.6 m"):
        studies.run(case)


# ---- sentences and figures ----


def test_frequencies_that_stay_as_they_are_have_one_sentence() -> None:
    """ "Along the way frequency 1 changes most, by 0 %" was told of them."""
    found = small.run("eigenfrequencies", "positions = 9\nmodes = 4", MASS).copy(deep=True)
    found["base_frequency"][:] = found.base_frequency.isel(position=0)
    text = "\n".join(answers.answer(found))
    assert "Along the way no frequency changes by more than 0.1 %." in text and "changes most" not in text


def test_sentences_of_frequencies_follow_the_data() -> None:
    found = small.run("eigenfrequencies", "positions = 9\nmodes = 4", MASS)
    text = "\n".join(answers.answer(found))
    base = found.base_frequency
    assert f"{float(base.sel(position=2.0, mode=1)):.4g}" in text and "with car at 2 m" in text
    change = (base.max("position") - base.min("position")) / base.min("position")
    assert f"frequency {int(np.argmax(change.values)) + 1} changes most, by {100 * float(change.max()):.2g} %" in text
    low = float(found.frequency.sel(mode=1).min())
    assert f"between {low:.4g} Hz at mass 50 kg with car at 2 m" in text
    assert "come closest" in text and "nan" not in text


def test_sentences_of_readings_follow_the_data() -> None:
    found = small.run("influence", sweep=MASS)
    text = "\n".join(answers.answer(found))
    largest = 1e3 * float(found.middle.max())
    assert f"to {largest:.4g} mm at mass 50 kg with car at 2 m" in text
    own = 5.0 * 78.5 * 9.80665 * 4.0**4 / (384.0 * 210e9 * 8e-6)
    assert f"({100 * own / float(found.middle.max()):.2g} % of that by own weight)" in text
    assert "Contact forces" not in text  # a single mass presses with its weight
    still = small.run("influence", "positions = [1.0, 1.5]", carriage=small.CAR.replace("40.0", "1e-13"))
    assert "wherever car stands" in "\n".join(answers.answer(still))


def test_shapes_across_the_loads_are_drawn_at_rest() -> None:
    """A girder on two columns, whose lowest mode sways out of its plane."""
    way = {"kind": "cruise", "start": 1.0, "end": 3.0, "speed": 1.0}
    car = {"on": "portal", "kind": "mass", "mass": 100.0, "motion": way}
    study = engine.Study(
        kind="eigenfrequencies", body={"portal": small.PORTAL}, carriage={"car": car}, question={"positions": 3}
    )
    found = studies.run(study)
    moved = np.abs(found.mode_shape.isel(on_body=0, position=1)).max("body_place").values
    assert moved[0] < 1e-9 * moved.max()
    assert "ode 1 moves no track" in (text := "\n".join(answers.answer(found))) or "odes 1" in text
    [shapes] = [figure for figure in answers.figures(found) if figure.name == "shapes"]
    titles = [axes.get_title(loc="left") for axes in shapes.drawing.axes]
    assert sum("across the loads" in title for title in titles) >= 3


def test_directions_in_which_a_mass_does_not_act_are_told_first() -> None:
    """With what frequencies would be, those of the keys that it names; where it acts in all there is no word."""
    way = {"kind": "cruise", "start": 1.0, "end": 3.0, "speed": 1.0}
    car, found = {"on": "portal", "kind": "mass", "mass": 100.0, "motion": way}, []
    for more in ({}, {"inertia_along": True, "inertia_across": True}):
        body, asked = {"portal": small.PORTAL}, {"positions": 3}
        found.append(
            studies.run(engine.Study(kind="eigenfrequencies", body=body, carriage={"car": car | more}, question=asked))
        )
    plain, whole = found
    [remark], none = (kind_of(Results.of(one).study).remarks(Results.of(one).study) for one in found)
    assert remark.startswith("the mass of car does not act along or across its track") and not none
    told, lowest = answers.answer(plain)[0], float(whole.base_frequency.values[:, 0].min())
    assert told.startswith(
        "The mass of car does not act along or across its track: if it did (carriage.car.inertia_along"
    )
    assert (
        f"the lowest frequency would be {lowest:.4g} Hz, not {float(plain.base_frequency.values[1, 0]):.4g} Hz" in told
    )
    np.testing.assert_allclose(plain.base_frequency_all_directions, whole.base_frequency, rtol=1e-9)
    assert (whole.base_frequency.values[:, 0] < 0.98 * plain.base_frequency.values[:, 0]).all()
    assert "base_frequency_all_directions" not in whole and "does not" not in "".join(answers.answer(whole))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sweep", ["", MASS, f"{MASS}\ngravity = {{ of = 'gravity', values = [1.6, 9.8] }}"])
def test_figures(kind: str, sweep: str) -> None:
    carriage = small.CAR if sweep else TABLE
    figures = answers.figures(small.run(kind, COMPARED, sweep, carriage))
    names = [figure.name for figure in figures]
    assert {"modes", "shapes" if kind == "eigenfrequencies" else "deflection"} <= set(names)
    assert ("sweep" in names) == (bool(sweep) and kind == "eigenfrequencies")
    assert ("contacts" in names) == (not sweep and kind == "influence")
    for figure in figures:
        assert figure.title and figure.caption and "nan" not in figure.caption


def test_of_one_position_nothing_is_said_along_the_way() -> None:
    found = small.run("eigenfrequencies", "positions = [2.0]\nmodes = 2\nmode_counts = [3, 6]\nunreduced = 1")
    said, figures = answers.answer(found), {figure.name: figure for figure in answers.figures(found)}
    lowest = float(found.base_frequency[0, 0])
    assert said[0] == (
        f"The two lowest natural frequencies are {lowest:.4g} and {float(found.base_frequency[0, 1]):.4g} Hz with car "
        "at 2 m."
    )
    assert "long the way" not in "\n".join(said) and said[1].startswith("Frequencies 1 and 2 come closest")
    assert "frequencies up to the 2nd differ by" in "\n".join(said)
    assert "of the frequencies up to the 2nd, against" in figures["modes"].caption
    assert figures["frequencies"].title == f"The lowest natural frequency is {lowest:.4g} Hz with car at 2 m"
    assert "with the carriage where it stands," in figures["shapes"].caption


@pytest.mark.parametrize(("error", "words"), [(0.012, "by at most 1.2 %"), (1e-12, "by less than 1e-7 %")])
def test_rounding_is_no_largest_difference(error: float, words: str) -> None:
    found = small.run("influence", COMPARED).copy(deep=True)
    for name in ("middle", "moment"):
        found[f"{name}_difference"].values[:] = error
    assert f"readings differ {words} of the sensor's largest" in "\n".join(answers.answer(found))
