"""From a study's scene to arrays of modes: every body in modal coordinates, every carriage a tie, every damper a tie.

A `SceneModel` is what variants share that differ only in mass, force, pace, damping and gravity.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.build import build_body
from engine.model.numerics import Numerics
from engine.model.refusals import check_rigid_modes
from engine.model.rider import Rider
from engine.model.support_reactions import Place, stand
from engine.model.ties import CarriageTie, DamperTie, Load, PushTie, SpringTie
from engine.scene.variants import SpringKeys, in_step, in_use, keys_of_carriage
from results_schema.arrays import Array, Counts, Mask
from results_schema.errors import BadInput
from results_schema.status import Fidelity

if TYPE_CHECKING:
    from engine.bodies.modal.description import Body
    from engine.bodies.modal.modal_body import Direction, ModalBody
    from engine.kernels.schemes import Scheme
    from engine.model.support_reactions import SupportReactions
    from engine.model.ties import Attachment, Inertia
    from engine.scene.carriages import Suspension
    from engine.scene.motions.base import Motion
    from engine.scene.study import Study


PROBED = 65  # places along a track at which it is looked for what a mode moves
UNFELT = 1e-6  # of the largest: a mode that moves its track less is none of the loads' business


@dataclass(frozen=True, eq=False)
class BodyPart:
    """A body's place in the scene's modal coordinates.

    modes: its slice of all modes. own_weight: gravity acts on it too.
    """

    name: str
    modal: ModalBody
    modes: slice
    own_weight: bool


@dataclass(frozen=True, eq=False)
class SceneModel:
    """Bodies, carriages, dampers and springs of one scene; modes of all bodies stand in one row, sprung masses after
    them, then what pushes along or across tracks adds. numerics: what it is computed with. contacts: the ways of the
    contacts of bodies that ride. swept: keys of numbers that differ from variant to variant."""

    study: Study
    numerics: Numerics
    bodies: tuple[BodyPart, ...]
    carriages: tuple[CarriageTie, ...]
    dampers: tuple[DamperTie, ...]
    springs: tuple[SpringTie, ...] = ()
    contacts: tuple[Rider, ...] = ()
    swept: tuple[str, ...] = ()
    pushes: tuple[PushTie, ...] = ()

    @property
    def ties(self) -> int:
        """Number of ties: carriages first, then dampers, springs, and pushes along or across tracks."""
        return self.first_push + len(self.pushes)

    @property
    def body_modes(self) -> int:
        """Number of modes of all bodies."""
        return sum(part.modal.omega.size for part in self.bodies)

    @cached_property
    def omega(self) -> Array:
        """(N,) natural frequencies of all bodies, rad/s, 0 for every sprung mass, those of residual coordinates, which
        are the highest kept and ask for no smaller steps, 0 for pulsating forces, whose frequency is the variant's, and
        0 for the coordinate that stays 1, which is there where something pushes along its track."""
        sprung, others = np.zeros(len(self.sprung)), np.zeros(self.pulses.stop - self.pulses.start + self.has_constant)
        bodies = (part.modal.omega for part in self.bodies)
        residual = [self.bodies[body].modal.omega[-1] for body in self.corrected_bodies]
        return np.concatenate([*bodies, sprung, residual, others])

    @property
    def has_constant(self) -> bool:
        """Whether the last coordinate is one that stays 1."""
        return any(push.prescribed for push in self.pushes)

    @cached_property
    def corrected(self) -> Counts:
        """Numbers of the ties that a residual coordinate moves (`attachment.residual_rows`): masses, and their pushes
        along and across their tracks, on bodies that bend."""
        if not self.numerics.static_correction:
            return np.zeros(0, dtype=np.int64)
        masses = [r for r, carriage in enumerate(self.carriages) if carriage.inertia == "mass"]
        ties = [*masses, *range(self.first_push, self.ties)]
        return np.array([r for r in ties if self.bodies[self.attachments[r][0].body].modal.omega.any()], dtype=np.int64)

    @property
    def corrected_bodies(self) -> list[int]:
        """The bodies that these ties hold."""
        return [self.attachments[r][0].body for r in self.corrected]

    @property
    def residuals(self) -> slice:
        """The residual coordinates among all coordinates."""
        first = self.body_modes + len(self.sprung)
        return slice(first, first + self.corrected.size)

    @cached_property
    def pulsating(self) -> dict[int, int]:
        """By numbers of the carriages whose force pulsates, which of the coordinates of `pulses` it swings by."""
        names = list(dict.fromkeys(carriage.pulse for carriage in self.carriages if carriage.pulsates))
        return {n: names.index(carriage.pulse) for n, carriage in enumerate(self.carriages) if carriage.pulsates}

    @property
    def pulses(self) -> slice:
        """Their coordinates among all: oscillators that nothing holds back, z'' + Omega^2 z = 0, of amplitude 1."""
        return slice(self.residuals.stop, self.residuals.stop + 1 + max(self.pulsating.values(), default=-1))

    @property
    def sprung(self) -> tuple[SpringTie, ...]:
        """The springs under sprung masses."""
        return tuple(spring for spring in self.springs if spring.mode is not None)

    @property
    def varying(self) -> list[int]:
        """Numbers, among the springs, of contacts whose stiffness is a lane's own."""
        return [number for number, spring in enumerate(self.springs) if spring.varies]

    @property
    def scheme(self) -> Scheme:
        """The time integration scheme."""
        return self.numerics.scheme

    @property
    def leading_body(self) -> BodyPart:
        """The body of the first carriage, whose first period and length make ratios; where that is rigid and rides,
        the first one below it that bends."""
        below = {carriage.rides: carriage.body for carriage in self.carriages}
        body = self.carriages[0].body
        while not self.bodies[body].modal.omega.any():
            body = below[body]
        return self.bodies[body]

    @cached_property
    def first_omega(self) -> float:
        """Lowest elastic natural frequency of the leading body that moves its track along the load, rad/s."""
        modal = self.leading_body.modal
        felt = (modal.omega > 0.0) & _larger(modal.shape(np.linspace(0.0, modal.length, PROBED)))
        return float(modal.omega[felt if felt.any() else modal.omega > 0.0][0])

    def excited(self, part: BodyPart) -> Mask:
        """(N,) which modes of a body its loads excite: of a frame, others sway and twist beside them."""
        modal, x = part.modal, np.linspace(0.0, part.modal.length, PROBED)
        found = (modal.omega == 0.0) | _larger(modal.shape(x))
        if modal.points is not None:
            found |= _larger(modal.points.shapes)
        for direction in self.pushed(self.bodies.index(part)):
            found |= _larger(modal.sides[direction].derivatives(x, (0,))[0])
        return np.asarray(found)

    @property
    def riders(self) -> tuple[Rider, ...]:
        """The ways of all carriages, then of all contacts of bodies that ride."""
        return (*(carriage.rider for carriage in self.carriages), *self.contacts)

    @property
    def clock(self) -> Motion:
        """The motion whose passage or cycle is the unit of scene time."""
        return self.study.carriage[self.study.clock].motion

    @property
    def timing(self) -> tuple[dict[str, float], dict[str, float]]:
        """Paces and delays of all carriages by name, as `build_model` takes them."""
        riders = {carriage.name: carriage.rider for carriage in self.carriages}
        return {name: r.pace for name, r in riders.items()}, {name: r.delay for name, r in riders.items()}

    @property
    def first_spring(self) -> int:
        """Number of the first spring among all ties."""
        return len(self.carriages) + len(self.dampers)

    @property
    def first_push(self) -> int:
        """Number of the first push along or across a track among all ties, after the springs."""
        return self.first_spring + len(self.springs)

    @cached_property
    def attachments(self) -> tuple[tuple[Attachment, ...], ...]:
        """Where every tie acts on the bodies."""
        ties: list[CarriageTie | DamperTie | SpringTie | PushTie] = [*self.carriages, *self.dampers]
        return tuple(tie.attachments for tie in (*ties, *self.springs, *self.pushes))

    def pushed(self, body: int) -> set[Direction]:
        """Directions beside that of loads in which the inertia of carriages acts on the track of a body."""
        return {push.direction for push in self.pushes if push.body == body}

    def exceeds_statics(self, body: int) -> bool:
        """Whether something pushes a body that statics do not count: inertia along its track, or a pulsating force."""
        return "along" in self.pushed(body) or any(self.carriages[n].body == body for n in self.pulsating)

    def springs_of(self, carriage: int) -> dict[int, SpringTie]:
        """The springs of a carriage by their number among all ties."""
        numbered = enumerate(self.springs, start=self.first_spring)
        return {r: spring for r, spring in numbered if spring.carriage == carriage}

    def contact_names(self, carriage: int) -> dict[int, str]:
        """The contacts of a body that rides by the numbers of their riders; empty for other carriages."""
        tie = self.carriages[carriage]
        if tie.rides is None:
            return {}
        contacts = self.study.carriage[tie.name].riding_contacts
        return {load.rider: name for load, name in zip(tie.loads, contacts, strict=True)}

    def reacts(self, carriage: int) -> bool:
        """Whether the contact force of a carriage depends on how its body moves."""
        return self.carriages[carriage].inertia != "force" or bool(self.springs_of(carriage))

    def may_lift(self, carriage: int) -> bool:
        """Whether the carriage would lift off where its contact force turns negative."""
        return self.reacts(carriage) and self.study.carriage[self.carriages[carriage].name].may_lift

    @property
    def fidelity(self) -> Fidelity:
        """The model that this scene marches: the fullest of its carriages'."""
        if self.numerics.fidelity == "static":
            return Fidelity.STATIC
        if self.springs:
            return Fidelity.TIED
        kinds = {carriage.inertia for carriage in self.carriages}
        if "mass" in kinds:
            return Fidelity.MASS
        return Fidelity.MASS_WITHOUT_CONVECTIVE if "mass-without-convective" in kinds else Fidelity.FORCE

    def sag(self, body: int, x: Array, derivative: int) -> Array:
        """d^j/dx^j of a body's deflection under its own weight per unit gravity, zero where that does not act."""
        part = self.bodies[body]
        if not part.own_weight:
            return np.zeros_like(x)
        return part.modal.own_weight_deflection(x, derivative)


