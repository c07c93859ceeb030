"""What every variant was computed with, the errors estimated for it and its work: sentences, and entries for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from results_schema.arrays import Array, Mask
from results_schema.lazy_imports import xr
from results_schema.status import Fidelity, SchemeUsed, label
from studies.results.formatting import counted, scientific
from studies.results.results import Results

MODEL, MODES, STEPS, SCHEME = "fidelity_used", "modes_used", "steps_used", "scheme_used"
WORK, ERROR = "work", "error_estimate"
NAMES: Mapping[Fidelity, str] = {
    Fidelity.STATIC: "statics",
    Fidelity.FORCE: "moving force",
    Fidelity.MASS_WITHOUT_CONVECTIVE: "moving mass without convective terms",
    Fidelity.MASS: "moving mass",
    Fidelity.TIED: "tied carriage",
    Fidelity.GIVEN_FRAME: "given frame",
    Fidelity.FRAME: "floating frame",
}


def is_marched(dataset: xr.Dataset) -> bool:
    """Whether variants of a sweep were marched, each with a model, modes and steps of its own."""
    return ERROR in dataset


def of_variants(results: Results, name: str) -> Array:
    """A number of every variant in the sweep's shape; NaN in variants without values, everywhere if there is none."""
    if name not in results.dataset:
        return np.full(results.shape, np.nan)
    values = np.asarray(results.dataset[name].transpose(*results.dims).values, dtype=np.float64)
    return np.where(results.kept.values, values, np.nan)


def known(values: Any) -> Array:
    """(n,) those of the values that are numbers."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    return flat[np.isfinite(flat)]


def models(results: Results) -> list[Fidelity]:
    """The models that variants with values took, cheapest first."""
    return [Fidelity(int(value)) for value in np.unique(known(of_variants(results, MODEL)))]


def told_choices(results: Results) -> list[str]:
    """How many variants took which model with what, by which schemes, and their work; [] of measurements."""
    parts = as_json(results)
    told = [_told(results, part) for part in parts]
    total = sum(part["variants"] for part in parts)
    if total < 2:
        return [f"Computed as {words}." for words in told]
    among = f"{counted(total, 'variant')}{' with values' if total < results.size else ''}"
    rest = "".join(f"; {part['variants']:,}: {words}" for part, words in zip(parts[1:], told[1:], strict=True))
    first = f"{parts[0]['variants']:,} of {among}" if rest else f"All {among}"
    return [f"{first}: {told[0]}{rest}.", *_told_schemes(results), *_told_work(known(of_variants(results, WORK)))]


def as_json(results: Results) -> list[dict[str, Any]]:
    """What `run --json` says of it: one entry for every model that variants took, cheapest first."""
    chosen = of_variants(results, MODEL)
    return [
        _entry(results, model, chosen == model) for model in (models(results) if is_marched(results.dataset) else ())
    ]


def _entry(results: Results, model: Fidelity, which: Mask) -> dict[str, Any]:
    """A model with the ranges of its modes and steps, its largest estimated error and its mean work."""
    found: dict[str, Any] = {"model": label(model), "variants": int(which.sum())}
    for noun, name in (("modes", MODES), ("steps", STEPS)):  # one after the other: there may be very many variants
        values = of_variants(results, name)[which]
        found[noun] = [int(values.min()), int(values.max())]
    schemes = np.unique(known(of_variants(results, SCHEME)[which]))
    errors = of_variants(results, ERROR)[which]
    largest, unknown = float(known(errors).max(initial=-np.inf)), int(np.isnan(errors).sum())
    work = known(of_variants(results, WORK)[which])
    return found | {
        "schemes": [label(SchemeUsed(int(number))) for number in schemes],
        "largest_error_estimate": largest if np.isfinite(largest) else None,
        "without_estimate": unknown,
        "mean_work": float(work.mean()) if work.size else None,
    }


def _told(results: Results, part: Mapping[str, Any]) -> str:
    """An entry in words; of errors only where something is held to a tolerance."""
    model = next(model for model in NAMES if label(model) == part["model"])
    words = [NAMES[model]]
    words += [_span(part[f"{noun}s"], noun) for noun in ("mode", "step") if model is not Fidelity.STATIC]
    if part["largest_error_estimate"] is not None:
        words.append(f"estimated error at most {scientific(part['largest_error_estimate'])}")
    if part["without_estimate"] and "tolerance" in results.dataset and known(results.dataset["tolerance"]).size:
        words.append(f"{part['without_estimate']:,} without an estimate")
    return ", ".join(words)


def _span(ends: list[int], noun: str) -> str:
    """A number or a range of them.

    >>> _span([4, 10], "mode"), _span([1, 1], "mode")
    ('4 to 10 modes', '1 mode')
    """
    low, high = ends
    return counted(low, noun) if low == high else f"{low:,} to {counted(high, noun)}"


def _told_schemes(results: Results) -> list[str]:
    """By which schemes variants were marched, where there are several."""
    marched = of_variants(results, MODEL) > Fidelity.STATIC
    used, counts = np.unique(known(of_variants(results, SCHEME)[marched]), return_counts=True)
    parts = [f"{label(SchemeUsed(int(k)))} {n:,}" for k, n in zip(used, counts, strict=True)]
    return [f"Variants by scheme: {', '.join(parts)}."] if len(parts) > 1 else []


def _told_work(work: Array) -> list[str]:
    """Modes x steps of the variants' own marches."""
    if not work.size:
        return []
    half = f"half of them {np.median(work):,.0f} or fewer" if np.median(work) > 0.0 else "half of them marched nothing"
    return [f"On average a variant took {work.mean():,.0f} modes × steps over a passage or cycle; {half}."]
