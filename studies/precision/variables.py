"""What an archive of a work-precision study holds, declared."""

from __future__ import annotations

from results_schema.variable import axis, beside
from results_schema.variables import Variable

_POINT = ("scene", "mode_count", "correction", "scheme", "step_count", "quantity")
_WHERE = "history and extremes over the scene's largest static value, contact_force over the weight"
_AUTOMATIC = ("scene", "asked_tolerance")
_CHOSEN = "what is chosen for the scene in a sweep of its mass, speed and damping from half to twice its own"
_NO_CHOICE = "0 where there is no automatic choice"


def _measured(name: str, dims: tuple[str, ...], long_name: str, meaning: str, units: str = "") -> Variable:
    return Variable(name, dims, "float64", units, long_name, meaning, nan_allowed=True, lead="none")


RESULTS = (
    Variable(
        "error",
        ("quantity",),
        long_name="error of the time steps",
        meaning=f"against DOP853 on the same modal equations; {_WHERE}",
        nan_allowed=True,
    ),
    Variable(
        "seconds_per_variant",
        units="s",
        long_name="wall time per variant",
        meaning="in a batch on all threads of this machine, the best of a few; tables of the scene and compiling left "
        "out",
        nan_allowed=True,
    ),
    _measured(
        "fitted_order",
        ("scene", "scheme", "quantity"),
        "power with which the error falls with the steps",
        "slope of a line through the finest three or more errors whose slopes agree with each other and with the "
        "scheme's own order, or five or more on a straight line; NaN where there are none",
    ),
    Variable(
        "comparison_only",
        ("scheme",),
        "int8",
        long_name="whether a scheme is for comparison alone",
        meaning="1: no study can choose it; 0: a scheme of the march",
        lead="none",
    ),
    _measured(
        "reference_error",
        ("scene", "quantity"),
        "error of the reference of `error`",
        "difference of DOP853 with relative tolerances 1e-12 and 1e-10, which is above it",
    ),
    _measured(
        "total_error",
        _POINT,
        "error of the time steps and of the modes together",
        f"against a reference converged in both; {_WHERE}; NaN where it diverged and for comparison-only schemes",
    ),
    _measured(
        "total_seconds_per_variant",
        ("scene", "mode_count", "scheme", "step_count"),
        "wall time per variant",
        "as seconds_per_variant; the static correction costs nothing, as the kernels do the same work without it",
        "s",
    ),
    _measured(
        "total_reference_error",
        ("scene", "quantity"),
        "estimated error of the reference of `total_error`",
        "a third of the change from half as many modes, as errors fall with the second power at least, plus the "
        "change from half as many steps",
    ),
    Variable(
        "on_front",
        _POINT,
        "int8",
        long_name="whether a point is on the Pareto front",
        meaning="1 where no other point of the scene and quantity is both cheaper and better; the error of a point "
        "counts as that of its worst finer step count, so that lucky points do not",
        lead="none",
    ),
    _measured("solver_error", ("scene", "solver", "quantity"), "error of a solver of SciPy", "as `error`"),
    Variable(
        "solver_seconds_per_variant",
        ("scene", "solver"),
        units="s",
        long_name="wall time per variant of a solver",
        meaning="one variant after another on one thread, as these solvers work",
        lead="none",
    ),
    beside(
        "jax_error",
        ("scene", "step_count"),
        "error of histories of average acceleration by jax.vmap",
        "as `error`; only where jax is installed, and up to 4096 steps",
    ),
    beside(
        "jax_seconds_per_variant",
        ("scene", "step_count"),
        "wall time per variant of average acceleration by jax.vmap",
        "in a batch of 256 variants, the best of a few, compiling left out",
        "s",
    ),
    beside(
        "automatic_error",
        _AUTOMATIC,
        "error of histories of the automatic choice",
        f"as the history of `total_error`, of {_CHOSEN}; NaN where the number of modes cannot be left open",
    ),
    beside(
        "automatic_seconds_per_variant",
        _AUTOMATIC,
        "wall time per variant of the automatic choice",
        "as seconds_per_variant, of the march alone: the pilots that the choice is measured by are left out",
        "s",
    ),
    *(
        Variable(f"automatic_{name}", _AUTOMATIC, "int32", "", words, _NO_CHOICE, required=False, lead="none")
        for name, words in (
            ("modes", "modes of the automatic choice"),
            ("steps", "steps of the automatic choice over one passage or cycle"),
        )
    ),
)
COORDINATES = (
    axis("scene", "scene", dtype="str"),
    axis("correction", "whether the static correction is added", dtype="int8", meaning="1 with, 0 without"),
    axis("solver", "solver of SciPy and its relative tolerance", dtype="str"),
    axis("asked_tolerance", "tolerance asked of the automatic choice", meaning="`solver.tolerance`"),
)