def build_model(
    study: Study,
    paces: Mapping[str, float],
    delays: Mapping[str, float],
    swept: Collection[str] = (),
    numerics: Numerics | None = None,
) -> SceneModel:
    """The model of a study without sweep.

    paces: per carriage, the first carriage's time scale over its own. delays: per carriage, in the first one's time
    scale. swept: keys of numbers that differ between the variants that share the model. numerics: as the study says if
    not given. Raises BadInput where the scene cannot be marched.
    """
    numerics = Numerics.of(study) if numerics is None else numerics
    used = [name for name in study.body if in_use(study, name)]
    parts: list[BodyPart] = []
    first = 0
    for name in used:
        part = _body_part(study, name, numerics.body(study, name), first)
        parts.append(part)
        first = part.modes.stop
    carriages = []
    for number, (name, carriage) in enumerate(study.carriage.items()):
        body = used.index(carriage.on)
        rider = Rider(carriage.motion, parts[body].modal.length, paces.get(name, 1.0), delays.get(name, 0.0))
        own = _inertia(study, numerics, name, swept), (Load(number, 1.0, body),)
        pulse = in_step(study, name, swept) if carriage.pulsates else ""
        carriages.append(CarriageTie(name, body, rider, *own, pulse=pulse))
    dampers = [
        DamperTie(number, at, key)
        for number, name in enumerate(used)
        for key, at, coefficient in study.dampers(name)
        if coefficient > 0.0 or key in swept
    ]
    support_reactions = _standing(study, numerics, carriages, parts, swept)
    contacts = tuple(rider for stands in support_reactions.values() for rider in stands.riders)
    on_contacts = tuple(spring for stands in support_reactions.values() for spring in stands.springs)
    springs = (*_springs(study, numerics, carriages, first, swept), *on_contacts)
    carried = tuple(support_reactions[n].carriage if n in support_reactions else tie for n, tie in enumerate(carriages))
    model = SceneModel(
        study,
        numerics,
        tuple(parts),
        carried,
        tuple(dampers),
        springs,
        contacts,
        tuple(swept),
        tuple(_pushes(study, numerics, carriages)),
    )
    check_rigid_modes(model)
    return model


