"""What differs from variant to variant: columns of numbers for the models below, which know no dotted key.

Mass, force, pace, damping and gravity may differ within one scene, and so may what changes the units of time and force
alone (`engine.scene.similarity`) and the masses of rigid bodies that ride; every other swept number changes the scene
itself, and the plan groups by it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.scene.similarity import UnitKeys, Units
from engine.study_file.units import exponents_of
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.bodies.modal.description import Body
    from engine.scene.carriages import Contact
    from engine.scene.study import Study
    from engine.scene.sweep import Axis, Cases


STEPS, TOLERANCE = "solver.steps", "solver.tolerance"
#: Keys of numbers that a lane may have to itself; of a motion's that one alone with which all its speeds grow.
LANE_KEYS = re.compile(
    r"gravity|solver\.(steps|tolerance)"
    r"|body\.\w+\.(damping_ratio(\..+)?|supports\.\d+\.damping|spring\.\w+\.(rotational_)?damping\.\d|point\.\w+\.damping)"
    r"|carriage\.\w+\.(mass|wheel_mass|stiffness|damping|force|delay|headway)"
    r"|carriage\.\w+\.contacts\.\w+\.damping"
    r"|carriage\.\w+\.pulsation\.(amplitude|frequency|phase)"
    r"|carriage\.\w+\.motion\.(speed|frequency)"
)
#: Keys of numbers of modes, elements and steps.
NUMERICS_KEYS = re.compile(r"solver\..+|body\..+\.(modes|elements|fixed_interface_modes)")
_DIGITS = 2.0**40  # timing is rounded to this part of itself, so that equal ratios group whatever their rounding


class SpringKeys(NamedTuple):
    """The keys of a spring's numbers: N/m, N s/m of the damper beside it, kg that stand on it."""

    stiffness: str
    damping: str
    mass: str

    @classmethod
    def of_carriage(cls, name: str) -> SpringKeys:
        """Of the spring under a sprung mass."""
        return cls(*keys_of_carriage(name, cls._fields))

    @classmethod
    def of_contact(cls, carriage: str, contact: str) -> SpringKeys:
        """Of a contact of a body that rides."""
        return cls(*keys_of_carriage(f"{carriage}.contacts.{contact}", cls._fields))


def in_step(study: Study, carriage: str, swept: Collection[str]) -> str:
    """What a force that pulsates swings by, as a dotted key: its train, where all phases of that are one and none is
    among the keys that are swept, else the carriage."""
    train, alone = study.axles.get(carriage), f"carriage.{carriage}"
    if train is None:
        return alone
    axles = [axle for axle, own in study.axles.items() if own == train]
    keys = {f"carriage.{axle}.pulsation.phase" for axle in axles}
    one = len({study.value(key) for key in keys}) == 1
    return f"train.{train}" if one and keys.isdisjoint(swept) else alone


def keys_of_carriage(name: str, keys: Sequence[str]) -> tuple[str, ...]:
    """The dotted keys of some numbers of a carriage."""
    return tuple(f"carriage.{name}.{key}" for key in keys)


def in_use(study: Study, body: str) -> bool:
    """Whether a body carries a carriage, a robot, a sensor, an envelope, a load or a spring, or its frame moves or
    holds another one."""
    moving = [name for carriage in study.carriage.values() for name in carriage.bodies]
    moving += [name for robot in study.robot.values() for name in robot.rails]
    moving += [*study.frame, *(frame.on for frame in study.frame.values())]
    moving += [load.on for load in study.load.values()]
    moving += [end.on for spring in study.spring.values() for end in spring.ends]
    read = (*(study.body_of(sensor) for sensor in study.sensor), *(e.body for e in study.envelope.values()))
    return body in (*moving, *read)


def modal_mass_keys(study: Study) -> dict[str, tuple[str, ...]]:
    """By the bodies that ride, the keys of the masses of their modes, where one number is each: such modes keep their
    shapes, and every lane has masses of its own. Not on one rigid contact: how it sets them moving is shared out by
    masses, where two or more leave no choice."""
    found = dict[str, tuple[str, ...]]()
    for carriage in study.carriage.values():
        joints = sum(contact.is_rigid for contact in carriage.riding_contacts.values())
        if carriage.riding_body is not None and joints != 1:
            keys = tuple(f"body.{carriage.riding_body}.{key}" for key in study.body[carriage.riding_body].modal_masses)
            if all(study.value(key) > 0.0 for key in keys):
                found[carriage.riding_body] = keys
    return found


#: Contacts on which a body that nothing else holds stands so that their forces at rest follow from weights alone.
DETERMINATE = 2
APART = 1e-6  # of its length: contacts nearer to each other share what they carry by rounding, if not by stiffness


