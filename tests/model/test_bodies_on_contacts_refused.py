"""Bodies that ride on contacts: what is refused."""

from typing import Any

import numpy as np
import pytest

from engine.batch.plan import make_plan
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.engine.bodies_on_contacts import RIGID, TWO, riding
from tests.engine.build import beam, cruise, shuttle, study, swing


def change(case: Study, path: str, value: Any) -> Study:
    return case.with_values({path: value})


WHOLE = riding(shuttle(0.3, 0.7, 0.8, 0.1, 2))


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("carriage.car.body", "bed", r"carriage\.car\.body: a body cannot ride on itself"),
        ("carriage.car.body", "tabel", r"carriage\.car\.body: no such body"),
        ("carriage.car.contacts.front.at", 0.5, r"contacts\.front\.at: a place off the track of the body that rides"),
        ("carriage.car.contacts.front.at", 0.1, r"carriage\.car\.contacts: this body would tip over"),
        ("carriage.car.contacts", {}, r"carriage\.car\.contacts"),
        ("carriage.car.contacts.rear", {"at": 0.35, "stiffness": 1.0}, r"this body would tip over"),
        ("carriage.car.contacts.front.stiffness", 0.0, r"contacts\.front\.stiffness"),
        ("carriage.car.contacts.front.stiffness", "stiff", r"contacts\.front\.stiffness"),
        ("carriage.car.contacts.front.stiffness", "rigid", r"a rigid contact has no damper"),
        ("carriage.car.contacts.front.point", "toe", r"exactly one place"),
        ("carriage.car.contacts.front", {"point": "toe", "offset": 0.1, "stiffness": 1.0}, r"no such point"),
        ("carriage.car.contacts.front", {"point": "toe", "stiffness": 1.0}, r"a point needs an offset"),
        ("carriage.car.motion.end", 0.9, r"contacts\.front: this contact leaves the body"),
        ("carriage.car.reference", 0.6, r"carriage\.car\.reference: a place off the track"),
        ("solver.fidelity", "mass", r"solver\.fidelity: .*has no meaning"),
        ("body.table.own_weight", True, r"nothing holds this body fully"),
        ("body.table", beam(length=0.4, modes=4), r"something holds this body"),
        ("body.table.centre", 0.41, r"body\.table\.centre"),
        ("sensor.rear.contact", "raer", r"sensor\.rear\.contact: no such contact"),
        ("sensor.rear.quantity", "displacement", r"sensor\.rear: only contact forces"),
        ("sensor.total.quantity", "velocity", r"has no sprung mass"),
    ],
)
def test_refused(path: str, value: Any, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        make_plan(change(WHOLE, path, value))


def test_rigid_contacts_meet_no_shocks() -> None:
    rigid = {name: {"at": contact["at"], "stiffness": "rigid"} for name, contact in TWO.items()}
    for motion in (cruise(-0.4, 1.4, 0.8), shuttle(0.3, 0.7, 0.8, 0.0, 1), cruise(0.3, 0.7, 0.8, after=1.0)):
        with pytest.raises(BadInput, match="a rigid contact would meet a shock"):
            make_plan(riding(motion, rigid))
    whole = swing(0.5, 0.2, 0.7, 2)  # sets off and stops at once, as a scene of its own begins and ends
    make_plan(riding(whole, rigid))
    car = {"on": "bed", "kind": "body", "body": "table", "contacts": rigid}
    push = {"on": "bed", "kind": "force", "force": 1.0, "motion": cruise(0.0, 1.0, 0.1)}
    late = {"motion": cruise(0.3, 0.7, 0.8), "delay": 0.1}  # it is not there before
    for cars in ({"car": car | {"motion": whole}, "push": push}, {"car": car | late}):
        with pytest.raises(BadInput, match="a rigid contact would meet a shock"):
            make_plan(study(beam(), cars, body={"bed": beam(), "table": RIGID}))


@pytest.mark.parametrize(
    ("bed", "places", "most"), [(5, np.linspace(0.05, 0.35, 8), 7), (5, [0.2, 0.2], 1), (1, [0.0, 0.1, 0.2, 0.4], 3)]
)
def test_rigid_contacts_that_the_modes_cannot_meet_are_refused(bed: int, places: Any, most: int) -> None:
    """A rigid body moves in two ways, and the bed in as many as it has modes."""
    rigid = {f"c{number}": {"at": float(at), "stiffness": "rigid"} for number, at in enumerate(places)}
    with pytest.raises(BadInput, match=rf"carriage\.car\.contacts: .*at most {most} of them rigid"):
        make_plan(riding(shuttle(0.3, 0.7, 0.8, 0.1, 1), rigid, bed=beam(modes=bed)))
