"""Conditions on numbers of a study: of any by itself, and between several, for one value and for columns of a sweep."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from engine.study_file.document import Source
    from results_schema.errors import BadInput

# Sizes, beside 0, of what studies are made of in SI units: from the inertia of molecules to what stands for infinite.
# Whatever is taken to the fourth power on the way to a deflection stays within the range of floating-point numbers.
SMALLEST, LARGEST = 1e-50, 1e30
NOT_MEANT = "no usable number"
NO_JERK = "leave jerk out for no limit; in a list take a large one such as 1e6"
NO_LIMIT = "a large number such as 1e6 where there is no limit"
SIZES = f"0 or of a size from {SMALLEST:g} to {LARGEST:g}"


def is_meant(value: float | Fraction) -> bool:
    """Whether a number has a size that a study may mean (no NaN does).

    >>> [is_meant(value) for value in (0, -2.5, 1e300, 5e-324, float("nan"))]
    [True, True, False, False, False]
    """
    return value == 0 or SMALLEST <= value <= LARGEST or -LARGEST <= value <= -SMALLEST


@dataclass(frozen=True)
class Check:
    """A condition on some numbers of a study.

    where: dotted key that an error names. needs: dotted keys of the numbers that decide.
    holds: takes those numbers in this order, as floats or arrays that broadcast; True where the condition is met.
    """

    where: str
    needs: tuple[str, ...]
    holds: Callable[..., Any]
    what: str
    expected: str
    remedy: str = field(default="", kw_only=True)

    def met(self, values: Mapping[str, Any]) -> NDArray[np.bool_]:
        """Verdict for values by dotted key, of their broadcast shape."""
        return np.asarray(self.holds(*(values[key] for key in self.needs)), dtype=bool)

    def fault(self, values: Mapping[str, Any], source: Source, places: str = "") -> BadInput:
        """The error with the deciding numbers in words; places: where in a sweep they are."""
        numbers = ", ".join(f"{source.written(key)} = {values[key]:.10g}" for key in self.needs[:6])
        received, remedy = f"{numbers}{places}", self.remedy
        return source.fault(self.where, self.what, expected=self.expected, received=received, remedy=remedy)


def on_body(where: str, needs: tuple[str, str], what: str) -> Check:
    """A place on a body: needs names the place and the body's length."""
    expected, remedy = "0 to the body's length", "another place, or another unit of the place or of the length"
    return Check(where, needs, lambda at, length: (at >= 0) & (at <= length), what, expected, remedy=remedy)
