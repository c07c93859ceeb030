"""Where the things of a scene stand in space: x and y level, z upward, in m.

Frames and bodies out of files stand where their coordinates say, beams along x. What rides stands over its contacts, a
little above the tracks so that these can be seen; further bodies under it stand below their contacts. Bodies in frames
that move stand as they do at time 0, undeformed, and so do robots.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from engine.bodies.modal.description import Spot
from engine.bodies.modal.outline import Outline
from engine.model.scene_model import BodyPart, SceneModel
from engine.model.station_path import in_row
from engine.scene.carriages import Carriage, Contact
from engine.scene.frames import GROUND
from engine.scene.motions.base import Motion
from engine.scene.robots import Arm, Robot
from engine.scene.sensors import Sensor
from engine.scene.study import Study
from results_schema.arrays import Array

GAP = 0.06  # of the scene's size, between a track and what rides on it
UP = np.array([0.0, 0.0, 1.0])
TURNED_UP = np.diag([1.0, -1.0, -1.0])  # from axes of which z is down, as of frames that move
SAME = 1e-9
ARROWS = 5  # of a load along a body
FAR = 3.0  # lengths of a track beside it
SEEN = 1.0  # lengths of its body beside it at which axles of a train are shown


@dataclass(frozen=True, eq=False)
class Placed:
    """A body in the scene: turn (3, 3) and shift (3,) take its own coordinates there."""

    part: BodyPart
    outline: Outline
    turn: Array
    shift: Array

    def at(self, points: Array) -> Array:
        """Places (..., 3) in the scene."""
        return np.asarray(points @ self.turn.T + self.shift)

    def along(self, s: float | Array) -> Array:
        """Places (..., 3) at s on the track, or before and behind it."""
        start, end = self.outline.track
        return self.at(start + np.asarray(s)[..., None] * (end - start) / self.part.modal.length)

    @property
    def forward(self) -> Array:
        """(3,) level unit vector along the track."""
        return _level(self.turn @ np.diff(self.outline.track, axis=0)[0])

    @property
    def axes(self) -> Array:
        """(3, 3) along its track, across, and the way it bends under loads, as columns."""
        return self.turn @ _own_axes(self.outline)


class Standing(NamedTuple):
    """A contact: its name, where it stands on a track and where it holds what rides, (3,)."""

    name: str
    below: Array
    above: Array
    contact: Contact


@dataclass(frozen=True, eq=False)
class Layout:
    """A scene in space; positions: of the carriages shown, m along their tracks; contacts: of those with a body."""

    model: SceneModel
    bodies: Mapping[str, Placed]
    positions: Mapping[str, float]
    contacts: Mapping[str, tuple[Standing, ...]]

    def touched(self, carriage: str) -> Array:
        """(3,) where a carriage stands."""
        return self.bodies[self.model.study.carriage[carriage].on].along(self.positions[carriage])

    def read(self, sensor: Sensor) -> Array | None:
        """(3,) where a sensor reads; None where that is unknown, or not shown."""
        if sensor.rides is not None:
            if sensor.rides not in self.positions:
                return None
            at_contact = [c.below for c in self.contacts.get(sensor.rides, ()) if c.name == sensor.contact]
            return at_contact[0] if at_contact else self.touched(sensor.rides)
        body = self.bodies[str(sensor.body)]
        if sensor.spot is None:
            return body.along(float(sensor.at or 0.0))
        place = self.model.study.body[str(sensor.body)].spot_place(sensor.spot)
        return None if place is None else body.at(place)

    @property
    def points(self) -> Array:
        """(P, 3) all of its bodies, and what is fixed to them."""
        found = [body.at(points) for body in self.bodies.values() for points in _points(body.outline)]
        return np.concatenate([*found, *self.robots.values(), *self.springs.values()])

    def held(self, body: str, at: float | None) -> Array:
        """(3,) a place on a track, its end if none is given."""
        found = self.bodies[body]
        return found.along(found.part.modal.length if at is None else at)

    def loaded(self, name: str) -> Array:
        """(P, 3) the place of a load, or some of those along a body."""
        load = self.model.study.load[name]
        if load.between is None:
            return self.held(load.on, load.at)[None]
        return self.bodies[load.on].along(np.linspace(*load.between, ARROWS))

    @property
    def springs(self) -> dict[str, Array]:
        """(2, 3) both ends of the springs between bodies in frames that move."""
        found = {}
        for name, spring in self.model.study.spring.items():
            ends = [
                self.held(end.on, end.at) if end.position is None else TURNED_UP @ np.array(end.position)
                for end in spring.ends
            ]
            found[name] = np.array(ends)
        return found

    @property
    def robots(self) -> dict[str, Array]:
        """(K, 3) of every robot its base point, its joints and its tool, at time 0."""
        study = self.model.study
        return {name: self._robot(robot, study.arm[robot.arm]) for name, robot in study.robot.items()}

    def feet(self, robot: str) -> list[Array]:
        """(3,) where a robot stands on each of its rails, at time 0."""
        of = self.model.study.robot[robot]
        first = float(self.bodies[of.rails[0]].along(of.start[0])[0])
        return [self.bodies[name].along(first - float(self.bodies[name].along(0.0)[0])) for name in of.rails]

    def _robot(self, robot: Robot, arm: Arm) -> Array:
        starts = np.array([self.bodies[name].along(0.0) for name in robot.rails])
        place, turn = starts.mean(axis=0) + robot.offset, np.eye(3)
        place[0] = starts[0, 0] + robot.offset[0] + robot.start[0]
        found = [place]
        for link, value in zip(arm.links, robot.start[1:], strict=True):
            place, turn = place + turn @ link.place, turn @ _turned(link.turned)
            axis = np.array(link.axis) / np.linalg.norm(link.axis)
            place = place + turn @ axis * value * link.slides
            turn = turn @ _turned(axis * value * (not link.slides))
            found.append(place)
        return np.array([*found, place + turn @ arm.tool])


def _points(outline: Outline) -> list[Array]:
    return [outline.track, *(line.points for line in outline.every_line)]


def starts(model: SceneModel) -> dict[str, float]:
    """Where every carriage starts, m."""
    return {tie.name: float(tie.rider.motion.path(0.0).S) for tie in model.carriages}


def in_a_row(model: SceneModel) -> dict[str, float]:
    """The same, but what passes and sets off later stands behind by as much as it trails, unless that is far. With a
    train, what passes stands as the first one has come onto its body; axles that are far off theirs are left out."""
    found, instant = starts(model), _instant(model)
    row, off = dict(found), dict[str, float]()
    for tie in model.carriages:
        carriage, length = model.study.carriage[tie.name], model.bodies[tie.body].modal.length
        if carriage.motion.passes:
            start, end = _ends(carriage.motion)
            row[tie.name] += float(np.sign(end - start)) * _speed(carriage.motion) * (instant - carriage.start_time)
        off[tie.name] = max(-row[tie.name], row[tie.name] - length) / length
    others = found.keys() - model.study.axles.keys()
    if any(off[name] > FAR for name in others):
        row |= {name: found[name] for name in others}
    return _seen(model, row)


def with_first_at(model: SceneModel, place: float) -> dict[str, float]:
    """Where carriages stand while the first is at a place, m: the other axles of its train behind it as everywhere,
    all others where they start."""
    return _seen(model, {tie.name: float(in_row(model, tie.name, np.array([place]))[0]) for tie in model.carriages})


def _seen(model: SceneModel, places: Mapping[str, float]) -> dict[str, float]:
    """The same without axles of trains that are far off their bodies."""
    lengths = {tie.name: model.bodies[tie.body].modal.length for tie in model.carriages}
    return {
        name: place
        for name, place in places.items()
        if name not in model.study.axles or max(-place, place - lengths[name]) <= SEEN * lengths[name]
    }


def _instant(model: SceneModel) -> float:
    """s after which the first train has run onto its body as a whole, or to the end of it; 0 without a train."""
    for first, name in model.study.axles.items():
        motion = model.study.carriage[first].motion
        length = next(model.bodies[tie.body].modal.length for tie in model.carriages if tie.name == first)
        start, end = _ends(motion)
        on = np.clip([start, end], 0.0, length)
        return float(abs(on[0] - start) + min(model.study.train[name].length, abs(on[1] - on[0]))) / _speed(motion)
    return 0.0


def _ends(motion: Motion) -> Array:
    """(2,) where a motion begins and ends, m."""
    return motion.path([0.0, motion.duration]).S


def _speed(motion: Motion) -> float:
    """Its top speed, m/s."""
    return motion.max_speed / motion.time_scale


def layout(model: SceneModel, positions: Mapping[str, float]) -> Layout:
    """The scene with its carriages at some positions."""
    carriages = model.study.carriage
    parts = {part.name: (part, model.study.body[part.name].outline(part.modal)) for part in model.bodies}
    if model.study.frame or model.study.load or model.study.spring:
        return Layout(model, {name: _hung(model.study, *part) for name, part in parts.items()}, positions, {})
    gap = GAP * max(float(np.ptp(np.concatenate(_points(outline)), axis=0).max()) for _, outline in parts.values())
    placed, contacts = dict[str, Placed](), dict[str, tuple[Standing, ...]]()
    riding = {name: c for name, c in carriages.items() if c.riding_body is not None}
    later = {body for c in riding.values() for body in c.bodies if body != c.on}
    for body, part in parts.items():
        if body not in later:
            placed[body] = _on_the_ground(*part, placed, gap)
    while riding:
        name, carriage = next((item for item in riding.items() if item[1].on in placed), next(iter(riding.items())))
        if carriage.on not in placed:  # two that ride stand each on a track beside that of the other
            placed[carriage.on] = _on_the_ground(*parts[carriage.on], placed, gap)
        del riding[name]
        body = str(carriage.riding_body)
        placed[body] = _above(model, carriage, parts[body], placed, positions[name], gap)
        for other in carriage.ridden:
            if other not in placed:
                placed[other] = _under(model, carriage, parts[other], placed)
        contacts[name] = tuple(_contacts(model, carriage, placed, positions[name]))
    return Layout(model, {name: placed[name] for name in parts}, positions, contacts)


def _hung(study: Study, part: BodyPart, outline: Outline) -> Placed:
    """A body whose frame moves, or is fixed, where it is at time 0."""
    attitude, place = _frame(study, part.name)
    turn = TURNED_UP @ attitude @ _own_axes(outline).T
    return Placed(part, outline, turn, TURNED_UP @ place - turn @ outline.track[0])


def _frame(study: Study, name: str) -> tuple[Array, Array]:
    """Attitude (3, 3) and place (3,) over the ground of the frame of a body at time 0, z down."""
    frame = study.frame.get(name)
    if frame is None:
        return np.eye(3), np.zeros(3)
    attitude, place = np.eye(3), np.array(frame.position)
    if frame.on != GROUND:
        attitude, place = _frame(study, frame.on)
        place = place + attitude[:, 0] * (study.body[frame.on].length if frame.at is None else frame.at)
    attitude = attitude @ _turned(frame.turned)
    for joint in frame.joints:
        turn, shift = joint.at_start
        attitude, place = attitude @ _turned(turn), place + attitude @ shift
    return attitude, place


def _turned(vector: Sequence[float] | Array) -> Array:
    """(3, 3) turn by a rotation vector, rad."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def _own_axes(outline: Outline) -> Array:
    """(3, 3) along the track, across and down, as columns, in a body's own coordinates."""
    along = np.diff(outline.track, axis=0)[0]
    along = along / np.linalg.norm(along)
    down = outline.down - (outline.down @ along) * along
    if np.linalg.norm(down) < SAME:
        down = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    down = down / np.linalg.norm(down)
    return np.array([along, np.cross(down, along), down]).T


