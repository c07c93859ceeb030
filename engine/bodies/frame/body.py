"""A frame as a modal body: its matrices, its modes (all of the model, or of its Craig-Bampton reduction), its track."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.frame.assembly import ABOUT_MODES, MASSES, Assembly, Content, Counts, assemble, rigid_motions
from engine.bodies.frame.gauges import Read, frame_gauge, frame_points, loads_everywhere
from engine.bodies.frame.geometry import unit
from engine.bodies.frame.pushes import SIDE_SHAPES, FrameSide, PushStatics, SideLine, side_lines
from engine.bodies.frame.sections import TrackSections
from engine.bodies.frame.shapes import mode_forces, track_shapes
from engine.bodies.frame.statics import TrackStatics, responses, track_statics
from engine.bodies.frame.track import TrackBeams, TrackPoints, track_of
from engine.bodies.modal.craig_bampton import reduce_model
from engine.bodies.modal.description import AUTO_MODES, MAX_MODES, Spots
from engine.bodies.modal.flexibility import SAME_FREQUENCY, Flexibility, factorised, solving, without_rounding
from engine.bodies.modal.modal_body import Array, Direction, ModalBody, Shapes, frozen
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame

_UNFELT = 1e-9  # part of the largest deflection below which a mode does not move the track


def frame_body(frame: Frame, spots: Spots = ()) -> ModalBody:
    """The frame in modal coordinates with its exact statics, read at some spots; the last few are remembered.

    Raises BadInput, with the key within the body as its place, for a frame that cannot be reduced as it asks.
    """
    return _frame_body(Content.of(frame), spots)


@lru_cache(maxsize=8)
def _frame_body(content: Content, spots: Spots) -> ModalBody:
    what = "the stiffnesses, masses or lengths of this frame differ too much to be solved"
    with solving(what, "section", "numbers of one scale") as demand_finite:
        found = _reduced(content.frame, spots)
        probe = found.influence_at([0.5 * found.length], [0.5 * found.length])
        demand_finite(found.omega, found.participation, probe, found.wave_number)
    return found


@dataclass(frozen=True, eq=False)
class _Whole:
    """What does not depend on how many modes a frame keeps: its matrices, its track, also as its motions in other
    directions than its loads' are read, and its statics."""

    assembly: Assembly
    flexibility: Flexibility
    track: TrackBeams
    sides: Mapping[Direction, SideLine]
    ends: TrackPoints
    statics: TrackStatics


@lru_cache(maxsize=8)
def _whole(content: Content) -> _Whole:
    frame = content.frame
    assembly = assemble(frame)
    flexibility = factorised(assembly.stiffness, assembly.mass, assembly.rigid)
    track, ends = track_of(frame, assembly.mesh)
    gravity = unit(frame.gravity)
    spread = track.spread_weight(gravity) * (frame.mass_matrix == "consistent")
    statics = track_statics(track, ends, assembly, flexibility, gravity, spread)
    return _Whole(assembly, flexibility, track, side_lines(frame, track), ends, statics)


@lru_cache(maxsize=16)
def _push_statics(content: Content, direction: Direction) -> PushStatics:
    """What forces on its track in another direction than its loads' do."""
    whole = _whole(content)
    line = whole.sides[direction]
    patterns, moved = responses(line, whole.ends, whole.assembly, whole.flexibility)
    deflection = replace(whole.statics, loads=line, patterns=patterns, flexibility=moved)
    return PushStatics(deflection, whole.sides)


def _reduced(frame: Frame, spots: Spots) -> ModalBody:
    content = Content.of(frame, without=ABOUT_MODES)
    whole = _whole(content)
    assembly, track, statics = whole.assembly, whole.track, whole.statics
    omega, moved, shapes = _kept(frame, whole)
    masses, gravity = MASSES[frame.mass_matrix](track.beams), unit(frame.gravity)
    forces = mode_forces(track, moved, omega**2 * moved, masses)
    sections = TrackSections(statics, forces)
    pushes = {direction: partial(_push_statics, content, direction) for direction in whole.sides}
    read = Read(frame, assembly, whole.flexibility, statics, pushes, whole.ends, omega, shapes)
    numbers, everywhere = loads_everywhere(frame, assembly)
    loads = numbers, everywhere[assembly.free]
    points = frame_points(read, loads, sections) if numbers else None
    bending = track.bending
    member_ends = np.cumsum([len(assembly.mesh.chains[name]) for name, _ in frame.line.members])
    return ModalBody(
        length=frame.length,
        mass=assembly.total_mass,
        omega=omega,
        participation=frozen(shapes.T @ read.pull),
        wave_number=frozen(track.wave_number(omega)),
        bending_stiffness=float(bending[0]) if np.ptp(bending) <= 1e-9 * bending[0] else np.nan,
        dampers=(),
        joints=tuple(track.places[member_ends[:-1]].tolist()),
        shapes=track_shapes(track, moved, forces),
        statics=statics,
        gravity_share=float(track.direction @ gravity),
        sections=sections,
        points=points,
        sides={
            direction: FrameSide(
                direction,
                line.wave_number(omega),
                SIDE_SHAPES[direction](line, moved, forces),
                forces,
                points,
                pushes[direction],
            )
            for direction, line in whole.sides.items()
        },
        gauges={name: frame_gauge(read, spot, (numbers, everywhere)) for name, spot in spots},
    )


