"""From which mass on does a staggered coupling blow up? Lagged inertia over mass, modes and step, at midspan."""

from __future__ import annotations

import numpy as np

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from studies.protocol.parts import Work
from studies.results.formatting import listed, number
from studies.stability_maps.map_scene import GROWS, Ground, MapScene, threshold
from studies.stability_maps.mapping import Asked, Map, dataset_of

LIGHTEST, HEAVIEST = 0.01, 3.0  # mass ratios
SHOWN = (1, 3, 5, 10, 20)

OUTPUTS = outputs("""
    * | | | optional alone |
    lagged_mass_ratio | | | axis | mass ratio
        carriage mass over body mass
    critical_mass_ratio | mode_count relative_step | | nan | mass ratio from which on lagged inertia grows
        frozen at midspan, by bisection on the march itself; NaN where there is none up to 3
    critical_mass_ratio_theory | mode_count | | | mass ratio where m phi.phi = 1
        for average acceleration, whatever the step
    lagged_growth | mode_count relative_step lagged_mass_ratio | | nan | growth per step of lagged inertia
        frozen at midspan
""")


def compute(ground: Ground, asked: Asked, work: Work) -> xr.Dataset:
    """The mass held at midspan, its inertia force taken from the step before."""
    mass = np.geomspace(LIGHTEST, HEAVIEST, asked.points(50))
    critical, theory, growth = [], [], []
    for modes in asked.mode_counts:
        scene = ground.passage(modes)
        part = scene.model.leading_body.modal
        theory.append(1.0 / (part.mass * float((part.shape([0.5 * part.length])[0] ** 2).sum())))
        for relative in asked.relative_steps:
            work.check()
            growth.append(lagged_growth(scene, mass, relative))
            grows = lambda at, s=scene, r=relative: lagged_growth(s, at, r) > 1.0 + GROWS  # noqa: E731
            critical.append(threshold(grows, LIGHTEST, HEAVIEST))
    counts, steps = list(asked.mode_counts), list(asked.relative_steps)
    values = {
        "critical_mass_ratio": np.reshape(critical, (len(counts), len(steps))),
        "critical_mass_ratio_theory": theory,
        "lagged_growth": np.reshape(growth, (len(counts), len(steps), mass.size)),
    }
    along = {"mode_count": counts, "relative_step": steps, "lagged_mass_ratio": mass}
    return dataset_of(OUTPUTS, along, values, (max(counts), 1))


def lagged_growth(scene: MapScene, mass: Array, relative: float) -> Array:
    """(n,) growth per step for masses (n,) over the body's, omega_1 h = relative."""
    from engine.methods.comparison import COMPARISON

    step = np.full_like(mass, relative / scene.model.first_omega)
    return scene.step_growth(scene.values(mass), step, scheme=COMPARISON["lagged-inertia"])


def sentences(dataset: xr.Dataset) -> list[str]:
    """The threshold per number of modes, and its independence of the step."""
    found = dataset["critical_mass_ratio"]
    counts = [int(n) for n in dataset["mode_count"].values]
    shown = [n for n in SHOWN if n in counts] or counts
    middle = {n: float(found.sel(mode_count=n).median()) for n in shown}
    told = listed([f"{number(middle[n])} with {n} mode{'s' if n > 1 else ''}" for n in shown])
    away = float(np.abs(found / dataset["critical_mass_ratio_theory"] - 1.0).max())
    steps = dataset["relative_step"].values
    return [
        f"Lagged inertia: a coupling that takes the mass's inertia from the last step blows up from mass ratio {told} "
        f"on (frozen: held at midspan), whatever the step (omega_1 h from {number(float(steps.min()))} to "
        f"{number(float(steps.max()))}; within "
        f"{number(100.0 * away, 2)} % of m phi.phi = 1). Smaller steps do not help."
    ]


MAP = Map(
    "lagged-inertia",
    "lagged inertia over mass, modes and step",
    lambda asked: 0.9 * asked.fineness,
    OUTPUTS,
    compute,
    sentences,
)
