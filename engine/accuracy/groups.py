"""Variants that are computed alike: marched with what was chosen for them, or level by level until they converge; and
marched again for their histories."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.grids import MOST_COMPARED
from engine.accuracy.jobs import InTurn
from engine.accuracy.ladder import ladder_of
from engine.accuracy.reference import (
    USUAL_LEVEL,
    Marches,
    as_fixed,
    converge,
    in_full,
    is_free,
    left_by_elements,
    level_work,
)
from engine.accuracy.results import Result, differences, results_of, tolerances, worst_held
from engine.accuracy.shown import Histories, Shown, fine_enough
from engine.kernels.layout import STATISTICS
from engine.march.outcome import NOWHERE, USED, number_of, outcome, used, vibration
from engine.march.rest import most_settling
from engine.model.timeline import MOST_STATIONS
from results_schema.arrays import Array, Counts, split
from results_schema.gravest_status import lost
from results_schema.status import Fidelity

if TYPE_CHECKING:
    from engine.accuracy.choice import Choice
    from engine.accuracy.grids import SceneGrid
    from engine.accuracy.jobs import Halted
    from engine.march.outcome import Flat, Outcome
    from engine.march.tables import SceneTables
    from engine.model.numerics import Numerics
    from engine.model.scene_model import SceneModel
    from engine.scene.variants import VariantValues

Kept = Literal["numbers", "histories"]

PACE = 1.2e9  # modes x steps x variants per second and thread of an ordinary server, for the size of chunks only
PLACE = 0.2  # of a march that an envelope's place takes besides; likewise
ANSWER_PART = 0.5  # of the tolerance by which an answer may be told to be off: 2,080 of 2,080 random variants held it
TRUTH_PART = 0.1  # the same of the reference of an answer within what a study fixes, whose error is told too


class Found(NamedTuple):
    """What V variants report, what they were computed with (by the names of the archive), the estimated errors
    (R, V), and the largest of those that are held, less what the study fixes, over their tolerances (V,); shown: the
    histories of those of them, by their places, whose marches had what is kept of them."""

    outcome: Outcome
    used: Flat
    error: Array
    held: Array
    shown: tuple[tuple[Counts, Histories], ...] = ()


@dataclass(eq=False)
class Group:
    """Variants of one scene that are computed alike."""

    grid: SceneGrid
    variants: Counts

    @property
    def scene(self) -> SceneModel:
        """The scene as the study has it."""
        return self.grid.scene

    @abstractmethod
    def found(
        self,
        values: VariantValues,
        variants: Counts,
        choice: Choice | None,
        halted: Halted,
        kept: Kept = "numbers",
        shown: Counts = NOWHERE,
    ) -> Found:
        """The results of some of its variants; kept: with the histories at the grid's stations or not; shown: places of
        those whose histories are kept, which may come with them. Raises Halted."""

    @property
    @abstractmethod
    def work(self) -> float:
        """Modes x steps of a variant, all that it takes."""

    @property
    @abstractmethod
    def tables(self) -> SceneTables:
        """The tables of a march, as coarse as any of its variants takes."""

    @property
    def steps(self) -> int:
        """Steps of that over one passage or cycle."""
        return self.tables.steps

    @property
    @abstractmethod
    def usual_steps(self) -> int:
        """Steps over one passage or cycle that most of its variants take."""

    @property
    def chunk_bytes(self) -> float:
        """Bytes of a variant's histories and statistics while it is marched."""
        steps, study = self.usual_steps, self.scene.study
        places = max((envelope.places for envelope in study.envelope.values()), default=0)
        signals = len(study.sensor) + len(self.scene.carriages)
        found = 8.0 * self.rows * max(1, len(study.sensor)) + 8.0 * STATISTICS * max(signals, places)
        pair = 24.0 * min(steps, MOST_STATIONS) * max(signals, places)  # which has all histories of a segment
        return found + (pair if self.scene.scheme.stride > 1 else 0.0)

    @property
    def rows(self) -> int:
        """Stations of a variant's histories that are kept while it is marched."""
        if self.grid.asked.reduction is not None:
            return min(2 * self.grid.asked.reduction.stations, self.usual_steps)
        return min(self.grid.unit, MOST_COMPARED)

    @cached_property
    def seconds_per_variant(self) -> float:
        """Expected time on one thread."""
        signals, study = 1.0 + 0.1 * (len(self.scene.study.sensor) + len(self.scene.carriages)), self.scene.study
        places = PLACE * sum(envelope.places for envelope in study.envelope.values())
        units = max(rider.end for rider in self.scene.riders)
        return float(self.work * units * (signals + places) * max(1.0, self.scene.ties**1.2) / PACE)

    def forget(self) -> None:
        """Drop the tables, when no chunk needs them any more."""

    def __getstate__(self) -> dict[str, Any]:
        """What another process makes the same of: without what was built meanwhile."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


@dataclass(eq=False)
class MarchGroup(Group):
    """Variants that share what was chosen for them: numerics, and the steps in one of the grid's."""

    numerics: Numerics
    by: int

    @cached_property
    def model(self) -> SceneModel:
        """The scene with these numerics."""
        return self.grid.model(self.numerics)

    @cached_property
    def tables(self) -> SceneTables:
        return self.grid.tables(self.model, self.by)

    @property
    def steps(self) -> int:
        return self.grid.unit * self.by * self.model.scheme.stride  # of no tables, which many scenes would have at once

    @property
    def usual_steps(self) -> int:
        return self.steps

    @property
    def rows(self) -> int:
        keeps = self.grid.asked.reduction is not None or self.grid.listens
        return super().rows if keeps else min(self.steps + 1, most_settling(self.scene.study))

    @property
    def work(self) -> float:
        return float(self.model.body_modes * self.steps)

    def found(
        self,
        values: VariantValues,
        variants: Counts,
        choice: Choice | None,
        halted: Halted,
        kept: Kept = "numbers",
        shown: Counts = NOWHERE,
    ) -> Found:
        if choice is None:
            now, unknown = self._marched(values, halted, kept), np.full((len(self._results), variants.size), np.nan)
            return Found(now, used(self.tables, variants.size), unknown, unknown[0])
        if self.grid.listens and self.numerics.fidelity != "static":
            found = self._heard(values, variants, choice, halted, kept)
        else:
            now, rung = self._marched(values, halted, kept), choice.rung[variants]
            around = choice.around(variants)
            held = around.held(rung, values.tighter)
            found = Found(now, used(self.tables, variants.size), around.errors(rung), held)
        if not np.isfinite(tolerances(self._results)).any():  # what is only told decides, and misses nothing
            return found._replace(held=np.full(variants.size, -np.inf))
        return found

    @property
    def _results(self) -> tuple[Result, ...]:
        return results_of(self.grid.asked)

    def _marched(self, values: VariantValues, halted: Halted, kept: Kept) -> Outcome:
        """Some of its variants, marched as was chosen."""
        stations = self.grid.stations(self.model, self.by)
        return outcome(self.grid.asked, self.tables, values, stations if kept == "histories" else stations[:0], halted)

    def _heard(self, values: VariantValues, variants: Counts, choice: Choice, halted: Halted, kept: Kept) -> Found:
        """The same of cycles: those that vibrate more than was foreseen by so much that they do not hold are marched
        again on the rung that does."""
        now, rung = self._marched(values, halted, "histories"), choice.rung[variants].copy()
        taken = used(self.tables, variants.size)
        heard = vibration(self.tables, values, self.grid.stations(self.model, self.by), now)
        around = choice.around(variants, heard)
        missed = np.flatnonzero(around.held(rung, values.tighter) > 1.0)
        if missed.size:
            rung[missed] = choice.around(variants[missed], heard[missed]).rungs(values.tighter[missed])
            for group, lanes in on_rungs(self.grid, rung[missed], variants[missed], values.part(missed)):
                own = missed[lanes]
                now = now.replaced(own, group._marched(values.part(own), halted, "histories"))
                for name, column in used(group.tables, own.size).items():
                    taken[name][own] = column
                group.forget()
        held, told = around.held(rung, values.tighter), around.errors(rung)
        if not choice.measured.free:  # what the study fixes, as few modes, need not rise with vibration
            told = np.maximum(told, choice.around(variants).errors(rung))
        return Found(now, taken, told, held)

    def forget(self) -> None:
        if "tables" in self.__dict__:
            self.tables.forget()


