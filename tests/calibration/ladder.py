"""How good the errors are that the ladder of models tells beforehand, over a random sample of scenes and variants.

`python -m tests.calibration.ladder` prints the figures. The truth is the largest distance over time between the
model's own history and the full model's, with the same modes and steps, over the largest static value of the sensor.
Arguments: how many scenes, and the seed.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.ladder import ladder, model_errors
from engine.march import march
from engine.plan import Plan, make_plan
from engine.quasistatic import rest
from engine.tables import SceneTables
from results_schema.status import Fidelity, label
from tests.engine.build import Table, beam, cruise, fixed, mass, oscillator, shuttle, study, swing, under

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
SLOWEST, FASTEST = 0.002, 0.6  # alpha
SENSORS = ("displacement", "moment", "moment under")
TOLERANCES = (1e-2, 1e-3, 1e-4)
MOST_SAMPLES = 40_000  # of a history, from which on
THINNEST = 8  # every so many steps are enough: of 200 over a first period
NEGLIGIBLE = 1e-5  # errors below count as none
USELESS = 0.3  # a model that leaves out more, by its estimate and in truth, is not worth a better estimate


@dataclass(frozen=True, eq=False)
class Measured:
    """A scene's variants: told and true errors of one sensor by model, and how they were drawn."""

    supports: str
    motion: str
    kind: str
    sensor: str
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


def drawn(
    random: np.random.Generator, supports: str, motion: str, kind: str, slowest: float = SLOWEST
) -> tuple[Scene, dict[str, Array]]:
    """A random scene, and alpha, mu and zeta of its variants. alpha: top speed over omega_1 L/pi."""
    path = motion_of(motion, random)
    bed = beam(modes=8, supports=SUPPORTS[supports])
    alpha = np.exp(random.uniform(np.log(slowest), np.log(FASTEST), LANES))
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
    tip, bent = (1.0, 0.0) if supports == "free end" else (0.5, 0.5)
    read = (fixed(tip), fixed(bent, "bending_moment"), under("car", "bending_moment"))
    sensors = dict(zip(SENSORS, read, strict=True))
    if supports == "free end":
        del sensors["moment under"]  # there is none under a load at rest
    return Scene(bed, carriage, sweep, sensors), {"alpha": alpha, "mu": mu, "zeta": zeta}


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene with variants, of which every model makes a study."""

    bed: Table
    carriage: Table
    sweep: Table
    sensors: dict[str, Table]

    def plan(self, *sensors: str, **solver: Any) -> Plan:
        """The plan of a model, with some sensors or all."""
        read = {name.replace(" ", "_"): self.sensors[name] for name in sensors or self.sensors}
        return make_plan(study(self.bed, self.carriage, sweep=self.sweep, sensor=read, solver=solver))

    def history(self, fidelity: str, steps: int) -> Array:
        """(H, J, V) readings over the whole motion."""
        plan = self.plan(fidelity=fidelity, steps=steps)
        tables = SceneTables(plan.base, steps, "whole")
        every = min(THINNEST, 1 + tables.timeline.steps // MOST_SAMPLES)
        counts = np.arange(0, tables.timeline.steps + 1, every)
        values = plan.values(plan.buckets[0], np.arange(plan.size))
        return (rest if fidelity == "static" else march)(tables, values, counts, values.size).history

    def told(self, sensor: str) -> dict[Fidelity, Array]:
        """Errors (V,) told beforehand."""
        plan = self.plan(sensor, fidelity="full")
        return model_errors(plan.base, plan.values(plan.buckets[0], np.arange(plan.size)))


def measure(scene: Scene) -> dict[str, tuple[dict[Fidelity, Array], dict[Fidelity, Array]]]:
    """Told and true errors of a scene's variants by sensor."""
    plan = scene.plan(fidelity="full")
    whole = ladder(plan.base, plan.values(plan.buckets[0], np.arange(plan.size)))[-1]
    steps = int(whole.cost.max()) // plan.base.body_modes
    told = {sensor: scene.told(sensor) for sensor in scene.sensors}
    full, still = scene.history("full", steps), scene.history("static", steps)
    largest = np.nanmax(np.abs(still), axis=0)
    true: dict[str, dict[Fidelity, Array]] = {sensor: {} for sensor in scene.sensors}
    for rung in next(iter(told.values())):
        found = still if rung is Fidelity.STATIC else scene.history(label(rung), steps)
        errors = np.nanmax(np.abs(found - full), axis=0) / largest
        for sensor, error in zip(scene.sensors, errors, strict=True):
            true[sensor][rung] = error
    return {sensor: (told[sensor], true[sensor]) for sensor in scene.sensors}


def sample(scenes: int = SCENES, seed: int = SEED, slowest: float = SLOWEST) -> list[Measured]:
    """The random sample."""
    random, found = np.random.default_rng(seed), []
    for number in range(scenes):
        motion = MOTIONS[number % len(MOTIONS)]
        supports = str(random.choice(list(SUPPORTS)))
        kind = "mass" if random.random() < 0.7 else "oscillator"
        scene, drawn_as = drawn(random, supports, motion, kind, slowest)
        for sensor, (told, true) in measure(scene).items():
            found.append(Measured(supports, motion, kind, sensor, told, true, **drawn_as))
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


def accepted(told: Array, true: Array) -> str:
    """By tolerance: how many are within it as told, the share of these that are not, and the median ratio of these."""
    words = []
    for tolerance in TOLERANCES:
        taken = told <= tolerance
        wrong = float(np.mean(true[taken] > tolerance)) if taken.any() else 0.0
        ratio = float(np.median(told[taken] / np.maximum(true[taken], 1e-12))) if taken.any() else np.nan
        words.append(f"{taken.sum():6d} {100.0 * wrong:6.2f} % {ratio:6.2f}")
    return "   ".join(words)


def main() -> None:
    """Print told over true errors by model, sensor and motion, and what tolerances would accept."""
    found = sample(int(sys.argv[1]) if len(sys.argv) > 1 else SCENES, int(sys.argv[2]) if len(sys.argv) > 2 else SEED)
    groups = [(kind, sensor) for kind in ("mass", "oscillator") for sensor in SENSORS]
    print(f"{'told over true':68s} number    least      2 %      5 %   median     95 %   too low")
    for rung in Fidelity:
        for kind, sensor in groups:
            for by in (*[("motion", m) for m in MOTIONS], *[("supports", s) for s in SUPPORTS], ("kind", kind)):
                part = [m for m in found if (m.kind, m.sensor, getattr(m, by[0])) == (kind, sensor, by[1])]
                told, true = joined(part, rung)
                if told.size:
                    print(f"{label(rung):24s} {kind:11s} {sensor:14s} {by[1]:16s} {spread(compared(told, true))}")
    print(f"\n{'accepted, wrongly, median ratio':39s} {TOLERANCES}")
    for rung in Fidelity:
        for kind, sensor in groups:
            told, true = joined([m for m in found if (m.kind, m.sensor) == (kind, sensor)], rung)
            if told.size:
                print(f"{label(rung):24s} {kind:11s} {sensor:14s} {accepted(told, true)}")


def joined(part: list[Measured], rung: Fidelity) -> tuple[Array, Array]:
    """Told and true errors of a model."""
    none = np.zeros(0)
    told, true = ([none, *(getattr(m, of)[rung] for m in part if rung in m.told)] for of in ("told", "true"))
    return np.concatenate(told), np.concatenate(true)


if __name__ == "__main__":
    main()
