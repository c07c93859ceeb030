"""What the time march knows of a body: its modes, its statics and its dampers, never its mesh."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from results_schema.errors import BadInput

Array = NDArray[np.float64]

# an end whose modes all move by less than this part of the largest at some places along the track does not move
HELD, PROBED = 1e-9, 9
TRACK_PLACES = 257  # along the track, at which the mobility is looked for: four in a wave of 64 modes
# of the length, within which supports are one: a lever this short resists no rotation that a beam could feel
SAME_PLACE = 1e-9


#: In which a contact pushes on its track and feels it move: as its loads act, along it, or across both.
Side = Literal["along", "across"]
Direction = Literal["load"] | Side


class Shapes(Protocol):
    """Mode shapes along the track of a body."""

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j phi_k / ds^j at the stations `s` (S,) for several j, as (orders, S, N); unit modal mass."""


class Statics(Protocol):
    """Static flexibility of a body along its track (elastic part only, see `ModalBody.influence`)."""

    def influence_at(self, x: ArrayLike, s: ArrayLike, derivative: int) -> Array:
        """d^j/dx^j of the deflection at `x` per unit force at `s`, for pairs that are broadcast against each other."""

    def own_weight_deflection(self, x: ArrayLike, derivative: int) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) under the body's own weight, per unit gravity."""


