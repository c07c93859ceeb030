"""What must hold between the tables of a study file: names, and what they refer to."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

from engine.scene.carriages import Carriage
from engine.scene.frames import GROUND
from engine.scene.robots import check_robots
from engine.scene.sensors import Sensor, quantities_of_a_body
from engine.scene.trains import axle_name
from engine.study_file.spec import nearest
from results_schema.errors import BadInput, shortened
from results_schema.quantities import QUANTITIES
from results_schema.variables import RESERVED

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import Direction, Side
    from engine.scene.study import Study

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")

NO_RESULTS = ("body", "load", "spring", "arm", "robot")  # tables whose names stand in no result
NAMED = (*NO_RESULTS, "train", "carriage", "sensor", "envelope", "sweep")


def check_names(study: Study) -> None:
    """Names that can stand in an archive, and results that do not collide. Raises BadInput."""
    for table in NAMED:
        for name in getattr(study, table) if table != "sweep" else study.sweep.axes:
            where = study.source.where(f"{table}.{name}")
            if not NAME.fullmatch(name):
                raise BadInput("not a usable name", where=where, expected="letters, digits and _, a letter first")
            if table not in NO_RESULTS and name in RESERVED:
                raise BadInput("this name is reserved for results", where=where, remedy="choose another name")
    study.results("march")


def check_references(study: Study) -> None:
    """Every name that is mentioned exists, and sensors suit their bodies. Raises BadInput."""
    for name, frame in study.frame.items():
        _must_exist(study, f"frame.{name}", name, "body")
        if frame.on != GROUND:
            _must_exist(study, f"frame.{name}.on", frame.on, "body")
    for name, load in study.load.items():
        _must_exist(study, f"load.{name}.on", load.on, "body")
    for name, spring in study.spring.items():
        for number, end in enumerate(spring.ends):
            if end.on != GROUND:
                _must_exist(study, f"spring.{name}.ends.{number}.on", end.on, "body")
    for key, what, expected in check_robots(study.arm, study.robot, study.body):
        raise study.source.fault(key, what, expected=expected)
    for name, carriage in study.carriage.items():
        _check_carriage(study, name, carriage)
    for name, sensor in study.sensor.items():
        _check_sensor(study, name, sensor)
    for name, envelope in study.envelope.items():
        _must_exist(study, f"envelope.{name}.body", envelope.body, "body")
        _check_quantity(study, f"envelope.{name}", envelope.body, envelope.quantity)


def _check_carriage(study: Study, name: str, carriage: Carriage) -> None:
    _must_exist(study, f"carriage.{name}.on", carriage.on, "body")
    for word, contact in carriage.riding_contacts.items():
        _must_exist(study, f"carriage.{name}.contacts.{word}.on", contact.on or carriage.on, "body")
    if carriage.riding_body is not None:
        _check_rider(study, name, carriage.riding_body)
    for direction in carriage.pushes:
        with _within(study, f"carriage.{name}"):
            check_inertia(study, carriage, direction)
    if carriage.pulsates:
        _check_pulsation(study, f"carriage.{name}.pulsation", carriage)


def _check_pulsation(study: Study, here: str, carriage: Carriage) -> None:
    """A pulsating force belongs to a march that is no cycle."""
    if study.frame:
        what = "no force pulsates on bodies in frames that move"
        remedy = "a load with a course that changes in time"
        raise study.source.fault(here, what, expected="no such key", remedy=remedy)
    if carriage.motion.period is not None:
        what = "a force that pulsates does not come round with the cycles of its carriage"
        raise study.source.fault(here, what, expected="a motion from one place to another, or no such key")
    if study.solver.fidelity == "static":
        what = "a force that pulsates is not static"
        raise study.source.fault("solver.fidelity", what, expected='"auto"', remedy=f"leave out {here}")


def _check_sensor(study: Study, name: str, sensor: Sensor) -> None:
    here = f"sensor.{name}"
    if sensor.rides is not None:
        _must_exist(study, f"{here}.{'carriage' if sensor.under is None else 'under'}", sensor.rides, "carriage")
    if sensor.carriage is not None:
        _check_of_carriage(study, here, sensor)
    if sensor.body is not None:
        _must_exist(study, f"{here}.body", sensor.body, "body")
    body = study.body_of(name)
    if sensor.body not in (None, body):
        received = f'"{sensor.body}"'
        what = "the carriage rides on another body"
        raise study.source.fault(f"{here}.body", what, expected=f'"{body}"', received=received)
    _check_quantity(study, here, body, sensor.quantity)
    if sensor.settling_band is not None and not (study.output.residual or sensor.reads.of_arm):
        if study.frame:
            what, expected = "in frames that move a position error alone settles", 'quantity = "position_error"'
            raise study.source.fault(f"{here}.settling_band", what, expected=expected)
        what, expected = "how long a sensor takes to settle is told of residual vibrations", "[output] residual = true"
        raise study.source.fault(f"{here}.settling_band", what, expected=f"{expected} beside it, or no settling_band")
    if sensor.spot is not None:
        with _within(study, here):
            study.body[body].check_spot(sensor.spot)
    if sensor.side is not None and not study.frame:
        _check_side(study, f"{here}.direction", body, sensor.side)


def _check_side(study: Study, here: str, body: str, side: Side) -> None:
    """A track moves in a direction beside that of its loads."""
    rides = any(carriage.riding_body == body for carriage in study.carriage.values())
    if rides or not study.body[body].moves(side):
        why = "rides too, and is not read" if rides else "does not move"
        what = f"body {body} {why} {side} its own track"
        expected = "a frame, or a body out of finite-element files" + " in space" * (side == "across")
        raise study.source.fault(here, what, expected=expected, remedy="no direction: along gravity")


def _check_quantity(study: Study, here: str, name: str, quantity: str) -> None:
    """A body has the quantity that is read of it, and the keys that this needs."""
    body = study.body[name]
    if quantity in body.untold:
        told = [one for one in quantities_of_a_body() if body.tells_supports or not QUANTITIES[one].of_support]
        expected = f"one of {', '.join(one for one in told if one not in body.untold)}"
        raise study.source.fault(f"{here}.quantity", f"{quantity} is not available on body {name}", expected=expected)
    if QUANTITIES[quantity].needs_fibre and (missing := body.lacks_for_stress):
        what = f"a {quantity} sensor needs this key"
        raise study.source.fault(f"body.{name}.{missing}", what, expected="a length (m), > 0")


@contextmanager
def _within(study: Study, here: str) -> Iterator[None]:
    """Refusals of bodies name a key of the table `here`."""
    try:
        yield
    except BadInput as error:
        raise error.moved(study.source.where(f"{here}.{error.where}")) from None


def check_inertia(study: Study, carriage: Carriage, direction: Direction) -> None:
    """The inertia of a carriage can act along or across its track. Raises BadInput, with the key within that."""
    if any(other.riding_body == carriage.on for other in study.carriage.values()):
        what = f"the body below rides too: its own motion holds it {direction}"
        where = f"inertia_{direction}"
        raise BadInput(what, where=where, expected="a body that does not ride", remedy=f"{where} = false")
    study.body[carriage.on].check_inertia(direction)


def _check_of_carriage(study: Study, here: str, sensor: Sensor) -> None:
    """A carriage has what a sensor of its own reads."""
    name = str(sensor.carriage)
    carriage = study.carriage[name]
    if sensor.reads.of_contact and not sensor.reads.of_suspension:
        contacts = carriage.riding_contacts
        if sensor.contact is not None and sensor.contact not in contacts:
            where, expected = study.source.where(f"{here}.contact"), f"one of {', '.join(contacts)}"
            missing = "none: leave this key out" if not contacts else expected
            raise BadInput("no such contact", where=where, expected=missing, received=shortened(sensor.contact))
    elif carriage.suspension is None:
        remedy = 'quantity = "contact_force"' if sensor.reads.of_suspension else carriage.instead_of_own_motion(name)
        what = "this carriage has no sprung mass"
        raise study.source.fault(f"{here}.carriage", what, expected="an oscillator", remedy=remedy)


def _check_rider(study: Study, name: str, body: str) -> None:
    """A body that rides is another one, and rides once."""
    here = f"carriage.{name}.body"
    _must_exist(study, here, body, "body")
    riding = [(c.riding_body, c.ridden) for c in study.carriage.values()]
    below, on = set[str](), dict(riding)
    reached = set(on[body])
    while reached - below:
        below |= reached
        reached = {name for rider in below for name in on.get(rider, ())}
    alone = [rider for rider, _ in riding].count(body) == 1
    if body in below or not alone:
        what = "a body cannot ride on itself" if alone else "this body rides twice"
        raise study.source.fault(here, what, received=shortened(body), remedy="another body")


def _must_exist(study: Study, key: str, name: str, table: Literal["body", "carriage"]) -> None:
    names: list[str] = list(getattr(study, table))
    if name not in names:
        expected = f"one of {', '.join(names)}" if names else f"a table such as [{table}.name]; there is none"
        received, remedy = shortened(name), nearest(name, names)
        near = next((other for other in names if remedy == f'did you mean "{other}"?'), None)
        if near is not None and not _mentions(study.data, near):  # nothing speaks for that spelling
            remedy = f'did you mean "{near}", or should [{table}.{near}] be [{table}.{name}]?'
        if table == "carriage" and name in study.train:
            remedy = f'one of its axles: "{axle_name(name, 0)}" is in front'
        raise study.source.fault(key, f"no such {table}", expected=expected, received=received, remedy=remedy)


def _mentions(data: Any, name: str) -> bool:
    """Whether a name is a value anywhere in plain data, as it is where something refers to it."""
    if isinstance(data, dict | list):
        return any(_mentions(item, name) for item in (data.values() if isinstance(data, dict) else data))
    return bool(data == name)
