"""References for the calibration of the choice of models: the full model with many modes and steps, by Fox-Goodwin.

Its period error is (omega h)^4/480 where average acceleration's is (omega h)^2/12. Every variant is marched twice, the
second time with fewer modes and steps; how far the two are apart bounds the error of the first. Where that is too far
both are marched again with more modes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from engine.bucket import uncompared
from engine.execution import execute
from engine.fidelity import needed_steps
from engine.lanes import LaneValues
from engine.model import SceneModel, build_model
from engine.ode import ModalEquations, check_smooth
from engine.plan import Plan, make_plan
from engine.resonance import spring_steps
from engine.scene import Study
from engine.signals import silent
from engine.tables import SceneTables
from results_schema.errors import BadInput
from studies.audit import Again, Pair, _differences, _scale
from studies.study import kind_named
from tests.calibration.choice_scenes import LANES, Scene

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Arrays = dict[str, NDArray[Any]]

SCHEME = "fox-goodwin"
MODES, MOMENT_MODES = (40, 64), 64  # in turn, until the companion is near; with a bending moment
SURE = 3e-5  # apart: near
SLOW = 0.05  # alpha below which high modes hardly move, so that fewer tell as much; their steps would be many
SLOW_MODES, SLOW_SPAN = (
    (12, 20),
    450.0,
)  # of slow variants: least and most modes, up to so many times the first frequency
EXACT = 1e-10  # tolerance of DOP853
EXACT_MODES = 12


class Fineness(NamedTuple):
    """How finely variants are marched: modes, steps per passage or cycle at least, and times the rules' steps."""

    modes: int
    least: int
    finer: float = 1.0

    @property
    def companion(self) -> Self:
        """Fewer modes and steps."""
        return self._replace(modes=7 * self.modes // 10, least=self.least // 2)


@dataclass(frozen=True, eq=False)
class Reference:
    """Results (V, ...) of a scene by name, those of the coarser companion, and sensors that say nothing."""

    results: Arrays
    rough: Arrays
    silent: NDArray[np.bool_]

    def save(self, path: Path) -> None:
        """Write it to a file."""
        named = {f"results:{name}": array for name, array in self.results.items()}
        named |= {f"rough:{name}": array for name, array in self.rough.items()}
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, silent=self.silent, **named)

    @classmethod
    def load(cls, path: Path) -> Reference:
        """Read it from a file."""
        with np.load(path) as found:
            parts: list[Arrays] = [
                {name.removeprefix(part): found[name] for name in found.files if name.startswith(part)}
                for part in ("results:", "rough:")
            ]
            return cls(*parts, found["silent"])


def fineness(scene: Scene, slow: bool) -> tuple[Fineness, ...]:
    """Of references, coarse before fine. A moment has a kink where the load passes: it wants many stations."""
    least = 40_000 if scene.reads_moment else 20_000
    slow_modes = (_slow_modes(scene),) if slow else ()
    many = (MOMENT_MODES,) if scene.reads_moment and not slow else MODES
    return tuple(Fineness(modes, least) for modes in (*slow_modes, *many))


def _slow_modes(scene: Scene) -> int:
    """Modes up to a frequency that nothing slow excites: 20 of a pinned beam, fewer where the first is low."""
    omega = full_model(plan_of(scene.study()), SLOW_MODES[1], SCHEME).omega
    return int(np.clip(np.count_nonzero(omega <= SLOW_SPAN * omega[0]), *SLOW_MODES))


def reference_of(scene: Scene, folder: Path | None) -> Reference:
    """The reference of a scene, found in a folder or kept there."""
    path = None if folder is None else folder / f"{scene.seed}-{scene.number}-{scene.study().source.sha256[:16]}.npz"
    if path is not None and path.exists():
        return Reference.load(path)
    first = finer_plan(scene.study(), Fineness(20, 200)).buckets[0]
    found = Reference({}, {}, silent(first.scene, first.tables.sensors))
    refine(scene, found, 0)
    if path is not None:
        found.save(path)
    return found


def refine(scene: Scene, found: Reference, first: int) -> None:
    """Fill a reference, and its companion, from a place in the order of `fineness` on: first all variants, then those
    that are not near their companion."""
    wanting = np.ones(LANES, dtype=np.bool_) if first == 0 else gaps(scene, found) > SURE
    slow = scene.alpha < SLOW
    for turn in range(first, 1 + len(MODES)):
        for group in (slow, ~slow):
            variants, fine = np.flatnonzero(wanting & group), fineness(scene, group is slow)[turn : turn + 1]
            for wanted in fine if variants.size else ():
                _fill(found.results, variants, march(finer_plan(scene.study(variants), wanted)))
                _fill(found.rough, variants, march(finer_plan(scene.study(variants), wanted.companion)))
        wanting = gaps(scene, found) > SURE


def gaps(scene: Scene, reference: Reference) -> Array:
    """(V,) how far a reference is from its companion."""
    return largest(compared(scene, reference.rough, reference.results, reference.silent))


