"""Is a speed critical because a frozen station says so? Mass held at midspan with its speed's terms, and passages."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from results_schema.arrays import Array, Mask
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from studies.protocol.parts import Work
from studies.results.formatting import counted, number, percent
from studies.stability_maps.map_scene import GROWS, Ground, MapScene, threshold
from studies.stability_maps.mapping import Asked, Map, dataset_of

STEPS = 2000  # per passage
SLOWEST, FASTEST = 0.3, 1.2  # speed ratio times the root of the mass ratio
COUNTS = (1, 3, 5, 9, 19)
LIMIT = 2.0 / math.pi  # of a pinned beam with all modes
SWINGS = 1e-9  # imaginary part of a multiplier beyond which it is none of a motion that creeps
SAME = 1.01  # growth up to which a passage is called neutral: what is left of the alias is smaller

OUTPUTS = outputs("""
    * | | | optional alone |
    held_mode_count | | | axis int64 | number of modes
    held_mass_ratio | | | axis | mass ratio
        carriage mass over body mass
    centrifugal_number | | | axis | centrifugal number
        speed ratio times the square root of the mass ratio
    frozen_growth | held_mode_count held_mass_ratio centrifugal_number | | nan |
        growth during the time of one passage, frozen
        mass held at midspan, with the terms of its speed; a property of the frozen station, not of a passage
    frozen_flutter | held_mode_count held_mass_ratio centrifugal_number | | nan | the same of what swings alone
        0 where nothing swings
    passage_growth | held_mode_count held_mass_ratio centrifugal_number | | nan | growth per passage
        the mass crosses
    frozen_divergence | held_mode_count | | nan | speed ratio times root of mass ratio where the frozen station diverges
        begins to grow without swinging, by bisection on the march itself; NaN where it does not up to 1.2, or does from
        0.3 on
    frozen_divergence_theory | held_mode_count | | nan | the same from the modes' sum
        m v^2 times the sum of phi phi'' / omega^2 is -1; NaN where that cannot be
    frozen_limit | | | | the same with all modes
        2/pi, pinned beams only
""")


class Grown(NamedTuple):
    """Growth per step (n,) of what swings, and of what does not."""

    swinging: Array
    straight: Array


def compute(ground: Ground, asked: Asked, work: Work) -> xr.Dataset:
    """Both growths over speed, and the frozen station's limit."""
    number_of = np.linspace(SLOWEST, FASTEST, asked.points(91))
    masses = np.array([0.25, 1.0])
    frozen, flutter, passage, limit, theory = [], [], [], [], []
    for modes in COUNTS:
        work.check()
        scene = ground.passage(modes)
        for mass in masses:
            grown = frozen_growth(scene, float(mass), number_of)
            with np.errstate(over="ignore"):
                frozen.append(np.maximum(*grown) ** STEPS)
                flutter.append(grown.swinging**STEPS)
            crossing = scene.values(np.full_like(number_of, mass), number_of / math.sqrt(mass))
            passage.append(scene.growth(STEPS, crossing))
        limit.append(divergence(scene))
        theory.append(_theory(scene))
    shape = (len(COUNTS), masses.size, number_of.size)
    values: dict[str, object] = {
        "frozen_growth": np.reshape(frozen, shape),
        "frozen_flutter": np.reshape(flutter, shape),
        "passage_growth": np.reshape(passage, shape),
        "frozen_divergence": limit,
        "frozen_divergence_theory": theory,
    }
    if ground.is_pinned:
        values["frozen_limit"] = LIMIT
    along: dict[str, object] = {
        "held_mode_count": COUNTS,
        "held_mass_ratio": masses,
        "centrifugal_number": number_of,
    }
    return dataset_of(OUTPUTS, along, values, (max(COUNTS), STEPS))


