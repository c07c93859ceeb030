"""Numbers that no beam has, nearly always because they are in another unit than SI, and what they may be meant as."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.study_file.checks import Check
from engine.study_file.units import (
    Acceleration,
    Area,
    Density,
    Dimensionless,
    Length,
    Pressure,
    SecondMoment,
    Unit,
    unit_of,
)

NEAR = 0.01  # of a thousand, as a power: 7 %


@dataclass(frozen=True)
class Doubt(Check):
    """A condition that a study may break, but hardly means to; `needs` begins with the number in doubt.

    others: units in which that number may have been thought; "MPa=GPa" where it is one in MPa that was thought in GPa.
    """

    unit: Unit
    others: tuple[str, ...]

    def amount(self, values: Mapping[str, Any]) -> str:
        """The number in doubt with its unit."""
        return f"{values[self.needs[0]]:.6g} {self.unit.typed}".rstrip()

    def meant(self, values: Mapping[str, Any]) -> str:
        """The number with other units that make it likely, as a question, or ""."""
        number, likely = self.needs[0], list[str]()
        for other in self.others:
            typed, _, thought = other.rpartition("=")
            amount = values[number] / (self.unit.si(f"1 {typed}") if typed else 1.0)
            if self.met({**values, number: amount * self.unit.si(f"1 {thought}")}):
                likely.append(f'"{amount:.6g} {thought}"')
        return f"did you mean {' or '.join(likely)}?" if likely else ""


def section_doubts(here: str, length: str, *fibres: str) -> list[Doubt]:
    """Of a uniform section with its material at the dotted key `here`, of a body whose length has the key `length`, and
    of those of its keys that tell how far its extreme fibres lie out.

    A study in which neither the modulus nor the density is that of a material has units of its own, and no doubts.
    """
    material = (f"{here}.youngs_modulus", f"{here}.density")

    def doubt(dimension: Any, others: str, needs: tuple[str, ...], expected: str, likely: Callable[..., Any]) -> Doubt:
        def holds(*values: Any) -> Any:
            modulus, density = values[-2:]
            return likely(*values[:-2]) | ~(np.asarray(_modulus_of_matter(modulus)) | _density_of_matter(density))

        what = "no beam has this"
        return Doubt(needs[0], (*needs, *material), holds, what, expected, unit_of(dimension), tuple(others.split()))

    # The slenderest masts are some 500 radii of gyration long; a length in mm is a thousand times what was meant.
    area, inertia = f"{here}.area", f"{here}.second_moment"
    return [
        doubt(Pressure, "GPa MPa", material[:1], "1e5 to 2e12 Pa, steel 2.1e11", _modulus_of_matter),
        doubt(Pressure, "MPa=GPa", material, "above 5e8 Pa for what is denser than 2000 kg/m3", _stiff_where_heavy),
        doubt(Density, "g/cm^3 t/mm^3", material[1:], "20 to 50000 kg/m3, steel 7850", _density_of_matter),
        doubt(Length, "mm cm", (length,), "1e-4 to 1e4 m", lambda size: (size >= 1e-4) & (size <= 1e4)),
        doubt(Length, "mm cm", (length, area, inertia), "at most 5000 times sqrt(second_moment/area), in m",
              lambda along, across, size: (along**2 * across <= 5000**2 * size) | (across > along**2 / 4)),
        doubt(Area, "mm^2 cm^2", (area, length), "at most length^2/4, in m2",
              lambda size, along: size <= along**2 / 4),
        doubt(SecondMoment, "mm^4 cm^4", (inertia, area, length), "at most area x length^2/16, in m4",
              lambda size, across, along: size <= across * along**2 / 16),
        *(doubt(Length, "mm cm", (f"{here}.{fibre}", length), "at most half the length of its body, in m",
                lambda size, along: size <= along / 2) for fibre in fibres),
    ]  # fmt: skip


def damping_doubt(here: str) -> Doubt:
    """Of one damping ratio for all modes of a body at the dotted key `here`."""
    key = f"{here}.damping_ratio"
    what, expected = "hardly any structure is damped so much", "at most 0.3, steel 0.005, concrete 0.02"
    return Doubt(key, (key,), lambda ratio: ratio <= 0.3, what, expected, unit_of(Dimensionless), ("%",))


def gravity_doubt() -> Doubt:
    """Of gravity in mm and not in m, either way."""
    what, expected = "this is a thousandth or a thousand times of what there is", "9.81 m/s2, or 0"
    others, unit = ("mm/s^2=m/s^2", "mm/s^2"), unit_of(Acceleration)
    return Doubt("gravity", ("gravity",), _in_metres, what, expected, unit, others)


def _in_metres(gravity: Any) -> Any:
    """Whether it is no power of a thousand beside 9.81 m/s2."""
    powers = np.log10(np.where(gravity == 0.0, 1.0, np.abs(gravity)) / 9.81) / 3.0
    return (np.abs(powers - np.rint(powers)) > NEAR) | (np.rint(powers) == 0.0)


def _modulus_of_matter(modulus: Any) -> Any:
    """From rubber to diamond, Pa."""
    return (modulus >= 1e5) & (modulus <= 2e12)


def _stiff_where_heavy(modulus: Any, density: Any) -> Any:
    """Of metals, stone and concrete lead has the least modulus, 1.6e10 Pa; rubber and foam are lighter."""
    return (modulus >= 5e8) | (density <= 2000)


def _density_of_matter(density: Any) -> Any:
    """From foam to osmium, kg/m3; and where the area is 1, of what masses per length (kg/m) there are."""
    return (density >= 20) & (density <= 50_000)
