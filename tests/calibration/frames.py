"""How well tolerances are held where frames move, over random variants of the built-in studies of that.

`python -m tests.calibration.frames [--seed N] [--variants N] [--tolerances T ...] [--fixed]` draws scenes around
`sliding-mass`, `spin-up`, `free-flyer` and `flexible-arm`, SIZE variants of each, over wider ranges than those of their
own sweeps, and computes them as a run does. Every held result is judged beside marches of its floating frame of 4 and 8
times the steps of the level that told its error and, where modes are open, 1.5 times and twice its modes: the second is
the truth, and by how much they differ is its doubt.
"""

import argparse
import time
from collections import Counter
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np

from engine.floating.converge import converge, levels
from engine.floating.model import FloatingModel, build
from engine.floating.model_choice import choose
from engine.floating.results import Outcome, differences, results_of
from engine.linear_algebra import one_thread
from engine.scene.study import Study, load
from engine.scene.sweep import expand
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from results_schema.status import Status, label
from studies.commands.catalogue import built_in
from tests.calibration.held import Row, row_of, tell
from tests.engine.build import Table

Random = np.random.Generator
Columns = dict[str, Array]

SIZE = 16  # variants of a scene: two blocks of lanes, which take as long however few of them are used
FINER = (4, 1.5), (8, 2.0)  # times the steps that told an error, and times the modes where these are open
MOST_WORK = 3e6  # steps x coordinates of a truth: about ten seconds


class Truth(NamedTuple):
    """The model of a level, and what two much finer marches report, the second of which is the truth."""

    model: FloatingModel
    finer: Outcome
    finest: Outcome


class Judged(NamedTuple):
    """The rows of a scene; of all its variants the status that is told, and that of the truth in words."""

    rows: list[Row]
    statuses: list[tuple[str, str]]


def draw(seed: int, number: int, tolerance: float) -> Study:
    """Scene of a number in the sample of a seed, as a sweep; no other scene has a say in it."""
    random = np.random.default_rng([seed, number])
    name = study_of(number)
    fixed, columns = DRAWN[name](random)
    study = load(built_in()[name]).without_sweep().with_values(fixed)
    axes = {f"axis{n}": {"of": path, "values": column.tolist()} for n, (path, column) in enumerate(columns.items())}
    more: dict[str, Any] = {"sweep": {"zip": True} | axes, "solver": {"tolerance": tolerance}}
    if random.random() < 0.3:
        more["solver"]["fidelity"] = "full"
    if random.random() < 0.3:
        body = next(iter(study.body))
        at = float(random.uniform(0.0, 0.8)) * study.value(f"body.{body}.length")
        more["sensor"] = study.data["sensor"] | {"moment": {"body": body, "at": at, "quantity": "bending_moment"}}
    return Study(**{key: value for key, value in (study.data | more).items() if key != "schema_version"})


def study_of(number: int) -> str:
    """The built-in study around which a scene is drawn."""
    return list(DRAWN)[number % len(DRAWN)]


def _sliding_mass(random: Random) -> tuple[Table, Columns]:
    fixed = {
        "body.beam.modes": _modes(random, 4),
        "body.beam.second_moment": _log(random, 4e-6, 4e-5),
        "question.duration": random.uniform(15.0, 80.0),
    }
    columns = {
        "carriage.load.mass": np.exp(random.uniform(np.log(5.0), np.log(400.0), SIZE)),
        "carriage.load.motion.start": random.uniform(0.3, 14.7, SIZE),
        "carriage.load.motion.speed": random.uniform(-1.0, 1.0, SIZE) * (random.random(SIZE) < 0.5),
        "body.beam.damping_ratio": random.uniform(0.0, 0.08, SIZE) * (random.random(SIZE) < 0.8),
        "carriage.load.motion.friction": random.uniform(0.0, 20.0, SIZE) * (random.random(SIZE) < 0.3),
    }
    if random.random() < 0.3:
        columns["carriage.load.motion.coulomb"] = random.uniform(0.0, 0.1, SIZE)
        columns["carriage.load.motion.slip_speed"] = random.uniform(0.02, 0.2, SIZE)
    return fixed, columns


