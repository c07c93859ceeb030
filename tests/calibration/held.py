"""How well tolerances are held, and what is told of errors, over a random sample of scenes, each a sweep.

`python -m tests.calibration.held [--seed N] [--scenes FIRST LAST] [--size V] [--tolerances T ...]` chooses for V
variants of every scene (8: they converge by themselves) and judges 8 of them, none a pilot, beside marches of one level
more than the references of pilots have. Every scene follows from seed and number. With `--fixed` each has some of its
numerics fixed, and what counts is what is told of its errors.
"""

import argparse
import time
from collections.abc import Sequence
from functools import partial
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np

from engine.accuracy.results import results_of
from engine.batch.audit import SEED, audit
from engine.batch.plan import Plan
from engine.linear_algebra import one_thread
from results_schema.arrays import Array
from results_schema.errors import BadInput
from tests.calibration.scenes import draw, judged, planned, reads_moment, with_fixed

JUDGED = 8  # variants of a scene
CANNOT_JUDGE = 0.3  # of the tolerance: a truth that may be off by more
MATTERS = 0.01  # of the tolerance: smaller errors need not be told well
GROUPS = "displacements", "with a moment"  # of scenes: without and with one that is read


class Row(NamedTuple):
    """One variant that was judged, of a group of scenes: its worst held error and that of its truth over the tolerance,
    whether the archive marks it; and told over true errors of its held results that matter."""

    scene: int
    group: str
    worst: float
    doubt: float
    marked: bool
    ratios: tuple[float, ...]


def row_of(scene: int, group: str, marked: bool, observed: Array, told: Array, doubt: Array) -> Row:
    """Of the errors (R,) of a variant's held results over the tolerance: observed, told, and those of the truth."""
    matter = (observed > MATTERS) & (observed > doubt)
    ratios = tuple((told[matter] / observed[matter]).tolist())
    return Row(scene, group, float(observed.max()), float(np.nanmax(doubt)), marked, ratios)


@one_thread()
def rows_of(seed: int, size: int, tolerance: float, fixed: bool, number: int) -> list[Row]:
    """The rows of a scene; none where what is fixed breaks a rule."""
    given = draw(seed, number, size, tolerance)
    try:
        plan = planned(with_fixed(given, seed, number) if fixed else given)
    except BadInput:
        return []
    return rows_of_plan(plan, number, GROUPS[reads_moment(number)], tolerance)


def rows_of_plan(plan: Plan, number: int, group: str, tolerance: float) -> list[Row]:
    """The rows of a scene that is planned, by its number."""
    picked = judged(plan, JUDGED, [SEED, number])
    found = audit(plan, picked)
    held = np.array([np.isfinite(result.tolerance) for result in results_of(plan.asked)])
    observed, told, doubt = (part[held] / tolerance for part in (found.observed, found.told, found.doubt))
    rows = []
    for v in range(found.variants.size):
        marked = bool(np.nanmax(told[:, v]) > 1.0 or np.isnan(told[:, v]).any())
        rows.append(row_of(number, group, marked, observed[:, v], told[:, v], doubt[:, v]))
    return rows


def said(rows: Sequence[Row], words: str) -> str:
    """One line on some variants."""
    if not rows:
        return f"{words}: none"
    worst, doubt = (np.array([getattr(row, name) for row in rows]) for name in ("worst", "doubt"))
    missed, doubtful = ~(worst <= 1.0), ~(doubt <= CANNOT_JUDGE)
    marked = np.array([row.marked for row in rows], dtype=np.bool_)
    ratios = np.concatenate([row.ratios for row in rows]) if rows else np.zeros(0)
    return (
        f"{words}: {len(rows)} variants, held {100 * np.mean(~missed):.2f} % ({missed.sum()} missed, of which "
        f"{(missed & marked).sum()} marked and {(missed & doubtful).sum()} with a truth that cannot judge; "
        f"{(missed & ~marked & ~doubtful).sum()} neither); marked though held {100 * np.mean(marked & ~missed):.1f} %; "
        f"told below the true error {100 * np.mean(ratios < 1.0):.1f} %, more than 30 times "
        f"{100 * np.mean(ratios > 30.0):.1f} % of {ratios.size}, median {np.median(ratios):.1f}"
    )


def tell(rows: Sequence[Row], groups: Sequence[str], tolerance: float) -> None:
    """Print a line on each group, and the worst of all rows."""
    for group in groups:
        print(f"{tolerance:g}, {said([row for row in rows if row.group == group], group)}", flush=True)
    worst = sorted(rows, key=lambda row: -row.worst)[:12]
    shown = (f"scene {r.scene}: {r.worst:.2g} (truth {r.doubt:.2g}{', marked' * r.marked})" for r in worst)
    print(f"  worst: {'; '.join(shown)}", flush=True)


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=20240609)
    parser.add_argument("--scenes", type=int, nargs=2, default=(0, 250))
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--tolerances", type=float, nargs="+", default=(1e-2, 1e-3, 1e-4))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--fixed", action="store_true")
    given = parser.parse_args()
    numbers, started = range(*given.scenes), time.perf_counter()
    with get_context("spawn").Pool(given.processes) as pool:
        for tolerance in given.tolerances:
            work = partial(rows_of, given.seed, given.size, tolerance, given.fixed)
            rows = [row for part in pool.imap_unordered(work, numbers) for row in part]
            tell(rows, GROUPS, tolerance)
            print(f"  {time.perf_counter() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
