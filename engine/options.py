"""Every combination of model, modes, scheme and steps that a scene may get, its price, and the cheapest that holds.

All three errors are estimates (`ladder`, `omitted`); of all combinations whose sum is within `AIM` of the tolerance the
one with the fewest modes x steps is taken, so that a tighter tolerance never gets a cheaper one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.choice import (
    AIM,
    FEW,
    FINER,
    LEVELS,
    MOST_CHOSEN,
    MOST_SIMPLER,
    Asked,
    Choice,
    automatic_bodies,
    fewer_modes,
    fixed_steps,
    scheme_used,
    true_steps,
    usual_steps,
    with_choice,
)
from engine.fidelity import LEAST_MARGIN, LEAST_STEPS, alias_steps, limit_steps, round_up, stair
from engine.kernels.schemes import Scheme
from engine.ladder import errors_along, full_fidelity
from engine.lanes import LaneValues
from engine.model import SceneModel, simplified
from engine.moving_load import Load, noticed
from engine.omitted import MODES_LOOKED_AT, Omitted, Spoiled
from engine.resonance import spring_steps
from engine.route import Route, routes
from results_schema.status import Fidelity, SchemeUsed

Array = NDArray[np.float64]

CELL = 0.05  # width of the lattice's cells on which variants are looked at, as a part of a number
UNKNOWN = 12  # modes where nothing is known of their error
UNFELT = 0.05  # of the tolerance: ringing that need not be resolved
LEAST_PART = 0.1  # of the tolerance, or of all other errors where these are larger, that steps may take
UNHELD = 1e15  # price of an error, beyond that of any march
ALIKE = 1.25  # times an error that is not held: as good as that
UNKNOWN_PRICE = 1e300  # of the carriages' own model where nothing can be told, beyond any error's
LEAST_OF_CYCLE = 400  # steps, of whose stations a study makes its results
KINKED = 0.3  # of the tolerance that extremes may miss between stations where an influence line has a kink
MOST_FINER = 12.0  # times the steps where nothing is known, for the sake of the tolerance
CHOSEN = (Fidelity.STATIC, Fidelity.FORCE, Fidelity.MASS)  # besides the carriages' own model
SCHEMES = (SchemeUsed.AVERAGE_ACCELERATION, SchemeUsed.FOX_GOODWIN)  # with any step; and the truest in phase
STAIR = stair(MOST_CHOSEN)


class _Kind(NamedTuple):
    """A model, a number of modes of every body whose modes are chosen (0 where none is), and a scheme."""

    model: Fidelity
    level: int
    scheme: SchemeUsed


class _Option(NamedTuple):
    """One combination of model, modes, scheme and steps for V variants, and its price in modes x steps; more than any
    other's where it does not hold the tolerance, by its error."""

    choice: Choice
    price: Array


