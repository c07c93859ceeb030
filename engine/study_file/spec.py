"""What all parts of a study file share: the strict base class, the choice by `kind`, validators of words and lists."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    Tag,
    TypeAdapter,
    ValidationError,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, InitErrorDetails, core_schema

from engine.study_file.document import Beside
from engine.study_file.units import fault
from results_schema.errors import did_you_mean, shortened
from results_schema.registry import ABSENT, Pieces, by_other_names, unfinished

NUMBER, WORD, LIST, TABLE = "<number>", "<word>", "<list>", "<table>"


class Spec(BaseModel):
    """Base of every table of a study file: strict types, no unknown keys, finite numbers, frozen."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True, defer_build=True)
    derived: ClassVar[tuple[str, ...]] = ()  # numbers that follow from others and can be asked for by their key
    entry_class: ClassVar[Any] = None  # class of the tables under names of the user's choice, if there are such
    looked_for: ClassVar[Mapping[str, str]] = {}  # keys that others look for -> what there is of them


class SpecOfKind(Spec):
    """Base of tables whose class is chosen by their key `kind`, which every such class names."""

    if TYPE_CHECKING:

        @property
        def kind(self) -> str:
            """As in the study file."""


SpecT = TypeVar("SpecT", bound=Spec)
T = TypeVar("T")
Three = Annotated[tuple[T, T, T], Strict(False)]
Several = Annotated[tuple[T, ...], Strict(False)]


def form_of(value: Any) -> str:
    """How a value is written, for fields that can be written in several ways; words count as words."""
    if isinstance(value, list | tuple):
        return LIST
    if isinstance(value, dict | BaseModel):
        return TABLE
    return WORD if isinstance(value, str) else NUMBER


def form_of_amount(value: Any) -> str:
    """Like `form_of`, but a string is a number with a unit."""
    form = form_of(value)
    return NUMBER if form == WORD else form


Auto = Annotated[Literal["auto"], Tag(WORD)]
by_form = Discriminator(form_of)
by_amount_form = Discriminator(form_of_amount)


@dataclass(frozen=True, eq=False)
class KindOf:
    """Annotation of a table whose class is chosen by its key `kind`.

    table: kind -> class, looked up when a study is read, so that a new kind is one new entry. What stands beside the
    keys that a user wrote (`Beside`) reaches the validators as their context.
    """

    noun: str
    table: Mapping[str, type[Spec]]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"oneOf": [handler(TypeAdapter(self.table[kind]).core_schema) for kind in self.table]}

    def read(self, value: Any) -> Spec:
        """The validated table. Raises pydantic's errors."""
        if not isinstance(value, dict):
            raise fault("a table is wanted here", expected=f"the keys of a {self.noun}", received=shortened(value))
        kind = value.get("kind")
        if isinstance(kind, str) and kind in self.table:
            beside = [item for item in value.values() if isinstance(item, Beside)]
            written = {key: item for key, item in value.items() if not isinstance(item, Beside)}
            return self.table[kind].model_validate(written, context=beside[0] if beside else None)
        known = ", ".join(self.table)
        if "kind" not in value:
            problem = fault("the kind is missing", expected=f"one of {known}")
        else:
            word = str(kind).lower().replace("_", "-").replace(" ", "-")
            meant = f'did you mean "{_MEANT[word]}"?' if _MEANT.get(word) in self.table else ""
            remedy = meant or nearest(kind, list(self.table)) or _OTHER_KINDS.get(word, "")
            what = f"unknown kind of {self.noun}"
            problem = fault(what, expected=f"one of {known}", received=shortened(kind), remedy=remedy)
        detail = InitErrorDetails(type=problem, loc=("kind",), input=kind)
        raise ValidationError.from_exception_data(self.noun, [detail])


def kinds(noun: str, group: str, base: Any, *own: type[SpecT]) -> Pieces[type[SpecT]]:
    """The table of the classes that `KindOf` chooses from: the program's own, then those of other packages' entry
    points."""
    return Pieces(
        group=group,
        noun=noun,
        own={_kind_of(cls): cls for cls in own},
        wanted=f'a class made of {base.__module__}.{base.__name__} with kind: Literal["..."]',
        missing=unfinished(base),
        name=_kind_of,
    )


def _kind_of(cls: type[Spec]) -> str:
    field = cls.model_fields.get("kind")
    return "" if field is None else str(next(iter(get_args(field.annotation)), ""))


