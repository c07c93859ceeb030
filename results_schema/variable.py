"""One output as it is declared: name, dimensions, type, unit, meaning; and the registry of all declarations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Literal

from results_schema.status import flag_meanings, flag_values

EVERY_KIND = "*"
AXES = "axes"

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Variable:
    """One output, or one template for the outputs of every sensor, carriage or envelope.

    dims: dimensions beyond the leading ones; "a|b" allows either.
    units: udunits text; "{sensor}", "{envelope}" are its own unit, "" dimensionless.
    lead: the leading dimensions: "grid" those of `status`; "history" those or the single dimension `history`
        (a choice of variants, whose coordinate is the flat number in the grid, last axis fastest); "some" those of the
        study's sweep that matter (in a group, which has no status); "none".
    nan_allowed: NaN may occur in a variant whose status keeps the values, and numbers in one whose does not.
    planned: no version writes it yet; left out of the table for people.
    gaps_allowed: NaN may occur at some instants of a history whose status keeps the values, but not at all of them.
    """

    name: str
    dims: tuple[str, ...] = ()
    dtype: str = "float64"
    units: str | None = ""
    long_name: str = ""
    meaning: str = ""
    flags: type[IntEnum] | None = None
    required: bool = True
    nan_allowed: bool = False
    gaps_allowed: bool = False
    planned: bool = False
    lead: Literal["grid", "history", "some", "none"] = "grid"

    def attributes(self) -> dict[str, Any]:
        """CF attributes of an expanded variable; `comment` holds the meaning.

        `flag_values` is a list of int: the writer stores it in the variable's dtype.
        """
        found: dict[str, Any] = {"long_name": self.long_name}
        if self.flags is not None:
            found |= {"flag_values": flag_values(self.flags), "flag_meanings": flag_meanings(self.flags)}
        elif self.units is not None and self.dtype != "str":
            found["units"] = self.units or "1"
        return found | ({"comment": self.meaning} if self.meaning else {})

    def holding(
        self, values: Any, dims: Sequence[str] | None = None
    ) -> tuple[tuple[str, ...], np.ndarray, dict[str, Any]]:
        """Dimensions, values in the declared type, and attributes, as a dataset takes them."""
        import numpy as np

        array = np.asarray(values)
        own = tuple(self.dims if dims is None else dims)
        return own, array if self.dtype == "str" else array.astype(self.dtype), self.attributes()


def axis(name: str, long_name: str, units: str = "", dtype: str = "float64", meaning: str = "") -> Variable:
    """A coordinate along a dimension of its own, where a dataset has that."""
    return Variable(name, (name,), dtype, units, long_name, meaning, required=False, lead="none")


def beside(
    name: str, dims: tuple[str, ...], long_name: str, meaning: str = "", units: str = "", *, nan_allowed: bool = True
) -> Variable:
    """A number that some studies have, over dimensions of its own beside the sweep."""
    return Variable(name, dims, "float64", units, long_name, meaning, None, False, nan_allowed, lead="none")


REGISTRY: dict[str, dict[str, Variable]] = {}


def declare(kind: str, *variables: Variable) -> None:
    """Add the outputs of a kind of study ("*": of every kind, "axes": coordinates, "/audit": of a group).

    Raises ValueError when a name is declared again with another meaning.
    """
    known = REGISTRY.setdefault(kind, {})
    for variable in variables:
        if known.setdefault(variable.name, variable) != variable:
            raise ValueError(f"{variable.name} of {kind} is declared twice: expected {known[variable.name]}")
