"""What differs from variant to variant without changing the scene's shape: mass, force, pace, damping, gravity.

Every other swept number changes the scene itself, and the plan groups by it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.kernels.layout import LANES, Lanes
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.model.ties import DamperTie, SpringTie
    from engine.scene.study import Study


#: Keys of numbers that a lane may have to itself.
LANE_KEYS = re.compile(
    r"gravity|solver\.(steps|tolerance)"
    r"|body\.\w+\.(damping_ratio(\..+)?|supports\.\d+\.damping|spring\.\w+\.(rotational_)?damping\.\d)"
    r"|carriage\.\w+\.(mass|wheel_mass|stiffness|damping|force|delay|headway)"
    r"|carriage\.\w+\.contacts\.\w+\.damping"
    r"|carriage\.\w+\.motion\.(speed|frequency)"
)
_DIGITS = 2.0**40  # timing is rounded to this part of itself, so that equal ratios group whatever their rounding


@dataclass(frozen=True, eq=False)
class VariantValues:
    """Numbers of a study for some variants: swept columns (V,) by dotted key, the study's own value elsewhere."""

    study: Study
    columns: Mapping[str, Array]
    size: int

    def _of(self, path: str) -> Array:
        """(V,) values at a dotted key."""
        found = self.columns.get(path)
        if found is None:
            value = self.study.value(path)
            return np.full(self.size, 0.0 if value is None else float(value))  # None: a delay that is not set
        return found

    @property
    def gravity(self) -> Array:
        """(V,) m/s^2."""
        return self._of("gravity")

    @property
    def steps(self) -> NDArray[np.int64]:
        """(V,) steps over a passage or cycle, where the study fixes them."""
        return self._of("solver.steps").astype(np.int64)

    @property
    def tighter(self) -> Array:
        """(V,) `solver.tolerance` over the study's own."""
        return self._of("solver.tolerance") / self.study.solver.tolerance

    def speed(self, carriage: str) -> Array:
        """(V,) m/s, the top speed of a motion that has one."""
        return self._of(f"carriage.{carriage}.motion.speed")

    def force(self, carriage: str) -> Array:
        """(V,) N of a carriage besides its weight."""
        return self._sum(carriage, self.study.carriage[carriage].forces)

    def touching_mass(self, carriage: str) -> Array:
        """(V,) kg of a carriage that touch the body."""
        return self._sum(carriage, self.study.carriage[carriage].touching)

    def sprung_mass(self, spring: SpringTie) -> Array:
        """(V,) kg that stand on a spring."""
        return self._of(f"{spring.key}.mass")

    def stiffness(self, spring: SpringTie) -> Array:
        """(V,) N/m."""
        return self._of(f"{spring.key}.stiffness")

    def damping(self, tie: SpringTie | DamperTie) -> Array:
        """(V,) N s/m of a damper, or of that beside a spring."""
        return self._of(tie.damping_key)

    @property
    def padded(self) -> VariantValues:
        """The same filled up to whole blocks by repeating the last variant."""
        return self.part(padded(np.arange(self.size)))

    def part(self, lanes: NDArray[np.int64]) -> VariantValues:
        """Some of the variants."""
        return VariantValues(self.study, {path: column[lanes] for path, column in self.columns.items()}, lanes.size)

    def time_scale(self, carriage: str) -> Array:
        """(V,) seconds per unit of a carriage's own tau."""
        motion = self.study.carriage[carriage].motion
        if motion.pace is None:
            return np.full(self.size, motion.time_scale)
        key = f"carriage.{carriage}.motion.{motion.pace}"
        return float(motion.time_scale * self.study.value(key)) / self._of(key)

    @property
    def scene_time_scale(self) -> Array:
        """(V,) seconds per unit of scene time."""
        return self.time_scale(self.study.clock)

    def start_time(self, carriage: str) -> Array:
        """(V,) seconds after time 0 at which a carriage sets off."""
        spec = self.study.carriage[carriage]
        if spec.headway is None:
            return self._of(f"carriage.{carriage}.delay")
        return self._of(f"carriage.{carriage}.headway") * self.time_scale(carriage) / spec.motion.max_speed

    def timing(self) -> dict[str, tuple[Array, Array]]:
        """Per carriage pace and delay (V,) relative to the scene's time scale, rounded so that they group."""
        first = self.scene_time_scale
        return {
            name: (rounded(first / self.time_scale(name)), rounded(self.start_time(name) / first))
            for name in self.study.carriage
        }

    def own_mass(self, carriage: str) -> Array:
        """(V,) kg of a carriage by its own keys."""
        return self._sum(carriage, self.study.carriage[carriage].masses)

    def _sum(self, carriage: str, keys: tuple[str, ...]) -> Array:
        return sum((self._of(f"carriage.{carriage}.{key}") for key in keys), np.zeros(self.size))

    def damping_rates(self, body: str, omega: Array) -> Array:
        """(N, V) 2 zeta omega of a body's modes, 1/s: one ratio, one per mode, or Rayleigh's a + b omega^2."""
        key = f"body.{body}.damping_ratio"
        spec = self.study.body[body]
        if spec.rayleigh is not None:
            return self._of(f"{key}.rayleigh.0") + self._of(f"{key}.rayleigh.1") * omega[:, None] ** 2
        if spec.modal_ratios:
            last = len(spec.modal_ratios) - 1  # goes on for modes beyond the list
            return np.stack([2.0 * self._of(f"{key}.{min(k, last)}") * w for k, w in enumerate(omega)])
        return 2.0 * self._of(key) * omega[:, None]