def _larger(shapes: Array) -> Mask:
    """(N,) which modes of shapes (S, N) are more than rounding."""
    size = np.abs(shapes).max(axis=0)
    return np.asarray(size > UNFELT * size.max())


def with_numerics(model: SceneModel, numerics: Numerics) -> SceneModel:
    """The same scene computed with something else. Raises BadInput."""
    if numerics == model.numerics:
        return model
    return build_model(model.study, *model.timing, model.swept, numerics)


def _inertia(study: Study, numerics: Numerics, name: str, swept: Collection[str]) -> Inertia:
    """The terms that act at a carriage's contact; fidelity "auto" is the carriage's own kind in full."""
    fidelity, carriage = numerics.fidelity, study.carriage[name]
    locked = _suspension(study, numerics, name) is None
    touching = carriage.masses if locked else carriage.touching
    heavy = carriage.sum_of(touching) > 0.0 or any(key in swept for key in keys_of_carriage(name, touching))
    if fidelity in ("force", "static") or not heavy:
        return "force"
    return "mass-without-convective" if fidelity == "mass-without-convective" else "mass"


def _suspension(study: Study, numerics: Numerics, name: str) -> Suspension | None:
    """The spring of a carriage that acts; below the full fidelity it is locked."""
    return study.carriage[name].suspension if numerics.knows_springs else None