def contact_stiffness_keys(study: Study) -> tuple[str, ...]:
    """The keys of the stiffnesses of contacts, where every body that rides is statically determinate: a lane may have
    them to itself, as no force at rest depends on them. Of a rigid contact there is none."""
    found = list[str]()
    for name, carriage in study.carriage.items():
        contacts = carriage.riding_contacts
        if carriage.riding_body is not None and not _is_determinate(study.body[carriage.riding_body], contacts):
            return ()
        found += (SpringKeys.of_contact(name, word).stiffness for word, own in contacts.items() if not own.is_rigid)
    return tuple(found)


def _is_determinate(body: Body, contacts: Mapping[str, Contact]) -> bool:
    """Whether it is known that a body is free, heaves and pitches, and has no more contacts than it takes, apart."""
    places = [contact.at for contact in contacts.values() if contact.at is not None]
    apart = len(places) < DETERMINATE or abs(places[0] - places[1]) > APART * body.length
    moves = body.modes == "auto" or int(body.modes) >= DETERMINATE
    return body.is_free and moves and apart and len(contacts) <= DETERMINATE


def structural(study: Study, cases: Cases) -> list[str]:
    """Swept keys that change the scene itself."""
    motions = {f"carriage.{name}.motion.": carriage.motion for name, carriage in study.carriage.items()}
    fixed = {f"{here}{key}" for here, motion in motions.items() for key in ("speed", "frequency") if key != motion.pace}
    own = UnitKeys.of(study).set_by(axis.paths for axis in cases.axes)
    own = own.union(contact_stiffness_keys(study), *modal_mass_keys(study).values())
    return [path for path in cases.paths if path in fixed or not (LANE_KEYS.fullmatch(path) or path in own)]


def sweeps_numerics(cases: Cases) -> bool:
    """Whether a sweep sets what variants are computed with, but for their tolerances."""
    return any(NUMERICS_KEYS.fullmatch(path) and path != TOLERANCE for path in cases.paths)


def axes_of_scene(cases: Cases) -> list[Axis]:
    """The axes of a sweep that change something else than the tolerance alone."""
    return [axis for axis in cases.axes if axis.paths != (TOLERANCE,)]


def cases_tolerance(study: Study, cases: Cases) -> Array:
    """(V,) `solver.tolerance` of every variant over the study's."""
    if TOLERANCE not in cases.paths:
        return np.ones(cases.size)
    return cases.column(TOLERANCE) / study.solver.tolerance


