"""What differs from variant to variant of a scene with frames that move: numbers by their keys, as kernels take
them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from engine.kernels.floating import layout as columns
from engine.kernels.floating.layout import Lane
from engine.kernels.layout import LANES
from engine.scene.frames import AxisJoint, Free, Spherical
from engine.scene.motions.of_joints import AMPLITUDE, CONSTANT, START
from engine.scene.variants import VariantValues
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.floating.model import FloatingModel, OneJoint

LIGHT = 1e-6  # of the masses of carriages, of which a mass matrix without them is left that can be solved
#: Keys of numbers that a variant may have to itself within one scene.
OWN_KEYS = re.compile(
    r"gravity|solver\.tolerance|body\.\w+\.damping_ratio(\..+)?"
    r"|carriage\.\w+\.(mass|wheel_mass|stiffness|damping|inertia\.\d|height)|carriage\.\w+\.motion\.(?!cycles$).+"
    r"|load\.\w+\.(force|torque)(_per_metre)?\.\d|load\.\w+\.course\..+|spring\.\w+\.(stiffness|damping|length)"
    r"|frame\.\w+\.joints\.\d+\.(start|rate(\.\d)?|velocity\.\d|stiffness|damping|motion\..+)"
)


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers (V,) of a scene's variants by dotted key."""

    model: FloatingModel
    values: VariantValues

    def of(self, key: str) -> Array:
        """(V,) of a key; 0 where it is not set."""
        column = self.values.columns.get(key)
        if column is not None:
            return np.asarray(column, dtype=np.float64)
        value = self.model.study.value(key)
        return np.full(self.values.size, 0.0 if value is None else float(value))


def lanes(model: FloatingModel, values: VariantValues, step: Array) -> Lane:
    """The table of some variants, each with its step (V,) in s."""
    numbers, V = Numbers(model, values), values.size
    gravity = np.zeros((V, 3))
    gravity[:, 2] = numbers.of("gravity")
    start = np.zeros((V, 2, model.size))
    joints = np.zeros((V, len(model.joints), 2))
    for j, joint in enumerate(model.joints):
        _start_joint(joint, numbers, start, joints[:, j])
    carriages = np.zeros((V, len(model.study.carriage), columns.CARRIAGE))
    for c, name in enumerate(model.study.carriage):
        _carriage(model, numbers, name, start, carriages[:, c])
    motions = _motions(model, numbers)
    loads, links = _loads(model, numbers), _links(model, numbers)
    events, damping, stops = _events(motions), _damping(model, values), _stops(model, motions)
    riding = carriages, _light(carriages)
    return Lane(gravity, damping, joints, *riding, motions, events, start, loads, links, stops, step[:, None])


def _light(carriages: Array) -> Array:
    """(V, C, CARRIAGE) carriages of next to no mass."""
    found = carriages.copy()
    found[..., [columns.OWN_MASS, *range(columns.INERTIA, columns.INERTIA + 3), columns.SPRUNG_MASS]] *= LIGHT
    return found


