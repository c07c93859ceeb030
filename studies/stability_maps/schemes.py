"""Up to which step is a scheme stable? Growth per step of an undamped oscillator over omega h."""

from __future__ import annotations

import math

import numpy as np

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from studies.protocol.parts import Work
from studies.results.formatting import listed, number
from studies.stability_maps.map_scene import GROWS, Ground, MapScene, threshold
from studies.stability_maps.mapping import Asked, Map, dataset_of
from studies.stability_maps.methods import LABELS, METHODS, Method

STEPS = 50  # marched for the measured growth
SMALLEST, LARGEST, FAR = 0.1, 20.0, 1000.0  # omega h: of the map, and up to where a limit is looked for

OUTPUTS = outputs("""
    * | | | optional alone |
    frequency_step | | | axis | omega h
        natural frequency times the time step
    critical_step | scheme | | nan | omega h at which a scheme's amplification leaves 1
        omega h, by bisection on the march itself; NaN where there is none up to 1000
    critical_step_theory | scheme | | nan | the same by the closed form
        omega h; NaN without limit
    scheme_radius | scheme frequency_step | | | spectral radius of one step of the march
    scheme_radius_theory | scheme frequency_step | | | spectral radius of the closed amplification matrix
    scheme_growth | scheme frequency_step | | | growth per step over 50 marched steps
""")


def compute(ground: Ground, asked: Asked, work: Work) -> xr.Dataset:
    """One mode of the body, without the mass, by every scheme."""
    x = np.geomspace(SMALLEST, LARGEST, asked.points(93))
    found: dict[str, list[Array | float]] = {output.name: [] for output in OUTPUTS[1:]}
    for method in METHODS:
        work.check()
        scene = ground.passage(1, method.table)
        radius = one_step(scene, method, x)
        found["scheme_radius"].append(radius)
        found["scheme_growth"].append(_marched(scene, method, x))
        found["scheme_radius_theory"].append(method.radius(x))
        grows = lambda at, s=scene, m=method: one_step(s, m, at) > 1.0 + GROWS  # noqa: E731
        found["critical_step"].append(threshold(grows, SMALLEST, FAR))
        found["critical_step_theory"].append(method.limit if math.isfinite(method.limit) else math.nan)
    return dataset_of(OUTPUTS, {"scheme": list(LABELS), "frequency_step": x}, found, (1, STEPS))


def one_step(scene: MapScene, method: Method, x: Array) -> Array:
    """(n,) spectral radius of one step of the march at omega h = x (n,), the mass being none."""
    values, step = scene.oscillators(x.size), x / scene.model.first_omega
    return scene.step_growth(values, step, scheme=method.scheme)


def _marched(scene: MapScene, method: Method, x: Array) -> Array:
    """(n,) growth per step over many marched steps."""
    values, step = scene.oscillators(x.size), x / scene.model.first_omega
    return np.asarray(scene.step_growth(values, step, steps=STEPS, scheme=method.scheme) ** (1.0 / STEPS))


def sentences(dataset: xr.Dataset) -> list[str]:
    """The limits, and how far they are from the theory."""
    found, theory = dataset["critical_step"].values, dataset["critical_step_theory"].values
    labels = [str(label) for label in dataset["scheme"].values]
    limited = [(label, value) for label, value in zip(labels, found, strict=True) if math.isfinite(value)]
    free = [label for label, value in zip(labels, found, strict=True) if not math.isfinite(value)]
    away = float(np.nanmax(np.abs(found / theory - 1.0)))
    limits = listed([f"{number(value, 4)} for {label}" for label, value in limited])
    return [
        f"Steps: some schemes blow up once the step is too long for the fastest vibration kept, at omega h = {limits} "
        f"(found by running them; within {number(100.0 * away, 2)} % of the theory). "
        f"{listed(free).capitalize()} do not, up to omega h = {number(FAR)}."
    ]


MAP = Map(
    "schemes", "growth of every scheme over the step, and its limit", lambda asked: 0.14, OUTPUTS, compute, sentences
)
