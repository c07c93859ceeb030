"""How much of the errors that elements of frames leave is told, over a random sample of scenes, each a sweep.

`python -m tests.calibration.elements [--seed N] [--scenes FIRST LAST] [--size V] [--tolerance T]` judges 8 of the V
variants of every scene, none a pilot, beside references with four times the elements. Every scene follows from seed and
number: a bridge of two spans, a gantry, a jib in turn, of members of the default number of elements or fewer.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from multiprocessing import get_context

import numpy as np

from engine.accuracy.reference import Levels, Marches, converge, in_full
from engine.accuracy.results import Result, differences, results_of
from engine.batch.chunk import told_errors
from engine.batch.plan import Plan
from engine.linear_algebra import one_thread
from engine.scene.study import Study
from results_schema.arrays import Array, Counts
from tests.calibration.scenes import judged, planned
from tests.engine.build import Table, cruise, fixed, study

JUDGED = 8  # variants of a scene
TIMES = 4  # the elements
PART = 0.02  # of the tolerance: of references
MATTERS = 1e-4  # smaller errors need not be told well
EVERY = "all"

Random = np.random.Generator
Rows = list[tuple[str, float, float, float]]


def draw(seed: int, number: int, size: int, tolerance: float) -> Study:
    """Scene of a number in the sample of a seed, with variants that differ in speed, load and damping."""
    random = np.random.default_rng([seed, number])
    build = (_bridge, _gantry, _jib)[number % 3]
    bed, length, sensors = build(random, int(random.choice([4, 8, 8, 8, 16])))
    motion = cruise(0.0, length, 1.0, after=float(random.choice([0.0, 0.5, 2.0])))
    car: Table = {"on": "bed", "motion": motion, "kind": "force", "force": 1e4}
    varied = {"carriage.car.force": random.uniform(5e3, 5e4, size)}
    if random.random() < 0.5:
        car: Table = {"on": "bed", "motion": motion, "kind": "mass", "mass": 1e3}
        varied = {"carriage.car.mass": random.uniform(100.0, 2000.0, size)}
    fastest = np.log(length * random.uniform(0.3, 3.0))
    varied |= {
        "carriage.car.motion.speed": np.exp(random.uniform(fastest - 1.5, fastest, size)),
        "body.bed.damping_ratio": random.uniform(0.0, 0.03, size),
    }
    axes = {f"axis{n}": {"of": path, "values": column.tolist()} for n, (path, column) in enumerate(varied.items())}
    tables = {"sensor": sensors, "sweep": {"zip": True} | axes, "solver": {"tolerance": tolerance}}
    return study(bed | {"length": length}, car, **tables, body={"bed": bed})


def _read(places: dict[str, float], pier: str, node: str) -> Table:
    found = {f"{name}_{quantity}": fixed(at, quantity) for name, at in places.items() for quantity in READ}
    found["carried"] = {"body": "bed", "node": pier, "quantity": "support_reaction"}
    return found | {f"{node}_{quantity}": {"body": "bed", "node": node, "quantity": quantity} for quantity in OFF}


READ, OFF = ("displacement", "bending_moment", "acceleration"), ("displacement", "acceleration")


def _bridge(random: Random, elements: int) -> tuple[Table, float, Table]:
    long, short = random.uniform(20.0, 40.0), random.uniform(12.0, 40.0)
    girder = {"area": 1.0, "second_moment": random.uniform(0.3, 2.0), "youngs_modulus": 3e9, "density": 1000.0}
    bed = {
        "kind": "frame",
        "plane": "xz",
        "node": {"west": [0.0, 0.0], "pier": [long, 0.0], "east": [long + short, 0.0]},
        "section": {"girder": girder},
        "member": {
            "long": {"nodes": ["west", "pier"], "section": "girder", "elements": elements},
            "short": {"nodes": ["pier", "east"], "section": "girder", "elements": elements},
        },
        "supports": {"west": "pinned", "pier": ["z"], "east": ["z"]},
        "track": {"members": ["long", "short"]},
    }
    sensors = _read({"middle": 0.5 * long, "place": random.uniform(0.1, 0.9) * (long + short)}, "pier", "pier")
    sensors = {name: one for name, one in sensors.items() if not name.startswith("pier")}
    sensors["spot"] = {"body": "bed", "member": "short", "at": random.uniform(0.1, 0.9) * short}
    return bed, long + short, sensors


def _section(random: Random) -> Table:
    side, wall = random.uniform(0.15, 0.4), 0.012
    second = 2.0 / 3.0 * side**3 * wall
    return {
        "area": 4.0 * side * wall,
        "second_moment": second,
        "second_moment_lateral": second * random.uniform(0.5, 1.0),
        "torsion_constant": side**3 * wall,
        "youngs_modulus": 2.1e11,
        "poissons_ratio": 0.3,
        "density": 7850.0 * random.uniform(1.0, 3.0),
    }


def _gantry(random: Random, elements: int) -> tuple[Table, float, Table]:
    high, wide = random.uniform(2.0, 6.0), random.uniform(5.0, 15.0)
    up, columns = [1, 0, 0], max(2, elements // 2)
    bed = {
        "kind": "frame",
        "node": {"foot": [0, 0, -high], "left": [0, 0, 0], "right": [wide, 0, 0], "end": [wide, 0, -high]},
        "section": {"column": _section(random), "girder": _section(random)},
        "member": {
            "column": {"nodes": ["foot", "left"], "section": "column", "up": up, "elements": columns},
            "girder": {"nodes": ["left", "right"], "section": "girder", "elements": elements},
            "other": {"nodes": ["right", "end"], "section": "column", "up": up, "elements": columns},
        },
        "supports": {"foot": "clamped", "end": "clamped"},
        "track": {"members": ["girder"], "offset": [0.0, random.choice([0.0, 0.2]), 0.0]},
    }
    sensors = _read({"middle": 0.5 * wide, "place": random.uniform(0.1, 0.9) * wide}, "foot", "left")
    sensors["sway"] = {"body": "bed", "node": "left", "direction": [1, 0, 0]}
    return bed, wide, sensors


def _jib(random: Random, elements: int) -> tuple[Table, float, Table]:
    high, wide = random.uniform(2.0, 5.0), random.uniform(2.0, 6.0)
    bed = {
        "kind": "frame",
        "node": {"foot": [0, 0, 0], "head": [0, 0, high], "end": [wide, 0, high]},
        "section": {"column": _section(random), "arm": _section(random)},
        "member": {
            "column": {"nodes": ["foot", "head"], "section": "column", "up": [1, 0, 0], "elements": elements},
            "arm": {"nodes": ["head", "end"], "section": "arm", "elements": elements},
        },
        "supports": {"foot": "clamped"},
        "track": {"members": ["arm"]},
    }
    return bed, wide, _read({"place": random.uniform(0.3, 0.9) * wide}, "foot", "end")


@one_thread()
def rows_of(seed: int, size: int, tolerance: float, number: int) -> Rows:
    """The quantity, told and true error, and that of the truth, of each result of the variants of a scene that are
    judged."""
    plan = planned(draw(seed, number, size, tolerance))
    rows: Rows = []
    for result, errors in errors_of(plan, judged(plan, JUDGED, [seed, number])):
        sensor = plan.study.sensor.get(result.of)
        quantity = "contact_force" if sensor is None else sensor.quantity
        rows += [(quantity, *map(float, row)) for row in errors.T]
    return rows


def errors_of(plan: Plan, variants: Counts) -> Iterator[tuple[Result, Array]]:
    """Every result but places, which jump, with the told and true errors of some variants of one scene, and those of
    the truth (3, n)."""
    found = []
    for group in plan.groups:
        own = np.intersect1d(variants, group.variants)
        if own.size:
            values, levels = plan.values(group, own), in_full(group.grid)
            now = group.found(values, own, plan.choice, lambda: False, "histories")
            finer = Levels(tuple(one._replace(elements=TIMES) for one in levels.numerics), levels.steps)
            truth = converge(Marches(group.grid, values, finer), PART)
            true = differences(plan.asked, group.scene, values, now.outcome, truth.outcome)
            found.append(np.stack([told_errors(now, plan.asked), true, truth.error], axis=1))
    for result, errors in zip(results_of(plan.asked), np.concatenate(found, axis=2), strict=True):
        if not result.name.endswith("_position"):
            yield result, errors


def said(rows: Rows, words: str) -> str:
    """One line on some results."""
    told, true, doubt = (np.array([row[k] for row in rows]) for k in (1, 2, 3))
    own = (true > MATTERS) & (doubt < 0.3 * true) & np.isfinite(told)
    if not own.any():
        return f"{words}: none of {len(rows)}"
    ratios = told[own] / true[own]
    low, most = np.quantile(ratios, [0.02, 0.9])
    return (
        f"{words}: {ratios.size} of {len(rows)} ({np.count_nonzero(~np.isfinite(told))} untold), told no less "
        f"{100 * np.mean(ratios >= 1.0):.1f} %, 2 % below {low:.2f}, median {np.median(ratios):.2f}, 90 % {most:.1f}; "
        f"true median {np.median(true[own]):.1e}"
    )


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=20261126)
    parser.add_argument("--scenes", type=int, nargs=2, default=(0, 24))
    parser.add_argument("--size", type=int, default=8)
    parser.add_argument("--tolerance", type=float, default=1e-3)
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    with get_context("spawn").Pool(given.processes) as pool:
        work = partial(rows_of, given.seed, given.size, given.tolerance)
        rows = [row for part in pool.imap_unordered(work, range(*given.scenes)) for row in part]
    groups = defaultdict[str, Rows](list)
    for row in rows:
        groups[row[0]].append(row)
    for words, own in (groups | {EVERY: rows}).items():
        print(said(own, words), flush=True)


if __name__ == "__main__":
    main()