@dataclass(frozen=True, eq=False)
class Options:
    """Everything that may be chosen for a scene."""

    scene: SceneModel
    asked: Asked
    _models: dict[tuple[int, SchemeUsed], SceneModel] = field(default_factory=dict)

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
        simpler = [model for model in CHOSEN if self.asked.least <= model < full]
        if not self.scene.study.solver.static_correction:  # statics know the kept modes alone
            simpler = [model for model in simpler if model is not Fidelity.STATIC]
        if any(carriage.rides is not None for carriage in self.scene.carriages):
            simpler = [model for model in simpler if model is Fidelity.STATIC]
        return (*simpler, full)

    def schemes(self, values: LaneValues) -> tuple[SchemeUsed, ...]:
        """Schemes to choose from. Free vibration with springs wants one that is stable with any step."""
        free = self._vibrates_freely and bool(self.scene.springs)
        if self.scene.study.solver.scheme != "auto" or fixed_steps(self.scene.study, values) or free:
            return (scheme_used(self.scene.study),)
        return SCHEMES

    def _has_many(self, level: int) -> bool:
        """Whether so many modes are compared with half of them: with more of them, a limit asks for many more steps."""
        return (level or max(part.modal.omega.size for part in self.scene.bodies)) >= FEW

    @cached_property
    def along(self) -> tuple[Route, ...] | None:
        """The routes of all loads over the whole bodies."""
        return routes(self.whole, MODES_LOOKED_AT, self.asked.window)

    def choose(self, values: LaneValues) -> Choice:
        """The choice for some variants."""
        if self.along is None:
            return self._unknown(values)
        errors, told = errors_along(self.whole, self.along, values), Told.of(self.along, values)
        options = [
            self._option(kind, errors.get(kind.model, np.zeros(values.size)), told, values)
            for kind in self._kinds(values)
        ]
        price = np.stack([option.price for option in options])
        cheapest = np.argmin(price, axis=0)
        columns = (np.stack(column) for column in zip(*(option.choice for option in options), strict=True))
        return Choice(*(np.take_along_axis(column, cheapest[None], axis=0)[0] for column in columns))

    def _kinds(self, values: LaneValues) -> Iterator[_Kind]:
        """All combinations but for the steps."""
        schemes = self.schemes(values)
        for model in self.models:
            for level in self.levels if model is not Fidelity.STATIC else ():
                for scheme in schemes if self._has_many(level) else schemes[:1]:
                    yield _Kind(model, level, scheme)
            if model is Fidelity.STATIC:
                yield _Kind(model, 0, schemes[0])

    def _option(self, kind: _Kind, error: Array, told: Told, values: LaneValues) -> _Option:
        """One combination for some variants."""
        model, level, scheme = kind
        tolerance, time = AIM * values.of("solver.tolerance"), values.time_scale(self.scene.carriages[0].name)
        none = np.zeros(values.size)
        if model is Fidelity.STATIC:
            choice = Choice(none + model, none, none + scheme, none, error, none, none, none, none, none)
            return _Option(choice, np.where(error <= MOST_SIMPLER * tolerance, 0.0, np.inf))
        kept = level or MODES_LOOKED_AT
        ours = error if self.scene.study.solver.fidelity == "auto" else none  # what the study fixes is its own affair
        left, spoiled = told.modes(kept), told.ringing(kept, self._by(scheme).scheme)
        spoiled = spoiled._replace(sizes=self.asked.reported * spoiled.sizes)
        others = ours + (left if level else 0.0)
        allowed = tolerance - others
        least = LEAST_PART * np.maximum(tolerance, others)
        enough = _fewest(spoiled, np.maximum(allowed, least), self._unit(time))
        most = np.minimum(MOST_FINER * np.maximum(usual_steps(values) * self._periods(time), LEAST_STEPS), MOST_CHOSEN)
        wanted, rules = np.minimum(enough, most), self._rules(kind, values)
        wanted = np.maximum(wanted, told.kinks / (KINKED * tolerance) if self.asked.window == "last-cycle" else none)
        fixed = fixed_steps(self.scene.study, values)
        steps = values.of("solver.steps") if fixed else round_up(np.maximum(wanted, rules)).astype(np.float64)
        missed = spoiled.missed(self._unit(time) / steps)
        fewer = told.modes(fewer_modes(kept)) if level else none
        decay = np.divide(left, fewer, out=np.ones_like(left), where=fewer > left)
        ruled = (rules > wanted).astype(float)
        errors = (error, left, missed, decay, ruled, told.felt(tolerance))
        choice = Choice(none + model, none + level, none + scheme, steps, *errors)
        room = allowed >= (0.0 if fixed else LEAST_PART * tolerance)
        holds = room & (ours <= MOST_SIMPLER * tolerance) & (fixed | (enough < most))
        work = steps * (level or self.scene.body_modes)
        price = np.where(holds, work, UNHELD * _alike(ours + left + missed) + work)
        last = UNKNOWN_PRICE if model is full_fidelity(self.scene) else np.inf
        return _Option(choice, np.where(np.isnan(price), last, price))

    def _unit(self, time: Array) -> Array:
        """(V,) s over which steps count; free vibration has as many per first period."""
        return np.maximum(time, 2.0 * np.pi / self.scene.first_omega) if self._vibrates_freely else time

    @property
    def _vibrates_freely(self) -> bool:
        return any(getattr(rider.motion, "after", 0.0) > 0.0 for rider in self.scene.riders)

    def _periods(self, time: Array) -> Array:
        """(V,) first periods over which steps count."""
        return np.asarray(self._unit(time) * self.scene.first_omega / (2.0 * np.pi))

    def _rules(self, kind: _Kind, values: LaneValues) -> Array:
        """(V,) steps that the rules ask for which no march may break, for any variant of a cell."""
        model, level, scheme = kind
        time, scene = values.time_scale(self.scene.carriages[0].name), self._by(scheme)
        found = FINER * limit_steps(scene, self._highest(level), self._unit(time))
        if model > Fidelity.FORCE:
            found = np.maximum(found, FINER * LEAST_MARGIN * alias_steps(scene, time, level or None))
        if model is Fidelity.TIED:
            sprung = self._with(level, scheme)
            rules = spring_steps(sprung, values, true_steps(values, scene.scheme), FINER)
            found = np.max([found, *rules.values()], axis=0)
        return np.asarray(
            np.maximum((1.0 + CELL) * found, LEAST_STEPS if self.asked.window == "whole" else LEAST_OF_CYCLE)
        )

    def _highest(self, level: int) -> float:
        """rad/s: of the scene with so many modes."""
        chosen, kept = automatic_bodies(self.scene), level or None
        return max(float(part.modal.omega[: kept if part.name in chosen else None][-1]) for part in self.whole.bodies)

    def _by(self, scheme: SchemeUsed) -> SceneModel:
        """The scene with as many modes as are looked at, marched by a scheme."""
        if (0, scheme) not in self._models:
            self._models[0, scheme] = with_choice(self.whole, full_fidelity(self.scene), 0, scheme)
        return self._models[0, scheme]

    def _with(self, level: int, scheme: SchemeUsed) -> SceneModel:
        """The carriages' own model with so many modes, marched by a scheme."""
        if (level, scheme) not in self._models:
            self._models[level, scheme] = with_choice(self.scene, full_fidelity(self.scene), level, scheme)
        return self._models[level, scheme]

    def _unknown(self, values: LaneValues) -> Choice:
        """Where nothing is known: the full model, and steps by the tolerance alone."""
        periods = self._periods(values.time_scale(self.scene.carriages[0].name))
        nothing, none = np.full(values.size, np.nan), np.zeros(values.size)
        level = UNKNOWN if automatic_bodies(self.scene) else 0
        kind = _Kind(self.models[-1], level, scheme_used(self.scene.study))
        wanted, rules = usual_steps(values) * periods, self._rules(kind, values)
        steps = round_up(np.maximum(np.minimum(wanted, MOST_CHOSEN), rules)).astype(np.float64)
        ruled = (rules > wanted).astype(float)
        felt = none + np.inf
        model, modes, scheme = (none + number for number in kind)
        return Choice(model, modes, scheme, steps, none, nothing, nothing, none + 1.0, ruled, felt)


