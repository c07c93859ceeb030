"""From a study's scene to arrays of modes: every body in modal coordinates, every carriage a tie, every damper a tie.

A `SceneModel` is what variants share that differ only in mass, force, pace, damping and gravity.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.bodies.build import build_body
from engine.bodies.modal import ModalBody
from engine.carriages import OscillatorCarriage
from engine.kernels.schemes import Scheme
from engine.scene import Study
from engine.timeline import Rider
from results_schema.errors import BadInput
from results_schema.status import Fidelity

Array = NDArray[np.float64]

Inertia = Literal["force", "mass", "mass-without-convective"]


@dataclass(frozen=True, eq=False)
class BodyPart:
    """A body's place in the scene's modal coordinates.

    modes: its slice of all modes. fibre_distance: m, NaN where it is not known. own_weight: gravity acts on it too.
    """

    name: str
    modal: ModalBody
    modes: slice
    second_moment: float
    fibre_distance: float
    own_weight: bool


@dataclass(frozen=True, eq=False)
class CarriageTie:
    """A carriage as the march sees it: its body's number, its way, and which inertia terms act at its contact."""

    name: str
    body: int
    rider: Rider
    inertia: Inertia


@dataclass(frozen=True, eq=False)
class SpringTie:
    """The spring and damper under a carriage's sprung mass.

    carriage: its number. mode: of the mass, whose coordinate is its displacement (m) from where the spring carries it
    on a level track; so the tie's force is what the spring has beyond the weight, which stays with the contact.
    damped: whether there is a damper.
    """

    carriage: int
    mode: int
    damped: bool


@dataclass(frozen=True, eq=False)
class DamperTie:
    """A damper at a place of a body's track (m) or a point of it (by name): force -c w', c at the dotted key, N s/m."""

    body: int
    at: float | str
    key: str

    def row(self, modal: ModalBody) -> Array:
        """(N,) what every mode of its body moves it by."""
        if isinstance(self.at, str):
            assert modal.points is not None
            return modal.points.row(self.at)
        return np.asarray(modal.shape([self.at])[0])


@dataclass(frozen=True, eq=False)
class SceneModel:
    """Bodies, carriages, dampers and springs of one scene; modes of all bodies stand in one row, sprung masses after
    them."""

    study: Study
    bodies: tuple[BodyPart, ...]
    carriages: tuple[CarriageTie, ...]
    dampers: tuple[DamperTie, ...]
    springs: tuple[SpringTie, ...] = ()

    @property
    def ties(self) -> int:
        """Number of ties: carriages first, then dampers, then springs."""
        return len(self.carriages) + len(self.dampers) + len(self.springs)

    @property
    def body_modes(self) -> int:
        """Number of modes of all bodies."""
        return sum(part.modal.omega.size for part in self.bodies)

    @cached_property
    def omega(self) -> Array:
        """(N,) natural frequencies of all bodies, rad/s, and 0 for every sprung mass."""
        return np.concatenate([*(part.modal.omega for part in self.bodies), np.zeros(len(self.springs))])

    @cached_property
    def scheme(self) -> Scheme:
        """The time integration scheme of the study."""
        return self.study.solver.integration

    @property
    def leading_body(self) -> BodyPart:
        """The body of the first carriage, whose first period and length make ratios."""
        return self.bodies[self.carriages[0].body]

    @property
    def first_omega(self) -> float:
        """Lowest elastic natural frequency of the leading body, rad/s."""
        omega = self.leading_body.modal.omega
        return float(omega[omega > 0.0][0])

    @property
    def riders(self) -> tuple[Rider, ...]:
        """The ways of all carriages."""
        return tuple(carriage.rider for carriage in self.carriages)

    def spring_of(self, carriage: int) -> int | None:
        """Number of the spring tie of a carriage, counted among all ties; None where it has none."""
        first = len(self.carriages) + len(self.dampers)
        return next((r for r, spring in enumerate(self.springs, start=first) if spring.carriage == carriage), None)

    def reacts(self, carriage: int) -> bool:
        """Whether the contact force of a carriage depends on how its body moves."""
        return self.carriages[carriage].inertia != "force" or self.spring_of(carriage) is not None

    @property
    def fidelity(self) -> Fidelity:
        """The model that this scene marches: the fullest of its carriages'."""
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
    study: Study, paces: Mapping[str, float], delays: Mapping[str, float], swept: Collection[str] = ()
) -> SceneModel:
    """The model of a study without sweep.

    paces: per carriage, the first carriage's time scale over its own. delays: per carriage, in the first one's time
    scale. swept: keys of numbers that differ between the variants that share the model. Raises BadInput where the
    scene cannot be marched.
    """
    used = [name for name in study.body if _in_use(study, name)]
    parts: list[BodyPart] = []
    first = 0
    for name in used:
        part = _body_part(study, name, first)
        parts.append(part)
        first = part.modes.stop
    carriages = []
    for name, carriage in study.carriage.items():
        body = used.index(carriage.on)
        rider = Rider(carriage.motion, parts[body].modal.length, paces.get(name, 1.0), delays.get(name, 0.0))
        carriages.append(CarriageTie(name, body, rider, _inertia(study, name, swept)))
    dampers = [
        DamperTie(number, at, f"body.{name}.{key}")
        for number, name in enumerate(used)
        for key, at, coefficient in study.body[name].dampers()
        if coefficient > 0.0 or f"body.{name}.{key}" in swept
    ]
    springs = _springs(study, first, swept)
    model = SceneModel(study, tuple(parts), tuple(carriages), tuple(dampers), springs)
    _check_rigid_modes(model)
    _check_weights(model)
    return model


