"""How well tolerances are held where robots ride on rails, and what is told of errors, over random scenes.

`python -m tests.calibration.robots [--seed N] [--scenes FIRST LAST] [--tolerances T ...]` draws a gantry on two rails
and an arm that hangs from one of them, with other rails, drives, moves and payloads, and judges every result of each
beside marches of 2 and 4 times the elements and modes, and 4 and 8 times the steps: the second is the truth, and by how
much they differ is its doubt. Rows are of histories, of their largest values and of drives, of which the first are
held, but for what a study fixes.
"""

import argparse
import time
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from typing import Any

import numpy as np

from engine.linear_algebra import one_thread
from engine.robots.converge import Ladder, Rung, climb, marched
from engine.robots.model import build
from engine.robots.modes import open_bodies, with_finer_bodies, with_modes
from engine.robots.results import Outcome, are_held, are_largest, are_of_drives, differences, results_of
from engine.scene.study import Study
from tests.calibration.held import Row, row_of, tell
from tests.robots.scenes import scene

FINER = (1, 2), (2, 3)  # times that elements and modes, and steps, are doubled
GROUPS = "histories", "largest values", "drives"
MOST_MODES = 160  # of a rail


def draw(seed: int, number: int, tolerance: float) -> Study:
    """Scene of a number in the sample of a seed."""
    random = np.random.default_rng([seed, number])
    modes = "auto" if random.random() < 0.5 else int(random.integers(4, 20))
    stiffer, elements = float(np.exp(random.uniform(-1.5, 1.5))), int(random.choice([4, 8, 8, 16]))
    given = scene({"stiffer": stiffer, "elements": elements}, solver={"tolerance": tolerance})
    values: dict[str, Any] = {f"body.{name}.modes": modes for name in given.body}
    values |= {f"body.{name}.damping_ratio": float(random.uniform(0.0, 0.05)) for name in given.body}
    for name in given.robot:
        values[f"robot.{name}.acceleration_scale"] = float(np.exp(random.uniform(-1.2, 1.2)))
        values[f"robot.{name}.payload_scale"] = float(random.uniform(0.0, 2.0))
        values[f"robot.{name}.delay"] = float(random.uniform(0.0, 1.0))
    if random.random() < 0.2:
        values["solver.steps"] = int(random.integers(1500, 6000))
    return given.with_values(values)


def finer(ladder: Ladder, rung: Rung, bodies: int, steps: int) -> Outcome:
    """What a march of so many times twice the elements, modes and steps of what is told reports."""
    study = ladder.study
    for _ in range(bodies):
        study = with_finer_bodies(study)
    if open_bodies(study):
        study = with_modes(study, min(MOST_MODES, 2**bodies * ladder.level(rung).model.modes // len(study.body)))
    return marched(replace(ladder, study=study, coarsest=build(study)).level(Rung(0, rung.steps + steps)), "start")


@one_thread()
def judged(seed: int, tolerance: float, number: int) -> list[Row]:
    """The rows of a scene, one of each group."""
    ladder = Ladder.of(draw(seed, number, tolerance), None, 0.5)
    found = climb(ladder, "start")
    if not found.status.values_kept:
        return []
    near, truth = (finer(ladder, found.rung, *more) for more in FINER)
    names = results_of(found.model)
    held = are_held(names)
    true, doubt = (differences(found.model, one, truth) / tolerance for one in (found.outcome, near))
    groups = zip(GROUPS, (held, are_largest(names), are_of_drives(names)), strict=True)
    marked = bool(found.error[held].max() > tolerance)
    return [row_of(number, name, marked, true[own], found.error[own] / tolerance, doubt[own]) for name, own in groups]


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=20261130)
    parser.add_argument("--scenes", type=int, nargs=2, default=(0, 60))
    parser.add_argument("--tolerances", type=float, nargs="+", default=(1e-2,))
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    started = time.perf_counter()
    with get_context("spawn").Pool(given.processes) as pool:
        for tolerance in given.tolerances:
            work = partial(judged, given.seed, tolerance)
            rows = [row for part in pool.imap_unordered(work, range(*given.scenes)) for row in part]
            tell(rows, GROUPS, tolerance)
            print(f"  {time.perf_counter() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
