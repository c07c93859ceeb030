"""A uniform Euler-Bernoulli beam, pinned, clamped, free or on springs, as a modal body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.beam.dimensionless_modes import UnitModes, unit_modes
from engine.bodies.beam.statics import Restraint, beam_statics, merge, stations
from engine.bodies.modal.modal_body import Array, ModalBody, frozen
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.beam.beam import Beam

MOST_MODES = 512
_END_RESTRAINTS = {"free": (), "pinned": (0,), "clamped": (0, 1)}


def restraints_of(beam: Beam) -> tuple[Restraint, ...]:
    """Ends and springs in dimensionless form, merged and sorted."""
    found = [
        Restraint(place, order, 0.0)
        for place, end in zip((0.0, 1.0), beam.ends, strict=True)
        for order in _END_RESTRAINTS[end]
    ]
    for spring in beam.springs:
        for order, stiffness in enumerate((spring.stiffness, spring.rotational)):
            if stiffness > 0.0:
                unit = beam.bending_stiffness / beam.length ** (3 - 2 * order)
                found.append(Restraint(spring.at / beam.length, order, unit / stiffness))
    return merge(found)


def uniform_beam(beam: Beam, modes: int) -> ModalBody:
    """The beam with its lowest `modes` modes (rigid-body modes included) and its exact statics.

    Sign: going from s = 0, the first place where a mode reaches half of its largest value is positive there.
    Raises BadInput unless 1 <= modes <= MOST_MODES.

    >>> from engine.bodies.beam.beam import Beam
    >>> numbers = dict.fromkeys(("length", "area", "second_moment", "youngs_modulus", "density"), 1.0)
    >>> np.round(uniform_beam(Beam(kind="beam", supports="pinned-pinned", **numbers), modes=3).wave_number / np.pi, 12)
    array([1., 2., 3.])
    """
    if not (isinstance(modes, int | np.integer) and 1 <= modes <= MOST_MODES):
        raise BadInput("so many modes", where="modes", expected=f"1 to {MOST_MODES}", received=repr(modes))
    restraints = restraints_of(beam)
    unit = unit_modes(restraints, int(modes))
    length, stiffness, line_mass, mass = beam.length, beam.bending_stiffness, beam.mass_per_length, beam.mass
    return ModalBody(
        length=length,
        mass=mass,
        omega=frozen(unit.omega * math.sqrt(stiffness / line_mass) / length**2),
        participation=frozen(unit.integral * math.sqrt(mass)),
        wave_number=frozen(np.sqrt(unit.omega) / length),
        bending_stiffness=stiffness,
        second_moment=beam.second_moment,
        fibre_distance=math.nan if beam.fibre_distance is None else beam.fibre_distance,
        joints=tuple(spring.at for spring in beam.springs if 0.0 < spring.at < length),
        dampers=tuple((spring.at, spring.damping) for spring in beam.springs if spring.damping > 0.0),
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