def _spin_up(random: Random) -> tuple[Table, Columns]:
    stiffens = random.random() < 0.8
    second_moment, lowest = _log(random, 1e-7, 1e-6), 3.8  # rad/s, of the study's own arm, 2e-7 m4
    fixed = {
        "body.arm.modes": _modes(random, 8),
        "body.arm.second_moment": second_moment,
        "frame.arm.stiffening": stiffens,
        "question.duration": 30.0,
    }
    most = 8.0 if stiffens else 0.3 * lowest * np.sqrt(second_moment / 2e-7)  # a fifth is beyond the theory
    columns = {
        "frame.arm.joints.0.motion.rate": random.uniform(0.1, 1.0, SIZE) * most,
        "frame.arm.joints.0.motion.time": random.uniform(5.0, 25.0, SIZE),
        "carriage.load.mass": np.exp(random.uniform(np.log(0.05), np.log(5.0), SIZE)),
        "carriage.load.motion.times.1": random.uniform(4.0, 25.0, SIZE),
        "carriage.load.motion.positions.1": random.uniform(0.5, 10.0, SIZE),
        "body.arm.damping_ratio": random.uniform(0.0, 0.05, SIZE) * (random.random(SIZE) < 0.5),
    }
    return fixed, columns


def _free_flyer(random: Random) -> tuple[Table, Columns]:
    fixed = {
        "body.hull.modes": _modes(random, 5),
        "frame.hull.lateral_modes": int(random.integers(0, 4)),
        "body.hull.second_moment": _log(random, 8e-6, 8e-5),
        "question.duration": random.uniform(20.0, 60.0),
        "carriage.payload.motion.times": [0.0, 10.0, 20.0],
        "carriage.payload.motion.positions": [4.0, 16.0, 4.0],
    }
    columns = {
        "carriage.payload.mass": np.exp(random.uniform(np.log(4.0), np.log(160.0), SIZE)),
        "carriage.payload.height": random.uniform(-1.5, 1.5, SIZE),
        "carriage.payload.motion.times.1": random.uniform(3.0, 17.0, SIZE),
        "carriage.payload.motion.positions.1": random.uniform(1.0, 19.0, SIZE),
        "body.hull.damping_ratio": random.uniform(0.0, 0.03, SIZE),
    }
    rates = {f"frame.hull.joints.0.rate.{axis}": random.uniform(-0.3, 0.3, SIZE) for axis in range(3)}
    return fixed, columns | rates


def _flexible_arm(random: Random) -> tuple[Table, Columns]:
    modes = _modes(random, 4)
    fixed = {
        "body.upper.modes": modes,
        "body.lower.modes": modes,
        "body.upper.second_moment": _log(random, 1e-6, 1e-5),
        "body.lower.second_moment": _log(random, 1e-7, 1e-6),
        "body.payload.mass": _log(random, 0.2, 8.0),
        "question.duration": random.uniform(2.0, 5.0),
    }
    columns = {
        "frame.upper.joints.0.motion.times.1": random.uniform(0.3, 1.9, SIZE),
        "frame.lower.joints.0.motion.times.1": random.uniform(0.3, 1.9, SIZE),
        "frame.upper.joints.0.motion.values.1": random.uniform(-1.5, 1.5, SIZE),
        "frame.lower.joints.0.motion.values.1": random.uniform(-2.0, 2.0, SIZE),
        "body.upper.damping_ratio": random.uniform(0.0, 0.05, SIZE),
        "body.lower.damping_ratio": random.uniform(0.0, 0.05, SIZE),
    }
    return fixed, columns


DRAWN = {
    "sliding-mass": _sliding_mass,
    "spin-up": _spin_up,
    "free-flyer": _free_flyer,
    "flexible-arm": _flexible_arm,
}


