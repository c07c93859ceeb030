"""A frame of beam elements as the user describes it: nodes and sections by name, members between them, a track.

Directions are those of the nodes' coordinates. A member's local axes: x from its first node to its second, z the part
of `up` square to x, y = z x x; `second_moment` is that of bending along z (as a beam's under its load), the
`..._lateral` one that of bending along y.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field, Strict, model_validator

from engine.bodies.frame.geometry import DIRECTIONS, SAME_PLACE, TrackLine, member_ends, unit
from engine.bodies.frame.refusals import check_frame, check_spot, track_line
from engine.bodies.modal.description import MAX_MODES, Body, Growing, Spot, Spots, check_square
from engine.bodies.modal.modal_body import Array, Direction, ModalBody
from engine.bodies.modal.outline import HELD_AT, Outline
from engine.bodies.modal.places import Coordinate, Place, Support, Vector, Way
from engine.bodies.modal.section_doubts import Doubt, section_doubts
from engine.study_file.spec import Several, Spec, Three, distinct, one_of
from engine.study_file.units import (
    Area,
    Damping,
    Density,
    Dimensionless,
    Inertia,
    Length,
    Mass,
    Pressure,
    RotationalDamping,
    RotationalStiffness,
    SecondMoment,
    Stiffness,
    fault,
)

MAX_ELEMENTS = 1000
MAX_POINTS = 50
MAX_FIXED_INTERFACE_MODES = 64
MATERIAL = "youngs_modulus", "density"
PLANES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}

_THEORIES = {"euler": "euler-bernoulli", "bernoulli": "euler-bernoulli"}
TheoryWord = Annotated[str, AfterValidator(one_of("euler-bernoulli", "timoshenko", meant=_THEORIES))]
MassWord = Annotated[str, AfterValidator(one_of("consistent", "lumped"))]
PlaneWord = Annotated[str, AfterValidator(one_of(*PLANES))]


Node = Annotated[Several[Coordinate], Field(min_length=2, max_length=3)]
Two = Annotated[tuple[str, str], Strict(False)]
Names = Annotated[Several[str], AfterValidator(distinct)]
Triple = tuple[float, float, float]
_ZERO = (0.0, 0.0, 0.0)


class Section(Spec):
    """A cross-section with its material; SI units. Shear areas are for Timoshenko members, fibre distances for stress.

    Give shear_modulus or poissons_ratio. In a plane frame only the section's bending in that plane counts.
    """

    area: Area = Field(gt=0)
    second_moment: SecondMoment = Field(gt=0)
    second_moment_lateral: SecondMoment | None = Field(default=None, gt=0)
    torsion_constant: SecondMoment | None = Field(default=None, gt=0)
    youngs_modulus: Pressure = Field(gt=0)
    shear_modulus: Pressure | None = Field(default=None, gt=0)
    poissons_ratio: Dimensionless | None = Field(default=None, gt=-1, lt=0.5)
    density: Density = Field(gt=0)
    shear_area: Area | None = Field(default=None, gt=0)
    shear_area_lateral: Area | None = Field(default=None, gt=0)
    fibre_distance: Length | None = Field(default=None, gt=0)
    fibre_distance_lateral: Length | None = Field(default=None, gt=0)

    @property
    def shear_stiffness(self) -> float | None:
        """G, Pa; None where it is not known."""
        if self.poissons_ratio is not None:
            return self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))
        return self.shear_modulus

    @model_validator(mode="after")
    def _one_shear_modulus(self) -> Section:
        if self.shear_modulus is not None and self.poissons_ratio is not None:
            raise fault("the shear modulus is given twice", expected="shear_modulus or poissons_ratio")
        return self


class Member(Spec):
    """A straight beam between two nodes. offsets: rigid arms (m) from each node to the end of its axis."""

    nodes: Two
    section: str
    elements: int = Field(default=8, ge=1, le=MAX_ELEMENTS)
    up: Vector | None = None
    theory: TheoryWord = "euler-bernoulli"
    offsets: Annotated[tuple[Place, Place], Strict(False)] = (_ZERO, _ZERO)


class PointMass(Spec):
    """A rigid mass (kg) at a node; offset (m) of its centre from it, inertia (kg m2) about that centre."""

    node: str
    mass: Mass = Field(gt=0)
    inertia: Three[Annotated[Inertia, Field(ge=0)]] = _ZERO
    offset: Place = _ZERO


class NodeSpring(Spec):
    """Springs and dampers in all directions at a node, to ground or `to` another node's rigid arm to this place."""

    node: str
    to: str | None = None
    stiffness: Three[Annotated[Stiffness, Field(ge=0)]] = _ZERO
    rotational: Three[Annotated[RotationalStiffness, Field(ge=0)]] = _ZERO
    damping: Three[Annotated[Damping, Field(ge=0)]] = _ZERO
    rotational_damping: Three[Annotated[RotationalDamping, Field(ge=0)]] = _ZERO


