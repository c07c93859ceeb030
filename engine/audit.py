"""The audit of a study: some of its variants once more with all terms, twice the modes and four times the steps.

Which variants follows from the study alone, and with how much of what they took: those that a variant of its march got
after all improvement.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.bodies.body import AUTO_MODES, MAX_MODES, Body
from engine.bodies.frame import MAX_FIXED_INTERFACE_MODES, Frame
from engine.bodies.reduced import Reduced
from engine.bodies.reduced_body import load_body
from engine.bodies.rigid import Rigid
from engine.bucket import PACE, Bucket
from engine.choice import Choice, automatic_bodies, fixed_steps, scheme_used, with_choice
from engine.fidelity import MOST_STEPS, STEPS_PER_PERIOD, check_most_steps, safe_steps
from engine.kernels.layout import LANES
from engine.lanes import LaneValues
from engine.model import SceneModel, build_model
from engine.plan import Plan
from engine.resolution import steps_to_resolve
from engine.resonance import spring_steps
from engine.scene import Study
from engine.scenes import scenes
from engine.sweep import Cases
from engine.tables import KEPT_BYTES, SceneTables
from results_schema.status import Fidelity, SchemeUsed

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

MORE_MODES, MORE_STEPS = 2, 4
_BASES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)  # of dimensions: axes beyond share the last
LEAST_STEPS = 800  # of a variant that marched none
MODES_OF_STATICS = 3  # whose double is marched for a variant that marched none: statics err by the slowest modes
PART, FEWEST, MOST = 0.01, 16, 256  # of all variants, where their number is left open
MOST_TIME, FREE_SECONDS = 0.3, 2.0  # of the run's expected time; and what may be spent whatever that is
SHARED = 8  # times the steps that a variant takes to share tables, which cost more than that
FULL_SHARED = 2  # the same once `MOST` share them
GROUP_SECONDS = 0.05  # besides tables and marching, for expected times only
STATION_SECONDS = 1.2e-6  # of tables; likewise
MODE_SECONDS = 1.5e-7  # of each mode in tables; likewise
TIE_BYTES, SENSOR_BYTES = 32, 16  # of a mode at a station of tables


class Used(NamedTuple):
    """What variants (V,) are marched with: modes of all bodies together, steps over one passage or cycle, and the
    scheme (number of `SchemeUsed`); 0 where nothing is marched."""

    modes: Counts
    steps: Counts
    scheme: Counts


class Sample(NamedTuple):
    """Variants (n,) to audit by their flat numbers, in the order in which fewer of them are spread best, and the
    seconds that their audit may be expected to take on one thread: of more, half are left out."""

    variants: Counts
    seconds: float


class _Group(NamedTuple):
    """Variants that are marched again together, with twice so many modes of the bodies whose modes are chosen."""

    scene: SceneModel
    chosen: int
    steps: int
    variants: Counts

    def seconds(self, plan: Plan) -> float:
        """Expected time on one thread; no body with more modes is made for that."""
        ties, timeline = self.scene.ties, SceneTables(self.scene, self.steps, plan.window).timeline
        modes = self.modes
        size = (TIE_BYTES * ties + SENSOR_BYTES * len(plan.study.sensor)) * self.steps * modes
        once = timeline.repeats and size <= KEPT_BYTES
        stations = min(timeline.steps, self.steps) if once else timeline.steps
        table = STATION_SECONDS + MODE_SECONDS * modes
        lanes = LANES * -(-self.variants.size // LANES)
        march = modes * (1.0 + 0.1 * len(plan.study.sensor)) * ties**1.2 * timeline.steps * lanes / PACE
        return float(GROUP_SECONDS + table * stations * ties + march)

    @property
    def modes(self) -> int:
        """About as many as are marched, with those of sprung masses."""
        own = self.chosen * len(automatic_bodies(self.scene)) + _fixed_modes(self.scene)
        return MORE_MODES * own + self.scene.omega.size - self.scene.body_modes


def expected(plan: Plan) -> Used:
    """What the variants of a plan are to be marched with before anything is improved."""
    found = Used(*(np.zeros(plan.size, dtype=np.int64) for _ in Used._fields))
    for bucket in plan.buckets:
        found.modes[bucket.variants] = bucket.scene.body_modes
        found.scheme[bucket.variants] = scheme_used(bucket.scene.study)
        found.steps[bucket.variants] = 0 if bucket.scene.fidelity is Fidelity.STATIC else bucket.steps
    return found


def sampled(plan: Plan) -> Sample:
    """The variants to audit; where the study leaves their number open 1 % of them, 16 to 256, that may take 30 % of
    the run's time or 2 s. Raises BadInput where the study asks for an audit of more steps than can be marched."""
    wanted = plan.study.solver.audit
    if wanted == "auto":
        count = int(np.clip(np.rint(PART * plan.size), FEWEST, MOST))
        seconds = max(MOST_TIME * plan.total_seconds(1), FREE_SECONDS)
        return Sample(spread_quasi_randomly(plan.cases, count), seconds)
    sample = Sample(spread_quasi_randomly(plan.cases, int(wanted)), np.inf)
    for group in _groups(plan, sample.variants, expected(plan)):
        check_most_steps(group.scene, np.array([group.steps]))
    return sample