@dataclass(frozen=True, eq=False)
class Told:
    """What is known beforehand of V variants: loads on their routes, and what marches leave out of them."""

    loads: tuple[Omitted, ...]

    @classmethod
    def of(cls, along: tuple[Route, ...], values: LaneValues) -> Told:
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

    @property
    def kinks(self) -> float:
        """Part of an extreme, times the number of steps, by which stations may miss the kink of an influence line."""
        return max(load.load.route.steepest for load in self.loads)

    def felt(self, tolerance: Array) -> Array:
        """(V,) number of the lowest modes beyond which all ringing together is less than `UNFELT` of the tolerance."""
        found = [
            np.max(np.where(load.tails > UNFELT * tolerance, load.load.modes[:, None] + 1, 1), axis=0)
            for load in self.loads
        ]
        return np.asarray(np.max(found, axis=0), dtype=np.float64)

    def ringing(self, level: int, scheme: Scheme) -> Spoiled:
        """What the step of a scheme may spoil, with so many modes of every body."""
        parts = [load.stepped(level, scheme) for load in self.loads]
        return Spoiled(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _alike(error: Array) -> Array:
    """(V,) errors that nothing holds, to the next power of `ALIKE`: of such alike the cheapest is good enough."""
    with np.errstate(divide="ignore"):
        return np.asarray(ALIKE ** np.ceil(np.log(error) / np.log(ALIKE)))


def _fewest(spoiled: Spoiled, allowed: Array, unit: Array) -> Array:
    """(V,) the fewest steps of the stair over ``unit`` (V,) s that miss no more than is ``allowed`` (V,); infinite
    where not even its last are enough."""
    low, high = np.zeros(unit.size, dtype=np.int64), np.full(unit.size, STAIR.size)
    while np.any(low < high):
        middle = np.minimum((low + high) // 2, STAIR.size - 1)
        enough = spoiled.missed(unit / STAIR[middle]) <= allowed
        low, high = np.where(enough | (low == high), low, middle + 1), np.where(enough, middle, high)
    return np.asarray(np.append(STAIR, np.inf)[high])
