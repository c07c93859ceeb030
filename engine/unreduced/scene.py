"""The unreduced finite-element model of a study's scene: a second source for what the march of modes says.

Every body has all its degrees of freedom, stacked in one row; sprung masses stand after the bodies as degrees of
freedom of their own. A body that rides and a sprung mass count from their unstressed place over level rigid ground, so
their weight bends them and their springs by the model itself; the bodies they ride count from their state without
carriages, or with own weight from the unstressed state.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from engine.bodies.modal.modal_body import Direction
from engine.model.rider import Rider
from engine.scene.carriages import Contact, Suspension
from engine.scene.study import Study
from engine.unreduced.bodies import FullBody, Track, full_body
from results_schema.arrays import Array
from results_schema.lazy_imports import linalg, sparse

Link = Literal["force", "mass", "spring", "rigid", "push"]  # push: the inertia of a mass beside that along its loads


@dataclass(frozen=True, eq=False)
class Tie:
    """One force between a carriage and the body on which it rides; positive presses.

    name: of the contact. rider: number of its way. body: the name of the ridden one. mass kg, force N, stiffness N/m,
    damping N s/m: of its kind; direction: in which it acts. other (n,): what it does to the rest of the scene, the
    rider's side of its gap; at: its place on the track of the body that rides, None where it has none.
    """

    name: str
    carriage: str
    link: Link
    rider: int
    body: str
    other: Array
    mass: float = 0.0
    force: float = 0.0
    stiffness: float = np.inf
    damping: float = 0.0
    rides: str = ""
    at: float | None = None
    direction: Direction = "load"

    @property
    def compliance(self) -> float:
        """m/N of its spring."""
        return 1.0 / self.stiffness


@dataclass(frozen=True, eq=False)
class Unreduced:
    """All bodies of a scene as one system M x'' + C x' + K x = f + ties.

    bodies by name, firsts: where their degrees of freedom begin; sprung: that of every sprung mass by its carriage's
    name; riders: the ways of the carriages, then of all contacts.
    """

    study: Study
    bodies: Mapping[str, FullBody]
    firsts: Mapping[str, int]
    sprung: Mapping[str, int]
    riders: tuple[Rider, ...]

    @cached_property
    def size(self) -> int:
        """Degrees of freedom of the whole scene."""
        return sum(body.size for body in self.bodies.values()) + len(self.sprung)

    @cached_property
    def ties(self) -> tuple[Tie, ...]:
        """All ties: of the carriages themselves, then of contacts."""
        return (*_own_ties(self), *_contact_ties(self))

    @cached_property
    def weight(self) -> Array:
        """(n,) N: of sprung masses, of bodies that ride, and of those whose own weight acts."""
        found = np.zeros(self.size)
        for name, body in self.bodies.items():
            if name in self.loose or self.study.body[name].own_weight:
                found[self.part(name)] = body.pull * self.study.gravity
        for name, suspension in suspensions_of(self.study).items():
            found[self.sprung[name]] = suspension.mass * self.study.gravity
        return found

    @property
    def loose(self) -> tuple[str, ...]:
        """The bodies that ride."""
        return tuple(c.riding_body for c in self.study.carriage.values() if c.riding_body is not None)

    @cached_property
    def stiffness(self) -> sparse.csc_array:
        """(n, n) of all bodies, without ties."""
        return self._stacked([body.stiffness for body in self.bodies.values()], np.zeros(len(self.sprung)))

    @cached_property
    def mass(self) -> sparse.csc_array:
        """(n, n) of all bodies and sprung masses."""
        return self._stacked([body.mass for body in self.bodies.values()], self._sprung_masses)

    @cached_property
    def viscous(self) -> sparse.csc_array:
        """(n, n) of dampers and Rayleigh damping."""
        return self._stacked([body.damping.viscous for body in self.bodies.values()], np.zeros(len(self.sprung)))

    @cached_property
    def modal_loads(self) -> Array:
        """(n, k) M phi of the damped modes, times the root of 2 zeta omega."""
        loads = [body.damping.loads * np.sqrt(body.damping.rates) for body in self.bodies.values()]
        return np.asarray(linalg.block_diag(*loads, np.zeros((len(self.sprung), 0))))

    @cached_property
    def rigid(self) -> Array:
        """(n, r) rigid-body motions of unit mass of what is free to move."""
        motions = [body.rigid for body in self.bodies.values()]
        return np.asarray(linalg.block_diag(*motions, np.diag(1.0 / np.sqrt(self._sprung_masses))))

    @property
    def _sprung_masses(self) -> Array:
        return np.array([suspension.mass for suspension in suspensions_of(self.study).values()])

    def line(self, tie: Tie) -> Track:
        """The track of a tie in its direction."""
        body = self.bodies[tie.body]
        return body.track if tie.direction == "load" else body.sides[tie.direction]

    def within(self, one: Tie, other: Tie, x: Array, s: Array) -> Array:
        """(S,) m/N: what the element between its ends adds under a tie at x per unit force of another one on its body
        at s."""
        if one.direction == other.direction:
            return self.line(one).within(x, s)
        lines = self.bodies[one.body].lines
        return lines[one.direction].within(x, s, loads=lines[other.direction])

    def part(self, body: str) -> slice:
        """A body's degrees of freedom."""
        return slice(self.firsts[body], self.firsts[body] + self.bodies[body].size)

    def elastic(self, loads: Array) -> Array:
        """(n, c) elastic displacements of all bodies under loads (n, c), rigid-body motions left out."""
        found = np.zeros_like(loads)
        for name, body in self.bodies.items():
            here = loads[self.part(name)]
            felt = np.flatnonzero(np.any(here, axis=0))
            if body.flexibility is not None and felt.size:
                found[self.part(name), felt] = body.flexibility.solve(here[:, felt])
        return found

    def _stacked(self, parts: Sequence[Any], last: Array) -> sparse.csc_array:
        return sparse.csc_array(
            sparse.block_diag([*parts, *(sparse.csc_array([[value]]) for value in last)], format="csc")
        )