class SideMotion(Protocol):
    """Motion of a track along itself, or across it and its loads, and what unit forces in that direction do.

    wave_number (N,): as of `ModalBody`.
    """

    @property
    def wave_number(self) -> Array: ...

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j psi_k / ds^j at the stations `s` (S,) for several j up to 2, as (orders, S, N); unit modal mass."""

    def influence_at(self, direction: Direction, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the motion in a direction at `x` per unit force in its own at `s`, m^(1-j)/N, for pairs that are
        broadcast against each other."""

    def own_weight_motion(self, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the motion at `x` (X,) under the body's own weight, per unit gravity. Raises BadInput for a body
        that nothing holds."""

    def section_at(self, quantity: str, x: ArrayLike, s: ArrayLike) -> Array:
        """A section force, stress or strain at `x` per unit force at `s`, likewise."""

    def of_point(self, name: str, s: ArrayLike) -> Array:
        """(S,) motion of a point per unit force at `s`, m/N."""


class Sections(Protocol):
    """Section forces, stress and strain along the track; quantities as those of sensors."""

    def rows(self, quantity: str, s: ArrayLike) -> Array:
        """A quantity of every mode at the stations `s` (S,), as (S, N)."""

    def influence_at(self, quantity: str, x: ArrayLike, s: ArrayLike) -> Array:
        """The quantity at `x` per unit force at `s`, for pairs that are broadcast against each other."""

    def own_weight(self, quantity: str, x: ArrayLike) -> Array:
        """The quantity at `x` (X,) under the body's own weight, per unit gravity."""

    def under_response(self, quantity: str, response: Array, x: ArrayLike) -> Array:
        """The quantity at `x` (X,) by a response of the body, see `Points`."""


class Responding(Protocol):
    """Statics of a model whose track follows from the motions of some of its points."""

    def under_response(self, response: Array, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) where those points move by `response`."""


@dataclass(frozen=True, eq=False)
class Points:
    """Points of a body off its track, by name: where shoes, sensors and dampers stand.

    A point is one number of the body's motion, v = r . u; a unit force there is the load r, so that one static solution
    tells what it does to the track and what a load on the track does to it (Maxwell). shapes (P, N), kg^(-1/2);
    flexibility (P, P), m/N; response, section_response (..., P) to a unit force at each point, as statics and sections
    take them; weight (P,): motion under own weight per unit gravity; rigid: number of rigid-body modes.
    """

    numbers: Mapping[str, int]
    shapes: Array
    flexibility: Array
    response: Array
    section_response: Array
    weight: Array
    rigid: int
    statics: Responding
    sections: Sections

    def row(self, name: str) -> Array:
        """(N,) what every mode moves a point by."""
        return np.asarray(self.shapes[self.numbers[name]])

    def influence(self, name: str, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) of the track per unit force at a point; and the other way round."""
        return self.statics.under_response(self.response[:, self.numbers[name]], x, derivative)

    def section_influence(self, quantity: str, name: str, x: ArrayLike) -> Array:
        """A section force, stress or strain at `x` (X,) of the track per unit force at a point."""
        return self.sections.under_response(quantity, self.section_response[:, self.numbers[name]], x)

    def between(self, name: str, other: str) -> float:
        """Motion of a point per unit force at another one, m/N."""
        return float(self.flexibility[self.numbers[name], self.numbers[other]])


def frozen(values: Array) -> Array:
    """The array, which nobody can change from now on."""
    values.flags.writeable = False
    return values


def refuse_loose(rigid: int) -> None:
    """Raise BadInput for a body with rigid-body modes, which no static state can carry."""
    if rigid:
        raise BadInput(
            "own weight of a body that is free to move as a rigid one",
            where="supports",
            expected="supports that hold the body",
            received=f"{rigid} rigid-body mode(s)",
            remedy="pin it at two places, clamp it, or set it on two springs",
        )


@dataclass(frozen=True, eq=False)
class Gauge:
    """A place that a sensor reads in one direction, or what a support carries: N in place of m.

    row (N,): what every mode moves it by, kg^(-1/2); along: its motion per unit force at places (S,) of the track, m/N;
    points: the same at points, by name; weight: its motion under the body's own weight per unit gravity; rigid: number
    of rigid-body modes; dampers: by the places of those at a support, the part of their force that it carries too;
    pushed: as `along`, per unit force in the other directions in which the track moves.
    """

    row: Array
    along: Callable[[Array], Array]
    points: Mapping[str, float]
    rigid: int
    weight: float
    dampers: Mapping[float | str, float] = field(default_factory=dict)
    pushed: Mapping[Direction, Callable[[Array], Array]] = field(default_factory=dict)

    def influence(self, loaded: Array | str, direction: Direction) -> Array:
        """Its motion per unit force at places (S,) of the track in a direction, or at a point (1,); m/N."""
        if isinstance(loaded, str):
            return np.array([self.points[loaded]])
        return self.along(loaded) if direction == "load" else self.pushed[direction](loaded)

    def own_weight(self) -> float:
        """Its motion under own weight per unit gravity. Raises BadInput for a body that nothing holds."""
        refuse_loose(self.rigid)
        return self.weight


def gauge_at(body: ModalBody, name: str) -> Gauge:
    """A sensor at a point of a body that has such."""
    assert body.points is not None
    points = body.points
    between = {other: points.between(name, other) for other in points.numbers}
    weight = float(points.weight[points.numbers[name]])
    pushed = {direction: partial(motion.of_point, name) for direction, motion in body.sides.items()}
    return Gauge(points.row(name), partial(points.influence, name), between, points.rigid, weight, pushed=pushed)


@dataclass(frozen=True, eq=False)
class ModalBody:
    """A body in modal coordinates with unit modal mass; SI units, w positive along gravity.

    length              of the track, m
    mass                of the whole body, kg
    omega               (N,) rad/s, ascending; exactly 0.0 for rigid-body modes
    participation       (N,) integral of phi_k over the body's mass, kg^(1/2): the modal force of its own
                        weight is gravity times this
    wave_number         (N,) 1/m, of each mode (N pi/L for a pinned beam), for the alias rule of moving loads
    bending_stiffness   E I, N m^2: moment = -E I w'' (positive when it sags), shear = dM/ds = -E I w'''; NaN where
                        it varies along the track
    second_moment       m4, fibre_distance m: of a uniform beam; NaN where there is none
    dampers             (at, coefficient) pairs, m and N s/m: discrete dampers, which become ties to ground
    shapes, statics     where the functions of place come from
    gravity_share       of gravity along w: 1, or the cosine between gravity and the track's direction of loads
    points              places off the track; None: there are none
    gauges              places that sensors read off the track, by the sensors' names
    sides               motions of the track in other directions than its loads', and what forces in these do
    joints              inner places of the track, m, at which section forces jump or bend: supports, ends of members
    sections            section forces of bodies whose track is not one uniform beam; None: -E I w'' and its derivative
    checks              what a body out of foreign files was checked for, and what was found, in words
    doubts              what of these is likely a mistake, in words
    unknown_weight      why nobody knows what it weighs, in words
    """

    length: float
    mass: float
    omega: Array
    participation: Array
    wave_number: Array
    bending_stiffness: float
    dampers: tuple[tuple[float, float], ...]
    shapes: Shapes
    statics: Statics
    gravity_share: float = 1.0
    second_moment: float = np.nan
    fibre_distance: float = np.nan
    joints: tuple[float, ...] = ()
    sections: Sections | None = None
    points: Points | None = None
    gauges: Mapping[str, Gauge] = field(default_factory=dict)
    sides: Mapping[Direction, SideMotion] = field(default_factory=dict)
    checks: tuple[tuple[str, str], ...] = ()
    doubts: tuple[str, ...] = ()
    unknown_weight: str = ""
    _fixed: dict[tuple[float, int], Array] = field(default_factory=dict, init=False, repr=False)

    @property
    def rigid_modes(self) -> int:
        """Number of modes without stiffness (they come first)."""
        return int(np.count_nonzero(self.omega == 0.0))

    def shape(self, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j phi_k / ds^j, j = 0..3, at the stations `s` (S,) inside [0, length]; (S, N), kg^(-1/2) m^(-j).

        Where a derivative jumps (at a spring) it is the limit from the right, at `length` from the left.
        A row does not depend, bit for bit, on which other stations are asked for.
        Raises BadInput for a station off the body or another derivative.
        """
        return np.asarray(self.shapes.derivatives(s, (derivative,))[0])

    def shape_derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """Several derivatives j of `shape` in one pass, which takes hardly longer than one, as (orders, S, N)."""
        return self.shapes.derivatives(s, orders)

    def influence(self, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the static deflection at `x` (X,) per unit force at `s` (S,); (X, S), m^(1-j)/N.

        The sum of phi_k(x) phi_k(s)/omega_k^2 over *all* elastic modes. For a body with rigid-body modes this
        is the inertia relief: the force is balanced by the body's rigid acceleration and the result is
        orthogonal to the rigid-body modes. Jumps and errors as in `shape`.
        """
        place, load = np.broadcast_arrays(np.atleast_1d(x)[:, None], np.atleast_1d(s))
        return self.statics.influence_at(place, load, derivative)

    def influence_at(self, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """`influence` for pairs of places, broadcast against each other (sensors under a carriage: x = s)."""
        return self.statics.influence_at(x, s, derivative)

    @cached_property
    def modal_flexibility(self) -> Array:
        """(N,) 1/omega^2, the static answer to a modal force, kg-normalised; 0 for rigid-body modes."""
        return np.divide(1.0, self.omega**2, out=np.zeros_like(self.omega), where=self.omega > 0.0)

    def shape_at(self, place: float, derivative: int = 0) -> Array:
        """(1, N) `shape` at one place, evaluated once: sensors and dampers ask for theirs again and again."""
        found = self._fixed.get((place, derivative))
        if found is None:
            found = self._fixed[place, derivative] = self.shape([place], derivative)
        return found

    @cached_property
    def mobility(self) -> float:
        """The largest sum of squared mode shapes anywhere along the track, 1/kg."""
        places = np.linspace(0.0, self.length, TRACK_PLACES)
        return float(np.max(np.sum(self.shape(places) ** 2, axis=1)))

    @cached_property
    def held_ends(self) -> tuple[bool, bool]:
        """Whether the ends of the track, at 0 and at the length, are held along the load."""
        sizes = np.abs(self.shape(np.linspace(0.0, self.length, PROBED))).max(axis=1)
        left, right = sizes[[0, -1]] <= HELD * sizes.max()
        return bool(left), bool(right)

    def shapes_in(self, direction: Direction) -> Shapes | SideMotion:
        """What its modes move its track by in a direction."""
        return self.shapes if direction == "load" else self.sides[direction]

    def flexibility_between(
        self, one: Array | str, other: Array | str, directions: tuple[Direction, Direction] = ("load", "load")
    ) -> Array:
        """Motion of one place in its direction per unit force at another one in its own, m/N: places (S,) of the track,
        broadcast against each other, or a point's name."""
        if not isinstance(one, str) and not isinstance(other, str):
            if directions == ("load", "load"):
                return self.influence_at(one, other)
            if directions[1] == "load":
                return self.sides[directions[0]].influence_at("load", other, one)
            return self.sides[directions[1]].influence_at(directions[0], one, other)
        assert self.points is not None
        if isinstance(one, str) and isinstance(other, str):
            return np.array([self.points.between(one, other)])
        name, track = (one, other) if isinstance(one, str) else (other, one)
        return self.points.influence(str(name), np.asarray(track))

    def own_weight_deflection(self, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) under own weight, per unit gravity; m^(1-j) / (m/s^2).

        Raises BadInput for a body with rigid-body modes, which no static state can carry.
        """
        return self.statics.own_weight_deflection(x, derivative)
