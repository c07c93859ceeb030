"""Physical numbers in study files: SI floats, or strings with a unit that are turned into SI exactly.

Each dimension is an annotated float: `length: Length = Field(gt=0)`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Annotated, Any, get_args, get_origin

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from engine.study_file.checks import NO_JERK, NOT_MEANT, SIZES, is_meant
from results_schema.errors import shortened

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(.*?)\s*")
THOUSANDS = 3  # digits behind a comma that may be none of decimals
_COMMA = re.compile(r",(\d+)(.*)")
_FACTOR = re.compile(r"([A-Za-zµμ°%]+)(?:(?:\*\*|\^)?([+-]?\d)|([²³⁴]))?|1(?=\s*/)")
_OPERATOR = re.compile(r"\s*([*·/])\s*|\s+")
_SUPERSCRIPTS = {"²": 2, "³": 3, "⁴": 4}
_BOUNDS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}  # JSON schema's
_BASE = ("meter", "kilogram", "second")
_PI = Fraction("3.1415926535897932384626433832795028841971693993751")  # as pint has it
_DEGREE = str(_PI / 180)
_COMMON = {
    name: (Fraction(factor), base)
    for base, names in (
        ({}, {"%": "0.01"}),
        ({"meter": 1}, {"m": "1", "mm": "1e-3", "cm": "1e-2", "km": "1e3"}),
        ({"kilogram": 1}, {"kg": "1", "g": "1e-3", "t": "1e3"}),
        ({"second": 1}, {"s": "1", "ms": "1e-3", "min": "60", "h": "3600"}),
        ({"second": -1}, {"Hz": "1", "kHz": "1e3"}),
        ({"kilogram": 1, "meter": 1, "second": -2}, {"N": "1", "kN": "1e3", "MN": "1e6"}),
        ({"kilogram": 1, "meter": -1, "second": -2}, {"Pa": "1", "kPa": "1e3", "MPa": "1e6", "GPa": "1e9"}),
        ({"radian": 1}, {"rad": "1", "deg": _DEGREE, "°": _DEGREE}),
        ({"radian": 1, "second": -1}, {"rpm": str(_PI / 30)}),
    )
    for name, factor in names.items()
}  # what pint says of them, which takes half a second to import
JERK = "m s-3"
KNOWN_UNITS = "a unit such as m, mm, kN, GPa, km/h, Hz"
_RIGID = ("rigid", "fixed", "infinite", "infinity", "inf")
_RUN_TOGETHER = {"kmh": "km/h", "kph": "km/h", "mps": "m/s", "nm": "N m", "knm": "kN m"}
_E_TIMES_I, E_TIMES_I = re.compile(r"[kMG]?Nm(2|\^2|²)"), (3, 1, -2)  # pint takes Nm for the number of a yarn
_RUN_TOGETHER |= dict.fromkeys(("mu", "my", "µ", "mum"), "um")


@dataclass(frozen=True)
class Unit:
    """Dimension of a field: its name, SI unit (UDUNITS text, "" for a plain number), exponents of m, kg, s.

    angle: exponents of the radian that are the same dimension, besides 0 (turns: and not 0). A frequency in rad/s or
    rpm is turned into cycles per second.
    """

    noun: str
    symbol: str
    exponents: tuple[int, int, int]
    angle: int = 0
    per_turn: bool = False
    turns: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        words = {"type": "string", "pattern": r"^\s*[+-]?[\d.]+([eE][+-]?\d+)?\s*\D"}
        number = {_BOUNDS.get(key, key): value for key, value in handler(schema).items()}
        return {"anyOf": [number, words], "description": self.article}

    def read(self, value: Any) -> Any:
        """A string such as "210 GPa" as SI float; anything else unchanged. Raises PydanticCustomError."""
        return self.si(value) if isinstance(value, str) else value

    def si(self, text: str) -> float:
        """The SI value of a number with a unit, rounded once.

        >>> Unit("speed", "m s-1", (1, 0, -1)).si("200 km/h") == 200 / 3.6
        True
        """
        number, unit = _split(text, self)
        factor, exponents, angle = _unit_factor(unit)
        if exponents != self.exponents or angle not in ((self.angle,) if self.turns else (0, self.angle)):
            stiff = exponents == E_TIMES_I or _E_TIMES_I.fullmatch(unit)
            received = "a bending stiffness (N m2)" if stiff else _dimension_name(exponents, angle)
            what = f"{received} where {self.article} is wanted"
            remedy = _meant_here(number, unit, self, exponents)
            raise fault(what, expected=self.article, received=shortened(text), remedy=remedy)
        if self.per_turn and angle == 1:
            factor /= 2 * _PI
        value = Fraction(number) * factor
        if not is_meant(value):
            raise fault(NOT_MEANT, expected=f"{self.article}, {SIZES}", received=shortened(text))
        return float(value)

    def written(self, text: str) -> tuple[str, float]:
        """The unit of a number with a unit as it was written, and one of it in SI.

        >>> Unit("speed", "m s-1", (1, 0, -1)).written("72 km/h")[0]
        'km/h'
        """
        unit = _split(text, self)[1]
        return unit, self.si(f"1 {unit}")

    @property
    def article(self) -> str:
        """The dimension in words, as an error names it."""
        noun = f"{'an' if self.noun[0] in 'aeiou' else 'a'} {self.noun}"
        return f"{noun} ({self.typed})" if self.symbol else noun

    @property
    def typed(self) -> str:
        """The SI unit as people type it in a study file.

        >>> Unit("density", "kg m-3", (-3, 1, 0)).typed, Unit("rate", "s-1", (0, 0, -1)).typed
        ('kg/m3', '1/s')
        """
        return _typed(self.symbol)


def unit_of(dimension: Any) -> Unit:
    """The unit of an annotated float, such as `Length`."""
    found: Unit = get_args(dimension)[1]
    return found


@lru_cache(maxsize=256)
def exponents_of(symbol: str) -> tuple[int, int, int]:
    """Exponents of m, kg and s of a unit in UDUNITS text.

    >>> exponents_of("N m"), exponents_of("1")
    ((2, 1, -2), (0, 0, 0))
    """
    return (0, 0, 0) if symbol in ("", "1", "percent") else _unit_factor(symbol)[1]


def fault(what: str, *, expected: str = "", received: str = "", remedy: str = "") -> PydanticCustomError:
    """A refusal raised inside a pydantic validator; `engine.study_file.refusals` turns it into BadInput."""
    context = {"what": what, "expected": expected, "received": received, "remedy": remedy}
    return PydanticCustomError("wanderlast", "{what}", context)


def _split(text: str, wanted: Unit) -> tuple[str, str]:
    """Number and unit of a string; a bare number in quotes is refused, as is an expression."""
    match = _QUANTITY.fullmatch(text) if len(text) <= 100 else None
    if match is not None and (decimals := _COMMA.match(match[2])):
        whole, thousands = match[1].replace(".", ""), len(decimals[1]) == THOUSANDS
        remedy = f'a point: "{whole}.{decimals[1]}{decimals[2]}"'
        if thousands:
            remedy = f'"{whole}{decimals[1]}{decimals[2]}" if it parts thousands, else {remedy}'
        what = "a comma in a number" if thousands else "a decimal comma"
        raise fault(what, expected=wanted.article, received=shortened(text), remedy=remedy)
    example = f'a number, or a string such as "1.5 {wanted.typed or "%"}"'
    if match is None:
        stiff = f'a number large against what it supports, such as "1e12 {wanted.typed}", or a frame with a held node'
        endless = text.strip().casefold() in _RIGID
        remedy = NO_JERK if wanted.symbol == JERK and endless else ""
        remedy = stiff if "stiffness" in wanted.noun and endless else remedy
        if wanted.noun == "length" and text.strip().isalpha():
            remedy = 'places are numbers: "7.5 m" is the middle of 15 m'
            with suppress(PydanticCustomError):
                wanted.si(f"1 {text.strip()}")
                remedy = f'"1 {text.strip()}"'
        raise fault(f"this text is not {wanted.article}", expected=example, received=shortened(text), remedy=remedy)
    if not match[2]:
        raise fault("a number in quotes has no unit", expected=example, received=shortened(text))
    return match[1], match[2]


@lru_cache(maxsize=256)
def _unit_factor(unit: str) -> tuple[Fraction, tuple[int, int, int], int]:
    """Exact SI factor, exponents of (m, kg, s) and of the radian of a product of units such as "kN/m^2"."""
    total, exponents, angle = Fraction(1), [0, 0, 0], 0
    sign, place = 1, 0
    while place < len(unit):
        match = _FACTOR.match(unit, place)
        if match is None or len(unit) > 40:
            raise fault("no such unit", expected='a product such as "kN m/rad" or "kg/m^3"', received=shortened(unit))
        if match[1]:
            power = sign * (int(match[2] or 1) if not match[3] else _SUPERSCRIPTS[match[3]])
            scale, base = _COMMON.get(match[1]) or _named_by_pint(match[1])
            total *= scale**power
            exponents = [old + power * base.get(name, 0) for old, name in zip(exponents, _BASE, strict=True)]
            angle += power * base.get("radian", 0)
        operator = _OPERATOR.match(unit, match.end())
        if operator is None and match.end() < len(unit):
            raise fault("no such unit", expected='a product such as "kN m/rad" or "kg/m^3"', received=shortened(unit))
        place = operator.end() if operator else len(unit)
        sign = -1 if operator and operator[1] == "/" else 1
        if operator and place == len(unit):
            raise fault("the unit breaks off", received=shortened(unit))
    return total, (exponents[0], exponents[1], exponents[2]), angle


@lru_cache(maxsize=256)
def _named_by_pint(name: str) -> tuple[Fraction, Mapping[str, int]]:
    """Exact SI factor and exponents of base units of a name such as "inch"; pint is imported here."""
    from pint import PintError

    if name.casefold() in ("ton", "tons"):  # which pint takes for 907 kg
        raise fault("a ton is one of several sizes", expected='"t" (1,000 kg) or "kg"', received=shortened(name))
    if name.endswith("s") and name not in _COMMON and name[:-1] in _COMMON:  # which pint takes for a plural
        of_damper = name[:-1] in ("N", "kN", "MN")
        remedy = f'did you mean "{name[:-1]} s"?' if of_damper else _meant(name[:-1])
        raise fault("no such unit", expected=KNOWN_UNITS, received=shortened(name), remedy=remedy)
    try:
        quantity = _registry().Quantity(Fraction(1), name).to_base_units()
    except (PintError, TypeError, ValueError, AssertionError):
        raise fault("no such unit", expected=KNOWN_UNITS, received=shortened(name), remedy=_meant(name)) from None
    base = {key: int(power) for key, power in dict(quantity._units).items()}
    if not set(base) <= {*_BASE, "radian"} or not isinstance(quantity.magnitude, Fraction):
        expected = "a unit of metres, kilograms, seconds"
        raise fault("not a mechanical unit", expected=expected, received=shortened(name), remedy=_meant(name))
    return quantity.magnitude, base


def _meant(name: str) -> str:
    """A hint at the unit of another spelling, or "".

    >>> _meant("Gpa")
    'did you mean "GPa"?'
    """
    known = {unit.casefold(): unit for unit in _COMMON} | _RUN_TOGETHER
    unit = known.get(name.casefold())
    return f'did you mean "{unit}"?' if unit else ""


def _meant_here(number: str, unit: str, wanted: Unit, exponents: tuple[int, int, int]) -> str:
    """A remedy for a number with a unit of other exponents than those wanted, or ""."""
    known = {unit.casefold(): unit for unit in _COMMON} | _RUN_TOGETHER
    other = re.sub(r"[A-Za-z]+", lambda name: known.get(name[0].casefold(), name[0]), unit)
    if other != unit and _unit_factor(other)[1] == wanted.exponents:
        return f'did you mean "{number} {other}"?'
    for power in "234":  # of the last part: cm2 for cm4, m/s2 for m/s3
        other = re.sub(r"\^?[234]$", power, unit)
        if other != unit and _unit_factor(other)[1] == wanted.exponents:
            return f'did you mean "{number} {other}"?'
    return _another_quantity(number, unit, wanted, exponents)


def _another_quantity(number: str, unit: str, wanted: Unit, exponents: tuple[int, int, int]) -> str:
    """How what is wanted follows from a number of another quantity, or ""."""
    if wanted.noun == "pressure" and (exponents == E_TIMES_I or _E_TIMES_I.fullmatch(unit)):
        return 'N m2 is E I, of which each has a key; a beam may have second_moment = "1 m4" with all of it in Pa'
    if unit == "g" and wanted.noun == "acceleration":
        return f'g is gram; {number} g of gravity is "{float(number) * 9.81:.3g} m/s2"'
    if wanted.noun == "stiffness" and exponents == (0, 0, -1):
        rate = float(Fraction(number) * _unit_factor(unit)[0])
        return f"m (2 pi f)^2 of the mass m on it: {(2 * math.pi * rate) ** 2:.6g} N/m for each kg"
    if wanted.noun == "mass" and exponents == (1, 1, -2):
        weight = float(Fraction(number) * _unit_factor(unit)[0])
        return f'the mass of that weight is "{weight / 9.81:.6g} kg"; a carriage of kind = "force" is a weight alone'
    if wanted.noun == "density" and exponents == (-1, 1, 0):
        per_length = float(Fraction(number) * _unit_factor(unit)[0])
        return f'divide it by the area; a beam may have area = "1 m2" with density = "{per_length:.10g} kg/m3"'
    return ""


@lru_cache(maxsize=1)
def _registry() -> Any:
    """pint's units with exact factors, so that "210 GPa" is 210e9 to the last bit."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction)


