"""A train: axles one behind another, written as one table and read as one carriage for each of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Annotated, Any, ClassVar, Literal, TypeVar, get_args

import numpy as np
from pydantic import AfterValidator, Field, Strict, Tag, ValidationError, model_validator

from engine.scene.motions.along_bodies import AnyMotion
from engine.scene.motions.base import Motion
from engine.scene.motions.standing import Standing
from engine.study_file.document import Document
from engine.study_file.refusals import refuse
from engine.study_file.spec import LIKE_OSCILLATORS, LIST, NUMBER, KindOf, Noun, Spec, by_amount_form
from engine.study_file.units import (
    Angle,
    Damping,
    Dimensionless,
    Force,
    Frequency,
    Length,
    Mass,
    Stiffness,
    Time,
    fault,
)
from results_schema.arrays import Array

MAX_AXLES = 200

T = TypeVar("T")
OneOrEach = Annotated[
    Annotated[T, Tag(NUMBER)] | Annotated[tuple[T, ...], Strict(False), Field(min_length=1), Tag(LIST)], by_amount_form
]


def _in_a_row(motion: Motion) -> Motion:
    if not (motion.ends or (motion.passes and motion.pace == "speed")):
        expected = 'kind = "cruise", "point-to-point" or "out-and-back"'
        raise fault("the axles of a train keep their distances", expected=expected, received=motion.kind)
    return motion


class Train(Spec):
    """Base of all trains. Its axles are the carriages NAME_1 (in front), NAME_2 and so on.

    axles: how many, which a list of distances tells too. spacing: m from every axle to the next, or one for each,
    from the front. delay: s after time 0 at which the first axle sets off, 0 if not given. spacing_scale, load_scale:
    factors of all distances, and of all forces and masses.
    loads, springs: keys of numbers that are the same for all axles, or listed for each from the front; the former are
    those that `load_scale` multiplies, in `units`. unsprung: that of the mass which moves with the body; "" for none.
    """

    looked_for: ClassVar[Mapping[str, str]] = {
        key: f"this is a key of its motion: motion.{key}, or {key} below the header [train.NAME.motion]"
        for key in ("speed", "start", "end", "after")
    }
    units: ClassVar[str] = "kg"
    loads: ClassVar[tuple[str, ...]] = ()
    unsprung: ClassVar[str] = ""
    springs: ClassVar[tuple[str, ...]] = ()

    kind: str
    on: Annotated[str, Noun("the name of a body")]
    motion: Annotated[AnyMotion, AfterValidator(_in_a_row)]
    axles: int | None = Field(default=None, ge=1, le=MAX_AXLES)
    spacing: OneOrEach[Annotated[Length, Field(gt=0)]]
    delay: Time | None = Field(default=None, ge=0)
    spacing_scale: Dimensionless = Field(default=1.0, gt=0)
    load_scale: Dimensionless = Field(default=1.0, gt=0)

    @property
    def count(self) -> int:
        """Number of axles."""
        return self.axles if not isinstance(self.spacing, tuple) else len(self.spacing) + 1  # type: ignore[return-value]

    @property
    def distances(self) -> tuple[float, ...]:
        """m by which its axles trail the first, before `spacing_scale`."""
        if isinstance(self.spacing, tuple):
            return tuple(accumulate(self.spacing, initial=0.0))
        return tuple(self.spacing * axle for axle in range(self.count))

    @property
    def length(self) -> float:
        """m from its first axle to its last."""
        return self.distances[-1] * self.spacing_scale

    @property
    def axle_loads(self) -> Array:
        """(axles,) N or kg of every axle."""
        return np.asarray(np.sum([np.array(self.own(key)) * self.scale(key) for key in self.loads], axis=0))

    @property
    def load(self) -> float:
        """N or kg of all its axles together."""
        return float(self.axle_loads.sum())

    @property
    def unsprung_mass(self) -> float:
        """kg of all axles together that move with the body."""
        return self.scale(self.unsprung) * sum(self.own(self.unsprung)) if self.unsprung else 0.0

    def in_step(self, wavelength: Array) -> Array:
        """The part of its load that pushes in step with a wave of so many m (L,): the train's spectrum
        |sum P_k exp(2 pi i x_k/wavelength)| (EN 1991-2, annex E, without the span and its damping) over sum P_k."""
        places = np.array(self.distances) * self.spacing_scale
        loads = np.sum([self.own(key) for key in self.loads], axis=0)
        turned = np.exp(2j * np.pi * places / wavelength[:, None]) @ loads
        return np.asarray(np.abs(turned) / loads.sum())

    @property
    def swept(self) -> str:
        """What of it may be swept, in words."""
        if self.motion.ends:
            return "delay, load_scale, a load or a number of the motion, but not where that begins and ends"
        return "delay, spacing (one for all), spacing_scale, load_scale, a load or a number of the motion"

    @property
    def each(self) -> tuple[str, ...]:
        """Keys of all that an axle has of its own besides its place."""
        return (*self.loads, *self.springs)

    def own(self, key: str) -> tuple[float, ...]:
        """A number of every axle, before the scales."""
        return self.each_of(getattr(self, key))

    def each_of(self, value: float | tuple[float, ...]) -> tuple[float, ...]:
        """One number for all axles, or a list with one for each, as such a list."""
        return value if isinstance(value, tuple) else (value,) * self.count

    def scale(self, key: str) -> float:
        """The factor of a number of the axles."""
        return self.load_scale if key in self.loads else 1.0

    def numbers(self, axle: int) -> dict[str, Any]:
        """What an axle has of its own, counted from 0, by the keys of carriages."""
        found = {key: self.own(key)[axle] * self.scale(key) for key in self.each}
        if self.delay is not None:
            found["delay"] = self.delay
        trails = axle and not self.motion.ends
        return found | ({"headway": self.distances[axle] * self.spacing_scale} if trails else {})

    def ends(self, axle: int) -> dict[str, float]:
        """m where the way of an axle begins and ends, by the keys of its motion, where it is on the body all the
        time: as far behind the first as it stands."""
        if not self.motion.ends:
            return {}
        start, end = (float(getattr(self.motion, key)) for key in self.motion.ends)
        behind = float(np.sign(end - start)) * self.distances[axle] * self.spacing_scale
        return dict(zip(self.motion.ends, (start - behind, end - behind), strict=True))

    def follow(self, key: str) -> Iterator[tuple[int, str, float]]:
        """What follows a number of the train in proportion: axle from 0, its key and the factor."""
        first, _, rest = key.partition(".")
        trailing, axles = range(1, self.count), range(self.count)
        if self.motion.ends and (first.startswith("spacing") or (first == "motion" and rest in self.motion.ends)):
            return  # their places would not grow in proportion
        if key == "spacing" and not isinstance(self.spacing, tuple):
            yield from ((axle, "headway", axle * self.spacing_scale) for axle in trailing)
        elif key == "spacing_scale":
            yield from ((axle, "headway", self.distances[axle]) for axle in trailing)
        elif key == "load_scale":
            each = ((axle, load, self.own(load)[axle]) for load in self.loads for axle in axles)
            yield from (number for number in each if number[-1])
        elif first in ("motion", "delay"):
            yield from ((axle, key, 1) for axle in axles)
        elif first in self.each:
            yield from ((axle, first, self.scale(first)) for axle in ([int(rest)] if rest else axles))

    def agree(self, key: str, each: Sequence[float]) -> None:
        """That a list has a number for each axle. Raises."""
        if len(each) != self.count:
            what = f"{key} is one number for all axles, or a list with one for each"
            received = f"a list of {len(each)} number{'s' * (len(each) != 1)}"
            raise fault(what, expected=f"{self.count} numbers, or one without brackets", received=received)

    @model_validator(mode="after")
    def _axles_agree(self) -> Train:
        listed = isinstance(self.spacing, tuple)
        if self.axles is None and not listed:
            raise fault("the number of axles is missing", expected="axles = 2 or more, or a list of spacings")
        if listed and self.axles not in (None, self.count):
            expected = f"axles = {self.count}, or without this key"
            raise fault("spacings lie between axles", expected=expected, received=f"axles = {self.axles}")
        for key in self.each:
            self.agree(key, self.own(key))
        last = min(self.ends(self.count - 1).values(), default=0.0)
        if last < 0.0:
            what = "the last axle is off the body at an end of its way, where only a cruise comes onto it"
            raise fault(
                what, expected=f"places {-last:.4g} m further on", received=f"{last:.4g} m, {self.length:.4g} behind"
            )
        return self


class Pulsations(Spec):
    """What forces in a row swing by, as a force alone does: at one frequency (Hz), by amplitudes (N) and from phases
    (rad) that are the same for all or listed for each from the front."""

    amplitude: OneOrEach[Force]
    frequency: Frequency = Field(gt=0)
    phase: OneOrEach[Angle] = 0.0


class ForceTrain(Train):
    """Forces in N along gravity, with what they swing by, as of persons one behind another."""

    units = "N"
    loads = ("force",)
    kind: Literal["force"]
    force: OneOrEach[Force]
    pulsation: Pulsations | None = None

    def numbers(self, axle: int) -> dict[str, Any]:
        return super().numbers(axle) | ({"pulsation": pulses[axle]} if (pulses := self._pulses) else {})

    def follow(self, key: str) -> Iterator[tuple[int, str, float]]:
        yield from super().follow(key)
        first, _, rest = key.partition(".")
        number, _, place = rest.partition(".")
        if key == "load_scale" and self.pulsation is not None:
            amplitudes = self.each_of(self.pulsation.amplitude)
            yield from ((axle, "pulsation.amplitude", own) for axle, own in enumerate(amplitudes) if own)
        elif first == "pulsation":
            scale = self.load_scale if number == "amplitude" else 1.0
            yield from ((axle, f"pulsation.{number}", scale) for axle in ([int(place)] if place else range(self.count)))

    @property
    def _pulses(self) -> list[dict[str, float]]:
        """What every force swings by, by the keys of carriages; none where none does."""
        if self.pulsation is None:
            return []
        numbers = {key: self.each_of(getattr(self.pulsation, key)) for key in Pulsations.model_fields}
        each = [dict(zip(numbers, own, strict=True)) for own in zip(*numbers.values(), strict=True)]
        return [own | {"amplitude": own["amplitude"] * self.load_scale} for own in each]

    @model_validator(mode="after")
    def _pulsations_agree(self) -> ForceTrain:
        for key in ("amplitude", "phase") if self.pulsation is not None else ():
            self.agree(f"pulsation.{key}", self.each_of(getattr(self.pulsation, key)))
        return self


class MassTrain(Train):
    """Rigid masses in kg that stay in contact; their weights act."""

    loads = ("mass",)
    unsprung = "mass"
    kind: Literal["mass"]
    bilateral: bool = False
    mass: OneOrEach[Annotated[Mass, Field(gt=0)]]
    inertia_along: bool = False
    inertia_across: bool = False


class OscillatorTrain(Train):
    """Sprung masses, each on a wheel of its own."""

    looked_for: ClassVar[Mapping[str, str]] = dict(Train.looked_for) | LIKE_OSCILLATORS
    loads = ("mass", "wheel_mass")
    unsprung = "wheel_mass"
    springs = ("stiffness", "damping")
    kind: Literal["oscillator"]
    bilateral: bool = False
    mass: OneOrEach[Annotated[Mass, Field(gt=0)]]
    wheel_mass: OneOrEach[Annotated[Mass, Field(ge=0)]] = 0.0
    stiffness: OneOrEach[Annotated[Stiffness, Field(gt=0)]]
    damping: OneOrEach[Annotated[Damping, Field(ge=0)]] = 0.0
    inertia_along: bool = False
    inertia_across: bool = False


TRAINS: Mapping[str, type[Train]] = {"force": ForceTrain, "mass": MassTrain, "oscillator": OscillatorTrain}
AnyTrain = Annotated[Train, KindOf("train", TRAINS)]


class Trains(Spec):
    """All trains of a study file."""

    train: dict[str, AnyTrain] = Field(default_factory=dict)

    @property
    def axles(self) -> dict[str, str]:
        """The train of every carriage that is an axle, by its name."""
        return {axle_name(name, axle): name for name, train in self.train.items() for axle in range(train.count)}


def axle_name(train: str, axle: int) -> str:
    """Name of the carriage of an axle, counted from 0."""
    return f"{train}_{axle + 1}"


def with_axles(document: Document) -> Document:
    """The document with a carriage for every axle, behind those that were written. Raises BadInput.

    Errors in such a carriage name the train. What is written of one, as where one axle is swept, stands above what the
    train says.
    """
    data, source = document.data, document.source
    written = data.get("carriage", {})
    if "train" not in data or not isinstance(written, dict):
        return document
    try:
        trains = Trains(train=data["train"]).train
    except ValidationError as error:
        refuse(error, Trains, {"train": data["train"]}, source)
    axles, trained_by = {}, {}
    for name, train in trains.items():
        shared = {key: value for key, value in data["train"][name].items() if key not in Train.model_fields}
        shared |= {key: data["train"][name][key] for key in ("kind", "on")}
        for axle in range(train.count):
            own = axle_name(name, axle)
            motion = {"motion": data["train"][name]["motion"] | train.ends(axle)}
            axles[own] = shared | train.numbers(axle) | motion
            trained_by[f"carriage.{own}"] = f"train.{name}"
    for name in axles:
        if isinstance(written.get(name), dict) and "kind" in written[name]:
            here, what = f"carriage.{name}", "two carriages have this name"
            raise source.fault(here, what, received=f"an axle of {trained_by[here]}", remedy="another name")
    return Document(data | {"carriage": _overlaid(written, axles)}, replace(source, written_as=trained_by))


def moving_first(document: Document) -> Document:
    """The document with carriages that stand behind those that move, as places are told and steps counted by the way of
    the first one; as it was written where a study at rest lists the places of that."""
    data = document.data
    carriages, question = data.get("carriage"), data.get("question")
    if not isinstance(carriages, dict) or (isinstance(question, dict) and isinstance(question.get("positions"), list)):
        return document
    ordered = {name: carriages[name] for name in sorted(carriages, key=lambda name: _stands(carriages[name]))}
    return Document(data | {"carriage": ordered}, document.source)


def _stands(carriage: object) -> bool:
    """Whether a table, as it was written, is that of a carriage that stands."""
    motion = carriage.get("motion") if isinstance(carriage, dict) else None
    return isinstance(motion, dict) and motion.get("kind") in get_args(Standing.model_fields["kind"].annotation)


def _overlaid(above: Mapping[str, Any], below: Mapping[str, Any]) -> dict[str, Any]:
    """One table of both; what stands in `above` comes first and counts."""
    both = {
        key: _overlaid(above[key], below[key])
        for key in above
        if isinstance(below.get(key), dict) and isinstance(above[key], dict)
    }
    return {**above, **{key: value for key, value in below.items() if key not in above}, **both}