def _level(vector: Array) -> Array:
    """The level part of a vector as a unit vector; x where it has none."""
    level = vector * [1.0, 1.0, 0.0]
    size = float(np.linalg.norm(level))
    return level / size if size > SAME * np.linalg.norm(vector) else np.array([1.0, 0.0, 0.0])


def _upright(outline: Outline) -> Array:
    """(3, 3) turn after which gravity acts along -z."""
    up = -outline.down
    if up @ UP > 1.0 - SAME:
        return np.eye(3)
    along = np.diff(outline.track, axis=0)[0]
    across = np.cross(up, along)
    if np.linalg.norm(across) < SAME * np.linalg.norm(along):
        across = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    across = across / np.linalg.norm(across)
    return np.array([np.cross(across, up), across, up])


def _about_up(one: Array, other: Array) -> Array:
    """(3, 3) turn about z from one level direction to another."""
    cosine, sine = float(one @ other), float(np.cross(one, other)[2])
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _on_the_ground(part: BodyPart, outline: Outline, placed: Mapping[str, Placed], gap: float) -> Placed:
    """Where its coordinates say; what has none stands below all others."""
    found = Placed(part, outline, _upright(outline), np.zeros(3))
    if outline.nodes or not placed:
        return found
    lowest = min(float(body.at(points)[:, 2].min()) for body in placed.values() for points in _points(body.outline))
    return Placed(part, outline, found.turn, (lowest - 4.0 * gap) * UP)


