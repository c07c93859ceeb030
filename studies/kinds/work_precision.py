"""What does which accuracy cost? Error against cost of every scheme, number of steps and number of modes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, Strict

from engine.study_file.spec import Spec, ascending, distinct, one_of
from engine.study_file.units import fault
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.lazy_imports import xr
from results_schema.status import Fidelity, Status
from results_schema.variables import axes, declare
from studies.precision import checks
from studies.precision import findings as advice
from studies.precision.checks import slug_of
from studies.precision.pareto import fitted_order, formal_order, fronts
from studies.precision.variables import COMPARED, COORDINATES, MARCHED, QUANTITIES, RESULTS, SCHEMES
from studies.protocol.parts import Piece, Work, usual
from studies.protocol.study import PiecedKind, question_of
from studies.results.findings_common import check_sensors, first_carriage
from studies.results.results import Results

if TYPE_CHECKING:
    from engine.scene.study import Study
    from studies.pictures.common.figures import Figure

STATIC_QUANTITIES = ("displacement", "bending_moment", "shear_force", "stress")
LADDER = (50, 100, 200, 400, 800, 1600, 3200, 6400, 12800, 25600)
MODES = (2, 3, 5, 8, 12, 20, 32, 48)
WANTED = (1e-3, 1e-4, 1e-6)
TOLERANCES = (1e-4, 1e-3, 1e-2)
AUTOMATIC_EXPECTED = 0.8  # s of one choice, half of them for the reference
FLOOR = 30.0  # times the reference's own error: less is no error of a scheme


def _even(count: int) -> int:
    if count % 2:
        raise fault("a Richardson pair halves the number of steps", expected="an even number", received=str(count))
    return count


_Steps = Annotated[int, Field(ge=4, le=1_000_000), AfterValidator(_even)]
_Modes = Annotated[int, Field(ge=1, le=64)]
_Part = Annotated[float, Field(gt=0, lt=1)]
_Scheme = Annotated[str, AfterValidator(one_of(*SCHEMES))]


class Question(Spec):
    """The table [question].

    scenes: name -> other values of the study's scene by dotted key. schemes, step_counts: what is compared, at the
    study's own number of modes. mode_counts: what the schemes of the march are compared at too, against
    reference_modes. wanted: errors for which the report names the cheapest choice. tolerances: for which the program's
    own choice is measured beside them.
    """

    scenes: dict[str, dict[str, Any]] = Field(default={"the scene": {}}, min_length=1)
    schemes: Annotated[tuple[_Scheme, ...], Strict(False), Field(min_length=1), AfterValidator(distinct)] = SCHEMES
    step_counts: Annotated[tuple[_Steps, ...], Strict(False), Field(min_length=1), AfterValidator(ascending)] = LADDER
    mode_counts: Annotated[tuple[_Modes, ...], Strict(False), Field(min_length=1), AfterValidator(ascending)] = MODES
    reference_modes: int = Field(default=64, ge=4, le=64)
    wanted: Annotated[tuple[_Part, ...], Strict(False), Field(min_length=1)] = WANTED
    tolerances: Annotated[tuple[_Part, ...], Strict(False), Field(min_length=1), AfterValidator(ascending)] = TOLERANCES


declare("work-precision", *RESULTS, *COORDINATES)


class WorkPrecision(PiecedKind):
    """The kind "work-precision"."""

    name = "work-precision"
    summary = "error against cost of schemes, steps, modes and static correction; what to take for which accuracy"
    question = "Which scheme, how many steps and how many modes give which accuracy at the least cost?"
    settings = Question

    def check(self, study: Study) -> None:
        """One mass on one smooth way in every scene, and sensors with a static value."""
        from engine.methods.ode import check_smooth
        from studies.precision.precision import scene_model

        asked = question_of(study, Question)
        first_carriage(study)
        check_sensors(study)
        checks.check_wholes(study)
        checks.check_slugs(study, asked)
        checks.check_ladder(study, asked)
        checks.check_solver(study)
        for name, overrides in asked.scenes.items():
            checks.check_overrides(study, name, overrides)
            try:
                check_smooth(scene_model(study, overrides, asked.mode_counts[-1]), STATIC_QUANTITIES)
            except BadInput as error:
                what = f"{error.where.rpartition(': ')[2]}: {error.what}"
                raise error.moved(study.source.where(f"question.scenes.{name}"), what) from None

    def pieces(self, study: Study) -> Sequence[Piece]:
        """Per scene the steps, SciPy's solvers, the modes, and the program's own choices."""
        asked = question_of(study, Question)
        found = []
        for name, overrides in asked.scenes.items():
            for part, (words, seconds) in _parts(asked).items():
                job = partial(_compute, part, study, asked, overrides)
                found.append(Piece(f"{part}-{slug_of(name)}", f"{words}: {name}", job, seconds))
            found.extend(_automatic_pieces(study, asked, name))
        return found

    def gather(self, pieces: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
        """Scenes side by side, with fitted orders and fronts."""
        return _gathered(pieces, question_of(study, Question))

    def findings(self, results: Results) -> list[str]:
        return advice.findings(results.dataset, question_of(results.study, Question).wanted)

    def figures(self, results: Results) -> list[Figure]:
        from studies.pictures import work_precision

        return work_precision.pictures(results.dataset)


KIND = WorkPrecision()


def _parts(asked: Question) -> Mapping[str, tuple[str, float]]:
    """The parts of a scene's work on this machine, each a function of `studies.precision.ladders`: words, expected
    seconds, as two fast cores took."""
    from studies.precision.jax_march import is_there

    found = {
        "steps": ("every scheme over the steps", 3.7),
        "solvers": ("SciPy's solvers on the same equations", 0.8),
        "modes": ("the march over steps and modes", 0.12 * sum(asked.mode_counts)),
    }
    return found | ({"jax": ("average acceleration by jax.vmap", 10.0)} if is_there() else {})


def _compute(part: str, study: Study, asked: Question, overrides: Mapping[str, Any], work: Work) -> xr.Dataset:
    """One piece."""
    from studies.precision import ladders

    if part == "solvers":
        return ladders.solvers(study, overrides, work)
    measured = {"steps": ladders.steps, "modes": ladders.modes, "jax": ladders.by_jax}
    return measured[part](study, overrides, asked, work)


def _automatic_pieces(study: Study, asked: Question, scene: str) -> Iterator[Piece]:
    """The program's own choice for a scene at each tolerance, where it has one."""
    from studies.precision.ladders import automatic, leaves_modes_open

    overrides = asked.scenes[scene]
    if not leaves_modes_open(study.with_values(overrides)):
        return
    for tolerance in asked.tolerances:
        job = partial(automatic, study, overrides, asked, tolerance)
        words = f"the automatic choice at {tolerance:g}: {scene}"
        yield Piece(_automatic_name(scene, tolerance), words, job, AUTOMATIC_EXPECTED)