def in_blocks(table: Array) -> Array:
    """(V, ...) as (blocks, ..., LANES), the last variant in the lanes that are left over."""
    blocks = -(-len(table) // LANES)
    filled = np.concatenate([table, np.repeat(table[-1:], blocks * LANES - len(table), axis=0)])
    return np.ascontiguousarray(np.moveaxis(filled.reshape(blocks, LANES, *table.shape[1:]), 1, -1))


def out_of_blocks(table: NDArray[Any], variants: int) -> NDArray[Any]:
    """(blocks, ..., LANES) as (V, ...)."""
    rows = table.shape[0] * table.shape[-1]
    return np.ascontiguousarray(np.moveaxis(table, -1, 1).reshape(rows, *table.shape[1:-1])[:variants])


def _start_joint(joint: OneJoint, numbers: Numbers, start: Array, springs: Array) -> None:
    """Coordinates and rates of a joint at time 0, its spring and its damper."""
    key, k, spec = f"frame.{joint.body}.joints.{joint.number}", joint.coordinate, joint.spec
    if isinstance(spec, AxisJoint):
        springs[:, 0], springs[:, 1] = numbers.of(f"{key}.stiffness"), numbers.of(f"{key}.damping")
        if k >= 0:
            start[:, 0, k], start[:, 1, k] = numbers.of(f"{key}.start"), numbers.of(f"{key}.rate")
    elif isinstance(spec, Free) and joint.kind == columns.PRISMATIC:
        start[:, 1, k] = numbers.of(f"{key}.velocity.{int(np.argmax(joint.axis))}")
    else:
        for axis in range(3):
            start[:, 1, k + axis] = numbers.of(f"{key}.rate.{axis}")
        if isinstance(spec, Spherical):
            springs[:, 1] = numbers.of(f"{key}.damping")


def _carriage(model: FloatingModel, numbers: Numbers, name: str, start: Array, own: Array) -> None:
    """A carriage's masses, its spring, its friction and where it starts."""
    spec, key = model.study.carriage[name], f"carriage.{name}"
    own[:, columns.OWN_MASS] = sum((numbers.of(f"{key}.{part}") for part in spec.touching), np.zeros(len(own)))
    own[:, columns.SLIP] = 1.0
    if spec.suspension is not None:
        for column, part in ((columns.SPRUNG_MASS, "mass"), (columns.SPRING, "stiffness"), (columns.DAMPER, "damping")):
            own[:, column] = numbers.of(f"{key}.{part}")
    else:
        for axis in range(3 if model.study.value(f"{key}.inertia") is not None else 0):
            own[:, columns.INERTIA + axis] = numbers.of(f"{key}.inertia.{axis}")
        own[:, columns.HEIGHT] = numbers.of(f"{key}.height")
    if name in model.places:
        k = model.places[name]
        start[:, 0, k], start[:, 1, k] = numbers.of(f"{key}.motion.start"), numbers.of(f"{key}.motion.speed")
        keys = {"drive": columns.DRIVE, "friction": columns.VISCOUS, "coulomb": columns.COULOMB}
        for word, column in (keys | {"slip_speed": columns.SLIP}).items():
            own[:, column] = numbers.of(f"{key}.motion.{word}")


def _loads(model: FloatingModel, numbers: Numbers) -> Array:
    """(V, Q, 6): force and torque of every load at its grip."""
    found = np.zeros((numbers.values.size, len(model.loads), 6))
    for q, load in enumerate(model.loads):
        for k, key in (*enumerate(load.force), *enumerate(load.torque, 3)):
            found[:, q, k] = numbers.of(key)
    return found


def _links(model: FloatingModel, numbers: Numbers) -> Array:
    """(V, K, 3): stiffness, damping and free length of every spring between places."""
    found = np.zeros((numbers.values.size, len(model.links), 3))
    for k, name in enumerate(model.study.spring):
        for column, word in enumerate(("stiffness", "damping", "length")):
            found[:, k, column] = numbers.of(f"spring.{name}.{word}")
    return found


def _damping(model: FloatingModel, values: VariantValues) -> Array:
    """(V, B n): 2 zeta omega."""
    n = max(1, *(body.omega.size for body in model.bodies.values()))
    found = np.zeros((values.size, len(model.bodies), n))
    for b, (name, body) in enumerate(model.bodies.items()):
        if body.omega.size:
            found[:, b, : body.omega.size] = values.damping_rates(name, body.omega).T
    return found.reshape(values.size, -1)


def _motions(model: FloatingModel, numbers: Numbers) -> Array:
    """(V, M, pieces, 10); those with fewer pieces have others that never begin."""
    found = [_pieces(model, numbers, key) for key in model.motions]
    most = max((one.shape[1] for one in found), default=1)
    table = np.zeros((numbers.values.size, len(found), most, columns.PIECE))
    table[:, :, :, START] = np.inf
    for m, one in enumerate(found):
        table[:, m, : one.shape[1]] = one
    return table


def _events(motions: Array) -> Array:
    """(V, E) times at which a motion goes on as another piece."""
    starts = np.sort(motions[:, :, 1:, START].reshape(len(motions), -1), axis=1)
    again = np.concatenate([np.zeros((len(motions), 1), dtype=bool), starts[:, 1:] == starts[:, :-1]], axis=1)
    return np.sort(np.where(again[:, : starts.shape[1]], np.inf, starts), axis=1)


def _stops(model: FloatingModel, motions: Array) -> Array:
    """(V, T) times at which the last joint that carries a tip comes to its end, infinite where one never does, and what
    goes along these bodies, where it does."""
    found = np.zeros((len(motions), len(model.tips)))
    moving = np.any(motions[..., CONSTANT + 1 : AMPLITUDE] != 0.0, axis=-1) | (motions[..., AMPLITUDE] != 0.0)
    after = np.concatenate([motions[:, :, 1:, START], np.full((*motions.shape[:2], 1), np.inf)], axis=2)
    ends = np.where(moving & np.isfinite(motions[..., START]), after, 0.0).max(axis=2, initial=0.0)
    for t, sensor in enumerate(model.tips.values()):
        carriers = model.carriers(str(sensor.body))
        own = [joint.motion for joint in model.joints if joint.body in carriers]
        keys = [f"carriage.{name}.motion" for name, one in model.study.carriage.items() if one.on in carriers]
        riding = ends[:, [model.motions.index(key) for key in keys if key in model.motions]]
        last = np.where(np.isfinite(riding), riding, 0.0).max(axis=1, initial=0.0)
        found[:, t] = np.maximum(ends[:, own].max(axis=1, initial=0.0), last)
    return found


def _pieces(model: FloatingModel, numbers: Numbers, key: str) -> Array:
    """(V, pieces, 10) of what is given in time at a key."""
    table, name, *rest = key.split(".")
    if table == "frame":
        joint = model.frame(name).joints[int(rest[1])]
        assert isinstance(joint, AxisJoint) and joint.motion is not None
        return joint.motion.pieces(lambda word: numbers.of(f"{key}.{word}"))
    if table == "load":
        course = model.study.load[name].course
        assert course is not None
        return course.pieces(lambda word: numbers.of(f"{key}.{word}"))
    return model.study.carriage[name].motion.pieces(lambda word: numbers.of(f"{key}.{word}"))
