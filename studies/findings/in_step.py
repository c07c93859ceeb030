"""Speeds at which the axles of a train push in step with a frequency of the body that they cross, and how strongly;
whether such a resonance may lie between the speeds of a sweep."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from engine.model.scene_model import UNFELT
from engine.scene.sensors import Envelope, Sensor
from engine.scene.study import Study
from engine.scene.trains import Train, axle_name
from results_schema.arrays import Array, Counts
from results_schema.lazy_imports import xr
from results_schema.quantities import QUANTITIES
from studies.findings.amplification import sizes
from studies.findings.theory import along_track, first_omega
from studies.results.axes import VARIANT, Axis
from studies.results.formatting import ALIKE, number, percent
from studies.results.places import Index
from studies.results.results import Results

#: Speeds that are looked at between the lowest and the highest, and the part of a train's load that has to push in
#: step to be told: a bogie of two axles does so far from any resonance of the whole train. Of many axles less is much:
#: times what they push at random, 1/sqrt(n) of their load (24 % of 40 axles swung a bridge by 7 m/s2).
LOOKED_AT, TOLD_IN_STEP, BEYOND_CHANCE = 4096, 0.3, 1.3
#: Beside a resonance of n coaches a fifth of it comes in step at 1.4 times the speed by which its way leaves one more
#: or less of them on the train's length, and less further on: so many of these, where another peak is so much larger.
LOBES, OVER_LOBES = 4.0, 4.0
FEWEST = 3  # axles, or loads in a row: what one or two pushes leave is no resonance
MODES, MOST = 4, 8  # that are looked at, the lowest that move the track; speeds that are told
WAYS = 4.0  # lengths of a train: the wave along which its axles push the least together is shorter
LEAST = 0.05  # of the largest swing: what is less builds up to nothing
ACCELERATION, NO_DECAY = 2, 1e-12  # order by time
#: Of what is read, at least, a swing that the answer tells: of a third mode it was a hundredth, with no peak to see.
TOLD_OF_LARGEST = 0.2
BEYOND = 1.5  # times a speed, up to which values climb to a resonance: those of a 15 m bridge did from 0.66 of it on
NEAR = 0.05  # of a frequency, as half-power points are with 5 % damping: a force that pulsates so near is in step
DAMPING = ".damping_ratio"  # which moves no speed
WITH_MASSES = " with them on it"


class InStep(NamedTuple):
    """A speed (m/s) at which a part of a train's load pushes in step with a frequency (Hz): where axles are
    speed/frequency m apart, one comes in every period. swing: to which that mode alone builds up, an acceleration or a
    displacement in `units`."""

    speed: float
    frequency: float
    part: float
    swing: float
    units: str

    @property
    def way(self) -> float:
        """m in a period."""
        return self.speed / self.frequency


def speeds_in_step(
    study: Study, name: str, body: xr.Dataset, between: tuple[float, float], readers: Iterable[Sensor | Envelope]
) -> list[InStep]:
    """Where much of a train's load pushes in step with one of the first frequencies of its body, as it is crossed, the
    highest speed first: at most eight of those at which a mode swings more than a little slower and faster. body: as
    its archive tells it, without what rides on it. readers: where some read accelerations of that body these count, of
    modes up to their frequency limits, else displacements. None of a train that starts and stops, whose axles never
    come in one rhythm for long, or of two axles."""
    train, found, speeds = study.train[name], list[InStep](), np.geomspace(*between, LOOKED_AT)
    if not train.motion.passes or train.count < FEWEST:
        return []
    of_body = [one for one in readers if one.body == train.on]
    read = [one for one in of_body if QUANTITIES[one.quantity].rate == ACCELERATION]
    units, newtons = "m s-2" if read else "m", train.load * (1.0 if train.units == "N" else study.gravity)
    seen = read or [one for one in of_body if QUANTITIES[one.quantity].unit == "m"]
    for mode in _modes(body, max((one.frequency_limit or np.inf for one in read), default=np.inf)):
        own = body.isel({body["frequency"].dims[0]: mode})
        own = _with_masses(own, train) if masses_ride(study, name) else own
        frequency = float(own["frequency"])
        share = train.in_step(speeds / frequency)
        swings = newtons * share * _per_newton(train, own, speeds) * _moved(own, seen)
        swings = swings if read else swings / (2.0 * np.pi * frequency) ** 2
        # Of the product: a crossing may cancel what comes in step just where all of it does.
        least = min(TOLD_IN_STEP, BEYOND_CHANCE / np.sqrt(train.count))
        inside = (swings[1:-1] > swings[:-2]) & (swings[1:-1] >= swings[2:]) & (share[1:-1] >= least)
        inside &= speeds[1:-1] < frequency * _longest_way(train)
        at = _no_lobes(1 + np.flatnonzero(inside), speeds / (frequency * train.length), share)
        numbers = zip(speeds[at].tolist(), share[at].tolist(), swings[at].tolist(), strict=True)
        found += [InStep(speed, frequency, part, swing, units) for speed, part, swing in numbers]
    strongest = sorted(found, key=lambda one: one.swing)[-MOST:]
    return sorted((one for one in strongest if one.swing >= LEAST * strongest[-1].swing), reverse=True)


def _no_lobes(peaks: Counts, ways: Array, share: Array) -> Counts:
    """Peaks of what comes in step that do not stand beside a much larger one; ways: in a period, over the length of the
    train."""
    near = np.abs(ways[peaks] - ways[:, None]) <= LOBES * ways[peaks] ** 2
    largest = np.where(near, share[:, None], 0.0).max(axis=0, initial=0.0)
    return np.asarray(peaks[largest <= OVER_LOBES * share[peaks]])


def masses_ride(study: Study, name: str) -> bool:
    """Whether a train has masses that move with its body."""
    return study.train[name].unsprung_mass > 0.0 and study.solver.fidelity not in ("force", "static")


def _with_masses(mode: xr.Dataset, train: Train) -> xr.Dataset:
    """A mode of the body as it swings with the train's masses on it, on average over their places: with 1 + mu of its
    own mass, mu their mass per m times the integral of the shape squared over what they cross."""
    x, shape = _crossed(train, mode)
    spread = max(train.length * train.count / (train.count - 1), x[-1] - x[0])  # of a short one as many are on it
    more = 1.0 + train.unsprung_mass / spread * float(np.trapezoid(shape**2, x))
    frequency, damping_ratio = (mode[name] / np.sqrt(more) for name in ("frequency", "damping_ratio"))
    return mode.assign(frequency=frequency, damping_ratio=damping_ratio, mode_shape=mode["mode_shape"] / np.sqrt(more))


def _crossed(train: Train, mode: xr.Dataset) -> tuple[Array, Array]:
    """Places (S,) that a train crosses, evenly, and a mode's shape there (S,)."""
    x = along_track(mode)
    low, high = np.clip(train.motion.range(), x[0], x[-1])
    crossed = np.linspace(low, high, x.size)
    return crossed, np.interp(crossed, x, mode["mode_shape"].values)


