"""What pilots tell other variants of the errors by modes that a study fixes where frames move.

`python -m tests.calibration.fixed_modes [--seed N] [--scenes N] [--swept N]` draws scenes with fixed modes as
`tests.calibration.frames` does, of which so many numbers are swept, and takes every fourth variant by turns as one that
is no pilot: what is told it by the twelve others, and by the largest of them, beside a march of four times the modes.
"""

import argparse
from functools import partial
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np

from engine.accuracy.few_pilots import FewPilots
from engine.accuracy.reference import left_over
from engine.floating.model import build
from engine.floating.model_choice import FIRST_MODES, Pilots, with_more_modes
from engine.floating.results import differences, results_of
from engine.linear_algebra import one_thread
from engine.scene.study import Study
from engine.scene.sweep import expand
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from tests.calibration.frames import draw, is_open
from tests.calibration.held import MATTERS

TOLERANCE, TURNS = 1e-3, 4


class Told(NamedTuple):
    """Errors of results over the true ones, those told by the nearest pilots and by all; whether they are held."""

    near: Array
    most: Array
    held: Array


@one_thread()
def judged(seed: int, swept: int, number: int) -> list[Told]:
    """Of a scene; none where modes are open or none is fixed."""
    study = _with_few_axes(draw(seed, number, TOLERANCE), swept, [seed, number])
    if is_open(study):
        return []
    cases, scene = expand(study), study.without_sweep()
    columns, time = cases.columns_of(np.arange(cases.size)), float(scene.data["question"]["duration"])
    values = VariantValues(scene, columns, cases.size)
    marches = with_more_modes(Pilots(scene, values, np.full(cases.size, time), time), FIRST_MODES, 1)
    model, (fixed, twice, four) = build(scene, FIRST_MODES), marches
    change, doubt = differences(model, fixed, twice), differences(model, twice, four)
    error, true = change + left_over(doubt, change), differences(model, fixed, four)
    held = np.array([np.isfinite(result.tolerance) for result in results_of(model)])
    found = []
    for turn in range(TURNS):
        other = np.arange(cases.size) % TURNS == turn
        own = {path: column[~other] for path, column in columns.items()}
        pilots = FewPilots(own, error[:, ~other])
        near = pilots.told({path: column[other] for path, column in columns.items()}, int(other.sum()))
        most = np.fmax.reduce(pilots.error, axis=1)[:, None]
        r, v = np.nonzero((true > np.maximum(MATTERS * TOLERANCE, doubt))[:, other])
        beside = true[:, other][r, v]
        found.append(Told(near[r, v] / beside, most[r, 0] / beside, held[r]))
    return found


def _with_few_axes(study: Study, count: int, seed: list[int]) -> Study:
    """The study with so many of its axes that part all variants, the numbers of others those of its first variant."""
    axes = {name: axis for name, axis in study.data["sweep"].items() if name != "zip"}
    part = [name for name, axis in axes.items() if len(set(axis["values"])) == len(axis["values"])]
    kept = np.random.default_rng(seed).permutation(part)[:count].tolist() if count < len(axes) else list(axes)
    fixed = study.without_sweep().with_values({axes[n]["of"]: axes[n]["values"][0] for n in axes if n not in kept})
    data: dict[str, Any] = fixed.data | {"sweep": {"zip": True} | {name: axes[name] for name in kept}}
    return Study(**{key: value for key, value in data.items() if key != "schema_version"})


def _said(ratios: Array) -> str:
    below, beyond = (100.0 * np.mean(part) for part in (ratios < 1.0, ratios > 30.0))
    return f"below the true error {below:.1f} %, more than 30 times {beyond:.1f} %, median {np.median(ratios):.1f}"


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=20261127)
    parser.add_argument("--scenes", type=int, default=64)
    parser.add_argument("--swept", type=int, default=2)
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    work = partial(judged, given.seed, given.swept)
    with get_context("spawn").Pool(given.processes) as pool:
        rows = [row for part in pool.imap(work, range(given.scenes)) for row in part]
    for words, held in (("held", True), ("told", False)):
        near = np.concatenate([row.near[row.held == held] for row in rows])
        most = np.concatenate([row.most[row.held == held] for row in rows])
        print(f"{words}, {near.size}: by the nearest {_said(near)}; by all {_said(most)}", flush=True)


if __name__ == "__main__":
    main()