def spread_quasi_randomly(cases: Cases, count: int) -> Counts:
    """(n,) flat numbers of `count` variants or all, spread over the sweep's dimensions, and so are the first of them:
    Halton's points, the longest dimension in base 2, the next ones in 3, 5 and so on."""
    wanted, dimensions = min(count, cases.size), len(cases.shape)
    order = np.argsort(np.argsort(-np.array(cases.shape, dtype=np.int64), kind="stable"))
    base = np.array(_BASES)[np.minimum(order, len(_BASES) - 1)]
    found, draws = np.zeros(0, dtype=np.int64), 2 * wanted
    while found.size < wanted and draws <= 16 * cases.size:
        numbers = np.arange(1, draws + 1)
        points = np.stack([_mirrored(numbers, int(b)) for b in base], axis=1) if dimensions else np.zeros((draws, 0))
        places = np.floor(points * cases.shape).astype(np.int64)
        drawn = np.ravel_multi_index(tuple(places.T), cases.shape) if cases.shape else np.zeros(1, dtype=np.int64)
        found, draws = drawn[np.sort(np.unique(drawn, return_index=True)[1])], 2 * draws
    left = np.setdiff1d(np.arange(cases.size), found) if found.size < wanted else found[:0]
    return np.concatenate([found, left])[:wanted]


def _mirrored(numbers: Counts, base: int) -> NDArray[np.float64]:
    """(n,) numbers with their digits mirrored at the point, from 0 to 1 (van der Corput 1935).

    >>> _mirrored(np.array([1, 2, 3, 4]), 2)
    array([0.5  , 0.25 , 0.75 , 0.125])
    """
    found, left, unit = np.zeros(numbers.size), numbers.copy(), 1.0
    while left.any():
        unit /= base
        found += unit * (left % base)
        left //= base
    return found


