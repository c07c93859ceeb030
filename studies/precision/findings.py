"""What a work-precision study says, from the archive's points alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from results_schema.lazy_imports import xr
from results_schema.status import Status
from studies.precision.pareto import (
    Automatic,
    Choice,
    automatic_choices,
    cheapest,
    choices,
    is_out_of_reach,
    step_choices,
)
from studies.precision.variables import COMPARED, MARCHED, QUANTITIES
from studies.results.formatting import counted, listed, number, spanned

READING = (
    "How to read this: a scheme is the rule that takes one step through time, and modes are the shapes of vibration "
    "that are kept. More steps and more modes err less and cost more. Errors are parts of the largest static value, "
    "those of the contact force parts of the weight."
)
USEFUL = 0.01  # error of a solver beyond which its time says nothing
RESOLVED = 0.01  # error from which on a scheme shows its order
_PARTS = {1: "half", 2: "a quarter", 3: "an eighth", 4: "a sixteenth"}


def scheme_words(scheme: str) -> str:
    """A scheme as people write it."""
    return (MARCHED | COMPARED).get(scheme, scheme)


def short_time(seconds: float) -> str:
    """A short time.

    >>> short_time(2.52e-6), short_time(0.0123), short_time(10.0)
    ('2.5 µs', '12 ms', '10 s')
    """
    factor, unit = (1e6, "µs") if seconds < 0.999e-3 else (1e3, "ms") if seconds < 0.999 else (1.0, "s")
    return f"{number(factor * seconds, 2)} {unit}"


def findings(dataset: xr.Dataset, wanted: Sequence[float]) -> list[str]:
    """The answer in sentences, the most important first."""
    scenes, quantities = ([str(name) for name in dataset[dim].values] for dim in ("scene", "quantity"))
    told = [advice(dataset, scene, quantity, wanted) for quantity in quantities for scene in scenes]
    told += [steps_alone(dataset, scene, "history", wanted) for scene in scenes]
    rest = [_orders(dataset), _gain(dataset), _failed(dataset), *_solvers(dataset), _jax(dataset), _references(dataset)]
    return [lead(dataset, max(wanted)), READING, *automatic(dataset), *told, *(text for text in rest if text)]


def advice(dataset: xr.Dataset, scene: str, quantity: str, wanted: Sequence[float]) -> str:
    """What to take for each accuracy in one scene and quantity, steps and modes together."""
    known = _known(dataset, "total_reference_error", scene, quantity)
    said = _advised(choices(dataset, scene, quantity), known, wanted, _with_modes)
    return f"{_named(scene)}, {QUANTITIES[quantity]}: {said}."


def steps_alone(dataset: xr.Dataset, scene: str, quantity: str, wanted: Sequence[float]) -> str:
    """What to take for each accuracy where the modes are given."""
    known = _known(dataset, "reference_error", scene, quantity)
    points = step_choices(dataset, scene, quantity)
    modes = counted(int(dataset["modes_used"].sel(scene=scene).values.flat[0]), "mode")
    said = _advised(points, known, wanted, _taken)
    return f"{_named(scene)}, the error of the steps alone in {QUANTITIES[quantity]}, {modes}: {said}."


def automatic(dataset: xr.Dataset) -> list[str]:
    """How far the program's own choices are from the front, the loosest tolerance first."""
    if "automatic_error" not in dataset:
        return []
    tolerances = sorted(map(float, dataset["asked_tolerance"].values), reverse=True)
    return [_automatic(automatic_choices(dataset, tolerance), tolerance) for tolerance in tolerances]


def _automatic(found: Sequence[Automatic], tolerance: float) -> str:
    """The program's own choices at a tolerance."""
    costs = [(ratio, point.scene) for point in found if (ratio := point.over_front) is not None]
    errors = spanned([point.error / tolerance for point in found], _times)
    beyond = [point.scene for point in found if point.error > tolerance]
    erring = f"Its histories err {errors} times what was asked{f', too much in {listed(beyond)}' if beyond else ''}."
    who = f"The automatic choice at {_plain(tolerance)}"
    if not costs:
        return f"{who} cannot be compared with the front, where no point surely errs so little. {erring}"
    worst, scene = max(costs)
    if len(found) == 1:
        return f"{who} costs {number(worst, 2)} times the front at the error asked. {erring}"
    where = f"in all {len(found)} scenes"
    if len(costs) < len(found):
        where = f"in {len(costs)} of {len(found)} scenes; in the others no point surely errs so little"
    return f"{who} costs at most {number(worst, 2)} times the front at the error asked ({scene}), {where}. {erring}"


def _times(ratio: float) -> str:
    return number(ratio, 2) if np.isfinite(ratio) else "infinitely many"


def _named(scene: str) -> str:
    return f"{scene[:1].upper()}{scene[1:]}"


