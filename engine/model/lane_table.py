"""The numbers of whole blocks of variants of one scene as the kernels take them, and what carriages weigh."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.kernels.layout import LANES, Lanes
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.scene.variants import VariantValues

#: Damping ratio of residual coordinates of masses beyond that of the highest mode kept. With none the growth by a
#: passage of an undamped beam (3 to 12 modes, up to 0.9 of its critical speed, twice the rule's steps and more) was
#: up to 3, with 0.1 to 1 at most 1.07; the errors of four passages by 4 to 16 modes were 0.9, 1.3 and 2 times those
#: without it, by 0.1, 0.4 and 1.
RESIDUAL_DAMPING = 0.2


def moving_mass(model: SceneModel, values: VariantValues, carriage: int) -> Array:
    """(V,) kg of a whole carriage."""
    tie = model.carriages[carriage]
    if tie.rides is None:
        return values.own_mass(tie.name)
    brought = model.bodies[tie.rides]
    return values.own_mass(tie.name) + values.columns.get(f"body.{brought.name}.mass", brought.modal.mass)


def weight(model: SceneModel, values: VariantValues, carriage: int) -> Array:
    """(V,) N of a carriage along the deflections of the track that it rides."""
    tie = model.carriages[carriage]
    share = model.bodies[tie.body].modal.gravity_share
    return values.force(tie.name) + moving_mass(model, values, carriage) * values.gravity * share


def weights(model: SceneModel, values: VariantValues) -> Array:
    """(C, V) N of all carriages."""
    return np.stack([weight(model, values, number) for number in range(len(model.carriages))])


def static_loads(model: SceneModel, values: VariantValues) -> Array:
    """(L, V) what static readings grow with: `loads_of` all carriages, and last gravity in m/s^2."""
    return np.concatenate([loads_of(model, values, weights(model, values)), values.gravity[None]])


def loads_of(model: SceneModel, values: VariantValues, heavy: Array) -> Array:
    """(C (1 + R), V) weights (C, V) of the carriages in N, and for each of the R contacts with lanes' own stiffnesses
    the same times how much softer it is than the model's, in m: it carries what it carries, and yields by as much."""
    softer = [_softer(model, values, number) for number in model.varying]
    return np.concatenate([heavy, *(heavy * own for own in softer)])


def _softer(model: SceneModel, values: VariantValues, spring: int) -> Array:
    """(V,) m/N."""
    key = model.springs[spring].keys.stiffness
    return np.asarray(1.0 / values.column(key) - 1.0 / float(model.study.value(key)))


def padded(variants: NDArray[np.int64]) -> NDArray[np.int64]:
    """Variants filled up to whole blocks by repeating the last one."""
    return np.pad(variants, (0, -variants.size % LANES), mode="edge")


def in_whole_blocks(values: VariantValues) -> VariantValues:
    """The values filled up in the same way."""
    return values.part(padded(np.arange(values.size)))


def to_blocks(values: Array) -> Array:
    """(..., V) as (V/LANES, ..., LANES)."""
    cut = values.reshape(*values.shape[:-1], -1, LANES)
    return np.ascontiguousarray(cut.transpose(values.ndim - 1, *range(values.ndim - 1), values.ndim))


def from_blocks(blocks: Array, size: int) -> Array:
    """(blocks, ..., LANES) as (..., size)."""
    joined = blocks.transpose(*range(1, blocks.ndim - 1), 0, blocks.ndim - 1)
    return joined.reshape(*joined.shape[:-2], blocks.shape[0] * blocks.shape[-1])[..., :size]


@dataclass(frozen=True, eq=False)
class LaneTable:
    """Numbers of whole blocks of variants of one scene, in SI units.

    omega (N, 1), or (blocks, N, LANES) where forces pulsate;  rates (blocks, N, LANES): 2 zeta omega;
    inverse_modal_mass (blocks, N, LANES): 1 over the masses of bodies' modes, which are mostly 1, 1/m (1/kg) of sprung
    masses, and 0 of what nothing moves;  mass, weight
    (blocks, ties, LANES): of the carriages, zero for dampers and springs, mass only what touches the body and has
    inertia;  joint (blocks, ties, LANES): 1 for rigid joints;  damper, spring (blocks, ties, LANES): N s/m and N/m,
    zero for carriages;  pulse (blocks, ties, LANES): N, amplitudes of forces that pulsate;  phase (blocks, P,
    LANES): rad, of what they swing by;  of_carriages (blocks, C (1 + R), LANES): of `loads_of` their weights;
    time_scale, gravity (blocks, LANES).
    """

    omega: Array
    rates: Array
    inverse_modal_mass: Array
    mass: Array
    joint: Array
    weight: Array
    damper: Array
    spring: Array
    pulse: Array
    phase: Array
    of_carriages: Array
    time_scale: Array
    gravity: Array

    def turned(self, step: Array) -> Array:
        """(blocks, N, LANES) omega h of all coordinates for a step (blocks, LANES) in s."""
        return np.asarray(self.omega * step[:, None])

    def steps_of(self, step: Array, ties: Counts | None = None, scaled_from: float = math.inf) -> Lanes:
        """The kernels' lanes for a step h (blocks, LANES) in s; ties: numbers of some, where not of all; scaled_from:
        omega h from which modes take more mass, their stiffness and damping the same."""
        h = step[:, None, :]
        turned = self.turned(step)
        limited = not math.isinf(scaled_from)
        slower = np.minimum(1.0, scaled_from / np.maximum(turned, np.finfo(np.float64).tiny)) if limited else 1.0
        own = np.arange(self.mass.shape[1]) if ties is None else ties
        return Lanes(
            stiffness=(turned * slower) ** 2,
            damping=self.rates * h * slower**2,
            inverse_modal_mass=self.inverse_modal_mass * slower**2,
            coupling_mass=(self.mass + self.joint).take(own, 1)
            + self.damper.take(own, 1) * h
            - self.pulse.take(own, 1) * h**2,
            coupling_stiffness=self.spring.take(own, 1) * h**2,
            load=self.weight.take(own, 1) * h**2,
            weight=self.of_carriages,
            gravity=self.gravity,
            step=step,
        )


