"""Which place of a study file a dotted key names, what belongs there, and pydantic's errors in the user's words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, NoReturn, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import ValidationError

from engine.study_file.document import Source
from engine.study_file.spec import LIST, NUMBER, TABLE, WORD, Hint, KindOf, Noun, Spec, nearest, synonym
from engine.study_file.units import Unit
from results_schema.errors import BadInput, shortened
from results_schema.registry import ABSENT

Keys = Sequence[str | int]

NOT_SWEPT = ("question", "output")  # tables of what is told of results
_TAGS = {NUMBER: "a number", WORD: "a word in quotes", LIST: "a list", TABLE: "a table"}
_BOUNDS: tuple[tuple[type, str, str], ...] = ((Gt, "gt", ">"), (Ge, "ge", ">="), (Lt, "lt", "<"), (Le, "le", "<="))


def _may_be_table(annotation: Any) -> bool:
    """Whether a value of a type may be a table, not only a word, a number or a list."""
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _may_be_table(args[0])
    if origin in (Union, UnionType):
        return any(map(_may_be_table, args))
    return annotation not in (Any, str, int, float, bool) and origin not in (tuple, list)


class FieldType(NamedTuple):
    """Type and annotations of the place that a dotted key names."""

    annotation: Any
    metadata: Sequence[Any] = ()

    @property
    def notes(self) -> Iterator[Any]:
        """Annotations of the place and of the arms of its union, outermost first; not those of entries of lists."""
        for note in self.metadata:
            yield from getattr(note, "metadata", None) or (note,)
        if get_origin(self.annotation) is Annotated:
            inner, *own = get_args(self.annotation)
            yield from FieldType(inner, own).notes
        elif _is_union(self.annotation):
            for arm in get_args(self.annotation):
                yield from FieldType(arm).notes

    @property
    def unit(self) -> Unit | None:
        """The unit of the number, if the place holds one."""
        return next((note for note in self.notes if isinstance(note, Unit)), None)

    @property
    def hint(self) -> str:
        """The remedy for a number out of its bounds, or ""."""
        return next((note.remedy for note in self.notes if isinstance(note, Hint)), "")

    @property
    def holds_words_only(self) -> bool:
        """Whether it is the place of a word, and never that of a number."""
        arms = set(_arms(self.annotation))
        return str in arms and not arms & {int, float}

    @property
    def holds_named_tables(self) -> bool:
        """Whether it is a table of tables that have names of the user's choice."""
        return get_origin(self.annotation) is dict and _may_be_table(get_args(self.annotation)[1])

    def describe(self) -> str:
        """What belongs there, in words, as far as annotations tell: "a length (m), > 0"."""
        notes = list(self.notes)
        bounds = [
            f"{sign} {getattr(note, name):g}"
            for note in notes
            for kind, name, sign in _BOUNDS
            if isinstance(note, kind)
        ]
        words = next((note.words for note in notes if isinstance(note, Noun)), "")
        noun = words or (self.unit.article if self.unit else _type_words(self.annotation))
        return ", ".join(part for part in (noun, *bounds) if part)


def field_at(model: type[Spec], data: Any, keys: Keys) -> FieldType | None:
    """The field of a study that dotted keys lead to; the data decide between kinds. None where there is none."""
    return _descend(FieldType(model), data, tuple(keys))


def keys_at(model: type[Spec], data: Any, keys: Keys) -> list[str]:
    """Names of the keys that the table at this place can have."""
    place = field_at(model, data, keys)
    cls = _class_of(place, value_at(data, keys)) if place is not None else None
    return [field.alias or name for name, field in cls.model_fields.items()] if cls else []


def value_at(data: Any, keys: Keys) -> Any:
    """The value at a place of plain data; KeyError where there is none."""
    for key in keys:
        try:
            data = data[int(key) if isinstance(data, list | tuple) else key]
        except (KeyError, IndexError, ValueError, TypeError):
            raise KeyError(".".join(str(part) for part in keys)) from None
    return data


def refuse(error: ValidationError, model: type[Spec], data: Any, source: Source) -> NoReturn:
    """Raise the one BadInput that helps most: an unknown key first, since it often explains a missing one."""
    details = sorted(error.errors(include_url=False), key=lambda item: item["type"] != "extra_forbidden")
    raise bad_input(details[0], model, data, source) from None  # it says all that pydantic's error does


