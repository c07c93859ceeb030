"""How well the choice of models holds its tolerance, and what it saves, over a random sample of scenes and variants.

`python -m tests.calibration.choice [--seed N] [--scenes N] [--moments none] [--tolerance T ...] [--references FOLDER]
[--rows FILE.csv]` runs every variant with all on "auto" and compares what its study reports with a much finer
reference, as an audit does. References take most of the time; a folder keeps them for the next time. `--scene N` looks
at one scene alone, `--verify N` tells how far so many references are from finer ones and from DOP853. Every scene
follows from seed and number.
"""

from __future__ import annotations

import argparse
import csv
import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import count, islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.fidelity import round_up
from results_schema.status import Fidelity, Status, label
from tests.calibration.choice_references import (
    Arrays,
    Reference,
    against_exact,
    against_finer,
    compared,
    full_model,
    largest,
    march,
    plan_of,
    reference_of,
    steps_by_rules,
)
from tests.calibration.choice_references import gaps as reference_gaps
from tests.calibration.choice_scenes import LANES, Scene, draw, reads_moment

Array = NDArray[np.float64]
Row = dict[str, Any]
Rows = Sequence[Row]

SEED = 20240609
SCENES = 250
TOLERANCES = (1e-2, 1e-3, 1e-4)
BAR = 0.99  # of all variants must hold
USUAL_MODES = 20  # of the full model that costs are compared with
CHECKS = 1.75  # a march, one with half its steps and one with half its modes too
DOUBTFUL = 0.3  # of the tolerance: a reference that is further from its companion cannot judge
SHOWN = 12  # worst offenders
PARTS = ("error_estimate", "error_steps", "error_modes", "error_fidelity")


def measured(scene: Scene, reference: Reference, tolerance: float) -> list[Row]:
    """What became of every variant at a tolerance."""
    plan = plan_of(scene.study(tolerance=tolerance))
    started = time.perf_counter()
    own = march(plan)
    seconds = time.perf_counter() - started
    gaps = compared(scene, own, reference.results, reference.silent)
    rough = reference_gaps(scene, reference)
    rules = round_up(steps_by_rules(plan, full_model(plan, USUAL_MODES, plan.study.solver.scheme)))
    checks = CHECKS if "error_estimate" in own else 1.0
    cost = checks * own["modes_used"].astype(float) * own["steps_used"]
    observed, usual = largest(gaps), USUAL_MODES * rules.astype(float)
    told = {name: own.get(name, np.full(LANES, np.nan)) for name in (*PARTS, "relative_cost")}
    return [
        {
            **_drawn(scene, v),
            "tolerance": tolerance,
            "observed": observed[v],
            "worst": _worst(gaps, scene, v),
            **{name: float(values[v]) for name, values in told.items()},
            "reference_gap": rough[v],
            **{name: int(own[name][v]) for name in ("status", "fidelity_used", "modes_used", "steps_used")},
            "separated": int(reference.results["status"][v]),
            "of_worst_case": cost[v] / usual.max(),
            "of_own_steps": cost[v] / usual[v],
            "seconds": seconds,
        }
        for v in range(LANES)
    ]


def _drawn(scene: Scene, v: int) -> Row:
    """How a variant was drawn."""
    motion = scene.motion
    return {
        "scene": scene.number,
        "variant": v,
        "supports": scene.supports,
        "motion": motion["kind"],
        "turn": motion.get("turn", np.nan),
        "cycles": motion.get("cycles", 1),
        "carriage": scene.carriage_kind,
        "moment": int(scene.reads_moment),
        "alpha": scene.alpha[v],
        "mu": scene.mu[v],
        "zeta": scene.zeta[v],
    }


def _worst(gaps: Arrays, scene: Scene, v: int) -> str:
    """The result and the sensor that are furthest off; one without a number before all others."""
    table = np.stack([gap[v] for gap in gaps.values()])
    result, sensor = np.unravel_index(np.argmax(np.where(np.isnan(table), np.inf, table)), table.shape)
    return f"{list(scene.sensors)[sensor]} {list(gaps)[result]}"


def measure(seed: int, tolerances: Sequence[float], folder: Path | None, number: int) -> tuple[list[Row], float, float]:
    """Rows of a scene, and seconds that its reference and its runs took."""
    scene, started = draw(seed, number), time.perf_counter()
    try:
        reference = reference_of(scene, folder)
        referred = time.perf_counter()
        rows = [row for tolerance in tolerances for row in measured(scene, reference, tolerance)]
    except Exception as error:
        error.add_note(f"scene {number} of seed {seed}: {scene.told}")
        raise
    return rows, referred - started, time.perf_counter() - referred


def verify(seed: int, folder: Path | None, number: int) -> tuple[int, Array, Array, float | None]:
    """Distances of a scene's reference from a finer one and from its companion (LANES,), of its march from DOP853."""
    scene = draw(seed, number)
    reference = reference_of(scene, folder)
    return number, against_finer(scene, reference), reference_gaps(scene, reference), against_exact(scene)


