"""How well tolerances are held in sweeps of tables on two contacts, whose stiffnesses share one scene.

`python -m tests.calibration.contacts [--seed N] [--scenes FIRST LAST] [--size V] [--tolerances T ...]` chooses for V
variants of every scene, whose contacts are up to ten times stiffer and softer, and speeds up to 2.5 times faster and
slower, and judges 8 of them as `tests.calibration.held` does.
"""

import argparse
import time
from functools import partial
from multiprocessing import get_context
from typing import Any

import numpy as np

from engine.linear_algebra import one_thread
from engine.scene.study import Study
from tests.calibration.held import GROUPS, Row, rows_of_plan, tell
from tests.calibration.scenes import planned

STEEL = {"youngs_modulus": 2.1e11, "density": 7850.0}
SUPPORTS = ("pinned-pinned", "clamped-clamped", "pinned-clamped", "clamped-free")


def draw(seed: int, number: int, size: int, tolerance: float) -> Study:
    """A rigid or flexible table that crosses a bed or passes along it, on two springs with dampers."""
    random = np.random.default_rng([seed, number])

    def between(low: float, high: float) -> float:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    length = between(0.8, 30.0)
    second, area = between(1e-7, 1e-5) * length**3, between(1e-3, 1e-2) * length
    bed = STEEL | {"kind": "beam", "length": length, "second_moment": second, "area": area}
    bed |= {"supports": str(random.choice(SUPPORTS)), "damping_ratio": between(0.003, 0.05)}
    stiff, heavy = STEEL["youngs_modulus"] * second, STEEL["density"] * area * length
    own, mass = length * between(0.08, 0.3), heavy * between(0.05, 1.0)
    table: dict[str, Any] = {
        "kind": "rigid",
        "length": own,
        "mass": mass,
        "inertia": mass * own**2 * between(0.06, 0.16),
    }
    if random.random() < 0.4:
        thin = {"area": mass / own / STEEL["density"], "second_moment": second * between(0.02, 0.5)}
        table = STEEL | thin | {"kind": "beam", "length": own, "supports": "free-free", "damping_ratio": 0.02}
    stiffness = 48.0 * stiff / length**3 * between(1.0, 100.0)
    damping = 0.1 * np.sqrt(0.5 * stiffness * mass) * between(0.3, 3.0)
    speed = 0.5 * np.pi * np.sqrt(stiff * length / heavy) / length * 2.0 * between(0.05, 0.5)
    contacts = {
        name: {"at": own * place, "stiffness": stiffness * times, "damping": damping}
        for name, place, times in (("rear", random.uniform(0.05, 0.3), 1.0), ("front", random.uniform(0.7, 0.95), 1.5))
    }
    beyond = own if random.random() < 0.3 else -0.55 * own
    motion = {"kind": "cruise", "start": -beyond, "end": length + beyond, "speed": speed}
    sensor: dict[str, Any] = {"middle": {"body": "bed", "at": 0.5 * length}, "tip": {"body": "table", "at": 0.2 * own}}
    if number % 3 == 0:
        sensor["moment"] = sensor["middle"] | {"quantity": "bending_moment"}
    keys = [f"carriage.car.contacts.{name}" for name in contacts]
    sweep = {
        "stiffness": _sampled([f"{key}.stiffness" for key in keys], size, stiffness, 10.0) | {"spacing": "log"},
        "damping": _sampled([f"{key}.damping" for key in keys], size, damping, 3.0),
        "speed": _sampled(["carriage.car.motion.speed"], size, speed, 2.5),
    }
    car = {"on": "bed", "kind": "body", "body": "table", "contacts": contacts, "motion": motion}
    tables = {"body": {"bed": bed, "table": table}, "carriage": {"car": car}, "sensor": sensor, "sweep": sweep}
    return Study(kind="passage", solver={"tolerance": tolerance}, **tables)


def _sampled(keys: list[str], size: int, middle: float, times: float) -> dict[str, Any]:
    return {"of": keys, "sobol": size, "from": middle / times, "to": middle * times}


@one_thread()
def rows_of(seed: int, size: int, tolerance: float, number: int) -> list[Row]:
    """The rows of a scene."""
    return rows_of_plan(planned(draw(seed, number, size, tolerance)), number, GROUPS[number % 3 == 0], tolerance)


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--scenes", type=int, nargs=2, default=(0, 40))
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--tolerances", type=float, nargs="+", default=(1e-2, 1e-3))
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    started = time.perf_counter()
    with get_context("spawn").Pool(given.processes) as pool:
        for tolerance in given.tolerances:
            work = partial(rows_of, given.seed, given.size, tolerance)
            found = pool.imap_unordered(work, range(*given.scenes))
            tell([row for part in found for row in part], GROUPS, tolerance)
            print(f"  {time.perf_counter() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
