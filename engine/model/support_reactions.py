"""How a body that rides stands on its contacts: where they are, and what each carries at rest on level rigid ground."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.model.ties import Attachment, Load, SpringTie
from engine.scene.variants import APART, SpringKeys, contact_stiffness_keys
from results_schema.arrays import Array
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import ModalBody
    from engine.model.numerics import Numerics
    from engine.model.rider import Rider
    from engine.model.ties import CarriageTie
    from engine.scene.carriages import Carriage
    from engine.scene.study import Study


LIFTS = 1e-9  # of its weight: a contact that pulls more at rest would lift
CLASH = 1e-7  # of a shape, per contact: rigid contacts that the modes cannot tell apart any better are one
#: Of the largest motion of contacts: a smaller one is rounding, 1e-17 of a frame that goes along its track, where 14 t
#: with 1e-9 kg m2 heave by 1e-7 of their pitch.
UNMOVED = 1e-12
HELD = 1e-6  # part of a body's mass that its elastic modes may take of a uniform acceleration


class Place(NamedTuple):
    """Whose contacts: the carriage's number and tie, the numbers of the bodies below its contacts and of the one that
    rides, all bodies, and the number of its first contact among all riders."""

    number: int
    tie: CarriageTie
    below: tuple[int, ...]
    rides: int
    bodies: tuple[ModalBody, ...]
    first: int


@dataclass(frozen=True, eq=False)
class SupportReactions:
    """A body on its contacts: the carriage with its weight on them, their ways and springs."""

    carriage: CarriageTie
    riders: tuple[Rider, ...]
    springs: tuple[SpringTie, ...]


def stand(study: Study, numerics: Numerics, place: Place, swept: Collection[str]) -> SupportReactions:
    """Put the body of a carriage on its contacts. Raises BadInput where it cannot stand or leaves what it rides."""
    name, modal = place.tie.name, place.bodies[place.rides]
    carriage = study.carriage[name]
    _check_fidelity(study, name)
    _check_directions(study, name, place)
    _check_points(study, name, carriage, modal)
    riders = tuple(
        replace(place.tie.rider, length=place.bodies[below].length, offset=offset)
        for below, offset in zip(place.below, carriage.contact_offsets(modal.length), strict=True)
    )
    _check_ways(study, name, carriage, riders)
    _check_joints(study, name, _joints(carriage, riders, place))
    shares = _shares(study, numerics, name, modal)
    loads = tuple(Load(*load) for load in zip(itertools.count(place.first), shares, place.below))
    springs, varying = [], set(contact_stiffness_keys(study)) & set(swept)
    for load, (word, contact) in zip(loads, carriage.riding_contacts.items(), strict=True):
        keys = SpringKeys.of_contact(name, word)
        held = Attachment(-1.0, place.rides, None, contact.place)
        damped = contact.damping > 0.0 or keys.damping in swept
        kind = damped, contact.is_rigid, keys.stiffness in varying
        springs.append(SpringTie(place.number, load.rider, load.body, keys, held, None, *kind))
    _check_determinate(study, name, modal, springs)
    acting = tuple(springs) if numerics.knows_springs else ()
    reference = carriage.reference_on(modal.length)
    carried = replace(place.tie, loads=loads, rides=place.rides, reference=reference)
    return SupportReactions(carried, riders, acting)


def _shares(study: Study, numerics: Numerics, name: str, modal: ModalBody) -> tuple[float, ...]:
    """Parts of the weight at rest on level rigid ground.

    N/k + C N = rigid-body motion at the contacts, and N balances the weight; C is the body's flexibility between its
    contacts. Its own weight bends it only through the contacts: a uniform acceleration moves rigid-body modes alone.
    """
    contacts = study.carriage[name].riding_contacts.values()
    attachments = [Attachment(1.0, 0, None, contact.place) for contact in contacts]
    places = [
        attachment.at if isinstance(attachment.at, str) else np.array([attachment.at]) for attachment in attachments
    ]
    shapes = np.stack([attachment.fixed_row(modal) for attachment in attachments])
    rigid = modal.omega == 0.0
    pull = modal.participation / modal.mass
    if not float(np.sum(pull[rigid] ** 2) * modal.mass) > 1.0 - HELD:
        raise study.source.fault(
            f"carriage.{name}.body",
            "something holds this body: it cannot ride",
            expected="a body that is free to move along gravity",
            remedy="no supports, or only such as leave it free along gravity, and rigid-body modes kept",
        )
    soft = (shapes * modal.modal_flexibility) @ shapes.T
    if numerics.static_correction:
        soft = _flexibility(modal, places)
    soft = soft + np.diag([1.0 / contact.spring for contact in contacts])
    unit = max(float(np.trace(soft)), 1e-30)
    sizes = np.abs(shapes[:, rigid]).max(axis=0)  # of each motion its own: what turns easily heaves all the same
    sizes = np.where(sizes > UNMOVED * sizes.max(), sizes, sizes.max())
    free, count = shapes[:, rigid] / sizes, len(places)
    matrix = np.block([[soft / unit, -free], [free.T, np.zeros((free.shape[1],) * 2)]])
    wanted = np.concatenate([np.zeros(count), pull[rigid] / sizes])
    found = np.linalg.lstsq(matrix, wanted, rcond=1e-12)[0]
    _check_stands(study, name, (free, wanted[count:]), found[:count])
    return tuple(float(share) for share in found[:count])


def _flexibility(modal: ModalBody, places: Sequence[Array | str]) -> Array:
    """(C, C) deflection at every contact per unit force at every other one, m/N; places (1,) or names of points."""
    count = len(places)
    along = [place for place in places if not isinstance(place, str)]
    if len(along) == count:  # all at once
        at = np.concatenate(along)
        return modal.flexibility_between(np.repeat(at, count), np.tile(at, count)).reshape(count, count)
    return np.array([[modal.flexibility_between(one, other)[0] for other in places] for one in places])


def _check_stands(study: Study, name: str, balance: tuple[Array, Array], shares: Array) -> None:
    """Refuse contacts that cannot carry the body at rest."""
    free, pull = balance
    tips = np.abs(free.T @ shares - pull).max() > 1e-9 * np.abs(pull).max()
    if tips or shares.min() < -LIFTS:
        raise study.source.fault(
            f"carriage.{name}.contacts",
            "this body would tip over: its contacts cannot carry its weight at rest",
            expected="contacts on both sides of its centre of mass",
            received=_places_in_words(study, name),
            remedy="a contact further out on the side to which it tips, or another one",
        )


def _places_in_words(study: Study, name: str) -> str:
    """Where the contacts of a carriage stand on the body that rides."""
    contacts = study.carriage[name].riding_contacts
    return ", ".join(
        f"{word} at {c.at:g} m" if c.at is not None else f"{word} at {c.point}" for word, c in contacts.items()
    )


def _check_determinate(study: Study, name: str, modal: ModalBody, springs: Sequence[SpringTie]) -> None:
    """Refuse contacts that share the weight by stiffnesses which are the variants' own."""
    held = np.stack([spring.held.fixed_row(modal)[modal.omega == 0.0] for spring in springs if spring.held])
    sizes = np.abs(held).max(axis=0)
    held = held / np.where(sizes > UNMOVED * sizes.max(), sizes, sizes.max())
    if any(spring.varies for spring in springs) and np.linalg.matrix_rank(held, tol=APART) < len(held):
        raise study.source.fault(
            f"carriage.{name}.contacts",
            "these contacts share what they carry by their stiffnesses, which the sweep varies",
            expected="contacts at different places of a body that is free to heave and to pitch",
            received=_places_in_words(study, name),
            remedy="points further apart, or one stiffness for all variants",
        )


