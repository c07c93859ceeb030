"""One output as it is declared: name, dimensions, type, unit, meaning; and the registry of all declarations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from textwrap import dedent
from types import MappingProxyType
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


#: Words of a row of `outputs` and what they stand for; any other word is a type.
WORDS: Mapping[str, Mapping[str, Any]] = {
    "optional": {"required": False},
    "axis": {"required": False, "lead": "none"},
    "alone": {"lead": "none"},
    "some": {"lead": "some"},
    "history": {"lead": "history"},
    "nan": {"nan_allowed": True},
    "gaps": {"gaps_allowed": True},
}


def outputs(text: str, flags: Mapping[str, type[IntEnum]] = MappingProxyType({})) -> tuple[Variable, ...]:
    """Outputs out of a table: a row of name, dimensions, unit ("-": None), words of `WORDS` or a type, long name; below
    it, indented, the meaning, after the long name where the row has none. flags: by name.

    The words of a row "*" are those of all rows below it. An axis is a coordinate along a dimension of its own.

    >>> outputs("lag | sensor | m | nan | lag of the response")[0].dims
    ('sensor',)
    """
    found, shared = list[Variable](), list[str]()
    for line in dedent(text).strip("\n").splitlines():
        if line.startswith(" "):
            last, words = found[-1], line.strip()
            more = {"meaning": f"{last.meaning} {words}".lstrip()} if last.long_name else {"long_name": words}
            found[-1] = replace(last, **more)  # type: ignore[arg-type]
            continue
        name, dims, units, words, long_name = (cell.strip() for cell in line.split("|"))
        if name == "*":
            shared = words.split()
            continue
        given: dict[str, Any] = {"dims": tuple(dims.replace("/", "|").split()), "flags": flags.get(name)}
        for word in (*shared, *words.split()):
            given.update(WORDS.get(word, {"dtype": word}))
            if word == "axis":
                given["dims"] = (name,)
        found.append(Variable(name, units=None if units == "-" else units, long_name=long_name, **given))
    return tuple(found)


REGISTRY: dict[str, dict[str, Variable]] = {}


def declare(kind: str, *variables: Variable) -> None:
    """Add the outputs of a kind of study ("*": of every kind, "axes": coordinates, "/audit": of a group).

    Raises ValueError when a name is declared again with another meaning.
    """
    known = REGISTRY.setdefault(kind, {})
    for variable in variables:
        if known.setdefault(variable.name, variable) != variable:
            raise ValueError(f"{variable.name} of {kind} is declared twice: expected {known[variable.name]}")
