"""The cheapest model, modes and steps that hold a variant's tolerance, chosen before anything is marched.

All three errors are estimates (`ladder`, `omitted`); of all combinations whose sum is within the tolerance the one with
the fewest modes x steps is taken. So a tighter tolerance never gets a cheaper one, and what a variant gets depends on
its own numbers alone: rounded to a fixed lattice first, so that a million variants ask for a few thousand choices.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.bodies.beam import Beam
from engine.bodies.frame import Frame
from engine.fidelity import LEAST_MARGIN, LEAST_STEPS, STEPS_PER_PERIOD, alias_steps, limit_steps, round_up
from engine.ladder import errors_along, full_fidelity
from engine.lanes import LaneValues
from engine.model import SceneModel, simplified
from engine.moving_load import Load, noticed
from engine.omitted import MODES_LOOKED_AT, Omitted, longest_step, missed_by
from engine.resonance import spring_steps
from engine.route import Route, routes
from engine.timeline import Window
from results_schema.status import Fidelity

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

LEVELS = (2, 3, 4, 6, 8, 12, 16, 24)  # numbers of modes that are chosen from
FEW, MORE = 4, 3  # fewer modes than these are compared with so many more, others with half
UNKNOWN = 12  # modes where nothing is known of their error
USUAL = 1e-3  # the tolerance at which `STEPS_PER_PERIOD` is right where nothing is known
CELL = 0.05  # width of the lattice's cells, as a part of a number
UNFELT = 0.05  # of the tolerance: ringing that need not be resolved
MOST_SIMPLER = 0.7  # of the tolerance that a simpler model may take
LEAST_PART = 0.1  # of the tolerance that steps may take where nothing holds it
UNHELD = 1e15  # price of an error, beyond that of any march
UNKNOWN_PRICE = 1e300  # of the carriages' own model where nothing can be told, beyond any error's
FINER = 2.0  # times the steps that are safe: half of them must be so too
MOST_CHOSEN = 1e6  # steps over a passage or cycle for the sake of the tolerance; what asks for more misses it
MOST_FINER = 12.0  # times the steps where nothing is known, likewise
AT_ONCE = 4096  # variants that are looked at together
CHOSEN = (Fidelity.STATIC, Fidelity.FORCE, Fidelity.MASS)  # besides the carriages' own model


class Choice(NamedTuple):
    """What V variants get: a model (number of `Fidelity`), modes of every body whose modes are "auto", steps for the
    tolerance; and the errors that these leave, NaN where nobody can tell.

    decay: the error of all these modes over that of as many as `checking` compares them with. ruled: 1 where the steps
    are more than the tolerance asks for, by the rules that no march may break. felt: modes that ring noticeably.
    """

    fidelity: Array
    modes: Array
    steps: Array
    error_fidelity: Array
    error_modes: Array
    error_steps: Array
    decay: Array
    ruled: Array
    felt: Array

    def of(self, lanes: Counts | NDArray[np.bool_]) -> Choice:
        """Some of them."""
        return Choice(*(part[lanes] for part in self))


class _Option(NamedTuple):
    """One combination of model, modes and steps for V variants, and its price in modes x steps; more than any other's
    where it does not hold the tolerance, by its error."""

    choice: Choice
    price: Array


def choose(scene: SceneModel, values: LaneValues, least: Fidelity, window: Window) -> Choice:
    """The choice for some variants of a scene. least: the lowest model that tells what the study asks. window: what
    is recorded."""
    cells, inverse = _lattice(values)
    options = _Options(scene, least, window)
    with np.errstate(over="ignore"):  # infinitely slow variants
        parts = [options.choose(part) for part in _pieces(cells)]
    return Choice(*(np.concatenate(column) for column in zip(*parts, strict=True))).of(inverse)


def fewer_modes(kept: int) -> int:
    """The number of modes that so many are compared with."""
    return kept // 2 if kept >= FEW else kept + MORE


def automatic_bodies(scene: SceneModel) -> tuple[str, ...]:
    """Bodies whose number of modes is chosen: those of beams and frames that carry loads, and ride on nothing."""
    riding = {carriage.rides for carriage in scene.carriages}
    ridden = {carriage.body for carriage in scene.carriages}
    return tuple(
        part.name
        for number, part in enumerate(scene.bodies)
        if number in ridden - riding and _is_free(scene.study.body[part.name])
    )


def with_choice(scene: SceneModel, fidelity: Fidelity, modes: int) -> SceneModel:
    """A scene with a chosen model and number of modes; the same scene where nothing is chosen."""
    changes: dict[str, object] = {f"body.{name}.modes": modes for name in automatic_bodies(scene)} if modes else {}
    if scene.study.solver.fidelity == "auto" and fidelity < full_fidelity(scene):
        changes["solver.fidelity"] = fidelity.name.lower()
    return simplified(scene, changes) if changes else scene


def usual_steps(values: LaneValues) -> Array:
    """(V,) steps per period where nothing but the tolerance is known."""
    return STEPS_PER_PERIOD * np.sqrt(USUAL / values.of("solver.tolerance"))


def _is_free(body: object) -> bool:
    """Whether a body's modes are ours to choose; those of a reduced or imported one are few already."""
    if isinstance(body, Frame) and body.interface:
        return False
    return isinstance(body, Beam | Frame) and body.modes == "auto" and not isinstance(body.damping_ratio, tuple)