def _automatic_name(scene: str, tolerance: float) -> str:
    return f"automatic-{slug_of(str(tolerance))}-{slug_of(scene)}"


def _gathered(pieces: Mapping[str, xr.Dataset], asked: Question) -> xr.Dataset:
    def stacked(part: str, name: str) -> Array:
        return np.stack([pieces[f"{part}-{slug_of(scene)}"][name].values for scene in asked.scenes])

    error, floors = stacked("steps", "error"), stacked("steps", "reference_error")
    marched = [place for place, scheme in enumerate(asked.schemes) if scheme in MARCHED]
    total = np.full((len(asked.scenes), len(asked.mode_counts), 2, *error.shape[1:]), np.nan)
    total[:, :, :, marched] = stacked("modes", "error")
    seconds = np.full((*total.shape[:2], *error.shape[1:3]), np.nan)
    seconds[:, :, marched] = stacked("modes", "seconds")
    quantities = list(QUANTITIES)
    order = np.empty((*error.shape[:2], len(quantities)))
    for place in np.ndindex(order.shape):
        s, i, q = place
        formal = formal_order(asked.schemes[i], quantities[q])
        order[place] = fitted_order(asked.step_counts, error[s, i, :, q], float(FLOOR * floors[s, q]), formal)
    values = {
        "error": error,
        "seconds_per_variant": stacked("steps", "seconds"),
        "fitted_order": order,
        "comparison_only": [int(scheme in COMPARED) for scheme in asked.schemes],
        "reference_error": floors,
        "total_error": total,
        "total_seconds_per_variant": seconds,
        "total_reference_error": stacked("modes", "reference_error"),
        "on_front": fronts(total, seconds),
        "solver_error": stacked("solvers", "error"),
        "solver_seconds_per_variant": stacked("solvers", "seconds"),
        **_automatic(pieces, asked),
    }
    told = {"jax": "not installed, so there are no points of jax.vmap"}
    if any(name.startswith("jax-") for name in pieces):
        told = {"jax": "measured"}
        values |= {"jax_error": stacked("jax", "error"), "jax_seconds_per_variant": stacked("jax", "seconds")}
    threads = sorted({int(count) for count in stacked("steps", "threads")})
    told["threads"] = " to ".join(str(count) for count in dict.fromkeys((threads[0], threads[-1])))
    grid = ("scene", "scheme", "step_count")
    diverged = np.isnan(error).all(axis=-1)
    shared = usual(
        grid,
        status=np.where(diverged, int(Status.DIVERGED), int(Status.OK)),
        fidelity=np.full(diverged.shape, int(Fidelity.MASS)),
        modes=np.broadcast_to(stacked("steps", "modes")[:, None, None], diverged.shape),
        steps=np.broadcast_to(asked.step_counts, diverged.shape),
    )
    own = {
        variable.name: variable.holding(
            values[variable.name], (*grid, *variable.dims) if variable.lead == "grid" else variable.dims
        )
        for variable in RESULTS
        if variable.name in values
    }
    return xr.Dataset(shared | own, coords=_coordinates(asked), attrs=told)


def _automatic(pieces: Mapping[str, xr.Dataset], asked: Question) -> dict[str, Any]:
    """The program's own choices over scene and tolerance, where there are any."""
    names = [[_automatic_name(scene, tolerance) for tolerance in asked.tolerances] for scene in asked.scenes]
    if not any(name in pieces for row in names for name in row):
        return {}
    missing = {"error": np.nan, "seconds_per_variant": np.nan, "modes": 0, "steps": 0}
    return {
        f"automatic_{own}": [[float(pieces[name][own]) if name in pieces else none for name in row] for row in names]
        for own, none in missing.items()
    }


def _coordinates(asked: Question) -> dict[str, Any]:
    from studies.precision.ladders import SOLVERS

    named = [f"{method} {tolerance:g}" for method, tolerances in SOLVERS.items() for tolerance in tolerances]
    values = {
        "scene": list(asked.scenes),
        "scheme": list(asked.schemes),
        "step_count": np.array(asked.step_counts, dtype=np.int64),
        "mode_count": np.array(asked.mode_counts, dtype=np.int64),
        "correction": np.array([0, 1], dtype=np.int8),
        "quantity": list(QUANTITIES),
        "solver": named,
        "asked_tolerance": np.array(asked.tolerances),
    }
    known = axes() | {variable.name: variable for variable in COORDINATES}
    return {name: (name, value, known[name].attributes()) for name, value in values.items()}
