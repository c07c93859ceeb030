"""The numbers that a march of bodies in moving frames reports of a variant, and how far two marches differ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.accuracy.reference import LEAST_LEFT
from engine.floating.settling import banded, settled
from engine.floating.theory import bent_times, unstiffened_times
from engine.kernels.floating.layout import LARGEST, LARGEST_AT, SMALLEST, SMALLEST_AT, SQUARES
from engine.kernels.floating.observe import OF_BODY, OF_CARRIAGE, OF_POINT
from engine.march.settling import names_of_times
from results_schema.arrays import Array, Counts
from results_schema.gravest_status import gravest, lost
from results_schema.quantities import AFTER_STOP, QUANTITIES
from results_schema.status import Status

if TYPE_CHECKING:
    from engine.floating.march import Marched
    from engine.floating.model import FloatingModel
    from engine.scene.sensors import Sensor

#: Signals of a carriage that are reported, by the ends of their names, and what comes of each: its error is held
#: to the tolerance, or only told, as forces that enter excite every mode.
OF_CARRIAGES = (
    ("position", 0, "held"),
    ("speed", 1, "told"),
    ("acceleration_along", 2, "told"),
    ("acceleration_x", 3, "told"),
    ("acceleration_y", 4, "told"),
    ("acceleration_z", 5, "told"),
    ("contact_force", 6, "told"),
)
ENDS = ("max", "min")
KINETIC, POTENTIAL = 0, 1  # signals of the whole
ROUNDING = 1e-9  # of a time
ROUNDED = 1e-12  # of places of an arm, over how far it reaches
#: Of section forces, which hang on accelerations and converge unevenly: of errors of 8 flexible arms 4.2 % were told
#: below the true ones where half a change is left at least, 1.6 % with this.
LEFT_OF_SECTIONS = 1.0


class Signal(NamedTuple):
    """A signal that is reported: name, its number, the tolerance that it is held to (NaN: told), and whether it is
    measured by the length of a track, in place of the largest value of a signal, its own or another; length: of a
    vector; noise: differences below are rounding; left: the part of a change by more steps that may be left at least.
    """

    name: str
    number: int
    tolerance: float
    follows: bool
    along: float
    over: str
    length: bool = False
    noise: float = 0.0
    left: float = LEAST_LEFT


class Result(NamedTuple):
    """A reported number: its name, and the tolerance that it is held to, NaN where its error is only told; follows:
    whether it is `solver.tolerance`; left: as of a signal."""

    name: str
    tolerance: float
    follows: bool
    left: float = LEAST_LEFT


@dataclass(frozen=True, eq=False)
class Outcome:
    """What V variants report by one march: numbers (V,) and (V, B, 3) by name, histories (V, stations, signals) of all
    signals with their times (V, stations), statuses (V,), and the part of a variant's time (V,) by which it may have
    ended sooner: of what has slid over an end its last step; other_bands: by sensor the settling times in other bands
    than its own."""

    numbers: dict[str, Array]
    history: Array
    times: Array
    status: np.ndarray[tuple[int], np.dtype[np.int8]]
    sooner: Array
    other_bands: dict[str, Array]

    def of(self, lanes: Counts) -> Outcome:
        """That of some of the variants."""
        numbers, others = ({name: array[lanes] for name, array in own.items()} for own in self._by_name)
        rest = self.history[lanes], self.times[lanes], self.status[lanes], self.sooner[lanes]
        return Outcome(numbers, *rest, others)

    def put(self, lanes: Counts, other: Outcome) -> None:
        """Replace some of the variants by those of another outcome."""
        for own, others in zip(self._by_name, other._by_name, strict=True):
            for name, array in own.items():
                array[lanes] = others[name]
        self.history[lanes], self.times[lanes], self.status[lanes] = other.history, other.times, other.status
        self.sooner[lanes] = other.sooner

    @property
    def _by_name(self) -> tuple[dict[str, Array], dict[str, Array]]:
        return self.numbers, self.other_bands


def signals(model: FloatingModel) -> Iterator[Signal]:
    """The signals of sensors and carriages that are reported, with histories."""
    tolerance = model.study.solver.tolerance
    for number, (name, sensor) in enumerate(model.study.sensor.items()):
        own = sensor.tolerance
        told = own == "told" or (own is None and QUANTITIES[sensor.quantity].told)
        held = tolerance if own is None else np.nan if told else float(own)
        found = Signal(name, number, np.nan if told else held, own is None and not told, np.nan, name)
        if sensor.reads.has_kinks:
            found = found._replace(left=LEFT_OF_SECTIONS)
        yield _of_arm(model, sensor, found) if sensor.reads.of_arm else found
    first = model.signal_of("carriages")
    for c, (name, carriage) in enumerate(model.study.carriage.items()):
        length = model.bodies[carriage.on].length
        for end, offset, how in OF_CARRIAGES:
            held = how == "held" and name in model.places
            along = length if end == "position" else np.nan
            number = first + OF_CARRIAGE * c + offset
            yield Signal(f"{name}_{end}", number, tolerance if held else np.nan, held, along, f"{name}_{end}")


def _of_arm(model: FloatingModel, sensor: Sensor, signal: Signal) -> Signal:
    """The same of a position error, which is a difference of two places, or the length of that."""
    carriers = model.carriers(str(sensor.body))
    far = np.linalg.norm(model.frame(carriers[0]).position) + sum(model.bodies[name].length for name in carriers)
    return signal._replace(length=sensor.direction is None, noise=ROUNDED * float(far))


def extremes(model: FloatingModel) -> Iterator[Signal]:
    """The signals whose extremes are reported: these, and what is left of position errors after stops, as a part of
    what these are in the whole time."""
    found, first = list(signals(model)), model.signal_of("stops")
    yield from found
    for t, name in enumerate(model.tips):
        whole = next(signal for signal in found if signal.name == name)
        yield whole._replace(name=f"{name}{AFTER_STOP}", number=first + t)


def ends(model: FloatingModel) -> slice:
    """Signals of the places of all tracks' ends."""
    first = model.signal_of("ends")
    return slice(first, first + OF_POINT * len(model.bodies))