def unreduced_model(
    study: Study, paces: Mapping[str, float] | None = None, delays: Mapping[str, float] | None = None
) -> Unreduced:
    """The whole model of a study without sweep.

    Only modes that the reduced bodies keep are damped by a damping ratio, as there; Rayleigh damping and dampers are
    exact. paces, delays: as of `engine.model.scene_model.build_model`. Raises BadInput for a body without a whole
    model, and for a fidelity other than "auto".
    """
    if study.solver.fidelity not in ("auto", "full"):
        received = f'"{study.solver.fidelity}"'
        what = "the unreduced model is a full one"
        raise study.source.fault("solver.fidelity", what, expected='"auto"', received=received)
    used = {study.body_of(sensor) for sensor in study.sensor}
    for carriage in study.carriage.values():
        used |= set(carriage.bodies)
    bodies = {name: full_body(study, name) for name in study.body if name in used}
    _check_weights(study, bodies)
    _check_quantities(study)
    _check_points(study, bodies)
    firsts, first = {}, 0
    for name, body in bodies.items():
        firsts[name], first = first, first + body.size
    sprung = {name: first + index for index, name in enumerate(suspensions_of(study))}
    return Unreduced(study, bodies, firsts, sprung, tuple(_riders(study, bodies, paces or {}, delays or {})))


def _check_weights(study: Study, bodies: Mapping[str, FullBody]) -> None:
    """Weights act along the track."""
    for name, carriage in study.carriage.items():
        share = min(bodies[body].gravity_share for body in carriage.ridden)
        if carriage.inertial and abs(share - 1.0) > 1e-9 and study.gravity != 0.0:
            raise study.source.fault(
                f"carriage.{name}.on",
                "the weight of this carriage does not act in the direction of its track",
                expected="a track whose loads act along gravity",
                received=f"{share:.3g} of gravity along it",
            )


def _check_quantities(study: Study) -> None:
    """What sensors read is a motion, its rates, or what sections carry, of all modes."""
    for name, sensor in study.sensor.items():
        if sensor.frequency_limit is not None:
            what = "the unreduced model has no modes up to a limit"
            raise study.source.fault(f"sensor.{name}.frequency_limit", what, expected="no such key, or unreduced = 0")
        if sensor.reads.derivative and not sensor.reads.of_section:
            raise study.source.fault(
                f"sensor.{name}.quantity",
                "the unreduced model does not have this quantity",
                expected="displacement, velocity, acceleration, a section force, stress, strain or contact_force",
                received=f'"{sensor.quantity}"',
            )


