"""The ladder of what a variant may be computed with, and its rungs, marched for some variants (pilots).

A column of the ladder is a model and a number of modes; its rungs are numbers of steps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.grids import AVERAGE_ACCELERATION, DAMPED, SceneGrid, open_scheme
from engine.accuracy.jobs import Halted
from engine.accuracy.results import between_peaks, deciding, differences, results_of, worst_held
from engine.march.outcome import Asked, Outcome, outcome
from engine.march.step_rules import least_steps
from engine.model.numerics import Numerics, open_bodies
from engine.model.scene_model import SceneModel
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.status import Fidelity

if TYPE_CHECKING:
    from engine.accuracy.reference import Converged, Level

MODES = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)  # each a third to a half more than the one before
SIMPLER = (("static", Fidelity.STATIC), ("force", Fidelity.FORCE), ("mass", Fidelity.MASS))  # than the carriages' own
CUTS = tuple(sorted({2**k for k in range(16)} | {3 * 2**k for k in range(15)}))  # steps in one of the grid's
#: Steps at which a column's modes are judged, per first period and in one of the grid's: by Fox-Goodwin (1e-8 of phase
#: a period), and by schemes of second order (1e-5). With half of them `double-peak` took 1.7 times the work.
FINE = {"fox-goodwin": (128.0, 16.0), "scaled-fox-goodwin": (128.0, 16.0), "": (512.0, 32.0)}
# What is said of the next three was measured on `asymmetry`, `double-peak` and 10,000 passages: the work they took.
FIRST = 3.0  # steps per first period, with which pilots begin: no rung of fewer has held 1e-2; 1 to 6 chose alike
FLAT = 1.2  # times what a column leaves, from where finer rungs gain nothing: 1.05 to 1.5 chose alike
ENOUGH = 0.2  # of the tolerance, where pilots climb no further: with 0.4 some variants missed it, 0.1 gained nothing


@dataclass(frozen=True, eq=False)
class Ladder:
    """The columns of a study's ladder, and the steps of their rungs in those of the grid."""

    columns: tuple[Numerics, ...]
    cuts: tuple[int, ...]


def ladder_of(asked: Asked, grid: SceneGrid) -> Ladder:
    """The ladder within what the study fixes."""
    if grid.common is not None:
        return Ladder(grid.common, (1,) if grid.fixed else CUTS)
    study, says = asked.study, grid.scene.numerics
    names = open_bodies(grid.scene.study)
    rigid = max((part.modal.rigid_modes for part in grid.scene.bodies if part.name in names), default=0)
    modes = [count for count in MODES if count > rigid] if names else [0]
    is_open = study.solver.scheme == "auto" and not grid.fixed
    columns = [
        says._replace(fidelity=name, scheme=open_scheme(grid) if is_open else says.scheme, modes=count)
        for name in _models(asked, grid)
        for count in (modes[:1] if name == "static" and says.static_correction else modes)
    ]
    return Ladder(tuple(columns), (1,) if grid.fixed else CUTS)


def share_ladder(asked: Asked, grids: Sequence[SceneGrid]) -> None:
    """Let the scenes of a sweep have one ladder, of the columns that all of them have: what pilots of some scenes find
    is told to the others."""
    schemes = {open_scheme(grid) for grid in grids}
    if len(schemes) > 1:  # references too: rungs that cost more than a reference by another scheme were never judged
        for grid in grids:
            grid.shared = DAMPED if DAMPED in schemes else AVERAGE_ACCELERATION
    of_each = [ladder_of(asked, grid).columns for grid in grids]
    known = set.intersection(*map(set, of_each))
    for grid in grids:
        grid.common = tuple(column for column in of_each[0] if column in known)


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
    """A march of n pilots (by their places) on a rung: error (R, n) of every result, held (n,), and modes x steps."""

    column: int
    rung: int
    lanes: Counts
    error: Array
    held: Array
    work: float