def results_of(model: FloatingModel) -> tuple[Result, ...]:
    """All results whose error is measured, in the order of `differences`."""
    found = []
    for signal in extremes(model):
        found += [Result(f"{signal.name}_{end}", signal.tolerance, signal.follows, signal.left) for end in ENDS]
    tolerance = model.study.solver.tolerance
    moves = any(model.frame(name).joints for name in model.bodies)
    found += [Result(f"far end of {name}", tolerance if moves else np.nan, moves) for name in model.bodies]
    return (*found, *(Result(time, np.nan, False) for name in banded(model) for time in names_of_times(name)))


def outcome(model: FloatingModel, marched: Marched) -> Outcome:
    """The numbers of a march."""
    found: dict[str, Array] = {}
    statistics, step = marched.statistics, marched.step
    duration = np.maximum(marched.last * step, np.finfo(np.float64).tiny)
    for signal in extremes(model):
        own = statistics[:, signal.number]
        read = np.isfinite(own[:, LARGEST])  # not where no stop is within the time
        largest, smallest = own[:, LARGEST], own[:, SMALLEST]
        times = {"max_time": own[:, LARGEST_AT] * step, "min_time": own[:, SMALLEST_AT] * step}
        for end, values in {"max": largest, "min": smallest, **times}.items():
            found[f"{signal.name}_{end}"] = np.where(read, values, np.nan)
        if signal.number < len(model.study.sensor):
            found[f"{signal.name}_rms"] = np.sqrt(own[:, SQUARES] * step / duration)
    shape = (len(step), len(model.bodies), 3)
    found["end_max"] = statistics[:, ends(model), LARGEST].reshape(shape)
    found["end_min"] = statistics[:, ends(model), SMALLEST].reshape(shape)
    whole = model.signal_of("whole")
    energy = marched.history[:, :, whole + KINETIC] + marched.history[:, :, whole + POTENTIAL]
    found["energy_change"] = np.fmax.reduce(np.abs(energy - energy[:, :1]), axis=1)
    found["duration"] = marched.last * step
    times, other_bands = settled(model, marched)
    found |= times
    limits = {"unstiffened_time": unstiffened_times(model, marched), "bent_time": bent_times(model, marched)}
    for array in (*found.values(), *other_bands.values(), marched.history):
        array[lost(marched.status)] = np.nan
    buckles = (marched.buckling_ratio >= 1.0).any(axis=1)
    left = np.isfinite(np.concatenate(list(limits.values()), axis=1)).any(axis=1) | buckles
    limits["buckling_ratio"] = marched.buckling_ratio
    status = gravest(marched.status, np.where(left, np.int8(Status.BEYOND_THEORY), np.int8(Status.OK)))
    ended = duration < marched.times[:, -1] * (1.0 - ROUNDING)
    sooner = np.where(ended, 1.0 / np.maximum(marched.last, 1), 0.0)
    return Outcome(found | limits, marched.history, marched.times, status, sooner, other_bands)


