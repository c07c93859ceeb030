"""What a work-precision study compares, and what its archive holds, declared."""

from results_schema.variable import outputs

#: Schemes in words: those of the march, and those that are offered for comparison alone.
MARCHED = {
    "average-acceleration": "average acceleration",
    "linear-acceleration": "linear acceleration",
    "fox-goodwin": "Fox-Goodwin",
    "scaled-fox-goodwin": "Fox-Goodwin with scaled masses",
    "central-difference": "central difference",
    "hht-alpha": "HHT-alpha (\N{MINUS SIGN}0.05)",
    "generalized-alpha": "generalized-alpha (0.8)",
    "richardson": "a Richardson pair",
}
COMPARED = {
    "wilson-theta": "Wilson-theta",
    "rk4": "Runge-Kutta 4",
    "lagged-inertia": "lagged inertia",
    "lagged-convective": "lagged convective terms",
    "picard": "Picard iteration",
    "picard-relaxed": "relaxed Picard iteration",
}
SCHEMES = (*MARCHED, *COMPARED)
QUANTITIES = {"history": "whole histories", "extremes": "largest values", "contact_force": "the contact force"}

RESULTS = outputs("""
    error | quantity | | nan | error of the time steps
        against DOP853 on the same modal equations; history and extremes over the scene's largest static value,
        contact_force over the weight
    seconds_per_variant | | s | nan | wall time per variant
        in a batch on all threads of this machine, the best of a few; tables of the scene and compiling left out
    fitted_order | scene scheme quantity | | alone nan | power with which the error falls with the steps
        slope of a line through the finest three or more errors whose slopes agree with each other and with the scheme's
        own order, or five or more on a straight line; NaN where there are none
    comparison_only | scheme | | alone int8 | whether a scheme is for comparison alone
        1: no study can choose it; 0: a scheme of the march
    reference_error | scene quantity | | alone nan | error of the reference of `error`
        difference of DOP853 with relative tolerances 1e-12 and 1e-10, which is above it
    total_error | scene mode_count correction scheme step_count quantity | | alone nan |
        error of the time steps and of the modes together
        against a reference converged in both; history and extremes over the scene's largest static value, contact_force
        over the weight; NaN where it diverged and for comparison-only schemes
    total_seconds_per_variant | scene mode_count scheme step_count | s | alone nan | wall time per variant
        as seconds_per_variant, with the static correction, without which a mass has one coordinate less
    total_reference_error | scene quantity | | alone nan | estimated error of the reference of `total_error`
        a third of the change from half as many modes, as errors fall with the second power at least, plus the change
        from half as many steps
    on_front | scene mode_count correction scheme step_count quantity | | alone int8 |
        whether a point is on the Pareto front
        1 where no other point of the scene and quantity is both cheaper and better; the error of a point counts as that
        of its worst finer step count, so that lucky points do not
    solver_error | scene solver quantity | | alone nan | error of a solver of SciPy
        as `error`
    solver_seconds_per_variant | scene solver | s | alone | wall time per variant of a solver
        one variant after another on one thread, as these solvers work
    jax_error | scene step_count | | optional alone nan | error of histories of average acceleration by jax.vmap
        as `error`; only where jax is installed, and up to 4096 steps
    jax_seconds_per_variant | scene step_count | s | optional alone nan |
        wall time per variant of average acceleration by jax.vmap
        in a batch of 256 variants, the best of a few, compiling left out
    automatic_error | scene asked_tolerance | | optional alone nan | error of histories of the automatic choice
        as the history of `total_error`, of what is chosen for the scene in a sweep of its mass, speed and damping from
        half to twice its own; NaN where the number of modes cannot be left open
    automatic_seconds_per_variant | scene asked_tolerance | s | optional alone nan |
        wall time per variant of the automatic choice
        as seconds_per_variant, of the march alone: the pilots that the choice is measured by are left out
    automatic_modes | scene asked_tolerance | | optional alone int32 | modes of the automatic choice
        0 where there is no automatic choice
    automatic_steps | scene asked_tolerance | | optional alone int32 |
        steps of the automatic choice over one passage or cycle
        0 where there is no automatic choice
""")
COORDINATES = outputs("""
    * | | | axis |
    scene | | | str | scene
    correction | | | int8 | static correction
        1 with, 0 without
    solver | | | str | solver
        of SciPy, and its relative tolerance
    asked_tolerance | | | | tolerance asked
        `solver.tolerance`
""")