def one_of(
    *words: str, more: Collection[str] = (), meant: Mapping[str, str] = MappingProxyType({})
) -> Callable[[str], str]:
    """Validator of a word out of a list. more: of a table, as it is when a word is read. meant: words that others
    use -> the one of the list."""

    def check(word: str) -> str:
        if word in words or word in more:
            return word
        every = (*words, *more)
        known = meant.get(word.lower().replace("_", "-").replace(" ", "-"))
        meaning = f'"{known}"' if known in every else known  # what is no word stands as it is written
        remedy = f"did you mean {meaning}?" if known else nearest(word, every) or (ABSENT if more else "")
        expected = f"one of {', '.join(every)}"
        raise fault("unknown name", expected=expected, received=shortened(word), remedy=remedy)

    return check


def distinct(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Validator of a list that has nothing twice."""
    if len(set(values)) < len(values):
        raise fault("an entry stands here twice", expected="each one once", received=shortened(values))
    return values


def ascending(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Validator of a list in ascending order."""
    if list(values) != sorted(set(values)):
        raise fault("a list in ascending order is wanted here", expected="each once", received=shortened(values))
    return values


#: Keys that others look for in a mass on a spring.
LIKE_OSCILLATORS = dict.fromkeys(
    ("frequency", "natural_frequency", "damping_ratio"),
    "of a sprung mass m with the natural frequency f and the damping ratio D: stiffness = 4 pi^2 f^2 m (N/m), "
    "damping = 4 pi D f m (N s/m)",
)
ROPE = (
    'a hanging mass that goes up and down is kind = "oscillator"; one that swings on a rope is a link of a robot '
    '(kind = "portal" in docs/study-file.md)'
)
SPRUNG = 'a mass on a spring over its wheel is kind = "oscillator"; one with several axles is kind = "body"'
# kinds that others look for -> what there is of them
_OTHER_KINDS = {
    "pendulum": ROPE,
    "train": "a train is a table of its own: [train.NAME] (docs/study-file.md)",
    **dict.fromkeys(("sprung", "sprung-mass", "spring-mass", "quarter-car", "vehicle", "car", "bogie"), SPRUNG),
}

# what others call a kind -> its name
_MEANT = by_other_names(
    ("beam", "euler-bernoulli bernoulli beam188 beam189 bar girder"),
    ("frame", "timoshenko portal truss grillage"),
    ("force", "moving-force point-load point-force load"),
    ("mass", "moving-mass point-mass"),
    ("point-to-point", "trapezoidal trapezoid s-curve scurve ptp"),
    ("timed-move", "move-in-time move-time timed"),
    ("minimum-jerk", "min-jerk minjerk quintic polynomial"),
    ("cruise", "constant-speed constant linear uniform"),
    ("standing", "stand stands rest rests resting fixed static stationary parked"),
    ("rigid", "mass rigid-body lump payload"),  # of a body; "mass" is a carriage
    ("waypoints", "cycloidal rest-to-rest"),
)

# what others call a number -> its key; of several the first that is there
_SYNONYMS = by_other_names(
    ("force mass", "axle_load axle_weight load weight P F"),
    ("mass", "m sprung_mass body_mass"),
    ("wheel_mass", "unsprung_mass unsprung axle_mass"),
    ("youngs_modulus", "E elastic_modulus young_modulus young youngs modulus"),
    ("second_moment", "I Iy Iyy Iz inertia moment_of_inertia second_moment_of_area"),
    ("density", "rho"),
    ("area", "A cross_section"),
    ("length", "L span"),
    ("damping_ratio", "damping zeta xi"),
    ("damping", "c"),
    ("stiffness", "k spring_stiffness"),
    ("speed", "v V velocity max_speed vmax"),
    ("acceleration", "accel acc a deceleration decel amax"),
    ("gravity", "g"),
    ("at", "x position place"),
    ("displacement", "deflection deflexion sag"),
    ("spacing", "positions distances axle_distances"),
    ("from", "start"),
    ("to", "stop end"),
)


def synonym(word: object, names: Sequence[str]) -> str:
    """A hint at the name, or the dotted key, of what is also called so, or "".

    >>> synonym("body.bed.E", ["body.bed.youngs_modulus"])
    'did you mean "body.bed.youngs_modulus"?'
    """
    table, dot, last = str(word)[:100].rpartition(".")
    meant = (_SYNONYMS.get(last) or (_SYNONYMS.get(last.lower(), "") if len(last) > 1 else "")).split()
    return next((f'did you mean "{table}{dot}{key}"?' for key in meant if f"{table}{dot}{key}" in names), "")


def nearest(word: object, names: Sequence[str]) -> str:
    """A hint at the name that was probably meant, or "".

    >>> nearest("lenght", ["length", "area"])
    'did you mean "length"?'
    """
    if meant := synonym(word, names):
        return meant
    return did_you_mean(str(word), names)


@dataclass(frozen=True)
class Hint:
    """Annotation of a number: what to do where it is out of its bounds."""

    remedy: str


@dataclass(frozen=True)
class Noun:
    """Annotation of a place: what belongs there, in words."""

    words: str
