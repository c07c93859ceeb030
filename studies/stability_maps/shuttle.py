"""When does a mass that swings to and fro make its body vibrate ever more? Floquet multipliers of one period."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from studies.protocol.parts import Work
from studies.results.formatting import listed, number, percent
from studies.stability_maps.map_scene import Ground, MapScene
from studies.stability_maps.mapping import Asked, Map, dataset_of, times

#: Modes unless the body says how many, and steps of a period. Beside 24 modes and 6,400 steps 3 modes and 600 steps
#: judged 17 of 280 cells of the map otherwise with 2 % damping, and 55 without; 8 modes 1 and 31, 12 modes 0 and 31
#: (16 modes 0 and 25): with damping few modes tell, without it there is always a next narrow band.
MODES, STEPS = 12, 1200
FEWER = 2.0 / 3.0  # of the modes, by which the map is made once more
SLOWEST, FASTEST, HEAVIEST = 0.3, 1.4, 1.0  # frequency ratios, mass ratio
DAMPED = 0.02  # where the body has no damping of its own
UNSTABLE = 1.0 + 1e-3
FINE = 201  # frequencies about a tongue
NEAR = (0.8, 1.25)  # times the formula: where the main tongue is looked for
CYCLE_POINTS = 720
UNSHAKEN = "Swinging mass: near the formula for one mode nothing grows"
TOLD = (0.1, 0.5, 1.0)

OUTPUTS = outputs("""
    * | | | optional alone |
    shuttle_damping_ratio | | | axis | damping ratio of all modes
    shuttle_mass_ratio | | | axis | mass ratio
        carriage mass over body mass
    shuttle_frequency_ratio | | | axis | frequency ratio
        of the shuttle over omega_1
    multiplier | shuttle_damping_ratio shuttle_mass_ratio shuttle_frequency_ratio | | nan | largest Floquet multiplier
        of one period, in magnitude
    multiplier_fewer_modes | shuttle_damping_ratio shuttle_mass_ratio shuttle_frequency_ratio | | nan | by fewer modes
        the multiplier by two thirds of the modes: on the other side of 1 the map does not tell for certain
    tongue_low | shuttle_mass_ratio | | nan | lower end of the main tongue
        of the main unstable interval without damping, frequency over omega_1; NaN where there is none
    tongue_high | shuttle_mass_ratio | | nan | upper end of the main tongue
        as tongue_low
    tongue_theory | shuttle_mass_ratio | | | centre of the main tongue by theory
        by the first mode alone, frequency over omega_1
