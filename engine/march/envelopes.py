"""Envelopes: the extremes at many places along a body.

The places are watched by marches of their own, each of the same steps as the sensors' march. So what sensors cost, and
every bit of what they read, does not depend on how many places are watched.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from engine.march.tables import SceneTables
from engine.model.attachment import place
from engine.observation.readings import Sensor
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import Direction
    from engine.march.tables import Missed, SegmentTable
    from engine.model.scene_model import SceneModel
    from engine.model.station_path import Along
    from engine.model.ties import Attachment
    from engine.model.timeline import Segment
    from engine.scene.study import Study


MOST_READINGS = 2**21  # stations x places that one march watches in a segment, by the size of its tables
MOST_PAIR_READINGS = 2**19  # the same of a Richardson pair, by the size of its histories
LEAST_PLACES = 4  # that one march watches, however many stations there are
MOST_KEPT = 4  # marches for as many groups of places keep their tables from chunk to chunk
SAME_PLACE = 1e-9  # of a length: places that are the same


@dataclass(frozen=True, eq=False)
class Places(Sensor):
    """All places (X,) m of an envelope that one march watches, whose influence lines are evaluated together.

    known: the lines (X, S) by the array of the loads' places and their direction, as long as tables are built.
    """

    every: Array
    known: dict[tuple[int, Direction], tuple[Array, Array]] = field(default_factory=dict)

    def places(self, along: Along) -> Array:
        """(X, 1), to be broadcast against loads."""
        return self.every[:, None]

    def lines(self, model: SceneModel, along: Along, attachment: Attachment, loaded: Array) -> Array:
        """(X, S) static readings per unit force where an attachment holds its track, at places (S,)."""
        key = id(loaded), attachment.direction
        found = self.known.get(key)
        if found is None:
            found = self.known[key] = (loaded, self._full(model, along, attachment))
        return found[1]


@dataclass(frozen=True, eq=False)
class Place(Sensor):
    """One place of an envelope: its number among those that are evaluated together."""

    number: int
    together: Places

    def _full(self, model: SceneModel, along: Along, attachment: Attachment) -> Array:
        loaded = place(attachment, along)
        if isinstance(loaded, str) or loaded.size == 1:
            return super()._full(model, along, attachment)
        return np.asarray(self.together.lines(model, along, attachment, loaded)[self.number])


@dataclass(eq=False)
class EnvelopeTables(SceneTables):
    """The tables of a scene whose march watches some places in place of the study's sensors."""

    places: tuple[Place, ...] = ()

    @cached_property
    def sensors(self) -> tuple[Sensor, ...]:
        """The places."""
        return self.places

    @cached_property
    def static_scales(self) -> Array:
        """(places,) zeros: which variants diverge, the march of the sensors tells."""
        return np.zeros(len(self.places))

    def _build(self, segments: Sequence[Segment], missed: Missed) -> list[SegmentTable]:
        found = super()._build(segments, missed)
        for one in self.places:
            one.together.known.clear()
        return found


def envelope_tables(tables: SceneTables, most: int) -> tuple[EnvelopeTables, ...]:
    """The tables of the marches that watch the envelopes of a scene, at so many places of each: one, or several for
    groups of places where the histories are long."""
    model, count = tables.model, sum(min(most, e.places) for e in tables.model.study.envelope.values())
    if not count:
        return ()
    longest = max(segment.steps for segment in tables.timeline.segments)
    readings = MOST_READINGS if tables.model.scheme.stride == 1 else MOST_PAIR_READINGS
    size = -(-count // -(-count // max(LEAST_PLACES, readings // longest)))
    return tuple(_watching(tables, _places(model, slice(first, first + size), most)) for first in range(0, count, size))


def _watching(tables: SceneTables, places: tuple[Place, ...]) -> EnvelopeTables:
    """The tables of the same march that watch some places."""
    found = EnvelopeTables(tables.model, tables.steps, tables.window, refinement=tables.refinement, places=places)
    found.timeline = tables.timeline
    return found


def _spread(places: Array, most: int) -> Array:
    """At most so many of some places, both ends among them."""
    return places[np.unique(np.rint(np.linspace(0, places.size - 1, min(places.size, most))).astype(np.int64))]


def envelope_places(model: SceneModel) -> dict[str, Array]:
    """The places (m along the track) of every envelope by its name."""
    lengths = {part.name: part.modal.length for part in model.bodies}
    return {name: envelope.along(lengths[envelope.body]) for name, envelope in model.study.envelope.items()}


def envelope_names(study: Study) -> list[str]:
    """Names of the results of all envelopes."""
    return [f"{name}_envelope_{end}" for name in study.envelope for end in ("max", "min")]


def places_read(study: Study) -> int:
    """Number of places of all envelopes."""
    return sum(envelope.places for envelope in study.envelope.values())


def check_places(study: Study, scenes: Iterable[SceneModel]) -> None:
    """Refuse a sweep that moves the places of an envelope, which are a coordinate. Raises BadInput."""
    known: dict[str, Array] = {}
    for scene in scenes:
        for name, places in envelope_places(scene).items():
            first = known.setdefault(name, places)
            if np.abs(places - first).max() > SAME_PLACE * first[-1]:
                raise study.source.fault(
                    f"envelope.{name}",
                    "the places of an envelope must be the same in all variants",
                    expected="from and to, where a sweep changes the length of the body",
                    received=f"a last place of {first[-1]:.6g} m and of {places[-1]:.6g} m",
                )


def _places(model: SceneModel, part: slice, most: int) -> tuple[Place, ...]:
    """Some of the places of all envelopes in a row, ``most`` of each, each with the name of its envelope."""
    bodies = [body.name for body in model.bodies]
    spread = {name: _spread(places, most) for name, places in envelope_places(model).items()}
    numbered = [(name, at) for name, places in spread.items() for at in places.tolist()][part]
    found: list[Place] = []
    for name in dict.fromkeys(name for name, _ in numbered):
        envelope = model.study.envelope[name]
        own = np.array([at for of, at in numbered if of == name])
        reads = (name, envelope.quantity, bodies.index(envelope.body))
        together = Places(*reads, 0.0, None, own)
        limit = envelope.frequency_limit
        found += [Place(*reads, at, None, number, together, limit=limit) for number, at in enumerate(own.tolist())]
    return tuple(found)
