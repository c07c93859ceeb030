"""A study as the user describes it: validated, frozen, in SI units."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, PrivateAttr, ValidationError

from engine.bodies import BODIES, AnyBody
from engine.bodies.modal.description import Recorded, Spots
from engine.bodies.modal.section_doubts import Doubt, damping_doubt
from engine.scene.carriages import AnyCarriage
from engine.scene.dotted_keys import numbers_in, value_in, values_by_key, with_value
from engine.scene.frames import Frame, inertia_checks
from engine.scene.loads import Load, Spring
from engine.scene.references import check_names, check_references
from engine.scene.robots import Arm, Robot, limit_checks
from engine.scene.sensors import Envelope, Sensor
from engine.scene.settings import Output, Solver, Sweep
from engine.scene.trains import Trains, axle_name, moving_first, with_axles
from engine.study_file.checks import Check, on_body
from engine.study_file.document import Document, Source, document_of, read_document
from engine.study_file.refusals import field_at, refuse
from engine.study_file.spec import Noun, Several, one_of
from engine.study_file.units import Acceleration, Unit, fault
from results_schema.errors import BadInput, shortened
from results_schema.status import Status, label
from results_schema.store import files
from results_schema.variables import Variable, expand, sensor_unit

SCHEMA_VERSION = 1
CELLS = "cells"  # the kind of results of studies that reduce their variants
STANDARD_GRAVITY = 9.80665
KIND = re.compile(r"[a-z][a-z0-9-]{0,63}")
EXPECTABLE = tuple(label(status) for status in Status if status != Status.OK)


def _known_version(version: int) -> int:
    if version != SCHEMA_VERSION:
        remedy = "a newer wanderlast may read it" if version > SCHEMA_VERSION else ""
        raise fault("unknown version", expected=str(SCHEMA_VERSION), received=str(version), remedy=remedy)
    return version


def _kind_name(kind: str) -> str:
    if not KIND.fullmatch(kind):
        remedy = f'did you mean "{kind.lower()}"?' if KIND.fullmatch(kind.lower()) else ""
        what, expected = "not a name of a kind of study", 'a name such as "asymmetry"'
        raise fault(what, expected=expected, received=shortened(kind), remedy=remedy)
    return kind


Statuses = Several[Annotated[str, AfterValidator(one_of(*EXPECTABLE))]]


class Scene(Trains):
    """Every table of a study file, each valid by itself; `Study` adds what must hold between them."""

    schema_version: Annotated[int, AfterValidator(_known_version)] = SCHEMA_VERSION
    title: str = Field(default="", max_length=500)
    kind: Annotated[str, AfterValidator(_kind_name), Noun('a kind of study, such as kind = "passage"')]
    expected: Statuses = ()  # statuses that belong to the study's answer
    gravity: Acceleration = Field(default=STANDARD_GRAVITY, ge=0)
    initial: Literal["rest", "equilibrium"] | None = None
    body: dict[str, AnyBody] = Field(default_factory=dict)
    frame: dict[str, Frame] = Field(default_factory=dict)
    load: dict[str, Load] = Field(default_factory=dict)
    spring: dict[str, Spring] = Field(default_factory=dict)
    arm: dict[str, Arm] = Field(default_factory=dict)
    robot: dict[str, Robot] = Field(default_factory=dict)
    carriage: dict[str, AnyCarriage] = Field(default_factory=dict)
    sensor: dict[str, Sensor] = Field(default_factory=dict)
    envelope: dict[str, Envelope] = Field(default_factory=dict)
    sweep: Sweep = Field(default_factory=lambda: Sweep.model_validate({}))
    solver: Solver = Field(default_factory=Solver)
    output: Output = Field(default_factory=Output)
    question: dict[str, Any] = Field(default_factory=dict)  # of the kind of study, which validates it


class Study(Scene):
    """A whole study; from keywords as in the file, or from a file by `load`.

    Raises BadInput with the file's name, the dotted key, what was found and what is wanted. The first parameter is
    only for `load`.

    >>> Study(kind="passage", gravity="1 km/s^2").gravity
    1000.0
    """

    _source: Source = PrivateAttr()
    _data: dict[str, Any] = PrivateAttr()
    _tables: dict[str, Any] = PrivateAttr()

    def __init__(self, document: Document | None = None, /, **keywords: Any) -> None:
        if not isinstance(document, Document | None):
            raise _no_study(document, "keywords such as kind and body")
        given = document if document is not None else document_of({"schema_version": SCHEMA_VERSION, **keywords})
        whole = moving_first(with_axles(given))
        try:
            super().__init__(**whole.data)
        except ValidationError as error:
            refuse(error, Scene, whole.data, whole.source)
        self._source, self._data, self._tables = whole.source, given.data, whole.data
        _check_swept_words(self)
        check_names(self)
        check_references(self)
        verify(self)

    @property
    def source(self) -> Source:
        """Text and SHA-256 of the study file; for keywords the same study written as TOML."""
        return self._source

    def toml(self) -> str:
        """The text of a study file that `load` reads back into an equal study: the file's own, with its comments, or
        the keywords as tables.

        >>> load(Study(kind="passage", gravity="1 km/s^2").toml()).gravity
        1000.0
        """
        return self._source.text

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write that as a file, which the commands read; its path. Raises BadInput where there is something at that
        place, but for a file with ``overwrite``, and OutputFailed."""
        path = Path(path)
        files.check_place(path, overwrite=overwrite)
        files.write_text(path, self.toml())
        return path

    def __eq__(self, other: object) -> bool:
        """Whether two studies say the same, whatever their texts."""
        return other.__class__ is self.__class__ and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((self.kind, self.title))

    @property
    def data(self) -> dict[str, Any]:
        """The tables as they were written, without defaults; not to be changed."""
        return self._data

    @property
    def tables(self) -> dict[str, Any]:
        """The same with a carriage for every axle of a train."""
        return self._tables

    def _repr_html_(self) -> str:
        """How notebooks show it: title, kind, what is swept, and the file."""
        axes = ", ".join(f"{name} ({axis.size})" for name, axis in self.sweep.axes.items()) or "nothing"
        text = f"<pre>{escape(self.source.text)}</pre>"
        return (
            f"<b>{escape(self.title or self.kind)}</b><br>{escape(self.kind)}, swept: "
            f"{escape(axes)}<details><summary>study file</summary>{text}</details>"
        )

    @property
    def start(self) -> Literal["rest", "equilibrium"]:
        """How the march starts: as given, else from rest if every carriage cruises or frames move, else from
        equilibrium."""
        if self.initial is not None:
            return self.initial
        if self.frame or any(c.motion.slides for c in self.carriage.values()):
            return "rest"
        return "rest" if all(c.motion.passes for c in self.carriage.values()) else "equilibrium"

    @property
    def clock(self) -> str:
        """Name of the carriage whose passage or cycle is the unit of scene time: the first one."""
        return next(iter(self.carriage))

    @property
    def has_critical_speed(self) -> bool:
        """Whether omega_1 L/pi says something of the first carriage: not on a body with supports between its ends."""
        return bool(self.carriage) and self.body[self.carriage[self.clock].on].is_one_span

    def body_of(self, sensor: str) -> str:
        """Name of the body that a sensor reads."""
        place = self.sensor[sensor]
        return self.carriage[place.rides].on if place.rides is not None else str(place.body)

    def spots(self, body: str) -> Spots:
        """What its sensors read off the track of a body."""
        found = ((name, sensor.spot) for name, sensor in self.sensor.items() if sensor.body == body)
        return tuple((name, spot) for name, spot in found if spot is not None)

    def dampers(self, body: str) -> Iterator[tuple[str, float | str, float]]:
        """Discrete dampers of a body: key, place on the track (m) or a point's name, coefficient (N s/m)."""
        for key, at, coefficient in self.body[body].dampers():
            yield f"body.{body}.{key}", at, coefficient

    def value(self, path: str) -> Any:
        """The value at a dotted key, SI, defaults included. KeyError, which names those there are, where there is none.

        >>> Study(kind="passage").value("gravity")
        9.80665
        """
        return value_in(self, path)

    def numbers(self) -> dict[str, float]:
        """Every number of the model by its dotted key, SI, defaults included."""
        return dict(numbers_in(self))

    def doubts(self) -> Iterator[Doubt]:
        """Conditions that its numbers may break, but are hardly meant to."""
        for name, body in self.body.items():
            yield from body.doubts(f"body.{name}")
            if isinstance(body.damping_ratio, float):
                yield damping_doubt(f"body.{name}")

    def unit(self, path: str) -> Unit | None:
        """Dimension of the number at a dotted key; None for integers such as a number of modes."""
        place = field_at(Scene, self._tables, path.split("."))
        return place.unit if place else None

    def targets(self, path: str) -> dict[str, float]:
        """The numbers that a swept key sets, by dotted key, each with the factor of the swept value: itself, or those
        of a train's axles; none where they do not grow in proportion."""
        table, name, key = (*path.split(".", 2), "", "")[:3]
        if table != "train" or name not in self.train:
            return {path: 1}
        follow = self.train[name].follow(key)
        return {f"carriage.{axle_name(name, axle)}.{own}": factor for axle, own, factor in follow}

    @property
    def sensor_units(self) -> dict[str, str]:
        """Name and unit of every sensor."""
        return {name: sensor_unit(sensor.quantity) for name, sensor in self.sensor.items()}

    @property
    def envelope_units(self) -> dict[str, str]:
        """Name and unit of every envelope."""
        return {name: sensor_unit(envelope.quantity) for name, envelope in self.envelope.items()}

    @property
    def results_kind(self) -> str:
        """The kind whose declared results its dataset has: its own, or that of cells."""
        return self.kind if self.output.keeps_variants else CELLS

    def results(self, kind: str) -> dict[str, Variable]:
        """What a kind of study tells of this scene, by name. Raises BadInput where two would have one name."""
        try:
            found = expand(kind, self.sensor_units, tuple(self.carriage), self.envelope_units)
        except BadInput as error:
            raise error.moved(self._source.where(error.where)) from None
        for name in self.sweep.axes:
            if name in found:
                what = "a result has this name"
                raise self._source.fault(f"sweep.{name}", what, remedy="choose another name for the axis")
        return found

    def with_values(self, values: Mapping[str, Any] | Iterable[tuple[str, Any]]) -> Study:
        """The study with other values at dotted keys, validated as a whole; its text is the new study as TOML.

        Raises BadInput, also for a key that an axis of the sweep sets, unless that axis is given anew.
        """
        data, values = self._data, values_by_key(values)
        for name, axis in self.sweep.axes.items():
            if (lost := next((path for path in axis.of if path in values), None)) and not _is_of_sweep(name, values):
                raise self._source.fault(
                    lost,
                    f"sweep.{name} sets this key in every variant, whatever stands here",
                    received=f"{lost} = {shortened(values[lost])}",
                    remedy=f"study.without_sweep().with_values(...), or other values of sweep.{name}",
                )
        for path, value in values.items():
            try:
                data = with_value(data, path, value)
            except KeyError:
                raise self._source.fault(path, "no such key") from None
        return Study(document_of(data, self._source.name))

    def without_sweep(self) -> Study:
        """The base scene alone."""
        data = {key: table for key, table in self._data.items() if key != "sweep"}
        return Study(document_of(data, self._source.name))


