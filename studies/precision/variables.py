"""What an archive of a work-precision study holds, declared."""

from __future__ import annotations

from results_schema.variables import Variable

_POINT = ("scene", "mode_count", "correction", "scheme", "step_count", "quantity")
_WHERE = "history and extremes over the scene's largest static value, contact_force over the weight"
ERROR = Variable(
    "error",
    ("quantity",),
    long_name="error of the time steps",
    meaning=f"against DOP853 on the same modal equations; {_WHERE}",
    nan_allowed=True,
)
SECONDS = Variable(
    "seconds_per_variant",
    units="s",
    long_name="wall time per variant",
    meaning="in a batch on all threads of this machine, the best of a few; tables of the scene and compiling left out",
    nan_allowed=True,
)
ORDER = Variable(
    "fitted_order",
    ("scene", "scheme", "quantity"),
    long_name="power with which the error falls with the steps",
    meaning="slope of a line through the finest three or more errors whose slopes agree with each other and with the "
    "scheme's own order, or five or more on a straight line; NaN where there are none",
    lead="none",
    nan_allowed=True,
)
COMPARISON_ONLY = Variable(
    "comparison_only",
    ("scheme",),
    "int8",
    long_name="whether a scheme is for comparison alone",
    meaning="1: no study can choose it; 0: a scheme of the march",
    lead="none",
)
REFERENCE_ERROR = Variable(
    "reference_error",
    ("scene", "quantity"),
    long_name="error of the reference of `error`",
    meaning="difference of DOP853 with relative tolerances 1e-12 and 1e-10, which is above it",
    lead="none",
    nan_allowed=True,
)
TOTAL_ERROR = Variable(
    "total_error",
    _POINT,
    long_name="error of the time steps and of the modes together",
    meaning=f"against a reference converged in both; {_WHERE}; NaN where it diverged and for comparison-only schemes",
    lead="none",
    nan_allowed=True,
)
TOTAL_SECONDS = Variable(
    "total_seconds_per_variant",
    ("scene", "mode_count", "scheme", "step_count"),
    units="s",
    long_name="wall time per variant",
    meaning="as seconds_per_variant; the static correction costs nothing, as the kernels do the same work without it",
    lead="none",
    nan_allowed=True,
)
TOTAL_REFERENCE_ERROR = Variable(
    "total_reference_error",
    ("scene", "quantity"),
    long_name="estimated error of the reference of `total_error`",
    meaning="a third of the change from half as many modes, as errors fall with the second power at least, plus the "
    "change from half as many steps",
    lead="none",
    nan_allowed=True,
)
ON_FRONT = Variable(
    "on_front",
    _POINT,
    "int8",
    long_name="whether a point is on the Pareto front",
    meaning="1 where no other point of the scene and quantity is both cheaper and better; the error of a point counts "
    "as that of its worst finer step count, so that lucky points do not",
    lead="none",
)
SOLVER_ERROR = Variable(
    "solver_error",
    ("scene", "solver", "quantity"),
    long_name="error of a solver of SciPy",
    meaning="as `error`",
    lead="none",
    nan_allowed=True,
)
SOLVER_SECONDS = Variable(
    "solver_seconds_per_variant",
    ("scene", "solver"),
    units="s",
    long_name="wall time per variant of a solver",
    meaning="one variant after another on one thread, as these solvers work",
    lead="none",
)
JAX_ERROR = Variable(
    "jax_error",
    ("scene", "step_count"),
    long_name="error of histories of average acceleration by jax.vmap",
    meaning="as `error`; only where jax is installed, and up to 4096 steps",
    lead="none",
    required=False,
    nan_allowed=True,
)
JAX_SECONDS = Variable(
    "jax_seconds_per_variant",
    ("scene", "step_count"),
    units="s",
    long_name="wall time per variant of average acceleration by jax.vmap",
    meaning="in a batch of 256 variants, the best of a few, compiling left out",
    lead="none",
    required=False,
    nan_allowed=True,
)
_AUTOMATIC = ("scene", "asked_tolerance")
_CHOSEN = "what is chosen for the scene in a sweep of its mass, speed and damping from half to twice its own"
AUTOMATIC_ERROR = Variable(
    "automatic_error",
    _AUTOMATIC,
    long_name="error of histories of the automatic choice",
    meaning=f"as the history of `total_error`, of {_CHOSEN}; NaN where the number of modes cannot be left open",
    lead="none",
    required=False,
    nan_allowed=True,
)
AUTOMATIC_SECONDS = Variable(
    "automatic_seconds_per_variant",
    _AUTOMATIC,
    units="s",
    long_name="wall time per variant of the automatic choice",
    meaning="as seconds_per_variant, of the march alone: the pilots that the choice is measured by are left out",
    lead="none",
    required=False,
    nan_allowed=True,
)
AUTOMATIC_MODES = Variable(
    "automatic_modes",
    _AUTOMATIC,
    "int32",
    long_name="modes of the automatic choice",
    meaning="0 where there is no automatic choice",
    lead="none",
    required=False,
)
AUTOMATIC_STEPS = Variable(
    "automatic_steps",
    _AUTOMATIC,
    "int32",
    long_name="steps of the automatic choice over one passage or cycle",
    meaning="0 where there is no automatic choice",
    lead="none",
    required=False,
)
AUTOMATIC = {
    "error": AUTOMATIC_ERROR,
    "seconds": AUTOMATIC_SECONDS,
    "modes": AUTOMATIC_MODES,
    "steps": AUTOMATIC_STEPS,
}
RESULTS = (
    *(ERROR, SECONDS, ORDER, COMPARISON_ONLY, REFERENCE_ERROR, TOTAL_ERROR, TOTAL_SECONDS, TOTAL_REFERENCE_ERROR),
    *(ON_FRONT, SOLVER_ERROR, SOLVER_SECONDS, JAX_ERROR, JAX_SECONDS),
    *AUTOMATIC.values(),
)


def _axis(name: str, long_name: str, dtype: str, meaning: str = "") -> Variable:
    return Variable(name, (name,), dtype, "", long_name, meaning, required=False, lead="none")


COORDINATES = (
    _axis("scene", "scene", "str"),
    _axis("correction", "whether the static correction is added", "int8", "1 with, 0 without"),
    _axis("solver", "solver of SciPy and its relative tolerance", "str"),
    _axis("asked_tolerance", "tolerance asked of the automatic choice", "float64", "`solver.tolerance`"),
)
