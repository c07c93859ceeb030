"""Lines and directions of frames: plain vectors in metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame


ROUNDING = 1e-15  # of a length
PARALLEL = 1e-6  # sine of the angle below which two directions are one
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")  # of a node's degrees of freedom
SAME_PLACE = 1e-9  # distance over length below which two points are one


@dataclass(frozen=True, eq=False)
class TrackLine:
    """Members in the order in which the track passes them.

    members: (name, whether it runs from its second node to its first); tangent (3,); places (n + 1,): m, the members'
    ends along the track; direction (3,): unit vector of the load.
    """

    members: tuple[tuple[str, bool], ...]
    tangent: Array
    places: Array
    direction: Array

    @property
    def length(self) -> float:
        """Of the track, m."""
        return as_meant(float(self.places[-1]))


def as_meant(length: float) -> float:
    """A length made of coordinates, without their rounding: a sensor at 2 m is on a track from 0.3 m to 2.3 m.

    >>> 2.3 - 0.3, as_meant(2.3 - 0.3)
    (1.9999999999999998, 2.0)
    """
    round_one = float(f"{length:.12g}")
    return round_one if abs(round_one - length) <= ROUNDING * length else length


def unit(vector: ArrayLike) -> Array:
    """The vector scaled to length 1."""
    found = np.asarray(vector, dtype=np.float64)
    found = found / np.abs(found).max()
    return np.asarray(found / np.linalg.norm(found))


def across(tangent: Array, load: Array) -> Array:
    """(3,) unit vector across a track and its loads: with them along x and z, this is y."""
    return unit(np.cross(load, tangent))


def local_axes(along: ArrayLike, up: ArrayLike) -> Array:
    """(3, 3) rows x, y, z: x along the member, z the part of `up` square to it.

    >>> local_axes([2.0, 0.0, 0.0], [1.0, 0.0, 3.0])
    array([[1., 0., 0.],
           [0., 1., 0.],
           [0., 0., 1.]])
    """
    x = unit(along)
    z = np.asarray(up, dtype=np.float64)
    z = unit(z - (z @ x) * x)
    return np.array([x, np.cross(z, x) + 0.0, z])


def parallel(one: ArrayLike, other: ArrayLike) -> bool:
    """Whether two directions are the same or opposite."""
    return bool(np.linalg.norm(np.cross(unit(one), unit(other))) < PARALLEL)


def member_ends(frame: Frame, name: str) -> Array:
    """(2, 3) ends of a member's axis, its rigid arms included, m."""
    member = frame.member[name]
    found: Array = np.array([frame.place(node) for node in member.nodes]) + np.array(member.offsets)
    return found


def up_of(frame: Frame, name: str) -> Array | None:
    """The direction that orients a member's section; None where a member along gravity has none."""
    member = frame.member[name]
    along: Array = np.diff(member_ends(frame, name), axis=0)[0]
    if frame.plane is not None:  # bending in the plane is that of `second_moment`
        across = np.zeros(3)
        across["xyz".index(frame.still[0])] = 1.0
        up: Array = np.cross(along, across)
        return up
    if member.up is not None:
        return np.array(member.up)
    against = -np.array(frame.gravity)
    return None if parallel(along, against) else against


def member_axes(frame: Frame, name: str) -> Array:
    """(3, 3) local axes of a member, as rows."""
    up = up_of(frame, name)
    assert up is not None  # checked
    return local_axes(np.diff(member_ends(frame, name), axis=0)[0], up)