def _is_of_sweep(name: str, values: Mapping[str, Any]) -> bool:
    """Whether values at dotted keys are also those of an axis."""
    return any(path in ("sweep", f"sweep.{name}") or path.startswith(f"sweep.{name}.") for path in values)


def json_schema(kinds: Sequence[str]) -> dict[str, Any]:
    """The JSON schema of a study file. kinds: the kinds of study that there are."""
    found = Scene.model_json_schema(by_alias=True)
    found["properties"]["kind"]["enum"] = list(kinds)
    found["properties"]["sweep"] = {
        "type": "object",
        "properties": {"zip": {"anyOf": [{"type": "boolean"}, {"type": "array", "items": {"type": "string"}}]}},
        "additionalProperties": {"$ref": "#/$defs/SweepAxis"},
    }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "wanderlast study", **found}


def load(path_or_text: str | Path) -> Study:
    """The study of a file, or of TOML text with line breaks. Raises BadInput."""
    return Study(_read(path_or_text))


def study_of(given: Study | str | Path) -> Study:
    """A study as it is, or that of a file, or of its text. Raises BadInput."""
    if isinstance(given, Study):
        return given
    if isinstance(given, str | Path):
        return load(given)
    raise _no_study(given, "a study, or the path of a study file")


def _no_study(given: object, expected: str) -> BadInput:
    remedy = "engine.Study(**tables) takes the tables of a dict, engine.load(path) those of a file"
    received = f"a {type(given).__name__}"
    return BadInput("this is no study", where="study", expected=expected, received=received, remedy=remedy)