def _modes(random: Random, most: int) -> int | str:
    """A number of modes, or none in a tenth of all scenes, which take most of the time."""
    return "auto" if random.random() < 0.1 else int(random.integers(1, most + 1))


def is_open(study: Study) -> bool:
    """Whether it leaves modes of a body open."""
    return any(body.modes_are_open for body in study.body.values())


def _log(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


@one_thread()
def judged(seed: int, tolerance: float, number: int) -> Judged:
    """A scene's variants beside the truth; those that this has no values of are in no row."""
    study = draw(seed, number, tolerance)
    cases, scene = expand(study), study.without_sweep()
    values = VariantValues(scene, cases.columns_of(np.arange(cases.size)), cases.size)
    duration = np.full(cases.size, scene.data["question"]["duration"])
    longest = float(duration.max())
    rung = choose(scene, values, duration, longest)
    found = converge(scene, values, duration, longest, rung)
    rows, statuses = [], []
    for steps in np.unique(found.steps):
        own = np.flatnonzero(found.steps == steps)
        truth, told_as = (
            _truth(rung.of(scene), values.part(own), int(steps), longest, rung.modes),
            _labels(found.status[own]),
        )
        if truth is None:
            statuses += [(word, "too dear") for word in told_as]
            continue
        model, finer, finest = truth
        held = np.array([np.isfinite(result.tolerance) for result in results_of(model)])
        apart, doubt = (differences(model, one, finest)[held] / tolerance for one in (found.outcome.of(own), finer))
        by_fixed = rung.by_fixed.told(values.part(own).columns, own.size)  # the truth keeps these modes
        told = (found.error[:, own] - by_fixed)[held] / tolerance
        for v in np.flatnonzero(~np.isnan(apart).any(axis=0)):
            marked = bool(found.status[own[v]] != Status.OK)
            rows.append(row_of(number, study_of(number), marked, apart[:, v], told[:, v], doubt[:, v]))
        statuses += list(zip(told_as, _labels(finest.status), strict=True))
    return Judged(rows, statuses)


def _labels(status: Array) -> list[str]:
    return [label(Status(int(one))) for one in status]


def _truth(study: Study, values: VariantValues, steps: int, longest: float, modes: int) -> Truth | None:
    """Two much finer marches of the same variants than one of so many steps; None where they take too long."""
    level = next(one for one in levels(study, longest, modes) if one.steps == steps)
    found = []
    for finer, wider in FINER:
        model = build(study, int(modes * wider)) if level.model.is_open else level.model
        count = steps * finer
        if count * model.size > MOST_WORK:
            return None
        fine = replace(level, model=model, steps=count, every=level.every * finer)
        found.append(fine.march(values, np.full(values.size, longest)))
    return Truth(level.model, *found)


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=20240609)
    parser.add_argument("--variants", type=int, default=512)
    parser.add_argument("--tolerances", type=float, nargs="+", default=(1e-3,))
    parser.add_argument("--fixed", action="store_true", help="only scenes whose modes are fixed")
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    numbers, started = list(range(-(-given.variants // SIZE))), time.perf_counter()
    if given.fixed:  # the others take most of the time
        numbers = [number for number in numbers if not is_open(draw(given.seed, number, 1e-3))]
    with get_context("spawn").Pool(given.processes) as pool:
        for tolerance in given.tolerances:
            work = partial(judged, given.seed, tolerance)
            found = dict(zip(numbers, pool.imap(work, numbers), strict=True))
            tell([row for one in found.values() for row in one.rows], list(DRAWN), tolerance)
            for name in DRAWN:
                pairs = Counter(pair for n, one in found.items() if study_of(n) == name for pair in one.statuses)
                shown = (f"{count} {told} ({true})" for (told, true), count in sorted(pairs.items()))
                print(f"  {name}: statuses told (of the truth): {', '.join(shown)}")
            print(f"  {time.perf_counter() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