def audit_plan(plan: Plan, sample: Sample, used: Used) -> Plan | None:
    """The plan that marches the sample again, or as much of it as its time allows; None where that is nothing.

    Flat numbers stay what they are, and no history is kept. used: by all variants of the plan.
    """
    most = max(MOST_STEPS // MORE_STEPS, int(expected(plan).steps.max(initial=0)))
    groups = _affordable(plan, sample, used._replace(steps=np.minimum(used.steps, most)))
    if not groups:
        return None
    study = plan.study.with_values({"envelope": {}}) if plan.study.envelope else plan.study
    buckets = tuple(_bucket(plan, group) for group in groups)
    return replace(plan, study=study, buckets=buckets, shown=np.zeros(0, dtype=np.int64))


def audit_seconds(plan: Plan, sample: Sample) -> tuple[int, float]:
    """How many variants are expected to be audited, and the time that takes on one thread."""
    groups = _affordable(plan, sample, expected(plan))
    return sum(group.variants.size for group in groups), sum(group.seconds(plan) for group in groups)


def _affordable(plan: Plan, sample: Sample, used: Used) -> list[_Group]:
    """The groups of so many variants that their time is within the sample's."""
    count = sample.variants.size
    while count:
        groups = list(_groups(plan, sample.variants[:count], used))
        if not np.isfinite(sample.seconds) or sum(group.seconds(plan) for group in groups) <= sample.seconds:
            return groups
        count //= 2
    return []


def _groups(plan: Plan, variants: Counts, used: Used) -> Iterator[_Group]:
    """Variants that share a scene, a scheme and about as many steps."""
    for scene, own in _scenes(plan, np.sort(variants), used.scheme) if variants.size else ():
        wanted = _wanted_steps(plan, scene, own, used.steps[own])
        order = np.argsort(-wanted, kind="stable")
        first = 0
        for last in range(1, order.size + 1):
            shared = FULL_SHARED if last - first >= MOST else SHARED
            if last == order.size or shared * wanted[order[last]] < wanted[order[first]]:
                part = own[order[first:last]]
                yield _Group(scene, _modes(scene, part, used), int(np.ceil(wanted[order[first]])), part)
                first = last


def _scenes(plan: Plan, variants: Counts, scheme: Counts) -> Iterator[tuple[SceneModel, Counts]]:
    """Variants that share a scene and a scheme."""
    for scene, own in scenes(plan.study, plan.cases, variants):
        for number in np.unique(scheme[own]):
            yield with_choice(scene, scene.fidelity, 0, SchemeUsed(number)), own[scheme[own] == number]


def _wanted_steps(plan: Plan, scene: SceneModel, variants: Counts, used: Counts) -> Array:
    """(n,) four times the steps that were used; 200 per first period where none were, or too few by order."""
    values = LaneValues(scene.study, plan.cases.columns_of(variants), variants.size)
    periods = values.time_scale(scene.carriages[0].name) * scene.first_omega / (2.0 * np.pi)
    usual = np.maximum(LEAST_STEPS, STEPS_PER_PERIOD * periods)
    if fixed_steps(scene.study, values):
        return np.maximum(MORE_STEPS * used, usual)
    return np.where(used == 0, usual, MORE_STEPS * used)


def _modes(scene: SceneModel, variants: Counts, used: Used) -> int:
    """The largest number of modes that any variant used of the bodies whose modes are chosen."""
    chosen, marched = automatic_bodies(scene), variants[used.steps[variants] > 0]
    if not chosen or not marched.size:
        return MODES_OF_STATICS
    return max(MODES_OF_STATICS, (int(used.modes[marched].max()) - _fixed_modes(scene)) // len(chosen))


def _fixed_modes(scene: SceneModel) -> int:
    """Modes of the bodies whose modes are not chosen."""
    chosen = automatic_bodies(scene)
    return sum(part.modal.omega.size for part in scene.bodies if part.name not in chosen)


def _bucket(plan: Plan, group: _Group) -> Bucket:
    """A group as part of a plan: nothing was told of it, and it is compared with nothing."""
    model = build_model(in_full(group.scene, group.chosen), *group.scene.timing, plan.cases.paths)
    steps, none = _safe_steps(plan, model, group), np.zeros(group.variants.size)
    tables = SceneTables(model, steps, plan.window, refinement=MORE_STEPS, stops="kinks")
    told = Choice(*(none for _ in Choice._fields))
    return Bucket(tables, group.variants, "audit", told, none + steps * model.body_modes, compared="not")


def _safe_steps(plan: Plan, model: SceneModel, group: _Group) -> int:
    """The steps of a group, or more where its many modes could ring otherwise; every four are cut from one."""
    values = LaneValues(model.study, plan.cases.columns_of(group.variants), group.variants.size)
    rules = safe_steps(model, values.time_scale(model.carriages[0].name)) | spring_steps(model, values)
    if model.scheme.stride > 1:
        rules |= {"every mode of a Richardson pair resolved": steps_to_resolve(model, values)}
    least = float(np.minimum(np.max(list(rules.values())), MOST_STEPS))
    return MORE_STEPS * int(np.ceil(max(least, group.steps) / MORE_STEPS))


def in_full(scene: SceneModel, chosen: int) -> Study:
    """The study of a scene with all terms, no envelopes, and twice the modes of every body in use; chosen: modes of
    those bodies whose modes were chosen."""
    changes: dict[str, Any] = {"solver.fidelity": "full", "solver.steps": "auto", "solver.static_correction": True}
    automatic = automatic_bodies(scene)
    for part in scene.bodies:
        own = chosen if part.name in automatic else AUTO_MODES
        found = _more_modes(scene.study.body[part.name], own)
        changes |= {f"body.{part.name}.{key}": value for key, value in found.items()}
    return scene.study.with_values(changes | ({"envelope": {}} if scene.study.envelope else {}))


def _more_modes(body: Body, auto: int) -> dict[str, Any]:
    """Values that give a body twice its modes, or as many as it has; those beyond a list of damping ratios have its
    last one. auto: its modes where the study does not say how many."""
    if isinstance(body, Rigid):
        return {}
    found: dict[str, Any] = {}
    asked = auto if body.modes == "auto" else int(body.modes)
    if isinstance(body, Reduced):
        whole = load_body(body.file).omega.size
        found["modes"] = "auto" if body.modes == "auto" else min(MORE_MODES * asked, whole)
    elif isinstance(body, Frame) and body.interface:
        fixed = min(MORE_MODES * body.fixed_interface_modes, MAX_FIXED_INTERFACE_MODES)
        found |= {"fixed_interface_modes": fixed} | ({} if body.modes == "auto" else {"modes": _capped(asked)})
    else:
        found["modes"] = _capped(asked)
    if isinstance(body.damping_ratio, tuple):
        ratios = list(body.damping_ratio)
        found["damping_ratio"] = ratios + ratios[-1:] * (MAX_MODES - len(ratios))
    return found


def _capped(asked: int) -> int:
    return min(MORE_MODES * asked, MAX_MODES)