def lane_table(model: SceneModel, values: VariantValues) -> LaneTable:
    """The lanes of some variants, whose number must be a multiple of LANES."""
    rates = [values.damping_rates(part.name, part.modal.omega) for part in model.bodies]
    none, numbers = np.zeros(values.size), range(len(model.carriages))
    masses, heavy = [_contact_mass(model, values, number) for number in numbers], weights(model, values)
    carriages, dampers, springs = ([none] * len(part) for part in (model.carriages, model.dampers, model.springs))
    rigid = [np.full(values.size, float(spring.rigid)) for spring in model.springs]
    coefficients = [values.column(damper.key) for damper in model.dampers]
    coefficients += [values.column(spring.keys.damping) for spring in model.springs]
    pushes, alongside = [none] * len(model.pushes), [moving_mass(model, values, p.carriage) for p in model.pushes]
    stiffness = [none if spring.rigid else values.column(spring.keys.stiffness) for spring in model.springs]
    residual = [rates[model.attachments[r][0].body][-1:] + _more_damping(model, r) for r in model.corrected]
    damped = np.concatenate([*rates, np.zeros((len(model.sprung), values.size)), *residual])
    return LaneTable(
        omega=_frequencies(model, values),
        rates=to_blocks(np.pad(damped, ((0, model.omega.size - len(damped)), (0, 0)))),
        inverse_modal_mass=to_blocks(_inverse_modal_mass(model, values)),
        mass=to_blocks(np.stack(masses + dampers + springs + alongside)),
        joint=to_blocks(np.stack(carriages + dampers + rigid + pushes)),
        weight=to_blocks(np.stack([*heavy, *dampers, *springs, *pushes])),
        damper=to_blocks(np.stack(carriages + coefficients + pushes)),
        spring=to_blocks(np.stack(carriages + dampers + stiffness + pushes)),
        pulse=to_blocks(_pulses(model, values)),
        phase=_phases(model, values),
        of_carriages=to_blocks(loads_of(model, values, heavy)),
        time_scale=to_blocks(values.scene_time_scale),
        gravity=to_blocks(values.gravity),
    )


def _frequencies(model: SceneModel, values: VariantValues) -> Array:
    """(N, 1) rad/s of all coordinates, or (blocks, N, LANES) with those of what forces that pulsate swing by."""
    if not model.pulsating:
        return model.omega[:, None]
    found = np.repeat(model.omega[:, None], values.size, axis=1)
    for number, pulse in model.pulsating.items():
        found[model.pulses.start + pulse] = values.pulsation(model.carriages[number].name)[1]
    return to_blocks(found)


def _inverse_modal_mass(model: SceneModel, values: VariantValues) -> Array:
    """(N, V) 1 over the masses of bodies' modes, 1/m of sprung masses, and 0 of what forces that pulsate swing by:
    nothing moves their coordinates."""
    found = np.ones((model.omega.size, values.size))
    for part in model.bodies:
        found[part.modes] = values.mobility(part.name, part.modal.omega.size)
    for spring in model.sprung:
        found[spring.mode] = 1.0 / values.column(spring.keys.mass)
    found[model.pulses] = 0.0
    return found


def _pulses(model: SceneModel, values: VariantValues) -> Array:
    """(ties, V) N, the amplitudes of the forces that pulsate."""
    found = np.zeros((model.ties, values.size))
    for number in model.pulsating:
        found[number] = values.pulsation(model.carriages[number].name)[0]
    return found


def _phases(model: SceneModel, values: VariantValues) -> Array:
    """(blocks, P, LANES) rad of what forces that pulsate swing by."""
    if not model.pulsating:
        return np.zeros((values.size // LANES, 0, LANES))
    found = np.zeros((model.pulses.stop - model.pulses.start, values.size))
    for number, pulse in model.pulsating.items():
        found[pulse] = values.pulsation(model.carriages[number].name)[2]
    return to_blocks(found)


def _more_damping(model: SceneModel, tie: int) -> float:
    """By how much the residual coordinate of a tie is damped (1/s) beyond its body's highest mode: nothing where the
    mass pushes along or across its track, of which what the modes miss is no small part."""
    if tie >= model.first_push or any(push.carriage == tie for push in model.pushes):
        return 0.0
    return 2.0 * RESIDUAL_DAMPING * float(model.bodies[model.attachments[tie][0].body].modal.omega[-1])


def _contact_mass(model: SceneModel, values: VariantValues, number: int) -> Array:
    """(V,) kg of a carriage whose inertia acts where it touches its body."""
    carriage = model.carriages[number]
    if carriage.inertia == "force":
        return np.zeros(values.size)
    if not model.springs_of(number):
        return moving_mass(model, values, number)
    return values.touching_mass(carriage.name)