def check_moves(study: Study) -> None:
    """Refuse a study without a carriage. Raises BadInput."""
    if not study.carriage:
        where = study.source.where("carriage")
        raise BadInput("nothing moves", where=where, expected="at least one table [carriage.name]")


def _in_use(study: Study, body: str) -> bool:
    """Whether a body carries a carriage or a sensor."""
    ridden = any(carriage.on == body for carriage in study.carriage.values())
    return ridden or any(study.body_of(sensor) == body for sensor in study.sensor)


def _inertia(study: Study, name: str, swept: Collection[str]) -> Inertia:
    """The terms that act at a carriage's contact; fidelity "auto" is the carriage's own kind in full."""
    fidelity, carriage = study.solver.fidelity, study.carriage[name]
    if fidelity == "force" or not carriage.inertial:
        return "force"
    if _sprung(study, name):
        wheel = f"carriage.{name}.wheel_mass"
        return "mass" if study.value(wheel) > 0.0 or wheel in swept else "force"
    return "mass-without-convective" if fidelity == "mass-without-convective" else "mass"


def _sprung(study: Study, name: str) -> bool:
    """Whether a carriage's spring acts; below the full fidelity it is locked."""
    return isinstance(study.carriage[name], OscillatorCarriage) and study.solver.fidelity == "auto"


def _springs(study: Study, first: int, swept: Collection[str]) -> tuple[SpringTie, ...]:
    """The springs of all sprung masses, whose modes are counted from ``first``."""
    found: list[SpringTie] = []
    for number, name in enumerate(study.carriage):
        if _sprung(study, name):
            key = f"carriage.{name}.damping"
            found.append(SpringTie(number, first + len(found), study.value(key) > 0.0 or key in swept))
    return tuple(found)


def _body_part(study: Study, name: str, first: int) -> BodyPart:
    """A body of the study in modal coordinates, its modes counted from ``first``."""
    body = study.body[name]
    try:
        built = build_body(body)
    except BadInput as error:
        where = study.source.where(f"body.{name}.{error.where}")
        raise BadInput(
            error.what, where=where, expected=error.expected, received=error.received, remedy=error.remedy
        ) from None
    modes = slice(first, first + built.modal.omega.size)
    return BodyPart(name, built.modal, modes, built.second_moment, built.fibre_distance, body.own_weight)


def _check_weights(model: SceneModel) -> None:
    """The weight of a mass acts along w: its track must stand so, or there must be no gravity."""
    for carriage in model.carriages:
        share = model.bodies[carriage.body].modal.gravity_share
        if model.study.carriage[carriage.name].inertial and abs(share - 1.0) > 1e-9 and model.study.gravity != 0.0:
            raise BadInput(
                "the weight of this mass does not act in the direction of its track",
                where=model.study.source.where(f"carriage.{carriage.name}.kind"),
                expected="a track whose loads act along gravity",
                received=f"{share:.3g} of gravity along it",
                remedy='kind = "force", or gravity = 0',
            )


def _check_rigid_modes(model: SceneModel) -> None:
    """A body that nothing holds has no static equilibrium and no sag, and needs a mode that bends."""
    for part in model.bodies:
        where = model.study.source.where(f"body.{part.name}.supports")
        if part.modal.rigid_modes == len(part.modal.omega):
            raise BadInput(
                "only rigid-body modes are kept",
                where=model.study.source.where(f"body.{part.name}.modes"),
                expected=f"more than {part.modal.rigid_modes} modes",
            )
        if part.modal.rigid_modes and model.study.start == "equilibrium":
            raise BadInput(
                "nothing holds this body, so it has no static equilibrium to start from",
                where=where,
                expected="supports that hold it",
                remedy='hold the body, or set initial = "rest"',
            )
        if part.modal.rigid_modes and part.own_weight:
            raise BadInput("nothing holds this body against its own weight", where=where, remedy="own_weight = false")
