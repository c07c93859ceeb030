"""Every key of a study, dropped, misspelt, retyped and made NaN: each is refused, or still means something.

Use: `@pytest.mark.parametrize("how", HOW)` and `accepted(how, distinct(text), read)`.
"""

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args

from engine.study_file.document import write_document
from results_schema.errors import BadInput

How = Literal["drop", "misspell", "retype", "text", "nan"]
HOW: tuple[How, ...] = get_args(How)
# tables whose keys are the user's own names
OWN_NAMES = (("body",), ("carriage",), ("sensor",), ("envelope",), ("sweep",), ("question", "scenes"))
OWN_NAMES_OF_FRAMES = ("node", "section", "member", "point", "point_mass", "spring")


@dataclass(frozen=True)
class Mutation:
    """The data of a study with one change at a dotted key."""

    how: How
    path: tuple[str, ...]
    data: dict[str, Any]

    def __str__(self) -> str:
        return f"{self.how} {'.'.join(self.path)}"

    @property
    def text(self) -> str:
        """The study file."""
        return write_document(self.data)

    @property
    def must_fail(self) -> bool:
        """Dropping an optional key and renaming a thing nobody refers to leave a valid study."""
        inner = (self.path[0], self.path[2]) if len(self.path) == 4 else ("", "")
        own = inner == ("carriage", "contacts") or (inner[0] == "body" and inner[1] in OWN_NAMES_OF_FRAMES)
        own_name = own or self.path[:-1] in OWN_NAMES
        return self.how not in ("drop", "misspell") or (self.how == "misspell" and not own_name)


def mutations(text: str) -> list[Mutation]:
    """All mutations of a study file."""
    data = tomllib.loads(text)
    return [Mutation(how, path, changed) for path in _paths(data, ()) for how, changed in _changes(data, path)]


def distinct(*texts: str) -> list[Mutation]:
    """One mutation for each key that means something else: what the user calls a thing, where an item stands in a list,
    and, for what belongs to a body, in which kind of study do not matter."""
    found: dict[tuple[object, ...], Mutation] = {}
    for text in texts:
        data = tomllib.loads(text)
        for mutation in mutations(text):
            found.setdefault((mutation.how, *_meaning(data, mutation.path)), mutation)
    return list(found.values())


def accepted(how: How, tried: list[Mutation], read: Callable[[str], object]) -> list[Mutation]:
    """Those of one sort that mean something; all others are refused with the place."""
    chosen = [mutation for mutation in tried if mutation.how == how]
    assert chosen
    return [mutation for mutation in chosen if survives(mutation, read)]


def survives(mutation: Mutation, read: Callable[[str], object]) -> bool:
    """Read a mutation; True if it was accepted, False if it was refused with a message that names the place.

    Anything but BadInput passes through and fails the test.
    """
    try:
        read(mutation.text)
    except BadInput as error:
        message = str(error)
        assert any(key in message for key in mutation.path if not key.isdigit()), message
        assert "\n" not in message
        return False
    assert not mutation.must_fail, f"{mutation} was accepted"
    return True


def _meaning(data: dict[str, Any], path: tuple[str, ...]) -> Iterator[object]:
    """The key without the user's own names, and the kinds of the tables on the way to it."""
    for n, name in enumerate(path):
        here = _at(data, path[:n])
        if isinstance(here, dict):
            yield here.get("kind") if n > 0 or path[0] != "body" else ""
        own = n == 3 and path[2] in (*OWN_NAMES_OF_FRAMES, "contacts", "supports")
        yield "*" if own or isinstance(here, list) or path[:n] in OWN_NAMES else name


def _paths(value: Any, here: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    if here:
        yield here
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in inside:
        yield from _paths(item, (*here, str(key)))


def _changes(data: dict[str, Any], path: tuple[str, ...]) -> Iterator[tuple[How, dict[str, Any]]]:
    value = _at(data, path)
    if not path[-1].isdigit():
        yield "drop", _changed(data, path, lambda table, key: table.pop(key))
        yield "misspell", _changed(data, path, lambda table, key: table.update({f"{key}x": table.pop(key)}))
    yield "retype", _set(data, path, "x" if isinstance(value, bool) else True)
    if isinstance(value, int | float) and not isinstance(value, bool):
        yield "text", _set(data, path, str(value))
    yield "nan", _set(data, path, float("nan"))


def _set(data: dict[str, Any], path: tuple[str, ...], value: Any) -> dict[str, Any]:
    def put(table: Any, key: Any) -> None:
        table[key] = value

    return _changed(data, path, put)


def _changed(data: Any, path: tuple[str, ...], change: Callable[[Any, Any], object]) -> Any:
    copy = dict(data) if isinstance(data, dict) else list(data)
    key: Any = path[0] if isinstance(copy, dict) else int(path[0])
    if len(path) == 1:
        change(copy, key)
    else:
        copy[key] = _changed(copy[key], path[1:], change)
    return copy


def _at(data: Any, path: tuple[str, ...]) -> Any:
    for key in path:
        data = data[int(key)] if isinstance(data, list) else data[key]
    return data
