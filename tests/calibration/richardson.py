"""How honest the error estimates of Richardson pairs are, over a random sample of scenes and variants.

`python -m tests.calibration.richardson` prints the figures. The true error of the finer march is its distance from a
pair with four times the steps, at the common stations of the pair; both relative as in `error_steps`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.bucket import Bucket
from engine.fidelity import allow_any_steps
from engine.lanes import LaneValues, weight
from engine.march import march
from engine.plan import make_plan
from engine.resolution import RESOLVED, phase_errors
from engine.richardson import march_pair, relative_error
from engine.tables import SceneTables
from tests.engine.build import Table, beam, cruise, fixed, force, mass, shuttle, study, swing, under

Array = NDArray[np.float64]

SEED = 20240607
SCENES = 72
LANES = 16  # variants of a scene
FINER = 4  # times the pair's steps, of the reference
SPRINGS = [{"at": 0.0, "stiffness": 60.0, "rotational": 0.3}, {"at": 1.0, "stiffness": 90.0}]
DAMPED = [{"at": 0.0, "stiffness": 200.0, "damping": 2.0}, {"at": 0.9, "stiffness": 300.0, "damping": 0.7}]
SUPPORTS: tuple[Any, ...] = ("pinned-pinned", "clamped-clamped", "clamped-pinned", "clamped-free", SPRINGS, DAMPED)
SENSORS = {
    "midspan": {"midspan": fixed(0.5)},
    "under": {"below": under("car"), "place": fixed(0.37)},
    "moment": {"midspan": fixed(0.5), "moment": fixed(0.4, "bending_moment")},
    "velocity": {"rate": fixed(0.5, "velocity")},
    "acceleration": {"felt": under("car", "acceleration")},
}


@dataclass(frozen=True, eq=False)
class Measured:
    """Of every variant: estimated and true relative error of the finer march, and the largest phase error."""

    estimated: Array
    true: Array
    phase: Array

    @property
    def resolved(self) -> NDArray[np.bool_]:
        """What the condition says."""
        return self.phase <= RESOLVED

    @property
    def within_two(self) -> NDArray[np.bool_]:
        """Whether the estimate is at most twice and at least half of the true error."""
        return (self.estimated <= 2.0 * self.true) & (self.true <= 2.0 * self.estimated)


def motion_of(kind: str, random: np.random.Generator) -> Table:
    """A random motion of a kind, on the bed of length 1 or over it."""
    return {
        "cruise": lambda: cruise(0.0, 1.0, 1.0, after=float(random.choice([0.0, 0.5]))),
        "far cruise": lambda: cruise(-0.1, 1.1, 1.0),
        "two": lambda: cruise(0.0, 1.0, 1.0),
        "out-and-back": lambda: shuttle(0.1, 0.9, 1.0, float(random.uniform(0.1, 0.4)), int(random.integers(1, 3))),
        "instant": lambda: shuttle(0.1, 0.9, 1.0, 0.0, 1),
        "sinusoidal": lambda: swing(0.5, float(random.uniform(0.1, 0.45)), 1.0, int(random.integers(1, 4))),
    }[kind]()


def drawn(random: np.random.Generator) -> tuple[Bucket, LaneValues]:
    """A random scene with variants that differ in mass, pace and damping."""
    kind = str(random.choice(["cruise", "far cruise", "out-and-back", "instant", "sinusoidal", "two"]))
    motion = motion_of(kind, random)
    carriages = {"car": mass(0.5, motion)}
    paced = ["carriage.car.motion." + ("frequency" if kind == "sinusoidal" else "speed")]
    if kind == "two":
        carriages["next"] = force(3.0, motion, headway=0.3)
        paced.append("carriage.next.motion.speed")
    ratios = np.exp(random.uniform(np.log(0.03), np.log(1.0), LANES))  # of the speed to the first critical one
    masses = np.exp(random.uniform(np.log(0.05), np.log(2.0), LANES))  # over the bed's
    damping = np.where(random.random(LANES) < 0.2, 0.0, random.uniform(0.0, 0.1, LANES))
    sweep = {
        "zip": True,
        "mass": {"of": "carriage.car.mass", "values": masses.tolist()},
        "pace": {"of": paced, "values": (ratios * np.pi * (0.3 if kind == "sinusoidal" else 1.0)).tolist()},
        "zeta": {"of": "body.bed.damping_ratio", "values": damping.tolist()},
    }
    bed = beam(modes=int(random.integers(3, 13)), supports=SUPPORTS[random.integers(len(SUPPORTS))])
    sensors = SENSORS[str(random.choice(list(SENSORS)))]
    given = study(
        bed, carriages, sensor=sensors, sweep=sweep, solver={"scheme": "richardson", "steps": 200, "fidelity": "full"}
    )
    plan = make_plan(given, check_steps=allow_any_steps)
    bucket = plan.buckets[0]
    return bucket, plan.values(bucket, bucket.variants)


def steps_for(bucket: Bucket, values: LaneValues, wanted: float) -> int:
    """Steps with which half of the variants have at most a phase error, 200 to 8,000."""
    once = SceneTables(bucket.scene, 200, "whole", refinement=2)
    return 2 * int(np.clip(100.0 * np.sqrt(np.median(phase_errors(once, values)) / wanted), 100, 4000))


def statics_of(tables: SceneTables, values: LaneValues) -> Array:
    """(sensors, V) largest static values, the bed being weightless."""
    weights = np.stack([weight(tables.model, values, c) for c in range(len(tables.model.carriages))])
    return np.abs(np.einsum("hjr,rv->hjv", tables.static_over_window.force, weights)).max(axis=0)


def measure(bucket: Bucket, values: LaneValues, steps: int) -> Measured:
    """Estimates and true errors of the variants of a scene."""
    tables = SceneTables(bucket.scene, steps, "whole", refinement=2)
    finest = SceneTables(bucket.scene, FINER * steps, "whole", refinement=2 * FINER)
    counts = np.arange(0, tables.timeline.steps + 1, 2)
    marched, gap = march_pair(tables, values, counts[:0], values.size)
    finer = march(tables, values, counts, values.size).history
    reference = march_pair(finest, values, FINER * counts, values.size)[0].history
    assert np.array_equal(np.isnan(finer), np.isnan(reference))
    off = np.nan_to_num(np.abs(finer - reference)).max(axis=0)
    statics = statics_of(tables, values)
    estimated, true = (relative_error(tables, marched, part, statics) for part in (gap, off))
    return Measured(estimated, true, phase_errors(tables, values))


def sample(scenes: int = SCENES, seed: int = SEED) -> Measured:
    """The random sample: as many scenes with a few resolved modes too few as with many too many steps."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(scenes):
        bucket, values = drawn(random)
        wanted = float(np.exp(random.uniform(np.log(RESOLVED / 30.0), np.log(RESOLVED * 30.0))))
        found.append(measure(bucket, values, steps_for(bucket, values, wanted)))
    return Measured(
        np.concatenate([part.estimated for part in found]),
        np.concatenate([part.true for part in found]),
        np.concatenate([part.phase for part in found]),
    )


def main() -> None:
    """Print shares of honest estimates by the largest phase error."""
    found = sample(int(sys.argv[1]) if len(sys.argv) > 1 else SCENES)
    ratio = found.estimated / found.true
    print("phase error (rad)  variants  within 2   estimate over truth: least, 2.5 %, median, 97.5 %, most")
    for low, high in pairwise([0.0, 0.03, 0.1, 0.3, 0.7, RESOLVED, 2.0, 3.0, 5.0, 10.0, 30.0, np.inf]):
        here = (found.phase > low) & (found.phase <= high)
        if here.any():
            spread = "  ".join(f"{x:6.3f}" for x in np.percentile(ratio[here], [0, 2.5, 50, 97.5, 100]))
            print(f"{low:6.2f} to {high:6.2f} {here.sum():11d} {found.within_two[here].mean():9.3f}   {spread}")
    resolved = found.resolved
    print(f"{resolved.sum()} of {resolved.size} resolved, {found.within_two[resolved].mean():.4f} of them within 2")
    print(f"{(~resolved).sum()} not resolved, {found.within_two[~resolved].mean():.4f} of them within 2")


if __name__ == "__main__":
    main()
