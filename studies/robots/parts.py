"""The work of a study of robots on rails: pieces of some variants each, and their dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array, Counts
from results_schema.status import Fidelity
from studies.protocol.converged import HISTORY, Told, labelled
from studies.protocol.parts import Piece, Work, unlabelled
from studies.results.formatting import counted

if TYPE_CHECKING:
    import xarray as xr

    from engine.robots.converge import Converged
    from engine.robots.rails import Rail
    from engine.scene.study import Study
    from engine.scene.sweep import Cases
    from studies.robots.question import Question

PIECE_SECONDS, STEP_SECONDS = 8.0, 4e-5  # of one piece and of a step, about; for sizes of pieces only
LEVELS_TAKEN = 3.0  # times the coarsest level: two levels
BUILD_SECONDS = 0.1  # of a variant's model
COMPONENTS = ("x", "y", "z")
ONE_AT_A_TIME = "one-at-a-time"  # the piece of robots that stand still in turn
BY_MODES = "by-modes"  # that of numbers of modes


def pieces(study: Study, question: Question) -> list[Piece]:
    """The work. Raises BadInput for what cannot be marched."""
    from engine.batch.plan import check_memory
    from engine.robots.converge import Ladder, scheme_of
    from engine.scene.sweep import expand

    cases, base = expand(study), study.without_sweep()
    scheme_of(study)
    ladder = Ladder.of(base, question.duration, question.after)
    each = BUILD_SECONDS + LEVELS_TAKEN * STEP_SECONDS * ladder.duration / ladder.step * len(study.robot) / 3.0
    check_memory(study, cases.size, 8 * cases.size * 40 * len(study.robot))
    size = int(np.clip(2 * PIECE_SECONDS / each, 1, 4096))
    found: list[Piece] = []
    for first in range(0, cases.size, size):
        own = np.arange(first, min(first + size, cases.size), dtype=np.int64)
        compute = partial(_march, study, question, cases, own)
        words = f"{counted(own.size, 'variant')} of {ladder.duration:.4g} s"
        found.append(Piece(f"variants-{len(found):04d}", words, compute, 0.5 * each * own.size + 0.5))
    if question.one_at_a_time and len(study.robot) > 1:
        compute = partial(_without, base, question)
        found.append(Piece(ONE_AT_A_TIME, "robots that stand still in turn", compute, 0.5 * each * len(study.robot)))
    if question.mode_counts:
        compute, seconds = partial(_by_modes, base, question), each * (1.0 + len(question.mode_counts) / 3.0)
        found.append(Piece(BY_MODES, "numbers of modes", compute, seconds))
    return found


def _converged(study: Study, question: Question, work: Work) -> Converged:
    from engine.march.halting import stoppable
    from engine.robots.converge import converge

    with stoppable(work.halted):
        return converge(study, question.duration, question.after, question.zero)


def _march(study: Study, question: Question, cases: Cases, variants: Counts, work: Work) -> xr.Dataset:
    """The results of some variants, on threads."""
    from engine.batch.executors import run_jobs
    from engine.batch.plan import shown

    kept, found = set(shown(study, cases.size).tolist()), dict[int, dict[str, NDArray[Any]]]()

    def job(variant: int) -> None:
        converged = _converged(cases.study_of(study, variant), question, work)
        found[variant] = _numbers(converged) | (_traces(converged) if variant in kept else {})

    run_jobs([partial(job, int(variant)) for variant in variants], work.threads)
    rows = [found[int(variant)] for variant in variants]
    arrays = {
        name: np.stack([row[name] for row in rows if name in row]) for name in {n: 0 for row in rows for n in row}
    }
    return unlabelled(
        arrays | {"number": variants, "kept": np.array([v for v in variants.tolist() if v in kept], np.int64)}
    )


def again(study: Study, question: Question, variants: Counts, work: Work) -> dict[int, tuple[Array, Array] | None]:
    """Observed and told errors of some variants, on threads."""
    from engine.batch.executors import run_jobs
    from engine.march.halting import stoppable
    from engine.robots.converge import observed
    from engine.scene.sweep import expand

    cases, found = expand(study), dict[int, tuple[Array, Array] | None]()

    def job(variant: int) -> None:
        own = cases.study_of(study, variant)
        with stoppable(work.halted):
            found[variant] = observed(own, question.duration, question.after, question.zero)

    run_jobs([partial(job, int(variant)) for variant in variants], work.threads)
    return found


def _numbers(converged: Converged) -> dict[str, NDArray[Any]]:
    numbers = converged.outcome.numbers | {
        "status": np.int8(converged.status),
        "fidelity_used": np.int8(Fidelity.FRAME),
        "steps_used": np.int32(converged.steps),
        "modes_used": np.int32(converged.model.modes),
        "estimated_error": converged.error.astype(np.float32),
        "estimated_error_time": converged.when,
    }
    return {name: np.asarray(value) for name, value in numbers.items()}


def _traces(converged: Converged) -> dict[str, NDArray[Any]]:
    """Histories of a variant."""
    from engine.robots.results import deflections, stations

    outcome = converged.outcome
    kept = stations(outcome)
    return {
        f"{HISTORY}elapsed": outcome.times[kept],
        f"{HISTORY}tool_centre_point": outcome.planned[kept],
        f"{HISTORY}tool_centre_point_error": outcome.error[kept],
        f"{HISTORY}rail_deflection": deflections(converged.model, outcome, kept),
    }


def _without(study: Study, question: Question, work: Work) -> xr.Dataset:
    """Errors of all robots while one of them stands still where it starts, on threads."""
    from engine.batch.executors import run_jobs
    from engine.robots.results import DOING

    rows = dict[str, Array]()

    def job(name: str) -> None:
        alone = _converged(study.with_values({f"robot.{name}.moves": []}), question, work)
        rows[name] = np.fmax.reduce([alone.outcome.numbers[f"error_{doing}"] for doing in DOING])

    run_jobs([partial(job, name) for name in study.robot], work.threads)
    return unlabelled({"error_without": np.stack([rows[name] for name in study.robot])})


def _by_modes(study: Study, question: Question, work: Work) -> xr.Dataset:
    """What numbers of modes change."""
    from engine.march.halting import stoppable
    from engine.robots.converge import by_mode_counts

    counts, how = question.mode_counts, (question.duration, question.after, question.zero)
    with stoppable(work.halted):
        error, doubt = by_mode_counts(study, counts, *how)
    return unlabelled({"error_by_modes": error, "error_by_modes_doubt": doubt})


def gather(parts: Mapping[str, xr.Dataset], study: Study, question: Question, kind: str) -> xr.Dataset:
    """Everything, labelled."""
    from engine.robots.model import build
    from engine.robots.modes import with_open_modes
    from engine.robots.results import are_held, results_of
    from engine.scene.sweep import expand

    model, declared = build(with_open_modes(study.without_sweep())), study.results(kind)
    labels: dict[str, Sequence[str] | Sequence[int]] = {
        "robot": model.robots,
        "rail": list(model.rails),
        "component": COMPONENTS,
    }
    labels["joint"] = [f"link {j}" if j else "rail" for j in range(model.system.coordinate.shape[1])]
    own = dict(parts)
    more = {name: part for piece in (ONE_AT_A_TIME, BY_MODES) if piece in own for name, part in own.pop(piece).items()}
    if "error_without" in more:
        labels["still"] = model.robots
    if "error_by_modes" in more:
        labels["mode_count"] = question.mode_counts
    results = results_of(model)
    tolerance = np.where(are_held(results), study.solver.tolerance, np.nan)
    dataset = labelled(list(own.values()), Told(expand(study), declared, results, tolerance, labels))
    dataset = dataset.assign({str(name): declared[str(name)].holding(part.values) for name, part in more.items()})
    return _with_places(dataset, model.rails, declared) if "rail_deflection" in dataset else dataset


def _with_places(dataset: xr.Dataset, rails: Mapping[str, Rail], declared: Mapping[str, Any]) -> xr.Dataset:
    """The places of every rail whose deflections have histories."""
    most = max(rail.ends.size for rail in rails.values())
    places = np.full((len(rails), most), np.nan)
    for b, rail in enumerate(rails.values()):
        places[b, : rail.ends.size] = rail.ends
    dataset = dataset.assign_coords(rail_end=declared["rail_end"].holding(np.arange(most), ("rail_end",)))
    return dataset.assign(rail_place=declared["rail_place"].holding(places))