def _dimension_name(exponents: tuple[int, int, int], angle: int) -> str:
    for unit in KNOWN:
        if unit.exponents == exponents and angle in (0, unit.angle):
            return unit.article
    along, mass, time = exponents
    powers = (("kg", mass), ("m", along), ("s", time), ("rad", angle))
    return f"a quantity in {_typed(' '.join(f'{name}{power}' for name, power in powers if power)) or 'no unit'}"


def _typed(symbol: str) -> str:
    """A unit in UDUNITS text with slashes instead of negative powers."""
    parts = [re.sub(r"(?<=[a-z])1$", "", part) for part in symbol.split()]
    over = " ".join(part for part in parts if "-" not in part)
    under = "".join(f"/{part.replace('-1', '').replace('-', '')}" for part in parts if "-" in part)
    return (over or "1" * bool(under)) + under


Length = Annotated[float, Unit("length", "m", (1, 0, 0))]
Area = Annotated[float, Unit("area", "m2", (2, 0, 0))]
SecondMoment = Annotated[float, Unit("second moment of area", "m4", (4, 0, 0))]
Pressure = Annotated[float, Unit("pressure", "Pa", (-1, 1, -2))]
Density = Annotated[float, Unit("density", "kg m-3", (-3, 1, 0))]
Mass = Annotated[float, Unit("mass", "kg", (0, 1, 0))]
Force = Annotated[float, Unit("force", "N", (1, 1, -2))]
Torque = Annotated[float, Unit("torque", "N m", (2, 1, -2))]
ForcePerMetre = Annotated[float, Unit("force per metre", "N m-1", (0, 1, -2))]
TorquePerMetre = Annotated[float, Unit("torque per metre", "N", (1, 1, -2))]
Speed = Annotated[float, Unit("speed", "m s-1", (1, 0, -1))]
Acceleration = Annotated[float, Unit("acceleration", "m s-2", (1, 0, -2))]
Frequency = Annotated[float, Unit("frequency", "Hz", (0, 0, -1), angle=1, per_turn=True)]
Stiffness = Annotated[float, Unit("stiffness", "N m-1", (0, 1, -2))]
RotationalStiffness = Annotated[float, Unit("rotational stiffness", "N m rad-1", (2, 1, -2), angle=-1)]
Damping = Annotated[float, Unit("damping coefficient", "N s m-1", (0, 1, -1))]
RotationalDamping = Annotated[float, Unit("rotational damping coefficient", "N m s rad-1", (2, 1, -1), angle=-1)]
Inertia = Annotated[float, Unit("moment of inertia", "kg m2", (2, 1, 0))]
Time = Annotated[float, Unit("time", "s", (0, 0, 1))]
Rate = Annotated[float, Unit("rate", "s-1", (0, 0, -1))]
Dimensionless = Annotated[float, Unit("plain number", "", (0, 0, 0))]
Angle = Annotated[float, Unit("angle", "rad", (0, 0, 0), angle=1, turns=True)]
AngularRate = Annotated[float, Unit("rate of turning", "rad s-1", (0, 0, -1), angle=1, turns=True)]
AngularAcceleration = Annotated[float, Unit("angular acceleration", "rad s-2", (0, 0, -2), angle=1, turns=True)]
Jerk = Annotated[float, Unit("jerk", JERK, (1, 0, -3))]
AngularJerk = Annotated[float, Unit("angular jerk", "rad s-3", (0, 0, -3), angle=1, turns=True)]
#: Every unit above.
KNOWN = tuple(unit_of(one) for one in list(globals().values()) if get_origin(one) is Annotated)