def moving_mass(model: SceneModel, values: VariantValues, carriage: int) -> Array:
    """(V,) kg of a whole carriage."""
    tie = model.carriages[carriage]
    return values.own_mass(tie.name) + tie.own_mass


def weight(model: SceneModel, values: VariantValues, carriage: int) -> Array:
    """(V,) N of a carriage along the deflections of the track that it rides."""
    tie = model.carriages[carriage]
    share = model.bodies[tie.body].modal.gravity_share
    return values.force(tie.name) + moving_mass(model, values, carriage) * values.gravity * share


def weights(model: SceneModel, values: VariantValues) -> Array:
    """(C, V) N of all carriages."""
    return np.stack([weight(model, values, number) for number in range(len(model.carriages))])


def rounded(values: Array) -> Array:
    """Values rounded to 40 binary digits."""
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.rint(mantissa * _DIGITS) / _DIGITS, exponent)


def padded(variants: NDArray[np.int64]) -> NDArray[np.int64]:
    """Variants filled up to whole blocks by repeating the last one."""
    return np.pad(variants, (0, -variants.size % LANES), mode="edge")


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

    omega (N,);  rates (blocks, N, LANES): 2 zeta omega;  inverse_modal_mass (blocks, N, LANES): 1, and 1/m (1/kg) of
    sprung masses;  mass, weight (blocks, ties, LANES): of the carriages, zero for dampers and springs, mass only what
    touches the body and has inertia;  joint (blocks, ties, LANES): 1 for rigid joints;  damper, spring (blocks, ties,
    LANES): N s/m and N/m, zero for carriages;  time_scale, gravity (blocks, LANES).
    """

    omega: Array
    rates: Array
    inverse_modal_mass: Array
    mass: Array
    joint: Array
    weight: Array
    damper: Array
    spring: Array
    time_scale: Array
    gravity: Array

    def steps_of(self, step: Array) -> Lanes:
        """The kernels' lanes for a step h (blocks, LANES) in s."""
        h = step[:, None, :]
        return Lanes(
            stiffness=(self.omega[:, None] * h) ** 2,
            damping=self.rates * h,
            inverse_modal_mass=self.inverse_modal_mass,
            coupling_mass=self.mass + self.joint + self.damper * h,
            coupling_stiffness=self.spring * h**2,
            load=self.weight * h**2,
            gravity=self.gravity,
            step=step,
        )


def lane_table(model: SceneModel, values: VariantValues) -> LaneTable:
    """The lanes of some variants, whose number must be a multiple of LANES."""
    rates = [values.damping_rates(part.name, part.modal.omega) for part in model.bodies]
    none, numbers = np.zeros(values.size), range(len(model.carriages))
    masses = [_contact_mass(model, values, number) for number in numbers]
    carriages, dampers, springs = ([none] * len(part) for part in (model.carriages, model.dampers, model.springs))
    rigid = [np.full(values.size, float(spring.rigid)) for spring in model.springs]
    coefficients = [*map(values.damping, model.dampers), *map(values.damping, model.springs)]
    pushes, alongside = [none] * len(model.pushes), [moving_mass(model, values, p.carriage) for p in model.pushes]
    stiffness = [none if spring.rigid else values.stiffness(spring) for spring in model.springs]
    ones, others = np.ones((model.body_modes, values.size)), model.omega.size - model.body_modes
    constant = others - len(model.sprung)
    return LaneTable(
        omega=model.omega,
        rates=to_blocks(np.concatenate([*rates, np.zeros((others, values.size))])),
        inverse_modal_mass=to_blocks(
            np.concatenate([ones, *(1.0 / values.sprung_mass(s)[None] for s in model.sprung), ones[:constant]])
        ),
        mass=to_blocks(np.stack(masses + dampers + springs + alongside)),
        joint=to_blocks(np.stack(carriages + dampers + rigid + pushes)),
        weight=to_blocks(np.stack([*weights(model, values), *dampers, *springs, *pushes])),
        damper=to_blocks(np.stack(carriages + coefficients + pushes)),
        spring=to_blocks(np.stack(carriages + dampers + stiffness + pushes)),
        time_scale=to_blocks(values.scene_time_scale),
        gravity=to_blocks(values.gravity),
    )


def _contact_mass(model: SceneModel, values: VariantValues, number: int) -> Array:
    """(V,) kg of a carriage whose inertia acts where it touches its body."""
    carriage = model.carriages[number]
    if carriage.inertia == "force":
        return np.zeros(values.size)
    if not model.springs_of(number):
        return moving_mass(model, values, number)
    return values.touching_mass(carriage.name)
