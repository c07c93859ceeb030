"""The ladder of what a variant may be computed with, and the measured error of every rung for some variants (pilots).

A column of the ladder is a model, a number of modes and a scheme; its rungs are numbers of steps. A pilot climbs each
column that can hold its tolerance at all until the error is small or no longer falls; from there on, finer rungs count
as no worse.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.grids import AVERAGE_ACCELERATION, FOX_GOODWIN, SceneGrid, swift_scheme_fits
from engine.accuracy.jobs import Halted, InTurn, Job, Share
from engine.accuracy.reference import Converged, Level, as_fixed, converge, in_full, is_free
from engine.accuracy.results import deciding, differences, results_of, worst_held
from engine.kernels.schemes import Scheme
from engine.march.outcome import Asked, Outcome, outcome, vibration
from engine.march.step_rules import least_steps
from engine.model.numerics import Numerics, open_bodies
from engine.model.scene_model import SceneModel
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.status import Fidelity

MODES = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)  # each a third to a half more than the one before
SIMPLER = (("static", Fidelity.STATIC), ("force", Fidelity.FORCE), ("mass", Fidelity.MASS))  # than the carriages' own
CUTS = tuple(sorted({2**k for k in range(16)} | {3 * 2**k for k in range(15)}))  # steps in one of the grid's
#: Steps at which a column's modes are judged, per first period and in one of the grid's: by Fox-Goodwin (1e-8 of phase
#: a period), and by schemes of second order (1e-5). With half of them `double-peak` took 1.7 times the work.
FINE = {"fox-goodwin": (128.0, 16.0), "": (512.0, 32.0)}
# What is said of the next six was measured on `asymmetry`, `double-peak` and 10,000 passages: the work that these took.
#: Of the tolerance that a column leaves at such steps, so that none is climbed: 0.5 to 2 took 0.9 to 1.1 times.
HOPELESS = 0.9
FIRST = 3.0  # steps per first period, with which pilots begin: no rung of fewer has held 1e-2; 1 to 6 chose alike
FLAT = 1.2  # times what a column leaves, from where finer rungs gain nothing: 1.05 to 1.5 chose alike
MORE = 2.0  # times the fewest modes that leave little: with 1.4 some variants missed the tolerance, 4 gained nothing
JUDGED_BY = 12  # modes, at least, of the column that says whether a simpler model can do at all: 6 to 24 took 0.8 to 1
ENOUGH = 0.2  # of the tolerance, where pilots climb no further: with 0.4 some variants missed it, 0.1 gained nothing
REFERENCE_PART = 0.25  # of the tolerance by which references may be off, which what they judge is told to be off too


@dataclass(frozen=True, eq=False)
class Ladder:
    """The columns of a study's ladder, and the steps of their rungs in those of the grid."""

    columns: tuple[Numerics, ...]
    cuts: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Measured:
    """What P pilots found: error (M, R) of every result in each march of a pilot, the first infinite; pilot (M,): whose
    it was; march (columns, cuts, P): the one that tells of a rung, 0 where none does; held (columns, cuts, P): the
    largest of the errors that are held, without what the study itself fixes, over their tolerances; reference (R, P):
    the errors of the references themselves; marched (columns, cuts): rungs that any has marched; work: modes x steps
    over a passage or cycle of all their marches; spent (P,): the same of each one's reference; vibration (P,): of
    cycles; free: whether the study fixes nothing that the references change."""

    error: Array
    pilot: Counts
    march: NDArray[np.int32]
    held: Array
    reference: Array
    marched: NDArray[np.bool_]
    work: float
    spent: Array
    vibration: Array
    free: bool


def ladder_of(asked: Asked, grid: SceneGrid) -> Ladder:
    """The ladder within what the study fixes."""
    study, own = asked.study, grid.scene.numerics
    names = open_bodies(study)
    rigid = max((part.modal.rigid_modes for part in grid.scene.bodies if part.name in names), default=0)
    modes = [count for count in MODES if count > rigid] if names else [0]
    schemes = [own.scheme]
    if study.solver.scheme == "auto" and not grid.fixed:
        schemes = [AVERAGE_ACCELERATION, FOX_GOODWIN] if swift_scheme_fits(grid) else [AVERAGE_ACCELERATION]
    columns = [
        own._replace(fidelity=name, scheme=scheme, modes=count)
        for name in _models(asked, grid)
        for count in (modes[:1] if name == "static" and own.static_correction else modes)
        for scheme in (schemes[:1] if name == "static" else schemes)
    ]
    return Ladder(tuple(columns), (1,) if grid.fixed else CUTS)


