"""Numbers and units as people write them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.scene.study import Study

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
MINUS = "\N{MINUS SIGN}"
_PREFIXED = ("m", "N", "N m", "Pa", "J", "rad")
SMALL_TURN = 0.1  # rad: what turns farther is no slope
NOISE = 1e-12  # of the largest value beside it: what is smaller is rounding
ROUNDING = 1e-9  # of the scale of a result: what a long march leaves of what is nothing
ALIKE = 1e-6  # of the largest value: a smaller range of values is rounding
APART = 0.05  # of the distance to the next swept value: by how much one that is told may be off
MOST_TOLD_APART = 1000  # swept values: of more, as of random draws, the next is beyond the digits that people read
_METRES = (-9, -6, -3, 0)


class Scale(NamedTuple):
    """A unit that suits the size of some values: values times `factor` are in `unit`."""

    factor: float
    unit: str


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, and never in the form 1e+05 between 1e-4 and 1e6.

    >>> number(0.00123456), number(12345.6), number(5.0), number(-1.2e-7), number(float("nan"))
    ('0.00123', '12300', '5', '-1.2e-7', 'none')
    """
    if not math.isfinite(value):
        return "none"
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    rounded = round(value, digits - 1 - size)
    if -4 <= size < 6:
        places = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
        text = f"{rounded:.{places}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{mantissa}e{int(exponent)}"


def unit_text(units: str) -> str:
    """A unit of the archive as people write it.

    >>> unit_text("m s-2"), unit_text("N m"), unit_text("1"), unit_text("kg m-3"), unit_text("kg-0.5")
    ('m/s²', 'N m', '', 'kg/m³', '1/√kg')
    """
    over, under = [], []
    for part in ("" if units == "1" else units).split():
        stem = part.rstrip("-.0123456789")
        power = part[len(stem) :]
        if power == "-0.5":
            under.append(f"√{stem}")
        elif power.startswith("-"):
            under.append(stem + ("" if power == "-1" else power[1:].translate(_SUPERSCRIPTS)))
        else:
            over.append(stem + power.translate(_SUPERSCRIPTS))
    if not under:
        return " ".join(over)
    bottom = under[0] if len(under) == 1 else f"({' '.join(under)})"
    return f"{' '.join(over) or '1'}/{bottom}"


def axis_title(name: str, units: str) -> str:
    """Name and unit as on a figure's axis.

    >>> axis_title("speed", "m s-1"), axis_title("mass ratio", "")
    ('speed (m/s)', 'mass ratio')
    """
    unit = unit_text(units)
    return f"{name} ({unit})" if unit else name


def scale_for(largest: float, units: str) -> Scale:
    """A unit in which values of this size read well.

    >>> scale_for(0.0123, "m"), scale_for(2.5e4, "N"), scale_for(3.0, "m s-2")
    (Scale(factor=1000.0, unit='mm'), Scale(factor=0.001, unit='kN'), Scale(factor=1.0, unit='m/s²'))
    """
    turned = units == "rad" and largest > SMALL_TURN
    if units not in _PREFIXED or turned or not math.isfinite(largest) or largest <= 0.0:
        return Scale(1.0, unit_text(units))
    known = _METRES if units == "m" else tuple(_PREFIXES)
    exponent = 3 * math.floor(math.log10(largest) / 3.0 + 1e-12)
    exponent = min(max(exponent, known[0]), known[-1])
    return Scale(10.0**-exponent, _PREFIXES[exponent] + units)


def quantity(value: float, units: str, digits: int = 3, beside: float = 0.0) -> str:
    """A value with its unit; 0 where it is rounding beside a value so much larger.

    >>> quantity(0.0012345, "m"), quantity(5.0, "m s-1"), quantity(0.25, "1"), quantity(-2e-13, "N m", beside=7.0)
    ('1.23 mm', '5 m/s', '0.25', '0 N m')
    >>> quantity(float("nan"), "m")
    'none'
    """
    value = 0.0 if abs(value) < NOISE * abs(beside) else value
    scale = scale_for(abs(value), units)
    text = number(value * scale.factor, digits)
    return f"{text} {scale.unit}" if scale.unit and math.isfinite(value) else text


def times(ratio: float, of: str = "", digits: int = 3) -> str:
    """A ratio in words; of: over what it is, where that is said.

    >>> times(1.264, "the static value"), times(1.00001, "the static value"), times(1.00001)
    ('1.26 times the static value', 'as large as the static value', 'as large')
    """
    text = number(ratio, digits)
    if text == "1":
        return f"as large as {of}" if of else "as large"
    return f"{text} times {of}".strip()


