"""What if the mass is tied to the body by its place instead of by its inertia? The contact force then rings."""

from __future__ import annotations

import numpy as np

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from studies.protocol.parts import Work
from studies.results.formatting import listed, number, percent
from studies.stability_maps.map_scene import Ground
from studies.stability_maps.mapping import Asked, Map, dataset_of
from studies.stability_maps.methods import METHODS, Method

MODES, STEPS, COUNTED = 8, 400, 0.98
INERTIAL = "as inertia"
TIED = (*METHODS[:2], *METHODS[4:9])  # not those for comparison alone, Fox-Goodwin and central difference
UNDAMPED = tuple(method.label for method in METHODS[:4])  # they damp no vibration, however fast
LOST = 1e6  # weights: a force beyond means nothing any more
CALM = 0.1  # of the weight: ringing below is none to speak of

OUTPUTS = outputs("""
    * | | | optional alone |
    tie | | | axis str | tie
        how the mass is tied, and the scheme
    passage_fraction | | | axis | place over the length
        of the mass
    contact_force | tie passage_fraction | | nan | contact force
        over the weight; NaN beyond a million
    contact_ringing | tie | | nan | ringing of the contact force
        over the weight: rms of the part that changes its sign from step to step, (F[n+1] - 2 F[n] + F[n-1])/4; NaN
        where it blows up
    contact_departure | tie | | nan | largest departure of the contact force from that of the mass as inertia
        over the weight; NaN where it blows up
""")


def compute(ground: Ground, asked: Asked, work: Work) -> xr.Dataset:
    """The study's own mass and speed, once as inertia and then tied by its place, by several schemes."""
    rows = [_inertial(ground, work)]
    for method in TIED:
        work.check()
        rows.append(_tied(ground, method))
    counted = int(COUNTED * STEPS)
    force = np.array(rows)[:, : counted + 1]
    force = np.where(np.abs(force) < LOST, force, np.nan)
    ringing = np.sqrt(np.mean((0.25 * np.diff(force, 2)) ** 2, axis=1))
    departure = np.abs(force - force[0]).max(axis=1)
    values = {"contact_force": force, "contact_ringing": ringing, "contact_departure": departure}
    along = {"tie": [INERTIAL, *(method.label for method in TIED)], "passage_fraction": np.arange(counted + 1) / STEPS}
    return dataset_of(OUTPUTS, along, values, (MODES, STEPS))


def _inertial(ground: Ground, work: Work) -> Array:
    """(steps + 1,) contact force over the weight, as all other studies march it."""
    scene = ground.passage(MODES)
    values = scene.values(np.array([ground.mass_ratio]), np.array([ground.speed_ratio]))
    return scene.march(STEPS, values, work, np.arange(STEPS + 1)).history[:, 0, 0] / ground.weight


def _tied(ground: Ground, method: Method) -> Array:
    """The same by a tie at position level."""
    from engine.methods.comparison import march_comparison, rigid_tie

    scene = ground.passage(MODES, method.table)
    tables, lanes = scene.laid_out(STEPS, scene.values(np.array([ground.mass_ratio]), np.array([ground.speed_ratio])))
    scheme = rigid_tie(scene.model.scheme.coefficients)
    marched = march_comparison(scheme, tables, lanes, np.arange(STEPS + 1), 1, sampled=1)
    return np.asarray(marched.history[:, 0, 0] / ground.weight)


def sentences(dataset: xr.Dataset) -> list[str]:
    """Which schemes ring, and which calm it at what price."""
    ringing = {str(n): float(v) for n, v in zip(dataset["tie"].values, dataset["contact_ringing"].values, strict=True)}
    departure = dict(zip(ringing, dataset["contact_departure"].values.tolist(), strict=True))
    tied = [name for name in ringing if name != INERTIAL]
    lost = [name for name in tied if not np.isfinite(ringing[name])]
    wild = [f"{name} {number(ringing[name])} times the weight" for name in tied if ringing[name] > CALM]
    calm = [name for _, name in sorted((departure[name], name) for name in tied if ringing[name] <= CALM)]
    told = [f"Rigid tie: with the mass tied by its place instead of its inertia, {_rings(wild, lost)}."]
    if calm:
        away = f"by {percent(departure[calm[0]])} of the weight at most"
        best = f"the tie by {calm[0]} departs least from the force of the mass as inertia, {away}."
        told.append(f"{_calms(calm) if wild else ''}{best}")
    return [told[0], *(f"{text[:1].upper()}{text[1:]}" for text in told[1:])]


def _rings(wild: list[str], lost: list[str]) -> str:
    """What the contact force does where it is not calm."""
    gone = f"{listed(lost)} blow{'s' if len(lost) == 1 else ''} up altogether"
    if wild:
        return f"the contact force rings from step to step with {listed(wild)}" + (f", and {gone}" if lost else "")
    here = f"the contact force of this passage rings by no more than {percent(CALM)} of the weight with"
    return f"{here} any other scheme, but {gone}" if lost else f"{here} any scheme"


def _calms(calm: list[str]) -> str:
    """Which schemes do not ring: those that damp fast vibration, and others."""
    damping, others = [n for n in calm if n not in UNDAMPED], [n for n in calm if n in UNDAMPED]
    told = f"numerical damping calms it ({listed(damping)}); " if damping else ""
    return told + (f"{listed(others)} {'does' if len(others) == 1 else 'do'} not ring either; " if others else "")


MAP = Map("rigid-tie", "the contact force of a mass tied by its place", lambda asked: 0.06, OUTPUTS, compute, sentences)