def bad_input(detail: Any, model: type[Spec], data: Any, source: Source) -> BadInput:
    """One of pydantic's errors in the user's words: file, dotted key, what was found, what is wanted."""
    keys = [key for key in detail["loc"] if key not in _TAGS]
    where = source.where(".".join(str(key) for key in keys))
    context = detail.get("ctx", {})
    if detail["type"] == "wanderlast":
        said = {key: context[key] for key in ("expected", "received")}
        remedy = context["remedy"] or _misnamed(data, keys) or _misplaced(model, data, keys)
        return BadInput(context["what"], where=where, **said, remedy=remedy)
    if detail["type"] == "extra_forbidden":
        names = keys_at(model, data, keys[:-1])
        looked_for = _looked_for(model, data, keys)
        remedy = synonym(keys[-1], names) or looked_for or _misplaced(model, data, keys) or nearest(keys[-1], names)
        return BadInput("unknown key", where=where, expected=f"one of {', '.join(names)}", remedy=remedy)
    place = field_at(model, data, keys)
    expected = place.describe() if place else ""
    if detail["type"] == "missing" and isinstance(keys[-1], int):
        return _too_few(model, data, keys[:-1], source)
    if detail["type"] == "missing":
        return BadInput("this key is missing", where=where, expected=expected)
    try:
        received = shortened(value_at(data, keys))
    except KeyError:
        received = shortened(detail["input"])
    words = get_args(place.annotation) if place and get_origin(place.annotation) is Literal else ()
    bound = any(name in context for _, name, _ in _BOUNDS)
    remedy = place.hint if place and bound else nearest(detail["input"], [str(word) for word in words])
    remedy = remedy or _misplaced(model, data, keys)
    is_of_scene = keys[0] not in NOT_SWEPT
    if not remedy and place and is_of_scene and isinstance(detail["input"], list) and "a list" not in expected:
        remedy = f'to vary it: [sweep] NAME = {{ of = "{".".join(map(str, keys))}", values = {received} }}'
    return BadInput(_what(detail), where=where, expected=expected or detail["msg"], received=received, remedy=remedy)


def _misnamed(data: Any, keys: Keys) -> str:
    """A hint at the table that was meant, where a dotted key with a misspelt name made one with that key alone and no
    kind; or ""."""
    if len(keys) < 2 or keys[-1] != "kind":
        return ""
    around, own = value_at(data, keys[:-2]), value_at(data, keys[:-1])
    if not isinstance(own, dict) or "kind" in own or len(own) != 1:
        return ""
    others = [str(name) for name in around if name != keys[-2]] if isinstance(around, dict) else []
    return nearest(keys[-2], others) or (f"a kind, or one that there is: {', '.join(others)}" if others else "")


def _too_few(model: type[Spec], data: Any, keys: Keys, source: Source) -> BadInput:
    """A list with fewer entries than it has to have, such as two of a vector."""
    place, where = field_at(model, data, keys), source.where(".".join(str(key) for key in keys))
    wanted = len(get_args(place.annotation)) if place else 0
    expected = f"{wanted} entries" if wanted else "more entries"
    return BadInput("this list is too short", where=where, expected=expected, received=shortened(value_at(data, keys)))


def _looked_for(model: type[Spec], data: Any, keys: Keys) -> str:
    """What there is of a key that others look for in the table at this place, or ""."""
    place = field_at(model, data, keys[:-1])
    cls = _class_of(place, value_at(data, keys[:-1])) if place is not None else None
    return cls.looked_for.get(str(keys[-1]), "") if cls is not None else ""


def _misplaced(model: type[Spec], data: Any, keys: Keys) -> str:
    """A hint at the table to which a key belongs that cannot stand, or not so, in its own, or ""."""
    try:
        value = value_at(data, keys)
    except KeyError:
        return ""
    place, around = (field_at(model, data, part) if part else None for part in (keys, keys[:-1]))
    if place is not None and place.holds_named_tables:
        return f"[{keys[-1]}.NAME], a table with a name of your choice"
    if str(keys[-1]) in keys_at(model, data, keys[:-1]):
        return ""
    if isinstance(value, dict):
        return _of_other_kinds(around, str(keys[-1]))
    if around is not None and around.holds_named_tables:
        return f"[{keys[-2]}.NAME] as the header: a table with a name of your choice"
    return _where_else(model, data, around, keys)


def _of_other_kinds(around: FieldType | None, key: str) -> str:
    """The kinds of a table that have a key, in words, or ""."""
    tables = [note.table for note in around.notes if isinstance(note, KindOf)] if around else []
    fitting = [kind for table in tables for kind, cls in table.items() if _field_of(cls, key) is not None]
    return f"{key} is a key of the kind {' and '.join(shortened(kind) for kind in fitting)}" if fitting else ""


