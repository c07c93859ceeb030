"""From a study to work: all variants, grouped by scene and step count, with sizes and times known before anything runs.

Scene, step count and bucket of a variant are functions of that variant alone, so no result depends on its neighbours.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.bucket import Bucket
from engine.bucketing import CheckSteps, buckets_of
from engine.choice import Asked
from engine.envelopes import check_places, places_read
from engine.histories import counts_shown
from engine.kernels.layout import LANES, MARKS
from engine.lanes import LaneValues
from engine.model import SceneModel, check_moves
from engine.reduction import Reduction
from engine.resonance import check_steps
from engine.scene import Study
from engine.scenes import base_scene, scenes
from engine.sweep import Cases, expand
from engine.tables import KEPT_BYTES
from engine.timeline import Window, coarsened
from results_schema.errors import BadInput
from results_schema.status import Fidelity
from results_schema.variables import declarations

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

START_SECONDS, BUCKET_SECONDS = 2.5, 0.02  # besides marching, for expected times only
STATION_SECONDS, STATION_MODE_SECONDS = 3e-6, 2e-7  # of a station's tables, and of each mode in them; likewise
CHECKED = 2.0  # times the tables of a march with those that it is compared with; likewise
TASK_SECONDS = 0.4  # of one chunk at most: a stop waits no longer than that
LEAST_TASK_SECONDS = 0.05  # of one chunk: less is not worth its overhead
TASKS = 16  # into which small studies are cut, so that all threads have work
MOST_LANES = 65536  # of one chunk
MOST_HISTORY_BYTES = 24 * 2**20  # of one chunk's histories, of which a reduction makes a few copies
READING_SECONDS = 6e-7  # of an envelope's place at a station, in tables
MOST_MARK_BYTES = 32 * 2**20  # of one chunk's extremes along bodies
MOST_PAIR_BYTES = 12 * 2**20  # of one segment's histories of a chunk of Richardson pairs
MOST_MEMORY = 16 * 2**30
REPORTED = 0.5  # of what histories are off by that extremes and the like are expected to be
STATIONS = 256  # of a whole run, about, at which histories are compared
SHOWN = 64  # variants whose histories are kept by default


@dataclass(frozen=True, eq=False)
class Plan:
    """All work of a study. ``base`` is the scene without sweep."""

    study: Study
    cases: Cases
    buckets: tuple[Bucket, ...]
    reduction: Reduction | None
    shown: Counts
    base: SceneModel

    @property
    def size(self) -> int:
        """Number of variants."""
        return self.cases.size

    @property
    def window(self) -> Window:
        """What extremes and histories cover."""
        return "whole" if self.reduction is None else "last-cycle"

    @cached_property
    def key(self) -> str:
        """What finished parts belong to: the study's text, the files of its bodies, the kernels, and all that chooses
        what they are given."""
        from engine.kernels.jit import kernel_hash

        files = [body.content for body in self.study.body.values() if body.content]
        return "-".join([self.study.source.sha256, *files, kernel_hash(), _sources_hash()])

    @cached_property
    def seconds(self) -> float:
        """Expected time of the march on one thread."""
        return float(sum(bucket.seconds_per_variant * bucket.variants.size for bucket in self.buckets))

    def total_seconds(self, threads: int) -> float:
        """Expected wall time of a run: the march in whole blocks, tables and chunks, and starting up."""
        found = START_SECONDS
        for bucket in self.buckets:
            lanes = LANES * -(-bucket.variants.size // LANES)
            timeline = bucket.tables.timeline
            again = timeline.repeats and bucket.tables.cycle_bytes <= KEPT_BYTES
            tabulated = min(timeline.steps, bucket.steps) if again else timeline.steps
            found += bucket.seconds_per_variant * lanes / threads
            station = STATION_SECONDS + STATION_MODE_SECONDS * bucket.scene.body_modes
            found += BUCKET_SECONDS + CHECKED * station * tabulated * bucket.scene.ties
            found += READING_SECONDS * tabulated * places_read(self.study)
        return found

    def counts_shown(self, bucket: Bucket) -> Counts:
        """Stations of the kept histories of a bucket, by their count; steps that were added give none."""
        timeline = coarsened(bucket.tables.timeline, bucket.added)
        return bucket.added * counts_shown(timeline, self.window, self.study.output.histories)

    @cached_property
    def stations_shown(self) -> int:
        """The most stations that any kept history has."""
        return max((self.counts_shown(bucket).size for bucket in self._shown_buckets()), default=0)

    @cached_property
    def phases_shown(self) -> NDArray[np.float64] | None:
        """The phases of the kept histories over a cycle, if all variants have the same."""
        if self.window != "last-cycle" or self.base.riders[0].motion.period is None:
            return None
        found = []
        for bucket in self._shown_buckets():
            first, last = bucket.tables.timeline.window
            found.append((self.counts_shown(bucket) - first) / (last - first))
        same = bool(found) and all(np.array_equal(found[0], phases) for phases in found)
        return found[0] if same else None

    def _shown_buckets(self) -> list[Bucket]:
        return [bucket for bucket in self.buckets if np.isin(self.shown, bucket.variants).any()]

    @property
    def disk_bytes(self) -> int:
        """Upper bound of the archive's size; the parts take as much until it is written."""
        shown = int(self.shown.size) * self.stations_shown * (len(self.study.sensor) + 2)
        return 8 * (self.size * numbers_per_variant(self.study, self.reduction) + shown) + 65536

    @property
    def memory_bytes(self) -> int:
        """Expected peak: results, a chunk per thread, and the program itself."""
        return needed_memory(self.disk_bytes)

    def lanes_per_chunk(self, bucket: Bucket) -> int:
        """Variants of one task, by time and memory."""
        task = float(np.clip(self.seconds / TASKS, LEAST_TASK_SECONDS, TASK_SECONDS))
        lanes = task / bucket.seconds_per_variant
        rows = min(2 * (STATIONS if self.reduction is None else self.reduction.stations), bucket.steps)
        lanes = min(lanes, MOST_HISTORY_BYTES / (8 * rows * max(1, len(self.study.sensor))))
        watched = max(len(tables.signals) for tables in (bucket.tables, *bucket.envelopes))
        lanes = min(lanes, MOST_MARK_BYTES / (8 * MARKS * watched))
        if bucket.scene.scheme.stride > 1:  # a pair has all histories of a segment in memory
            stations = 1.5 * max(segment.steps for segment in bucket.tables.timeline.segments)
            lanes = min(lanes, MOST_PAIR_BYTES / (8 * stations * watched))
        return int(np.clip(lanes // LANES * LANES, LANES, MOST_LANES))

    def chunks(self, done: Counts | None, chunk: int | None) -> Iterator[tuple[Bucket, Counts]]:
        """The tasks that are left; ``chunk`` fixes the number of variants of each."""
        for bucket in self.buckets:
            left = bucket.variants if done is None else bucket.variants[~np.isin(bucket.variants, done)]
            size = chunk or _even(left.size, self.lanes_per_chunk(bucket))
            for first in range(0, left.size, size):
                yield bucket, left[first : first + size]

    def values(self, bucket: Bucket, variants: Counts) -> LaneValues:
        """Numbers of some variants of a bucket."""
        return LaneValues(bucket.scene.study, self.cases.columns_of(variants), variants.size)


def _sources_hash() -> str:
    """SHA-256 over the engine's own sources."""
    digest = sha256()
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.name.encode() + b"\0" + source.read_bytes() + b"\0")
    return digest.hexdigest()


def _even(size: int, most: int) -> int:
    """The size of equal chunks of at most ``most``, in whole blocks."""
    parts = max(1, -(-size // most))
    return LANES * max(1, -(-size // (parts * LANES)))


def make_plan(study: Study, *, reduction: Reduction | None = None, check_steps: CheckSteps = check_steps) -> Plan:
    """Plan a study. Raises BadInput for whatever cannot be run, before anything is computed.

    check_steps: refuses fixed steps that cannot be right.
    """
    check_moves(study)
    cases = expand(study)
    check_memory(study, cases.size, 8 * cases.size * numbers_per_variant(study, reduction))
    window: Window = "whole" if reduction is None else "last-cycle"
    asked = Asked(_least(study, reduction), window, 1.0 if reads_accelerations(study) else REPORTED)
    buckets = tuple(
        bucket
        for scene, variants in scenes(study, cases, np.arange(cases.size, dtype=np.int64))
        for bucket in buckets_of(scene, cases, variants, asked, check_steps)
    )
    check_places(study, (bucket.scene for bucket in buckets))
    plan = Plan(study, cases, buckets, reduction, _shown(study, cases.size), base_scene(study))
    check_memory(study, plan.size, plan.disk_bytes)
    return plan


def _least(study: Study, reduction: Reduction | None) -> Fidelity:
    """Statics have no accelerations, and no result that only motion makes."""
    if reads_accelerations(study):
        return Fidelity.FORCE
    return Fidelity.STATIC if reduction is None else reduction.least_fidelity


def reads_accelerations(study: Study) -> bool:
    """Whether the kind of study keeps the accelerations of the carriages."""
    return "{carriage}_acceleration_across" in {variable.name for variable in declarations(study.kind)}


def numbers_per_variant(study: Study, reduction: Reduction | None) -> int:
    """Numbers of 8 bytes that are kept of one variant, besides histories."""
    found = 6 * len(study.sensor) + 4 * len(study.carriage) + 10 + 2 * places_read(study)
    if reduction is not None:
        sizes = reduction.sizes(study)
        found += sum(prod(sizes[dim] for dim in dims) for dims in reduction.outputs(study).values())
    return found


def needed_memory(result_bytes: int) -> int:
    """Expected peak in bytes: results while they are gathered, a chunk per thread, and the program itself."""
    return 300 * 2**20 + 3 * result_bytes + 6 * MOST_HISTORY_BYTES


def check_memory(study: Study, size: int, result_bytes: int) -> None:
    """Refuse a study whose results do not fit (fault 14), from whole numbers and before anything is allocated."""
    needed = needed_memory(result_bytes)
    if needed > MOST_MEMORY:
        raise BadInput(
            "the study does not fit into memory",
            where=study.source.where("sweep"),
            expected=f"at most {MOST_MEMORY / 2**30:.0f} GiB",
            received=f"{needed / 2**30:.1f} GiB for {size} variants",
            remedy="fewer variants or sensors, or fewer histories",
        )


def _shown(study: Study, size: int) -> Counts:
    """Variants whose histories are kept: all, none, or some spread over the sweep."""
    wanted = study.output.histories
    if wanted == "none":
        return np.zeros(0, dtype=np.int64)
    if wanted != "auto" or size <= SHOWN:
        return np.arange(size, dtype=np.int64)
    return np.unique(np.rint(np.linspace(0, size - 1, SHOWN)).astype(np.int64))
