"""A study's bodies, frames and carriages as the tables that kernels march, and the names of all coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from engine.floating.attachments import Grip, LoadAt, loads_of, springs_of
from engine.floating.bodies.build import elastic_body
from engine.floating.bodies.elastic import ElasticBody
from engine.floating.refusals import refuse_model, refuse_scene
from engine.floating.tables import OF_DEPTH, system_of
from engine.kernels.floating import layout as columns
from engine.kernels.floating.layout import System
from engine.kernels.floating.observe import OF_BODY, OF_CARRIAGE, OF_POINT, OF_WHOLE
from engine.scene.frames import GROUND, AxisJoint, Frame, Free, Joint, Prismatic, Spherical

if TYPE_CHECKING:
    from engine.scene.sensors import Sensor
    from engine.scene.study import Study


@dataclass(frozen=True)
class OneJoint:
    """A joint as kernels have it: free ones of a study are three that slide and one that turns."""

    body: str
    number: int
    spec: Joint
    kind: int
    axis: tuple[float, float, float]
    coordinate: int
    motion: int


@dataclass(frozen=True, eq=False)
class FloatingModel:
    """One scene with frames that move. bodies: in the order of the tree, by name; modes: of bending, where left open.

    motions: dotted keys of what is given in time, in order; size: number of coordinates; places, springs: coordinates
    of carriages that slide and of sprung masses, by carriage; loads; links: the ends of springs between places.
    """

    study: Study
    bodies: dict[str, ElasticBody]
    joints: tuple[OneJoint, ...]
    first: dict[str, int]
    places: dict[str, int]
    springs: dict[str, int]
    motions: tuple[str, ...]
    size: int
    loads: tuple[LoadAt, ...]
    links: tuple[tuple[Grip, Grip], ...]

    def frame(self, name: str) -> Frame:
        """How a body's frame moves."""
        return self.study.frame.get(name) or Frame()

    @property
    def modes(self) -> int:
        """Elastic coordinates of all bodies."""
        return sum(body.omega.size for body in self.bodies.values())

    @property
    def is_open(self) -> bool:
        """Whether the study leaves the modes of a body open that bends."""
        return any(self.study.body[name].modes == "auto" for name, body in self.bodies.items() if body.omega.size)

    @property
    def first_omega(self) -> float:
        """The lowest elastic frequency, rad/s; that of one period in a second where nothing bends."""
        found = [body.omega.min() for body in self.bodies.values() if body.omega.size]
        return float(min(found)) if found else 2.0 * np.pi

    @property
    def highest_omega(self) -> float:
        """The highest elastic frequency of a body, rad/s."""
        return float(max((body.omega.max() for body in self.bodies.values() if body.omega.size), default=0.0))

    @cached_property
    def system(self) -> System:
        """The tables."""
        return system_of(self)

    @property
    def signals(self) -> int:
        """How many signals kernels observe."""
        bodies = len(self.bodies)
        sensors, carriages = len(self.study.sensor) + len(self.tips), OF_CARRIAGE * len(self.study.carriage)
        return sensors + OF_DEPTH * bodies + carriages + (OF_POINT + OF_BODY) * bodies + OF_WHOLE

    def signal_of(self, group: str) -> int:
        """Number of the first signal of the sensors, depths, carriages, ends, stops, frames, or of the whole."""
        counts = {
            "sensors": len(self.study.sensor),
            "depths": OF_DEPTH * len(self.bodies),
            "carriages": OF_CARRIAGE * len(self.study.carriage),
            "ends": OF_POINT * len(self.bodies),
            "stops": len(self.tips),
            "frames": OF_BODY * len(self.bodies),
            "whole": OF_WHOLE,
        }
        names = list(counts)
        return sum(counts[name] for name in names[: names.index(group)])

    @property
    def tips(self) -> dict[str, Sensor]:
        """The sensors that tell how far a place is from where the rigid arm would have it."""
        return {name: sensor for name, sensor in self.study.sensor.items() if sensor.reads.of_arm}

    def carriers(self, name: str) -> list[str]:
        """A body and all that carry it, from the ground on."""
        found = [name]
        while (on := self.frame(found[0]).on) != GROUND:
            found.insert(0, on)
        return found

    @property
    def depths(self) -> dict[str, slice]:
        """Signals that tell how far each body bends: across the track, along y and z, at its middle and its end."""
        first = self.signal_of("depths")
        return {name: slice(first + OF_DEPTH * b, first + OF_DEPTH * (b + 1)) for b, name in enumerate(self.bodies)}


