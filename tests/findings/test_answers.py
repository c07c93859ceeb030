"""What each kind of study says of its results."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import j0

import engine
import studies
from engine.batch.execution import run
from engine.observation.cycle_reduction import Compared
from engine.scene.variants import VariantValues
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.findings import theory
from studies.kinds.asymmetry import AsymmetryReduction
from studies.reporting import answers
from studies.results.findings_common import missed_most, remedy
from studies.results.formatting import percent, quantity
from studies.results.results import Results
from tests.engine.build import beam, cruise, force, oscillator, shuttle, study, under
from tests.studies import at_rest, scenes
from tests.studies.small import SEPARATED

KINDS = tuple(scenes.MOTIONS)
MASSES = 'mass = { of = "carriage.table.mass", values = [600, 700] }'
FOLLOWER = f"""\
[carriage.second]
on = "bed"
kind = "mass"
mass = 300.0
headway = 1.0
motion = {{ {scenes.MOTIONS["passage"].replace(chr(10), ", ")} }}
"""


def said(kind: str, sweep: str = "", **options: str) -> str:
    return "\n".join(answers.answer(scenes.run(kind, sweep, **options)))


def test_findings_of_an_asymmetry_name_the_largest_and_its_place() -> None:
    damping = 'damping_ratio = { of = "body.bed.damping_ratio", values = [0.01, 0.05] }'
    dataset = scenes.run("asymmetry", f"{scenes.pace('asymmetry', 0.2, 2.0, 6)}\n{damping}")
    text = "\n".join(answers.answer(dataset))
    cycle = 2.0 * (4.6 * 0.8 + np.pi * 0.46) / dataset.pace
    first = np.pi**2 / 10.0**2 * np.sqrt(210e9 * 8e-6 / 78.5)
    settled = np.exp(-dataset.damping_ratio * first / (1.0 + 2.0 * dataset.mass_ratio) * cycle) <= 0.01
    assert f"In {int((~settled).sum())} of 12 variants more than 1 % of the start's vibration is left" in text
    assert f"from pace {float(dataset.pace.where(~settled).min()):.3g} m/s on" in text
    odd = dataset.odd_rms.where(settled)
    assert float(odd.max()) < float(dataset.odd_rms.max())
    assert text.startswith(("Yes: ", "Hardly: "))
    assert f"{float(odd.max()) * 100:.2g} % of the" in text
    assert "2 × damping ratio × speed" in text and "theory" in text


def test_lag_under_the_carriage_is_half_of_that_at_a_fixed_place() -> None:
    """Slow and damped, in the model itself: the closed form that the findings compare with."""
    extra = '[sensor.under]\nunder = "table"'
    results = Results.of(scenes.run("asymmetry", scenes.pace("asymmetry", 0.2, 0.4, 2), extra=extra))
    for sensor in ("midspan", "under"):
        found = results.of_sensor("lag", sensor).values
        np.testing.assert_allclose(found, results.everywhere(theory.lag(results, sensor)), rtol=0.03)
    assert theory.lag_factor(results, "under") * 2 == theory.lag_factor(results, "midspan")


def test_dampers_under_a_bed_make_it_lag_by_what_they_add_to_its_first_mode() -> None:
    """A damper in the middle of a bed on two hard springs, c phi_1^2/(2 omega_1) of 0 to 0.08."""
    ends = [{"at": at, "stiffness": 1e9} for at in (0.0, 10.0)]
    middle = {"at": 5.0, "stiffness": 1.0, "damping": 100.0}
    bed = beam(length=10.0, area=0.01, second_moment=8e-6, youngs_modulus=210e9, density=7850.0, modes=6)
    bed |= {"supports": [*ends, middle], "damping_ratio": 0.02}
    way = {"kind": "out-and-back", "start": 5.0, "end": 9.6, "speed": 0.2, "turn": 0.1, "cycles": 2}
    table, sensor = {"on": "bed", "kind": "mass", "mass": 100.0, "motion": way}, {"middle": {"body": "bed", "at": 5.0}}
    swept = {"damping": {"of": "body.bed.supports.2.damping", "values": [0.0, 500.0, 1000.0, 2000.0]}}
    found = studies.run(
        engine.Study(kind="asymmetry", body={"bed": bed}, carriage={"table": table}, sensor=sensor, sweep=swept)
    )
    results = Results.of(found)
    expected = results.everywhere(theory.lag(results, "middle"))
    assert expected[-1] < 3.0 * expected[0] < 0.0
    np.testing.assert_allclose(results.of_sensor("lag", "middle").values, expected, rtol=0.03)
    assert "of the first mode with its dampers" in theory.lag_formula(results, "middle")
    stiffer = {"stiffness": {"of": "body.bed.youngs_modulus", "values": [2e11, 2.1e11]}}
    other = engine.Study(kind="asymmetry", body={"bed": bed}, carriage={"table": table}, sensor=sensor, sweep=stiffer)
    assert not theory.lag_is_known(Results.of(studies.run(other)))


def test_stations_of_an_asymmetry_are_enough_for_tight_tolerances() -> None:
    """Under a force between springs the static response has a sharp peak, whose range 400 stations miss by 3e-4."""
    springs = [{"at": 0.2954, "stiffness": 135.5}, {"at": 0.8428, "stiffness": 106.9}]
    moving = force(1.0, shuttle(0.1467, 0.9314, 2.0, 0.0932, 3))
    bed, sensor = beam(modes=6, supports=springs, damping_ratio=0.0), {"below": under("car")}
    given = study(bed, moving, kind="asymmetry", sensor=sensor, solver={"steps": 12_800, "audit": 0})
    own = AsymmetryReduction()

    def indices(stations: int) -> np.ndarray:
        found = run(given, reduction=replace(own, stations=stations))
        return np.array([float(found[name].squeeze()) for name in ("lag", "odd_rms", "even_excess", "loop_area")])

    fine = indices(6400)
    assert np.abs(indices(own.stations) - fine).max() < 2e-5
    assert np.abs(indices(400) - fine).max() > 1e-4


def test_odd_and_even_parts_are_told_no_less_than_half_of_what_histories_differ_by() -> None:
    """Two roots of mean squares are the same by chance; the lag counts over the cruise."""
    given = study(beam(), force(1.0, shuttle(0.1, 0.9, 1.0, 0.25, 1)), kind="asymmetry", sensor={"below": under("car")})
    names = ("lag", "loop_area", "odd_rms", "even_excess")
    one, other = ({name: np.full((1, 1), value) for name in names} for value in (0.1, 0.3))
    found = [
        AsymmetryReduction().differences(Compared(one, two, np.full((1, 1), 2.0), apart, VariantValues(given, {}, 1)))
        for two, apart in ((one, np.full((1, 1), 0.8)), (other, np.zeros((1, 1))))
    ]
    assert [float(found[0][name].item()) for name in names] == pytest.approx([0.0, 0.0, 0.2, 0.2])
    assert [float(found[1][name].item()) for name in names] == pytest.approx([0.2 / (0.8 * 0.5), 0.2, 0.2, 0.2])


def test_loaded_frequency_is_the_closed_form_of_a_shuttle() -> None:
    results = Results.of(scenes.run("double-peak"))
    found = theory.loaded_frequency(results, np.array([0.1, 0.5, 1.0]))
    expected = (1.0 + np.array([0.1, 0.5, 1.0]) * (1.0 + j0(2 * np.pi * 4.8 / 10.0))) ** -0.5
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_findings_of_a_double_peak_follow_the_data() -> None:
    mass = 'mass = { of = "carriage.table.mass", values = [50, 200] }'
    dataset = scenes.run("double-peak", f"{scenes.pace('double-peak', 1, 16, 16)}\n{mass}")
    text = "\n".join(answers.answer(dataset))
    counts = dataset.peaks_per_cycle.sel(sensor="midspan")
    assert (counts == 2).any() and (counts != 2).any()
    first = float(dataset.frequency_ratio.broadcast_like(counts).where(counts != 2).min())
    assert f"{first:.3g}" in text and "mass 50 kg" in text and "meets the natural frequency" in text


def test_findings_of_a_passage_tell_where_the_contact_opens() -> None:
    mass = 'mass = { of = "carriage.table.mass", values = [10, 600] }'
    dataset = scenes.run("passage", f"{scenes.pace('passage', 2, 40, 8)}\n{mass}")
    text = "\n".join(answers.answer(dataset))
    opened = (dataset.table_contact_force_min < 0).sel(mass=600)
    assert opened.any() and not opened.all()
    assert f"first at {float(dataset.pace.values[opened.values][0]):.3g} m/s" in text
    assert "while the contact holds" in text and "; up to 10 kg never" in text


def test_all_axles_that_lift_off_are_told_before_other_sensors() -> None:
    dataset = scenes.run("passage", f"{scenes.pace('passage', 2, 40, 8)}\n{MASSES}", extra=FOLLOWER)
    said = answers.answer(dataset)
    assert "would lift off" in said[1]
    counts = {name: int((dataset[f"{name}_contact_force_min"] < 0).sum()) for name in ("table", "second")}
    assert min(counts.values()) > 0
    first, other = sorted(counts, key=lambda name: -counts[name])
    assert said[1].startswith(f"{first} would lift off in {counts[first]} of 16 variants")
    assert f" So would {other} in {counts[other]}. The equations assume contact" in said[1]
    heavy = scenes.run("passage", f"{scenes.pace('passage', 20, 30, 3)}\n{MASSES}")
    assert "with a contact that opens in every variant, the largest" in answers.answer(heavy)[0]


def test_a_missed_tolerance_names_its_result() -> None:
    """The one furthest beyond, among the variants that say so."""
    dataset = scenes.run("passage", scenes.pace("passage"))
    assert missed_most(Results.of(dataset)) == ""
    dataset["status"].values[:2] = Status.TOLERANCE_MISSED
    results, error = list(dataset["result"].values), dataset["estimated_error"].values
    error[:, results.index("midspan_max")] = [np.nan, 0.03, 0.0, 0.5]
    error[:, results.index("moment_min")] = [0.02, 0.0, 0.9, 0.9]
    assert missed_most(Results.of(dataset)) == " (most of all for midspan_max: 3e-2 where 1e-3 was asked)"
    error[:, results.index("midspan")] = [np.nan, 0.05, 0.0, 0.5]
    assert missed_most(Results.of(dataset)) == " (most of all for the history of midspan: 5e-2 where 1e-3 was asked)"
    said = "2 tolerance-missed (values kept). What helps: `tolerance ="
    helps = "on the sensors midspan and moment, which holds, or a larger tolerance."
    assert answers.answer(dataset)[-3].endswith(f"{said} 0.1` {helps}")
    error[:, results.index("moment_min")] = 0.3
    helps = "on the sensors moment and midspan, so that errors are estimated and not held, or a larger tolerance."
    assert answers.answer(dataset)[-3].endswith(f'{said} "told"` {helps}')


def test_what_helps_where_a_tolerance_is_missed_names_what_misses_it() -> None:
    dataset = scenes.run("passage", scenes.pace("passage"))
    assert remedy(Results.of(dataset)) == ""
    dataset["status"].values[:2] = Status.TOLERANCE_MISSED
    results, error = list(dataset["result"].values), dataset["estimated_error"].values
    error[:, results.index("dynamic_amplification moment")] = 0.5
    assert "on the sensor moment, so that" in remedy(Results.of(dataset))
    error[...] = 0.0
    error[:, results.index("table_contact_force_min")] = 0.5
    dataset["tolerance"].values[results.index("table_contact_force_min")] = 1e-3
    assert remedy(Results.of(dataset)) == " What helps: a larger `solver.tolerance`."
    dataset.attrs["study"] = f'expected = ["tolerance-missed"]\n{dataset.attrs["study"]}'
    assert remedy(Results.of(dataset)) == ""


@pytest.mark.parametrize("part", [{"pace": 0}, {"pace": slice(0, 2)}])
def test_a_part_of_a_dataset_gives_no_answer(part: dict[str, Any]) -> None:
    dataset = scenes.run("passage", scenes.pace("passage"))
    with pytest.raises(BadInput, match="pace: this dataset holds a part of its study's results"):
        studies.answer(dataset.isel(part))
    with pytest.raises(BadInput, match="status: this dataset holds a part"):
        studies.figures(dataset.mean("pace", keep_attrs=True).drop_vars("pace", errors="ignore"))


def test_a_sway_before_the_first_mode_that_bends_has_no_theory_of_its_lag() -> None:
    """A girder on two columns, whose first mode in its plane hardly moves the girder along the loads."""
    way = {"kind": "out-and-back", "start": 0.6, "end": 3.6, "speed": 1.0, "turn": 0.06, "cycles": 2}
    car = {"on": "portal", "kind": "mass", "mass": 100.0, "motion": way}
    sensor = {"middle": {"body": "portal", "at": 2.0}}
    speeds = {"speed": {"of": "carriage.car.motion.speed", "values": [0.5, 1.0]}}
    portal = {"body": {"portal": at_rest.PORTAL | {"damping_ratio": 0.02}}, "carriage": {"car": car}}
    dataset = studies.run(engine.Study(kind="asymmetry", sensor=sensor, sweep=speeds, **portal))
    told = "\n".join(answers.answer(dataset))
    assert "middle: the response trails by" in told and "theory" not in told
    assert not theory.first_mode_bears(Results.of(dataset))
    assert theory.first_mode_bears(Results.of(scenes.run("asymmetry", scenes.pace("asymmetry"))))


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ([1.0, 1.1, 1.0, 1.1, 1.0, 1.0], [1.0] * 6, "nowhere in the sweep."),
        ([1.2] * 6, [1.3] * 6, "everywhere from 1 to 6 m/s."),
        ([1.2] * 6, [1.0] * 6, "everywhere from 1 to 6 m/s (zeta 0.01); nowhere from 1 to 6 m/s (zeta 0.05)."),
        (
            [1.0, 1.2, 1.2, 1.0, 1.0, 1.2],
            [1.0] * 5 + [1.2],
            "at 2 to 3 and 6 m/s (zeta 0.01); at 6 m/s (zeta 0.05).",
        ),
        (
            [np.nan, 1.2, 1.0, 1.2, 1.2, 1.2],
            [1.0] * 6,
            "at 2 m/s and from 4 m/s to the end of the sweep, 6 m/s (zeta 0.01); nowhere from 1 to 6 m/s (zeta 0.05).",
        ),
    ],
)
def test_a_passage_tells_at_which_speeds_statics_are_exceeded(
    first: list[float], second: list[float], words: str
) -> None:
    zeta = 'zeta = { of = "body.bed.damping_ratio", values = [0.01, 0.05] }'
    pace = 'pace = { of = "carriage.table.motion.speed", values = [1, 2, 3, 4, 5, 6] }'
    dataset = scenes.run("passage", f"{pace}\n{zeta}", extra="[question]\namplification = 1.15")
    dataset["dynamic_amplification"].loc[{"sensor": "midspan"}] = np.transpose([first, second])
    assert f"The dynamic amplification exceeds 1.15 {words}" in answers.answer(dataset)[0]


def test_between_speeds_that_lie_far_apart_nothing_is_said() -> None:
    pace = 'pace = { of = "carriage.table.motion.speed", values = [1, 2, 3, 20, 21] }'
    dataset = scenes.run("passage", pace)
    dataset["dynamic_amplification"].loc[{"sensor": "midspan"}] = 1.3
    wanted = "exceeds 1.1 at 1 to 3 m/s and from 20 m/s to the end of the sweep, 21 m/s."
    assert wanted in answers.answer(dataset)[0]


def test_a_passage_tells_where_a_limit_of_the_question_is_exceeded() -> None:
    pace = 'pace = { of = "carriage.table.motion.speed", values = [1, 2, 3, 4] }'
    dataset = scenes.run("passage", pace, extra='[question]\ndisplacement = "5 mm"')
    dataset["midspan_max"].values[:] = [1e-3, 2e-3, 6e-3, 4e-3]
    dataset["midspan_min"].values[:] = [0.0, 0.0, 0.0, -7e-3]
    wanted = "Its absolute value exceeds 5 mm from 3 m/s to the end of the sweep, 4 m/s."
    assert wanted in answers.answer(dataset)[0]


def test_where_a_value_that_is_hardly_known_exceeds_a_limit_is_said_with_its_error() -> None:
    """20 % of the true acceleration are 25 % of one that is as much too small."""
    pace = 'pace = { of = "carriage.table.motion.speed", values = [1, 2, 3, 4] }'
    sensor = '[sensor.shaken]\nbody = "bed"\nat = 5.0\nquantity = "acceleration"\n'
    dataset = scenes.run("passage", pace, extra=f'{sensor}[question]\nacceleration = "3.4 m/s2"')
    dataset["shaken_max"].values[:], dataset["shaken_min"].values[:] = [1.0, 2.0, 3.0, 4.0], -0.5
    loose = scenes.with_errors(dataset, 0.2, "shaken_max", "shaken_min")
    wanted = (
        "Its absolute value exceeds 3.4 m/s² at 4 m/s; with its estimated error perhaps from 3 m/s to the end of the "
        "sweep, 4 m/s, surely nowhere from 1 to 4 m/s."
    )
    assert any(wanted in said for said in answers.answer(loose))
    exact = answers.answer(scenes.with_errors(dataset, 1e-3, "shaken_max", "shaken_min"))
    assert any("Its absolute value exceeds 3.4 m/s² at 4 m/s." in said for said in exact)


def test_without_swept_speeds_variants_that_exceed_statics_are_told_by_what_is_swept_alone_or_counted() -> None:
    masses = 'mass = { of = "carriage.table.mass", values = [10, 600] }'
    dataset = scenes.run("passage", masses)
    dataset["dynamic_amplification"].loc[{"sensor": "midspan"}] = [1.0, 1.3]
    assert "The dynamic amplification exceeds 1.1 at 600 kg." in answers.answer(dataset)[0]
    dataset = scenes.run("passage", masses + '\nzeta = { of = "body.bed.damping_ratio", values = [0.01, 0.02] }')
    dataset["dynamic_amplification"].loc[{"sensor": "midspan"}] = [[1.0, 1.0], [1.3, 1.0]]
    assert "The dynamic amplification exceeds 1.1 in 1 variant of 4." in answers.answer(dataset)[0]
    assert "The dynamic amplification" not in said("passage")


def test_the_parts_of_which_an_asymmetry_tells_are_the_questions() -> None:
    pace = scenes.pace("asymmetry")
    usual = "\n".join(answers.answer(scenes.run("asymmetry", pace)))
    asked = "\n".join(answers.answer(scenes.run("asymmetry", pace, extra='[question]\nodd_rms = ["90 %", "0.01 %"]')))
    assert "1 %" in usual and "0.01 %" not in usual
    assert " 0.01 %" in asked and "stays below 90 %" in asked


def test_a_zipped_passage_claims_nothing_that_was_not_computed() -> None:
    mass = 'mass = { of = "carriage.table.mass", values = [10, 600, 600] }'
    pace = 'pace = { of = "carriage.table.motion.speed", values = [1, 20, 40] }'
    dataset = scenes.run("passage", f"zip = true\n{pace}\n{mass}")
    opened = dataset.table_contact_force_min.values < 0
    text = "\n".join(answers.answer(dataset))
    assert opened.any() and "not up to" not in text and "first at" not in text
    assert f"would lift off in {opened.sum()} of 3 variants; worst is" in text


@pytest.mark.parametrize("kind", KINDS)
def test_a_value_that_is_known_loosely_says_so_in_its_own_sentence(kind: str) -> None:
    """Every kind that names an extreme, of all variants and of one."""
    for sweep in (scenes.pace(kind), "") if scenes.PACE[kind] else ("",):
        dataset = scenes.run(kind, sweep)
        assert "estimated to within" not in "\n".join(answers.answer(dataset))
        assert "(estimated to within " in "\n".join(answers.answer(scenes.with_errors(dataset, 0.4)))


@pytest.mark.parametrize("kind", ["double-peak", "passage"])
def test_how_loosely_it_is_known_is_a_part_of_the_value_that_is_named(kind: str) -> None:
    """An archive has errors over static values: of 116 times these a ninth of one was told as "9 %"."""
    dataset = scenes.run(kind, scenes.pace(kind))
    text = "\n".join(answers.answer(scenes.with_errors(dataset, 0.4)))
    gain = np.nanmax(dataset.dynamic_amplification.sel(sensor="midspan").values)
    assert f"(estimated to within {percent(0.4 / gain)}" in text
    grown = dataset.copy(deep=True)
    for name in ("dynamic_amplification", "midspan_max", "midspan_min"):
        grown[name].values *= 100.0
    assert f"{percent(0.4 / gain)}" not in "\n".join(answers.answer(scenes.with_errors(grown, 0.4)))


def test_what_a_tolerance_of_its_sensor_would_hold_is_told_with_it() -> None:
    dataset = scenes.run("passage", scenes.pace("passage"))
    of_moment, of_force = "moment_max", "table_contact_force_min"
    midspan, moment, contact, *_ = answers.answer(scenes.with_errors(dataset, 0.4, of_moment, of_force))
    assert "estimated" not in midspan
    part = percent(0.4 / np.nanmax(dataset.dynamic_amplification.sel(sensor="moment").values))
    assert f"N m (estimated to within {part}; a tolerance of its own on sensor moment asks for more) with" in moment
    assert "N ± 390 N at" in contact  # two fifths of the weight
    doubtful = answers.answer(scenes.with_errors(dataset, 2.0, of_force))[2]
    assert doubtful.startswith("Whether table keeps its contact is not certain: the smallest contact force is ")
    held = scenes.with_errors(dataset, 0.4, of_moment)
    held["tolerance"].values[...] = 0.1
    assert f"N m (estimated to within {part}) with" in answers.answer(held)[1]


def test_errors_of_contact_forces_are_parts_of_the_whole_weight() -> None:
    """Of a sprung mass with that of its wheel, all of which presses."""
    wheel = oscillator(1.0, 300.0, cruise(0.0, 1.0, 0.2), wheel_mass=4.0)
    dataset = studies.run(study(beam(), wheel, solver={"tolerance": 1e-2}))
    force = float(dataset["car_contact_force_min"])
    assert 0.0 < force < 0.98 * 5.0 * 9.81
    error = 0.999
    told = "\n".join(answers.answer(scenes.with_errors(dataset, error, "car_contact_force_min")))
    assert f"with an estimated error of {quantity(error * 5.0 * 9.81, 'N')}" in told


def test_an_envelope_that_is_known_loosely_says_so() -> None:
    envelope = '[envelope.along]\nbody = "bed"\nplaces = 5'
    dataset = scenes.run("passage", scenes.pace("passage"), extra=envelope)
    text = "\n".join(answers.answer(scenes.with_errors(dataset, 0.4, "along_envelope_max")))
    assert "mm (estimated to within 40 %), at 5 m of its track" in text


def test_findings_of_a_trajectory() -> None:
    assert "Histories of 1 variant out of 1, each over 3 s on 401 stations" in said("trajectory")


@pytest.mark.fault(18)
@pytest.mark.parametrize("kind", KINDS)
def test_failed_variants_are_left_out_and_counted(kind: str) -> None:
    sweep = scenes.pace(kind) if scenes.PACE[kind] else 'mass = { of = "carriage.table.mass", values = [1, 2, 3, 4] }'
    dataset = scenes.with_failures(scenes.run(kind, sweep), 2)
    text = "\n".join(answers.answer(dataset))
    assert "2 diverged (left out)" in text and "nan" not in text.lower().replace("dominan", "")
    everything = "\n".join(answers.answer(scenes.with_failures(dataset, 1)))
    assert "4 diverged (left out)" in everything and "nan" not in everything.lower()


@pytest.mark.parametrize(("middle", "told"), [(1.0, True), (0.5, False)])
def test_lift_off_is_told_over_the_critical_speed_on_one_span_alone(middle: float, told: bool) -> None:
    """A spring too soft to matter makes two spans of one."""
    ends = ", ".join(f"{{ at = {at}, stiffness = 1e8 }}" for at in (0.0, 1.0))
    text = SEPARATED.replace('"pinned-pinned"', f"[{ends}, {{ at = {middle}, stiffness = 1.0 }}]")
    (said,) = [one for one in studies.answer(studies.run(engine.load(text))) if "would lift off" in one]
    assert "first at 10 m/s" in said
    assert ("of the critical speed" in said) is told


def test_a_swept_place_is_told_as_one() -> None:
    """A sweep that is called `at` after its key read "largest at at 2 m"."""
    sweep = 'at = { of = "sensor.midspan.at", values = [4.0, 5.0] }'
    text = "\n".join(answers.answer(scenes.run("passage", sweep)))
    assert "at place 5 m" in text and "at at" not in text