def _advised(points: Sequence[Choice], known: float, wanted: Sequence[float], words: Callable[[Choice], str]) -> str:
    """known: error of the reference itself, which every choice may have on top of its own."""
    loosest_first = sorted(wanted, reverse=True)
    found = {tolerance: cheapest(points, tolerance, known) for tolerance in loosest_first}
    said = [
        f"for {_plain(tolerance)} take {words(choice)}: {short_time(choice.seconds)} per variant"
        for tolerance, choice in found.items()
        if choice is not None
    ]
    open_to = [tolerance for tolerance, choice in found.items() if choice is None]
    missed = [tolerance for tolerance in open_to if is_out_of_reach(points, tolerance, known)]
    unknown = [tolerance for tolerance in open_to if tolerance not in missed]
    if unknown:
        said.append(f"{_tolerances(unknown)} cannot be judged, as {_good_to([known])}{_nearest(points, known, words)}")
    if missed:
        best = "" if unknown else _nearest(points, known, words)
        said.append(f"{_tolerances(missed)} {'is' if len(missed) == 1 else 'are'} not reached{best}")
    return "; ".join(said)


def _nearest(points: Sequence[Choice], known: float, words: Callable[[Choice], str]) -> str:
    """The choice that errs least, in brackets; its error only where it is more than the reference's own."""
    best = min(points, key=lambda point: point.error, default=None)
    if best is None:
        return ""
    if best.error > known:
        return f" (the best found: {number(best.error, 2)}, {words(best)})"
    return f" (nearer to it than that is {words(best)})"


def _good_to(known: Sequence[float]) -> str:
    """How good references are."""
    span = spanned(known, lambda value: number(value, 2))
    return f"the reference itself is good to {span} only"


def _tolerances(values: Sequence[float]) -> str:
    return listed([_plain(value) for value in values])


def _plain(tolerance: float) -> str:
    return f"{tolerance:.0e}".replace("e-0", "e-") if tolerance < 1e-2 else number(tolerance)


def _taken(choice: Choice) -> str:
    of_pair = f" (and {choice.steps // 2:,} for its other half)" if choice.scheme == "richardson" else ""
    return f"{scheme_words(choice.scheme)} with {choice.steps:,} steps{of_pair}"


def _with_modes(choice: Choice) -> str:
    with_it = "with" if choice.corrected else "without"
    return f"{_taken(choice)} and {counted(choice.modes, 'mode')} {with_it} static correction"


def lead(dataset: xr.Dataset, tolerance: float) -> str:
    """The cheapest way to an accuracy over all scenes, and in how many there is none."""
    taken, missed, unknown = _judged(dataset, tolerance)
    total = len(taken) + missed + len(unknown)
    parts = [f"in {missed} of {counted(total, 'scene')} nothing does"] if missed else []
    if unknown:
        parts.append(f"in {len(unknown)} of {counted(total, 'scene')} it cannot be judged, as {_good_to(unknown)}")
    rest = " and ".join(parts)
    if not taken and not unknown:
        return f"No choice brings whole histories within {_plain(tolerance)} of the static value in any scene."
    if not taken:
        return f"No choice surely brings whole histories within {_plain(tolerance)} of the static value: {rest}."
    counts = Counter(scheme_words(choice.scheme) for choice in taken)
    names = listed([f"{name} in {counted(count, 'scene')}" for name, count in counts.most_common()])
    span = spanned([choice.seconds for choice in taken], short_time)
    steps, modes = (spanned([getattr(choice, key) for choice in taken], number) for key in ("steps", "modes"))
    return (
        f"Whole histories within {_plain(tolerance)} of the static value cost {span} per variant: {steps} steps and "
        f"{modes} {'mode' if modes == '1' else 'modes'}, cheapest by {names}.{f' But {rest}.' if rest else ''}"
    )


def _judged(dataset: xr.Dataset, tolerance: float) -> tuple[list[Choice], int, list[float]]:
    """Over the scenes: cheapest choices for whole histories, how many scenes have none, and errors of the references
    of those scenes where they are too large to tell."""
    taken, missed, unknown = [], 0, []
    for scene in map(str, dataset["scene"].values):
        points, known = choices(dataset, scene, "history"), _known(dataset, "total_reference_error", scene, "history")
        choice = cheapest(points, tolerance, known)
        if choice is not None:
            taken.append(choice)
        elif is_out_of_reach(points, tolerance, known):
            missed += 1
        else:
            unknown.append(known)
    return taken, missed, unknown


def _known(dataset: xr.Dataset, name: str, scene: str, quantity: str) -> float:
    """Error of a reference of one scene and quantity."""
    return float(dataset[name].sel(scene=scene, quantity=quantity))