def frozen_growth(scene: MapScene, mass: float, number_of: Array) -> Grown:
    """Growth at midspan for speed ratios (n,) times the root of the mass ratio."""
    speed = number_of / math.sqrt(mass) * scene.speed_unit
    advance = scene.model.leading_body.modal.length / STEPS
    multipliers = scene.multipliers(scene.values(np.full_like(speed, mass), speed), advance / speed, advance=advance)
    swings = np.abs(multipliers.imag) > SWINGS
    size = np.abs(multipliers)
    return Grown(np.where(swings, size, 0.0).max(axis=-1), np.where(swings, 0.0, size).max(axis=-1))


def divergence(scene: MapScene) -> float:
    """Where the frozen station begins to grow without swinging; NaN where it never does or does all along."""

    def grows(number_of: Array) -> Mask:
        return frozen_growth(scene, 1.0, number_of).straight > 1.0 + GROWS

    return math.nan if grows(np.array([SLOWEST]))[0] else threshold(grows, SLOWEST, FASTEST)


def _theory(scene: MapScene) -> float:
    """Where the stiffness that the centrifugal term leaves is none."""
    part = scene.model.leading_body.modal
    shape, bend = (part.shape([0.5 * part.length], derivative)[0] for derivative in (0, 2))
    softening = -float((shape * bend / part.omega**2).sum()) * part.mass
    return 1.0 / (scene.speed_unit * math.sqrt(softening)) if softening > 0.0 else math.nan


def sentences(dataset: xr.Dataset) -> list[str]:
    """The frozen limit, flutter where there is any, and how many real passages grow where the frozen station does."""
    counts = dataset["held_mode_count"].values
    most = int(np.argmax(counts))
    found = [_diverges(dataset, most)]
    flutter = dataset["frozen_flutter"].isel(held_mode_count=most).fillna(np.inf)
    swinging = flutter > SAME
    if swinging.any():
        share, slowest = (
            float(swinging.mean()),
            float(dataset["centrifugal_number"].where(swinging.any("held_mass_ratio")).min()),
        )
        least = ", the slowest tried" if slowest <= float(dataset["centrifugal_number"].min()) else ""
        found.append(
            f"Frozen so, with {counts[most]} modes some vibration also swings ever more (flutter, no divergence): "
            f"from {number(slowest)} on{least}, in {percent(share)} of the speeds and masses tried."
        )
    frozen = dataset["frozen_growth"].isel(held_mode_count=most).fillna(np.inf)
    passage = dataset["passage_growth"].isel(held_mode_count=most).fillna(np.inf)
    told = _passages(passage.values[frozen.values > SAME])
    return [" ".join([*found, told] if told else found)]


def _diverges(dataset: xr.Dataset, most: int) -> str:
    """Where the frozen station diverges, with the fewest modes and with the most."""
    limit, counts = dataset["frozen_divergence"].values, dataset["held_mode_count"].values
    held = "a mass held at midspan with the terms of its speed"
    if not math.isfinite(limit[most]):
        tried = f"speed ratio times root of mass ratio {number(SLOWEST)} to {number(FASTEST)}"
        return f"Frozen: {held} has no speed at which it begins to diverge with {counts[most]} modes, {tried}."
    first = f"{number(limit[0], 4)} on with {counted(int(counts[0]), 'mode')} and " * math.isfinite(limit[0])
    return (
        f"Frozen: {held} diverges from speed ratio times root of mass ratio {first}{number(limit[most], 4)}"
        f"{'' if first else ' on'} with {counts[most]}{'' if first else ' modes'}."
    )


def _passages(growth: Array) -> str:
    """What real passages (n,) do at speeds and masses at which the frozen station grows."""
    if not growth.size:
        return ""
    neutral = int((growth <= SAME).sum())
    where = f"of {counted(growth.size, 'real passage')} where it grows"
    if neutral:
        return f"That is a property of the frozen station only: {where}, {neutral} do not grow at all."
    low, high = (
        number(float(end), 2) if np.isfinite(end) else "beyond all numbers" for end in (growth.min(), growth.max())
    )
    return f"Real passages grow there too: {where}, all do, {low} to {high} times per passage."


MAP = Map(
    "frozen",
    "the frozen station beside the real passage",
    lambda asked: 0.45 * asked.fineness,
    OUTPUTS,
    compute,
    sentences,
)
