"""What variants of a sweep are given beside the least that holds, by brute force.

`python -m tests.calibration.cost [--judged N] [--tolerances T ...] [--quantity Q] [--sweeps N --size 1024 --seed S]`: a
sweep of 100,000 passages (speed, mass and damping drawn at random), or scenes of the calibration as sweeps; some
variants that are no pilots are marched with 13 numbers of modes x 16 of steps x 3 schemes, beside 64 modes and 64,000
steps or more.
"""

import argparse
from typing import Any

import numpy as np

import engine
from engine.accuracy.grids import AVERAGE_ACCELERATION, SCALED_FOX_GOODWIN, SceneGrid
from engine.accuracy.results import differences, results_of, worst_held
from engine.batch.plan import Plan
from engine.kernels.schemes import SCHEMES as EVERY
from engine.linear_algebra import one_thread
from engine.march.outcome import Outcome, outcome
from engine.march.step_rules import least_steps
from engine.model.numerics import Numerics
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from tests.calibration.scenes import draw, judged, planned
from tests.engine.build import steel

MODES = (2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64)
CUTS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)  # steps in one of the grid's
REFERENCE = Numerics("full", SCALED_FOX_GOODWIN, True, 64), 2048  # 65,536 steps over a passage
#: The last one as studies take it now, the others as they did before.
SCHEMES = AVERAGE_ACCELERATION, EVERY["fox-goodwin"]({}), SCALED_FOX_GOODWIN
BED = steel(15.0, damping_ratio=0.02)


def passages(size: int, seed: int, tolerance: float, quantity: str) -> Study:
    """Mass ratio to 0.42, speed ratio to 0.64, damping to 5 %."""
    random = np.random.default_rng(seed)
    motion = {"kind": "cruise", "start": 0, "end": 15, "speed": 5}
    swept = {
        "speed": ("carriage.car.motion.speed", random.uniform(1.0, 20.0, size)),
        "mass": ("carriage.car.mass", random.uniform(10.0, 500.0, size)),
        "damping": ("body.bed.damping_ratio", random.uniform(0.0, 0.05, size)),
    }
    return engine.Study(
        kind="passage",
        body={"bed": BED},
        carriage={"car": {"on": "bed", "kind": "mass", "mass": 100, "motion": motion}},
        sensor={"midspan": {"body": "bed", "at": 7.5, "quantity": quantity}},
        sweep={"zip": True} | {name: {"of": key, "values": values.tolist()} for name, (key, values) in swept.items()},
        solver={"tolerance": tolerance},
    )


@one_thread()
def compared(plan: Plan, count: int, seed: int) -> dict[str, Any]:
    """Work of some variants that are no pilots, the least work that holds, and how far what they took is off."""
    assert plan.choice is not None
    [grid] = plan.grids
    picked = judged(plan, count, seed)
    values = VariantValues.of(grid.scene.study, plan.cases, picked)
    numerics, cut = REFERENCE
    truth = march(grid, values, numerics, int(grid.safe_cuts(numerics, values, cut).max()))
    by_scheme = []
    for scheme in SCHEMES:
        work, error = [], []
        for numerics in (Numerics("auto", scheme, True, modes) for modes in MODES):
            column = np.array([_held(plan, grid, values, numerics, cut, truth) for cut in CUTS])
            error.append(np.maximum.accumulate(column[::-1], axis=0)[::-1])  # and all finer steps hold too
            work.append(np.array(CUTS) * grid.unit * grid.model(numerics).body_modes)
        by_scheme.append(np.min(np.where(np.stack(error) <= 1.0, np.stack(work)[..., None], np.inf), axis=(0, 1)))
    before, least = np.min(by_scheme[:-1], axis=0), np.min(by_scheme, axis=0)
    own, off = np.empty(picked.size), np.empty(picked.size)
    for group in plan.groups:
        lanes = np.flatnonzero(np.isin(picked, group.variants))
        if lanes.size:
            part = values.part(lanes)
            found = group.found(part, picked[lanes], plan.choice, lambda: False, "histories")
            own[lanes] = found.used["work"]
            apart = differences(plan.asked, grid.scene, part, found.outcome, truth.of(lanes))
            off[lanes] = worst_held(apart, results_of(plan.asked))
    return {"own": own, "least": least, "before": before, "off": off, "besides": plan.choice.measured.work}


def _held(plan: Plan, grid: SceneGrid, values: VariantValues, numerics: Numerics, cut: int, truth: Outcome) -> Array:
    """(V,) the worst of what is held over its tolerance; infinite where a march is not allowed."""
    allowed = least_steps(grid.model(numerics), values) <= cut * grid.unit
    if not allowed.any():
        return np.full(values.size, np.inf)
    apart = differences(plan.asked, grid.scene, values, march(grid, values, numerics, cut), truth)
    return np.where(allowed, worst_held(apart, results_of(plan.asked)), np.inf)


def march(grid: SceneGrid, values: VariantValues, numerics: Numerics, cut: int) -> Outcome:
    """One march of all variants."""
    model = grid.model(numerics)
    return outcome(grid.asked, grid.tables(model, cut), values, grid.stations(model, cut))


def told(found: dict[str, Any], words: str) -> str:
    """One line."""
    own, least, off = (found[name] for name in ("own", "least", "off"))
    known, before = np.isfinite(least), np.isfinite(found["before"])
    ratio = own[known].mean() / least[known].mean()
    ratio_before = own[before].mean() / found["before"][before].mean()
    beyond, most = np.mean(~(off <= 1.0)), np.quantile(off, 0.99)
    return (
        f"{words}: own work {own.mean():.0f} modes x steps, least {least[known].mean():.0f} (nothing holds "
        f"{np.mean(~known):.1%}), ratio {ratio:.2f}, by the schemes before {ratio_before:.2f}; beyond the tolerance "
        f"{beyond:.2%}, 99 % within {most:.2f} of it; marched besides {found['besides']:.3g} in all"
    )


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=100_000)
    parser.add_argument("--judged", type=int, default=208)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tolerances", type=float, nargs="+", default=(1e-3,))
    parser.add_argument("--quantity", default="displacement")
    parser.add_argument("--sweeps", type=int, default=0)
    given = parser.parse_args()
    for tolerance in given.tolerances:
        if not given.sweeps:
            study = passages(given.size, given.seed, tolerance, given.quantity)
            print(told(compared(planned(study), given.judged, given.seed), f"{tolerance:g}"), flush=True)
        for number in np.random.default_rng(given.seed).permutation(250)[: given.sweeps].tolist():
            plan = planned(draw(20240609, number, given.size, tolerance))
            print(told(compared(plan, given.judged, given.seed), f"{tolerance:g}, scene {number}"), flush=True)


if __name__ == "__main__":
    main()
