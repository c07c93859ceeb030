"""Natural vibrations of everything together as it stands at time 0: joints that are driven hold, the others turn and
slide on their springs; without gravity and turning, which stiffen or soften little of what is meant to stand.

Particles of all bodies move by small motions q with displacements J q, so that M = sum of m J' J, and K has the modes'
own stiffness and that of joints.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.floating.bodies.fields import AXES
from engine.floating.theory import given_way
from engine.kernels.floating.layout import PRISMATIC, REVOLUTE
from engine.scene.frames import GROUND, AxisJoint
from engine.scene.variants import VariantValues
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.floating.bodies.elastic import ElasticBody
    from engine.floating.model import FloatingModel


RIGID = 1e-6  # of the highest frequency: what is lower is held by nothing, and rounding


class Placed(NamedTuple):
    """A frame at time 0: attitude (3, 3), columns its axes; place (3,) m; moves, turns (3, N) of its origin by small
    motions, over the ground."""

    attitude: Array
    place: Array
    moves: Array
    turns: Array

    def at(self, arms: Array, own: Array) -> Array:
        """(..., 3, N) how places move that lie at arms (..., 3) m, over the ground, from the origin; own (..., 3, N):
        in the frame, by what bends."""
        turned = np.swapaxes(np.cross(self.turns.T, arms[..., None, :]), -1, -2)
        return np.asarray(self.moves + turned + self.attitude @ own)


class Vibrations(NamedTuple):
    """omega (N,) rad/s, ascending, 0 of what nothing holds, and damping_ratio (N,), NaN there."""

    omega: Array
    damping_ratio: Array


def natural_vibrations(model: FloatingModel) -> Vibrations | None:
    """Of a scene's own numbers; None where joints turn freely in all directions or about what has no inertia, springs
    are between places, or a carriage slides or has a suspension. Damping by what it takes of each vibration, which is
    that of light damping."""
    joints = [joint for joint in model.joints if joint.coordinate >= 0]
    if model.links or model.places or model.springs or any(j.kind not in (REVOLUTE, PRISMATIC) for j in joints):
        return None
    frames, N = dict[str, Placed](), model.size
    stiffness, mass = np.zeros(N), np.zeros((N, N))
    for joint in joints:
        assert isinstance(joint.spec, AxisJoint)
        stiffness[joint.coordinate] = joint.spec.stiffness
    for name, body in model.bodies.items():
        frames[name] = frame = _placed(model, name, frames)
        stiffness[_modes(model, name)] = body.omega**2
        moved = frame.at(body.places @ frame.attitude.T, _own(model, name, body.shapes)).reshape(-1, N)
        mass += (np.repeat(body.weights, 3)[:, None] * moved).T @ moved
        inertia = frame.attitude @ np.diag(body.own_inertia) @ frame.attitude.T
        mass += frame.turns.T @ inertia @ frame.turns
    mass += _carried(model, frames)
    try:
        unit_mass = np.linalg.inv(np.linalg.cholesky(mass))
    except np.linalg.LinAlgError:
        return None
    squares, turned = np.linalg.eigh(unit_mass @ (stiffness[:, None] * unit_mass.T))
    omega, shapes = np.sqrt(np.maximum(squares, 0.0)), unit_mass.T @ turned
    held = omega > RIGID * omega.max(initial=0.0)
    taken = _damping(model) @ shapes**2
    return Vibrations(omega, np.where(held, 0.5 * taken / np.where(held, omega, 1.0), np.nan))


def _damping(model: FloatingModel) -> Array:
    """(N,) of each coordinate, of modes 2 zeta omega."""
    values, found = VariantValues(model.study, {}, 1), np.zeros(model.size)
    for name, body in model.bodies.items():
        if body.omega.size:
            found[_modes(model, name)] = values.damping_rates(name, body.omega)[:, 0]
    for joint in model.joints:
        if joint.coordinate >= 0:
            assert isinstance(joint.spec, AxisJoint)
            found[joint.coordinate] = joint.spec.damping
    return found


def _modes(model: FloatingModel, name: str) -> slice:
    """The coordinates of a body's modes."""
    first = model.first[name]
    return slice(first, first + model.bodies[name].omega.size)


def _own(model: FloatingModel, name: str, shapes: Array) -> Array:
    """(..., N) of all coordinates from those of a body's own modes."""
    found = np.zeros((*shapes.shape[:-1], model.size))
    found[..., _modes(model, name)] = shapes
    return found


def _bent(model: FloatingModel, name: str, x: float) -> tuple[Array, Array]:
    """(3, N) twice: how a place of a body's track moves and turns in its frame, by its modes."""
    body: ElasticBody = model.bodies[name]
    fields = _own(model, name, body.fields(np.array([x]), (0,))[0, 0])
    return fields[: AXES // 2], fields[AXES // 2 :]


def _placed(model: FloatingModel, name: str, frames: dict[str, Placed]) -> Placed:
    """The frame of a body from that of what holds it, through its joints."""
    from scipy.spatial.transform import Rotation

    own, N = model.frame(name), model.size
    if own.on == GROUND:
        frame = Placed(np.eye(3), np.array(own.position), np.zeros((3, N)), np.zeros((3, N)))
    else:
        holder = frames[own.on]
        x = model.bodies[own.on].length if own.at is None else own.at
        arm, (bent, turned) = holder.attitude @ np.array([x, 0.0, 0.0]), _bent(model, own.on, x)
        moves, turns = holder.at(arm, bent), holder.turns + holder.attitude @ turned
        frame = Placed(holder.attitude, holder.place + arm, moves, turns)
    frame = frame._replace(attitude=frame.attitude @ Rotation.from_rotvec(own.turned).as_matrix())
    for joint in (joint for joint in model.joints if joint.body == name):
        turn, shift = joint.spec.at_start
        arm = frame.attitude @ shift
        frame = frame._replace(place=frame.place + arm, moves=frame.at(arm, np.zeros((3, N))))
        if joint.coordinate >= 0:
            way = frame.turns if joint.kind == REVOLUTE else frame.moves
            way[:, joint.coordinate] += frame.attitude @ np.array(joint.axis)
        frame = frame._replace(attitude=frame.attitude @ Rotation.from_rotvec(turn).as_matrix())
    return frame


def _carried(model: FloatingModel, frames: dict[str, Placed]) -> Array:
    """(N, N) the masses of carriages where their motions begin."""
    found, values = np.zeros((model.size, model.size)), VariantValues(model.study, {}, 1)
    for name, carriage in model.study.carriage.items():
        at = float(given_way(model, values, np.zeros(1), name)[0][0])
        frame, (bent, _) = frames[carriage.on], _bent(model, carriage.on, at)
        moved = frame.at(frame.attitude @ np.array([at, 0.0, 0.0]), bent)
        found += sum(float(model.study.value(f"carriage.{name}.{key}") or 0.0) for key in carriage.masses) * (
            moved.T @ moved
        )
    return found
