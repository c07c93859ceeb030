"""Places, directions and supports of nodes as study files have them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, Tag

from engine.bodies.modal.outline import HELD_AT
from engine.study_file.spec import LIST, WORD, Several, Three, by_form, distinct, one_of
from engine.study_file.units import Dimensionless, Length, fault
from results_schema.errors import shortened

MAX_COORDINATE = 1e9


def _of_word(value: Any) -> Any:
    """The vector along an axis that is named, as sensors name theirs."""
    return [float(axis == value) for axis in "xyz"] if isinstance(value, str) and value in tuple("xyz") else value


def _not_zero(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(vector):
        raise fault("this direction has no length", expected="three numbers, not all zero", received=shortened(vector))
    return vector


Vector = Annotated[Three[Dimensionless], AfterValidator(_not_zero)]
#: The same, or an axis by its name.
Way = Annotated[Vector, BeforeValidator(_of_word, json_schema_input_type=Vector | Literal["x", "y", "z"])]
Coordinate = Annotated[Length, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
Place = Three[Coordinate]
_DirectionWord = Annotated[str, AfterValidator(one_of(*HELD_AT["clamped"]))]
_Directions = Annotated[Several[_DirectionWord], Field(min_length=1, max_length=6), AfterValidator(distinct)]
_MEANT = {"fixed": "clamped", "hinged": "pinned"}
_MEANT |= dict.fromkeys(("roller", "rolled", "rolling", "sliding", "guided"), '["z"]')
_HoldWord = Annotated[str, AfterValidator(one_of(*HELD_AT, meant=_MEANT))]
Support = Annotated[Annotated[_HoldWord, Tag(WORD)] | Annotated[_Directions, Tag(LIST)], by_form]
