"""From a study to work: all variants, grouped by scene and by what they are computed with, and what that will take.

Everything follows from the study alone: neither chunks nor threads nor interruptions change a result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from math import prod

import numpy as np

from engine.accuracy.choice import Choice, Kept, Pilots, choose, find, tolerance_span
from engine.accuracy.grids import KEPT_CYCLE, SceneGrid, unit_steps
from engine.accuracy.groups import ConvergingGroup, Group, on_rungs
from engine.accuracy.jobs import NOBODY, Share, Told, untold
from engine.accuracy.ladder import share_ladder
from engine.accuracy.pilots import PILOTS, pilots_of
from engine.accuracy.reference import USUAL_LEVEL, in_full, level_work
from engine.accuracy.results import results_of
from engine.kernels.layout import LANES
from engine.march.envelopes import check_places, places_read
from engine.march.outcome import Asked
from engine.march.rest import settling
from engine.march.step_rules import check_even_steps, check_free_vibration, check_most_steps, check_slowest, check_steps
from engine.march.tables import SceneTables
from engine.model.distinct_models import base_scene, scenes
from engine.model.refusals import check_moves
from engine.model.scene_model import SceneModel
from engine.model.strikes import strikes_of, strikes_of_all
from engine.model.timeline import Window
from engine.observation.cycle_reduction import Reduction
from engine.observation.histories import CYCLE_STATIONS, REST_STATIONS, WHOLE_STATIONS, counts_shown
from engine.scene.study import Study
from engine.scene.sweep import Cases, expand
from engine.scene.variants import VariantValues, cases_tolerance, sweeps_numerics
from results_schema.arrays import Array, Counts, split
from results_schema.blocks import IN_MEMORY
from results_schema.cores import cores
from results_schema.errors import WorkersGaveUp
from results_schema.status import Fidelity
from results_schema.store.rows import Chunk
from results_schema.variables import Variable, declarations
from results_schema.variables import expand as declared_of

CheckSteps = Callable[[SceneModel, VariantValues, Counts], None]

TASK_SECONDS = 0.4  # of one chunk at most: a stop waits no longer than that
LEAST_TASK_SECONDS = 0.05  # of one chunk: less is not worth its overhead
TASKS = 16  # into which small studies are cut, so that all threads have work
MOST_LANES = 65536  # of one chunk
MOST_MEMORY = 16 * 2**30
CHUNK_BYTES = 24 * 2**20  # of one chunk's histories, of which a reduction makes a few copies
EVERY_MARCH = "march"  # the kind of results that every march has
NUMBERS_REDUCED = 4  # of 8 bytes, of a variant where extremes alone are kept: its number, its status, what it took
PROGRAM_BYTES, PROCESS_BYTES = 400 * 2**20, 200 * 2**20  # the program with its kernels, and a process beside it
PLANNED_BYTES = 150  # of a variant, at most, while it is planned: measured with three swept numbers and 1e7 variants
LARGEST = 2  # times the tables of most references
READ_BYTES = 40  # of a variant, at most, while an answer is made of some arrays over all variants
SHOWN = 64  # variants whose histories are kept by default
NAMED = 16  # most of those beside, which the answer names
#: Variants, of a study and in the mean of its scenes, up to which each converges by itself: a ladder for pilots costs
#: about as much as the convergence of two hundred variants of one scene. With more scenes pilots are worth it however
#: few variants each has: a scene's ladder takes two to four times as long as its variants' convergence, a march by what
#: pilots tell a tenth of that.
FEW, FEW_IN_SCENE, FEW_SCENES = 256, 16, 128
#: Scenes, of variants that converge and of pilots, that threads do as soon as processes, which take 1 to 5 s to start:
#: most of their work is Python, in which threads wait for each other. On two cores threads and processes took 2.8 and
#: 2.9 s for 20 scenes that converge, 9.2 and 6.7 for 100; with pilots 2.9 and 2.7 s for two, 6.9 and 4.4 for eight.
FEW_CONVERGING, FEW_CLIMBING = 24, 3
#: Variants of which processes get the choice, each for itself: of 1e6 in 8 scenes threads take 10.9 s and two processes
#: 8.5; of 4e6 in 4 scenes 31 s and 890 MiB, and 34 s and 2.3 GiB.
MOST_SENT = 2**20


def _whole(plan: Plan, chunk: Chunk) -> Chunk:
    """All of a chunk."""
    return chunk


@dataclass(eq=False)
class Plan:
    """All work of a study. base: the scene without sweep. declared: what is kept, by name, which processes that compute
    do not know of themselves. grids, members: its scenes, and the variants of each. choice: of what a large sweep is
    computed with, once it is made. reduce: what is kept of a chunk, where it is marched."""

    study: Study
    cases: Cases
    asked: Asked
    grids: tuple[SceneGrid, ...]
    members: tuple[Counts, ...]
    shown: Counts
    base: SceneModel
    declared: Mapping[str, Variable]
    choice: Choice | None = None
    reduce: Callable[[Plan, Chunk], Chunk] = _whole
    _groups: tuple[Group, ...] = field(default=())
    _forgotten: int = 0

    @property
    def size(self) -> int:
        """Number of variants."""
        return self.cases.size

    def _repr_html_(self) -> str:
        """How notebooks show it: how much work it is."""
        shape = " x ".join(f"{name} {length:,}" for name, length in zip(self.cases.dims, self.cases.shape, strict=True))
        title = escape(self.study.title or self.study.kind)
        return (
            f"<b>{title}</b><br>{self.size:,} variants ({escape(shape or 'one')}) of "
            f"{len(self.grids):,} scenes, at most {self.memory_bytes / 2**20:.0f} MiB of memory and "
            f"{self.disk_bytes / 2**20:.1f} MiB on the disk"
        )

    @property
    def converges(self) -> bool:
        """Whether every variant is marched until its results stay: where there are few."""
        few = len(self.grids) <= FEW_SCENES or sweeps_numerics(self.cases)  # by which neighbours would differ
        return few and self.size <= max(FEW, FEW_IN_SCENE * len(self.grids))

    @property
    def many_scenes(self) -> bool:
        """Whether there are so many scenes that processes of this machine do them sooner than threads."""
        return len(self.grids) > (FEW_CONVERGING if self.converges else FEW_CLIMBING) and self.size <= MOST_SENT

    @property
    def groups(self) -> tuple[Group, ...]:
        """Variants that are computed alike; those of a large sweep are known when it is chosen for."""
        if not self._groups:
            converging = map(ConvergingGroup, self.grids, self.members)
            self._groups = tuple(converging if self.converges else self._marching())
        return self._groups

    @property
    def cases_tolerance(self) -> Array:
        """(V,) `solver.tolerance` of every variant over the study's."""
        return cases_tolerance(self.study, self.cases)

    def choose(
        self,
        share: Share,
        pilots: int = PILOTS,
        without: Counts = NOBODY,
        kept: Kept | None = None,
        told: Told = untold,
    ) -> None:
        """Measure pilots, at most so many and ``without`` some variants, and choose, where the study has many variants.
        ``kept``: where what pilots found is kept, if anywhere; told: of how many of their scenes are done. Raises
        Halted, Crashed by flat numbers of pilots, and WorkersGaveUp where all of them crashed."""
        if not self.converges and self.choice is None:
            of = Pilots(self.asked, self.cases, dict(enumerate(self.grids)), tolerance_span(self.asked, self.cases))
            drawn = np.setdiff1d(pilots_of(self.cases, self.members, pilots), without)
            if not drawn.size:
                what = "every variant that was tried ends the process that computes it"
                raise WorkersGaveUp(what, remedy="try the study without workers")
            found = kept.read(drawn) if kept else None
            if found is None:
                found = find(of, self.members, drawn, share, told)
                if kept:
                    kept.write(found)
            self.choice = choose(of, found, share)
            self._groups = ()  # those of before the choice told sizes only
            self.__dict__.pop("seconds", None)

    def _marching(self) -> Iterator[Group]:
        """Variants of one scene by their rung."""
        for grid, members in zip(self.grids, self.members, strict=True):
            rungs = np.zeros(members.size, dtype=np.int32) if self.choice is None else self.choice.rung[members]
            yield from (group for group, _ in on_rungs(grid, rungs, members, grid.values))

    @cached_property
    def seconds(self) -> float:
        """Expected time of the march on one thread."""
        return float(sum(group.seconds_per_variant * group.variants.size for group in self.groups))

    @property
    def stations_shown(self) -> int:
        """About the most stations that a kept history has."""
        if self.study.output.histories == "auto":
            return WHOLE_STATIONS + REST_STATIONS * self.study.output.residual
        units = max(rider.end for rider in self.base.riders)
        return int(np.ceil(units * max((group.usual_steps for group in self.groups), default=0)))

    @cached_property
    def phases_shown(self) -> Array | None:
        """The phases of the kept histories over a cycle, if all variants have the same."""
        if self.asked.window != "last-cycle" or self.base.riders[0].motion.period is None:
            return None
        if self.study.output.histories == "auto" and not self.grids[0].fixed:
            return np.arange(CYCLE_STATIONS) / CYCLE_STATIONS
        if len({grid.unit for grid in self.grids}) > 1 or not self.grids[0].fixed:
            return None
        timeline = self.grids[0].tables(self.grids[0].scene, 1).timeline
        first, last = timeline.window
        return (counts_shown(timeline, self.asked.window, self.study.output.histories) - first) / (last - first)

    @property
    def numbers_bytes(self) -> int:
        """Upper bound of what is kept of all variants, besides histories."""
        numbers = numbers_per_variant(self.asked) if self.study.output.keep != "extremes" else NUMBERS_REDUCED
        return 8 * self.size * numbers

    @property
    def disk_bytes(self) -> int:
        """Upper bound of the archive's size; the parts take as much until it is written."""
        kept = int(self.shown.size)
        if self.study.output.histories == "auto" and self.study.output.keeps_variants:
            kept = min(kept + NAMED, self.size)
        shown = kept * self.stations_shown * (len(self.study.sensor) + 2)
        return self.numbers_bytes + 8 * shown + 65536

    @property
    def memory_bytes(self) -> int:
        """Expected peak of a run to an archive."""
        processes = self.many_scenes * cores() * PROCESS_BYTES
        return needed_memory(self.study, self.size, self.gathered_bytes) + self._tables_bytes + processes

    @property
    def _tables_bytes(self) -> int:
        """About what a march of cycles keeps of its tables: one of the largest references."""
        grid = self.grids[0]
        if not grid.grid.timeline(1, 1).repeats:
            return 0
        levels, numbers = in_full(grid), 4 * grid.scene.ties + len(self.study.sensor)
        usual = level_work(grid, grid.values, levels, min(USUAL_LEVEL, len(levels.numerics) - 1)).max()
        return int(min(KEPT_CYCLE, LARGEST * 8 * numbers * usual))

    @property
    def gathered_bytes(self) -> int:
        """Upper bound of what a run to an archive puts together in memory: histories, and results that are small."""
        return self.disk_bytes - max(0, self.numbers_bytes - IN_MEMORY)

    def chunks(self, done: Counts | None, chunk: int | None) -> Iterator[tuple[int, Counts]]:
        """The tasks that are left, each with the number of its group; ``chunk`` fixes the variants of each."""
        for number, group in enumerate(self.groups):
            left = group.variants if done is None else group.variants[~np.isin(group.variants, done)]
            size = chunk or _even(left.size, self.lanes_per_chunk(group))
            for first in range(0, left.size, size):
                yield number, left[first : first + size]

    def forget_before(self, number: int) -> None:
        """Drop the tables of groups before one, which no chunk needs any more: chunks come in their order."""
        for group in self.groups[self._forgotten : max(number, 0)]:
            group.forget()
        self._forgotten = max(self._forgotten, number)

    def lanes_per_chunk(self, group: Group) -> int:
        """Variants of one task, by time and memory."""
        least = TASK_SECONDS if self.converges else LEAST_TASK_SECONDS  # each chunk has tables of its own there
        task = float(np.clip(self.seconds / TASKS, least, TASK_SECONDS))
        lanes = min(task / max(group.seconds_per_variant, 1e-12), CHUNK_BYTES / group.chunk_bytes)
        if self.converges:  # two threads share a scene
            lanes = min(lanes, group.variants.size // 2 + LANES)
        return int(np.clip(lanes // LANES * LANES, LANES, MOST_LANES))

    def values(self, group: Group, variants: Counts) -> VariantValues:
        """Numbers of some variants of a group."""
        return VariantValues.of(group.scene.study, self.cases, variants)


def _even(size: int, most: int) -> int:
    """The size of equal chunks of at most ``most``, in whole blocks."""
    parts = max(1, -(-size // most))
    return LANES * max(1, -(-size // (parts * LANES)))


def make_plan(
    study: Study,
    *,
    reduction: Reduction | None = None,
    results: str = EVERY_MARCH,
    check_steps: CheckSteps = check_steps,
) -> Plan:
    """Plan a study. Raises BadInput for whatever cannot be run, before anything is computed.

    results: the kind whose declared results are kept, which must be declared by then; those of every march unless a
    study names its own. check_steps: refuses fixed steps that cannot be right.
    """
    check_moves(study)
    cases = expand(study)
    window: Window = "whole" if reduction is None else "last-cycle"
    accelerated = "{carriage}_acceleration_across" in {variable.name for variable in declarations(results)}
    base = base_scene(study)
    asked = Asked(study, reduction, window, accelerated, strikes_of(base))
    check_memory(study, cases.size, min(IN_MEMORY, 8 * cases.size * numbers_per_variant(asked)))
    # how loads strike is known when all scenes are built, which memory is looked at before
    every = list(scenes(study, cases, np.arange(cases.size, dtype=np.int64)))
    asked = replace(asked, strikes=strikes_of_all(scene for scene, _ in every))
    grids, members = [], []
    for scene, variants in every:
        for grid, own in _grids(asked, cases, scene, variants, check_steps):
            grids.append(grid)
            members.append(own)
    check_places(study, (grid.scene for grid in grids))
    declared = declared_of(results, study.sensor_units, list(study.carriage), study.envelope_units)
    plan = Plan(study, cases, asked, tuple(grids), tuple(members), shown(study, cases.size), base, declared)
    if len(grids) > 1 and not plan.converges:
        share_ladder(asked, grids)
    check_memory(study, plan.size, plan.gathered_bytes)
    return plan


def _grids(
    asked: Asked, cases: Cases, scene: SceneModel, variants: Counts, check_steps: CheckSteps
) -> Iterator[tuple[SceneGrid, Counts]]:
    """The variants of a scene, by their steps where the study fixes these. Raises BadInput."""
    values = VariantValues.of(scene.study, cases, variants)
    check_readings(scene, asked.window)
    if scene.fidelity is Fidelity.STATIC or not values.has_fixed_steps:
        if scene.fidelity is not Fidelity.STATIC:
            check_slowest(scene, values)
            check_free_vibration(scene, values)
        yield SceneGrid(asked, scene, values, unit_steps(scene)), variants
        return
    steps = values.steps
    check_even_steps(scene, steps)
    check_most_steps(scene, steps)
    check_steps(scene, values, steps)
    for lanes in split(np.arange(variants.size), steps):
        unit = int(steps[lanes[0]]) // scene.scheme.stride
        yield SceneGrid(asked, scene, values.part(lanes), unit), variants[lanes]


def check_readings(scene: SceneModel, window: Window) -> None:
    """Refuse a sensor under a carriage that is never on its body while anything is recorded, and rates of what is at
    rest. Raises BadInput."""
    tables = SceneTables(scene, 1, window)
    if scene.study.output.residual and (window != "whole" or not tables.at_rest.size):
        what = "a residual vibration is read over a whole run with rest at its end"
        moves = "a motion with a dwell (such as point-to-point), or after (cruise), last"
        expected = f'kind = "passage" or "trajectory", and {moves}'
        remedy = "" if window != "whole" else _rest(scene)
        raise scene.study.source.fault("output.residual", what, expected=expected, received="true", remedy=remedy)
    for sensor in tables.sensors:
        if scene.fidelity is Fidelity.STATIC and sensor.offset_order:
            what = f'fidelity = "static" has no {sensor.quantity}'
            expected = "a quantity that statics tell, such as displacement"
            raise scene.study.source.fault(f"sensor.{sensor.name}.quantity", what, expected=expected)
        seen = [s for s in tables.timeline.segments if s.recorded and (sensor.under is None or s.active[sensor.under])]
        if not seen:
            what = "the carriage is off its body for all of the recorded part, so the sensor reads nothing"
            raise scene.study.source.fault(f"sensor.{sensor.name}.under", what, expected="a carriage on its body")


def _rest(scene: SceneModel) -> str:
    """What gives the carriage a rest that comes to its end last, in words."""
    tie = max(scene.carriages, key=lambda found: found.rider.end)
    motion = f"{scene.study.source.written(f'carriage.{tie.name}')}.motion"
    key = next((key for key in ("dwell", "after") if key in type(tie.rider.motion).model_fields), "")
    if not key:
        return f"a point-to-point with a dwell as {motion}"
    return f"{motion}.{key} > 0, a rest after {tie.name}'s stop"


def numbers_per_variant(asked: Asked) -> int:
    """Numbers of 8 bytes that are kept of one variant, besides histories."""
    study, reduction = asked.study, asked.reduction
    found = (6 + study.output.residual + 2 * study.output.times) * len(study.sensor) + 2 * len(settling(study))
    found += 4 * len(study.carriage) + 10 + 2 * places_read(study)
    found += -(-len(results_of(asked)) // 2)  # errors are of half that size
    if reduction is not None:
        sizes = reduction.sizes(study)
        found += sum(prod(sizes[dim] for dim in dims) for dims in reduction.outputs(study).values())
    return found


def needed_memory(study: Study, size: int, gathered: int) -> int:
    """Expected peak in bytes: the plan, results that are gathered in memory and those that an answer reads, a chunk per
    thread, and the program itself."""
    results = 3 * gathered + READ_BYTES * size if study.output.keeps_variants else 0
    return PROGRAM_BYTES + PLANNED_BYTES * size + results + 6 * CHUNK_BYTES


def check_memory(study: Study, size: int, gathered: int) -> None:
    """Refuse a study that does not fit (fault 14), from whole numbers and before anything is allocated. gathered: bytes
    of results that are put together in memory."""
    needed = needed_memory(study, size, gathered)
    if needed > MOST_MEMORY:
        raise study.source.fault(
            "sweep",
            "the study does not fit into memory",
            expected=f"at most {MOST_MEMORY / 2**30:.0f} GiB",
            received=f"{needed / 2**30:.1f} GiB for {size} variants",
            remedy='fewer variants or sensors, fewer histories, or output.keep = "extremes"',
        )


def shown(study: Study, size: int) -> Counts:
    """Variants whose histories are kept: all, none, or some spread over the sweep."""
    wanted = study.output.histories
    if wanted == "none" or not study.output.keeps_variants:
        return np.zeros(0, dtype=np.int64)
    if wanted != "auto" or size <= SHOWN:
        return np.arange(size, dtype=np.int64)
    return np.unique(np.rint(np.linspace(0, size - 1, SHOWN)).astype(np.int64))
