"""From which speed on would the mass lift off? Smallest contact force of a passage over speed and mass."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from engine.kernels.layout import BELOW_AT, SMALLEST
from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from studies.protocol.parts import Work
from studies.results.formatting import counted, listed, number, percent, spanned
from studies.stability_maps.map_scene import Ground, MapScene
from studies.stability_maps.mapping import Asked, Map, dataset_of

MODES, STEPS = 20, 6000
SLOWEST, FASTEST = 0.05, 1.5  # speed ratios
REFINED = 48  # speeds between the last that holds and the first that does not

OUTPUTS = outputs("""
    * | | | optional alone |
    separation_mass_ratio | | | axis | mass ratio
        carriage mass over body mass
    separation_speed_ratio | | | axis | speed over omega_1 L / pi
    smallest_contact_force | separation_mass_ratio separation_speed_ratio | | nan |
        smallest contact force over the weight
        over the weight, on 0-98 % of the span; NaN where the march overflows
    separation_onset | separation_mass_ratio | | nan | onset of separation
        lowest speed ratio at which the contact opens; it may hold again at higher ones; NaN where it always holds
    separation_place | separation_mass_ratio | | nan | place of separation
        in lengths, at that speed
""")


class Contact(NamedTuple):
    """Smallest contact force over the weight (n,), and where it turns negative first, in lengths (n,)."""

    smallest: Array
    opens_at: Array


class Onset(NamedTuple):
    """Speed ratio and place (lengths) of the first opening."""

    speed: float
    place: float


def compute(ground: Ground, asked: Asked, work: Work) -> xr.Dataset:
    """Passages from rest under the weight."""
    scene = ground.passage(MODES)
    speed = np.linspace(SLOWEST, FASTEST, asked.points(146))
    rows, onsets = [], []
    for mass in asked.mass_ratios:
        smallest = contact(scene, mass, speed, work).smallest
        rows.append(smallest)
        onsets.append(onset(scene, mass, speed, smallest, work))
    values = {
        "smallest_contact_force": rows,
        "separation_onset": [found.speed for found in onsets],
        "separation_place": [found.place for found in onsets],
    }
    along = {"separation_mass_ratio": asked.mass_ratios, "separation_speed_ratio": speed}
    return dataset_of(OUTPUTS, along, values, (MODES, STEPS))


def contact(scene: MapScene, mass: float, speed: Array, work: Work) -> Contact:
    """The contact of passages at speed ratios (n,)."""
    values = scene.values(np.full_like(speed, mass), speed)
    marks = scene.march(STEPS, values, work).statistics[-1]
    weight = mass * scene.model.leading_body.modal.mass * scene.study.gravity
    return Contact(marks[SMALLEST] / weight, np.where(marks[BELOW_AT] >= 0.0, marks[BELOW_AT] / STEPS, np.nan))


def onset(scene: MapScene, mass: float, speed: Array, smallest: Array, work: Work) -> Onset:
    """The lowest speed at which the contact opens, between two of the scanned ones."""
    open_at = np.flatnonzero(smallest < 0.0)
    if open_at.size == 0:
        return Onset(math.nan, math.nan)
    first = int(open_at[0])
    fine = np.linspace(speed[max(0, first - 1)], speed[first], REFINED)
    found = contact(scene, mass, fine, work)
    at = int(np.argmax(found.smallest < 0.0))
    return Onset(float(fine[at]), float(found.opens_at[at]))


def sentences(dataset: xr.Dataset) -> list[str]:
    """The first opening per mass, and whether the contact holds again at faster speeds."""
    onset_of, mass = dataset["separation_onset"].values, dataset["separation_mass_ratio"].values
    known = np.isfinite(onset_of)
    top = number(float(dataset["separation_speed_ratio"].max()))
    if not known.any():
        return [f"Separation: the mass stays on its track up to speed ratio {top}."]
    slowest = float(dataset["separation_speed_ratio"].min())
    least = {i: " or less" if onset_of[i] <= slowest else "" for i in np.flatnonzero(known)}
    told = listed([f"{number(onset_of[i])}{less} for mass ratio {number(mass[i])}" for i, less in least.items()])
    kept = f" The other masses hold up to speed ratio {top}." if not known.all() else ""
    faster = dataset["separation_speed_ratio"] > dataset["separation_onset"]
    again = int((faster & (dataset["smallest_contact_force"] >= 0.0)).sum())
    holds = f" At {again} of {counted(int(faster.sum()), 'faster passage')} it holds." if again else ""
    places = dataset["separation_place"].values
    where = spanned(places[np.isfinite(places)], percent)
    return [
        f"Separation: the contact opens first at speed ratio {told}, at {where} of the way; from there on the "
        f"equations say no more of the passage.{holds}{kept}"
    ]


MAP = Map(
    "separation",
    "where a crossing mass would lift off",
    lambda asked: 0.03 * len(asked.mass_ratios),
    OUTPUTS,
    compute,
    sentences,
)