def _kept(frame: Frame, whole: _Whole) -> tuple[Array, Array, Array]:
    """omega (N,), motions of the track's ends (E + 1, 6, N) and shapes (n, N) of the modes that the frame keeps."""
    assembly, track = whole.assembly, whole.track
    omega, shapes = frame_modes(frame, assembly, whole.flexibility)
    moved = whole.ends.of(assembly.whole(shapes))
    forces = mode_forces(track, moved, omega**2 * moved, MASSES[frame.mass_matrix](track.beams))
    along = track_shapes(track, moved, forces)
    turn = settled(omega, along, whole.statics.length, shapes)
    kept = kept_modes(frame, omega)
    return frozen(omega[kept]), without_rounding(moved @ turn, (0, 1))[:, :, kept], (shapes @ turn)[:, kept]


def motion_of_points(frame: Frame) -> tuple[Assembly, Array]:
    """The frame's matrices, and (P, 6, N) displacements and rotations of all its points in every kept mode."""
    whole = _whole(Content.of(frame, without=ABOUT_MODES))
    shapes = whole.assembly.whole(_kept(frame, whole)[2])
    return whole.assembly, shapes.reshape(-1, 6, shapes.shape[1])


def frame_modes(frame: Frame, assembly: Assembly, flexibility: Flexibility) -> tuple[Array, Array]:
    """omega (k,) and shapes (n, k) of the lowest modes that the frame asks for; groups of equal frequencies whole."""
    count = AUTO_MODES if frame.modes == "auto" else int(frame.modes)
    if not frame.interface:
        return flexibility.modes(count)
    interface = interface_freedoms(frame, assembly)
    held = np.ones(6 * len(assembly.mesh.points), dtype=np.bool_)
    held[np.delete(assembly.free, interface)] = False
    loose = rigid_motions(assembly.mesh, held, assembly.springs)[~held]
    reduction = reduce_model(assembly.stiffness, assembly.mass, interface, loose, frame.fixed_interface_modes)
    omega, shapes = reduction.modes(flexibility.rigid)
    if frame.modes == "auto":
        count = min(len(omega), MAX_MODES)
    ends = np.append(groups(omega)[1:], len(omega))
    count = int(ends[ends >= min(count, len(omega))][0])
    return omega[:count], shapes[:, :count]


def interface_freedoms(frame: Frame, assembly: Assembly) -> Counts:
    """Places of the interface's degrees of freedom among the free ones."""
    nodes = [list(frame.node).index(name) for name in frame.interface]
    wanted = (6 * np.array(nodes)[:, None] + np.arange(6)).reshape(-1)
    return np.flatnonzero(np.isin(assembly.free, wanted))


def groups(omega: Array) -> Counts:
    """First modes of the groups of equal frequencies."""
    apart = np.diff(omega) > SAME_FREQUENCY * omega[1:]
    return np.concatenate([[0], np.flatnonzero(apart) + 1])


def settled(omega: Array, along: Shapes, length: float, shapes: Array) -> Array:
    """(k, k) turn within groups of equal frequencies, and signs, so that modes do not depend on the solver's whim.

    Within a group the first mode moves the track most, the next what is left, by the mean square along it. Then the
    first place of the track where a mode reaches half of its largest value is positive.
    """
    count = len(omega)
    turn = np.eye(count)
    fine = along.derivatives(np.linspace(0.0, length, 16 * count + 1), (0,))[0]
    for first, end in pairwise([*groups(omega), count]):
        part = fine[:, first:end]
        if end - first > 1:
            _, vectors = np.linalg.eigh(part.T @ part)
            turn[first:end, first:end] = vectors[:, ::-1]
    fine, whole = fine @ turn, shapes @ turn
    size = np.abs(fine).max(axis=0)
    for mode in range(count):
        felt = size[mode] > _UNFELT * np.abs(whole[:, mode]).max()
        line = fine[:, mode] if felt else whole[:, mode]
        start = line[np.argmax(np.abs(line) >= 0.5 * np.abs(line).max())]
        turn[:, mode] *= -1.0 if start < 0.0 else 1.0
    return turn


def kept_modes(frame: Frame, omega: Array) -> Counts:
    """The modes that stay: not those left out (nor their equals), nor rigid-body modes if these are dropped."""
    out = np.zeros(len(omega), dtype=np.bool_)
    for index, number in enumerate(frame.leave_out):
        if number > len(omega):
            expected = f"numbers of modes, 1 to {len(omega)}"
            what = "there is no such mode to leave out"
            raise BadInput(what, where=f"leave_out.{index}", expected=expected, received=str(number))
        out[number - 1] = True
    for first, end in pairwise([*groups(omega), len(omega)]):
        out[first:end] |= out[first:end].any()
    if frame.rigid_body_modes == "drop":
        out |= omega == 0.0
    kept = np.flatnonzero(~out)
    if not len(kept):
        raise BadInput("no mode is left", where="leave_out" if frame.leave_out else "modes", expected="at least one")
    return kept
