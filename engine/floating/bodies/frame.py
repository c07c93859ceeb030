"""Frames of beams in floating frames: their modes by finite elements, and what hangs on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from engine.bodies.frame.assembly import MASSES, Assembly
from engine.bodies.frame.body import motion_of_points
from engine.bodies.frame.frame import Frame as FrameBody
from engine.bodies.frame.sections import TrackSections
from engine.bodies.frame.shapes import mode_forces
from engine.bodies.frame.track import TrackPoints, line_of
from engine.bodies.modal.flexibility import factorised, without_rounding
from engine.floating.bodies.elastic import ElasticBody, floating_axes, refuse_beam_words, refuse_unheld
from engine.floating.bodies.frame_line import Track, of_masses, of_members, together
from engine.floating.bodies.frame_shortening import FrameShortening
from engine.floating.bodies.static_shapes import Motions
from engine.scene.frames import Frame
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.quantities import Quantity

ACROSS = 1e-9  # of a unit force: less along the track is rounding


def elastic_frame(body: FrameBody, frame: Frame, modes: int | None, where: str, hung: Sequence[float]) -> ElasticBody:
    """A frame of beams whose floating frame begins with its track, z where loads push it; modes: where that is open;
    hung: places of its track (m) at which something hangs on it. Raises BadInput for what is not built."""
    _check(body, frame, where)
    asked = body if body.modes != "auto" or modes is None else body.with_modes(modes)
    own = asked.model_copy(update={"rigid_body_modes": "drop"})
    assembly, motion = motion_of_points(own)
    refuse_unheld(assembly.rigid.shape[1], frame, where)
    line, modal = own.line, own.build()
    axes = floating_axes(line.tangent, line.direction)
    beams, points = line_of(own, assembly.mesh, line.members, line.direction, np.array(own.track.offset))
    origin = axes @ (assembly.mesh.points[points.points[0]] + points.arms[0] + own.track.offset)
    track = Track(beams, TrackPoints(points.points, points.arms + own.track.offset), axes)
    shapes = motion.reshape(-1, motion.shape[2])[assembly.free]
    found = Motions(np.asarray(modal.omega), shapes, modal.omega**2 * shapes)
    if hung:
        elements = factorised(assembly.stiffness, assembly.mass, assembly.rigid)
        found = found.with_statics(elements, track.loads(hung, motion.size // motion.shape[2])[assembly.free])
        moved = without_rounding(points.of(assembly.whole(found.shapes)), (0, 1))
        inertia = points.of(assembly.whole(found.inertia))
        forces = mode_forces(beams, moved, inertia, MASSES[own.mass_matrix](beams.beams))
        modal = replace(modal, sections=replace(cast(TrackSections, modal.sections), modes=forces))
    across = abs(float(line.direction @ line.tangent)) < ACROSS
    nodal = assembly.whole(found.shapes)
    particles = together([*of_members(own, assembly, nodal, axes), *of_masses(own, assembly, nodal, axes)])
    return ElasticBody(
        length=own.length,
        mass=assembly.total_mass,
        omega=found.omega,
        places=particles.places - origin,
        weights=particles.masses,
        shapes=particles.shapes,
        own_inertia=np.zeros(3),
        along=track.moving(nodal),
        modal=modal,
        shortening=FrameShortening(own, assembly, nodal, track, origin),
        stiffens=bool(frame.stiffening),
        slender=False,
        inertial=FrameInertia(own, assembly, found, Track(beams, points, axes), axes.T @ origin) if across else None,
    )


@dataclass(frozen=True, eq=False)
class FrameInertia:
    """As of `engine.floating.bodies.elastic.Inertial`, of a frame whose floating frame begins at a point (3,) m."""

    own: FrameBody
    assembly: Assembly
    found: Motions
    track: Track
    origin: Array

    def __call__(self, body: ElasticBody, quantity: Quantity, x: float) -> Array:
        return np.asarray(self._sections.rows(quantity.name, [x])[0])

    @cached_property
    def _sections(self) -> TrackSections:
        """Section forces by what the modes leave of the static deflections under inertia."""
        assembly, found, beams, points = self.assembly, self.found, self.track.beams, self.track.points
        all_of_it = self._accelerations
        loads = (assembly.all_mass @ all_of_it)[assembly.free]
        elements = factorised(assembly.stiffness, assembly.mass, assembly.rigid)
        on_modes = (found.shapes.T @ loads) / found.omega[:, None] ** 2
        moved = assembly.whole(elements.solve(loads) - found.shapes @ on_modes)
        taken = assembly.whole(elements.rigid @ (elements.rigid.T @ loads) + found.inertia @ on_modes)
        masses = MASSES[self.own.mass_matrix](beams.beams)
        forces = mode_forces(beams, points.of(moved), points.of(all_of_it - taken), masses)
        return replace(cast(TrackSections, self.own.build().sections), modes=forces)

    @property
    def _accelerations(self) -> Array:
        """(6 P, 3) of all points. Those by w_x w_z turn no point, as they are z along x and x along z: between points
        of an element they go off their line and as far back."""
        arms = self.assembly.mesh.points - self.origin
        along, about, across = self.track.axes
        found = np.zeros((len(arms), 6, 3))
        found[:, :3, 0], found[:, :3, 1], found[:, 3:, 1] = across, np.cross(about, arms), about
        found[:, :3, 2] = np.outer(arms @ along, across) + np.outer(arms @ across, along)
        return found.reshape(-1, 3)


def _check(body: FrameBody, frame: Frame, where: str) -> None:
    """Refuse what is not built of frames in frames that move."""
    refuse_beam_words(frame, where)
    if body.mass_matrix != "consistent":
        raise BadInput(
            "lumped masses in a frame that moves are not built yet",
            where=f"{where}.mass_matrix",
            expected="consistent",
            received=body.mass_matrix,
        )
    for name, member in body.member.items():
        if member.theory != "euler-bernoulli":
            raise BadInput(
                "beams with shear in a frame that moves are not built yet",
                where=f"{where}.member.{name}.theory",
                expected="euler-bernoulli",
                received=member.theory,
            )
    for name, mass in body.point_mass.items():
        if 2.0 * max(mass.inertia) > sum(mass.inertia) * (1.0 + 1e-12):
            raise BadInput(
                "no rigid body has such moments of inertia",
                where=f"{where}.point_mass.{name}.inertia",
                expected="each at most the sum of the two others",
                received=str(list(mass.inertia)),
            )
