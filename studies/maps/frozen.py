"""Is a speed critical because a frozen station says so? Mass held at midspan with its speed's terms, and passages."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.maps.ground import GROWS, Ground, MapScene, threshold
from studies.maps.mapping import Asked, Map, axis, dataset_of, result
from studies.words import counted, number

if TYPE_CHECKING:
    import xarray as xr

    from studies.measuring import Work

Array = NDArray[np.float64]

STEPS = 2000  # per passage
SLOWEST, FASTEST = 0.3, 1.2  # speed ratio times the root of the mass ratio
COUNTS = (1, 3, 5, 9, 19)
LIMIT = 2.0 / math.pi  # of a pinned beam with all modes
SAME = 1.01  # growth up to which a passage is called neutral: what is left of the alias is smaller

AXES = (
    axis("held_mode_count", "number of modes", dtype="int64"),
    axis("held_mass_ratio", "carriage mass over body mass"),
    axis("centrifugal_number", "speed ratio times the square root of the mass ratio"),
)
_OVER = tuple(a.name for a in AXES)
VARIABLES = (
    result("frozen_growth", _OVER, "growth during the time of one passage, frozen", "mass held at midspan, with the "
           "terms of its speed; a property of the frozen station, not of a passage", nan_allowed=True),
    result("passage_growth", _OVER, "growth per passage", "the mass crosses", nan_allowed=True),
    result("frozen_divergence", ("held_mode_count",), "speed ratio times root of mass ratio where the frozen station "
           "diverges", "by bisection on the march itself; NaN where it does not up to 1.2", nan_allowed=True),
    result("frozen_divergence_theory", ("held_mode_count",), "the same from the modes' sum",
           "m v^2 times the sum of phi phi'' / omega^2 is -1; NaN where that cannot be", nan_allowed=True),
    result("frozen_limit", (), "the same with all modes", "2/pi, pinned beams only"),
)  # fmt: skip


def compute(ground: Ground, asked: Asked, work: Work) -> xr.Dataset:
    """Both growths over speed, and the frozen station's limit."""
    number_of = np.linspace(SLOWEST, FASTEST, asked.points(91))
    masses = np.array([0.25, 1.0])
    frozen, passage, limit, theory = [], [], [], []
    for modes in COUNTS:
        work.check()
        scene = ground.passage(modes)
        for mass in masses:
            with np.errstate(over="ignore"):
                frozen.append(frozen_growth(scene, float(mass), number_of) ** STEPS)
            crossing = scene.values(np.full_like(number_of, mass), number_of / math.sqrt(mass))
            passage.append(scene.growth(STEPS, crossing))
        grows = lambda at, s=scene: frozen_growth(s, 1.0, at) > 1.0 + GROWS  # noqa: E731
        limit.append(threshold(grows, SLOWEST, FASTEST))
        theory.append(_theory(scene))
    shape = (len(COUNTS), masses.size, number_of.size)
    values: dict[str, object] = {
        "frozen_growth": np.reshape(frozen, shape),
        "passage_growth": np.reshape(passage, shape),
        "frozen_divergence": limit,
        "frozen_divergence_theory": theory,
    }
    if ground.is_pinned:
        values["frozen_limit"] = LIMIT
    along: dict[str, object] = dict(zip(_OVER, (COUNTS, masses, number_of), strict=True))
    return dataset_of((*AXES, *VARIABLES), along, values, (max(COUNTS), STEPS))


def frozen_growth(scene: MapScene, mass: float, number_of: Array) -> Array:
    """(n,) growth per step at midspan for speed ratios (n,) times the root of the mass ratio."""
    speed = number_of / math.sqrt(mass) * scene.speed_unit
    advance = scene.model.leading_body.modal.length / STEPS
    return scene.step_growth(scene.values(np.full_like(speed, mass)), advance / speed, advance=advance)


def _theory(scene: MapScene) -> float:
    """Where the stiffness that the centrifugal term leaves is none."""
    part = scene.model.leading_body.modal
    shape, bend = (part.shape([0.5 * part.length], derivative)[0] for derivative in (0, 2))
    softening = -float((shape * bend / part.omega**2).sum()) * part.mass
    return 1.0 / (scene.speed_unit * math.sqrt(softening)) if softening > 0.0 else math.nan


def sentences(dataset: xr.Dataset) -> list[str]:
    """The frozen limit, and how often a real passage beyond it does not grow."""
    limit, counts = dataset["frozen_divergence"].values, dataset["held_mode_count"].values
    most = int(np.argmax(counts))
    if not math.isfinite(limit[most]):
        return [
            f"Frozen: held at midspan with the terms of its speed the mass does not diverge with {counts[most]} modes."
        ]
    passage = dataset["passage_growth"].isel(held_mode_count=most)
    beyond = passage.where(dataset["centrifugal_number"] > limit[most])
    neutral = int((beyond <= SAME).sum())
    return [
        f"Frozen: a mass held at midspan with the terms of its speed diverges from speed ratio times root of mass "
        f"ratio {_told(limit[0])} on with {counted(int(counts[0]), 'mode')} and {_told(limit[most])} with "
        f"{counts[most]}. That is a property of the frozen station only: of "
        f"{counted(int(beyond.count()), 'real passage')} above it, {neutral} do not grow at all."
    ]


def _told(limit: float) -> str:
    """A limit in words."""
    if not math.isfinite(limit):
        return f"above {number(FASTEST)}"
    return number(limit, 4) if limit > SLOWEST * (1.0 + 1e-6) else f"{number(SLOWEST)} or less"


MAP = Map("frozen", "the frozen station beside the real passage", 4.0, AXES, VARIABLES, compute, sentences)