def _models(asked: Asked, grid: SceneGrid) -> list[str]:
    """Models to choose from, the simplest first."""
    own = grid.scene.numerics
    if own.fidelity != "auto":
        return [own.fidelity]
    found = [name for name, model in SIMPLER if asked.least_fidelity <= model < grid.scene.fidelity]
    if not own.static_correction:  # statics know the kept modes alone
        found = [name for name in found if name != "static"]
    if any(carriage.rides is not None for carriage in grid.scene.carriages):
        found = [name for name in found if name == "static"]
    return [*found, "auto"]


class March(NamedTuple):
    """A march of n pilots (by their places) on a rung: error (R, n) of every result, held (n,), whether it tells of
    finer rungs too (n,), which else none is to take, and modes x steps."""

    column: int
    rung: int
    lanes: Counts
    error: Array
    held: Array
    finer: NDArray[np.bool_]
    work: float


@dataclass(frozen=True, eq=False)
class Rungs:
    """Marches of pilots on the ladder, measured. truth: the references; aim: those within what the study fixes. span:
    as of `Climb`."""

    grid: SceneGrid
    values: VariantValues
    ladder: Ladder
    span: tuple[float, float]
    truth: Converged
    aim: Converged
    levels: dict[int, Level]
    _rules: dict[int, tuple[Array, Array]] = field(default_factory=dict)

    def march(self, lanes: Counts, halted: Halted, column: int, rung: int) -> March:
        """March some pilots on a rung. Raises Halted."""
        model, by = self.model(column), self.ladder.cuts[rung]
        tables = self.grid.once(model, by)
        now = outcome(self.grid.asked, tables, self.values.part(lanes), self.grid.stations(model, by), halted)
        tables.forget()
        return self._measured(column, rung, lanes, now, float(lanes.size * model.body_modes * tables.steps))

    def marched(self, lanes: Counts, column: int) -> Iterator[March]:
        """The marches of some pilots that were levels of their references."""
        level = self.levels[column]
        own = np.searchsorted(level.lanes, lanes)
        for by in np.unique(level.by[own]):
            part = level.by[own] == by
            yield self._measured(column, self.ladder.cuts.index(by), lanes[part], level.outcome.of(own[part]), 0.0)

    def _measured(self, column: int, rung: int, lanes: Counts, now: Outcome, work: float) -> March:
        """What pilots report on a rung, beside their references."""
        model, values, asked = self.model(column), self.values.part(lanes), self.grid.asked
        results = deciding(results_of(asked), asked.study.solver.tolerance)
        error = differences(asked, model, values, now, self.truth.outcome.of(lanes))
        against = error
        if self.aim is not self.truth:
            against = differences(asked, model, values, now, self.aim.outcome.of(lanes))
        finer = np.ones(lanes.size, dtype=np.bool_)
        return March(column, rung, lanes, error, worst_held(against, results), finer, work)

    def climb(self, lanes: Counts, halted: Halted, column: int, floor: Array, most: Array) -> list[March]:
        """From the coarsest rung that each of some pilots may take, until nothing is gained, or the next one would be
        more work than ``most`` (P,); floor (P,): what the column leaves. Raises Halted."""
        cuts, fine, rung = np.array(self.ladder.cuts), self.fine(column), self.first(column)
        active, found = lanes[rung[lanes] < np.minimum(fine[lanes], cuts.size)], list[March]()
        while active.size:
            here = int(rung[active].min())
            own = active[rung[active] == here]
            now = self.march(own, halted, column, here)
            small = now.held <= np.maximum(ENOUGH * self.span[0], FLAT * floor[own])
            rung[own] += 1
            done = small | (rung[own] >= np.minimum(fine[own], cuts.size))
            dear = ~done & (self.work(column)[min(here + 1, cuts.size - 1)] > most[own])
            found.append(now._replace(finer=~dear))
            active = active[~np.isin(active, own[done | dear])]
        return found

    def first(self, column: int) -> Counts:
        """(P,) the coarsest rung that pilots may take."""
        least, periods = self.least(column)
        return np.searchsorted(np.array(self.ladder.cuts), np.maximum(least, FIRST / self.unit(column) * periods))

    def fine(self, column: int) -> Counts:
        """(P,) the rung at which a column's modes are judged: that of the reference's level, where it is one."""
        least, periods = self.least(column)
        of_period, of_grid = FINE.get(self.model(column).scheme.name, FINE[""])
        wanted = np.maximum(least, np.maximum(of_period / self.unit(column) * periods, of_grid))
        if column in self.levels:
            wanted[self.levels[column].lanes] = self.levels[column].by
        return np.searchsorted(np.array(self.ladder.cuts), wanted)

    def known(self, column: int) -> NDArray[np.bool_]:
        """(P,) whether a column was a level of the reference, on one of the ladder's rungs."""
        found = np.zeros(self.values.size, dtype=np.bool_)
        if column in self.levels:
            found[self.levels[column].lanes] = self.levels[column].by <= self.ladder.cuts[-1]
        return found

    def least(self, column: int) -> tuple[Array, Array]:
        """(P,) the least steps in one of the grid's, and first periods per unit of scene time."""
        if column not in self._rules:
            model = self.model(column)
            periods = self.values.scene_time_scale * model.first_omega / (2.0 * np.pi)
            self._rules[column] = least_steps(model, self.values) / self.unit(column), periods
        return self._rules[column]

    def model(self, column: int) -> SceneModel:
        """The scene with the numerics of a column."""
        return self.grid.model(self.ladder.columns[column])

    def work(self, column: int) -> Array:
        """(cuts,) modes x steps of a column's rungs over one passage or cycle."""
        steps: Array = self.unit(column) * np.array(self.ladder.cuts, dtype=np.float64)
        return self.model(column).body_modes * steps

    def unit(self, column: int) -> int:
        """Steps of the lowest rung over one passage or cycle."""
        return self.grid.unit * self.ladder.columns[column].scheme.stride


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
    marched: NDArray[np.bool_] = field(init=False)
    work: float = 0.0
    floor: dict[int, Array] = field(default_factory=dict)
    enough: dict[str, Array] = field(default_factory=dict)

    def go(self) -> Measured:
        """Find the references of the pilots, what each model and number of modes can do for them, and with how many
        steps. Raises Halted, and Crashed by the places of pilots."""
        refer = partial(converge, self.grid, self.values, part=REFERENCE_PART, share=self.share)
        levels = list[Level]()
        aim = refer(levels=as_fixed(self.grid), seen=levels.append)
        truth = aim if is_free(self.grid) else refer(levels=in_full(self.grid))
        on_ladder = {self.ladder.columns.index(v.numerics): v for v in levels if v.numerics in self.ladder.columns}
        self.rungs = Rungs(self.grid, self.values, self.ladder, self.span, truth, aim, on_ladder)
        shape = len(self.ladder.columns), len(self.ladder.cuts), self.values.size
        self.found = [(np.zeros(1, dtype=np.int64), np.full((1, len(truth.error)), np.inf))]
        self.march = np.zeros(shape, dtype=np.int32)
        self.held = np.full(shape, np.inf)
        self.marched = np.zeros(shape[:2], dtype=np.bool_)
        for name in dict.fromkeys(numerics.fidelity for numerics in self.ladder.columns):
            self._judge(name)
        for scheme in dict.fromkeys(numerics.scheme for numerics in self.ladder.columns):
            for marches in self.share(self.rungs, list(self._climbs(scheme))):
                self._take(marches)
        for name, enough in self.enough.items():
            self._fill(name, enough)
        return self._measured(truth, aim is truth)

    def _measured(self, truth: Converged, free: bool) -> Measured:
        """What the jobs found."""
        work = float(self.work + truth.spent.sum())
        pilot, error = (np.concatenate(parts) for parts in zip(*self.found, strict=True))
        errors = error, pilot, self.march, self.held, truth.error, self.marched
        return Measured(*errors, work, truth.spent, self._vibration(truth), free)

    def _vibration(self, truth: Converged) -> Array:
        """(P,) how much the pilots vibrate in a cycle; nothing of what is no cycle."""
        if not self.grid.listens:
            return np.zeros(self.values.size)
        tables = self.grid.tables(self.grid.scene, 1)
        return vibration(tables, self.values, self.grid.stations(self.grid.scene, 1), truth.outcome)

    def _judge(self, name: str) -> None:
        """What each number of modes of a model leaves, by the last scheme alone; from the fewest on, until some leave
        so little that many more are of no use."""
        own = [column for column, numerics in enumerate(self.ladder.columns) if numerics.fidelity == name]
        everywhere = np.ones(self.values.size, dtype=np.bool_)
        if name == "static" or len(self.ladder.cuts) == 1:
            for column in own:
                fits = self.rungs.least(column)[0] <= 1.0 if name != "static" else everywhere
                self._march(column, {0: np.flatnonzero(fits)})
            return
        families: dict[int, list[int]] = {}
        for column in own:
            families.setdefault(self.ladder.columns[column].modes, []).append(column)
        if name != self.grid.scene.numerics.fidelity:
            modes = next((count for count in families if count >= JUDGED_BY), max(families))
            everywhere = self._floor(families[modes][-1], everywhere) <= HOPELESS * self.span[1]
        enough = np.full(self.values.size, np.inf)
        for count, columns in families.items():
            floor = self._floor(columns[-1], everywhere & (count <= MORE * enough))
            enough = np.where((floor <= ENOUGH * self.span[0]) & ~np.isfinite(enough), count, enough)
            self.floor |= dict.fromkeys(columns, floor)
        self.enough[name] = enough

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

    def _climbs(self, scheme: Scheme) -> Iterator[Job[list[March]]]:
        """Of all columns of a scheme that can hold the tolerance of some pilots at all, from where none of lower order
        holds well, as far as none of higher order is known to hold well with less work."""
        for column, floor in self.floor.items():
            own = self.ladder.columns[column]
            if own.scheme != scheme:
                continue
            most = np.full(self.values.size, np.inf)
            for other in (c for c in self.floor if c != column and own == self._with_scheme(c, scheme)):
                well = self.held[other] <= ENOUGH * self.span[0]
                most = np.minimum(most, np.where(well, self.rungs.work(other)[:, None], np.inf).min(axis=0))
                if other < column:
                    first = np.where(well.any(axis=0), np.argmax(well, axis=0), len(well))
                    self._no_worse(column, other, np.flatnonzero(first <= self.rungs.first(column)))
            first = np.minimum(self.rungs.first(column), len(self.ladder.cuts) - 1)
            known = np.isfinite(self.held[column, first, np.arange(first.size)])
            worth = np.flatnonzero((floor <= HOPELESS * self.span[1]) & ~known)
            if worth.size:
                yield Job(partial(Rungs.climb, column=column, floor=floor, most=most), worth)

    def _with_scheme(self, column: int, scheme: Scheme) -> Numerics:
        return self.ladder.columns[column]._replace(scheme=scheme)

    def _march(self, column: int, pilots: Mapping[int, Counts]) -> None:
        """March some pilots on each of some rungs."""
        jobs = [Job(partial(Rungs.march, column=column, rung=rung), own) for rung, own in pilots.items() if own.size]
        self._take(self.share(self.rungs, jobs))

    def _take(self, marches: Iterable[March]) -> None:
        """What marches found; of a column's, finer rungs are no worse."""
        for column, rung, lanes, error, held, finer, work in marches:
            numbers = sum(pilot.size for pilot, _ in self.found) + np.arange(lanes.size)
            self.marched[column, rung] = True
            self.held[column, rung:, lanes] = held[:, None]
            self.march[column, rung:, lanes] = np.where(finer, numbers, 0)[:, None]
            self.march[column, rung, lanes] = numbers
            self.found.append((lanes, error.T))
            self.work += work

    def _fill(self, name: str, enough: Array) -> None:
        """Pilots for which fewer modes were enough are no worse with more and the same steps, within their rules."""
        before: dict[Scheme, int] = {}
        for column, numerics in enumerate(self.ladder.columns):
            if numerics.fidelity != name:
                continue
            lanes = np.flatnonzero((numerics.modes > enough) & ~np.isfinite(self.held[column]).any(axis=0))
            if numerics.scheme in before:
                self._no_worse(column, before[numerics.scheme], lanes)
            before[numerics.scheme] = column

    def _no_worse(self, column: int, other: int, lanes: Counts) -> None:
        """Unknown rungs of a column that some pilots may take are no worse than those of another with as many steps."""
        allowed = np.array(self.ladder.cuts)[:, None] >= self.rungs.least(column)[0][lanes]
        rungs, own = np.nonzero(allowed & ~np.isfinite(self.held[column][:, lanes]))
        for told in (self.held, self.march):
            told[column, rungs, lanes[own]] = told[other, rungs, lanes[own]]
