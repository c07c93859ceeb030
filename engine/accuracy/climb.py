"""The measured error of every rung of the ladder for some variants of a scene (pilots).

A pilot climbs each column that can hold its tolerance at all until the error is small or no longer falls; from there
on, finer rungs count as no worse.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.grids import SceneGrid
from engine.accuracy.jobs import InTurn, Job, Share
from engine.accuracy.ladder import ENOUGH, FLAT, Ladder, March, Rungs
from engine.accuracy.reference import Converged, Level, Marches, as_fixed, converge, in_full, is_free, left_by_elements
from engine.march.outcome import vibration
from engine.model.numerics import open_bodies
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts

# What is said of the next three was measured on `asymmetry`, `double-peak` and 10,000 passages: the work they took.
#: Of the tolerance that a column leaves where its modes are judged, so that none is climbed: 0.5 to 2 took 0.9 to 1.1
#: times.
HOPELESS = 0.9
MORE = 2.0  # times the fewest modes that leave little: with 1.4 some variants missed the tolerance, 4 gained nothing
JUDGED_BY = 12  # modes, at least, of the column that says whether a simpler model can do at all: 6 to 24 took 0.8 to 1
TWICE = 2  # rungs to the one of twice the steps
REFERENCE_PART = 0.25  # of the tolerance by which references may be off, which what they judge is told to be off too


@dataclass(frozen=True, eq=False)
class Measured:
    """What P pilots found: error (M, R) of every result in each march of a pilot, the first infinite; pilot (M,): whose
    it was; march (columns, cuts, P): the one that tells of a rung, 0 where none does; held (columns, cuts, P): the
    largest of the errors that are held, without what the study itself fixes, over their tolerances; reference (R, P):
    the errors of the references themselves; by_elements (R, P): what the elements of bodies leave besides; marched
    (columns, cuts): rungs that any has marched; work: modes x steps over a passage or cycle of all their marches with
    the elements of the study; spent (P,): the same of each one's reference; vibration (P,): of cycles; free: whether
    the study fixes nothing that the references change."""

    error: Array
    pilot: Counts
    march: NDArray[np.int32]
    held: Array
    reference: Array
    by_elements: Array
    marched: NDArray[np.bool_]
    work: float
    spent: Array
    vibration: Array
    free: bool


@dataclass(eq=False)
class Climb:
    """Pilots of one scene on the ladder. span: the least and the largest `solver.tolerance` that a variant wants, over
    the study's; ``values`` have the least. share: does marches that need not wait for each other."""

    grid: SceneGrid
    values: VariantValues
    ladder: Ladder
    share: Share = field(default_factory=InTurn)
    span: tuple[float, float] = (1.0, 1.0)
    rungs: Rungs = field(init=False)
    found: list[tuple[Counts, Array]] = field(init=False)
    held: Array = field(init=False)
    march: NDArray[np.int32] = field(init=False)
    told_by: NDArray[np.int8] = field(init=False)
    marched: NDArray[np.bool_] = field(init=False)
    work: float = 0.0
    floor: dict[int, Array] = field(default_factory=dict)
    enough: dict[str, Array] = field(default_factory=dict)

    def go(self) -> Measured:
        """Find the references of the pilots, what each model and number of modes can do for them, and with how many
        steps. Raises Halted, and Crashed by the places of pilots."""
        refer = partial(converge, part=REFERENCE_PART, share=self.share)
        levels, full = list[Level](), Marches(self.grid, self.values, in_full(self.grid))
        aim = refer(Marches(self.grid, self.values, as_fixed(self.grid)), seen=levels.append)
        truth = aim if is_free(self.grid) else refer(full)
        self.rungs = Rungs(self.grid, self.values, self.ladder, self.span, truth, aim, self._judged(levels, aim))
        shape = len(self.ladder.columns), len(self.ladder.cuts), self.values.size
        self.found = [(np.zeros(1, dtype=np.int64), np.full((1, len(truth.error)), np.inf))]
        self.march = np.zeros(shape, dtype=np.int32)
        self.held = np.full(shape, np.inf)
        self.told_by = np.full(shape, -1, dtype=np.int8)
        self.marched = np.zeros(shape[:2], dtype=np.bool_)
        for name in dict.fromkeys(numerics.fidelity for numerics in self.ladder.columns):
            self._judge(name)
        for marches in self.share(self.rungs, list(self._climbs())):
            self._take(marches)
        for name, enough in self.enough.items():
            self._fill(name, enough)
        return self._measured(truth, aim is truth, left_by_elements(full, truth, self.share))

    def _judged(self, levels: Sequence[Level], aim: Converged) -> dict[int, Level]:
        """Levels of references that are columns whose modes are judged, by column; of modes that a study fixes the last
        of every pilot."""
        columns = {numerics: column for column, numerics in enumerate(self.ladder.columns)}
        if open_bodies(self.grid.scene.study):
            return {columns[v.numerics]: v for v in levels if v.numerics in columns}
        fixed = levels[0].numerics
        by = np.asarray(aim.used["steps_used"] // (self.grid.unit * fixed.scheme.stride), dtype=np.int64)
        return {columns[fixed]: Level(fixed, np.arange(by.size), by, aim.outcome)} if fixed in columns else {}

    def _measured(self, truth: Converged, free: bool, by_elements: Array) -> Measured:
        """What the jobs found."""
        work = float(self.work + truth.spent.sum())
        pilot, error = (np.concatenate(parts) for parts in zip(*self.found, strict=True))
        errors = error, pilot, self.march, self.held, truth.error, by_elements, self.marched
        return Measured(*errors, work, truth.spent, self._vibration(truth), free)

    def _vibration(self, truth: Converged) -> Array:
        """(P,) how much the pilots vibrate in a cycle; nothing of what is no cycle."""
        if not self.grid.listens:
            return np.zeros(self.values.size)
        tables = self.grid.tables(self.grid.scene, 1)
        return vibration(tables, self.values, self.grid.stations(self.grid.scene, 1), truth.outcome)

    def _judge(self, name: str) -> None:
        """What each number of modes of a model leaves; from the fewest on, until some leave so little that many more
        are of no use."""
        own = [column for column, numerics in enumerate(self.ladder.columns) if numerics.fidelity == name]
        everywhere = np.ones(self.values.size, dtype=np.bool_)
        if name == "static" or len(self.ladder.cuts) == 1:
            for column in own:
                fits = self.rungs.least(column)[0] <= 1.0 if name != "static" else everywhere
                self._march(column, {0: np.flatnonzero(fits)})
            return
        if not open_bodies(self.grid.scene.study):
            [column] = own
            self.floor[column] = self._as_fixed(name, column)
            return
        of_count = {self.ladder.columns[column].modes: column for column in own}
        if name != self.grid.scene.numerics.fidelity:
            modes = next((count for count in of_count if count >= JUDGED_BY), max(of_count))
            everywhere = self._floor(of_count[modes], everywhere) <= HOPELESS * self.span[1]
        enough = np.full(self.values.size, np.inf)
        for count, column in of_count.items():
            self.floor[column] = self._floor(column, everywhere & (count <= MORE * enough))
            holds = self.floor[column] <= ENOUGH * self.span[0]
            enough = np.where(holds & ~np.isfinite(enough), count, enough)
        self.enough[name] = enough
        before = np.zeros(self.values.size, dtype=np.bool_)
        for column, more in pairwise(of_count.values()):
            alike = np.isfinite(self.floor[more]) & (self.floor[column] <= FLAT * self.floor[more])
            self._finer(column, np.flatnonzero(alike & ~before & (self.floor[column] > ENOUGH * self.span[0])))
            before = alike

    def _finer(self, column: int, lanes: Counts) -> None:
        """Judge a column by more steps, of pilots whose error more modes do not change, as long as it falls."""
        cuts, floor = np.array(self.ladder.cuts), self.floor[column]
        rung, dear = self.rungs.fine(column), self.rungs.truth.used["work"]
        while lanes.size:
            rung[lanes] += TWICE
            lanes = lanes[rung[lanes] < cuts.size]
            work = cuts[rung[lanes]] * self.rungs.unit(column) * self.rungs.model(column).body_modes
            lanes = lanes[work <= dear[lanes]]
            self._march(column, {int(one): lanes[rung[lanes] == one] for one in np.unique(rung[lanes])})
            now = self.held[column, rung[lanes], lanes]
            falls = (FLAT * now < floor[lanes]) & (now > ENOUGH * self.span[0])
            floor[lanes] = np.minimum(floor[lanes], now)
            lanes = lanes[falls]

    def _as_fixed(self, name: str, column: int) -> Array:
        """(P,) what modes that a study fixes leave of what is wanted of them: nothing, or what a simpler model does."""
        if name == self.grid.scene.numerics.fidelity:
            for level in self.rungs.levels:
                self._take(self.rungs.marched(np.flatnonzero(self.rungs.known(level)), level))
            return np.zeros(self.values.size)
        return self._floor(column, np.ones(self.values.size, dtype=np.bool_))

    def _floor(self, column: int, fits: NDArray[np.bool_]) -> Array:
        """(P,) what a column leaves with so many steps that its modes and its model alone do; infinite where these
        would be more work than the reference."""
        found = np.full(self.values.size, np.inf)
        if not fits.any():
            return found
        cuts, fine, rungs = np.array(self.ladder.cuts), self.rungs.fine(column), self.rungs
        known = fits & rungs.known(column)
        if known.any():
            self._take(rungs.marched(np.flatnonzero(known), column))
        work = cuts[np.minimum(fine, cuts.size - 1)] * rungs.unit(column) * rungs.model(column).body_modes
        fits = fits & (fine < cuts.size) & (work <= rungs.truth.used["work"])
        lanes = np.flatnonzero(fits & ~known)
        self._march(column, {int(rung): lanes[fine[lanes] == rung] for rung in np.unique(fine[lanes])[::-1]})
        lanes = np.flatnonzero(fits | known)
        found[lanes] = self.held[column, fine[lanes], lanes]
        return found

    def _climbs(self) -> Iterator[Job[list[March]]]:
        """Of all columns, for pilots whose tolerance they can hold at all."""
        for column, floor in self.floor.items():
            start = self.rungs.first(column)
            worth = (floor <= HOPELESS * self.span[1]) & (start < len(self.ladder.cuts))
            if worth.any():
                yield Job(partial(Rungs.climb, column=column, start=start, floor=floor), np.flatnonzero(worth))

    def _march(self, column: int, pilots: Mapping[int, Counts]) -> None:
        """March some pilots on each of some rungs."""
        jobs = [Job(partial(Rungs.march, column=column, rung=rung), own) for rung, own in pilots.items() if own.size]
        self._take(self.share(self.rungs, jobs))

    def _take(self, marches: Iterable[March]) -> None:
        """What marches found; of a column's, finer rungs are no worse, unless marched and this one is not small."""
        for column, rung, lanes, error, held, work in marches:
            numbers = sum(pilot.size for pilot, _ in self.found) + np.arange(lanes.size)
            self.marched[column, rung] = True
            small, before = held <= ENOUGH * self.span[0], self.told_by[column, rung:, lanes].T
            finer, own = np.nonzero(small | (before <= rung))
            finer, of_pilot = finer + rung, lanes[own]
            self.held[column, finer, of_pilot] = held[own]
            self.march[column, finer, of_pilot] = numbers[own]
            self.told_by[column, finer, of_pilot] = rung
            self.found.append((lanes, error.T))
            self.work += work

    def _fill(self, name: str, enough: Array) -> None:
        """Pilots for which fewer modes were enough are no worse with more and the same steps, within their rules."""
        own = [column for column, numerics in enumerate(self.ladder.columns) if numerics.fidelity == name]
        for fewer, column in pairwise(own):
            is_more = self.ladder.columns[column].modes > enough
            lanes = np.flatnonzero(is_more & ~np.isfinite(self.held[column]).any(axis=0))
            allowed = np.array(self.ladder.cuts)[:, None] >= self.rungs.least(column)[0][lanes]
            rungs, pilots = np.nonzero(allowed & ~np.isfinite(self.held[column][:, lanes]))
            for told in (self.held, self.march):
                told[column, rungs, lanes[pilots]] = told[fewer, rungs, lanes[pilots]]