class Point(Spec):
    """A place off the track and a direction (along gravity unless given): for sensors, and shoes of other bodies.

    offset: m, from the node by a rigid arm.
    """

    node: str
    direction: Way | None = None
    offset: Place = _ZERO


class Track(Spec):
    """Where loads ride: members in order, one straight line, or a line beside it.

    offset: m, from the members' axis to the load, so that it twists them too. direction: in which the load acts and
    deflection counts; along gravity unless given.
    """

    members: Annotated[Names, Field(min_length=1)]
    offset: Place = _ZERO
    direction: Way | None = None


class Frame(Body):
    """A two- or three-dimensional frame. Loads ride on `track`; its length is the body's length.

    plane: a 2-D frame moves in that plane only. gravity_direction: downwards unless given. mass_matrix: "consistent"
    or "lumped". interface: nodes that Craig-Bampton reduction keeps, with fixed_interface_modes besides. leave_out:
    numbers of modes (from 1) that are not kept; rigid_body_modes: "keep" or "drop" those of a body that nothing holds.
    """

    derived: ClassVar[tuple[str, ...]] = ("length",)

    kind: Literal["frame"]
    plane: PlaneWord | None = None
    gravity_direction: Vector | None = None
    node: dict[str, Node] = Field(min_length=2)
    section: dict[str, Section] = Field(min_length=1)
    member: dict[str, Member] = Field(min_length=1)
    point_mass: dict[str, PointMass] = Field(default_factory=dict)
    spring: dict[str, NodeSpring] = Field(default_factory=dict, max_length=MAX_POINTS)
    point: dict[str, Point] = Field(default_factory=dict, max_length=MAX_POINTS)
    supports: dict[str, Support] = Field(default_factory=dict)
    track: Track
    mass_matrix: MassWord = "consistent"
    interface: Annotated[Names, Field(max_length=MAX_POINTS)] = ()
    fixed_interface_modes: int = Field(default=12, ge=0, le=MAX_FIXED_INTERFACE_MODES)
    leave_out: Several[Annotated[int, Field(ge=1)]] = ()
    rigid_body_modes: Annotated[str, AfterValidator(one_of("keep", "drop"))] = "keep"

    @model_validator(mode="after")
    def _consistent(self) -> Frame:
        check_frame(self)
        return self

    @cached_property
    def line(self) -> TrackLine:
        """The track as a line in space."""
        return track_line(self)

    @property
    def length(self) -> float:
        """Of the track, m."""
        return self.line.length

    @property
    def is_free(self) -> bool:
        return not (self.supports or self.spring)

    @property
    def grows_with(self) -> Growing:
        if self.spring or any(one.shear_modulus is not None for one in self.section.values()):
            return Growing()  # whose stiffness stays
        moduli, densities = (tuple(f"section.{name}.{key}" for name in self.section) for key in MATERIAL)
        return Growing((moduli,), () if self.point_mass else (densities,))

    @property
    def gravity(self) -> Triple:
        """The direction of gravity as it is given, else down: against the last axis."""
        if self.gravity_direction is not None:
            return self.gravity_direction
        last = PLANES[self.plane][1] if self.plane else 2
        return (0.0, -1.0, 0.0) if last == 1 else (0.0, 0.0, -1.0)

    @property
    def direction(self) -> Triple:
        """The direction in which loads act on the track."""
        return self.gravity if self.track.direction is None else self.track.direction

    @property
    def lever(self) -> float:
        return float(np.linalg.norm(self.track.offset))

    def deflects_down(self, point: str | None = None) -> bool:
        way = self.direction if point is None else self.point[point].direction
        return way is None or bool(np.allclose(unit(way), unit(self.gravity)))

    @property
    def lacks_for_stress(self) -> str:
        for name, _ in self.line.members:
            section = self.member[name].section
            if self.section[section].fibre_distance is None:
                return f"section.{section}.fibre_distance"
            if self.plane is None and self.section[section].fibre_distance_lateral is None:
                return f"section.{section}.fibre_distance_lateral"
        return ""

    @property
    def tells_supports(self) -> bool:
        return True

    def check_spot(self, spot: Spot) -> None:
        check_spot(self, spot)

    def moves(self, direction: Direction) -> bool:
        return direction != "across" or self.plane is None

    def check_inertia(self, direction: Direction) -> None:
        super().check_inertia(direction)
        check_square(direction, self.line.tangent, self.line.direction, unit(self.gravity))

    def place(self, node: str) -> Triple:
        """Coordinates of a node, m; in a plane frame two may be given."""
        given = self.node[node]
        if len(given) == 3:
            return (given[0], given[1], given[2])
        found = [0.0, 0.0, 0.0]
        for axis, value in zip(PLANES[str(self.plane)], given, strict=True):
            found[axis] = value
        return (found[0], found[1], found[2])

    def holds(self, node: str) -> Sequence[str]:
        """The directions in which a node is held."""
        support = self.supports.get(node, ())
        return HELD_AT[support] if isinstance(support, str) else support

    def stands(self, node: str) -> Sequence[str]:
        """The directions in which a node stays where it is: where it is held; of one at which no member ends, as of a
        tuned mass, also those in which no spring acts on it."""
        if any(node in member.nodes for member in self.member.values()):
            return self.holds(node)
        springs = [spring for spring in self.spring.values() if node in (spring.node, spring.to)]
        rates = [(*spring.stiffness, *spring.rotational) for spring in springs]
        idle = [way for way, own in zip(DIRECTIONS, zip(*rates, strict=True), strict=True) if not any(own)]
        return tuple(dict.fromkeys((*self.holds(node), *idle)))

    @property
    def track_ends(self) -> tuple[str, ...]:
        (first, first_turned), (last, last_turned) = self.line.members[0], self.line.members[-1]
        return self.member[first].nodes[int(first_turned)], self.member[last].nodes[int(not last_turned)]

    @property
    def is_one_span(self) -> bool:
        sprung = {one.node for one in self.spring.values() if one.to is None and any(one.stiffness)}
        held = sprung | {node for node in self.supports if set(self.holds(node)) & set(DIRECTIONS[:3])}
        name, turned = self.line.members[0]
        start = member_ends(self, name)[1 if turned else 0]
        along = [(np.array(self.place(node)) - start) @ self.line.tangent / self.length for node in held]
        return not any(SAME_PLACE < part < 1.0 - SAME_PLACE for part in along)

    @property
    def still(self) -> tuple[str, ...]:
        """The directions in which no node moves, as the frame is plane."""
        if self.plane is None:
            return ()
        (across,) = {0, 1, 2} - set(PLANES[self.plane])
        return (DIRECTIONS[across], *(f"r{DIRECTIONS[axis]}" for axis in PLANES[self.plane]))

    @property
    def is_meshed(self) -> bool:
        return True

    @property
    def modes_are_open(self) -> bool:
        return self.modes == "auto" and not (self.interface or self.leave_out)

    @property
    def modes_within(self) -> str:
        return "fixed_interface_modes" if self.interface else ""

    def with_more_modes(self, times: int) -> Frame:
        """The same body with so many times its modes, not reduced: twice as many modes within a fixed interface may
        change little, and all the others much."""
        if not self.interface:
            return super().with_more_modes(times)
        return self._not_reduced.with_modes(times * self._count)

    @property
    def _not_reduced(self) -> Frame:
        return self.model_copy(update={"interface": ()})

    @property
    def _count(self) -> int:
        """How many modes it keeps at most of its reduction."""
        whole = min(6 * len(self.interface) + self.fixed_interface_modes, MAX_MODES)
        return whole if self.modes == "auto" else int(self.modes)

    def with_more_elements(self, times: int) -> Frame:
        cut = {name: one.model_copy(update={"elements": times * one.elements}) for name, one in self.member.items()}
        return self.model_copy(update={"member": cut})

    def finer(self) -> Frame:
        """With twice the elements too, and not reduced."""
        more = self._not_reduced.model_copy(update={"modes": 2 * self._count})
        return (more if self.interface else super().finer()).with_more_elements(2)

    def outline(self, modal: ModalBody) -> Outline:
        from engine.bodies.frame.outline import frame_outline

        return frame_outline(self)

    def spot_place(self, spot: Spot) -> Array:
        if spot.member is not None:
            first, last = member_ends(self, spot.member)
            return np.asarray(first + spot.at * unit(last - first))
        if spot.point is None:
            return np.array(self.place(str(spot.node)))
        point = self.point[spot.point]
        return np.asarray(np.array(self.place(point.node)) + point.offset)

    @property
    def whole(self) -> Frame:
        return self

    def build(self) -> ModalBody:
        return self.read_at(())

    def read_at(self, spots: Spots) -> ModalBody:
        from engine.bodies.frame.body import frame_body

        return frame_body(self, spots)

    def dampers(self) -> list[tuple[str, float | str, float]]:
        found: list[tuple[str, float | str, float]] = []
        for name, spring in self.spring.items():
            for key, words in (("damping", DIRECTIONS[:3]), ("rotational_damping", DIRECTIONS[3:])):
                rates = zip(words, getattr(spring, key), strict=True)
                found += [(f"spring.{name}.{key}.{i}", f"spring.{name}.{w}", c) for i, (w, c) in enumerate(rates)]
        return found

    def doubts(self, here: str) -> list[Doubt]:
        keys, found = ("fibre_distance", "fibre_distance_lateral"), list[Doubt]()
        for name, section in self.section.items():
            fibres = [key for key in keys if getattr(section, key) is not None]
            found += section_doubts(f"{here}.section.{name}", f"{here}.length", *fibres)
        return found
