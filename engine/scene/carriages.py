"""What rides on a body: a force, a mass, a mass on a spring or a body on its shoes, with its motion and its start."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Discriminator, Field, Tag, model_validator

from engine.bodies.modal.modal_body import Direction
from engine.scene.motions.along_bodies import AnyMotion
from engine.study_file.checks import Check, on_body
from engine.study_file.spec import (
    LIKE_OSCILLATORS,
    NUMBER,
    ROPE,
    WORD,
    KindOf,
    Noun,
    Spec,
    SpecOfKind,
    Three,
    form_of_amount,
    kinds,
)
from engine.study_file.units import Angle, Damping, Force, Frequency, Inertia, Length, Mass, Stiffness, Time, fault

MAX_CONTACTS = 12
POINT = (
    "a carriage touches its track at one point: axles at distances are a table [train.NAME], a body on shoes or wheels "
    'is kind = "body", with the length of that body'
)

HOLDS_DOWN = "guided", "clamped", "preloaded", "holds", "hold_down", "uplift", "lifts", "unilateral"
BILATERAL = "bilateral = true: its guide also pulls, so that nothing lifts off (left out: it rests by its weight)"


class Suspension(NamedTuple):
    """A mass (kg) on a spring (N/m) and a damper (N s/m) over the point that a carriage touches."""

    mass: float
    stiffness: float
    damping: float


class Carriage(SpecOfKind):
    """Base of all carriages.

    on: name of the body. delay: s after time 0 at which it sets off, 0 if not given.
    headway: the metres of its own way by which it trails a carriage that sets off then.
    masses: keys that hold parts of its mass in kg; touching: of these, what touches the track; forces: keys in N.
    may_push: directions beside that of its loads in which its inertia may act. in_frames_that_move: keys that count
    there alone.
    """

    masses: ClassVar[tuple[str, ...]] = ()
    in_frames_that_move: ClassVar[tuple[str, ...]] = ()
    touching: ClassVar[tuple[str, ...]] = ()
    forces: ClassVar[tuple[str, ...]] = ()
    may_push: ClassVar[tuple[Direction, ...]] = ()
    looked_for: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(
            ("length", "width", "wheelbase", "wheel_base", "spacing", "spacings", "axles", "wheels"), POINT
        ),
        **dict.fromkeys(("rope", "rope_length", "cable", "pendulum"), ROPE),
    }

    on: Annotated[str, Noun("the name of a body")]
    motion: AnyMotion
    delay: Time | None = Field(default=None, ge=0)
    headway: Length | None = Field(default=None, ge=0)

    @property
    def moving_mass(self) -> float:
        """kg of the whole carriage by its own keys."""
        return self.sum_of(self.masses)

    def sum_of(self, keys: tuple[str, ...]) -> float:
        """Sum of some of its own numbers."""
        return float(sum(getattr(self, key) for key in keys))

    def weight(self, gravity: float) -> float:
        """Force along gravity on a body at rest, N, by the masses or the force of its own keys; gravity in m/s2."""
        return self.sum_of(self.forces) + self.moving_mass * gravity

    @property
    def inertial(self) -> bool:
        """Whether the contact force depends on the body's acceleration."""
        return self.moving_mass > 0.0

    @property
    def reacts(self) -> bool:
        """Whether its contact force may be another than its keys say: a plain force presses as it is written."""
        return bool(self.masses)

    @property
    def may_lift(self) -> bool:
        """Whether it would lift off where its contact force turns negative."""
        return self.reacts

    @property
    def suspension(self) -> Suspension | None:
        """Its sprung mass."""
        return None

    @property
    def pulsates(self) -> bool:
        """Whether its force swings in time."""
        return False

    @property
    def pushes(self) -> tuple[Direction, ...]:
        """Directions beside that of its loads in which its inertia acts too."""
        return ()

    @property
    def riding_body(self) -> str | None:
        """Name of the body that rides."""
        return None

    @property
    def riding_contacts(self) -> Mapping[str, Contact]:
        """The contacts of that body by name."""
        return {}

    @property
    def ridden(self) -> tuple[str, ...]:
        """Names of the bodies under its contacts in their order, or under itself where it has none."""
        return tuple(contact.on or self.on for contact in self.riding_contacts.values()) or (self.on,)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of all bodies that it stands on or brings."""
        return (*self.ridden, *([] if self.riding_body is None else [self.riding_body]))

    @property
    def lies_across(self) -> bool:
        """Whether the track of the body that rides lies across the way."""
        return any(contact.at is not None and contact.offset is not None for contact in self.riding_contacts.values())

    @property
    def level_contacts(self) -> list[list[str]]:
        """Names of those contacts that stand one behind the other on a body but at one place of the own track, about
        which nothing turns."""
        found: dict[tuple[float, str], list[str]] = {}
        for (name, contact), on in zip(self.riding_contacts.items(), self.ridden, strict=False):
            if contact.at is not None and contact.offset is not None:
                found.setdefault((contact.at, on), []).append(name)
        return [names for names in found.values() if len(names) > 1]

    def reference_on(self, track: float) -> float:
        """m, the place of the riding body's own track, of a length (m), that the motion moves."""
        return 0.0

    def contact_offsets(self, track: float) -> tuple[float, ...]:
        """m by which its contacts, or itself where it has none, are ahead of its position; track: as above."""
        reference = self.reference_on(track)
        return tuple(contact.ahead(reference) for contact in self.riding_contacts.values()) or (0.0,)

    def checks(self, here: str) -> Iterator[Check]:
        """Conditions between its numbers and those of bodies; ``here`` is its dotted key."""
        yield from self.motion.checks(f"{here}.motion", f"body.{self.on}.length")

    def instead_of_own_motion(self, name: str) -> str:
        """What to read where it has no sprung mass."""
        return f'under = "{name}" reads the body where the carriage touches it'

    @property
    def start_time(self) -> float:
        """s after time 0 at which the carriage sets off."""
        trails = 0.0 if self.headway is None else self.headway * self.motion.time_scale / self.motion.max_speed
        return (self.delay or 0.0) + trails

    @model_validator(mode="after")
    def _told_start(self) -> Carriage:
        if self.headway is not None and self.motion.pace != "speed":
            raise fault("a headway needs a motion with a constant speed", expected="delay (s)")
        return self


