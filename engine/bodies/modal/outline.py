"""What a body looks like: lines and nodes in space with what every mode moves them by, supports, springs and masses.

Coordinates are the body's own, in m. A body without coordinates lies along x with gravity along -z.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from engine.bodies.modal.modal_body import ModalBody
from results_schema.arrays import Array

STATIONS = 61  # of a track that is drawn
DOWN = np.array([0.0, 0.0, -1.0])
ALONG = np.array([1.0, 0.0, 0.0])
HELD_AT = {"clamped": ("x", "y", "z", "rx", "ry", "rz"), "pinned": ("x", "y", "z")}


@dataclass(frozen=True, eq=False)
class Line:
    """points (P, 3), m, one after another; motion (P, 3, N): displacement of every mode there, kg^(-1/2)."""

    points: Array
    motion: Array


class Held(NamedTuple):
    """Directions ("x" ... "rz") in which a place (3,) is held; outward (3,): away from the body."""

    name: str
    place: Array
    ways: tuple[str, ...]
    outward: Array


class Elastic(NamedTuple):
    """Springs between a place (3,) and the ground, or another place: N/m along x, y, z and N m/rad about these.

    damped: whether there is a damper beside them.
    """

    name: str
    place: Array
    stiffness: tuple[float, float, float]
    rotational: tuple[float, float, float] = (0.0, 0.0, 0.0)
    damped: bool = False
    to: Array | None = None


class Lump(NamedTuple):
    """A rigid mass, kg, at a place (3,)."""

    name: str
    place: Array
    mass: float


@dataclass(frozen=True, eq=False)
class Outline:
    """A body in space.

    track (2, 3): its ends; down (3,): the direction of gravity; lines; cloud: nodes of a mesh; nodes: named
    places; counts: what it is made of, how many of each.
    """

    track: Array
    lines: tuple[Line, ...]
    down: Array = field(default_factory=lambda: DOWN)
    cloud: Line | None = None
    nodes: Mapping[str, Array] = field(default_factory=dict)
    held: tuple[Held, ...] = ()
    springs: tuple[Elastic, ...] = ()
    masses: tuple[Lump, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)

    @property
    def every_line(self) -> tuple[Line, ...]:
        """Its lines, and the nodes of its mesh."""
        return self.lines if self.cloud is None else (*self.lines, self.cloud)


def straight(modal: ModalBody) -> Outline:
    """A body of which its track alone is known."""
    s = np.linspace(0.0, modal.length, STATIONS)
    points = s[:, None] * ALONG
    return Outline(points[[0, -1]], (Line(points, DOWN[:, None] * modal.shape(s)[:, None, :]),))
