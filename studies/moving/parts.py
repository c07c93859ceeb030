"""The work of a study of bodies in moving frames: pieces of some variants each, and their dataset."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array, Counts
from results_schema.errors import BadInput
from studies.moving.ways import refuse_ways
from studies.protocol.converged import HISTORY, Told, labelled
from studies.protocol.parts import Piece, Took, Work, unlabelled
from studies.results.formatting import counted
from studies.results.places import spread

if TYPE_CHECKING:
    import xarray as xr

    from engine.floating.converge import Converged
    from engine.floating.model import FloatingModel
    from engine.floating.model_choice import Rung
    from engine.scene.study import Study
    from engine.scene.sweep import Cases

PIECE_SECONDS = 8.0  # of one piece, about
STEP_SECONDS, COORDINATE_SECONDS = 5e-7, 3e-7  # of a step, and for each coordinate besides; for sizes of pieces only
LEVELS_TAKEN = 3.0  # times the coarsest level: two levels
AUDIT_SECONDS = 4.0  # of an audited variant over one of a run: a level beyond, in lanes of which most stand empty
NEWTON_STEPS = 4  # from a straight line, for roots to rounding
BLOCKS = 4  # of lanes in one job at most: those that need more steps fill the lanes anew
COMPONENTS, QUATERNION = ("x", "y", "z"), ("w", "x", "y", "z")


@dataclass(frozen=True, eq=False)
class Scene:
    """Variants (flat numbers) that share a model; study: with the numbers of the first of them."""

    study: Study
    variants: Counts


def scenes(study: Study, cases: Cases) -> list[Scene]:
    """The distinct scenes of a sweep: those whose numbers are not all numbers that a variant may have to itself."""
    from engine.floating.lanes import OWN_KEYS

    shared = [axis.dim for axis in cases.axes if not all(OWN_KEYS.fullmatch(path) for path in axis.paths)]
    everything = np.arange(cases.size, dtype=np.int64)
    if not shared:
        return [Scene(study.without_sweep(), everything)]
    positions = cases.positions(everything)
    codes = np.unique(np.stack([positions[dim] for dim in dict.fromkeys(shared)]), axis=1, return_inverse=True)[1]
    codes = codes.reshape(-1)
    groups = [everything[codes == code] for code in range(codes.max() + 1)]
    return [Scene(cases.study_of(study, int(own[0])), own) for own in groups]


def pieces(study: Study, duration: Callable[[Mapping[str, Array], int], Array]) -> list[Piece]:
    """The work; duration: (V,) s of variants by their columns. Raises BadInput for what cannot be marched."""
    from engine.batch.plan import check_memory
    from engine.floating.converge import levels
    from engine.floating.model import build
    from engine.floating.model_choice import FIRST_MODES
    from engine.scene.sweep import expand

    _check_steps(study)
    cases = expand(study)
    model = build(study.without_sweep(), 2)
    check_memory(study, cases.size, 8 * cases.size * (len(results_names(model)) + 40))
    found: list[Piece] = []
    together = scenes(study, cases)
    refuse_ways(study, cases, together, duration)
    for scene in together:
        longest = float(duration(cases.columns_of(scene.variants), scene.variants.size).max())
        coarsest = next(iter(levels(scene.study, longest, FIRST_MODES)), None)
        if coarsest is None:
            raise _too_many_steps(scene.study, build(scene.study, FIRST_MODES).first_omega, longest)
        each = coarsest.steps * LEVELS_TAKEN * (STEP_SECONDS + COORDINATE_SECONDS * coarsest.model.size)
        size = int(np.clip(2 * PIECE_SECONDS / each, 1, 4096))
        for first in range(0, scene.variants.size, size):
            own = scene.variants[first : first + size]
            words = f"{counted(own.size, 'variant')} over {longest:.4g} s"
            compute = partial(_march, scene, cases, own, duration, longest)
            found.append(Piece(f"variants-{len(found):04d}", words, compute, 0.5 * each * own.size + 0.5))
    return found


def _too_many_steps(study: Study, omega: float, longest: float) -> BadInput:
    """What is refused whose first mode already is too fast for a march."""
    from engine.floating.converge import MOST_STEPS

    return study.source.fault(
        "body",
        "a march of bodies as stiff and light as these would take more steps than any may",
        expected=f"at most {MOST_STEPS:,} steps",
        received=f"a first frequency of {omega / (2.0 * np.pi):.3g} Hz over {longest:.4g} s",
        remedy="look at the units of moduli, second moments, areas and densities",
    )


def _check_steps(study: Study) -> None:
    """Refuse a sweep of steps: histories have as many stations in all variants. Raises BadInput."""
    from engine.scene.variants import STEPS

    for name, axis in study.sweep.axes.items():
        if STEPS in axis.of:
            what, remedy = "variants of frames that move share their steps", "a study for each number of steps"
            raise study.source.fault(f"sweep.{name}.of", what, received=STEPS, remedy=remedy)


def results_names(model: FloatingModel) -> list[str]:
    """Names of the results whose errors are told."""
    from engine.floating.results import results_of

    return [result.name for result in results_of(model)]


@lru_cache(maxsize=4)  # the pieces of a scene ask in turn
def _rung(scene: Scene, cases: Cases, duration: Callable[[Mapping[str, Array], int], Array], longest: float) -> Rung:
    """The model of a scene, by pilots all over it, whichever of its variants are marched."""
    from engine.floating.model_choice import PILOTS, choose
    from engine.scene.variants import VariantValues

    pilots = scene.variants[spread(scene.variants.size, PILOTS)]
    columns = cases.columns_of(pilots)
    return choose(
        scene.study, VariantValues(scene.study, columns, pilots.size), duration(columns, pilots.size), longest
    )


def _march(
    scene: Scene,
    cases: Cases,
    variants: Counts,
    duration: Callable[[Mapping[str, Array], int], Array],
    longest: float,
    work: Work,
) -> xr.Dataset:
    """The results of some variants of one scene, whose longest takes so many seconds, on threads."""
    from engine.batch.executors import run_jobs
    from engine.batch.plan import shown
    from engine.floating.converge import converge
    from engine.floating.model import build
    from engine.kernels.layout import LANES
    from engine.march.halting import stoppable
    from engine.scene.variants import VariantValues

    with stoppable(work.halted):
        study, rung = scene.study, _rung(scene, cases, duration, longest)
    model = build(study, 2)
    kept = shown(study, cases.size)
    found: dict[int, dict[str, NDArray[Any]]] = {}
    at_once = LANES * int(np.clip(np.ceil(variants.size / (LANES * work.threads)), 1, BLOCKS))

    def job(first: int) -> None:
        own = variants[first : first + at_once]
        columns = cases.columns_of(own)
        values = VariantValues(study, columns, own.size)
        with stoppable(work.halted):
            converged = converge(study, values, duration(columns, own.size), longest, rung)
        found[first] = _arrays(model, converged, np.flatnonzero(np.isin(own, kept)), own)

    run_jobs([partial(job, first) for first in range(0, variants.size, at_once)], work.threads)
    parts = [found[first] for first in sorted(found)]
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return unlabelled({name: array for name, array in whole.items() if array.size})  # none may have a history


def seconds_of_marches(modes: Counts, steps: Counts) -> Took:
    """Seconds, about, of the marches of variants with so many modes and steps, and of one audited variant, alone in its
    lanes: the same once more, and a level beyond with more modes."""
    from engine.floating.converge import MORE_MODES
    from engine.kernels.layout import LANES

    each = LEVELS_TAKEN / 2.0 * steps * (STEP_SECONDS + COORDINATE_SECONDS * modes)
    beyond = 2.0 * steps * (STEP_SECONDS + COORDINATE_SECONDS * MORE_MODES * modes)
    return Took(float(max(each.sum(), LANES * each.max())), LANES * float((each + beyond).max()))


def again(
    study: Study, duration: Callable[[Mapping[str, Array], int], Array], variants: Counts, work: Work
) -> dict[int, tuple[Array, Array] | None]:
    """Observed and told errors of some variants, scene by scene on threads."""
    from engine.batch.executors import run_jobs
    from engine.floating.converge import observed
    from engine.march.halting import stoppable
    from engine.scene.sweep import expand
    from engine.scene.variants import VariantValues

    cases, found = expand(study), dict[int, tuple[Array, Array] | None]()

    def job(scene: Scene) -> None:
        own = scene.variants[np.isin(scene.variants, variants)]
        longest = float(duration(cases.columns_of(scene.variants), scene.variants.size).max())
        columns = cases.columns_of(own)
        values = VariantValues(scene.study, columns, own.size)
        with stoppable(work.halted):
            rung = _rung(scene, cases, duration, longest)
            apart, told = observed(scene.study, values, duration(columns, own.size), longest, rung)
        for lane, variant in enumerate(own.tolist()):
            known = bool(np.isfinite(apart[:, lane]).any())
            found[variant] = (apart[:, lane], told[:, lane]) if known else None

    ours = [scene for scene in scenes(study, cases) if np.isin(scene.variants, variants).any()]
    run_jobs([partial(job, scene) for scene in ours], work.threads)
    return found


def _arrays(model: FloatingModel, converged: Converged, kept: Counts, own: Counts) -> dict[str, NDArray[Any]]:
    """Results of V variants by name, and the histories of some of them."""
    from engine.floating.results import ends, frame_signals, signals
    from engine.kernels.floating.observe import BODY_ATTITUDE, BODY_SPIN, BODY_VELOCITY, OF_BODY
    from engine.march.outcome import number_of

    outcome, error = converged.outcome, converged.error
    found: dict[str, NDArray[Any]] = {
        "number": own,
        **outcome.numbers,
        "status": converged.status,
        "modes_used": converged.modes,
        "steps_used": converged.steps,
        "fidelity_used": np.full(own.size, int(converged.fidelity), dtype=np.int8),
        "scheme_used": np.full(own.size, int(number_of(converged.scheme)), dtype=np.int8),
        # where a finer march gives up no estimate exists
        "estimated_error": np.ascontiguousarray(np.where(np.isinf(error), np.nan, error).T, dtype=np.float32),
    }
    history, times = outcome.history[kept], outcome.times[kept]
    for name in model.places:
        number = next(signal.number for signal in signals(model) if signal.name == f"{name}_position")
        place, speed = outcome.history[:, :, number], outcome.history[:, :, number + 1]
        found[f"{name}_period"] = periods(outcome.times, place, speed)
    stations, bodies, whole = history.shape[1], len(model.bodies), model.signal_of("whole")
    frames = history[:, :, frame_signals(model)].reshape(kept.size, stations, bodies, OF_BODY)
    traces = {
        "elapsed": times,
        **{signal.name: history[:, :, signal.number] for signal in signals(model)},
        "end_place": history[:, :, ends(model)].reshape(kept.size, stations, bodies, 3),
        "frame_place": frames[..., 0:3],
        "frame_velocity": frames[..., BODY_VELOCITY : BODY_VELOCITY + 3],
        "frame_rate": frames[..., BODY_SPIN : BODY_SPIN + 3],
        "frame_attitude": quaternions(frames[..., BODY_ATTITUDE : BODY_ATTITUDE + 9]),
        "kinetic_energy": history[:, :, whole],
        "potential_energy": history[:, :, whole + 1],
        "momentum": history[:, :, whole + 2 : whole + 5],
        "angular_momentum": history[:, :, whole + 5 : whole + 8],
    }
    return found | {"kept": own[kept]} | {f"{HISTORY}{name}": array for name, array in traces.items()}


def quaternions(rows: Array) -> Array:
    """Attitudes (..., 9) as quaternions (..., 4), scalar first and not negative; NaN stays."""
    from scipy.spatial.transform import Rotation

    found = np.full((*rows.shape[:-1], 4), np.nan)
    known = np.isfinite(rows).all(axis=-1)
    if known.any():
        found[known] = Rotation.from_matrix(rows[known].reshape(-1, 3, 3)).as_quat(canonical=True, scalar_first=True)
    return found


def periods(times: Array, places: Array, speeds: Array) -> Array:
    """(V,) mean times of two passes of the middle of a way, s, of histories (V, stations), cubic between two stations;
    NaN where there are less than three passes."""
    highest, lowest = (np.fmax.reduce(side * places, axis=1)[:, None] for side in (1.0, -1.0))
    gap = places - 0.5 * (highest - lowest)
    side = np.sign(gap)
    own, k = np.nonzero(side[:, :-1] * side[:, 1:] <= 0.0)
    own, k = own[gap[own, k] != 0.0], k[gap[own, k] != 0.0]
    h = times[own, k + 1] - times[own, k]
    ends = gap[own, k], gap[own, k + 1], h * speeds[own, k], h * speeds[own, k + 1]
    one, other, start, end = ends
    x = one / (one - other)
    for _ in range(NEWTON_STEPS):  # of the cubic with these values and slopes
        bend, curve = 3.0 * (other - one) - 2.0 * start - end, 2.0 * (one - other) + start + end
        x -= (one + x * (start + x * (bend + x * curve))) / (start + x * (2.0 * bend + x * 3.0 * curve))
    passes, everyone = times[own, k] + x * h, np.arange(len(times))
    first, behind = np.searchsorted(own, everyone), np.searchsorted(own, everyone, "right")
    found = np.full(len(times), np.nan)
    known = behind - first > 2
    whole = passes[behind[known] - 1] - passes[first[known]]
    found[known] = 2.0 * whole / (behind - first - 1)[known]
    return found


def gather(parts: Mapping[str, xr.Dataset], study: Study, kind: str) -> xr.Dataset:
    """Everything, labelled."""
    from engine.floating.model import build
    from engine.floating.results import results_of
    from engine.scene.sweep import expand

    model, declared = build(study.without_sweep(), 2), study.results(kind)
    results = results_of(model)
    labels = {"frame": list(model.bodies), "component": COMPONENTS, "quaternion": QUATERNION}
    if study.sensor:
        labels["sensor"] = list(study.sensor)
    tolerance = np.array([result.tolerance for result in results])
    told = Told(expand(study), declared, [result.name for result in results], tolerance, labels)
    return labelled(list(parts.values()), told)
