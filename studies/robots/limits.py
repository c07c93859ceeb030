"""Where all tools stay within the limits that a study names, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from engine.study_file.units import Length, unit_of
from results_schema.arrays import Array, Mask
from studies.findings.absolute_errors import OF_TOOLS, absolute_errors
from studies.protocol.study import question_of
from studies.results.axes import VARIANT, Axis
from studies.results.findings_common import in_words
from studies.results.formatting import Scale, counted, listed, number, quantity
from studies.results.places import Index, extreme
from studies.robots.question import LIMITED, Question

if TYPE_CHECKING:
    from studies.results.results import Results

DOING = {"moving": "in moves", "working": "at work", "holding": "while holding"}
MOST_TOLD = 4  # values of other swept numbers that are told one by one


@dataclass(frozen=True)
class Limit:
    """A limit (m) of a result over robots, what it is of in words, and the unit in which the study has it."""

    name: str
    value: float
    words: str
    typed: Scale | None

    def say(self, value: float, digits: int = 3) -> str:
        """A value (m) in that unit."""
        if self.typed is None:
            return quantity(value, "m", digits)
        return f"{number(value * self.typed.factor, digits)} {self.typed.unit}"


def limits(results: Results) -> Iterator[Limit]:
    """Those that the study names, in the units in which it has them."""
    question = question_of(results.study, Question)
    for name in LIMITED:
        value, written = getattr(question, name), results.study.question.get(name)
        if value is not None:
            unit, size = unit_of(Length).written(written) if isinstance(written, str) else ("", 1.0)
            off = "of its plan" if name.startswith("error") else "of where it would rest"
            typed = Scale(1.0 / size, unit) if unit else None
            yield Limit(name, value, f"{off} {words_of(name)}", typed)


def words_of(name: str) -> str:
    """What robots do while a result of that name is taken."""
    return DOING[name.rsplit("_", 1)[1]]


def longest_axis(results: Results) -> Axis | None:
    """The swept number with the most values, along which errors are told and drawn; None where there is no sweep."""
    return max((axis for axis in results.axes if axis.values.size > 1), key=lambda axis: axis.values.size, default=None)


def told_limits(results: Results) -> Iterator[str]:
    """One sentence of every limit, and one where that is not certain."""
    for limit in limits(results):
        found = _Found.of(results, limit)
        yield found.sentence()
        yield from found.doubt()


@dataclass(frozen=True, eq=False)
class _Found:
    """What a limit is compared with: values (..., R), m, in the shape of the sweep and by robots."""

    results: Results
    limit: Limit
    values: Array

    @classmethod
    def of(cls, results: Results, limit: Limit) -> _Found:
        return cls(results, limit, results.dataset[limit.name].transpose(*results.dims, "robot").values)

    @property
    def worst(self) -> Array:
        """What the tool that is off the most is off; NaN where none has a number."""
        return np.asarray(np.fmax.reduce(self.values, axis=-1))

    @property
    def known(self) -> Mask:
        return np.isfinite(self.worst)

    @property
    def within(self) -> Mask:
        return self.known & (self.worst <= self.limit.value)

    def robot(self, at: Index) -> str:
        """The robot whose tool is off the most."""
        return list(self.results.study.robot)[int(np.nanargmax(self.values[at]))]

    def off(self, at: Index) -> str:
        """That robot, and how far it is off."""
        return f"{self.robot(at)} is off by {self.limit.say(float(self.worst[at]))}"

    def sentence(self) -> str:
        """Where all tools stay within, and which do not."""
        limit, most, least = self.limit, extreme(self.worst), extreme(self.worst, np.nanargmin)
        asked = f"{limit.say(limit.value, 6)} {limit.words}"
        if most is None or least is None:
            return f"Whether every tool stays within {asked} is not known: no variant has a number."
        if self.within[self.known].all():
            return (
                f"Every tool stays within {asked}{self._all()}: at most {self.off(most)}{in_words(self.results, most)}."
            )
        if self.results.size == 1:
            return f"Not every tool stays within {asked}. Beyond it: {self._beyond()}."
        if not self.within.any():
            least_off = f"{self.off(least)}{in_words(self.results, least)}"
            return f"No variant keeps every tool within {asked}: at best {least_off}. Beyond it: {self._beyond()}."
        return f"Every tool stays within {asked} {self._where()}. Beyond it: {self._beyond()}."

    def doubt(self) -> Iterator[str]:
        """Variants that may be on the other side of the limit by what errors are told of; the nearest by name."""
        above, below = (np.fmax.reduce(self.values + sign * self.error, axis=-1) for sign in (1.0, -1.0))
        unsure = (below <= self.limit.value) & (self.limit.value < above)
        if unsure.any():
            nearest = extreme(np.where(unsure, np.abs(self.worst - self.limit.value), np.nan), np.nanargmin)
            assert nearest is not None
            error = float(self.error[nearest][int(np.nanargmax(self.values[nearest]))])
            many = f" in {counted(int(unsure.sum()), 'variant')}, such as" if unsure.sum() > 1 else ""
            known = f"{self.off(nearest)}, with an estimated error of {self.limit.say(error, 2)}"
            yield f"By its errors that is not certain{many}{in_words(self.results, nearest)}: {known}."

    @property
    def error(self) -> Array:
        """(..., R) m: what errors of tools are told of."""
        each = [absolute_errors(self.results, OF_TOOLS[0], name) for name in self.results.study.robot]
        return np.stack(each, axis=-1)

    def _all(self) -> str:
        """That they do so everywhere."""
        if self.results.size == 1:
            return ""
        some = int(self.known.sum())
        return " in all variants" if some == self.results.size else f" in all {counted(some, 'variant')} with values"

    def _beyond(self) -> str:
        """Robots that are ever beyond the limit, with what they are off at most."""
        most = np.fmax.reduce(self.values.reshape(-1, self.values.shape[-1]), axis=0)
        pairs = zip(self.results.study.robot, most, strict=True)
        return listed([f"{name} up to {self.limit.say(float(off))}" for name, off in pairs if off > self.limit.value])

    def _where(self) -> str:
        """In which part of the sweep all tools stay within."""
        axis = longest_axis(self.results)
        assert axis is not None
        others = [other for other in self.results.axes if other is not axis and other.values.size > 1]
        cuts = list(product(*(range(other.values.size) for other in others)))
        if axis.dim == VARIANT or len(cuts) > MOST_TOLD:
            return self._share([axis, *others])
        told = dict[str, tuple[str, str]]()
        for cut in cuts:
            held = {other.dim: place for other, place in zip(others, cut, strict=True)}
            words = ", ".join(other.at(place) for other, place in zip(others, cut, strict=True))
            told[words] = self._along(axis, held)
        if len(told) == 1:
            return "".join(next(iter(told.values())))
        if len({part for part, _ in told.values()}) == 1:
            return f"{next(iter(told.values()))[0]} for every {listed([other.noun for other in others])}"
        return "; ".join(f"with {words} {part}{beyond}" for words, (part, beyond) in told.items())

    def _share(self, axes: Sequence[Axis]) -> str:
        """In how many variants, and up to which value of a swept number in all."""
        said = f"in {int(self.within.sum()):,} of {counted(self.results.size, 'variant')}"
        for axis in axes:
            value = self.results.holds_up_to(axis, self.within, self.known)
            if value is not None:
                return f"{said}, in all of them up to {axis.noun} {axis.in_words(value)}"
        return said

    def _along(self, axis: Axis, held: Mapping[str, int]) -> tuple[str, str]:
        """In which part of an axis, while others are held at places of theirs; and where it ends, what is beyond."""
        order = np.argsort(axis.values).tolist()
        places = [tuple({**held, axis.dim: i}[dim] for dim in self.results.dims) for i in order]
        kept = np.array([bool(self.within[place]) for place in places])
        turns = np.flatnonzero(np.diff(kept))
        if not turns.size:
            return f"everywhere from {axis.noun} {axis.span}" if kept[0] else "nowhere", ""
        if turns.size > 1:
            return f"only at {axis.noun} {self._parts(axis, order, kept)}", ""
        last, first = (turns[0], turns[0] + 1) if kept[0] else (turns[0] + 1, turns[0])
        side = f"up to {axis.at(order[last])}" if kept[0] else f"from {axis.at(order[last])} on"
        beyond = self.off(places[first]) if self.known[places[first]] else "no value is known"
        return side, f" (at {axis.value(order[first])} {beyond})"

    def _parts(self, axis: Axis, order: Sequence[int], kept: Mask) -> str:
        """The values of an axis at which something is so, those without others between as one."""
        bounds = np.flatnonzero(np.diff(kept, prepend=False, append=False))
        spans = []
        for first, end in zip(bounds[::2], bounds[1::2], strict=True):
            spans.append(" to ".join(dict.fromkeys(axis.value(order[i]) for i in (first, end - 1))))
        return listed(spans)
