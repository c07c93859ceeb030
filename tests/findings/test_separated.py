"""Variants whose contact opens count in no sentence or title beside one that leaves them out, or it is said."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import engine
import studies
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.commands.screens import _about_statuses
from studies.findings.contacts import told_contacts
from studies.kinds.double_peak import KIND as DOUBLE_PEAK
from studies.moving.findings import others, sliding
from studies.reporting import answers
from studies.results.results import Results
from tests.batch.test_plausibility import on_wheels
from tests.engine.build import fixed
from tests.floating.scenes import sliding_mass
from tests.kinds.test_residual import stops
from tests.studies import scenes

OPENED = 2  # of four variants
WHEEL = {"kind": "cruise", "end": 13.0, "speed": 1.0}  # of a coach, if it starts 1.5 m ahead of it


def opened(kind: str, **values: float) -> xr.Dataset:
    """A study at four paces, of which the third opens and reaches these values, which are 1 in the others."""
    dataset = scenes.run(kind, scenes.pace(kind))
    dataset["status"].values[:] = np.where(np.arange(4) == OPENED, Status.SEPARATED, Status.OK)
    for name, value in values.items():
        dataset[name].values[:] = 1.0
        dataset[name].values[OPENED] = value
    return dataset


def test_other_sensors_of_a_passage_are_compared_while_the_contact_holds() -> None:
    """As the first one is."""
    assert "Of the other sensors" not in "\n".join(answers.answer(opened("passage", dynamic_amplification=9.0)))
    dataset = opened("passage", dynamic_amplification=9.0)
    dataset["dynamic_amplification"].values[0] = 2.0
    assert "a dynamic amplification of 1.1." in "\n".join(answers.answer(dataset))
    assert "(up to 2) exceeds" in "\n".join(answers.answer(dataset))


def test_what_swings_on_after_a_stop_is_told_while_the_contact_holds() -> None:
    """Also how long all take to settle where motions end at different times."""
    sensor = {"midspan": fixed(0.5) | {"settling_band": 0.02}}
    dataset = studies.run(stops(sensor=sensor, output={"residual": True}))
    dataset["status"].values[np.argmax(dataset["midspan_residual"].values)] = Status.SEPARATED
    said = answers.answer(dataset)
    assert any(text.startswith("midspan: while the contact holds, after the stop it still swings") for text in said)
    assert any(text.startswith("While the contact holds, until midspan has settled, ") for text in said)


def test_a_limit_that_is_exceeded_where_the_contact_opens_alone_is_told() -> None:
    """And the first sentence says of which variants it is."""
    dataset = scenes.run("passage", scenes.pace("passage"), extra="[question]\ndisplacement = 0.5")
    dataset["status"].values[OPENED] = Status.SEPARATED
    dataset["midspan_max"].values[:] = [0.1, 0.1, 0.9, 0.1]
    (said,) = (text for text in answers.answer(dataset) if text.startswith("midspan: "))
    assert said.startswith("midspan: while the contact holds, the largest displacement at 5 m of bed is 100 mm")
    held = "from 1 to 3.33 m/s and at 8 m/s, where it is known"
    assert f"exceeds 500 mm nowhere {held}; it does in 1 of 1 variant whose contact opens." in said


HEAVY = 'mass = { of = "carriage.table.mass", values = [1, 20] }'


def test_where_a_contact_force_falls_below_a_part_of_the_weight() -> None:
    """Of the carriage that presses least, wherever the contact opens, too; of a light one nowhere."""
    fast = f"{scenes.pace('passage', 1.0, 12.0)}\n{HEAVY}"
    dataset = scenes.run("passage", fast, extra="[question]\nleast_contact = 0.9")
    speeds, weights = np.linspace(1.0, 12.0, 4), 9.81 * np.array([1.0, 20.0])
    parts = np.array([[0.99, 0.99], [0.95, 0.899], [0.99, 0.5], [0.99, -0.2]])
    dataset["table_contact_force_min"].values[:] = parts * weights
    dataset["status"].values[-1, -1] = Status.SEPARATED
    (said,) = (text for text in answers.answer(dataset) if text.startswith("The contact force of table"))
    where = f"from {speeds[1]:.3g} m/s to the end of the sweep, 12 m/s (mass 20 kg)"
    assert f"falls below 0.9 of its weight {where}; nowhere from 1 to 12 m/s (mass 1 kg); " in said
    assert said.endswith("; at its smallest it is -0.2 of it at pace 12 m/s, mass 20 kg.")
    assert not any("of its weight" in text for text in answers.answer(scenes.run("passage", fast)))


COACH = """
[body.coach]
kind = "rigid"
length = 4.0
mass = 300.0
inertia = 400.0