def on_all(task: Callable[[int], Any], numbers: Iterable[int], workers: int) -> list[Any]:
    """What a task finds for all numbers, in processes with one thread each."""
    os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    chosen, found, started = list(numbers), [], time.perf_counter()
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for result in pool.map(task, chosen):
            found.append(result)
            if len(found) % 10 == 0:
                print(f"  {len(found)} of {len(chosen)} scenes, {time.perf_counter() - started:.0f} s", flush=True)
    return found


def verdict(row: Row) -> str:
    """What counts as held, and what as which miss: one that the archive marks itself says so."""
    if row["status"] == Status.UNRESOLVED:
        return label(Status.UNRESOLVED)
    if not np.isfinite(row["observed"]):
        return "no number"
    if row["observed"] <= row["tolerance"]:
        return "held"
    return "marked" if row["status"] == Status.TOLERANCE_MISSED else "missed"


def told_tolerance(rows: Rows) -> list[str]:
    """Lines on the rows of one tolerance."""
    tolerance, count = rows[0]["tolerance"], Counter(verdict(row) for row in rows)
    share = count["held"] / len(rows)
    doubtful = [row for row in rows if row["reference_gap"] > DOUBTFUL * tolerance]
    sure = [row for row in rows if row["reference_gap"] <= DOUBTFUL * tolerance]
    sure_share = np.mean([verdict(row) == "held" for row in sure]) if sure else np.nan
    wrong = sum(verdict(row) == "unresolved" and row["observed"] <= tolerance for row in rows)
    said = [
        f"tolerance {tolerance:g}: held in {100 * share:.2f} % of {len(rows)} ({'holds' if share >= BAR else 'MISSES'} "
        f"the bar of {100 * BAR:g} %); " + ", ".join(f"{name} {n}" for name, n in sorted(count.items())),
        f"  reference in doubt in {len(doubtful)}; held in {100 * sure_share:.2f} % of the others; unresolved though "
        f"within the tolerance: {wrong}",
        f"  observed error, quantiles 50/90/95/99/100 %: {_quantiles(rows, 'observed', (50, 90, 95, 99, 100))}",
        f"  {_told_estimates(rows)}",
        f"  {_told_costs(rows)}",
        "  models: "
        + ", ".join(f"{label(Fidelity(f))} {n}" for f, n in sorted(_counts(rows, "fidelity_used").items())),
    ]
    return said + [f"  {line}" for line in (*_told_readings(rows), *_told_groups(rows))]


def _told_readings(rows: Rows) -> list[str]:
    """Displacements alone, and scenes with a bending moment, which converges slowly."""
    said = []
    for moment, name in ((0, "displacements"), (1, "with a bending moment")):
        here = [row for row in rows if row["moment"] == moment]
        if not here:
            continue
        held = [row for row in here if verdict(row) == "held"]
        doubt = sum(verdict(row) != "held" and row["reference_gap"] > DOUBTFUL * row["tolerance"] for row in here)
        marked = sum(row["status"] == Status.TOLERANCE_MISSED for row in held)
        others = len(here) - len(held)
        said.append(
            f"{name}: held in {100 * len(held) / len(here):.2f} % of {len(here)}, {marked} of these marked all the "
            f"same; reference in doubt in {doubt} of the {others} others; median cost over the full model's, "
            f"{USUAL_MODES} modes, steps of the scene's worst case {_quantiles(here, 'of_worst_case', (50,))}"
        )
    return said


def _quantiles(rows: Rows, name: str, wanted: Sequence[float]) -> str:
    values = np.array([row[name] for row in rows if np.isfinite(row[name])])
    return "  ".join(f"{q:.2g}" for q in np.percentile(values, wanted)) if values.size else "none"


def _counts(rows: Rows, name: str) -> Counter[Any]:
    return Counter(row[name] for row in rows)


def _told_estimates(rows: Rows) -> str:
    """How honest the estimates are, where either error is worth a word."""
    worth = [row for row in rows if max(row["observed"], row["error_estimate"]) > 0.01 * row["tolerance"]]
    told = [row for row in worth if np.isfinite(row["error_estimate"]) and row["observed"] > 0.0]
    if not told:
        return "estimates: none are told"
    ratio = np.array([row["error_estimate"] / row["observed"] for row in told])
    quantiles = "  ".join(f"{q:.2g}" for q in np.percentile(ratio, [0, 1, 5, 50, 95, 99]))
    return (
        f"estimated/observed of {len(told)}, quantiles 0/1/5/50/95/99 %: {quantiles}; too low in "
        f"{100 * np.mean(ratio < 1.0):.1f} %, below half in {100 * np.mean(ratio < 0.5):.1f} %"
    )


def _told_costs(rows: Rows) -> str:
    """What the choice costs against the full model everywhere."""
    return (
        f"cost over the full model's, {USUAL_MODES} modes, quantiles 10/50/90/100 %: steps of the scene's worst case "
        f"{_quantiles(rows, 'of_worst_case', (10, 50, 90, 100))}; the variant's own steps "
        f"{_quantiles(rows, 'of_own_steps', (10, 50, 90, 100))}; relative_cost "
        f"{_quantiles(rows, 'relative_cost', (10, 50, 90, 100))}"
    )


