"""Schemes to compare the march with: over the same scenes, observed in the same way, never chosen by a study.

They march scenes of exactly one carriage without dampers. Each asks for the track where its own stages stand, and what
they do is in `engine.kernels.stepping.comparison`. Nothing here is in the fast path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from engine.kernels import layout
from engine.kernels.layout import Alpha, Lanes, Newmark, Observation, Record, State
from engine.kernels.schemes import NewmarkScheme
from engine.kernels.stepping.comparison import (
    Carried,
    Coupling,
    RigidTie,
    RungeKutta,
    Track,
    WilsonTheta,
    march_by_rule,
)
from engine.kernels.stepping.comparison_steps import ITERATIONS, KEPT, OWN_A, OWN_Q, OWN_V, UNCONVERGED
from engine.march.march import March, Marched, Observed, prepare
from engine.march.stepper import Codes
from engine.march.tables import SceneTables, SegmentTable
from engine.model.lane_table import from_blocks
from engine.model.scene_model import SceneModel
from engine.model.station_path import Along, StationPath
from engine.model.ties import CarriageTie
from engine.model.timeline import Segment
from engine.model.track import tabulate_ties
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.errors import BadInput

Rule = Coupling | WilsonTheta | RungeKutta | RigidTie

AVERAGE_ACCELERATION = Newmark(0.25, 0.5)
MOST_ITERATIONS = 50
ITERATED_TO = 1e-12  # of the weight or of the force itself, the larger
_NO_IMPLICIT_PART = Newmark(0.0, 0.0)  # the rows' column w then holds P alone


@dataclass(frozen=True)
class ComparisonScheme:
    """A scheme that is offered for comparison only.

    order: of its error on smooth, resolved scenes. stability_limit: largest omega h of an undamped oscillator without
    a carriage, infinite where there is none. offsets: the places of a step, 0 its beginning and 1 its end, where the
    track is asked for. rule: what the kernels know of it.
    """

    name: str
    order: int
    stability_limit: float
    offsets: tuple[float, ...]
    rule: Rule


def wilson_theta(theta: float = 1.4) -> ComparisonScheme:
    """Wilson (1968): linear acceleration over theta h, equilibrium at its end.

    Raises BadInput for a theta below 1.37, from which on it is stable at every step.
    """
    if not theta >= 1.37:
        raise BadInput("Wilson-theta has a limit here", where="theta", expected="1.37 or more", received=f"{theta:g}")
    rule = WilsonTheta(theta, theta**2 / 6.0, 0.5 * theta)
    return ComparisonScheme("wilson-theta", 2, math.inf, (theta, 1.0), rule)


def runge_kutta() -> ComparisonScheme:
    """The classic method of order 4; its limit is sqrt(8)."""
    return ComparisonScheme("rk4", 4, math.sqrt(8.0), (0.5, 1.0), RungeKutta(0.5))


#: Staggered and iterated couplings, with average acceleration.
_COUPLED = {
    # the contact force m (g - D2w) of the last step: stable iff m phi.phi < 1 (section 7.1)
    "lagged-inertia": Coupling(AVERAGE_ACCELERATION, 0.0, 0.0, 0, 0.0, 0.0),
    # implicit inertia, the convective terms of the last step: stable and of first order
    "lagged-convective": Coupling(AVERAGE_ACCELERATION, 1.0, 0.0, 0, 0.0, 0.0),
    # the implicit step by fixed-point iteration of the contact force, which contracts where r < 1 (section 7.1); a
    # variant whose iteration does not converge within 50 ends as NaN
    "picard": Coupling(AVERAGE_ACCELERATION, 1.0, 1.0, MOST_ITERATIONS, ITERATED_TO, 0.0),
    # the same with the changes divided by 1 + r
    "picard-relaxed": Coupling(AVERAGE_ACCELERATION, 1.0, 1.0, MOST_ITERATIONS, ITERATED_TO, 1.0),
}


def coupled(name: str, scheme: Newmark = AVERAGE_ACCELERATION) -> ComparisonScheme:
    """A staggered or iterated coupling by its name, with a scheme of the march for the modes."""
    rule = _COUPLED[name]._replace(scheme=scheme)
    return ComparisonScheme(name, 2 if rule.iterations else 1, _limit(scheme), (0.0, 1.0), rule)


def rigid_tie(scheme: Newmark | Alpha = AVERAGE_ACCELERATION) -> ComparisonScheme:
    """The mass is a body of its own that has the contact point's place at every station (section 4, kappa = 0).

    Raises BadInput for an explicit scheme, in which no force of the new step moves the new place.
    """
    if not scheme.beta > 0.0:
        raise BadInput("an explicit scheme cannot hold a place", where="scheme", expected="a scheme with beta > 0")
    return ComparisonScheme("rigid-tie", 2, _limit(scheme), (0.0, 1.0), RigidTie(scheme))


def _limit(scheme: Newmark | Alpha) -> float:
    """Largest omega h of a scheme of the march; the alpha schemes have none."""
    return math.inf if isinstance(scheme, Alpha) else NewmarkScheme("newmark", *scheme).stability_limit


#: Every comparison scheme by its name, the implicit ones with average acceleration.
COMPARISON: Mapping[str, ComparisonScheme] = {
    scheme.name: scheme
    for scheme in (
        wilson_theta(),
        runge_kutta(),
        *map(coupled, _COUPLED),
        rigid_tie(),
    )
}


class Effort(NamedTuple):
    """Fixed-point iterations of V variants: their mean number per step in contact, and the number of steps whose
    iteration did not converge; zero for schemes that do not iterate."""

    iterations: Array
    unconverged: Array


@dataclass(frozen=True, eq=False)
class Compared(Marched):
    """What a march by a comparison scheme leaves: as `Marched`, and its effort."""

    effort: Effort


class Propagated(NamedTuple):
    """A state after steps without loads, and the effort, its iterations per step (lanes that fill a block too)."""

    state: State
    effort: Effort


def march_comparison(
    scheme: ComparisonScheme,
    tables: SceneTables,
    values: VariantValues,
    counts: Counts,
    size: int,
    halted: Callable[[], bool] = lambda: False,
    sampled: int | None = None,
) -> Compared:
    """March the first ``size`` variants of a scene as `engine.march.march.march` does, by a comparison scheme.

    Raises BadInput where the scene has not exactly one carriage or has dampers, and Halted.
    """
    going = prepare_comparison(scheme, tables, values, counts, sampled)
    codes = going.go(halted)
    steps = sum(segment.steps for segment in tables.timeline.segments if segment.active[0])
    return Compared(**vars(going.result(codes, size)), effort=_effort(going.kept, steps, size))


def prepare_comparison(
    scheme: ComparisonScheme, tables: SceneTables, values: VariantValues, counts: Counts, sampled: int | None = None
) -> ComparisonMarch:
    """Set up a march by a comparison scheme as `engine.march.march.prepare` does. Raises BadInput."""
    check_comparison(scheme, tables.model)
    ready = prepare(tables, values, counts, sampled)
    kept = np.zeros((ready.lanes.gravity.shape[0], KEPT, layout.LANES))
    return ComparisonMarch(**vars(ready), scheme=scheme, kept=kept)


def propagate_comparison(scheme: ComparisonScheme, track: Track, lanes: Lanes, state: State) -> Propagated:
    """The state after all steps of a track, without loads and gravity; the given one is left as it is.

    lanes, state: blocks as the kernels take them, SI units; the accelerations are taken as they are. A rigidly tied
    mass starts with the contact point.
    """
    free = lanes._replace(load=np.zeros_like(lanes.load), gravity=np.zeros_like(lanes.gravity))
    moved = State(*(part.copy() for part in state))
    steps, modes = track.rows.shape[1:3]
    blocks = free.step.shape[0]
    kept = np.zeros((blocks, KEPT, layout.LANES))
    start_own(kept, track, free, moved)
    record = Record(
        np.zeros((blocks, 0, layout.STATISTICS, layout.LANES)),
        np.full(steps + 1, -1, dtype=np.int64),
        np.zeros((blocks, 0, 0, layout.LANES)),
    )
    march_by_rule(scheme.rule, track, free, Carried(*moved, kept), _nothing_watched(modes), record, 0)
    return Propagated(moved, _effort(kept, steps, blocks * layout.LANES))


def frozen_track(scheme: ComparisonScheme, model: SceneModel, place: float, steps: int, advance: float = 0.0) -> Track:
    """The track of a carriage that is held at a place (m), with the terms of a speed of ``advance`` m per step.

    Raises BadInput as `march_comparison`.
    """
    check_comparison(scheme, model)
    still = np.zeros(steps)
    way = StationPath(still + place, still + advance, still, active=True)
    return _tabulated(model, tuple(way for _ in scheme.offsets))


def moving_track(scheme: ComparisonScheme, model: SceneModel, segment: Segment) -> Track:
    """The track along one segment; beyond its end the way goes on with its last acceleration, within the body.

    Raises BadInput as `march_comparison`.
    """
    check_comparison(scheme, model)
    key = segment._replace(first=0, fresh=False, strikes=(), recorded=False)
    return _moving_track(model, key, scheme.offsets)


@lru_cache(maxsize=16)
def _moving_track(model: SceneModel, segment: Segment, offsets: tuple[float, ...]) -> Track:
    return _tabulated(model, tuple(_way(model.carriages[0], segment, offset) for offset in offsets))


def check_comparison(scheme: ComparisonScheme, model: SceneModel) -> None:
    """Refuse a scene that a comparison scheme cannot march. Raises BadInput."""
    if model.ties != 1:
        raise model.study.source.fault(
            "carriage",
            f"{scheme.name} is for comparison only",
            expected="one carriage, no dampers and no springs",
            received=f"{len(model.carriages)} carriages, {len(model.dampers)} dampers, {len(model.springs)} springs",
        )
    carriage = model.carriages[0]
    if carriage.pulsates:
        what, where = f"{scheme.name} is for comparison only", f"carriage.{carriage.name}.pulsation"
        raise model.study.source.fault(where, what, expected="a force that stays the same")
    if isinstance(scheme.rule, RigidTie) and (carriage.inertia != "mass" or model.bodies[carriage.body].own_weight):
        what = f"{scheme.name} is for comparison only"
        expected = "a mass in full on a body whose own weight does not act"
        raise model.study.source.fault(f"carriage.{carriage.name}.kind", what, expected=expected)


@dataclass(frozen=True, eq=False)
class ComparisonMarch(March):
    """A march by a comparison scheme; kept (blocks, KEPT, LANES) is what its rule keeps besides the modes."""

    scheme: ComparisonScheme
    kept: Array

    def step(self, segment: Segment, table: SegmentTable, observed: Observed) -> Codes:
        """The steps of a segment by the rule; only those in contact count for its effort."""
        track = moving_track(self.scheme, self.tables.model, self._unit(segment))
        stepped = self.lanes.steps_of(self.step_size(segment))
        if segment.fresh:
            start_own(self.kept, track, stepped, self.state)
        kept = self.kept if segment.active[0] else self.kept.copy()
        carried = Carried(*self.state, kept)
        return np.asarray(march_by_rule(self.scheme.rule, track, stepped, carried, *observed, segment.first))

    def _unit(self, segment: Segment) -> Segment:
        """The segment in the first unit of scene time, where the path repeats itself."""
        unit = np.floor(segment.start + 1e-9) if self.tables.timeline.repeats else 0.0
        return segment._replace(start=round(segment.start - unit, 12), end=round(segment.end - unit, 12))


def start_own(kept: Array, track: Track, lanes: Lanes, state: State) -> None:
    """Put the mass's own place, velocity and acceleration where the contact point's are, in place."""
    row = track.rows[0, 0]
    h = lanes.step

    def over(column: int, modal: Array) -> Array:
        return np.asarray(np.einsum("n,bnj->bj", row[:, column], modal))

    kept[:, OWN_Q:] = 0.0
    kept[:, OWN_Q] = over(layout.FORCE, state.q)
    kept[:, OWN_V] = over(layout.FORCE, state.v) + 0.5 * over(layout.RATE, state.q) / h
    kept[:, OWN_A] = over(layout.FORCE, state.a) + over(layout.RATE, state.v) / h + over(layout.CURVE, state.q) / h**2


def _way(carriage: CarriageTie, segment: Segment, offset: float) -> StationPath:
    """The way of a carriage at the same place of every step of a segment."""
    tau = segment.start + (np.arange(segment.steps) + offset) * segment.step
    if not segment.active[0]:
        nowhere = np.zeros_like(tau)
        return StationPath(nowhere, nowhere, nowhere, active=False)
    inside = np.minimum(tau, segment.end)
    path, beyond = carriage.rider.path(inside, segment.start, segment.end), tau - inside
    place = path.S + path.dS * beyond + 0.5 * path.ddS * beyond**2
    speed = path.dS + path.ddS * beyond
    place = np.clip(place, 0.0, carriage.rider.length)
    return StationPath(place, speed * segment.step, path.ddS * segment.step**2, active=True)


def _tabulated(model: SceneModel, along: Along) -> Track:
    """Rows of the one tie along a way per offset."""
    ties = [tabulate_ties(model, (way,), _NO_IMPLICIT_PART) for way in along]
    rows = np.ascontiguousarray(np.stack([tie.rows[:, :, 0] for tie in ties]))
    return Track(rows, np.ascontiguousarray(np.stack([tie.drive[:, 0] for tie in ties])))


def _effort(kept: Array, steps: int, size: int) -> Effort:
    found = from_blocks(kept, size)
    return Effort(found[ITERATIONS] / max(1, steps), found[UNCONVERGED])


def _nothing_watched(modes: int) -> Observation:
    """A watch without signals."""
    rows, none = np.zeros((1, 0, 4 * -(-modes // 4))), np.zeros(0, dtype=np.int64)
    still = np.zeros((1, 0))
    never = still.astype(np.bool_)
    return Observation(rows, rows, rows, none, none, np.zeros((1, 0, 1)), still, none, never, never[0])
