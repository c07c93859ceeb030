"""Tables of pieces by name: the program's own, and those that other packages bring by entry points."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from operator import attrgetter
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from results_schema.errors import BadInput

T = TypeVar("T")
ABSENT = "is the package installed that brings it?"


def by_other_names(*rows: tuple[str, str]) -> dict[str, str]:
    """What others call something -> what it is called here, from rows of the latter and the words of others.

    >>> by_other_names(("beam", "girder bar"))
    {'girder': 'beam', 'bar': 'beam'}
    """
    return {other: own for own, others in rows for other in others.split()}


@dataclass(frozen=True, eq=False)
class Pieces(Mapping[str, T], Generic[T]):
    """Pieces of one sort by name; those of other packages are imported when they are first asked for.

    group: of the entry points; names of the program's own count for nothing there. noun: as in "the body ... of another
    package". wanted: what an entry point must name. missing: what a piece lacks for that. name: as the piece itself has
    it. Raises BadInput for a piece that cannot be had, KeyError for an unknown name.
    """

    group: str
    noun: str
    own: Mapping[str, T]
    wanted: str
    missing: Callable[[Any], Sequence[str]]
    name: Callable[[Any], object] = attrgetter("name")

    @cached_property
    def foreign(self) -> Mapping[str, EntryPoint]:
        """The entry points of pieces that other packages bring, by name."""
        return {point.name: point for point in entry_points(group=self.group) if point.name not in self.own}

    def __getitem__(self, name: str) -> T:
        return self.own[name] if name in self.own else cast(T, self._load(self.foreign[name]))

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in self.foreign

    def __iter__(self) -> Iterator[str]:
        return iter((*self.own, *self.foreign))

    def __len__(self) -> int:
        return len(self.own) + len(self.foreign)

    def sources(self, name: str) -> list[Path]:
        """The files of a piece of another package: its module, or all of the package that this is in; none of an own
        one."""
        if name in self.own or name not in self.foreign:
            return []
        module = import_module(self.foreign[name].module)
        file = Path(str(module.__file__))
        return sorted(file.parent.rglob("*.py")) if module.__package__ else [file]

    def _load(self, point: EntryPoint) -> object:
        where = f"entry point {point.name} = {point.value}"
        try:
            piece = point.load()
        except Exception as error:
            what = f"the {self.noun} {point.name} of another package cannot be imported"
            received = f"{type(error).__name__}: {error}"[:200]
            raise BadInput(what, where=where, received=received, remedy="mend or remove that package") from None
        missing = self.missing(piece)
        if missing or self.name(piece) != point.name:
            expected = f'{self.wanted}, whose name is "{point.name}"'
            received = f"without {', '.join(missing)}" if missing else f'the name "{self.name(piece)}"'
            raise BadInput(f"{point.value} is no {self.noun}", where=where, expected=expected, received=received)
        return piece


def lacks(*names: str) -> Callable[[Any], list[str]]:
    """Tells which of some attributes an object does not have."""
    return lambda piece: [name for name in names if not hasattr(piece, name)]


def no_row_of(row: type) -> Callable[[Any], list[str]]:
    """Tells whether an object is no row of a table."""
    return lambda piece: [] if isinstance(piece, row) else [f"the class {row.__name__}"]


def unfinished(base: type) -> Callable[[Any], list[str]]:
    """Tells what a class lacks of those that are made of a base class: the base itself, or what it leaves open."""

    def missing(piece: Any) -> list[str]:
        if not (isinstance(piece, type) and issubclass(piece, base)):
            return [f"the base class {base.__name__}"]
        return sorted(vars(piece).get("__abstractmethods__", ()))

    return missing