def _where_else(model: type[Spec], data: Any, around: FieldType | None, keys: Keys) -> str:
    """The table, or the kind of its own table, that has the key of this name, in words, or ""."""
    key, here = str(keys[-1]), list(keys[:-1])
    if key == "kind" and around is not None and any(isinstance(note, KindOf) for note in around.notes):
        return ABSENT
    if here and key in keys_at(model, data, ()):
        return f"write {key} at the top of the file: a key belongs to the table whose [header] stands above it"
    if fitting := _of_other_kinds(around, key):
        return fitting
    if isinstance(value_at(data, keys), list):  # the same word may well be the name of an axis
        return ""
    whole: dict[str, Any] = {name: {} for name in keys_at(model, data, ())} | data
    tables = [path for path in _tables_in((), whole) if path != tuple(here) and key in keys_at(model, whole, path)]
    if not tables:
        return ""
    without = next((path for path in tables if key not in value_at(whole, path)), None)
    then = ", which has one" if without is None else ": write it below that header"
    return f"{key} is a key of [{'.'.join(without or tables[0])}]{then}"


def _tables_in(here: tuple[str, ...], data: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    for key, value in data.items():
        if isinstance(value, dict):
            yield (*here, key)
            yield from _tables_in((*here, key), value)


def _what(detail: Any) -> str:
    kind, context = detail["type"], detail.get("ctx", {})
    for _, name, sign in _BOUNDS:
        if name in context:
            return f"must be {sign} {context[name]:g}"
    if kind == "string_too_long":
        return f"longer than {context['max_length']} characters"
    if kind in ("too_short", "too_long"):
        limit = f"at least {context['min_length']}" if kind == "too_short" else f"at most {context['max_length']}"
        return f"a list of {limit} entries is wanted here"
    if kind == "literal_error":
        return "unknown name"
    if kind == "union_tag_invalid":
        forms = " or ".join(words for tag, words in _TAGS.items() if tag in context["expected_tags"])
        return f"{forms} is wanted here"
    return "wrong type" if kind.endswith("_type") else str(detail["msg"])


def _type_words(annotation: Any) -> str:
    if get_origin(annotation) is Literal:
        return " or ".join(shortened(word) for word in get_args(annotation))
    if _is_union(annotation):
        return " or ".join(part for part in (_type_words(_bare(arm)) for arm in get_args(annotation)) if part)
    words = {bool: "true or false", int: "an integer", float: "a number", str: "text in quotes", type(None): ""}
    if annotation in words:
        return words[annotation]
    return {tuple: "a list", dict: "a table"}.get(get_origin(annotation), "a table")


def _bare(annotation: Any) -> Any:
    return get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation


def _is_union(annotation: Any) -> bool:
    return get_origin(annotation) in (Union, UnionType)


def _arms(annotation: Any) -> Iterator[Any]:
    """The types of which a value of this type is one; of words or numbers out of a list, theirs."""
    bare = _bare(annotation)
    if _is_union(bare):
        for arm in get_args(bare):
            yield from _arms(arm)
    elif get_origin(bare) is Literal:
        yield from map(type, get_args(bare))
    else:
        yield bare


def _class_of(place: FieldType, value: Any) -> type[Spec] | None:
    """The class of the table at a place, chosen by its kind where there are several."""
    for kinds in (note for note in place.notes if isinstance(note, KindOf)):
        kind = value.get("kind") if isinstance(value, dict) else None
        return kinds.table.get(kind) if isinstance(kind, str) else None
    arms = get_args(place.annotation) if _is_union(place.annotation) else (place.annotation,)
    classes = [_bare(arm) for arm in arms]
    return next((cls for cls in classes if isinstance(cls, type) and issubclass(cls, Spec)), None)


def _descend(place: FieldType, value: Any, keys: tuple[str | int, ...]) -> FieldType | None:
    annotation = place.annotation
    if get_origin(annotation) is Annotated:
        inner, *own = get_args(annotation)
        return _descend(FieldType(inner, (*place.metadata, *own)), value, keys)
    if not keys:
        return place
    key, rest = keys[0], keys[1:]
    try:
        inside = value_at(value, [key])
    except KeyError:
        inside = None
    cls = _class_of(place, value)
    if cls is not None and (step := _field_of(cls, str(key))) is not None:
        return _descend(step, inside, rest)
    if _is_union(annotation):
        found = (_descend(FieldType(arm), value, keys) for arm in get_args(annotation))
        return next((place for place in found if place is not None), None)
    entry = _entry_of(annotation, key)
    return None if entry is None else _descend(FieldType(entry), inside, rest)


def _field_of(cls: type[Spec], key: str) -> FieldType | None:
    for name, field in cls.model_fields.items():
        if key == (field.alias or name):
            return FieldType(field.annotation, tuple(field.metadata))
    return FieldType(cls.entry_class) if cls.entry_class is not None else None


def _entry_of(annotation: Any, key: str | int) -> Any:
    """Type of the entries of a dict or tuple annotation."""
    args = get_args(annotation)
    if get_origin(annotation) is dict:
        return args[1]
    if get_origin(annotation) is tuple and str(key).isdigit():
        return args[0] if args[-1] is Ellipsis else (args[int(key)] if int(key) < len(args) else None)
    return None