def _longest_way(train: Train) -> float:
    """m in a period, beyond which axles come ever more at once: no rhythm of theirs excites what is so slow."""
    ways = np.geomspace(train.length / LOOKED_AT, WAYS * train.length, LOOKED_AT)
    share = train.in_step(ways)
    least = np.flatnonzero((share[1:-1] < share[:-2]) & (share[1:-1] <= share[2:]))
    return float(ways[1 + least[-1]]) if least.size else 0.0


def _moved(mode: xr.Dataset, readers: Sequence[Sensor | Envelope]) -> float:
    """By how much a mode moves the places that are read, at most, or its track where one reads something else."""
    shape = np.abs(mode["mode_shape"].values)
    places = [place for one in readers if (place := one.fixed_place) is not None]
    if not places or len(places) < len(readers):
        return float(shape.max())
    return float(np.interp(places, along_track(mode), shape).max())


def _modes(body: xr.Dataset, highest: float) -> Counts:
    """The lowest modes that move the track, up to a frequency (Hz)."""
    size, frequencies = np.abs(body["mode_shape"].values).max(axis=1), body["frequency"].values
    return np.flatnonzero((size > UNFELT * size.max()) & (frequencies > 0.0) & (frequencies <= highest))[:MODES]


def _per_newton(train: Train, mode: xr.Dataset, speeds: Array) -> Array:
    """The acceleration of a mode's coordinate per newton that pushes in step with it.

    After a force F at a speed v it rings with F omega/v |integral of its shape times exp(i omega x/v) dx|, after a
    train with that of the sum of its forces in step, of which damping leaves the mean over the time in which they come.
    """
    omega, (crossed, phi) = 2.0 * np.pi * float(mode["frequency"]), _crossed(train, mode)
    wave = omega / speeds
    turned = np.exp(1j * wave[:, None] * crossed)
    ends = (turned[:, -1] * phi[-1] - turned[:, 0] * phi[0]) / (1j * wave)  # by parts, as the shape bends little
    integral = ends + np.diff(turned, axis=1) @ (np.diff(phi) / np.diff(crossed)) / wave**2  # between two places
    decay = np.maximum(float(mode["damping_ratio"]) * wave * train.length, NO_DECAY)
    return np.asarray(np.abs(integral) * wave * -np.expm1(-decay) / decay)


def trains_in_step(
    results: Results,
    axis: Axis,
    held: Mapping[str, int],
    between: tuple[float, float],
    readers: Collection[Sensor | Envelope],
) -> dict[str, list[tuple[float, InStep]]]:
    """By train, the values of a swept speed at which its axles push in step, with that; held: the place along other
    dimensions. Without trains of another pace, and those of which there are several as nothing holds what is swept."""
    found = dict[str, list[tuple[float, InStep]]]()
    for name in results.study.train:
        factor, scene = axis.targets.get(f"carriage.{axle_name(name, 0)}.motion.speed"), _held(results, name, held)
        if factor is not None and scene is not None:
            study, body = scene
            told = speeds_in_step(study, name, body, (factor * between[0], factor * between[1]), readers)
            found[name] = [(one.speed / factor, one) for one in told]
    return found