def load_recorded(text: str, recorded: Mapping[str, Recorded]) -> Study:
    """The study of an archive from its text: bodies out of files are as recorded, and no file is opened.

    recorded: by the names of bodies; one that is missing, as nothing uses it, has no length. Raises BadInput.
    """
    document = _read(f"{text}\n")
    tables = document.data.get("body")
    if not isinstance(tables, dict):
        return Study(document)
    bodies = {name: _beside(table, recorded.get(name, Recorded(math.nan))) for name, table in tables.items()}
    return Study(Document(document.data | {"body": bodies}, document.source))


def _beside(table: Any, recorded: Recorded) -> Any:
    """The table of a body with what is recorded of it, if it is one that is made of files."""
    kind = table.get("kind") if isinstance(table, dict) else None
    made_of_files = isinstance(kind, str) and kind in BODIES and BODIES[kind].names_files
    return table | {"recorded": recorded} if made_of_files else table


def _read(path_or_text: str | Path) -> Document:
    """The tables of a study file, or of its text, which must say their version. Raises BadInput."""
    document = read_document(path_or_text)
    if "schema_version" not in document.data:
        expected = f"schema_version = {SCHEMA_VERSION} at the top of the file, above the first [table]"
        raise BadInput("this key is missing", where=document.source.where("schema_version"), expected=expected)
    return document


