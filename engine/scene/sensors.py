"""What is read, and where."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from engine.bodies.modal.description import Spot
from engine.bodies.modal.modal_body import Side
from engine.bodies.modal.places import Vector
from engine.study_file.spec import LIST, NUMBER, WORD, Spec, by_form, form_of_amount, one_of
from engine.study_file.units import Dimensionless, Frequency, Length, fault
from results_schema.quantities import MEANT, QUANTITIES, Quantity

AXES = ("x", "y", "z")
SIDES: tuple[Side, ...] = ("along", "across")  # of a track, in which what rides is read
MOST_PLACES = 201
PLACES = 6  # ways to say where a sensor stands
EXPECTED = 'at = metres, node, member or point = "its name", under = "a carriage", or carriage = "a carriage"'


def _along_a_body(word: str) -> str:
    known = [name for name in quantities_of_a_body() if not QUANTITIES[name].of_support]
    return word if word in known else one_of(*known, meant=MEANT)(word)


def quantities_of_a_body() -> list[str]:
    """The quantities that can be read of bodies, whether their frames move or not."""
    return [name for name, quantity in QUANTITIES.items() if not (quantity.of_contact or quantity.of_tree)]


OwnTolerance = Annotated[
    Annotated[Literal["told"], Tag(WORD)] | Annotated[Annotated[Dimensionless, Field(gt=0, lt=1)], Tag(NUMBER)],
    Discriminator(lambda value: WORD if value == "told" else form_of_amount(value)),
]


_Axis = Annotated[str, AfterValidator(one_of(*AXES, *SIDES))]
Direction = Annotated[Annotated[_Axis, Tag(WORD)] | Annotated[Vector, Tag(LIST)], by_form]
NodeName = Annotated[Annotated[str, Tag(WORD)] | Annotated[int, Tag(NUMBER)], by_form]


Limit = Annotated[Frequency, Field(gt=0)]
Band = Annotated[Length, Field(gt=0)]


def _check_limit(limit: float | None, reads: Quantity) -> None:
    if limit is not None and not reads.rate:
        known = ", ".join(name for name, quantity in QUANTITIES.items() if quantity.rate)
        raise fault(f"a frequency_limit of {reads.name} is not told", expected=f"quantity: one of {known}")


def _check_band(sensor: Sensor) -> None:
    if sensor.settling_band is not None and (sensor.reads.unit != "m" or sensor.reads.of_joint):
        expected = 'quantity = "displacement", or "position_error" where frames move'
        raise fault("a settling_band is one of displacements", expected=expected)


def _check_part(sensor: Sensor) -> None:
    if sensor.part != "whole" and (sensor.reads.rate or sensor.reads.of_tree):
        known = ", ".join(name for name, quantity in QUANTITIES.items() if not (quantity.rate or quantity.of_tree))
        expected, remedy = f"quantity: one of {known}", "leave part out"
        raise fault(f"statics have no {sensor.quantity}, all of it is dynamic", expected=expected, remedy=remedy)


def _check_moment(sensor: Sensor) -> None:
    if sensor.reads.turns and (sensor.node is None or sensor.direction is None):
        remedy = 'of a uniform beam quantity = "bending_moment" at its clamped end'
        what, expected = (
            "a support's moment is one about a direction at a node",
            'node = "its name", direction = "x"',
        )
        raise fault(what, expected=expected, remedy=remedy)


def _check_error(sensor: Sensor) -> None:
    if sensor.reads.of_arm and sensor.fixed_place is None:
        what = f"a {sensor.quantity} is that of a place of a body's track"
        raise fault(what, expected='body = "a body" and at = metres along its track')


def _check_direction(sensor: Sensor) -> None:
    if sensor.direction is None:
        return
    if sensor.under is not None:
        if sensor.side is None:
            what, expected = "what moves with a carriage is read along its track or across", 'direction = "along"'
            raise fault(what, expected=expected, received=f"direction = {sensor.direction!r}")
        if sensor.reads.derivative or sensor.reads.of_support:
            expected = "displacement, velocity or acceleration"
            raise fault(f"a {sensor.quantity} has no direction", expected=f"quantity: {expected}")
    elif sensor.side is not None:
        what = f'only what moves with a carriage is read "{sensor.side}" a track'
        raise fault(what, expected='under = "a carriage", or direction: one of x, y, z, or a vector')
    elif sensor.point is not None:
        what, expected = "a point is read in the direction that its own table names", "no direction here"
        raise fault(what, expected=expected, remedy=f"direction in point.{sensor.point} of its body")
    elif not sensor.reads.of_arm and sensor.node is None and sensor.member is None:
        expected = 'node or member = "its name"'
        remedy = 'without direction; where frames move quantity = "position_error" has one'
        raise fault("only nodes and members are read in a direction", expected=expected, remedy=remedy)


def _check_joint(sensor: Sensor) -> None:
    if sensor.joint is not None and not sensor.reads.at_joint:
        known = ", ".join(name for name, quantity in QUANTITIES.items() if quantity.at_joint)
        raise fault(f"a {sensor.quantity} is not that of a joint", expected=f"quantity: one of {known}")
    if sensor.reads.at_joint and sensor.fixed_place != 0.0:
        raise fault(
            f"a {sensor.quantity} is that of a joint of a body", expected='body = "a body" alone, or with joint'
        )


class Sensor(Spec):
    """A quantity at a fixed place `at` (m along the track) of a body, at a node, a point, or a place of a member (`at`
    m from its first node) in a direction (along gravity unless given), at the point that a carriage touches (`under`,
    along gravity or "along" or "across" the track), of a carriage's own sprung mass (`carriage`), the contact force of
    a carriage (of a body that rides, that at one `contact`), what a support at a place of a beam or at a node carries
    (its moment at a node alone), how far a place of a track is from where the rigid arm would have it (the length of
    that, or in a direction over the ground), or what the drive of a `joint` of its body exerts, or how far one has
    turned or slid (by number; the only such one if not given).

    With `under` or `carriage`, the body is that of the carriage and need not be named. tolerance: of its own, in place
    of `solver.tolerance`; "told": its error is told and makes no status, as for velocities, accelerations and contact
    forces where nothing is given. frequency_limit: up to it modes count in a velocity or an acceleration, which
    converges then and is held.
    settling_band: within which of its static value a displacement has settled after a stop; how small a position error
    is then.
    part: "dynamic" for what it reads less what it would read if all carriages stood still where they are.
    """

    body: str | None = None
    at: Length | None = Field(default=None, ge=0)
    node: NodeName | None = None
    member: str | None = None
    point: str | None = None
    direction: Direction | None = None
    under: str | None = None
    carriage: str | None = None
    contact: str | None = None
    joint: int | None = Field(default=None, ge=0)
    quantity: Annotated[str, AfterValidator(one_of(more=QUANTITIES, meant=MEANT))] = "displacement"
    tolerance: OwnTolerance | None = None
    frequency_limit: Limit | None = None
    settling_band: Band | None = None
    part: Annotated[str, AfterValidator(one_of("whole", "dynamic"))] = "whole"

    @model_validator(mode="before")
    @classmethod
    def _at_its_joint(cls, data: Any) -> Any:
        """A joint is where the track of its body begins."""
        quantity = QUANTITIES.get(str(data.get("quantity"))) if isinstance(data, dict) else None
        return {"at": 0.0} | data if quantity is not None and quantity.at_joint else data

    @model_validator(mode="after")
    def _one_place(self) -> Sensor:
        off_track = [self.node, self.member, self.point]
        along = None if self.member is not None else self.at
        if [along, *off_track, self.under, self.carriage].count(None) != PLACES - 1:
            raise fault("a sensor has exactly one place", expected=EXPECTED)
        if self.rides is None and self.body is None:
            raise fault("a sensor at a fixed place needs its body", expected='body = "a body"')
        if self.member is not None and self.at is None:
            raise fault("a sensor on a member needs its place", expected="at = metres from the member's first node")
        if self.reads.of_support and (self.rides, self.member, self.point) != (None, None, None):
            raise fault("a support is a place of a beam, or a node", expected="at = metres, or node = its name")
        _check_moment(self)
        _check_band(self)
        _check_error(self)
        _check_joint(self)
        _check_part(self)
        _check_direction(self)
        if self.spot is not None and (self.reads.derivative or self.reads.of_contact):
            known = ", ".join(name for name in quantities_of_a_body() if not QUANTITIES[name].derivative)
            expected, remedy = f"quantity: one of {known}", "at = metres along the track"
            raise fault(f"only a track has {self.quantity}", expected=expected, remedy=remedy)
        if self.carriage is not None and not (self.reads.of_mass or self.reads.of_contact):
            known = ", ".join(name for name, q in QUANTITIES.items() if q.of_mass or q.of_contact)
            raise fault(f"a carriage has no {self.quantity}", expected=f"quantity: one of {known}")
        if self.reads.of_contact and self.carriage is None:
            raise fault(f"a {self.quantity} is that of a carriage", expected='carriage = "a carriage"')
        if self.frequency_limit is not None and self.rides is not None:
            raise fault("a frequency_limit counts modes at a fixed place", expected="at, node, member or point")
        _check_limit(self.frequency_limit, self.reads)
        if self.contact is not None and (not self.reads.of_contact or self.reads.of_suspension):
            raise fault("only contact forces are read at a contact", expected='quantity = "contact_force"')
        return self

    @property
    def is_dynamic_part(self) -> bool:
        """Whether it reads how far its quantity is from statics at the same places of the carriages."""
        return self.part == "dynamic"

    @property
    def words(self) -> str:
        """What it reads, in words."""
        said = self.quantity.replace("_", " ")
        return f"dynamic part of the {said}" if self.is_dynamic_part else said

    @property
    def takes_limit(self) -> bool:
        """Whether a `frequency_limit` could say which modes count in what it reads."""
        return self.rides is None and self.reads.rate > 0

    @property
    def fixed_place(self) -> float | None:
        """The place of the track, m, at which it reads whatever happens; None where it has no such."""
        return self.at if self.spot is None else None

    @property
    def reads(self) -> Quantity:
        """What it reads, as the table of quantities has it."""
        return QUANTITIES[self.quantity]

    @property
    def rides(self) -> str | None:
        """The carriage that it moves with, if any."""
        return self.carriage if self.under is None else self.under

    @property
    def side(self) -> Side | None:
        """The direction of its carriage's track in which it reads, if it does."""
        return next((side for side in SIDES if side == self.direction), None)

    @property
    def way_in_words(self) -> str:
        """The direction that it names, to stand behind its place: " along y"; "" where it names none."""
        if self.direction is None:
            return ""
        if self.side is not None:
            return f" {self.side} the track"
        named = (
            self.direction if isinstance(self.direction, str) else f"({', '.join(map('{:g}'.format, self.direction))})"
        )
        return f" {'about' if self.reads.turns else 'along'} {named}"

    @property
    def spot(self) -> Spot | None:
        """The place that it reads off its body's track, or its support, if it does."""
        if (self.node, self.member, self.point) == (None, None, None) and not self.reads.of_support:
            return None
        way = self._along
        return Spot(self.node, self.member, self.at or 0.0, self.point, way, self.reads.of_support, self.reads.turns)

    @property
    def way(self) -> Vector:
        """The unit vector of its direction; zero where it has none."""
        way = np.array(self._along or (0.0, 0.0, 0.0))
        x, y, z = (way / (np.linalg.norm(way) or 1.0)).tolist()
        return x, y, z

    @property
    def _along(self) -> Vector | None:
        """Its direction as a vector of any length."""
        if isinstance(self.direction, str):
            return float(self.direction == "x"), float(self.direction == "y"), float(self.direction == "z")
        return self.direction