@dataclass(frozen=True, eq=False)
class VariantValues:
    """Numbers of a study for some variants: swept columns (V,) by dotted key, SI, the study's own value elsewhere.

    What it tells of them is counted in the units in which all have the stiffness and the mass of the study's body,
    which are SI unless one of these is swept (`engine.scene.similarity`).
    """

    study: Study
    columns: Mapping[str, Array]
    size: int

    @classmethod
    def of(cls, study: Study, cases: Cases, variants: Counts) -> VariantValues:
        """Of some variants of a sweep, given by their flat numbers."""
        return cls(study, cases.columns_of(variants), variants.size)

    def column(self, path: str) -> Array:
        """(V,) values at a dotted key, such as those that springs and dampers bring."""
        found = self.columns.get(path)
        if found is None:
            value = self.study.value(path)
            found = np.full(self.size, 0.0 if value is None else float(value))  # None: a delay that is not set
        if self.units is None or (dimension := self.study.unit(path)) is None:
            return found
        unit = self.units.unit(dimension.exponents)
        return found if unit is None else found / unit

    @cached_property
    def units(self) -> Units | None:
        """The units in which they are told; None where these are SI."""
        return Units.of(self.study, self.columns)

    def in_si(self, symbol: str, values: Array) -> Array:
        """Values (V, ...) that follow from them in SI; symbol: UDUNITS text."""
        unit = None if self.units is None else self.units.unit(exponents_of(symbol))
        return values if unit is None else values * unit.reshape(-1, *[1] * (values.ndim - 1))

    @property
    def gravity(self) -> Array:
        """(V,) m/s^2."""
        return self.column("gravity")

    @property
    def has_fixed_steps(self) -> bool:
        """Whether the study says how many steps."""
        return self.study.solver.steps != "auto" or STEPS in self.columns

    @property
    def steps(self) -> Counts:
        """(V,) steps over a passage or cycle, where the study fixes them."""
        return self.column(STEPS).astype(np.int64)

    @property
    def tighter(self) -> Array:
        """(V,) `solver.tolerance` over the study's own."""
        return self.column(TOLERANCE) / self.study.solver.tolerance

    def all_as_tight(self, factor: float) -> VariantValues:
        """The same, but where the tolerance is swept it is this part of the study's own."""
        if TOLERANCE not in self.columns:
            return self
        wanted = np.full(self.size, factor * self.study.solver.tolerance)
        return replace(self, columns={**self.columns, TOLERANCE: wanted})

    def speed(self, carriage: str) -> Array:
        """(V,) m/s, the top speed of a motion that has one."""
        return self.column(f"carriage.{carriage}.motion.speed")

    def force(self, carriage: str) -> Array:
        """(V,) N of a carriage besides its weight."""
        return self._sum(carriage, self.study.carriage[carriage].forces)

    def pulsation(self, carriage: str) -> tuple[Array, Array, Array]:
        """(V,) amplitude in N, angular frequency in rad/s and phase in rad of a force that pulsates."""
        keys = keys_of_carriage(f"{carriage}.pulsation", ("amplitude", "frequency", "phase"))
        amplitude, frequency, phase = map(self.column, keys)
        return amplitude, 2.0 * np.pi * frequency, phase

    def touching_mass(self, carriage: str) -> Array:
        """(V,) kg of a carriage that touch the body."""
        return self._sum(carriage, self.study.carriage[carriage].touching)

    def part(self, lanes: Counts) -> VariantValues:
        """Some of the variants."""
        if lanes.size == self.size and np.array_equal(lanes, np.arange(self.size)):
            return self
        return VariantValues(self.study, {path: column[lanes] for path, column in self.columns.items()}, lanes.size)

    def time_scale(self, carriage: str) -> Array:
        """(V,) seconds per unit of a carriage's own tau."""
        motion = self.study.carriage[carriage].motion
        if motion.pace is None:
            scale = np.full(self.size, motion.time_scale)
            return scale if self.units is None else scale / self.units.time
        key = f"carriage.{carriage}.motion.{motion.pace}"
        return float(motion.time_scale * self.study.value(key)) / self.column(key)

    @cached_property
    def scene_time_scale(self) -> Array:
        """(V,) seconds per unit of scene time."""
        return self.time_scale(self.study.clock) if self.study.carriage else np.ones(self.size)

    def start_time(self, carriage: str) -> Array:
        """(V,) seconds after time 0 at which a carriage sets off."""
        spec, delay = self.study.carriage[carriage], self.column(f"carriage.{carriage}.delay")
        if spec.headway is None:
            return delay
        return delay + self.column(f"carriage.{carriage}.headway") * self.time_scale(carriage) / spec.motion.max_speed

    def timing(self) -> dict[str, tuple[Array, Array]]:
        """Per carriage pace and delay (V,) relative to the scene's time scale, rounded so that they group."""
        first = self.scene_time_scale
        return {name: (self._pace(name), rounded(self.start_time(name) / first)) for name in self.study.carriage}

    def _pace(self, name: str) -> Array:
        """(V,) of a carriage; of one that stands from time 0 on for no longer than the first moves that with which both
        end, so that variants of different speeds share a scene."""
        motion, clock = self.study.carriage[name].motion, self.study.carriage[self.study.clock].motion
        own, first = self.time_scale(name), self.scene_time_scale
        stands = (motion.rests_from == 0.0) & (self.start_time(name) == 0.0)
        together = stands & (own * motion.duration <= first * clock.duration)
        return np.where(together, motion.duration / clock.duration, rounded(first / own))

    def mobility(self, body: str, modes: int) -> Array:
        """(N, V) 1 over the modal masses of a body's modes, which are 1 but where variants have masses of their own."""
        found = np.ones((modes, self.size))
        for mode, key in enumerate(modal_mass_keys(self.study).get(body, ())):
            if key in self.columns:
                found[mode] = float(self.study.value(key)) / self.columns[key]
        return found

    def own_mass(self, carriage: str) -> Array:
        """(V,) kg of a carriage by its own keys."""
        return self._sum(carriage, self.study.carriage[carriage].masses)

    def _sum(self, carriage: str, keys: tuple[str, ...]) -> Array:
        return sum(map(self.column, keys_of_carriage(carriage, keys)), np.zeros(self.size))

    def damping_rates(self, body: str, omega: Array) -> Array:
        """(N, V) 2 zeta omega of a body's modes, 1/s: one ratio, one per mode, or Rayleigh's a + b omega^2."""
        key = f"body.{body}.damping_ratio"
        spec = self.study.body[body]
        if spec.rayleigh is not None:
            return self.column(f"{key}.rayleigh.0") + self.column(f"{key}.rayleigh.1") * omega[:, None] ** 2
        if spec.modal_ratios:
            last = len(spec.modal_ratios) - 1  # goes on for modes beyond the list
            return np.stack([2.0 * self.column(f"{key}.{min(k, last)}") * w for k, w in enumerate(omega)])
        return 2.0 * self.column(key) * omega[:, None]


def rounded(values: Array) -> Array:
    """Values rounded to 40 binary digits."""
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.rint(mantissa * _DIGITS) / _DIGITS, exponent)
