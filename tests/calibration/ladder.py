"""How good the errors are that the ladder of models tells beforehand, over a random sample of scenes and variants.

`python -m tests.calibration.ladder` prints the figures. The truth is the largest distance over time between the
model's own history and the full model's, with the same modes and steps, over the largest static value. Arguments:
how many scenes, and the seed.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.ladder import model_errors
from engine.march import march
from engine.plan import Plan, make_plan
from engine.quasistatic import rest
from engine.tables import SceneTables
from results_schema.status import Fidelity, label
from tests.engine.build import Table, beam, cruise, fixed, mass, oscillator, shuttle, study, swing

Array = NDArray[np.float64]

SEED = 20240608
SCENES = 64
LANES = 16  # variants of a scene
SPRINGS = [{"at": 0.0, "stiffness": 60.0, "rotational": 0.3}, {"at": 1.0, "stiffness": 90.0}]
STIFF = [{"at": 0.1, "stiffness": 400.0}, {"at": 0.9, "stiffness": 600.0}]
SUPPORTS: dict[str, Any] = {
    "pinned": "pinned-pinned",
    "clamped": "clamped-clamped",
    "clamped-pinned": "clamped-pinned",
    "free end": "clamped-free",
    "springs": SPRINGS,
    "stiff springs": STIFF,
}
MOTIONS = ("cruise", "far cruise", "sharp turns", "smooth turns", "sinusoidal")
NEGLIGIBLE = 1e-5  # errors below count as none
USELESS = 0.3  # a model that leaves out more, by its estimate and in truth, is not worth a better estimate


@dataclass(frozen=True, eq=False)
class Measured:
    """A scene's variants: told and true errors by model, and how they were drawn."""

    supports: str
    motion: str
    kind: str
    told: dict[Fidelity, Array]
    true: dict[Fidelity, Array]
    alpha: Array
    mu: Array
    zeta: Array


def motion_of(kind: str, random: np.random.Generator) -> Table:
    """A random motion of a kind along a bed of length 1."""
    low, high = float(random.uniform(0.0, 0.35)), float(random.uniform(0.6, 1.0))
    turn = float(random.uniform(0.05, 0.4))
    cycles = int(random.integers(1, 4))
    return {
        "cruise": lambda: cruise(0.0, 1.0, 1.0),
        "far cruise": lambda: cruise(-0.1, 1.1, 1.0),
        "sharp turns": lambda: shuttle(low, high, 1.0, 0.0, cycles),
        "smooth turns": lambda: shuttle(low, high, 1.0, turn, cycles),
        "sinusoidal": lambda: swing(0.5, float(random.uniform(0.1, 0.49)), 1.0, cycles),
    }[kind]()