def _springs(
    study: Study, numerics: Numerics, carriages: list[CarriageTie], first: int, swept: Collection[str]
) -> tuple[SpringTie, ...]:
    """The springs of all sprung masses, whose modes are counted from ``first``."""
    found: list[SpringTie] = []
    for number, tie in enumerate(carriages):
        suspension = _suspension(study, numerics, tie.name)
        if suspension is not None:
            keys = SpringKeys.of_carriage(tie.name)
            damped = suspension.damping > 0.0 or keys.damping in swept
            found.append(SpringTie(number, number, tie.body, keys, None, first + len(found), damped))
    return tuple(found)


def _pushes(study: Study, numerics: Numerics, carriages: list[CarriageTie]) -> Iterator[PushTie]:
    """The inertia of carriages along and across their tracks, wherever any inertia acts."""
    if numerics.fidelity in ("force", "static"):
        return
    for number, tie in enumerate(carriages):
        for direction in study.carriage[tie.name].pushes:
            push = PushTie(number, tie.body, direction, numerics.fidelity != "mass-without-convective")
            if push.prescribed and tie.rider.is_jolted(alone=len(carriages) == 1):
                raise study.source.fault(
                    f"carriage.{tie.name}.motion",
                    "this carriage changes its speed at an instant, and so would push along its track without bound",
                    expected="a motion without jumps of speed",
                    remedy="turn > 0 of an out-and-back, or inertia_along = false",
                )
            yield push


def _standing(
    study: Study, numerics: Numerics, carriages: list[CarriageTie], parts: list[BodyPart], swept: Collection[str]
) -> dict[int, SupportReactions]:
    """The bodies that ride, by the number of their carriage."""
    found: dict[int, SupportReactions] = {}
    names, first, modals = [part.name for part in parts], len(carriages), tuple(part.modal for part in parts)
    for number, tie in enumerate(carriages):
        carriage = study.carriage[tie.name]
        if carriage.riding_body is not None:
            rides = names.index(carriage.riding_body)
            place = Place(number, tie, tuple(map(names.index, carriage.ridden)), rides, modals, first)
            found[number] = stand(study, numerics, place, swept)
            first += len(carriage.riding_contacts)
    return found


def _body_part(study: Study, name: str, body: Body, first: int) -> BodyPart:
    """A body of the study in modal coordinates, its modes counted from ``first``."""
    try:
        modal = build_body(body, study.spots(name))
    except BadInput as error:
        raise error.moved(study.source.where(f"body.{name}.{error.where}")) from None
    return BodyPart(name, modal, slice(first, first + modal.omega.size), body.own_weight)
