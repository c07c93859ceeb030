"""What a support of a frame carries: a node that is held, or stands on springs to ground.

A unit motion of the support along what is read, or a unit turn about it, bends the frame to a shape psi, and by Betti's
theorem the support carries psi(s) of a unit force at s: everything that it carries follows from psi and the model's
mass. Of a spring k, psi is the answer to the load k at its node. Where a frame is free to move, psi stands for inertia
relief.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from engine.bodies.frame.assembly import Assembly
from engine.bodies.frame.geometry import DIRECTIONS, unit
from engine.bodies.modal.modal_body import Array, Gauge

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame
    from engine.bodies.frame.gauges import Read
    from engine.bodies.modal.description import Spot


ROTATIONAL = {"stiffness": "rotational", "damping": "rotational_damping"}


@dataclass(frozen=True, eq=False)
class FrameSupport:
    """The support at a node of a frame, read in a direction, positive where it is pressed along that, or turned about
    it."""

    frame: Frame
    assembly: Assembly
    spot: Spot

    @property
    def _parts(self) -> Array:
        """(3,) of the direction."""
        return unit(self.frame.gravity if self.spot.direction is None else self.spot.direction)

    @property
    def _first(self) -> int:
        """Number of the node's first degree of freedom of those that are read."""
        return 6 * list(self.frame.node).index(str(self.spot.node)) + 3 * self.spot.turns

    @property
    def _words(self) -> Sequence[str]:
        """Names of the three."""
        return DIRECTIONS[3:] if self.spot.turns else DIRECTIONS[:3]

    @property
    def _ways(self) -> list[int]:
        """The axes in which it moves."""
        held = (*self.frame.still, *self.frame.holds(str(self.spot.node)))
        return [axis for axis in range(3) if self._words[axis] not in held]

    def _to_ground(self) -> list[str]:
        """Springs between the node and the ground."""
        return [name for name, s in self.frame.spring.items() if s.node == self.spot.node and s.to is None]

    @cached_property
    def held(self) -> Array:
        """(6 P,) what is read of the motion of the directions that are held."""
        found = np.zeros(6 * len(self.assembly.mesh.points))
        rigid = [axis for axis in range(3) if axis not in self._ways]
        found[[self._first + axis for axis in rigid]] = self._parts[rigid]
        return found

    def at_springs(self, key: Literal["stiffness", "damping"]) -> Array:
        """(6 P,) what its springs carry of every motion by their stiffness, N/m or N m/rad, or damping, N s/m or
        N m s/rad."""
        found = np.zeros_like(self.held)
        own = ROTATIONAL[key] if self.spot.turns else key
        for axis in self._ways:
            rates = [getattr(self.frame.spring[name], own)[axis] for name in self._to_ground()]
            found[self._first + axis] = sum(rates) * self._parts[axis]
        return found

    @property
    def dampers(self) -> dict[float | str, float]:
        """The part that it carries of the dampers beside its springs."""
        names = self._to_ground()
        return {f"spring.{name}.{self._words[axis]}": float(self._parts[axis]) for name in names for axis in self._ways}


def frame_support(read: Read, spot: Spot, points: tuple[dict[str, int], Array]) -> Gauge:
    """What a sensor reads of a support; points: names and loads (6 P, P) of the frame's points."""
    assembly, statics = read.assembly, read.statics
    support = FrameSupport(read.frame, assembly, spot)
    psi = _moved(read, support)
    carried = psi @ assembly.all_mass
    names, loads = points
    response = read.ends.of(psi[:, None]).reshape(-1)
    weight = float(carried @ np.tile(np.append(unit(read.frame.gravity), np.zeros(3)), len(assembly.mesh.points)))
    return Gauge(
        row=np.asarray(read.omega**2 * (carried[assembly.free] @ read.shapes)),
        along=partial(statics.under_response, response),
        points={name: float(psi @ loads[:, number]) for name, number in names.items()},
        rigid=statics.rigid,
        weight=weight,
        dampers=support.dampers,
        pushed=read.moved(response),
    )


def _moved(read: Read, support: FrameSupport) -> Array:
    """(6 P,) psi."""
    free, flexibility = read.assembly.free, read.flexibility
    pulled = support.at_springs("stiffness")[free] - (read.assembly.all_stiffness @ support.held)[free]
    relief = flexibility.rigid @ (flexibility.rigid.T @ (read.assembly.all_mass @ support.held)[free])
    return support.held + read.assembly.whole(flexibility.solve(pulled[:, None])[:, 0] - relief)