class Pulsation(Spec):
    """What a force swings by: amplitude sin(2 pi frequency t + phase), N, Hz and rad; t counts from the run's start."""

    amplitude: Force
    frequency: Frequency = Field(gt=0)
    phase: Angle = 0.0


class ForceCarriage(Carriage):
    """A force in N along gravity; negative lifts. pulsation: what it swings by beside that, as of a person who walks or
    of a milling cutter; statics count the force alone."""

    forces: ClassVar[tuple[str, ...]] = ("force",)

    kind: Literal["force"]
    force: Force
    pulsation: Pulsation | None = None

    @property
    def pulsates(self) -> bool:
        return self.pulsation is not None


class GuidedCarriage(Carriage):
    """Base of those that a guide may hold from both sides.

    bilateral: whether its guide pulls too, as a profile rail does: nothing lifts off, whatever the contact force.
    """

    looked_for: ClassVar[Mapping[str, str]] = {**Carriage.looked_for, **dict.fromkeys(HOLDS_DOWN, BILATERAL)}

    bilateral: bool = False

    @property
    def may_lift(self) -> bool:
        return self.reacts and not self.bilateral


class PushingCarriage(GuidedCarriage):
    """Base of those whose inertia may act in other directions than their loads, in which it always does.

    inertia_along: the mass also pushes along its track, by -m (s'' + u''), u the motion of the track along itself.
    inertia_across: it also pushes across track and loads, by -m v'', v the motion of the track so.
    """

    may_push: ClassVar[tuple[Direction, ...]] = ("along", "across")

    inertia_along: bool = False
    inertia_across: bool = False

    @property
    def pushes(self) -> tuple[Direction, ...]:
        asked: dict[Direction, bool] = {"along": self.inertia_along, "across": self.inertia_across}
        return tuple(direction for direction, acts in asked.items() if acts)


class MassCarriage(PushingCarriage):
    """A rigid mass in kg that stays in contact; its weight acts. In frames that move: inertia (kg m2) about its centre
    of mass along x, y, z of its track, with which it turns; height: m of that centre below the track (above: < 0)."""

    masses: ClassVar[tuple[str, ...]] = ("mass",)
    touching: ClassVar[tuple[str, ...]] = ("mass",)
    in_frames_that_move: ClassVar[tuple[str, ...]] = ("inertia", "height")

    kind: Literal["mass"]
    mass: Mass = Field(gt=0)
    inertia: Three[Inertia] | None = None
    height: Length = 0.0


class OscillatorCarriage(PushingCarriage):
    """A sprung mass (kg) on a spring (N/m) and a damper (N s/m) over a wheel (kg) that stays in contact; the weights of
    both masses act, and along and across the track the inertia of both."""

    masses: ClassVar[tuple[str, ...]] = ("mass", "wheel_mass")
    touching: ClassVar[tuple[str, ...]] = ("wheel_mass",)
    looked_for: ClassVar[Mapping[str, str]] = dict(GuidedCarriage.looked_for) | LIKE_OSCILLATORS

    kind: Literal["oscillator"]
    mass: Mass = Field(gt=0)
    wheel_mass: Mass = Field(default=0.0, ge=0)
    stiffness: Stiffness = Field(gt=0)
    damping: Damping = Field(default=0.0, ge=0)

    @property
    def suspension(self) -> Suspension:
        return Suspension(self.mass, self.stiffness, self.damping)