def once(remark: str, said: Sequence[str]) -> list[str]:
    """Sentences with a remark in the first alone that has it.

    >>> once("Look closer.", ["a: 1 m. Look closer.", "b: 2 m. Look closer."])
    ['a: 1 m. Look closer.', 'b: 2 m.']
    """
    first = next((place for place, text in enumerate(said) if remark in text), -1)
    return [text if place == first else text.replace(f" {remark}", "") for place, text in enumerate(said)]


def percent(part: float, digits: int = 2) -> str:
    """A part in percent.

    >>> percent(0.01234)
    '1.2 %'
    """
    return f"{number(100.0 * part, digits)} %"


def scientific(value: float) -> str:
    """A relative error with two digits.

    >>> scientific(1e-3), scientific(2.14e-4), scientific(0.0), scientific(float("nan"))
    ('1e-3', '2.1e-4', '0', 'not known')
    """
    if not math.isfinite(value):
        return "not known"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa.removesuffix('.0')}e{int(exponent)}" if value else "0"


def spanned(values: Iterable[float], words: Callable[[float], str] = number) -> str:
    """The smallest and the largest of some values in words, or the one that they are.

    >>> spanned([0.5, 2.0, 1.0]), spanned([3.0]), spanned([])
    ('0.5 to 2', '3', 'none')
    """
    known = list(values)
    return " to ".join(dict.fromkeys((words(min(known)), words(max(known))))) if known else "none"


def duration(seconds: float) -> str:
    """A time as people say it.

    >>> duration(0.02), duration(42.0), duration(4000.0)
    ('0.1 s', '42 s', '1.1 h')
    """
    if seconds < 100.0:
        return f"{number(max(seconds, 0.1), 2)} s"
    return f"{number(seconds / 60, 2)} min" if seconds < 3600 else f"{number(seconds / 3600, 2)} h"


def counted(count: int, noun: str) -> str:
    """A number with its noun.

    >>> counted(1, "variant"), counted(2400, "variant")
    ('1 variant', '2,400 variants')
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def ordinal(number: int) -> str:
    """A number in an order.

    >>> [ordinal(number) for number in (1, 2, 3, 8, 11, 12, 13, 22)]
    ['1st', '2nd', '3rd', '8th', '11th', '12th', '13th', '22nd']
    """
    ending = "th" if number % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{ending}"


def listed(parts: Sequence[str]) -> str:
    """Parts joined as in a sentence.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else list(parts))


def swept_quantity(value: float, units: str, typed: Scale | None, digits: int = 3) -> str:
    """A swept number (SI) with its unit: the one in which the study file has it, where it has one."""
    if typed is None:
        return quantity(value, units, digits)
    return f"{number(value * typed.factor, max(digits, 4))} {typed.unit}"


def telling_digits(values: Array) -> int:
    """Significant digits that tell swept values (n,) from what lies between them; three where five would not do.

    >>> [telling_digits(np.array(values)) for values in ([9.5, 9.55, 9.6], [11.0, 11.25], [1.41421, 1.73205, 8.12345])]
    [3, 4, 3]
    """
    if values.size > MOST_TOLD_APART:
        return 3
    own = np.unique(values)
    apart = APART * np.minimum(np.diff(own, prepend=-np.inf), np.diff(own, append=np.inf))  # from the nearer neighbour
    told = {digits: np.array([float(f"{value:.{digits - 1}e}") for value in own]) for digits in (3, 4, 5)}
    return next((digits for digits, rounded in told.items() if (np.abs(rounded - own) <= apart).all()), 3)


def typed_unit(study: Study, axis: str) -> Scale | None:
    """The unit in which a study file has the values of a swept number; None where they are plain numbers."""
    written, unit = study.data["sweep"][axis], study.unit(study.sweep.axes[axis].of[0])
    values = written.get("values", (written.get("from"), written.get("to")))
    text = next((value for value in values if isinstance(value, str)), None)
    if text is None or unit is None:
        return None
    name, size = unit.written(text)
    return Scale(1.0 / size, name)


def typed_speed(study: Study, carriage: str) -> Scale | None:
    """The unit in which a study file has the swept speeds of a carriage; None without one, or without such a sweep."""
    key = f"carriage.{carriage}.motion.speed"
    axes = (name for name, axis in study.sweep.axes.items() if any(key in study.targets(path) for path in axis.of))
    return next((typed_unit(study, name) for name in axes), None)