@dataclass(frozen=True, eq=False)
class _Options:
    """Everything that may be chosen for a scene."""

    scene: SceneModel
    least: Fidelity
    window: Window
    _models: dict[int, SceneModel] = field(default_factory=dict)

    @cached_property
    def whole(self) -> SceneModel:
        """The scene with as many modes as are looked at."""
        names = automatic_bodies(self.scene)
        changes = {f"body.{name}.modes": MODES_LOOKED_AT for name in names}
        return simplified(self.scene, changes) if names else self.scene

    @cached_property
    def levels(self) -> tuple[int, ...]:
        """Numbers of modes to choose from; 0 where none is chosen."""
        names = automatic_bodies(self.scene)
        if not names:
            return (0,)
        rigid = max(part.modal.rigid_modes for part in self.whole.bodies if part.name in names)
        return tuple(level for level in LEVELS if level > rigid)

    @cached_property
    def models(self) -> tuple[Fidelity, ...]:
        """Models to choose from, cheapest first."""
        full = full_fidelity(self.scene)
        if self.scene.study.solver.fidelity != "auto":
            return (self.scene.fidelity,)
        simpler = [model for model in CHOSEN if self.least <= model < full]
        if not self.scene.study.solver.static_correction:  # statics know the kept modes alone
            simpler = [model for model in simpler if model is not Fidelity.STATIC]
        if any(carriage.rides is not None for carriage in self.scene.carriages):
            simpler = [model for model in simpler if model is Fidelity.STATIC]
        return (*simpler, full)

    @cached_property
    def along(self) -> tuple[Route, ...] | None:
        """The routes of all loads over the whole bodies."""
        return routes(self.whole, MODES_LOOKED_AT, self.window)

    def choose(self, values: LaneValues) -> Choice:
        """The choice for some variants."""
        if self.along is None:
            return self._unknown(values)
        errors, told = errors_along(self.whole, self.along, values), _Told.of(self.along, values)
        options = [
            self._option(model, errors.get(model, np.zeros(values.size)), level, told, values)
            for model in self.models
            for level in (self.levels if model is not Fidelity.STATIC else self.levels[:1])
        ]
        price = np.stack([option.price for option in options])
        cheapest = np.argmin(price, axis=0)
        columns = (np.stack(column) for column in zip(*(option.choice for option in options), strict=True))
        return Choice(*(np.take_along_axis(column, cheapest[None], axis=0)[0] for column in columns))

    def _option(self, model: Fidelity, error: Array, level: int, told: _Told, values: LaneValues) -> _Option:
        """One combination for some variants."""
        tolerance, time = values.of("solver.tolerance"), values.time_scale(self.scene.carriages[0].name)
        none = np.zeros(values.size)
        if model is Fidelity.STATIC:
            choice = Choice(none + model, none, none, error, none, none, none, none, none)
            return _Option(choice, np.where(error <= MOST_SIMPLER * tolerance, 0.0, np.inf))
        kept, ours = level or MODES_LOOKED_AT, error * float(len(self.models) > 1)
        left, (sizes, slips) = told.modes(kept), told.ringing(kept)
        allowed = tolerance - ours - (left if level else 0.0)
        step = longest_step(sizes, slips, np.maximum(allowed, LEAST_PART * tolerance), time / LEAST_STEPS)
        most = np.minimum(MOST_FINER * np.maximum(usual_steps(values) * self._periods(time), LEAST_STEPS), MOST_CHOSEN)
        wanted, rules = np.minimum(self._unit(time) / step, most), self._rules(model, level, values)
        steps = round_up(np.maximum(wanted, rules)).astype(np.float64)
        missed = missed_by(sizes, slips, self._unit(time) / steps)
        fewer = told.modes(fewer_modes(kept)) if level else none
        decay = np.divide(left, fewer, out=np.ones_like(left), where=fewer > left)
        ruled = (rules > wanted).astype(float)
        choice = Choice(none + model, none + level, steps, error, left, missed, decay, ruled, told.felt(tolerance))
        holds = (allowed > 0.0) & (ours <= MOST_SIMPLER * tolerance) & (wanted < most)
        price = np.where(holds, steps * (level or self.scene.body_modes), UNHELD * (ours + left + missed))
        last = UNKNOWN_PRICE if model is full_fidelity(self.scene) else np.inf
        return _Option(choice, np.where(np.isnan(price), last, price))

    def _unit(self, time: Array) -> Array:
        """(V,) s over which steps count; free vibration has as many per first period."""
        free = any(getattr(rider.motion, "after", 0.0) > 0.0 for rider in self.scene.riders)
        return np.maximum(time, 2.0 * np.pi / self.scene.first_omega) if free else time

    def _periods(self, time: Array) -> Array:
        """(V,) first periods over which steps count."""
        return np.asarray(self._unit(time) * self.scene.first_omega / (2.0 * np.pi))

    def _rules(self, model: Fidelity, level: int, values: LaneValues) -> Array:
        """(V,) steps that the rules ask for which no march may break, for any variant of a cell."""
        time, scene = values.time_scale(self.scene.carriages[0].name), self.whole
        kept = [part.modal.omega[: level or None] for part in scene.bodies]
        found = FINER * limit_steps(scene, max(float(omega[-1]) for omega in kept), time)
        if model > Fidelity.FORCE:
            found = np.maximum(found, FINER * LEAST_MARGIN * alias_steps(scene, time, level or None))
        if model is Fidelity.TIED:
            sprung = self._with(level)
            found = np.max([found, *spring_steps(sprung, values, usual_steps(values), FINER).values()], axis=0)
        return np.asarray(np.maximum((1.0 + CELL) * found, LEAST_STEPS))

    def _with(self, level: int) -> SceneModel:
        """The carriages' own model with so many modes."""
        if level not in self._models:
            self._models[level] = with_choice(self.scene, full_fidelity(self.scene), level)
        return self._models[level]

    def _unknown(self, values: LaneValues) -> Choice:
        """Where nothing is known: the full model, and steps by the tolerance alone."""
        periods = self._periods(values.time_scale(self.scene.carriages[0].name))
        nothing, none = np.full(values.size, np.nan), np.zeros(values.size)
        level = UNKNOWN if automatic_bodies(self.scene) else 0
        wanted, rules = usual_steps(values) * periods, self._rules(self.models[-1], level, values)
        steps = round_up(np.maximum(np.minimum(wanted, MOST_CHOSEN), rules)).astype(np.float64)
        ruled = (rules > wanted).astype(float)
        felt = none + np.inf
        return Choice(none + self.models[-1], none + level, steps, none, nothing, nothing, none + 1.0, ruled, felt)