def _check_fidelity(study: Study, name: str) -> None:
    if study.solver.fidelity in ("mass", "mass-without-convective"):
        what = f'carriage {name} is a body on contacts, for which fidelity = "{study.solver.fidelity}" has no meaning'
        raise study.source.fault("solver.fidelity", what, expected='"auto", or "force" for its weight alone')


def _check_directions(study: Study, name: str, place: Place) -> None:
    """The weight acts in one direction on all that carries it."""
    along = [place.bodies[body].gravity_share for body in (place.tie.body, *place.below)]
    if max(along) - min(along) > 1e-9:
        raise study.source.fault(
            f"carriage.{name}.contacts",
            "the bodies under these contacts deflect in different directions",
            expected="tracks whose loads act equally along gravity",
            received=", ".join(f"{share:.3g} of gravity" for share in along[1:]),
        )


def _check_points(study: Study, name: str, carriage: Carriage, modal: ModalBody) -> None:
    known = (
        [] if modal.points is None else [p.partition(".")[2] for p in modal.points.numbers if p.startswith("point.")]
    )
    for word, contact in carriage.riding_contacts.items():
        if contact.point is not None and contact.point not in known:
            raise study.source.fault(
                f"carriage.{name}.contacts.{word}.point",
                f"body {carriage.riding_body} has no such point",
                expected=f"one of {', '.join(known)}" if known else "at = metres along its track: it has no points",
                received=contact.point,
            )


