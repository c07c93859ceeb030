"""One axis of a sweep as values: read through the fields that they are meant for, generated, and checked."""

from __future__ import annotations

import fnmatch
import json
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from engine.scene.dotted_keys import FIXED, value_in, with_value
from engine.scene.settings import SweepAxis
from engine.scene.study import Scene, Study
from engine.study_file.refusals import bad_input
from engine.study_file.spec import nearest
from results_schema.errors import BadInput, shortened

AT_ONE_FREQUENCY = "pulsation.frequency"  # of the forces of a train
CHECKED_ONE_BY_ONE = 1000  # longer lists of plain numbers are checked at their ends: every field's limits are intervals
SOBOL_SEED = 0
DRAWN_AT_ONCE = 2**20
DIGITS, ROUNDINGS = 12, 4.0  # of a number that people type, by which a value of equal spacing may miss it

Number = int | float
Values = NDArray[Any]


class Range(NamedTuple):
    """Ends of an axis in SI; integers where the swept field holds integers."""

    low: Number
    high: Number

    @property
    def whole(self) -> bool:
        """Whether the axis counts."""
        return isinstance(self.low, int) and isinstance(self.high, int)


def listed(study: Study, name: str, axis: SweepAxis) -> Values:
    """Values (V,) of an axis that lists them, SI, int64 or float64. Raises BadInput with key and index."""
    given = axis.values or ()
    plain = [value for value in given if not isinstance(value, str)]
    if len(given) > CHECKED_ONE_BY_ONE and len(plain) == len(given):
        for extreme in (min(plain), max(plain)):
            read(study, name, axis, extreme, f"values.{given.index(extreme)}")
        whole = isinstance(read(study, name, axis, given[0], "values.0"), int)
        return np.array(given, dtype=np.int64 if whole else np.float64)
    values = [read(study, name, axis, value, f"values.{index}") for index, value in enumerate(given)]
    return np.array(values)


def ranged(study: Study, name: str, axis: SweepAxis) -> Values:
    """Values (count,) of an axis with equal or proportional spacing, both ends exact. Raises BadInput."""
    ends, count = _ends(study, name, axis), axis.count or 0
    if count == 1 and ends.low != ends.high:
        raise _bad(study, f"{name}.count", "one value cannot have two ends", "count >= 2, or values = [...]", "1")
    spread = np.linspace if axis.spacing == "linear" else np.geomspace
    values = np.asarray(spread(ends.low, ends.high, count), dtype=np.float64)
    if ends.whole:
        rounded = np.rint(values)
        if np.abs(values - rounded).max() > 1e-9 * max(1.0, np.abs(values).max()):
            odd = f"{values[np.abs(values - rounded).argmax()]:g}"
            raise _bad(study, f"{name}.count", "the axis counts, and this gives fractions", "whole numbers", odd)
        return rounded.astype(np.int64)
    if axis.spacing == "linear":
        values[1:-1] = decimal(values)[1:-1]
    return values


