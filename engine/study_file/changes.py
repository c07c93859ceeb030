"""What differs between two study files."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple


class Change(NamedTuple):
    """A key of the study file in both; None where one has it not."""

    key: str
    first: Any
    second: Any


def changes(first: str, second: str) -> list[Change]:
    """The keys by which two texts of study files differ.

    >>> changes("modes = 4\\nmass = 1.0", "modes = 4\\nmass = 2.0")
    [Change(key='mass', first=1.0, second=2.0)]
    """
    old, new = (dict(_leaves(tomllib.loads(text))) for text in (first, second))
    return [Change(key, old.get(key), new.get(key)) for key in {**old, **new} if old.get(key) != new.get(key)]


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of nested tables, and of lists of tables, by its dotted key."""
    inside = value.items() if isinstance(value, Mapping) else enumerate(value) if _holds_tables(value) else None
    if inside is None:
        yield key, value
        return
    for name, item in inside:
        yield from _leaves(item, f"{key}.{name}" if key else str(name))


def _holds_tables(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(item, Mapping) for item in value)