def _told_groups(rows: Rows) -> list[str]:
    """Misses by how the variants were drawn."""
    said = []
    for name in ("motion", "carriage", "moment", "supports", "separated"):
        parts = []
        for value in sorted(_counts(rows, name)):
            here = [row for row in rows if row[name] == value]
            parts.append(f"{value} {sum(verdict(row) != 'held' for row in here)}/{len(here)}")
        said.append(f"misses by {name}: " + ", ".join(parts))
    return said


def told_offenders(rows: Rows, seed: int) -> list[str]:
    """The variants that are furthest beyond their tolerance."""
    missed = [row for row in rows if verdict(row) in ("missed", "marked", "no number")]
    missed.sort(key=lambda row: -np.nan_to_num(row["observed"], nan=np.inf))
    return [
        f"    seed {seed} scene {row['scene']:3d}.{row['variant']} {verdict(row)} {row['worst']:18s} off "
        f"{row['observed']:.1e} told {row['error_estimate']:.1e} (reference {row['reference_gap']:.0e}) "
        f"{row['supports']}, {row['motion']} x{row['cycles']} turn {row['turn']:.2g}, {row['carriage']}, "
        f"alpha {row['alpha']:.4f} mu {row['mu']:.3f} zeta {row['zeta']:.3f}; {label(Fidelity(row['fidelity_used']))}, "
        f"{row['modes_used']} modes, {row['steps_used']}"
        for row in missed[:SHOWN]
    ]


def tell(rows: Rows, seed: int) -> None:
    """Print all there is to say of all tolerances."""
    for tolerance in sorted({row["tolerance"] for row in rows}, reverse=True):
        here = [row for row in rows if row["tolerance"] == tolerance]
        print("\n".join([*told_tolerance(here), "  worst offenders:", *told_offenders(here, seed)]), end="\n\n")


def tell_verified(found: Sequence[tuple[int, Array, Array, float | None]]) -> None:
    """Print how far references are from something better."""
    finer, gap = (np.concatenate([part[place] for part in found]) for place in (1, 2))
    trusted = gap <= DOUBTFUL * min(TOLERANCES)
    print("references against finer ones, quantiles 50/90/95/99/100 %:", np.percentile(finer, [50, 90, 95, 99, 100]))
    print(
        f"  those within {DOUBTFUL * min(TOLERANCES):g} of their companions ({trusted.sum()} of {finer.size}):", end=" "
    )
    print(np.percentile(finer[trusted], [50, 90, 95, 99, 100]) if trusted.any() else "none")
    exact = {number: gap for number, _, _, gap in found if gap is not None}
    print("marches against DOP853 with as many modes:", {number: f"{gap:.1e}" for number, gap in exact.items()})


def write(rows: Rows, path: Path) -> None:
    """All rows as CSV."""
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)


def read_arguments() -> argparse.Namespace:
    """What is asked."""
    parser = argparse.ArgumentParser(prog="python -m tests.calibration.choice", description=__doc__)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--scenes", type=int, default=SCENES)
    parser.add_argument("--scene", type=int, nargs="+", help="numbers of scenes to look at alone")
    parser.add_argument("--moments", choices=("all", "none", "only"), default="all", help="scenes that read one")
    parser.add_argument("--tolerance", type=float, nargs="+", default=list(TOLERANCES))
    parser.add_argument("--references", type=Path, help="folder that keeps references")
    parser.add_argument("--rows", type=Path, help="CSV file with a row for every variant and tolerance")
    parser.add_argument("--verify", type=int, default=0, help="compare so many references with finer ones instead")
    parser.add_argument("--workers", type=int, default=2)
    return parser.parse_args()


def main() -> None:
    """Run the benchmark and print its figures."""
    asked, started = read_arguments(), time.perf_counter()
    if asked.verify:
        numbers = np.unique(np.linspace(0, asked.scenes - 1, asked.verify).astype(int)).tolist()
        tell_verified(on_all(partial(verify, asked.seed, asked.references), numbers, asked.workers))
        return
    drawn = (
        number for number in count() if asked.moments == "all" or reads_moment(number) == (asked.moments == "only")
    )
    numbers = asked.scene or list(islice(drawn, asked.scenes))
    found = on_all(partial(measure, asked.seed, asked.tolerance, asked.references), numbers, asked.workers)
    rows = [row for part, _, _ in found for row in part]
    if asked.rows is not None:
        write(rows, asked.rows)
    if asked.scene:
        for number in asked.scene:
            print(f"scene {number}: {draw(asked.seed, number).told}")
    tell(rows, asked.seed)
    referred, ran = (sum(part[place] for part in found) for place in (1, 2))
    print(f"{time.perf_counter() - started:.0f} s; of all workers: references {referred:.0f} s, runs {ran:.0f} s")


if __name__ == "__main__":
    main()