def build(study: Study, modes: int | None = None) -> FloatingModel:
    """The model of a study without its sweep. Raises BadInput for what is not built or cannot be."""
    refuse_scene(study)
    names = list(_in_order(study))
    bodies = {
        name: elastic_body(
            study.body[name], study.frame.get(name) or Frame(), modes, f"body.{name}", hung_on(study, name)
        )
        for name in names
    }
    joints: list[OneJoint] = []
    motions: list[str] = []
    first: dict[str, int] = {}
    size = 0
    for name in names:
        for joint in _joints(study, name, size, motions):
            joints.append(joint)
            size += 0 if joint.coordinate < 0 else 3 if joint.kind == columns.SPHERICAL else 1
        first[name] = size
        size += bodies[name].omega.size
    places, springs = {}, {}
    for name, carriage in study.carriage.items():
        if carriage.motion.slides:
            places[name], size = size, size + 1
        else:
            motions.append(f"carriage.{name}.motion")
        if carriage.suspension is not None:
            springs[name], size = size, size + 1
    if size == 0:
        what = "nothing here can move by itself: all joints are driven, and no body bends"
        raise study.source.fault("frame", what, expected="a joint that nothing drives, or a body with modes")
    loads, links = tuple(loads_of(study, bodies)), tuple(springs_of(study, bodies))
    motions += dict.fromkeys(load.course for load in loads if load.course)
    found = FloatingModel(study, bodies, tuple(joints), first, places, springs, tuple(motions), size, loads, links)
    refuse_model(found)
    return found


def _in_order(study: Study) -> Iterator[str]:
    """Bodies, each after the one that it hangs on. Raises BadInput for a closed loop."""
    left = list(study.body)
    done: set[str] = {GROUND}
    while left:
        ready = [name for name in left if (study.frame.get(name) or Frame()).on in done]
        if not ready:
            what = "closed loops of bodies are not built: bodies stand in a tree"
            here, expected = f"frame.{left[0]}.on", '"ground" at one of them'
            raise study.source.fault(here, what, expected=expected, received=", ".join(left))
        for name in ready:
            yield name
            left.remove(name)
            done.add(name)


def hung_on(study: Study, name: str) -> list[float]:
    """Places (m) of a body's track at which others hang or torques act, whose moments its modes hardly hold; none
    without `solver.static_correction`."""
    if not study.solver.static_correction:
        return []
    hanging = [frame.at for frame in study.frame.values() if frame.on == name]
    twisted = [load.at for load in study.load.values() if load.on == name and load.torque is not None]
    length = study.body[name].length
    return sorted({length if at is None else at for at in [*hanging, *twisted]})


def _joints(study: Study, name: str, size: int, motions: list[str]) -> Iterator[OneJoint]:
    """The joints of a body from outside in; motions takes up what is given."""
    for number, joint in enumerate((study.frame.get(name) or Frame()).joints):
        if isinstance(joint, Free):
            for axis in np.eye(3):
                yield OneJoint(name, number, joint, columns.PRISMATIC, tuple(axis), size, -1)
                size += 1
            yield OneJoint(name, number, joint, columns.SPHERICAL, (0.0, 0.0, 0.0), size, -1)
            size += 3
        elif isinstance(joint, Spherical):
            yield OneJoint(name, number, joint, columns.SPHERICAL, (0.0, 0.0, 0.0), size, -1)
            size += 3
        else:
            assert isinstance(joint, AxisJoint)
            motion = -1
            if joint.motion is not None:
                motion = len(motions)
                motions.append(f"frame.{name}.joints.{number}.motion")
            axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
            kind = columns.PRISMATIC if isinstance(joint, Prismatic) else columns.REVOLUTE
            yield OneJoint(name, number, joint, kind, tuple(axis), -1 if joint.is_driven else size, motion)
            size += 0 if joint.is_driven else 1
