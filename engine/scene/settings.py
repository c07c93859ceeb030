"""The parts of a study file that say how to compute, what to keep and what to vary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, PlainValidator, Tag, model_validator

from engine.kernels.schemes import SCHEMES, USUAL_SCHEME, Scheme, SchemeRow
from engine.study_file.spec import NUMBER, TABLE, WORD, Auto, Hint, Several, Spec, by_form, form_of, one_of
from engine.study_file.units import Dimensionless, fault
from results_schema.errors import shortened
from results_schema.registry import Pieces, no_row_of

#: The program's schemes and those of other packages.
ALL_SCHEMES = Pieces(
    group="wanderlast.schemes",
    noun="scheme",
    own=SCHEMES,
    wanted="a SchemeRow of engine.kernels.schemes",
    missing=no_row_of(SchemeRow),
)
FIDELITIES = ("auto", "static", "force", "mass", "mass-without-convective", "full")
MAX_STEPS = 100_000_000


SchemeName = Annotated[str, AfterValidator(one_of("auto", more=ALL_SCHEMES))]
Chosen = Annotated[str, AfterValidator(one_of(*FIDELITIES))]


class Solver(Spec):
    """How to march.

    scheme: "auto" chooses between average acceleration and Fox-Goodwin with the steps, and is the former where the
    study says how many. beta, gamma: of the scheme "newmark" only, gamma >= 1/2 (smaller values grow at any step).
    alpha: of "hht-alpha", rho_inf: of "generalized-alpha".
    steps: over one whole passage or one whole cycle. tolerance: wanted where something is "auto".
    audit: number of variants that are run again with all terms, more modes and more steps; "auto" is 1 % of
    them, 16 to 256, or fewer where that would take long.
    """

    scheme: SchemeName = "auto"
    beta: Dimensionless | None = Field(default=None, ge=0, le=1)
    gamma: Dimensionless | None = Field(default=None, ge=0.5, le=1.5)
    alpha: Dimensionless | None = Field(default=None, ge=-1 / 3, le=0)
    rho_inf: Dimensionless | None = Field(default=None, ge=0, le=1)
    fidelity: Chosen = "auto"
    steps: Annotated[Auto | Annotated[int, Tag(NUMBER), Field(ge=1, le=MAX_STEPS)], by_form] = "auto"
    tolerance: Annotated[Dimensionless, Hint('a part of the largest static value: 0.01 or "1 %"')] = Field(
        default=1e-3, gt=0, lt=1
    )
    static_correction: bool = True
    audit: Annotated[Auto | Annotated[int, Tag(NUMBER), Field(ge=0)], by_form] = "auto"

    @property
    def integration(self) -> Scheme:
        """The scheme with its parameters; the usual one where it is left open."""
        return self._row({name: getattr(self, name) for name in self._row.parameters})

    @property
    def _row(self) -> SchemeRow:
        return ALL_SCHEMES[USUAL_SCHEME if self.scheme == "auto" else self.scheme]

    @model_validator(mode="after")
    def _fitting_keys(self) -> Solver:
        wanted = self._row.parameters
        for scheme, row in SCHEMES.items():
            given = [name for name in row.parameters if name not in wanted and getattr(self, name) is not None]
            if given:
                expected, received = f'scheme = "{scheme}"', f'scheme = "{self.scheme}"'
                raise fault(f"{' and '.join(given)}: not for this scheme", expected=expected, received=received)
        if any(getattr(self, name) is None for name in wanted):
            named, shown = " and ".join(wanted), "; ".join(f"{name} = {text}" for name, text in wanted.items())
            raise fault(f'the scheme "{self.scheme}" needs {named}', expected=shown)
        return self


class Every(Spec):
    """Histories thinned to every n-th station."""

    every: int = Field(ge=1, le=MAX_STEPS)


Percentile = Annotated[float, Field(ge=0, le=100)]


class Output(Spec):
    """What the archive keeps of the histories, and what is told of the results.

    percentiles: of every result over the sweep, in per cent. keep: all variants, or of every cell the extremes of every
    result with the variants that have them, or these and the percentiles. cells: the axes that stay where variants are
    reduced; all of the grid beside a sample if not given, else none. unreduced: number of variants, spread over the
    sweep, that are computed again by the unreduced finite-element model. residual: whether it is told how far sensors
    swing when all carriages have come to rest or left. times: whether it is told when sensors are largest
    and smallest.
    """

    histories: Annotated[
        Annotated[Literal["auto", "none", "all"], Tag(WORD)] | Annotated[Every, Tag(TABLE)], by_form
    ] = "auto"
    percentiles: Annotated[Several[Percentile], Field(max_length=20)] = ()
    keep: Literal["all", "extremes", "percentiles"] = "all"
    cells: Several[str] | None = None
    unreduced: int = Field(default=0, ge=0, le=1000)
    residual: bool = False
    times: bool = False

    @property
    def keeps_variants(self) -> bool:
        """Whether the archive has every variant, and not what cells of them have in common."""
        return self.keep == "all"

    @model_validator(mode="after")
    def _in_percent(self) -> Output:
        if len(self.percentiles) > 1 and max(self.percentiles) <= 1:
            received, remedy = shortened(self.percentiles), "percent: 5, 50, 95"
            raise fault("percentiles as parts of one", expected="per cent", received=received, remedy=remedy)
        return self

    @model_validator(mode="after")
    def _fitting_keys(self) -> Output:
        if self.keeps_variants and self.cells is not None:
            raise fault("cells: for archives that reduce variants", expected='keep = "extremes" or "percentiles"')
        if (self.keep == "percentiles") != bool(self.percentiles) and not self.keeps_variants:
            wanted = {"percentiles": "percentiles = [5, 50, 95], say", "extremes": "no percentiles"}[self.keep]
            raise fault(f'keep = "{self.keep}" and percentiles do not fit', expected=wanted)
        return self


def read_amount(value: Any) -> float | int | str:
    """A number of a sweep, whose dimension only its path decides: finite number, or text with a unit."""
    if isinstance(value, str) or (isinstance(value, int) and not isinstance(value, bool)):
        return value
    if isinstance(value, float) and isfinite(value):
        return value
    if isinstance(value, list | tuple):
        what = "the values of an axis are one-dimensional: a number is wanted here"
        remedy = "an axis for each dimension, or array.ravel() as the values of one"
        raise fault(what, expected="no list in a list", received=shortened(value), remedy=remedy)
    raise fault("a number is wanted here", expected='a number, or a string such as "15 m"', received=shortened(value))


def as_tuple(value: Any) -> Any:
    """One path as a list of one."""
    return (value,) if isinstance(value, str) else value


Amount = Annotated[float | int | str, PlainValidator(read_amount, json_schema_input_type=float | int | str)]
Amounts = Annotated[Several[Amount], Field(min_length=1)]
Paths = Annotated[
    Several[str],
    Field(min_length=1, max_length=100),
    BeforeValidator(as_tuple, json_schema_input_type=str | list[str]),
]


DRAWN = "sobol = N draws N values between from and to"
OWN_DRAWS = f"{DRAWN}; draws of your own are values = [...], of several numbers with zip (docs/python.md)"


class SweepAxis(Spec):
    """One varied number, or several that vary together: listed values, a range, or a sample of a range.

    of: dotted key or keys, all of which get the same value. sobol: size of the sample (scrambled, seed 0).
    """

    looked_for: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("random", "samples", "sample", "draws", "lhs", "monte_carlo"), DRAWN),
        **dict.fromkeys(("distribution", "normal", "lognormal", "mean", "std", "sigma", "seed"), OWN_DRAWS),
        **dict.fromkeys(("n", "num", "number", "points", "steps", "step"), "count = N: values between from and to"),
    }

    of: Paths
    values: Amounts | None = None
    from_: Amount | None = Field(default=None, alias="from")
    to: Amount | None = None
    count: int | None = Field(default=None, ge=1)
    sobol: int | None = Field(default=None, ge=1)
    spacing: Literal["linear", "log"] = "linear"

    @property
    def size(self) -> int:
        """Number of values."""
        return next(n for n in (self.count, self.sobol, len(self.values or ())) if n is not None)

    @model_validator(mode="before")
    @classmethod
    def _table(cls, value: Any) -> Any:
        if form_of(value) == TABLE:
            return value
        expected = 'an axis, such as { of = "carriage.NAME.mass", values = [50, 100] }'
        raise fault("a table is wanted here", expected=expected, received=shortened(value))

    @model_validator(mode="after")
    def _one_form(self) -> SweepAxis:
        forms = [name for name in ("values", "count", "sobol") if getattr(self, name) is not None]
        if len(forms) != 1:
            received = " and ".join(forms) or "none of them"
            raise fault("an axis is written in exactly one way", expected="values, count or sobol", received=received)
        ranged = [name for name in ("from_", "to") if getattr(self, name) is not None]
        if forms == ["values"] and (ranged or "spacing" in self.model_fields_set):
            raise fault("from, to and spacing do not go with values", expected="values alone")
        if forms != ["values"] and len(ranged) < 2:
            raise fault(f"{forms[0]} needs from and to", expected="from = ..., to = ...")
        return self

    @model_validator(mode="after")
    def _ends_in_one_unit(self) -> SweepAxis:
        if not self.values and (mixed := self.half_united()):  # 160 beside "2 km/h" would be 160 m/s
            what, expected = "a number without a unit beside one with a unit", "both with their units, or none"
            received, remedy = f"{shortened(mixed[0])} and {mixed[1]}", f"{mixed[1]} needs its unit too"
            raise fault(what, expected=expected, received=received, remedy=remedy)
        return self

    def half_united(self) -> tuple[str, float] | None:
        """The first of its numbers with a unit and the first without one, where it has both; 0 is 0 in any unit."""
        amounts = [amount for amount in (self.values or (self.from_, self.to)) if amount]
        united = [amount for amount in amounts if isinstance(amount, str)]
        if len(united) in (0, len(amounts)):
            return None
        return united[0], next(amount for amount in amounts if not isinstance(amount, str))


class Sweep(Spec):
    """All axes by name. zip: all of them, or those that are named, are paired instead of spanning a grid."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, SweepAxis]
    entry_class = SweepAxis
    zip: bool | Several[str] = False

    @model_validator(mode="after")
    def _zips_axes(self) -> Sweep:
        missing = [name for name in self._zipped if name not in self.axes]
        if missing:
            what, expected = "zip names an axis that is not there", f"axes of this sweep: {', '.join(self.axes)}"
            raise fault(what, expected=expected, received=shortened(missing[0]))
        return self

    @property
    def _zipped(self) -> Sequence[str]:
        """The names of the axes that are paired."""
        if isinstance(self.zip, bool):
            return tuple(self.axes) if self.zip else ()
        return self.zip

    @property
    def joint(self) -> tuple[str, ...]:
        """The names of the axes that lie along one dimension, paired or sampled."""
        return tuple(name for name, axis in self.axes.items() if name in self._zipped or axis.sobol is not None)

    @property
    def axes(self) -> dict[str, SweepAxis]:
        """Axes by name, in the order of the file."""
        return dict(self.__pydantic_extra__)


def setting_named(option: str) -> str:
    """The dotted key by which a study says what an option's name tells; "" where there is none.

    >>> setting_named("tolerance"), setting_named("threads")
    ('solver.tolerance', '')
    """
    tables: dict[str, type[Spec]] = {"solver": Solver, "output": Output}
    return next((f"{table}.{option}" for table, spec in tables.items() if option in spec.model_fields), "")
