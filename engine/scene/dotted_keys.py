"""Values of a study by their dotted keys: looked up, replaced, and all that are numbers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from engine.study_file.refusals import Keys
from engine.study_file.spec import Spec
from results_schema.errors import BadInput

# numbers that do not belong to the model
FIXED = ("schema_version", "expected", "sweep", "output", "question", "solver.audit", "envelope")


def value_in(scene: Spec, path: str) -> Any:
    """The value at a dotted key of a scene. KeyError, which names the keys there are, where there is none."""
    found: Any = scene
    for key in path.split("."):
        inside = _keys_inside(found)
        if key not in inside:
            raise KeyError(f"{path}: no {key} there, but {', '.join(inside) or 'a number, word or nothing'}")
        found = getattr(found, key) if isinstance(found, Spec) else inside[key]
    return found


def _keys_inside(value: Any) -> Mapping[str, Any]:
    """By key what stands below a value, or what says how to get it; nothing below numbers and words."""
    if isinstance(value, Spec):
        return type(value).model_fields | dict.fromkeys(type(value).derived)
    if isinstance(value, tuple):
        return {str(index): item for index, item in enumerate(value)}
    return value if isinstance(value, dict) else {}


def values_by_key(given: Mapping[str, Any] | Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Values by dotted key, of a table or of pairs. Raises BadInput of anything else."""
    try:
        return dict(given)
    except (TypeError, ValueError):
        expected = 'a table of values by dotted key, {"carriage.table.mass": 100} say'
        raise BadInput("these are no values", where="values", expected=expected, received=repr(given)[:80]) from None


def with_value(data: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Plain data with another value at a dotted key; what is not on the way is shared. KeyError where it cannot be."""
    return _replaced(data, str(path).split("."), value, path)  # type: ignore[no-any-return]


def numbers_in(value: Any, here: str = "") -> Iterator[tuple[str, float]]:
    """Every number of the model by its dotted key."""
    if here in FIXED or isinstance(value, bool):
        return
    if isinstance(value, int | float):
        yield here, value
    inside: Iterable[tuple[Any, Any]] = ()
    if isinstance(value, Spec):
        inside = [(name, getattr(value, name)) for name in type(value).model_fields]
    elif isinstance(value, dict):
        inside = value.items()
    elif isinstance(value, tuple):
        inside = enumerate(value)
    for key, item in inside:
        yield from numbers_in(item, f"{here}.{key}" if here else str(key))


def _replaced(data: Any, keys: Keys, value: Any, path: str) -> Any:
    if not keys:
        return value
    key, rest = keys[0], keys[1:]
    if isinstance(data, list):
        if not (str(key).isdigit() and int(key) < len(data)):
            raise KeyError(path)
        index = int(key)
        return [*data[:index], _replaced(data[index], rest, value, path), *data[index + 1 :]]
    if not isinstance(data, dict):
        raise KeyError(path)
    return {**data, key: _replaced(data.get(str(key), {}), rest, value, path)}
