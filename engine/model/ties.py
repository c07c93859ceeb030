"""What couples a scene: carriages, discrete dampers and springs, and where each of them takes hold of a body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import Direction, ModalBody
    from engine.model.rider import Rider
    from engine.scene.variants import SpringKeys


Inertia = Literal["force", "mass", "mass-without-convective"]


@dataclass(frozen=True)
class Attachment:
    """A place where a tie acts on a body with ``factor`` times its force: where a rider is (its number), in a direction
    there, or a fixed place of the body's track (m) or a point of it (by name)."""

    factor: float
    body: int
    rider: int | None = None
    at: float | str = 0.0
    direction: Direction = "load"

    @property
    def unit(self) -> Attachment:
        """The same place with the factor 1."""
        return replace(self, factor=1.0)

    def fixed_row(self, modal: ModalBody) -> Array:
        """(N,) what every mode of its body moves a fixed place by."""
        if isinstance(self.at, str):
            assert modal.points is not None
            return modal.points.row(self.at)
        return np.asarray(modal.shape_at(self.at)[0])


class Load(NamedTuple):
    """A part of a carriage's weight on level ground: the number of the rider that carries it, and of its body."""

    rider: int
    share: float
    body: int


@dataclass(frozen=True, eq=False)
class CarriageTie:
    """A carriage as the march sees it: the number of the body along which it moves, its way, and which inertia terms
    act at its contact.

    loads: what carries its weight on level ground: itself but for a body on its contacts.
    rides: number of the body that rides, with the place of its own track that the motion moves (m).
    pulse: what its force swings in time by, a name that it shares with those that swing in step with it; "" of others.
    """

    name: str
    body: int
    rider: Rider
    inertia: Inertia
    loads: tuple[Load, ...]
    rides: int | None = None
    reference: float = 0.0
    pulse: str = ""

    @property
    def pulsates(self) -> bool:
        """Whether its force swings in time."""
        return bool(self.pulse)

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Where its weight acts."""
        return tuple(Attachment(load.share, load.body, load.rider) for load in self.loads)


@dataclass(frozen=True, eq=False)
class SpringTie:
    """The spring and damper between a body and a sprung mass, or a contact of a body that rides on it.

    What rides counts from where its springs carry it on level rigid ground, so the tie's force is what the spring has
    beyond that, which stays with the carriage; off the body it stands on such ground.

    carriage, rider: numbers. body: that of the body which it stands on. keys: of its numbers in the study.
    held: where it holds the body that rides; None for a sprung mass, whose mode is ``mode``. damped: whether there is a
    damper. rigid: whether it is a rigid joint instead. varies: whether lanes have stiffnesses of their own.
    """

    carriage: int
    rider: int
    body: int
    keys: SpringKeys
    held: Attachment | None
    mode: int | None
    damped: bool
    rigid: bool = False
    varies: bool = False

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Where its force acts, what it stands on first."""
        below = Attachment(1.0, self.body, self.rider)
        return (below,) if self.held is None else (below, self.held)


@dataclass(frozen=True, eq=False)
class DamperTie:
    """A damper at a place of a body's track (m) or a point of it (by name): force -c w', c N s/m at its key."""

    body: int
    at: float | str
    key: str

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Where its force acts."""
        return (Attachment(1.0, self.body, None, self.at),)


@dataclass(frozen=True, eq=False)
class PushTie:
    """The inertia of a carriage (its number) along the track of a body, or across that and its loads:
    F = -m (s'' + D2 u), u the track's motion in that direction, and s'' along it alone.

    What the motion prescribes, s'', is m per step squared for every lane alike: the rate at which a coordinate that
    stays 1 enters the tie's kinematics. convected: whether D2 has its convective terms.
    """

    carriage: int
    body: int
    direction: Direction
    convected: bool

    @property
    def prescribed(self) -> bool:
        """Whether the motion of its carriage is in its direction."""
        return self.direction == "along"

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Where its force acts."""
        return (Attachment(1.0, self.body, self.carriage, direction=self.direction),)
