"""What a work-precision study says, from the archive's points alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from results_schema.status import Status
from studies.trade import Choice, cheapest, choices, step_choices
from studies.words import counted, listed, number

if TYPE_CHECKING:
    import xarray as xr

_WORDS = {
    "average-acceleration": "average acceleration",
    "linear-acceleration": "linear acceleration",
    "fox-goodwin": "Fox-Goodwin",
    "central-difference": "central difference",
    "hht-alpha": "HHT-alpha (\N{MINUS SIGN}0.05)",
    "generalized-alpha": "generalized-alpha (0.8)",
    "richardson": "a Richardson pair",
    "wilson-theta": "Wilson-theta",
    "rk4": "Runge-Kutta 4",
    "lagged-inertia": "lagged inertia",
    "lagged-convective": "lagged convective terms",
    "picard": "Picard iteration",
    "picard-relaxed": "relaxed Picard iteration",
}
READING = (
    "How to read this: a scheme is the rule that takes one step through time, and modes are the shapes of vibration "
    "that are kept. More steps and more modes err less and cost more. Errors are parts of the largest static value, "
    "those of the contact force parts of the weight."
)
RESOLVED = 0.01  # error from which on a scheme shows its order
QUANTITY_WORDS = {"history": "whole histories", "extremes": "largest values", "contact_force": "the contact force"}
_PARTS = {1: "half", 2: "a quarter", 3: "an eighth", 4: "a sixteenth"}


def scheme_words(scheme: str) -> str:
    """A scheme as people write it."""
    return _WORDS.get(scheme, scheme)


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
    return [_lead(dataset, wanted[0]), READING, *told, *(text for text in rest if text)]


def advice(dataset: xr.Dataset, scene: str, quantity: str, wanted: Sequence[float]) -> str:
    """What to take for each accuracy in one scene and quantity, steps and modes together."""
    known = float(dataset["total_reference_error"].sel(scene=scene, quantity=quantity))
    said = _advised(choices(dataset, scene, quantity), known, wanted, _with_modes)
    return f"{_named(scene)}, {QUANTITY_WORDS[quantity]}: {said}."


def steps_alone(dataset: xr.Dataset, scene: str, quantity: str, wanted: Sequence[float]) -> str:
    """What to take for each accuracy where the modes are given."""
    known = float(dataset["reference_error"].sel(scene=scene, quantity=quantity))
    points = step_choices(dataset, scene, quantity)
    modes = counted(int(dataset["modes_used"].sel(scene=scene).values.flat[0]), "mode")
    said = _advised(points, known, wanted, _taken)
    return f"{_named(scene)}, the error of the steps alone in {QUANTITY_WORDS[quantity]}, {modes}: {said}."


def _named(scene: str) -> str:
    return f"{scene[:1].upper()}{scene[1:]}"


def _advised(points: Sequence[Choice], known: float, wanted: Sequence[float], words: Callable[[Choice], str]) -> str:
    """known: error of the reference itself, below which nothing can be said."""
    judged = [tolerance for tolerance in wanted if tolerance >= known]
    found = {tolerance: cheapest(points, tolerance) for tolerance in judged}
    said = [
        f"for {_plain(tolerance)} take {words(choice)}: {short_time(choice.seconds)} per variant"
        if choice is not None
        else f"{_plain(tolerance)} is not reached"
        for tolerance, choice in found.items()
    ]
    if len(judged) < len(wanted):
        beyond = listed([_plain(tolerance) for tolerance in wanted if tolerance < known])
        said.append(f"{beyond} cannot be judged, as the reference itself is good to {number(known, 2)}")
    best = min(points, key=lambda point: point.error, default=None)
    if best is not None and (len(judged) < len(wanted) or None in found.values()):
        said[-1] += f" (the best found: {number(best.error, 2)}, {words(best)})"
    return "; ".join(said)


def _plain(tolerance: float) -> str:
    return f"{tolerance:.0e}".replace("e-0", "e-") if tolerance < 1e-2 else number(tolerance)


def _taken(choice: Choice) -> str:
    of_pair = f" (and {choice.steps // 2:,} for its other half)" if choice.scheme == "richardson" else ""
    return f"{scheme_words(choice.scheme)} with {choice.steps:,} steps{of_pair}"


def _with_modes(choice: Choice) -> str:
    with_it = "with" if choice.corrected else "without"
    return f"{_taken(choice)} and {counted(choice.modes, 'mode')} {with_it} static correction"


def _lead(dataset: xr.Dataset, tolerance: float) -> str:
    """The cheapest way to the first accuracy over all scenes."""
    scenes = [str(name) for name in dataset["scene"].values]
    found = [cheapest(choices(dataset, scene, "history"), tolerance) for scene in scenes]
    taken = [choice for choice in found if choice is not None]
    if not taken:
        return f"No choice brings whole histories within {_plain(tolerance)} in any scene."
    counts = Counter(scheme_words(choice.scheme) for choice in taken)
    names = listed([f"{name} in {counted(count, 'scene')}" for name, count in counts.most_common()])
    span = _span([choice.seconds for choice in taken], short_time)
    steps, modes = (_span([getattr(choice, key) for choice in taken], number) for key in ("steps", "modes"))
    missed = f" In {len(scenes) - len(taken)} of {counted(len(scenes), 'scene')} nothing does." * (None in found)
    return (
        f"Whole histories within {_plain(tolerance)} of the static value cost {span} per variant: {steps} steps and "
        f"{modes} modes, cheapest by {names}.{missed}"
    )


def _span(values: Sequence[float], words: Callable[[float], str]) -> str:
    ends = dict.fromkeys((words(min(values)), words(max(values))))
    return " to ".join(ends)


def _orders(dataset: xr.Dataset) -> str:
    """Which schemes have which measured order."""
    orders = dataset["fitted_order"].sel(quantity="history")
    groups: dict[int, list[str]] = {}
    for scheme in dataset["scheme"].values:
        known = orders.sel(scheme=scheme).values
        known = known[np.isfinite(known)]
        if known.size:
            ends = dict.fromkeys(number(float(end)) for end in (known.min(), known.max()))
            shown = f"{scheme_words(str(scheme))} ({' to '.join(ends)})"
            groups.setdefault(round(float(known.max())), []).append(shown)
    told = [f"order {order}{_meant(order)}: {listed(names)}" for order, names in sorted(groups.items(), reverse=True)]
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
    """How much cheaper the march is than SciPy's solvers at the solver's own error, one variant against a batch."""
    error, seconds = dataset["solver_error"].sel(quantity="history"), dataset["solver_seconds_per_variant"]
    own = dataset["error"].sel(quantity="history").where(dataset["comparison_only"] == 0)
    ratios = []
    for scene in dataset["scene"].values:
        for solver in dataset["solver"].values:
            reached = own.sel(scene=scene) <= error.sel(scene=scene, solver=solver)
            best = dataset["seconds_per_variant"].sel(scene=scene).where(reached).min()
            ratios.append(float(seconds.sel(scene=scene, solver=solver) / best))
    known = [ratio for ratio in ratios if np.isfinite(ratio)]
    if not known:
        return []
    return [
        f"SciPy's DOP853 and Radau need {number(min(known), 2)} to {number(max(known), 2)} times as long per variant "
        "as the march in a batch that is at least as exact on the same equations."
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
