"""What studies of robots on rails answer, in sentences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from results_schema.arrays import Array, Counts, Mask
from results_schema.status import Status
from studies.results.findings_common import in_words, told_statuses
from studies.results.formatting import counted, listed, percent, quantity, spanned
from studies.results.places import extreme
from studies.robots.limits import DOING, told_limits
from studies.robots.tolerance_missed import model_of, told_missed

if TYPE_CHECKING:
    from studies.results.results import Results

MOST_NAMED = 4
HOLDING = "While holding, as after the last move,"
ALIKE = 0.01  # of errors: what differs by less is as good


def answer(results: Results) -> list[str]:
    """Where limits hold, what falls over, what missed its tolerance, the front, errors, deflections, causes of errors,
    statuses."""
    missed = list(told_missed(results))
    others = {status for status, count in results.status_counts.items() if count and status != Status.OK}
    held = list(_held(results))
    works = np.isfinite(results.dataset["error_working"]).any()
    return [
        *told_limits(results),
        *_falls(results),
        *missed,
        *([] if works else held),
        *_front(results),
        *_errors(results),
        *(held if works else []),
        *_statics(results),
        *_deflections(results),
        *_causes(results),
        *_by_modes(results),
        *_beyond_linear(results),
        *([] if missed and others == {Status.TOLERANCE_MISSED} else told_statuses(results)),
    ]


def accuracy(results: Results) -> tuple[str, Array]:
    """What counts as accuracy, in words, and its values (m) over the grid: what any tool is off from where it would
    rest while it works, as what it is off at rest can be taught; in moves, where no robot works."""
    works = bool(np.isfinite(results.dataset["beyond_rest_working"]).any())
    doing, words = ("working", "at work") if works else ("moving", "in moves")
    return words, np.asarray(results.dataset[f"beyond_rest_{doing}"].max("robot").values)


def front(cycle: Array, error: Array) -> Mask:
    """Which points no other one beats in both, or in one and equals in the other (Pareto)."""
    known = np.isfinite(cycle) & np.isfinite(error)
    better = (cycle[None] <= cycle[:, None]) & (error[None] <= error[:, None])
    strictly = better & ((cycle[None] < cycle[:, None]) | (error[None] < error[:, None]))
    return known & ~(strictly & known[None]).any(axis=1)


def of_front(results: Results) -> Counts:
    """Flat numbers of the variants on the front, fastest first, each point once."""
    cycle, error = results.dataset["cycle_time"].values.reshape(-1), accuracy(results)[1].reshape(-1)
    chosen = np.flatnonzero(front(cycle, error))
    chosen = chosen[np.lexsort((error[chosen], cycle[chosen]))]
    points = np.round(np.stack([cycle[chosen], error[chosen]], axis=1), 12)
    return np.asarray(chosen[np.sort(np.unique(points, axis=0, return_index=True)[1])], dtype=np.int64)


def _falls(results: Results) -> Iterator[str]:
    """Variants in which nothing rests."""
    fallen = np.argwhere(results.dataset["status"].values == int(Status.FALLS_OVER))
    if len(fallen):
        where = in_words(results, tuple(fallen[0].tolist()))
        yield (
            f"In {len(fallen):,} of {counted(results.size, 'variant')} a joint cannot hold up what stands on it and "
            f"falls over{', as' if where else ''}{where}. What helps: a `stiffness` of "
            "that joint above mass times gravity times height of what it carries."
        )


def _held(results: Results) -> Iterator[str]:
    """Which variants are least off their plan while all tools hold, as after their last moves, and which most."""
    off = results.dataset["error_holding"].max("robot").transpose(*results.dims).values
    best, most = extreme(off, np.nanargmin), extreme(off)
    if best is None or most is None:
        return
    least, largest, known = float(off[best]), float(off[most]), int(np.isfinite(off).sum())
    if known == 1 or largest <= (1.0 + ALIKE) * least:
        every = "every variant" if known == results.size else f"all {counted(known, 'variant')} with values"
        where = f" in {every} within {percent(ALIKE)}" if known > 1 else in_words(results, most)
        yield f"{HOLDING} tools are off their plan by up to {quantity(largest, 'm')}{where}."
        return
    alike = int(np.count_nonzero(off <= (1.0 + ALIKE) * least))
    many = f", and as little within {percent(ALIKE)} in {counted(alike - 1, 'other variant')}" if alike > 1 else ""
    yield (
        f"{HOLDING} tools are least off their plan{in_words(results, best)}: by up to "
        f"{quantity(least, 'm')}{many}. Most they are{in_words(results, most)}: {quantity(largest, 'm')}."
    )


def _errors(results: Results) -> Iterator[str]:
    for name in results.study.robot:
        part = results.dataset.sel(robot=name)
        off = {"in moves": part["error_moving"].values, "at work": part["error_working"].values}
        places = {words: place for words, values in off.items() if (place := extreme(values)) is not None}
        if not places:
            continue
        told = {words: f"{quantity(float(off[words][place]), 'm')} {words}" for words, place in places.items()}
        where = {words: in_words(results, place) for words, place in places.items()}
        if len(set(where.values())) == 1:
            said = f"{' and '.join(told.values())}{next(iter(where.values()))}"
        else:
            said = ", and ".join(f"{told[words]}{where[words]}" for words in told)
        dynamic = quantity(float(np.nanmax(part["beyond_rest_moving"].values)), "m")
        yield f"The tool of {name} is off by up to {said}; from where it would rest by up to {dynamic} in moves."


def _statics(results: Results) -> Iterator[str]:
    """How often an answer by statics alone would have done, and where not."""
    dataset = results.dataset
    doing = {name: dataset[f"error_{name}"].values for name in DOING}
    largest = np.nanmax(np.nan_to_num(list(doing.values()), nan=-1.0), axis=0)
    known = np.isfinite(dataset["at_rest"].values) & (largest > 0.0)
    if not known.any():
        return
    times = spanned(dataset["at_rest"].values[known], percent)
    done = {name: words for name, words in DOING.items() if np.isfinite(doing[name]).any()}
    off = {name: np.nan_to_num(dataset[f"beyond_rest_{name}"].values[known] / largest[known]).max() for name in done}
    told = listed([f"{percent(float(off[name]))} {words}" for name, words in done.items()])
    limit = percent(results.study.solver.tolerance)
    yield (
        f"Statics alone would do to {limit} of the largest errors for {times} of the time; at other times tools are "
        f"off where they would rest by up to {told}, in parts of their largest errors."
    )


def _causes(results: Results) -> Iterator[str]:
    """What moves where the error is longest, and what is left of it when one robot stands still."""
    from engine.robots.results import moving_at

    dataset = results.dataset
    longest = np.fmax.reduce([dataset[f"error_{doing}"].transpose(*results.dims, "robot") for doing in DOING])
    for r, name in enumerate(results.study.robot):
        index = extreme(longest[..., r])
        if index is not None:
            time = float(dataset["error_largest_time"].sel(robot=name).transpose(*results.dims).values[index])
            moves = moving_at(model_of(results, index), time)
            doing = f"during {listed(moves)}" if moves else "when nothing moves"
            yield f"The error of {name} is longest at {quantity(time, 's')}, {doing}{in_words(results, index)}."
    if "error_without" in dataset:
        for still in results.study.robot:
            left = dataset["error_without"].sel(still=still)
            errors = {name: float(left.sel(robot=name)) for name in results.study.robot if name != still}
            told = ", ".join(f"{name} {quantity(error, 'm')}" for name, error in errors.items() if np.isfinite(error))
            if told:
                yield f"While {still} stands still, the largest errors of the others are: {told}."


def _deflections(results: Results) -> Iterator[str]:
    for name in results.dataset["rail"].values[:MOST_NAMED]:
        values = results.dataset["deflection_largest"].sel(rail=name)
        index = extreme(values)
        if index is not None:
            said = f"{name} goes down by up to {quantity(float(values.values[index]), 'm')}{in_words(results, index)}"
            stress = results.dataset["stress_largest"].sel(rail=name)
            most = extreme(stress)
            if most is not None:
                strained = quantity(float(stress.values[most]), "Pa")
                said += f"; its largest bending stress is {strained}{in_words(results, most)}"
            yield f"{said}."


def _by_modes(results: Results) -> Iterator[str]:
    """What numbers of modes change, and how many are enough."""
    if "error_by_modes" not in results.dataset:
        return
    worst, tolerance = results.dataset["error_by_modes"].max("robot"), results.study.solver.tolerance
    counts, off = worst["mode_count"].values, worst.values
    few = np.flatnonzero(off > tolerance)
    first = int(few[-1]) + 1 if few.size else 0
    holds = f"{counts[first]} are" if first < counts.size else "none of these is"
    yield (
        f"With {listed([f'{count:,}' for count in counts])} modes of every rail errors of tools are off by up to "
        f"{listed([percent(float(part)) for part in off])}, which is known to "
        f"{percent(float(results.dataset['error_by_modes_doubt'].max()))}: {holds} enough for {percent(tolerance)}."
    )


def _beyond_linear(results: Results) -> Iterator[str]:
    """Tools of which more than the tolerance is left out."""
    for name in results.study.robot:
        part = results.dataset["beyond_linear"].sel(robot=name)
        index = extreme(part)
        if index is not None and float(part.values[index]) > results.study.solver.tolerance:
            said = f"up to {percent(float(part.values[index]))}{in_words(results, index)}"
            yield f"Rails that grow shorter as they bend would change the error of {name} by {said}, which is left out."


def _front(results: Results) -> Iterator[str]:
    """The points of cycle time and accuracy that nothing beats."""
    if results.size == 1:
        return
    words, error = accuracy(results)
    chosen, cycle = of_front(results), results.dataset["cycle_time"].values.reshape(-1)
    if not chosen.size:
        return
    named = chosen[np.unique(np.linspace(0, chosen.size - 1, min(MOST_NAMED, chosen.size)).round().astype(int))]
    told = []
    for number in named:
        index = tuple(int(i) for i in np.unravel_index(number, results.shape))
        off = quantity(float(error.reshape(-1)[number]), "m")
        told.append(f"{off} in {quantity(float(cycle[number]), 's', 4)} ({results.at(index)})")
    best = f"{chosen.size} of {results.size} variants {'is' if chosen.size == 1 else 'are'} best, as none is both"
    if chosen.size == results.size:
        best = f"Each of the {results.size} variants trades time for accuracy: none is both"
    yield f"{best} faster and nearer to rest {words}: {'; '.join(told)}."