def _own_places(model: SceneModel, carriage: Carriage, part: BodyPart, outline: Outline) -> Array:
    """(C, 3) where contacts hold the body that rides, in its own coordinates."""
    body, (start, end) = model.study.body[part.name], outline.track
    found = []
    for contact in carriage.riding_contacts.values():
        named = None if contact.point is None else body.spot_place(Spot(point=contact.point))
        share = (contact.at or 0.0) / part.modal.length
        found.append(start + share * (end - start) if named is None else named)
    return np.array(found)


def _above(
    model: SceneModel,
    carriage: Carriage,
    rider: tuple[BodyPart, Outline],
    placed: Mapping[str, Placed],
    position: float,
    gap: float,
) -> Placed:
    """A body over its contacts: of the ways along and across its own track that which suits their offsets best."""
    part, outline = rider
    below, offsets = placed[carriage.on], np.array(carriage.contact_offsets(part.modal.length))
    free = Placed(part, outline, _upright(outline), np.zeros(3))
    own = _own_places(model, carriage, part, outline)
    along, across = free.forward, np.cross(UP, free.forward)
    ways = [along, across, -along, -across]
    misfits = np.array([np.var(free.at(own) @ way - offsets) for way in ways])
    way = ways[int(np.argmax(misfits <= misfits.min() + SAME * part.modal.length**2))]
    forward = below.forward
    turn = _about_up(way, forward) @ free.turn
    held, foot, aside = own @ turn.T, below.along(position), np.cross(UP, forward)
    on = np.array([(contact.on or carriage.on) == carriage.on for contact in carriage.riding_contacts.values()])
    shift = float(foot @ forward + np.mean(offsets - held @ forward)) * forward
    shift = shift + float(foot @ aside - np.mean(held[on] @ aside)) * aside
    return Placed(part, outline, turn, shift + float(foot[2] + gap - held[:, 2].mean()) * UP)


