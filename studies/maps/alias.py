"""How many steps keep the march from resonating with itself? Growth per passage over the number of steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from studies.maps.ground import Ground, MapScene
from studies.maps.mapping import Asked, Map, axis, dataset_of, result
from studies.maps.methods import hht
from studies.words import number, percent

if TYPE_CHECKING:
    import xarray as xr

    from studies.measuring import Work

Array = NDArray[np.float64]

FEW, MANY, SAFE = (0.3, 0.9), 1.1, 1.5  # times the rule's steps
MASSES = (0.25, 0.5, 1.0)  # mass ratios: heavy enough to show it, and light enough for passages not to grow
DAMPED = -0.05
CURED = 1.05
BANDS = (
    (0.3, 0.9, 61),
    (0.92, 1.5, 30),
    (1.6, 2.0, 5),
    (2.5, 4.0, 3),
)  # first and last multiple of the rule's steps, and points

AXES = (
    axis("alias_scheme", "time integration scheme", dtype="str"),
    axis("alias_mode_count", "number of modes", dtype="int64"),
    axis("alias_speed_ratio", "speed over omega_1 L / pi"),
    axis("alias_mass_ratio", "carriage mass over body mass"),
    axis("step_multiple", "steps over the steps of the alias rule"),
)
VARIABLES = (
    result("growth", tuple(a.name for a in AXES), "growth per passage",
           "spectral radius of its transition matrix "
           "on modal displacements and velocities over omega", nan_allowed=True),
    result("alias_steps", ("alias_mode_count", "alias_speed_ratio"), "steps per passage of the alias rule",
           "k_N v h = 2 atan(2/(omega_N h))"),
)  # fmt: skip


def compute(ground: Ground, asked: Asked, work: Work) -> xr.Dataset:
    """Whole passages by average acceleration and by HHT-alpha, in a range of steps about the rule's."""
    mass, speed = np.array(MASSES), np.array(asked.speed_ratios)
    multiples = np.concatenate([np.linspace(low, high, asked.points(count)) for low, high, count in BANDS])
    labels, growth, rules = ["average-acceleration", hht(DAMPED).label], [], []
    for solver in ({"scheme": "average-acceleration"}, hht(DAMPED).table):
        for modes in asked.alias_mode_counts:
            scene = ground.passage(modes, solver)
            rule = rule_steps(scene, speed)
            for v, steps in zip(speed, rule, strict=True):
                work.check()
                growth.append(passage_growth(scene, mass, float(v), multiples * steps).T)
            rules.append(rule)
    ways: tuple[Any, ...] = (labels, asked.alias_mode_counts, speed, mass, multiples)
    along = dict(zip((a.name for a in AXES), ways, strict=True))
    shape = tuple(len(way) for way in ways)
    values = {"growth": np.reshape(growth, shape), "alias_steps": rules[: len(asked.alias_mode_counts)]}
    marched = max(asked.alias_mode_counts), round(float(np.max(rules) * multiples.max()))
    return dataset_of((*AXES, *VARIABLES), along, values, marched)


def rule_steps(scene: MapScene, speed: Array) -> Array:
    """(n,) steps per passage of the rule for speeds (n,) over omega_1 L/pi."""
    from engine.fidelity import alias_steps

    return alias_steps(scene.model, scene.model.leading_body.modal.length / (speed * scene.speed_unit))


def passage_growth(scene: MapScene, mass: Array, speed: float, steps: Array) -> Array:
    """(steps, masses) growth per passage, infinite where the march overflows; steps (n,) are rounded."""
    values = scene.values(mass, np.full_like(mass, speed))
    return np.array([scene.growth(max(1, round(float(n))), values) for n in steps])


def sentences(dataset: xr.Dataset) -> list[str]:
    """How much grows below the rule's steps beside what grows with many, and how little above."""
    multiple = dataset["step_multiple"]
    most = dataset["growth"].isel(alias_scheme=0, step_multiple=-1, drop=True)
    average, damped = (dataset["growth"].isel(alias_scheme=i, drop=True) / most for i in (0, 1))
    few = (multiple >= FEW[0] - 1e-9) & (multiple <= FEW[1] + 1e-9)
    worst = average.where(few).max("step_multiple")
    above, far = (average.where(multiple >= least - 1e-9) for least in (MANY, SAFE))
    beyond = float((above > MANY).sum() / above.count())
    largest = number(float(above.max()))
    share = f"but for {percent(beyond)} of the step counts (largest {largest})" if beyond else "always"
    cure = float(damped.where(few).max())
    return [
        f"Too few steps: {FEW[0]:g} to {FEW[1]:g} times the steps of the alias rule let average acceleration blow up "
        f"some vibration by {number(float(worst.min()))} to {number(float(worst.max()))} times per passage in each of "
        f"{int(worst.count())} scenes, beside what it does in {number(float(multiple.max()))} times the rule's steps.",
        f"From {MANY:g} times the rule's steps on that stays below {MANY:g} {share}, and from {SAFE:g} times on below "
        f"{number(float(far.max()))}.",
        f"HHT-alpha with alpha = {DAMPED:g} {'nearly cures it' if cure < CURED else 'does not cure it all'}: with the "
        f"same too few steps the largest is {number(cure, 4)} times.",
    ]


MAP = Map("alias", "growth per passage over steps, speed, mass and modes", 14.0, AXES, VARIABLES, compute, sentences)