def on_rungs(
    grid: SceneGrid, rungs: NDArray[np.int32], variants: Counts, values: VariantValues
) -> Iterator[tuple[MarchGroup, Counts]]:
    """Variants of a scene by their rungs (V,), those that must take more steps apart, of like pace side by side, as
    they rise and fall together; with each group its variants' places among these."""
    ladder, pace = ladder_of(grid.asked, grid), values.scene_time_scale
    for own in split(np.arange(variants.size), rungs):
        column, cut = divmod(int(rungs[own[0]]), len(ladder.cuts))
        by = grid.safe_cuts(ladder.columns[column], values.part(own), ladder.cuts[cut])
        for part in split(np.arange(own.size), by):
            lanes = own[part[np.argsort(pace[own[part]], kind="stable")]]
            yield MarchGroup(grid, variants[lanes], ladder.columns[column], int(by[part[0]])), lanes


@dataclass(eq=False)
class ConvergingGroup(Group):
    """Variants of one scene, each with as many modes and steps as it needs."""

    @property
    def work(self) -> float:
        levels, values = as_fixed(self.grid), self.grid.values
        own = float(np.mean(level_work(self.grid, values, levels, min(USUAL_LEVEL, len(levels.numerics) - 1))))
        of_levels = 2.3 if self.grid.is_meshed else 1.3  # the last one again, with twice the elements
        if is_free(self.grid):
            return of_levels * own
        return own + of_levels * float(np.mean(level_work(self.grid, values, in_full(self.grid), USUAL_LEVEL)))

    @property
    def usual_steps(self) -> int:
        levels = as_fixed(self.grid)
        level = min(USUAL_LEVEL, len(levels.numerics) - 1)
        modes = self.grid.model(levels.numerics[level]).body_modes
        return int(level_work(self.grid, self.grid.values, levels, level).max() / modes)

    @property
    def tables(self) -> SceneTables:
        """The tables of a march as the study fixes it."""
        return self.grid.tables(self.grid.model(as_fixed(self.grid).numerics[0]), 1)

    def found(
        self,
        values: VariantValues,
        variants: Counts,
        choice: Choice | None,
        halted: Halted,
        kept: Kept = "numbers",
        shown: Counts = NOWHERE,
    ) -> Found:
        asked, results = self.grid.asked, results_of(self.grid.asked)
        levels, histories = as_fixed(self.grid), Shown(shown)
        share, tighter = InTurn(halted), values.tighter
        marches = Marches(self.grid, values, levels, histories)
        own = converge(marches, ANSWER_PART, share=share)
        known = tuple(histories.rows())
        if is_free(self.grid):
            told = own.error + left_by_elements(marches, own, share)
            return Found(own.outcome, own.used, told, worst_held(own.error, results, tighter), known)
        apart = np.full(own.error.shape, np.nan)
        if (whole := np.flatnonzero(~lost(own.outcome.status))).size:  # nothing is told of the others
            full = Marches(self.grid, values.part(whole), in_full(self.grid))
            truth = converge(full, TRUTH_PART, share=share)
            beside = differences(asked, self.scene, full.values, own.outcome.of(whole), truth.outcome)
            apart[:, whole] = beside + truth.error + left_by_elements(full, truth, share)
        left_open = len(levels.numerics) > 1
        held = worst_held(own.error, results, tighter) if left_open else np.zeros(values.size)
        return Found(own.outcome, own.used, apart, held, known)