def _check_ways(study: Study, name: str, carriage: Carriage, riders: tuple[Rider, ...]) -> None:
    """Contacts stay on what they ride unless the carriage only passes; rigid ones never meet a shock."""
    for rider, (word, contact) in zip(riders, carriage.riding_contacts.items(), strict=True):
        where = study.source.where(f"carriage.{name}.contacts.{word}")
        if rider.stays and rider.leaves:
            what, expected = "this contact leaves the body that it rides", f"a way within 0 to {rider.length:.6g} m"
            raise BadInput(what, where=where, expected=expected, received="{:.6g} to {:.6g} m".format(*rider.range))
        shocks = (
            rider.is_jolted(alone=len(study.carriage) == 1) or rider.delay > 0.0 or rider.motion.free_vibration > 0.0
        )
        if contact.is_rigid and (rider.leaves or shocks):
            what = "a rigid contact would meet a shock"
            expected = "a way that stays on the body, without jumps of speed, delay or free vibration afterwards"
            raise BadInput(what, where=f"{where}.stiffness", expected=expected, remedy="a stiffness in N/m")


def _joints(carriage: Carriage, riders: tuple[Rider, ...], place: Place) -> Array:
    """(J, N) rows of the rigid contacts over the modes of all bodies, in the middle of the way."""
    contacts, middle, rows = carriage.riding_contacts.values(), 0.5 * sum(carriage.motion.range()), []
    for rider, contact, number in zip(riders, contacts, place.below, strict=True):
        if contact.is_rigid:
            parts = [np.zeros(body.omega.size) for body in place.bodies]
            below, above = place.bodies[number], place.bodies[place.rides]
            parts[number] = below.shape([min(max(middle + rider.offset, 0.0), rider.length)])[0] * np.sqrt(below.mass)
            parts[place.rides] = Attachment(1.0, 0, None, contact.place).fixed_row(above) * np.sqrt(above.mass)
            rows.append(np.concatenate(parts))
    return np.array(rows)


def _check_joints(study: Study, name: str, rows: Array) -> None:
    """Refuse more rigid contacts than the kept modes of all bodies can meet."""
    met = int(np.linalg.matrix_rank(rows, tol=CLASH * len(rows))) if rows.size else 0
    if met < len(rows):
        raise study.source.fault(
            f"carriage.{name}.contacts",
            "the kept modes of these bodies cannot meet so many rigid contacts",
            expected=f"at most {met} of them rigid, at different places",
            received=str(len(rows)),
            remedy="more modes, or a stiffness in N/m",
        )
