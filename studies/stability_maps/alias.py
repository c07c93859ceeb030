"""How many steps keep the march from resonating with itself? Growth per passage over the number of steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from engine.march.step_rules import alias_steps
from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from studies.protocol.parts import Work
from studies.results.formatting import counted, number, percent
from studies.stability_maps.map_scene import Ground, MapScene
from studies.stability_maps.mapping import Asked, Map, dataset_of, times
from studies.stability_maps.methods import hht

FEW, MANY, SAFE = (0.3, 0.9), 1.1, 1.5  # times the rule's steps
MASSES = (0.25, 0.5, 1.0)  # mass ratios: heavy enough to show it, and light enough for passages not to grow
DAMPED = -0.05
CURED = 1.05
STEADY = 1.01  # growth with the most steps up to which nothing grows in truth
# First and last multiple of the rule's steps, and points.
BANDS = ((0.3, 0.9, 61), (0.92, 1.5, 30), (1.6, 2.0, 5), (2.5, 4.0, 3))

OUTPUTS = outputs("""
    * | | | optional alone |
    alias_scheme | | | axis str | time integration scheme
    alias_mode_count | | | axis int64 | number of modes
    alias_speed_ratio | | | axis | speed over omega_1 L / pi
    alias_mass_ratio | | | axis | mass ratio
        carriage mass over body mass
    step_multiple | | | axis | steps ratio
        over the steps of the alias rule
    growth | alias_scheme alias_mode_count alias_speed_ratio alias_mass_ratio step_multiple | | nan | growth per passage
        spectral radius of its transition matrix on modal displacements and velocities over omega
    alias_steps | alias_mode_count alias_speed_ratio | | | steps per passage of the alias rule
        k_N v h = 2 atan(2/(omega_N h))
""")


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
    along: dict[str, Sequence[Any] | Array] = {
        "alias_scheme": labels,
        "alias_mode_count": asked.alias_mode_counts,
        "alias_speed_ratio": speed,
        "alias_mass_ratio": mass,
        "step_multiple": multiples,
    }
    shape = tuple(len(places) for places in along.values())
    values = {"growth": np.reshape(growth, shape), "alias_steps": rules[: len(asked.alias_mode_counts)]}
    marched = max(asked.alias_mode_counts), round(float(np.max(rules) * multiples.max()))
    return dataset_of(OUTPUTS, along, values, marched)


def rule_steps(scene: MapScene, speed: Array) -> Array:
    """(n,) steps per passage of the rule for speeds (n,) over omega_1 L/pi."""
    return alias_steps(scene.model, scene.model.leading_body.modal.length / (speed * scene.speed_unit))


def passage_growth(scene: MapScene, mass: Array, speed: float, steps: Array) -> Array:
    """(steps, masses) growth per passage, infinite where the march overflows; steps (n,) are rounded."""
    values = scene.values(mass, np.full_like(mass, speed))
    return np.array([scene.growth(max(1, round(float(n))), values) for n in steps])


def sentences(dataset: xr.Dataset) -> list[str]:
    """How much grows below the rule's steps where nothing grows with many, and how little above."""
    multiple = dataset["step_multiple"]
    growth = dataset["growth"].fillna(np.inf).clip(1.0)
    truth = growth.isel(alias_scheme=0, step_multiple=-1, drop=True)
    quiet = truth <= STEADY
    many = f"{number(float(multiple.max()))} times the rule's steps"
    if not quiet.any():
        return [f"Too few steps: in all {quiet.size} scenes some vibration grows with {many} too: no answer."]
    average, damped = ((growth.isel(alias_scheme=i, drop=True) / truth).where(quiet) for i in (0, 1))
    few = (multiple >= FEW[0] - 1e-9) & (multiple <= FEW[1] + 1e-9)
    cure = float(damped.where(few).max())
    return [
        _too_few(average.where(few).max("step_multiple"), many),
        _enough(average.where(multiple >= MANY - 1e-9), average.where(multiple >= SAFE - 1e-9)),
        f"HHT-alpha with alpha = {DAMPED:g} {'nearly cures it' if cure < CURED else 'does not cure it all'}: with the "
        f"same too few steps the largest is {times(cure, 4)}.",
    ]


def _too_few(worst: xr.DataArray, many: str) -> str:
    """worst: of every scene the largest growth with too few steps; NaN where the truth grows."""
    scenes = int(worst.count())
    all_of = counted(scenes, "scene")
    grown = worst.where(worst > MANY)
    left = f"; {worst.size - scenes} more are left out, as some vibration grows in them with {many} too"
    left = left if scenes < worst.size else ""
    few = f"Too few steps: {FEW[0]:g} to {FEW[1]:g} times the steps of the alias rule let average acceleration blow up"
    beside = f"where nothing grows with {many}{left}."
    count = int(grown.count())
    if not count:
        return f"{few} nothing by more than {times(float(worst.max()))} per passage in {all_of} {beside}"
    span = " to ".join(dict.fromkeys((number(float(grown.min())), times(float(grown.max()))))) if count > 1 else ""
    which = f"in each of {all_of}" if count == scenes else f"in {count} of {all_of}"
    return f"{few} some vibration by {span or times(float(grown.max()))} per passage {which} {beside}"


def _enough(above: xr.DataArray, far: xr.DataArray) -> str:
    """above: growth from MANY times the rule's steps on. far: from SAFE times on."""
    beyond = float((above > MANY).sum() / above.count())
    largest = f"but for {percent(beyond)} of the step counts (largest {times(float(above.max()))})"
    stays = f"that stays below {MANY:g} {largest if beyond else 'always'}"
    return (
        f"From {MANY:g} times the rule's steps on {stays}, and from {SAFE:g} times on it is at most "
        f"{times(float(far.max()))}."
    )


def _seconds(asked: Asked) -> float:
    """Expected: steps of the rule go with the frequency of the highest mode and the time of a passage."""
    steps = sum(modes**2 for modes in asked.alias_mode_counts) * sum(1.0 / speed for speed in asked.speed_ratios)
    return 1.3e-4 * asked.fineness * steps


MAP = Map("alias", "growth per passage over steps, speed, mass and modes", _seconds, OUTPUTS, compute, sentences)