def _check_points(study: Study, bodies: Mapping[str, FullBody]) -> None:
    """Contacts are at points that the body has."""
    for name, word, contact in contacts_of(study):
        points = bodies[str(study.carriage[name].riding_body)].points
        if contact.at is None and contact.place not in points:
            names = [point.removeprefix("point.") for point in points if point.startswith("point.")]
            raise study.source.fault(
                f"carriage.{name}.contacts.{word}.point",
                "no such point of the body that rides",
                expected=f"one of {', '.join(names)}" if names else "a contact with `at`",
                received=f'"{contact.point}"',
            )


def _riders(
    study: Study, bodies: Mapping[str, FullBody], paces: Mapping[str, float], delays: Mapping[str, float]
) -> Iterator[Rider]:
    """The ways of the carriages, then of all contacts."""
    first = next(iter(study.carriage.values()))
    alone = {}
    for name, carriage in study.carriage.items():
        pace = paces.get(name, first.motion.time_scale / carriage.motion.time_scale)
        delay = delays.get(name, carriage.start_time / first.motion.time_scale)
        alone[name] = Rider(carriage.motion, bodies[carriage.on].length, pace, delay)
        yield alone[name]
    for name, carriage in study.carriage.items():
        if carriage.riding_body is not None:
            offsets = carriage.contact_offsets(bodies[carriage.riding_body].length)
            for below, offset in zip(carriage.ridden, offsets, strict=True):
                yield replace(alone[name], length=bodies[below].length, offset=offset)


def contacts_of(study: Study) -> Iterator[tuple[str, str, Contact]]:
    """Carriage, name and contact of every contact of the bodies that ride."""
    for name, carriage in study.carriage.items():
        for word, contact in carriage.riding_contacts.items():
            yield name, word, contact


def suspensions_of(study: Study) -> dict[str, Suspension]:
    """The springs under sprung masses, by the names of their carriages."""
    found = {name: carriage.suspension for name, carriage in study.carriage.items()}
    return {name: suspension for name, suspension in found.items() if suspension is not None}


def _own_ties(model: Unreduced) -> Iterator[Tie]:
    for number, (name, carriage) in enumerate(model.study.carriage.items()):
        none = np.zeros(model.size)
        if carriage.forces:
            yield Tie(name, name, "force", number, carriage.on, none, force=carriage.sum_of(carriage.forces))
        touching, suspension = carriage.sum_of(carriage.touching), carriage.suspension
        if touching > 0.0:
            yield Tie(name, name, "mass", number, carriage.on, none, mass=touching)
        if suspension is not None:
            mass = none.copy()
            mass[model.sprung[name]] = -1.0
            k, c = suspension.stiffness, suspension.damping
            yield Tie(name, name, "spring", number, carriage.on, mass, stiffness=k, damping=c)
        heavy = carriage.moving_mass
        for direction in carriage.pushes:
            yield Tie(name, name, "push", number, carriage.on, none, mass=heavy, direction=direction)


def _contact_ties(model: Unreduced) -> Iterator[Tie]:
    for rider, (name, word, contact) in enumerate(contacts_of(model.study), start=len(model.study.carriage)):
        carriage = model.study.carriage[name]
        rides = str(carriage.riding_body)
        other = np.zeros(model.size)
        other[model.part(rides)] = -_row(contact, model.bodies[rides])
        yield Tie(
            name=f"{name}_{word}",
            carriage=name,
            link="rigid" if contact.is_rigid else "spring",
            rider=rider,
            body=contact.on or carriage.on,
            other=other,
            stiffness=contact.spring,
            damping=contact.damping,
            rides=rides,
            at=contact.at,
        )


def _row(contact: Contact, body: FullBody) -> Array:
    """(n of the body,) what moves the contact."""
    if contact.at is None:
        return body.points[str(contact.place)]
    return body.track.rows(np.array([contact.at])).columns(body.size)[:, 0]