@dataclass(frozen=True, eq=False)
class Rungs:
    """Marches of pilots on the ladder, measured. truth: the references; aim: those within what the study fixes;
    levels: those of their marches that are columns of the ladder, by column. span: as of `Climb`."""

    grid: SceneGrid
    values: VariantValues
    ladder: Ladder
    span: tuple[float, float]
    truth: Converged
    aim: Converged
    levels: dict[int, Level]
    _rules: dict[int, tuple[Array, Array]] = field(default_factory=dict)
    _held: dict[int, Array] = field(default_factory=dict)

    def march(self, lanes: Counts, halted: Halted, column: int, rung: int) -> March:
        """March some pilots on a rung. Raises Halted."""
        model, by = self.model(column), self.ladder.cuts[rung]
        tables = self.grid.once(model, by)
        now = outcome(self.grid.asked, tables, self.values.part(lanes), self.grid.stations(model, by), halted)
        tables.forget()
        return self._measured(column, rung, lanes, now, float(lanes.size * model.body_modes * tables.steps))

    def marched(self, lanes: Counts, column: int) -> Iterator[March]:
        """The marches of some pilots that were levels of their references."""
        return self._of_steps(column, np.searchsorted(self.levels[column].lanes, lanes))

    def _of_steps(self, column: int, own: Counts) -> Iterator[March]:
        """The same by the places of pilots among those of the level."""
        level = self.levels[column]
        for by in np.intersect1d(level.by[own], self.ladder.cuts):
            part = level.by[own] == by
            yield self._measured(
                column, self.ladder.cuts.index(by), level.lanes[own[part]], level.outcome.of(own[part]), 0.0
            )

    def _measured(self, column: int, rung: int, lanes: Counts, now: Outcome, work: float) -> March:
        """What pilots report on a rung, beside their references."""
        model, values, asked = self.model(column), self.values.part(lanes), self.grid.asked
        results = deciding(results_of(asked), asked.study.solver.tolerance)
        least = between_peaks(asked, now)
        error = np.maximum(differences(asked, model, values, now, self.truth.outcome.of(lanes)), least)
        against = error
        if self.aim is not self.truth:
            against = np.maximum(differences(asked, model, values, now, self.aim.outcome.of(lanes)), least)
        return March(column, rung, lanes, error, worst_held(against, results), work)

    def climb(self, lanes: Counts, halted: Halted, column: int, start: Counts, floor: Array) -> list[March]:
        """From rungs ``start`` (P,) of some pilots, until nothing is gained; floor (P,): what the column leaves. Raises
        Halted."""
        cuts, fine, rung = np.array(self.ladder.cuts), self.fine(column), start.copy()
        active, found = lanes[rung[lanes] < np.minimum(fine[lanes], cuts.size)], list[March]()
        while active.size:
            here = int(rung[active].min())
            own = active[rung[active] == here]
            now = self.march(own, halted, column, here)
            small = now.held <= np.maximum(ENOUGH * self.span[0], FLAT * floor[own])
            rung[own] += 1
            done = small | (rung[own] >= np.minimum(fine[own], cuts.size))
            found.append(now)
            active = active[~np.isin(active, own[done])]
        return found

    def first(self, column: int) -> Counts:
        """(P,) the coarsest rung that pilots may take."""
        least, periods = self.least(column)
        return np.searchsorted(np.array(self.ladder.cuts), np.maximum(least, FIRST / self.unit(column) * periods))

    def fine(self, column: int) -> Counts:
        """(P,) the rung at which a column's modes are judged: that of the reference's level, where it is one and has
        steps enough, or leaves little, or more would be more work than the reference."""
        least, periods = self.least(column)
        scheme = self.model(column).scheme.name
        of_period, of_grid = FINE.get(scheme, FINE[""])
        wanted = np.maximum(least, np.maximum(of_period / self.unit(column) * periods, of_grid))
        if column in self.levels:
            lanes, by = self.levels[column].lanes, self.levels[column].by
            work = wanted[lanes] * self.unit(column) * self.model(column).body_modes
            dear = work > self.aim.used["work"][lanes]
            enough = dear | (by >= wanted[lanes]) | (self._of_level(column) <= ENOUGH * self.span[0])
            wanted[lanes] = np.where(enough, by, wanted[lanes])
        return np.searchsorted(np.array(self.ladder.cuts), wanted)

    def _of_level(self, column: int) -> Array:
        """(n,) the largest of the errors that are held, by the level of the reference that is a column; infinite where
        its steps are no rung's."""
        if column not in self._held:
            level = self.levels[column]
            self._held[column] = np.full(level.lanes.size, np.inf)
            for march in self._of_steps(column, np.arange(level.lanes.size)):
                self._held[column][np.searchsorted(level.lanes, march.lanes)] = march.held
        return self._held[column]

    def known(self, column: int) -> NDArray[np.bool_]:
        """(P,) whether a column is judged by a level of the reference."""
        found = np.zeros(self.values.size, dtype=np.bool_)
        if column in self.levels:
            lanes, by = self.levels[column].lanes, self.levels[column].by
            found[lanes] = np.append(self.ladder.cuts, 0)[self.fine(column)[lanes]] == by
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

    def unit(self, column: int) -> int:
        """Steps of the lowest rung over one passage or cycle."""
        return self.grid.unit * self.ladder.columns[column].scheme.stride