@dataclass(frozen=True, eq=False)
class _Told:
    """What is known beforehand of V variants: loads on their routes, and what marches leave out of them."""

    loads: tuple[Omitted, ...]

    @classmethod
    def of(cls, along: tuple[Route, ...], values: LaneValues) -> _Told:
        """From the routes of all loads."""
        loads = [Load(route, values) for route in along]
        found = []
        for load in loads:
            on_body = [other for other in loads if other.route.tie.body == load.route.tie.body]
            found.append(Omitted(load, noticed(on_body)))
        return cls(tuple(found))

    def modes(self, level: int) -> Array:
        """(V,) error of keeping so many modes of every body."""
        return np.asarray(np.sum([load.modes(level) for load in self.loads], axis=0))

    def felt(self, tolerance: Array) -> Array:
        """(V,) number of the lowest modes beyond which all ringing together is less than `UNFELT` of the tolerance."""
        found = [
            np.max(np.where(load.tails > UNFELT * tolerance, load.load.modes[:, None] + 1, 1), axis=0)
            for load in self.loads
        ]
        return np.asarray(np.max(found, axis=0), dtype=np.float64)

    def ringing(self, level: int) -> tuple[Array, Array]:
        """What the step may spoil (R, V), and by which part per square of it, with so many modes of every body."""
        parts = [load.stepped(level) for load in self.loads]
        sizes, slips = (np.concatenate(part) for part in zip(*parts, strict=True))
        return sizes, slips


class _Cells(LaneValues):
    """Numbers of variants on the lattice, swept or not: a variant is chosen for alike in any sweep."""

    def of(self, path: str) -> Array:
        """(V,) values at a dotted key."""
        return _rounded(super().of(path), path)


def _lattice(values: LaneValues) -> tuple[LaneValues, Counts]:
    """Variants with distinct numbers after rounding to a few per cent, and which of them every variant is."""
    code = np.zeros(values.size, dtype=np.int64)
    for path, column in values.columns.items():
        distinct, place = np.unique(_rounded(column, path), return_inverse=True)
        code = np.unique(code * distinct.size + place.reshape(-1), return_inverse=True)[1].reshape(-1)
    first, inverse = np.unique(code, return_index=True, return_inverse=True)[1:]
    return LaneValues(
        values.study, {path: column[first] for path, column in values.columns.items()}, first.size
    ), inverse


def _rounded(column: Array, path: str) -> Array:
    """A column on the lattice; tolerances and numbers of steps as they are."""
    if path.startswith("solver."):
        return column
    with np.errstate(divide="ignore"):
        cell = np.rint(np.log(np.abs(column)) / CELL)
    return np.asarray(np.where(column == 0.0, 0.0, np.sign(column) * np.exp(CELL * cell)))


def _pieces(values: LaneValues) -> Iterator[LaneValues]:
    """Variants a few at a time, their numbers on the lattice."""
    for first in range(0, values.size, AT_ONCE):
        part = slice(first, first + AT_ONCE)
        columns = {path: column[part] for path, column in values.columns.items()}
        yield _Cells(values.study, columns, min(AT_ONCE, values.size - first))