def drawn(random: np.random.Generator, supports: str, motion: str, kind: str) -> tuple[Scene, dict[str, Array]]:
    """A random scene, and alpha, mu and zeta of its variants. alpha: top speed over omega_1 L/pi."""
    path = motion_of(motion, random)
    bed = beam(modes=8, supports=SUPPORTS[supports])
    alpha = np.exp(random.uniform(np.log(0.005), np.log(0.6), LANES))
    mu = np.exp(random.uniform(np.log(0.01), np.log(1.0), LANES))
    zeta = np.where(random.random(LANES) < 0.3, 0.0, random.uniform(0.0, 0.1, LANES))
    soft = float(np.exp(random.uniform(np.log(0.2), np.log(8.0))))
    first = float(make_plan(study(bed, mass(1.0, path))).base.first_omega)
    speed = alpha * first / np.pi
    sinusoidal = motion == "sinusoidal"
    pace = speed / (2.0 * np.pi * path["amplitude"]) if sinusoidal else speed
    carriage = mass(1.0, path) if kind == "mass" else oscillator(1.0, 1.0, path)
    sweep: Table = {
        "zip": True,
        "mass": {"of": "carriage.car.mass", "values": mu.tolist()},
        "pace": {"of": "carriage.car.motion." + ("frequency" if sinusoidal else "speed"), "values": pace.tolist()},
        "zeta": {"of": "body.bed.damping_ratio", "values": zeta.tolist()},
    }
    if kind != "mass":
        stiffness = mu * (soft * first) ** 2
        sweep["spring"] = {"of": "carriage.car.stiffness", "values": stiffness.tolist()}
    at = 1.0 if supports == "free end" else 0.5
    tables = {"sensor": {"read": fixed(at)}, "sweep": sweep}
    return Scene(bed, carriage, tables), {"alpha": alpha, "mu": mu, "zeta": zeta}


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene with variants, of which every model makes a study."""

    bed: Table
    carriage: Table
    tables: Table

    def plan(self, **solver: Any) -> Plan:
        """The plan of a model."""
        return make_plan(study(self.bed, self.carriage, **self.tables, solver=solver))

    def history(self, fidelity: str, steps: int) -> Array:
        """(H, V) readings over the whole motion."""
        plan = self.plan(fidelity=fidelity, steps=steps)
        bucket = plan.buckets[0]
        assert len(plan.buckets) == 1
        tables = SceneTables(bucket.scene, steps, "whole")
        counts = np.arange(tables.timeline.steps + 1)
        values = plan.values(bucket, np.arange(plan.size))
        marched = (rest if fidelity == "static" else march)(tables, values, counts, values.size)
        return marched.history[:, 0]


def measure(scene: Scene) -> tuple[dict[Fidelity, Array], dict[Fidelity, Array]]:
    """Told and true errors of a scene's variants."""
    plan = scene.plan()
    steps = max(bucket.steps for bucket in plan.buckets)
    told = model_errors(plan.base, plan.values(plan.buckets[0], np.arange(plan.size)))
    full, still = scene.history("auto", steps), scene.history("static", steps)
    largest, true = np.nanmax(np.abs(still), axis=0), {}
    for rung in told:
        found = still if rung is Fidelity.STATIC else scene.history(label(rung), steps)
        true[rung] = np.nanmax(np.abs(found - full), axis=0) / largest
    return told, true


def sample(scenes: int = SCENES, seed: int = SEED) -> list[Measured]:
    """The random sample."""
    random, found = np.random.default_rng(seed), []
    for number in range(scenes):
        motion = MOTIONS[number % len(MOTIONS)]
        supports = str(random.choice(list(SUPPORTS)))
        kind = "mass" if random.random() < 0.7 else "oscillator"
        scene, drawn_as = drawn(random, supports, motion, kind)
        found.append(Measured(supports, motion, kind, *measure(scene), **drawn_as))
    return found


def compared(told: Array, true: Array) -> Array:
    """Told over true errors where either is worth a word and one of them says that the model may do."""
    seen = (np.maximum(told, true) > NEGLIGIBLE) & (np.minimum(told, true) < USELESS)
    return np.asarray(told[seen] / np.maximum(true[seen], 0.1 * NEGLIGIBLE))


def spread(ratio: Array) -> str:
    """Number of ratios, the least, 2 %, 5 %, median, 95 %, and the share that is told too low."""
    if not ratio.size:
        return "   none"
    quantiles = "  ".join(f"{q:8.2f}" for q in np.percentile(ratio, [0, 2, 5, 50, 95]))
    return f"{ratio.size:6d} {quantiles}   {np.mean(ratio < 1.0):6.3f}"


def main() -> None:
    """Print told over true errors, by model and motion."""
    found = sample(int(sys.argv[1]) if len(sys.argv) > 1 else SCENES, int(sys.argv[2]) if len(sys.argv) > 2 else SEED)
    print(f"{'':54s} number    least      2 %      5 %   median     95 %   too low")
    for kind in ("mass", "oscillator"):
        for rung in Fidelity:
            for by in (*[("motion", m) for m in MOTIONS], *[("supports", s) for s in SUPPORTS], ("kind", kind)):
                part = [m for m in found if m.kind == kind and getattr(m, by[0]) == by[1] and rung in m.told]
                if part:
                    told, true = (np.concatenate([getattr(m, side)[rung] for m in part]) for side in ("told", "true"))
                    print(f"{kind:11s} {label(rung):24s} {by[1]:16s} {spread(compared(told, true))}")


if __name__ == "__main__":
    main()