""")


class Tongue(NamedTuple):
    """Ends of an unstable interval, frequency ratios."""

    low: float
    high: float


def compute(ground: Ground, asked: Asked, work: Work) -> xr.Dataset:
    """s = L/2 + L/2 sin(Om t): unit states marched over one period."""
    modes = ground.modes or MODES
    scene, simpler = (ground.shuttle(count) for count in (modes, max(1, round(FEWER * modes))))
    damping_ratios = (0.0, ground.damping_ratio or DAMPED)
    frequency = np.linspace(SLOWEST, FASTEST, asked.points(331))
    mass = np.linspace(0.0, HEAVIEST, asked.points(20) + 1)[1:]
    maps = np.empty((2, len(damping_ratios), mass.size, frequency.size))
    for place in np.ndindex(maps.shape[:-1]):
        work.check()
        own = (scene, simpler)[place[0]]
        maps[place] = multipliers(own, float(mass[place[2]]), frequency, damping_ratios[place[1]])
    tongues = [main_tongue(scene, float(ratio), frequency, row) for ratio, row in zip(mass, maps[0, 0], strict=True)]
    values = {
        "multiplier": maps[0],
        "multiplier_fewer_modes": maps[1],
        "tongue_low": [tongue.low for tongue in tongues],
        "tongue_high": [tongue.high for tongue in tongues],
        "tongue_theory": one_mode(scene, mass),
    }
    along = {"shuttle_damping_ratio": damping_ratios, "shuttle_mass_ratio": mass, "shuttle_frequency_ratio": frequency}
    return dataset_of(OUTPUTS, along, values, (modes, STEPS))


def multipliers(scene: MapScene, mass: float, frequency: Array, damping: float) -> Array:
    """(n,) largest multipliers of one period for frequencies (n,) over omega_1."""
    alike = np.ones_like(frequency)
    return scene.growth(STEPS, scene.values(mass * alike, frequency, damping * alike))


def main_tongue(scene: MapScene, mass: float, frequency: Array, multiplier: Array) -> Tongue:
    """The unstable interval with the largest multiplier (n,) at frequencies (n,) near the formula, without damping; its
    ends on a finer grid."""
    centre = float(one_mode(scene, np.array([mass]))[0])
    coarse = interval(frequency, multiplier, centre)
    if math.isnan(coarse.low):
        return coarse
    margin = 2.0 * float(np.diff(frequency).max())
    fine = np.linspace(coarse.low - margin, coarse.high + margin, FINE)
    return interval(fine, multipliers(scene, mass, fine, 0.0), centre)


def interval(frequency: Array, multiplier: Array, centre: float) -> Tongue:
    """The connected unstable interval about the largest multiplier near a frequency; NaN where all is stable there.

    >>> interval(np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 1.5, 1.2, 1.0]), 2.1)
    Tongue(low=2.0, high=3.0)
    """
    near = (frequency > NEAR[0] * centre) & (frequency < NEAR[1] * centre)
    unstable = multiplier > UNSTABLE
    top = int(np.argmax(np.where(near, multiplier, 0.0)))
    if not (near[top] and unstable[top]):
        return Tongue(math.nan, math.nan)
    stable = np.flatnonzero(~unstable)
    first = int(stable[stable < top].max(initial=-1)) + 1
    last = int(stable[stable > top].min(initial=frequency.size)) - 1
    return Tongue(float(frequency[first]), float(frequency[last]))


def one_mode(scene: MapScene, mass: Array) -> Array:
    """(n,) centre of the principal tongue over omega_1 for mass ratios (n,), by the first mode alone.

    With the phase as time its kinetic energy holds the mass by the means of (phi q)'^2 over a cycle:
    Om/omega_1 = [1 + m <phi^2 + phi'^2 s'^2>]^(-1/2). For a pinned beam that is mechanics section 7.5,
    [1 + mu (1 + J0(z) + pi^2 a^2 (1/2 - J1(z)/z))]^(-1/2) with z = 2 pi a.
    """
    part = scene.model.leading_body.modal
    path = scene.model.carriages[0].rider.motion.path(np.arange(CYCLE_POINTS) / CYCLE_POINTS)
    shape, slope = (part.shape(path.S, derivative)[:, part.rigid_modes] for derivative in (0, 1))
    inertia = float(np.mean(shape**2 + (slope * path.dS / (2.0 * math.pi)) ** 2)) * part.mass
    return np.asarray((1.0 + mass * inertia) ** -0.5)


def sentences(dataset: xr.Dataset) -> list[str]:
    """Where the main tongue lies, how much of the map is unstable, and what damping does."""
    over = ["shuttle_mass_ratio", "shuttle_frequency_ratio"]
    growth = dataset["multiplier"].fillna(np.inf)
    parts = [percent(float(part)) for part in (growth > UNSTABLE).mean(over).values]
    largest = [float(value) for value in growth.max(over).values]
    damping = percent(float(dataset["shuttle_damping_ratio"].values[-1]))
    free = f"of the whole map of frequencies and masses {parts[0]} is unstable without damping"
    if largest[0] <= UNSTABLE:
        return [f"Swinging mass: nothing grows; {free}."]
    less = f"and {parts[-1]} with {damping}" if parts[-1] != parts[0] else f"and about as much with {damping}"
    return [
        f"{_main(dataset)}; {free} {less}. {_certainty(dataset, damping)}",
        f"In one period the vibration grows up to {times(largest[0])} without damping and {times(largest[-1])} with "
        f"{damping}.",
    ]


def _certainty(dataset: xr.Dataset, damping: str) -> str:
    """How much of the map two thirds of the modes judge otherwise; of archives written before that is not known."""
    if "multiplier_fewer_modes" not in dataset:
        return "How much of it fewer modes judge otherwise is not known."
    whole, fewer = (dataset[name].fillna(np.inf) > UNSTABLE for name in ("multiplier", "multiplier_fewer_modes"))
    otherwise = (whole != fewer).mean(["shuttle_mass_ratio", "shuttle_frequency_ratio"])
    parts = [percent(float(part)) for part in otherwise.values]
    said = f"With a third fewer modes {parts[0]} of the map is judged otherwise without damping"
    return f"{said}, {parts[-1]} with {damping}."


def _main(dataset: xr.Dataset) -> str:
    """The main band at some masses beside the formula."""
    mass, theory = dataset["shuttle_mass_ratio"].values, dataset["tongue_theory"].values
    low, high = dataset["tongue_low"].values, dataset["tongue_high"].values
    places = sorted({int(np.argmin(np.abs(mass - wanted))) for wanted in TOLD if wanted <= mass.max() + 1e-9})
    shown = [i for i in places if math.isfinite(low[i])]
    if not shown:
        return UNSHAKEN
    told = listed([f"{number(low[i])} to {number(high[i])} for mass ratio {number(mass[i])}" for i in shown])
    away = [percent(abs(0.5 * (low[i] + high[i]) / theory[i] - 1.0)) for i in shown]
    return (
        f"Swinging mass: one that swings over the whole body shakes it ever more, in a main band near the formula for "
        f"one mode at frequencies over omega_1 of {told} (its middle is {listed(away)} off the formula)"
    )


MAP = Map(
    "shuttle",
    "Floquet multipliers of a swinging mass",
    lambda asked: 5.0 * asked.fineness**2 + 1.2 * asked.fineness,
    OUTPUTS,
    compute,
    sentences,
)