def _held(results: Results, name: str, held: Mapping[str, int]) -> tuple[Study, xr.Dataset] | None:
    """The study of one train and its body, with the distances and the body's numbers that are held; None where they
    are not, or a body out of files would have to be built anew."""
    on, values = results.study.train[name].on, dict[str, float]()
    for axis in results.axes:
        keys = results.study.sweep.axes[axis.name].of
        own = [key for key in keys if key.startswith((f"train.{name}.spacing", f"body.{on}.")) and DAMPING not in key]
        if own and axis.dim not in held:
            return None
        values |= {key: axis.values[held[axis.dim]].item() for key in own}
    known = on in results.models and not any(key.startswith("body.") for key in values)
    if (values or not known) and any(results.recorded(body) is not None for body in results.study.body):
        return None
    from engine.batch.dataset import model_groups
    from engine.model.distinct_models import base_scene

    study = results.study.without_sweep().with_values(values)
    return study, results.models[on] if known else model_groups(base_scene(study))[f"/model/{on}"]


def told_in_step(results: Results, place: Index) -> str:
    """At which swept speed the axles of a train push in step with a frequency most strongly, or beyond where the
    largest value, at a place of the sweep, is that of the highest speed up to which the contact holds; "" where no
    train comes in step there, or swings the body by little of that."""
    axis = results.axis(".motion.speed")
    if axis is None:
        return ""
    held = dict(zip(results.dims, place, strict=True))
    holding = np.sort(axis.values)[results.along(axis, results.held, place)]
    top = float(holding.max(initial=-np.inf))
    readers: list[Sensor | Envelope] = [*results.study.sensor.values(), *results.study.envelope.values()]
    highest = top * BEYOND if axis.values[held[axis.dim]] == top else float(axis.values.max())
    found = trains_in_step(results, axis, held, (float(axis.values.min()), highest), readers)
    every = [(one.swing, speed, name, one) for name, told in found.items() for speed, one in told]
    if not every:
        return ""
    _, speed, name, one = max(every)
    read = [sizes(results, sensor)[place] for sensor, units in results.sensors.items() if units == one.units]
    if one.swing < TOLD_OF_LARGEST * max(read, default=0.0):
        return ""
    where = axis.in_words(float(f"{speed * axis.factor:.3g}") / axis.factor)
    where += ", beyond the sweep" * bool(speed > axis.values.max())
    return (
        f" Axles of {name} push in step with a frequency of {results.study.train[name].on}"
        f"{WITH_MASSES * masses_ride(results.study, name)} ({number(one.frequency)} Hz) most strongly at {where}."
    )


def told_pulsation(results: Results, place: Index) -> str:
    """That a force pulsates with the first frequency of the body that it crosses, nearly, at a place of the sweep; ""
    where what else stands on it shifts that."""
    if any(own.inertial and own.on == results.carriage.on for own in results.study.carriage.values()):
        return ""
    for name, carriage in results.study.carriage.items():
        if carriage.pulsates and carriage.on == results.carriage.on:
            key = f"carriage.{name}.pulsation.frequency"
            pulse, own = (
                float(results.everywhere(value)[place])
                for value in (results.parameter(key), first_omega(results) / (2.0 * np.pi))
            )
            if abs(pulse - own) <= NEAR * own:
                who = f"train {train}" if (train := results.study.axles.get(name)) else name
                first = f"the first frequency of {carriage.on} ({number(own)} Hz)"
                return f" Where it is largest {who} pulsates in step with {first}."
    return ""


def told_between_speeds(results: Results) -> str:
    """That peaks may be higher between swept speeds, as a sentence behind another; "" where no loads in a row cross a
    body of known damping, or speeds stand no farther apart than a resonance is wide: between its half-power points
    2 zeta of its speed, zeta the lowest damping ratio of the sweep."""
    axis = results.axis(".motion.speed")
    if axis is None or axis.dim == VARIANT or not (ratios := _damping(results, axis)):
        return ""
    zeta, speeds = min(ratios), np.unique(axis.values)
    apart = np.diff(speeds)
    if zeta <= 0.0 or (apart <= (1.0 + ALIKE) * zeta * (speeds[1:] + speeds[:-1])).all():
        return ""
    even = np.ptp(apart) <= ALIKE * apart.max()
    return (
        f" Speeds stand {'' if even else 'up to '}{axis.in_words(float(apart.max()))} apart; a resonance at "
        f"{percent(zeta)} damping is about {percent(2.0 * zeta)} of its speed wide, so peaks between them may be "
        "higher: sweep more closely around the highest."
    )


def _damping(results: Results, speed: Axis) -> list[float]:
    """The lowest damping ratio of every body that a row of loads crosses whose speed an axis sets; none where each mode
    has its own."""
    moved = [results.study.carriage[path.split(".")[1]] for path in speed.paths if path.startswith("carriage.")]
    loads = Counter(carriage.on for carriage in moved if carriage.motion.passes)
    crossed = [name for name, count in loads.items() if count >= FEWEST]
    known = [name for name in crossed if isinstance(results.study.body[name].damping_ratio, float)]
    return [float(np.min(results.parameter(f"body.{name}.damping_ratio"))) for name in known]
