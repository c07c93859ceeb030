"""One scene as all its marches see it: cut at its events by a coarse grid, on which marches of any steps meet."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from engine.kernels.schemes import SCHEMES
from engine.march.envelopes import envelope_tables
from engine.march.step_rules import (
    are_soft,
    contact_steps,
    free_limit,
    free_steps,
    least_steps,
    limit_with_springs,
    vibrates_freely,
)
from engine.march.tables import SceneTables
from engine.model.numerics import open_bodies
from engine.model.scene_model import with_numerics
from engine.model.timeline import build_grid, refined
from engine.observation.kinks import stops
from engine.scene.sensors import MOST_PLACES
from engine.statics.static_response import Statics
from results_schema.arrays import Counts

if TYPE_CHECKING:
    from engine.kernels.schemes import Scheme
    from engine.march.outcome import Asked
    from engine.model.numerics import Numerics
    from engine.model.scene_model import SceneModel
    from engine.model.timeline import Grid, Timeline
    from engine.scene.variants import VariantValues


#: Steps of the grid over a passage, or over a cycle. The cheapest march that holds 1e-2 took
#: 32 to 64 (208 passages), 50 over a cycle of a shuttle; the 200 phases of kept histories are a multiple of those.
PASSAGE_STEPS, CYCLE_STEPS = 32, 50
MODES = (4, 8, 16, 32, 64)  # that loads excite, of levels: 64 are what a beam's closed forms were tested for
FEWER, LEAST_LEVELS = (2, 1), 3  # the same where 64 modes hold few of them, and the levels that an error is told from
PILOT_PLACES = 9  # of an envelope, at which its error is measured: a mode or two lie between them at 1e-3
MOST_COMPARED = 4096  # stations of the histories that are compared: 0.25 MB of 8 variants each signal
KEPT_CYCLE = 256 * 2**20  # of a cycle's tables: ten of 64 modes x 102,400 steps took 2.1 s, 3.1 s with 96 MB
#: Steps per first period, up to which sweeps of a sprung mass on stiff springs took a third of the work that average
#: acceleration took; at ten times as many 9 of 192 references have no estimate.
CLOSE_STEPS = 20_000
#: Periods of contacts in a step of the grid, from which on a scheme that damps is taken: `machine-bed-run`, just
#: beyond, takes a quarter of the steps by it.
SLOWLY = 8
BEGINNING = 1e-9  # of scene time: what a rider is on then it is on at the start
MOST_FREE = 2048  # the same at most: of a passage at 30 times the critical speed; at 3e4 times it took minutes
LEAST_FREE = 8  # steps per first period of free vibration: what the coarsest march of such passages had


@dataclass(eq=False)
class SceneGrid:
    """A scene of the study with all its variants' numbers (``values``).

    unit: steps of the grid per unit of scene time; as many as the study fixes, where it fixes them. places: of each
    envelope that marches watch, at most. common: the columns of the ladder that all scenes of a sweep have, where
    pilots of some choose for others, and shared: their scheme.
    """

    asked: Asked
    scene: SceneModel
    values: VariantValues
    unit: int
    places: int = MOST_PLACES
    common: tuple[Numerics, ...] | None = None
    shared: Scheme | None = None
    _models: dict[Numerics, SceneModel] = field(default_factory=dict)
    _readings: dict[tuple[str, int, int, int], Statics] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        """What another process makes the same of: without what was built meanwhile."""
        return {one.name: getattr(self, one.name) for one in fields(self)} | {"_models": {}, "_readings": {}}

    @cached_property
    def grid(self) -> Grid:
        """The scene cut at its events, and where loads pass kinks of influence lines."""
        model, whole = self.scene, self.asked.window == "whole"
        cut = stops(model, SceneTables(model, 1, self.asked.window).sensors) if whole and not self.fixed else ()
        return build_grid(model.riders, self.unit, self.asked.window, self._free_unit, cut)

    @property
    def fixed(self) -> bool:
        """Whether the study says how many steps."""
        return self.values.has_fixed_steps

    @cached_property
    def _free_unit(self) -> int:
        """Steps of the grid per first period of free vibration: as in the mean passage."""
        scale = self.values.scene_time_scale
        if self.fixed:
            free, pairs = free_steps(self.scene), self.scene.scheme.stride
            return free if pairs == 1 else max(-(-free // pairs), self.unit)  # whose whole histories come closer
        passage = float(np.exp(np.mean(np.log(scale)))) * self.scene.first_omega / (2.0 * np.pi)
        return min(max(LEAST_FREE, int(np.ceil(self.unit / passage))), MOST_FREE)

    @property
    def readings(self) -> Literal["contacts", "accelerations"]:
        """What marches read besides the sensors."""
        return "accelerations" if self.asked.accelerated else "contacts"

    @property
    def listens(self) -> bool:
        """Whether it matters how much a variant vibrates: cycles resonate, within parts of a sweep that are too narrow
        for neighbours to tell of."""
        return self.asked.reduction is not None

    @property
    def is_meshed(self) -> bool:
        """Whether the study says into how many elements a body is cut."""
        return any(self.scene.study.body[part.name].is_meshed for part in self.scene.bodies)

    def of_pilots(self) -> SceneGrid:
        """The same scene for marches that only measure errors: envelopes at a few places."""
        return replace(self, places=PILOT_PLACES)

    @property
    def chooses(self) -> bool:
        """Whether the study leaves model, modes or scheme open."""
        solver = self.asked.study.solver
        return bool(open_bodies(self.scene.study)) or solver.fidelity == "auto" or solver.scheme == "auto"

    @cached_property
    def mode_levels(self) -> tuple[int, ...]:
        """Numbers of modes of bodies that leave them open, each with twice as many that loads excite as the one before:
        a frame may have none of these among its first dozen."""
        names = open_bodies(self.scene.study)
        parts = [part for part in self.scene.bodies if part.name in names]
        rigid = max((part.modal.rigid_modes for part in parts), default=0)
        usual = tuple(modes for modes in MODES if modes > rigid + 1)
        if all(self.scene.excited(part).all() for part in parts):
            return usual
        whole = self.model(self.scene.numerics._replace(modes=MODES[-1]))
        excited = [np.flatnonzero(whole.excited(part)) + 1 for part in whole.bodies if part.name in names]
        most = max(part.modal.omega.size for part in whole.bodies if part.name in names)
        found: set[int] = set()
        for count in (*usual, *FEWER):
            if count in usual or len(found) < LEAST_LEVELS:
                found.add(max(int(modes[count - 1]) if count <= modes.size else most for modes in excited))
        return tuple(sorted(found))

    def model(self, numerics: Numerics) -> SceneModel:
        """The scene with other numerics, the same object for the same."""
        if numerics not in self._models:
            self._models[numerics] = with_numerics(self.scene, numerics)
        return self._models[numerics]

    def free_by(self, model: SceneModel, by: int) -> int:
        """Steps of a march in one of the grid's free vibration, within its scheme's limit."""
        return by * max(1, int(np.ceil(free_limit(model) / (self._free_unit * by))))

    def once(self, model: SceneModel, by: int) -> SceneTables:
        """The same for one march alone."""
        found = self.tables(model, by)
        found.kept_bytes = KEPT_CYCLE if found.timeline.repeats else 0
        return found

    def tables(self, model: SceneModel, by: int) -> SceneTables:
        """The tables of a march with ``by`` steps in one of the grid's; a pair's coarser march has as many."""
        stride = model.scheme.stride
        found = SceneTables(model, self.unit * by * stride, self.asked.window, self.readings, stride)
        free_by = self.free_by(model, by * stride) // stride
        found.timeline = refined(self.grid.timeline(by, free_by), stride)
        found.statics = self._statics(model, (by * stride, free_by * stride), found.timeline)
        found.companions = envelope_tables(found, self.places)
        return found

    def _statics(self, model: SceneModel, by: tuple[int, int], timeline: Timeline) -> Statics:
        """Static readings along a timeline of so many steps in one of the grid's and of its free vibration: where all
        modes are known they are the scene's own, to the last bit, whichever march asks first, and the largest are
        looked for at the same places."""
        numerics = model.numerics
        key = (numerics.fidelity, 0 if numerics.static_correction else model.body_modes, *by)
        if key not in self._readings:
            corrected = self.scene.numerics._replace(fidelity=numerics.fidelity, static_correction=True)
            teller = self.model(corrected) if numerics.static_correction else model
            sensors = SceneTables(teller, self.unit, self.asked.window, self.readings).sensors
            coarser = None if by == (1, 1) else self._statics(model, (1, 1), self.grid.timeline(1, 1))
            self._readings[key] = Statics(teller, timeline, sensors, coarser, by)
        return self._readings[key]

    def stations(self, model: SceneModel, by: int) -> Counts:
        """The grid's stations by their count in such a march; where there are very many, some of them, evenly."""
        by *= model.scheme.stride
        return self.grid.stations(by, self.free_by(model, by), MOST_COMPARED)

    def safe_cuts(self, numerics: Numerics, values: VariantValues, by: int) -> Counts:
        """(V,) ``by``, or the least power of two of steps that no variant's rules forbid."""
        if self.fixed or numerics.fidelity == "static":
            return np.full(values.size, by, dtype=np.int64)
        model = self.model(numerics)
        times = least_steps(model, values) / (self.unit * model.scheme.stride * by)
        return by * np.exp2(np.ceil(np.log2(np.maximum(times, 1.0)) - 1e-9)).astype(np.int64)