def _under(
    model: SceneModel, carriage: Carriage, below: tuple[BodyPart, Outline], placed: Mapping[str, Placed]
) -> Placed:
    """A further body below its contacts, along whose track places count as on the first one."""
    part, outline = below
    first, rider = placed[carriage.on], placed[str(carriage.riding_body)]
    free = Placed(part, outline, _upright(outline), np.zeros(3))
    turn = _about_up(free.forward, first.forward) @ free.turn
    own = rider.at(_own_places(model, carriage, rider.part, rider.outline))
    here = [contact.on == part.name for contact in carriage.riding_contacts.values()]
    aside, start = np.cross(UP, first.forward), first.along(0.0)
    start = start + float(own[here].mean(axis=0) @ aside - start @ aside) * aside
    return Placed(part, outline, turn, start - turn @ outline.track[0])


def _contacts(model: SceneModel, carriage: Carriage, placed: Mapping[str, Placed], position: float) -> list[Standing]:
    rider = placed[str(carriage.riding_body)]
    held = rider.at(_own_places(model, carriage, rider.part, rider.outline))
    offsets = carriage.contact_offsets(rider.part.modal.length)
    return [
        Standing(name, placed[contact.on or carriage.on].along(position + ahead), above, contact)
        for (name, contact), ahead, above in zip(carriage.riding_contacts.items(), offsets, held, strict=True)
    ]
