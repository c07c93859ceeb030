"""Bodies out of finite-element files as the user describes them: which files, where loads ride, what holds the body."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, Strict, ValidationInfo, model_validator

from engine.bodies.files.model import Counts, FileModel
from engine.bodies.files.reader import Request, read_files, role_of
from engine.bodies.files.track import NodeLine, line_as_told
from engine.bodies.frame.geometry import DIRECTIONS, across, unit
from engine.bodies.frame.refusals import Key, refuse
from engine.bodies.modal.description import Body, Spot, Spots, check_spot_name, check_square
from engine.bodies.modal.modal_body import Array, Direction, ModalBody
from engine.bodies.modal.outline import HELD_AT, Outline
from engine.bodies.modal.places import Place, Support, Vector, Way
from engine.study_file.spec import Spec, one_of
from engine.study_file.units import Damping, Force, Length, fault
from results_schema.errors import BadInput, shortened
from results_schema.quantities import OF_SECTION

MAX_POINTS = 50
MAX_TRACK = 1000
_ROUNDED = 1e-9  # part of a unit vector that is rounding
ALONG = 1e-3  # sine of the angle between track and load below which the load acts along the track
_GROUP = re.compile(r"\d{1,18}(-\d{1,18})?(,\d{1,18}(-\d{1,18})?)*")

FilePath = Annotated[str, Field(min_length=1, max_length=1000)]
NodeNumber = Annotated[int, Field(ge=1, lt=10**18)]
Rows = Annotated[tuple[Annotated[int, Field(ge=1)], ...], Strict(False), Field(min_length=1, max_length=64)]


RowsOfNodes = tuple[Rows, ...]
TrackRows = Annotated[RowsOfNodes, Strict(False), Field(min_length=2, max_length=MAX_TRACK)]


class NodeTrack(Spec):
    """Where loads ride: `nodes` in their order, or all nodes near the straight line `from` ... `to`.

    tolerance: m, how far they may stand beside a straight line (0.1 % of its length if not given). direction: in which
    loads act and deflection counts; along gravity unless given. interpolation: between nodes by their rotations
    ("rotations"), by a smooth curve through their displacements ("spline"), or by rotations where all have them.
    """

    model_config = ConfigDict(populate_by_name=True)

    nodes: Annotated[tuple[NodeNumber, ...], Strict(False), Field(min_length=2, max_length=MAX_TRACK)] | None = None
    start: Place | None = Field(default=None, alias="from")
    end: Place | None = Field(default=None, alias="to")
    tolerance: Length | None = Field(default=None, gt=0)
    direction: Way | None = None
    interpolation: Annotated[str, AfterValidator(one_of("auto", "rotations", "spline"))] = "auto"

    @model_validator(mode="after")
    def _one_way(self) -> NodeTrack:
        line = (self.start is None, self.end is None)
        if line != ((True, True) if self.nodes is not None else (False, False)):
            raise fault("a track is given in one way", expected="nodes = [...], or from = [x, y, z] and to = [x, y, z]")
        return self


class NodePoint(Spec):
    """A node off the track and a direction (along gravity unless given): for sensors, and shoes of other bodies.

    damping: N s/m of a damper to the ground there.
    """

    node: NodeNumber
    direction: Way | None = None
    damping: Damping = Field(default=0.0, ge=0)


class Imported(Body):
    """Base of bodies out of finite-element files. Paths are from the working folder.

    supports: directions held by node, or by nodes ("1-21", "3,7,9", "all"). length_unit, force_unit: those of the files
    in m and N. rigid_body_modes: "keep" or "drop" those of a body that nothing holds.
    """

    derived: ClassVar[tuple[str, ...]] = ("length",)
    names_files: ClassVar[bool] = True
    roles: ClassVar[tuple[str, ...]] = ()
    lacking: ClassVar[Literal["refused", "whole nodes held", "held"]] = "refused"  # what a node has no row for

    track: NodeTrack
    supports: dict[str, Support] = Field(default_factory=dict)
    point: dict[str, NodePoint] = Field(default_factory=dict, max_length=MAX_POINTS)
    gravity_direction: Vector = (0.0, 0.0, -1.0)
    length_unit: Length = Field(default=1.0, gt=0)
    force_unit: Force = Field(default=1.0, gt=0)
    rigid_body_modes: Annotated[str, AfterValidator(one_of("keep", "drop"))] = "keep"

    @property
    def modes_are_open(self) -> bool:
        return self.modes == "auto" and self.rigid_body_modes == "keep"

    @property
    @abstractmethod
    def request(self) -> Request:
        """What is to be read."""

    def dampers(self) -> list[tuple[str, float | str, float]]:
        return [(f"point.{name}.damping", f"point.{name}", point.damping) for name, point in self.point.items()]

    @property
    def files(self) -> Mapping[str, str]:
        """The files' paths by their keys."""
        return {role: str(getattr(self, role)) for role in self.roles if getattr(self, role) is not None}

    @cached_property
    def model(self) -> FileModel:
        """The files' matrices and nodes, in the files' units. Raises BadInput."""
        assert self.recorded is None, "what an archive holds is told without the files of its models"
        return read_files(self.request)

    @cached_property
    def line(self) -> NodeLine:
        """The track's nodes and places, m. Raises BadInput with the key within the track."""
        return line_as_told(self.model.nodes, self.model.places, self.told_track)

    @property
    def told_track(self) -> dict[str, Any]:
        """What the line of nodes follows from, in plain words."""
        told = self.track.model_dump(include={"nodes", "start", "end", "tolerance"})
        return told | {"length_unit": self.length_unit}

    @property
    def length(self) -> float:
        """Of the track, m."""
        return self.line.length if self.recorded is None else self.recorded.length

    @property
    def direction(self) -> tuple[float, float, float]:
        """The direction in which loads act on the track."""
        return self.gravity_direction if self.track.direction is None else self.track.direction

    def deflects_down(self, point: str | None = None) -> bool:
        way = self.direction if point is None else self.point[point].direction
        return way is None or bool(np.allclose(unit(way), unit(self.gravity_direction)))

    @property
    def untold(self) -> tuple[str, ...]:
        return tuple(word for word in OF_SECTION if word not in self.recovered)

    @property
    def recovered(self) -> Mapping[str, RowsOfNodes]:
        """Quantities that a recovery matrix tells: for each node of the track the rows whose mean it is."""
        return {}

    @cached_property
    def content(self) -> str:
        """SHA-256 of the files, with those that they include."""
        return self.model.digest

    @property
    def hashes(self) -> tuple[tuple[str, str], ...]:
        return self.model.hashes

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Imported:
        if self.take(info.context):
            return self
        for role, path in self.files.items():
            if "\0" in path or not Path(path).name:
                refuse((role,), "not a path of a file", received=shortened(path))
        files = self.files
        try:
            nodes = self.model.nodes
        except BadInput as error:
            what = f"{error.where}: {error.what}" if error.where else error.what
            key: Key = (role_of(error, files),)
            refuse(key, what, expected=error.expected, received=error.received, remedy=error.remedy)
        try:
            line = self.line
        except BadInput as error:
            key = ("track", *error.where.split("."))
            refuse(key, error.what, expected=error.expected, received=error.received, remedy=error.remedy)
        if np.linalg.norm(np.cross(line.tangent, unit(self.direction))) < ALONG:
            what, expected = "the load acts along the track", "a direction across the track"
            refuse(("track", "direction"), what, expected=expected)
        self._check_track_rows()
        for group in self.supports:
            self.group(group)
        for name, point in self.point.items():
            if point.node not in nodes:
                refuse(("point", name, "node"), "there is no such node", received=str(point.node))
        return self

    def check_spot(self, spot: Spot) -> None:
        if spot.support:
            super().check_spot(spot)
        if spot.member is not None:
            remedy = "node = its number, or at = metres along its track"
            raise BadInput("a body out of files has no members", where="member", expected="a node", remedy=remedy)
        check_spot_name("point", spot.point, self.point)
        if spot.node is None or self.recorded is not None:
            return
        if spot.node not in self.model.nodes:
            remedy = f"{spot.node} without quotes" * (str(spot.node) in map(str, self.model.nodes.tolist()))
            what, told = "there is no such node", self.model.numbered
            raise BadInput(what, where="node", expected=told, received=shortened(spot.node), remedy=remedy)
        place = int(np.flatnonzero(self.model.nodes == spot.node)[0])
        if not self._moves(place, unit(self.gravity_direction if spot.direction is None else spot.direction)):
            what = f"node {spot.node} does not move in this direction"
            raise BadInput(what, where="direction", expected="a direction that is not held", remedy="node elsewhere")

    def _moves(self, place: int, way: Array) -> bool:
        """Whether a node, by its place in the model's list, can move along a vector (3,)."""
        held = {word for text in self.supports if place in self.group(text) for word in self.holds(text)}
        free = [row >= 0 and not self.model.held[row] for row in self.model.rows_of(place)[:3]]
        return any(abs(way[axis]) > _ROUNDED and free[axis] and DIRECTIONS[axis] not in held for axis in range(3))

    def moves(self, direction: Direction) -> bool:
        if self.recorded is not None:
            return True
        tangent = self.line.tangent
        way = tangent if direction == "along" else across(tangent, unit(self.direction))
        return any(self._moves(int(node), way) for node in self.line.nodes)

    def check_inertia(self, direction: Direction) -> None:
        super().check_inertia(direction)
        if self.recorded is None:
            check_square(direction, self.line.tangent, unit(self.direction), unit(self.gravity_direction))

    def _check_track_rows(self) -> None:
        """The nodes of the track have rows in the direction of the loads, unless what they lack counts as held."""
        if self.lacking == "held":
            return
        model = self.model
        rows = set(zip(model.owner.tolist(), model.direction.tolist(), strict=True))
        known = set(model.owner.tolist())
        for node in self.line.nodes.tolist():
            if self.lacking == "whole nodes held" and node not in known:
                continue
            for way, part in enumerate(unit(self.direction).tolist()):
                if abs(part) > ALONG and (node, way) not in rows:
                    what = f"node {model.nodes[node]} of the track does not move along {DIRECTIONS[way]} in these files"
                    refuse(("track",), what, expected="nodes with degrees of freedom along the load")

    def group(self, text: str) -> Counts:
        """Places in the model's list of the nodes that a key of the supports names. Raises pydantic's errors."""
        nodes = self.model.nodes
        if text == "all":
            return np.arange(len(nodes))
        plain = text.replace(" ", "")
        if not _GROUP.fullmatch(plain):
            expected = 'a node\'s number, "1-21", "3,7,9" or "all"'
            refuse(("supports", text), "no nodes", expected=expected, received=shortened(text))
        found = np.zeros(len(nodes), dtype=np.bool_)
        for part in plain.split(","):
            low, _, high = part.partition("-")
            chosen = (nodes >= int(low)) & (nodes <= int(high or low))
            if not chosen.any():
                refuse(("supports", text), "there is no such node", expected=self.model.numbered, received=part)
            found |= chosen
        return np.flatnonzero(found)

    def holds(self, text: str) -> tuple[str, ...]:
        """The directions that an entry of the supports holds."""
        support = self.supports[text]
        return HELD_AT[support] if isinstance(support, str) else support

    def build(self) -> ModalBody:
        return self.read_at(())

    def outline(self, modal: ModalBody) -> Outline:
        from engine.bodies.imported.outline import imported_outline

        return imported_outline(self)

    def spot_place(self, spot: Spot) -> Array:
        node = spot.node if spot.point is None else self.point[spot.point].node
        return np.asarray(self.model.places[self.model.nodes == node][0] * self.length_unit)

    def read_at(self, spots: Spots) -> ModalBody:
        from engine.bodies.imported.body import imported_body

        return imported_body(self, spots)