[carriage.coach]
on = "bed"
kind = "body"
body = "coach"
contacts.front = { at = 3.5, stiffness = 1e5, damping = 1e3 }
contacts.rear = { at = 0.5, stiffness = 1e5, damping = 1e3 }
motion = { kind = "cruise", start = -1.5, end = 11.5, speed = 1.0 }
"""

BEHIND = COACH.replace("coach", "behind").replace("-1.5", "-7.5").replace("11.5", "5.5")


def test_what_presses_a_wheel_down_besides_itself_is_told_and_each_contact_has_its_share() -> None:
    """Wheels of a coach "would lift off" without a word of it; at rest neither contact bore half of its weight."""
    text = scenes.text_of("passage", scenes.pace("passage"), extra=f"{COACH}{BEHIND}\n[question]\nleast_contact = 0.5")
    for start, told in ((0.0, True), (0.1, False)):
        study = engine.load(text).with_values({"carriage.table.motion": WHEEL | {"start": start}})
        found = studies.run(study.without_sweep())
        found["table_contact_force_min"].values[...], found["behind_contact_force_min"].values[...] = -1.0, 1e6
        found["coach_contact_force_min"].values[...] = 0.8 * 0.5 * 300.0 * study.gravity
        ((said,), _) = told_contacts(Results.of(found))
        assert said.startswith("table would lift off") and ("as its wheels do (table)" in said) == told
        for name in ("coach", "behind"):  # which keep pace, and are no wheels
            found[f"{name}_contact_force_min"].values[...] = -1.0
        ((both,), _) = told_contacts(Results.of(found))
        assert ("as its wheels do (table)" in both) == told and both.count("coach") == 1
        found["coach_contact_force_min"].values[...] = 0.8 * 0.5 * 300.0 * study.gravity
    found["behind_contact_force_min"].values[...] = 1e6
    found["table_contact_force_min"].values[...] = 1e6
    (low,) = (one for one in answers.answer(found) if one.startswith("The contact force of coach"))
    assert "below 0.5 of an equal share of its weight nowhere" in low and "at its smallest it is 0.8 of it" in low


def test_a_least_contact_where_nothing_presses_by_its_weight_is_refused() -> None:
    with pytest.raises(BadInput, match=r"question\.least_contact: a limit of contact forces.*and gravity"):
        studies.run(scenes.study("passage", "", extra="[question]\nleast_contact = 0.5").with_values({"gravity": 0.0}))


def test_smallest_contact_forces_beside_a_sensor_that_reads_them_say_where_they_are_of() -> None:
    read = '[sensor.wheel]\ncarriage = "table"\nquantity = "contact_force"\n'
    for extra, aside in (("", False), (read, True)):
        said = " ".join(answers.answer(scenes.run("passage", HEAVY, extra=extra)))
        assert "table keeps its contact everywhere" in said
        assert ("everywhere, the last 2 % before a held end aside;" in said) == aside


def test_a_map_of_amplifications_says_of_which_cells_its_title_is() -> None:
    mass = 'mass = { of = "carriage.table.mass", from = 100, to = 800, count = 7 }'
    dataset = scenes.run("passage", f"{scenes.pace('passage', 1.0, 12.0)}\n{mass}")
    dataset["table_separation_position"].values[:] = np.nan
    dataset["dynamic_amplification"].values[:] = 1.0 + np.linspace(0.0, 1.0, 28).reshape(4, 7)[..., None]
    for lost, title in ((False, "is 2 at most"), (True, "is 1.5 at most")):
        dataset["status"].values[2:] = Status.SEPARATED if lost else Status.OK
        dataset["dynamic_amplification"].values[1, -1] = 1.5
        (figure,) = (one for one in answers.figures(dataset) if one.name == "amplification-map")
        assert figure.title.endswith(title) and ("the map goes on beyond" in figure.caption) == lost


def test_values_have_a_map_of_their_own_where_another_variant_is_amplified_most() -> None:
    """So that nobody takes what is amplified most, from little, for what is largest."""
    mass = 'mass = { of = "carriage.table.mass", from = 100, to = 800, count = 7 }'
    speed = 'speed = { of = "carriage.table.motion.speed", from = 1, to = 12, count = 7 }'
    dataset = scenes.run("passage", f"{speed}\n{mass}")
    size = np.maximum(np.abs(dataset["midspan_max"]), np.abs(dataset["midspan_min"])).values
    for grows in (1.0, -1.0):
        dataset["dynamic_amplification"].values[:] = 2.0 + grows * (size / size.max())[..., None]
        names = [figure.name for figure in answers.figures(dataset)]
        assert "amplification-map" in names and ("largest-displacement-map" in names) == (grows < 0.0)


def test_double_peaks_count_while_the_contact_holds() -> None:
    """In sentences, titles, and in what is audited."""
    dataset = opened("double-peak", dynamic_amplification=9.0, odd_even_ratio=5.0)
    text = "\n".join(answers.answer(dataset))
    assert "midspan: while the contact holds, at most as large as the static value" in text
    assert "midspan: while the contact holds, the two halves of a cycle differ; odd harmonics reach 1 times" in text
    assert (OPENED,) not in DOUBLE_PEAK.named(Results.of(dataset))
    figures = {figure.name: figure for figure in answers.figures(dataset)}
    for name, title in (("amplification", "is up to 1 times the static one"), ("odd-even", "are up to 1 times the")):
        assert title in figures[name].title and "While the contact holds the title counts" in figures[name].caption
    dataset["status"].values[:] = Status.OK
    text = "\n".join(answers.answer(dataset))
    assert "midspan: at most 9 times the static value" in text and "contact holds" not in text


def slid(**values: list[float]) -> Results:
    """A mass that slides, in two variants, of which the second opens."""
    swept = {"mass": {"of": "carriage.load.mass", "values": [50.0, 100.0]}}
    sensor = {"midspan": {"body": "beam", "at": 7.5}}
    tables = {"sensor": sensor, "sweep": swept, "question": {"duration": 0.5, "displacement": 0.5}}
    data = sliding_mass().data | {"kind": "moving-frames"} | tables
    dataset = studies.run(Study(**{key: value for key, value in data.items() if key != "schema_version"}))
    dataset["status"].values[:] = [Status.OK, Status.SEPARATED]
    for name, own in values.items():
        dataset[name].values[:] = own
    return Results.of(dataset)


def test_bodies_in_moving_frames_count_while_the_contact_holds() -> None:
    """Their readings, limits and contact forces; nothing is said of it where every contact holds."""
    results = slid(
        midspan_max=[0.1, 0.9],
        midspan_min=[0.0, 0.0],
        load_contact_force_max=[500.0, 9e3],
        load_contact_force_min=[400.0, -9e3],
    )
    way, force = sliding(results)
    assert way.startswith("load slides from ") and "over all variants" in way
    assert force == "While the contact holds, its contact force goes from 400 N to 500 N, the largest at mass 50 kg."
    (reading,) = (text for text in others(results, 0.5) if text.startswith("midspan"))
    assert reading.startswith(
        "midspan: while the contact holds, the displacement goes from 0 m to 100 mm at mass 50 kg."
    )
    assert "nowhere at 50 kg, where it is known; it does in 1 of 1 variant whose contact opens." in reading
    results.dataset["status"].values[:] = Status.OK
    held = Results.of(results.dataset)
    assert "contact holds" not in "\n".join([*sliding(held), *others(held, 0.5)])
    assert list(sliding(held))[1].startswith("Its contact force goes from -9 kN to 9 kN")


@pytest.mark.parametrize(("place", "seems"), [(0.0, True), (0.2, False)])
def test_wheels_that_stay_level_may_only_seem_to_lift_off(place: float, seems: bool) -> None:
    """Wheels one behind the other at one place of a track that lies across were told to lift off at rest."""
    given = on_wheels(at=place)
    dataset = studies.run(given.with_values({"sensor": {"middle": fixed(0.5)}}))
    dataset["car_contact_force_min"].values[...] = -1.0
    (lifted,), _ = told_contacts(Results.of(dataset))
    assert lifted.startswith("car would lift off in 1 of 1 variant") and ("car may only seem to" in lifted) is seems


@pytest.mark.parametrize("reason", ["lift off", "over an end of its track"])
def test_the_status_says_both_reasons_that_it_has(reason: str) -> None:
    assert reason in Status.SEPARATED.message


def test_a_status_that_comes_first_hides_no_contact_that_opens() -> None:
    """ "5 separated" stood beside "would lift off in 7", as a missed tolerance is told first."""
    mass = 'mass = { of = "carriage.table.mass", values = [10, 600, 600] }'
    pace = 'pace = { of = "carriage.table.motion.speed", values = [1, 20, 25] }'
    dataset = scenes.run("passage", f"zip = true\n{pace}\n{mass}")
    opened = np.flatnonzero(dataset.status.values == Status.SEPARATED)
    assert opened.size == 2 and "whose status" not in " ".join(_about_statuses(Results.of(dataset)))
    dataset.status.values[opened[0]] = Status.TOLERANCE_MISSED
    said = list(_about_statuses(Results.of(dataset)))
    assert any("So it is in 1 variant more, whose status tells something else first." in text for text in said)