class Envelope(Spec):
    """The extremes of a quantity at equally spaced places of a body: from `from` to `to`, both included, m along its
    track, or its ends where they are not given. frequency_limit: as of sensors.

    >>> Envelope(body="bed", places=5).along(8.0).tolist()
    [0.0, 2.0, 4.0, 6.0, 8.0]
    """

    body: str
    quantity: Annotated[str, AfterValidator(_along_a_body)] = "displacement"
    frequency_limit: Limit | None = None
    places: int = Field(default=51, ge=2, le=MOST_PLACES)
    from_: Length | None = Field(default=None, alias="from", ge=0)
    to: Length | None = Field(default=None, gt=0)

    @property
    def fixed_place(self) -> None:
        """None: it reads many."""
        return None

    @property
    def reads(self) -> Quantity:
        """As of a sensor."""
        return QUANTITIES[self.quantity]

    @property
    def words(self) -> str:
        """What it reads, in words."""
        return self.quantity.replace("_", " ")

    @model_validator(mode="after")
    def _ascending(self) -> Envelope:
        if self.from_ is not None and self.to is not None and self.from_ >= self.to:
            received = f"from = {self.from_:.10g}, to = {self.to:.10g}"
            raise fault("an envelope goes forward along its body", expected="from < to", received=received)
        _check_limit(self.frequency_limit, QUANTITIES[self.quantity])
        return self

    def along(self, length: float) -> NDArray[np.float64]:
        """(places,) m along a track of this length (m)."""
        first = 0.0 if self.from_ is None else self.from_
        return np.linspace(first, length if self.to is None else self.to, self.places)
