"""Carriages whose guides hold them from both sides: nothing lifts off, and nothing else is another number."""

import re

import numpy as np
import pytest
import xarray as xr

import engine
import studies
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.findings.contacts import told_contacts
from studies.pictures.passage import pictures
from studies.results.formatting import quantity
from studies.results.results import Results
from tests.engine.bodies_on_contacts import riding
from tests.engine.build import beam, cruise, mass, oscillator, shuttle, study
from tests.kinds.test_moving_frames import paper
from tests.studies import at_rest as small
from tests.studies import scenes

FAST = cruise(0.0, 1.0, 6.0)
LIFTING = {
    "a mass": (study(beam(), mass(0.5, FAST)), "car"),
    "a sprung mass": (study(beam(), oscillator(0.1, 100.0, FAST, wheel_mass=0.5)), "car"),
    "a mass on a spring alone": (study(beam(), oscillator(0.6, 4000.0, FAST)), "car"),
    "a body on contacts": (riding(shuttle(0.3, 0.7, 2.2, 0.05, 1)), "car"),
    "a mass in a moving frame": (paper().with_values({"carriage.load.motion.start": 4.0}), "load"),
}


def guided(given: Study, carriage: str) -> Study:
    return given.with_values({f"carriage.{carriage}.bilateral": True})


@pytest.mark.parametrize("name", LIFTING)
def test_what_a_guide_holds_does_not_lift_off(name: str) -> None:
    given, carriage = LIFTING[name]
    rests, held = studies.run(given), studies.run(guided(given, carriage))
    assert (rests.status == Status.SEPARATED).any() and not (held.status == Status.SEPARATED).any()
    for result in rests.data_vars:
        if str(result).endswith("_separation_position"):
            assert np.isfinite(rests[result]).any() and np.isnan(held[result]).all()
        elif result != "status":
            xr.testing.assert_equal(rests[result], held[result])


def test_it_goes_over_the_end_of_its_track_all_the_same() -> None:
    given = paper(3.0, output={"histories": "none"}).with_values({"carriage.load.motion.speed": 6.0})
    assert (studies.run(guided(given, "load"))["status"] == Status.SEPARATED).all()


def test_at_rest_too() -> None:
    text = small.text_of("influence", carriage=small.TABLE).replace('"pinned-pinned"', '"clamped-free"')
    given = engine.load(text.replace("second_moment = 8e-6", "second_moment = 8e-7"))
    assert int(studies.run(given).status) == Status.SEPARATED
    assert int(studies.run(guided(given, "car")).status) == Status.OK


def test_how_far_it_pulls_is_told() -> None:
    """In place of where the carriage would lift off, in the answer and in the figure; with an error that matters."""
    given = scenes.study("passage", scenes.pace("passage", 2, 40, 8)).with_values({"carriage.table.mass": 400.0})
    found = studies.run(guided(given, "table"))
    results = Results.of(found)
    least = float(found.table_contact_force_min.min())
    lifted, (said,) = told_contacts(results)
    assert least < 0.0 and not lifted
    assert said.startswith(f"The guide of table holds it down with up to {quantity(-least, 'N')}")
    weight = 400.0 * 9.80665
    (_, (loose,)) = told_contacts(Results.of(scenes.with_errors(found, 0.4, "table_contact_force_min")))
    (told,) = re.findall(r"± ([\d.]+) kN", loose)
    assert 1e3 * float(told) == pytest.approx(0.4 * weight, rel=0.05)
    (figure,) = (one for one in pictures(results) if one.name == "contact-table")
    assert figure.title.startswith("table is held down by its guide, first at pace ")
    assert "Below zero the guide of the carriage pulls" in figure.caption
    found.table_contact_force_min.values[:] = 5.0
    assert (
        "The guide of table pulls nowhere: the smallest contact force is 5 N" in told_contacts(Results.of(found))[1][0]
    )


@pytest.mark.parametrize("key", ["preloaded", "guided", "unilateral"])
def test_other_words_for_it_are_known(key: str) -> None:
    with pytest.raises(BadInput, match="bilateral = true"):
        study(beam(), mass(0.5, FAST) | {key: True})