def verify(study: Study) -> None:
    """Every check of the study for its own numbers. Raises BadInput."""
    for check in checks(study):
        values = {key: study.value(key) for key in check.needs}
        if not check.met(values).all():
            raise check.fault(values, study.source)


def checks(study: Study) -> Iterator[Check]:
    """All conditions between numbers of a study, in the order in which they make sense."""
    for name, body in study.body.items():
        yield from body.checks(f"body.{name}")
    yield from inertia_checks(study.frame, study.body)
    for name, frame in study.frame.items():
        yield from frame.checks(name)
    for table in (study.load, study.spring):
        for name, own in table.items():
            yield from own.checks(name)
    for name, carriage in study.carriage.items():
        yield from carriage.checks(f"carriage.{name}")
    yield from limit_checks(study.arm, study.robot)
    for name, sensor in study.sensor.items():
        here, read = f"sensor.{name}", f"body.{sensor.body}"
        if sensor.spot is not None:
            yield from study.body[str(sensor.body)].spot_checks(sensor.spot, here, read)
        elif sensor.at is not None:
            yield on_body(f"{here}.at", (f"{here}.at", f"{read}.length"), "a sensor off its body")
    yield from _envelope_checks(study)


def _envelope_checks(study: Study) -> Iterator[Check]:
    for name, envelope in study.envelope.items():
        for key, field in (("from", "from_"), ("to", "to")):
            if getattr(envelope, field) is not None:
                here, needs = f"envelope.{name}.{key}", (f"envelope.{name}.{field}", f"body.{envelope.body}.length")
                yield on_body(here, needs, "an envelope off its body")


def _check_swept_words(study: Study) -> None:
    """Axes hold numbers; before their names are looked at, since another name would not help."""
    for name, axis in study.sweep.axes.items():
        for path in axis.of:
            place = field_at(Scene, study.tables, path.split("."))
            if place is not None and place.holds_words_only:
                raise study.source.fault(
                    f"sweep.{name}.of",
                    "a word cannot be swept",
                    expected="the key of a number",
                    received=shortened(path),
                    remedy="a study file for each word, or a loop in Python: study.with_values({key: word})",
                )