def _fill(arrays: Arrays, variants: Counts, found: Arrays) -> None:
    for name, array in found.items():
        if name not in arrays:
            arrays[name] = np.zeros((LANES, *array.shape[1:]), dtype=array.dtype)
        arrays[name][variants] = array


def finer_plan(study: Study, wanted: Fineness) -> Plan:
    """A plan with one bucket: the full model of all variants with the steps that the slowest needs."""
    plan = plan_of(study)
    model = full_model(plan, wanted.modes, SCHEME)
    steps = wanted.finer * max(wanted.least, float(steps_by_rules(plan, model).max()))
    variants = np.arange(plan.size)
    bucket = uncompared(SceneTables(model, int(np.ceil(steps)), plan.window), variants, "reference")
    return replace(plan, buckets=(bucket,), shown=variants[:0])


def plan_of(study: Study) -> Plan:
    """The plan of a study as its kind wants it."""
    return make_plan(study, reduction=kind_named(study.kind).reduction(study))  # type: ignore[union-attr]


def full_model(plan: Plan, modes: int, scheme: str) -> SceneModel:
    """The full model of a plan's scene, with so many modes."""
    changes = {"body.bed.modes": modes, "solver.scheme": scheme, "solver.fidelity": "full"}
    return build_model(plan.base.study.with_values(changes), *plan.base.timing, plan.cases.paths)


def steps_by_rules(plan: Plan, model: SceneModel) -> Array:
    """(V,) steps that all rules of a model ask for."""
    values = LaneValues(model.study, plan.cases.columns_of(np.arange(plan.size)), plan.size)
    rules = {"needed": needed_steps(model, values.time_scale("car")).total, **spring_steps(model, values)}
    return np.asarray(np.max(np.stack(list(rules.values())), axis=0))


def march(plan: Plan) -> Arrays:
    """Results (V, ...) of a plan by name."""
    found = Again(np.arange(plan.size))
    execute(plan, found.add, threads=1)
    return found.arrays


def compared(scene: Scene, reported: Arrays, again: Arrays, quiet: NDArray[np.bool_]) -> dict[str, Array]:
    """(V, J) relative differences by the names of results, as in an audit."""
    plan = plan_of(scene.study())
    values = LaneValues(plan.study, plan.cases.columns_of(np.arange(plan.size)), plan.size)
    sensors = tuple(scene.sensors)
    pair = Pair(sensors, reported, again, _scale(sensors, again), np.tile(quiet, (plan.size, 1)), values)
    return _differences(pair, plan.reduction)


def largest(differences: dict[str, Array]) -> Array:
    """(V,) the largest difference of all results and sensors; NaN where one is unknown."""
    return np.asarray(np.stack(list(differences.values()), axis=1).max(axis=(1, 2)))


def against_finer(scene: Scene, reference: Reference) -> Array:
    """(V,) how far the reference is from a march with 1.6 times its modes, at most 64, and many more steps."""
    still: Arrays = {}
    for slow in (True, False):
        variants, fine = np.flatnonzero((scene.alpha < SLOW) == slow), fineness(scene, slow)[0]
        if variants.size:
            finer = Fineness(min(64, fine.modes * 8 // 5), 2 * fine.least, 1.7 if fine.modes == MOMENT_MODES else 1.3)
            _fill(still, variants, march(finer_plan(scene.study(variants), finer)))
    return largest(compared(scene, reference.results, still, reference.silent))


def against_exact(scene: Scene) -> float | None:
    """How far extremes of displacements are from DOP853 with as many modes, in the fastest variant, over the largest
    static value; None where its equations do not describe the scene."""
    variant = np.array([int(scene.alpha.argmax())])
    plan = finer_plan(scene.study(variant), Fineness(EXACT_MODES, 20_000))
    model = full_model(finer_plan(_single(scene, variant), Fineness(EXACT_MODES, 200)), EXACT_MODES, SCHEME)
    try:
        check_smooth(model, ("displacement", "bending_moment"))
    except BadInput:
        return None
    tables = SceneTables(model, plan.buckets[0].steps, plan.window)
    counts = np.arange(tables.timeline.window[0], tables.timeline.window[1] + 1)
    equations = ModalEquations(model)
    solved = equations.solve("DOP853", EXACT)
    readings = equations.readings(tables, counts, solved.states(tables.timeline.moments(counts)[1]))
    found = march(plan)
    gaps = [
        abs(float(found[f"{name}_{end}"][0]) - float(pick(readings[:, number]))) / float(found[f"{name}_static"][0])
        for number, name in enumerate(scene.sensors)
        for end, pick in (("max", np.nanmax), ("min", np.nanmin))
    ]
    return max(gaps)


def _single(scene: Scene, variant: Counts) -> Study:
    """One variant as a study without a sweep."""
    plan = plan_of(scene.study(variant))
    return plan.cases.study_of(plan.study, 0)