def marches_again(grid: SceneGrid, used: Flat) -> Iterator[tuple[SceneTables, Counts]]:
    """The marches of some variants by what these were computed with, and which of them (lanes) each is for."""
    taken = np.stack([used[name] for name in USED], axis=1).astype(np.int64)
    rows, own = np.unique(taken, axis=0, return_inverse=True)
    for number, row in enumerate(rows):
        yield _tables(grid, *(int(part) for part in row)), np.flatnonzero(own.reshape(-1) == number)


def _tables(grid: SceneGrid, fidelity: int, scheme: int, modes: int, steps: int) -> SceneTables:
    """The tables of a march; where the study leaves its steps open, finer ones if there are too few for a history."""
    model = _model(grid, fidelity, scheme, modes)
    by = max(1, steps // (grid.unit * model.scheme.stride))
    return grid.tables(model, fine_enough(grid, model, by))


def _model(grid: SceneGrid, fidelity: int, scheme: int, modes: int) -> SceneModel:
    """The scene as a variant was computed with it; statics know all modes, and march none."""
    for numerics in (*as_fixed(grid).numerics, *ladder_of(grid.asked, grid).columns):
        model = grid.model(numerics)
        same = model.fidelity == fidelity and number_of(model.scheme) == scheme
        if same and (model.body_modes == modes or fidelity == Fidelity.STATIC):
            return model
    raise ValueError(f"modes: expected those of a march of this scene, received {modes}")