def decimal(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (V,), those within some roundings of a number of twelve digits as that number: what people type in turn
    to find them.

    >>> np.linspace(0.3, 1.5, 5)[2], decimal(np.linspace(0.3, 1.5, 5))[2]
    (np.float64(0.8999999999999999), np.float64(0.9))
    """
    largest = float(np.abs(values).max()) or 1.0
    near = np.round(values, DIGITS - 1 - math.floor(math.log10(largest)))
    return np.where(np.abs(near - values) <= ROUNDINGS * np.spacing(largest), near, values)


def sampled(study: Study, name: str, axis: SweepAxis, parts: NDArray[np.float64]) -> Values:
    """Values (V,) of a sampled axis from numbers (V,) in [0, 1); integers are equally likely."""
    low, high = _ends(study, name, axis)
    if isinstance(low, int) and isinstance(high, int):
        low, high = min(low, high), max(low, high)
        return (low + np.floor(parts * (high - low + 1))).astype(np.int64)
    if axis.spacing == "log":
        exponents = np.log(low) + parts * (np.log(high) - np.log(low))
        return np.asarray(np.clip(np.exp(exponents), min(low, high), max(low, high)))
    return np.asarray(np.clip(low + parts * (high - low), min(low, high), max(low, high)))


def sobol_points(size: int, dimensions: int) -> NDArray[np.float64]:
    """The first points (size, dimensions) of the scrambled Sobol sequence of seed 0, each in [0, 1); coordinate after
    coordinate lies together."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(SOBOL_SEED))
    # By whole powers of two, without which the sequence is out of balance, but never all of a large one at once.
    found, count = np.empty((dimensions, size)), min(DRAWN_AT_ONCE, 2 ** max(size - 1, 0).bit_length())
    for first in range(0, size, count):
        found[:, first : first + count] = sequence.random(count)[: size - first].T
    return found.T


def read(study: Study, name: str, axis: SweepAxis, amount: Any, entry: str) -> Number:
    """One value in SI, as all fields that the axis sets read it. Raises BadInput that names axis and entry."""
    numbers = [_read_at(study, path, amount, f"sweep.{name}.{entry}") for path in axis.of]
    if any(number != numbers[0] for number in numbers):
        raise _bad(study, f"{name}.of", "these keys read a value differently", "keys of one dimension", str(amount))
    whole = [number for number in numbers if isinstance(number, int)]
    return whole[0] if whole else numbers[0]


def check_targets(study: Study, name: str, axis: SweepAxis) -> None:
    """Every key of the axis is a number of the study, or an optional one. Raises BadInput with the nearest key."""
    for path in axis.of:
        here = f"sweep.{name}.of"
        if any(path == fixed or path.startswith(f"{fixed}.") for fixed in FIXED):
            raise study.source.fault(here, "this number is not part of the model", received=shortened(path))
        try:
            current = study.value(path)
        except KeyError:
            current = study
        open_ = current in (None, "auto")
        if isinstance(current, bool) or not (open_ or isinstance(current, int | float)):
            known = [key for key in study.numbers() if not _axle_that_would_leave(study, key)]
            longer = [key for key in known if key.endswith(f".{path}")]
            remedy = nearest(longer[0], longer) if longer else nearest(path, known)
            if several := fnmatch.filter(known, path) if "*" in path else []:
                remedy = f"name each of them: of = {json.dumps(several[:3])}{' and so on' * (len(several) > 3)}"
            remedy = _of_list(study, path) or _without_its_motion(study, path) or remedy
            remedy = remedy or _without_its_table(study, path)
            what = "no such number"
            raise study.source.fault(
                here, what, expected="the key of a number", received=shortened(path), remedy=remedy
            )
        if axle := _axle_that_would_leave(study, path):
            swings = axle.endswith(AT_ONE_FREQUENCY)
            what = "the forces of a train pulsate at one frequency" if swings else "an axle moves with its train"
            remedy = f'of = "{axle}" {"is that of" if swings else "moves"} all axles'
            raise study.source.fault(here, what, expected="a number of the train", received=path, remedy=remedy)
        if not study.targets(path):
            raise study.source.fault(
                here,
                "this number of a train cannot be swept",
                expected=study.train[path.split(".")[1]].swept,
                received=shortened(path),
                remedy="a study file for each",
            )


def _without_its_motion(study: Study, path: str) -> str:
    """That what would move has no motion, such as a joint; "" where it has, or is not there itself."""
    owner, _, rest = path.partition(".motion.")
    there: Any = study.tables
    for key in owner.split("."):
        listed = isinstance(there, list) and key.isdigit() and int(key) < len(there)
        there = there[int(key)] if listed else there.get(key) if isinstance(there, dict) else None
    return f"is {owner}.motion missing?" if rest and isinstance(there, dict) and "motion" not in there else ""


def _without_its_table(study: Study, path: str) -> str:
    """That the table of a key is not there, such as that of a body's frame; "" where it is, or could not be."""
    table, name, *rest = *path.split("."), ""
    there = getattr(study, table, None) if any(rest) else None
    return f"is the table [{table}.{name}] missing?" if isinstance(there, dict) and name not in there else ""


def _of_list(study: Study, path: str) -> str:
    """How a list is swept: each of its numbers by its own key, and those of a train's loads by their scale; "" where
    there is none at this key."""
    own = [key for key in study.numbers() if key.startswith(f"{path}.") and key[len(path) + 1 :].isdigit()]
    if not own:
        return ""
    table, name, key = (*path.split(".", 2), "", "")[:3]
    several = f"{json.dumps(own[0])} to {json.dumps(own[-1])}" if len(own) > 1 else json.dumps(own[0])
    scaled = table == "train" and key in study.train[name].loads
    together = f'; "{table}.{name}.load_scale" multiplies all of them' if scaled else ""
    return f"this is a list, and of takes its numbers, {several}{together}"


def _axle_that_would_leave(study: Study, path: str) -> str:
    """The key of a train whose axle alone a key would move or swing otherwise, "" where it does not."""
    table, _, rest = path.partition(".")
    name, _, key = rest.partition(".")
    if table != "carriage" or name not in study.axles or not key.startswith(("motion", "headway", AT_ONE_FREQUENCY)):
        return ""
    return f"train.{study.axles[name]}.{key.replace('headway', 'spacing')}"


def _ends(study: Study, name: str, axis: SweepAxis) -> Range:
    """Both ends in SI; a logarithmic axis needs them on one side of zero."""
    low = read(study, name, axis, axis.from_, "from")
    high = read(study, name, axis, axis.to, "to")
    if axis.spacing == "log" and not (low > 0 and high > 0):
        raise _bad(study, f"{name}.spacing", "log needs positive ends", "from > 0 and to > 0", f"{low:g}, {high:g}")
    return Range(low, high)


def _read_at(study: Study, path: str, amount: Any, entry: str) -> Number:
    data = with_value(_table_around(study, path), path, amount)
    try:
        number: Number = value_in(Scene(**data), path)
    except ValidationError as error:
        problem = bad_input(error.errors(include_url=False)[0], Scene, data, study.source)
        problem.received = problem.received or shortened(amount)
        raise problem.moved(study.source.where(entry), f"{path}: {problem.what}") from None
    return number


def _table_around(study: Study, path: str) -> dict[str, Any]:
    """The least data that make a scene in which the key can be set."""
    top, *rest = path.split(".")
    data = study.tables
    if top not in data:
        return {"kind": study.kind}
    named = isinstance(data[top], dict) and top in ("body", "carriage", "sensor", "train")
    return {"kind": study.kind, top: {rest[0]: data[top][rest[0]]} if named else data[top]}


def check_distinct(study: Study, name: str, values: Values) -> None:
    """Refuse an axis of a grid that has a value twice."""
    found, first, counts = np.unique(values, return_index=True, return_counts=True)
    if len(found) < len(values):
        twice = int(np.flatnonzero(counts > 1)[0])
        place = int(np.flatnonzero(values == found[twice])[1])
        what = f"entry {place} repeats entry {first[twice]}"
        raise _bad(study, name, what, "different values", f"{found[twice]:g} {counts[twice]} times")


def _bad(study: Study, key: str, what: str, expected: str, received: str) -> BadInput:
    return study.source.fault(f"sweep.{key}", what, expected=expected, received=received)