def differences(model: FloatingModel, one: Outcome, other: Outcome) -> Array:
    """(R, V) how far two outcomes of the same variants are apart, over the largest of each signal that ``other`` has:
    extremes no less than histories at common times. Infinite where only ``one`` has no numbers, NaN where the other."""
    gaps = np.abs(one.history - other.history)
    ended = np.minimum(one.numbers["duration"], other.numbers["duration"])[:, None, None]
    known = np.isnan(one.history) == np.isnan(other.history)
    gone = known | (other.times[:, :, None] >= ended * (1.0 - ROUNDING))  # one has slid over an end before the other
    gaps = np.where(np.isnan(gaps), np.where(gone, 0.0, np.inf), gaps).max(axis=1)
    found = []
    for signal in extremes(model):
        largest = np.maximum(*(np.abs(other.numbers[f"{signal.over}_{end}"]) for end in ENDS))
        scale = np.full_like(largest, signal.along) if signal.along > 0.0 else largest
        for end in ENDS:
            name = f"{signal.name}_{end}"
            values = one.numbers[name], other.numbers[name]
            gap = np.maximum(np.abs(values[0] - values[1]), gaps[:, signal.number])
            neither = np.isnan(values[0]) & np.isnan(values[1])
            known = signal.length & (values[0] == 0.0) & (values[1] == 0.0)  # nothing is below
            gap = np.where(neither | known | (gap <= signal.noise), 0.0, gap)
            found.append(np.divide(gap, scale, out=np.where(gap > 0.0, np.inf, 0.0), where=scale > 0.0))
    of_ends = gaps[:, ends(model)].reshape(-1, len(model.bodies), 3).max(axis=2)
    found += [of_ends[:, b] / _reach(model, name) for b, name in enumerate(model.bodies)]
    for time in (time for name in banded(model) for time in names_of_times(name)):
        gap, took = np.abs(one.numbers[time] - other.numbers[time]), other.numbers[time]
        gap = np.where(np.isnan(gap), np.where(np.isnan(one.numbers[time]) & np.isnan(took), 0.0, np.inf), gap)
        found.append(np.divide(gap, took, out=np.where(gap > 0.0, np.inf, 0.0), where=took > 0.0))
    apart = np.stack(found)
    sooner = np.abs(one.numbers["duration"] - other.numbers["duration"]) / other.numbers["duration"]
    left = one.status == Status.SEPARATED
    apart[:, left] = np.maximum(apart[:, left], sooner[left])
    apart[:, lost(one.status)] = np.inf
    apart[:, lost(other.status)] = np.nan
    return apart


def _reach(model: FloatingModel, name: str) -> float:
    """The longest track (m) of those that carry the far end of a body, its own too: what is short hangs on an arm."""
    return max(model.bodies[carrier].length for carrier in model.carriers(name))


def frame_signals(model: FloatingModel) -> slice:
    """Signals of all frames."""
    first = model.signal_of("frames")
    return slice(first, first + OF_BODY * len(model.bodies))