def unit_steps(scene: SceneModel) -> int:
    """Steps of the grid over one passage or cycle."""
    return PASSAGE_STEPS if scene.clock.period is None else CYCLE_STEPS


def open_scheme(grid: SceneGrid) -> Scheme:
    """The scheme of a study that leaves it open: Fox-Goodwin's, whose fast modes take mass; average acceleration, which
    has no limit, where springs are stiff: beside modes in free vibration, or so that their limit asks for more steps
    than it is worth; one that damps where carriages move so slowly, and are not dropped, that periods of their contacts
    are short steps. The scenes of a sweep share one."""
    if grid.shared is not None:
        return grid.shared
    if not grid.scene.springs:
        return SCALED_FOX_GOODWIN
    fewest = grid.mode_levels[0] if open_bodies(grid.scene.study) else 0
    model = grid.model(grid.scene.numerics._replace(scheme=SCALED_FOX_GOODWIN, modes=fewest))
    dropped = grid.scene.study.start == "rest" and any(rider.touches(0.0, BEGINNING) for rider in model.riders)
    if not dropped and np.any(contact_steps(model, grid.values) > SLOWLY * unit_steps(grid.scene)):
        return DAMPED
    if any(vibrates_freely(carriage) for carriage in model.carriages) and not are_soft(model, grid.values):
        return AVERAGE_ACCELERATION
    close = CLOSE_STEPS * grid.values.scene_time_scale * model.first_omega / (2.0 * np.pi)
    return AVERAGE_ACCELERATION if np.any(limit_with_springs(model, grid.values) > close) else SCALED_FOX_GOODWIN


AVERAGE_ACCELERATION = SCHEMES["average-acceleration"]({})
SCALED_FOX_GOODWIN = SCHEMES["scaled-fox-goodwin"]({})
DAMPED = SCHEMES["hht-alpha"]({"alpha": -0.05})
