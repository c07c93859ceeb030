"""A uniform Euler-Bernoulli beam, pinned, clamped, free or on springs, as a modal body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.beam.dimensionless_modes import UnitModes, unit_modes
from engine.bodies.beam.statics import Restraint, beam_statics, merge, stations
from engine.bodies.modal.modal_body import Array, ModalBody
from results_schema.errors import BadInput

MOST_MODES = 512
_END_RESTRAINTS = {"free": (), "pinned": (0,), "clamped": (0, 1)}


@dataclass(frozen=True)
class Spring:
    """Point support: place m; stiffness N/m; rotational stiffness N m/rad; damping N s/m (not part of the modes)."""

    at: float
    stiffness: float = 0.0
    rotational: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class BeamProperties:
    """A uniform beam in SI units; raises BadInput for values without a meaning.

    ends: "pinned", "clamped" or "free" at s = 0 and at s = length. None means free with `supports`, else pinned.
    supports: springs anywhere on the beam, besides the ends.
    """

    length: float
    area: float
    second_moment: float
    youngs_modulus: float
    density: float
    ends: tuple[str, str] | None = None
    supports: tuple[Spring, ...] = ()
    fibre_distance: float = math.nan

    def __post_init__(self) -> None:
        for name in ("length", "area", "second_moment", "youngs_modulus", "density"):
            _demand(name, getattr(self, name), "> 0", 0.0 < getattr(self, name) < math.inf)
        for end in self.end_conditions:
            _demand("ends", end, "pinned, clamped or free", end in _END_RESTRAINTS)
        for number, spring in enumerate(self.supports):
            where = f"supports[{number}]"
            _demand(f"{where}.at", spring.at, f"0 to {self.length:g} m", 0.0 <= spring.at <= self.length)
            for name in ("stiffness", "rotational", "damping"):
                value = getattr(spring, name)
                _demand(f"{where}.{name}", value, ">= 0", 0.0 <= value < math.inf)

    @property
    def end_conditions(self) -> tuple[str, str]:
        """The ends as they are, with the default filled in."""
        if self.ends is not None:
            return self.ends
        return ("free", "free") if self.supports else ("pinned", "pinned")

    @property
    def bending_stiffness(self) -> float:
        """E I, N m^2."""
        return self.youngs_modulus * self.second_moment

    @property
    def mass_per_length(self) -> float:
        """rho A, kg/m."""
        return self.density * self.area

    @property
    def restraints(self) -> tuple[Restraint, ...]:
        """Ends and springs in dimensionless form, merged and sorted."""
        found = [
            Restraint(place, order, 0.0)
            for place, end in zip((0.0, 1.0), self.end_conditions, strict=True)
            for order in _END_RESTRAINTS[end]
        ]
        for spring in self.supports:
            for order, stiffness in enumerate((spring.stiffness, spring.rotational)):
                if stiffness > 0.0:
                    unit = self.bending_stiffness / self.length ** (3 - 2 * order)
                    found.append(Restraint(spring.at / self.length, order, unit / stiffness))
        return merge(found)


def _demand(where: str, value: object, expected: str, fine: bool) -> None:
    if not fine:
        raise BadInput("value without a meaning for a beam", where=where, expected=expected, received=repr(value))


def uniform_beam(properties: BeamProperties, modes: int) -> ModalBody:
    """The beam with its lowest `modes` modes (rigid-body modes included) and its exact statics.

    Sign: going from s = 0, the first place where a mode reaches half of its largest value is positive there.
    Raises BadInput unless 1 <= modes <= MOST_MODES.

    >>> beam = uniform_beam(BeamProperties(1.0, 1.0, 1.0, 1.0, 1.0), modes=3)
    >>> np.round(beam.wave_number / np.pi, 12)
    array([1., 2., 3.])
    """
    _demand("modes", modes, f"1 to {MOST_MODES}", isinstance(modes, int | np.integer) and 1 <= modes <= MOST_MODES)
    restraints = properties.restraints
    unit = unit_modes(restraints, int(modes))
    length, stiffness, line_mass = properties.length, properties.bending_stiffness, properties.mass_per_length
    mass = line_mass * length
    wave_number = _frozen(np.sqrt(unit.omega) / length)
    return ModalBody(
        length=length,
        mass=mass,
        omega=_frozen(unit.omega * math.sqrt(stiffness / line_mass) / length**2),
        participation=_frozen(unit.integral * math.sqrt(mass)),
        wave_number=wave_number,
        bending_stiffness=stiffness,
        second_moment=properties.second_moment,
        fibre_distance=properties.fibre_distance,
        dampers=tuple((spring.at, spring.damping) for spring in properties.supports if spring.damping > 0.0),
        shapes=BeamShapes(length, mass, unit),
        statics=beam_statics(length, stiffness, line_mass, restraints),
    )


@dataclass(frozen=True, eq=False)
class BeamShapes:
    """`UnitModes` of a beam of this length (m) and mass (kg)."""

    length: float
    mass: float
    unit: UnitModes

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j phi_k/ds^j at the stations `s` (S,) for several j, as (orders, S, N), kg^(-1/2) m^(-j)."""
        x = stations(s, self.length, *orders)
        scale = [1.0 / (math.sqrt(self.mass) * self.length**order) for order in orders]
        return self.unit.derivatives(x, orders, scale)


def _frozen(values: Array) -> Array:
    values.flags.writeable = False
    return values
