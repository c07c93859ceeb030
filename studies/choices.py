"""Which model, how many modes and how many steps every variant took, what they left out and cost; sentences of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from results_schema.status import Fidelity, SchemeUsed, label
from studies.results import VARIANT, Axis, Results
from studies.study import is_measuring
from studies.words import counted, percent, scientific

Array = NDArray[np.float64]

MODEL, MODES, STEPS = "fidelity_used", "modes_used", "steps_used"
SCHEME = "scheme_used"
COST = "relative_cost"
ERROR = "error_estimate"
PARTS: Mapping[str, str] = {"error_steps": "steps", "error_modes": "modes", "error_fidelity": "model"}
NAMES: Mapping[Fidelity, str] = {
    Fidelity.STATIC: "statics",
    Fidelity.FORCE: "moving force",
    Fidelity.MASS_WITHOUT_CONVECTIVE: "moving mass without convective terms",
    Fidelity.MASS: "moving mass",
    Fidelity.TIED: "tied carriage",
    Fidelity.FRAME: "floating frame",
}


def is_marched(results: Results) -> bool:
    """Whether variants of a sweep were computed, each with a model, modes and steps of its own."""
    return not is_measuring(str(results.dataset.attrs["study_kind"]))


def of_variants(results: Results, name: str) -> Array:
    """A number of every variant in the sweep's shape; NaN in variants without values, everywhere if nobody tells."""
    if name not in results.dataset:
        return np.full(results.shape, np.nan)
    values = np.asarray(results.dataset[name].transpose(*results.dims).values, dtype=np.float64)
    return np.where(results.kept.values, values, np.nan)


def models(results: Results) -> list[Fidelity]:
    """The models that variants with values took, cheapest first."""
    used = of_variants(results, MODEL)
    return [Fidelity(int(value)) for value in np.unique(used[np.isfinite(used)])]


def by_changes(results: Results) -> list[Axis]:
    """The axes of a grid, that along which model, modes and steps change most often first."""
    varied = [axis for axis in results.axes if len(axis.values) > 1 and axis.dim != VARIANT]
    return sorted(varied, key=lambda axis: -_changes(results, axis))


def _changes(results: Results, axis: Axis) -> float:
    """How often the choice changes along an axis, per line of the grid."""
    place = results.dims.index(axis.dim)
    chosen = np.stack([of_variants(results, name) for name in (MODEL, MODES, STEPS)])
    steps = np.diff(np.nan_to_num(chosen), axis=1 + place)
    return float((steps != 0.0).any(axis=0).sum(axis=place).mean())


def told_choices(results: Results) -> list[str]:
    """How many variants took which model with what, and what it cost beside the full model; [] of measurements."""
    used = models(results) if is_marched(results) else []
    if not used:
        return []
    chosen = of_variants(results, MODEL)
    parts = [(int((chosen == model).sum()), _told(results, model, chosen == model)) for model in used]
    total = sum(count for count, _ in parts)
    if total == 1:
        said = f"Computed as {parts[0][1]}."
    elif len(parts) == 1:
        said = f"All {counted(total, 'variant')}{_with_values(results, total)}: {parts[0][1]}."
    else:
        (count, words), *others = parts
        rest = "".join(f"; {count:,}: {words}" for count, words in others)
        said = f"{count:,} of {counted(total, 'variant')}{_with_values(results, total)}: {words}{rest}."
    return [said, *_told_schemes(results), *_told_cost(results)]


def as_json(results: Results) -> list[dict[str, Any]]:
    """What `run --json` says of it: one entry for every model that variants took, cheapest first."""
    chosen = of_variants(results, MODEL)
    return [_as_json(results, model, chosen == model) for model in (models(results) if is_marched(results) else ())]


def _as_json(results: Results, model: Fidelity, which: NDArray[np.bool_]) -> dict[str, Any]:
    """A model with the ranges of its modes and steps, its largest estimated error and what it took on average."""
    modes, steps, errors, cost = (of_variants(results, name)[which] for name in (MODES, STEPS, ERROR, COST))
    return {
        "model": label(model),
        "variants": int(which.sum()),
        "modes": [int(modes.min()), int(modes.max())],
        "steps": [int(steps.min()), int(steps.max())],
        "schemes": [label(SchemeUsed(int(number))) for number in np.unique(known(of_variants(results, SCHEME)[which]))],
        "largest_error_estimate": float(known(errors).max()) if known(errors).size else None,
        "without_estimate": int(np.isnan(errors).sum()),
        "mean_relative_cost": float(known(cost).mean()) if known(cost).size else None,
    }


def _with_values(results: Results, total: int) -> str:
    return " with values" if total < results.size else ""


def _told(results: Results, model: Fidelity, which: NDArray[np.bool_]) -> str:
    """A model with its modes, steps and error in these variants."""
    words = [NAMES[model]]
    if model is not Fidelity.STATIC:
        words += [_span(of_variants(results, name)[which], noun) for name, noun in ((MODES, "mode"), (STEPS, "step"))]
    if ERROR in results.dataset:
        error = of_variants(results, ERROR)[which]
        known = error[np.isfinite(error)]
        words += [f"estimated error at most {scientific(float(known.max()))}"] if known.size else []
        words += [f"{error.size - known.size:,} without an estimate"] if known.size < error.size else []
    return ", ".join(words)


def _span(values: Array, noun: str) -> str:
    """A number or a range of them.

    >>> _span(np.array([4.0, 10.0, 4.0]), "mode"), _span(np.array([1.0, 1.0]), "mode")
    ('4 to 10 modes', '1 mode')
    """
    low, high = int(values.min()), int(values.max())
    return counted(low, noun) if low == high else f"{low:,} to {counted(high, noun)}"


def _told_schemes(results: Results) -> list[str]:
    """By which schemes variants were marched, where the choice took more than one."""
    marched = of_variants(results, MODEL) > Fidelity.STATIC
    number = of_variants(results, SCHEME)[marched]
    used, counts = np.unique(number[np.isfinite(number)], return_counts=True)
    if used.size < 2:
        return []
    parts = [f"{label(SchemeUsed(int(k)))} {n:,}" for k, n in zip(used, counts, strict=True)]
    return [f"Variants by scheme: {', '.join(parts)}."]


def _told_cost(results: Results) -> list[str]:
    """Modes x steps beside those of the full model."""
    cost = known(of_variants(results, COST))
    if not cost.size:
        return []
    what = "of the full model's modes × steps, checks included"
    if cost.size == 1:
        return [f"It took {percent(float(cost[0]))} {what}."]
    median = float(np.median(cost))
    half = f"half of them took {percent(median)} or less" if median > 0.0 else "half of them marched nothing"
    return [f"On average a variant took {percent(float(cost.mean()))} {what}; {half}."]


def known(values: Any) -> Array:
    """(n,) those of the values that are numbers."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    return flat[np.isfinite(flat)]