def _orders(dataset: xr.Dataset) -> str:
    """Which schemes have which measured order, and which have none."""
    orders = dataset["fitted_order"].sel(quantity="history")
    groups: dict[int, list[str]] = {}
    none = []
    for scheme in dataset["scheme"].values:
        known = orders.sel(scheme=scheme).values
        known = known[np.isfinite(known)]
        if known.size:
            shown = f"{scheme_words(str(scheme))} ({spanned(known.tolist())})"
            groups.setdefault(round(float(np.median(known))), []).append(shown)
        elif dataset["error"].sel(scheme=scheme, quantity="history").notnull().any():
            none.append(scheme_words(str(scheme)))
    told = [f"order {order}{_meant(order)}: {listed(names)}" for order, names in sorted(groups.items(), reverse=True)]
    if none:
        told.append(f"not in their order with these steps in any scene: {listed(none)}")
    return f"How fast errors of histories fall with the steps, measured: {'; '.join(told)}." if told else ""


def _meant(order: int) -> str:
    return f" (twice the steps leave {_PARTS[order]} of the error)" if order in _PARTS else ""


def _gain(dataset: xr.Dataset) -> str:
    """How much better Fox-Goodwin is than average acceleration at equal steps, where both are in their order."""
    pair = ("average-acceleration", "fox-goodwin")
    if not set(pair) <= set(dataset["scheme"].values.tolist()):
        return ""
    base, other = (dataset["error"].sel(scheme=name, quantity="history").values for name in pair)
    with np.errstate(all="ignore"):
        ratio = np.where((base < RESOLVED) & (other > 0.0), base / other, np.nan)
    if not np.isfinite(ratio).any():
        return ""
    low, high = (number(float(pick(ratio)), 2) for pick in (np.nanmin, np.nanmax))
    return f"At equal steps, where it is stable, Fox-Goodwin errs {low} to {high} times less than average acceleration."


def _failed(dataset: xr.Dataset) -> str:
    """Which schemes left the finite numbers, and where."""
    diverged = dataset["status"] == int(Status.DIVERGED)
    told = []
    for scheme in dataset["scheme"].values:
        own = diverged.sel(scheme=scheme)
        everywhere = [str(scene) for scene in dataset["scene"].values if own.sel(scene=scene).all()]
        if everywhere:
            told.append(f"{scheme_words(str(scheme))} with any number of steps ({listed(everywhere)})")
        elif own.any():
            worst = int(dataset["step_count"].values[own.any("scene").values].max())
            told.append(f"{scheme_words(str(scheme))} up to {worst:,} steps")
    if not told:
        return ""
    count = int(diverged.sum())
    return f"{counted(count, 'point')} of {diverged.size:,} diverged, which is an answer too: {'; '.join(told)}."


def _solvers(dataset: xr.Dataset) -> list[str]:
    """How much cheaper the march is than SciPy's solvers at the solver's own error, where that is of use."""
    error, seconds = dataset["solver_error"].sel(quantity="history"), dataset["solver_seconds_per_variant"]
    own = dataset["error"].sel(quantity="history").where(dataset["comparison_only"] == 0)
    ratios = []
    for scene in dataset["scene"].values:
        for solver in dataset["solver"].values:
            wanted = float(error.sel(scene=scene, solver=solver))
            if not wanted <= USEFUL:
                continue
            best = dataset["seconds_per_variant"].sel(scene=scene).where(own.sel(scene=scene) <= wanted).min()
            ratios.append(float(seconds.sel(scene=scene, solver=solver) / best))
    known = [ratio for ratio in ratios if np.isfinite(ratio)]
    if not known:
        return []
    threads = str(dataset.attrs.get("threads", ""))
    over = f"{threads} thread{'' if threads == '1' else 's'}" if threads else "all threads"
    span = spanned(known, lambda ratio: number(ratio, 2))
    return [
        f"SciPy's DOP853 and Radau, one variant after another on one thread, need {span} times as long per variant as "
        f"the march of a batch on {over} that is at least as exact on the same equations (errors up to "
        f"{_plain(USEFUL)})."
    ]


def _jax(dataset: xr.Dataset) -> str:
    """How much longer jax.vmap takes for the same scheme and steps, or that it is not there."""
    if "jax_seconds_per_variant" not in dataset:
        return "jax is not installed here, so nothing is said of jax.vmap."
    if "average-acceleration" not in dataset["scheme"].values:
        return ""
    own = dataset["seconds_per_variant"].sel(scheme="average-acceleration", drop=True)
    ratio = (dataset["jax_seconds_per_variant"] / own).values
    low, high = (number(float(pick(ratio)), 2) for pick in (np.nanmin, np.nanmax))
    return f"jax.vmap takes {low} to {high} times as long per variant as the march, both with average acceleration."


def _references(dataset: xr.Dataset) -> str:
    """How far the references can be trusted."""
    steps, total = (float(dataset[name].max()) for name in ("reference_error", "total_reference_error"))
    return (
        f"The references are good to {number(steps, 2)} for steps alone, and to {number(total, 2)} for steps and modes "
        f"together (histories: {number(float(dataset['total_reference_error'].sel(quantity='history').max()), 2)})."
    )