by_rigid_or_amount = Discriminator(lambda value: WORD if value == "rigid" else form_of_amount(value))
ContactStiffness = Annotated[
    Annotated[Literal["rigid"], Tag(WORD)] | Annotated[Annotated[Stiffness, Field(gt=0)], Tag(NUMBER)],
    by_rigid_or_amount,
]


class Contact(Spec):
    """A shoe or wheel under a body: a spring (N/m, or "rigid") and a damper (N s/m) between the body and what it rides.

    on: name of the body that it stands on, that of the carriage if not given. at: m along the track of the body that
    rides. point: instead, one of that body's points by name. offset: m along the way ahead of the carriage's position
    (negative: behind); of a place `at` that from the reference to it if not given, as the track lies along the way.
    """

    on: str | None = None
    at: Length | None = Field(default=None, ge=0)
    point: str | None = None
    offset: Length | None = None
    stiffness: ContactStiffness
    damping: Damping = Field(default=0.0, ge=0)

    @model_validator(mode="after")
    def _one_place(self) -> Contact:
        if (self.at is None) == (self.point is None):
            raise fault("a contact has exactly one place", expected='at = metres, or point = "a point" with an offset')
        if self.point is not None and self.offset is None:
            raise fault("a point needs an offset", expected='point = "a point" and offset = metres along the way')
        if self.stiffness == "rigid" and self.damping > 0.0:
            raise fault("a rigid contact has no damper", expected="damping = 0, or a stiffness in N/m")
        return self

    @property
    def is_rigid(self) -> bool:
        """Whether it has no spring."""
        return self.stiffness == "rigid"

    @property
    def spring(self) -> float:
        """N/m of its spring, infinite where it is rigid."""
        return math.inf if self.stiffness == "rigid" else self.stiffness

    @property
    def place(self) -> float | str:
        """Where it holds the body that rides: m along its track, or a point's name."""
        return f"point.{self.point}" if self.at is None else self.at

    def ahead(self, reference: float) -> float:
        """m by which it is ahead of the carriage's position, which moves the place ``reference`` of the own track."""
        if self.offset is not None:
            return self.offset
        return 0.0 if self.at is None else self.at - reference


NO_PUSH = "braking does not act on bodies on contacts: what rides pushes neither along nor across the track"


class BodyCarriage(GuidedCarriage):
    """Another body of the study, which nothing else holds, on shoes or wheels; its weight acts.

    reference: m along its own track, the place that the motion moves; the middle of its track if not given. Its track
    points the way of the track that it rides, or lies across it where contacts have a place `at` and an offset.
    contacts: by name; they may stand on several bodies, along whose tracks places count alike.
    """

    looked_for: ClassVar[Mapping[str, str]] = {
        **GuidedCarriage.looked_for,
        **dict.fromkeys(("inertia_along", "inertia_across"), NO_PUSH),
    }

    kind: Literal["body"]
    body: str
    reference: Length | None = None
    contacts: dict[str, Contact] = Field(min_length=1, max_length=MAX_CONTACTS)

    @model_validator(mode="after")
    def _one_way(self) -> BodyCarriage:
        if self.on not in self.ridden:
            what = f"no contact stands on {self.on}, along which the carriage moves"
            raise fault(what, expected=f'on = "{self.on}" of a contact')
        if len({contact.offset is None for contact in self.contacts.values() if contact.at is not None}) > 1:
            expected = "an offset for all of them, or for none"
            raise fault("the track of the body that rides lies along the way or across it", expected=expected)
        return self

    @property
    def inertial(self) -> bool:
        return True

    @property
    def reacts(self) -> bool:
        return True

    @property
    def riding_body(self) -> str:
        return self.body

    @property
    def riding_contacts(self) -> Mapping[str, Contact]:
        return self.contacts

    def reference_on(self, track: float) -> float:
        return 0.5 * track if self.reference is None else self.reference

    def checks(self, here: str) -> Iterator[Check]:
        yield from super().checks(here)
        keys = [f"contacts.{name}.at" for name, contact in self.contacts.items() if contact.at is not None]
        for key in keys if self.reference is None else ["reference", *keys]:
            needs = (f"{here}.{key}", f"body.{self.body}.length")
            yield on_body(f"{here}.{key}", needs, "a place off the track of the body that rides")

    def instead_of_own_motion(self, name: str) -> str:
        return f'body = "{self.body}" and at = metres along its track read the body that rides'


CARRIAGES = kinds(
    "carriage", "wanderlast.carriages", Carriage, ForceCarriage, MassCarriage, OscillatorCarriage, BodyCarriage
)
AnyCarriage = Annotated[Carriage, KindOf("carriage", CARRIAGES)]
