"""Some variants of a study once more by the unreduced finite-element model: the archive's group, and what it says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array
from results_schema.gravest_status import lost
from results_schema.lazy_imports import xr
from results_schema.variables import axes, declarations, sensor_unit
from studies.results.formatting import counted, listed, percent
from studies.results.places import spread
from studies.results.results import Results

if TYPE_CHECKING:
    from engine.batch.plan import Plan
    from engine.unreduced.comparison import Compared


GROUP = "/unreduced"
FLAT = 1e-9  # of the largest value: a smaller range is rounding
MOST_NAMES = 4


def unreduced_group(plan: Plan, dataset: xr.Dataset, check: Callable[[], None] = lambda: None) -> dict[str, xr.Dataset]:
    """The group of an archive by its path, {} where the study asks for none or no variant has values.

    dataset: the study's own. check: called now and then, to stop by what it raises.
    """
    from engine.march.outcome import USED
    from engine.unreduced.comparison import compare_variant

    variants = _chosen(plan, dataset)
    found = []
    for variant in variants:
        check()
        used = {name: dataset[name].values.reshape(-1)[[variant]] for name in USED}
        found.append(compare_variant(plan, variant, used, check))
    return {GROUP: _dataset(variants, found)} if found else {}


def _chosen(plan: Plan, dataset: xr.Dataset) -> list[int]:
    """Flat numbers of variants with values, spread over the sweep."""
    kept = np.flatnonzero(~lost(dataset["status"].values.ravel()))
    wanted = plan.study.output.unreduced
    return [int(kept[place]) for place in spread(len(kept), wanted)] if wanted and len(kept) else []


def _dataset(variants: Sequence[int], found: Sequence[Compared]) -> xr.Dataset:
    stations = max(one.elapsed.size for one in found)
    declared = {variable.name: variable for variable in declarations(GROUP)}
    quantities = found[0].quantities
    arrays: dict[str, NDArray[Any]] = {
        name: np.stack([_filled(getattr(one, name), stations) for one in found])
        for name in ("marched", "marched_static", "unreduced", "unreduced_static", "elapsed", "position")
    }
    arrays |= {name: np.array([gaps[name] for gaps in map(_gaps, found)]) for name in _gaps(found[0])}
    arrays["sensor_quantity"] = np.array(list(quantities.values()))
    arrays["degrees_of_freedom"] = np.array([one.degrees_of_freedom for one in found])
    arrays["unreduced_steps"] = np.array([one.steps for one in found])
    return xr.Dataset(
        {name: declared[name].holding(array) for name, array in arrays.items()},
        coords={
            "sample": ("sample", np.array(variants, dtype=np.int64), axes()["sample"].attributes()),
            "sensor": ("sensor", list(quantities), axes()["sensor"].attributes()),
            "sensor_unit": axes()["sensor_unit"].holding(
                [sensor_unit(one) for one in quantities.values()], ("sensor",)
            ),
            "station": ("station", np.arange(stations, dtype=np.int64), axes()["station"].attributes()),
        },
    )


def _filled(array: Array, stations: int) -> Array:
    pad = [(0, 0)] * (array.ndim - 1) + [(0, stations - array.shape[-1])]
    return np.pad(array, pad, constant_values=np.nan)


def _gaps(one: Compared) -> dict[str, Array]:
    """(J,) the numbers of every sensor."""
    dynamic, marched_dynamic = one.unreduced - one.unreduced_static, one.marched - one.marched_static
    size = _scales(one)
    spans = [_span(history, size) for history in (one.unreduced, dynamic, one.unreduced_static)]
    pairs = ((one.marched, one.unreduced), (marched_dynamic, dynamic), (one.marched_static, one.unreduced_static))
    gaps = [_largest(left - right) / span for (left, right), span in zip(pairs, spans, strict=True)]
    return {
        "difference": gaps[0],
        "dynamic_difference": gaps[1],
        "static_difference": gaps[2],
        "dynamic_range": spans[1] / spans[0],
    }


def _scales(one: Compared) -> Array:
    """(J,) largest values; of forces the largest of all, beside which one may be rounding as a whole."""
    found, forces = _largest(one.unreduced), [sensor_unit(q) == "N" for q in one.quantities.values()]
    return np.where(forces, found.max(initial=0.0, where=forces), found)


def _largest(values: Array) -> Array:
    return np.asarray(np.max(np.abs(values), axis=1, initial=0.0, where=np.isfinite(values)))


def _span(values: Array, size: Array) -> Array:
    """(J,) range of histories; NaN where it is rounding beside the largest value."""
    known = np.isfinite(values)
    span = np.max(values, axis=1, initial=-np.inf, where=known) - np.min(values, axis=1, initial=np.inf, where=known)
    return np.asarray(np.where(span > FLAT * size, span, np.nan))


def told_unreduced(group: xr.Dataset | None) -> list[str]:
    """What the group says, in sentences; [] where there is none."""
    if group is None:
        return []
    count, freedoms = group.sizes["sample"], int(group["degrees_of_freedom"].values.max())
    model = f"the unreduced finite-element model of {freedoms:,} degrees of freedom"
    said = [f"Against {model}, in {counted(count, 'variant')}: {_worst(group)}."]
    large = group["dynamic_range"].max("sample")
    known = [str(name) for name in group["sensor"].values[np.isfinite(large.values)]]
    if known:
        parts = [f"{percent(float(large.sel(sensor=name)))} at {name}" for name in known[:MOST_NAMES]]
        said.append(f"The dynamic part is as large as this part of the whole range: {listed(parts)}.")
    return said


def _worst(group: xr.Dataset) -> str:
    """The largest differences of displacements and the like, and of contact forces, in words."""
    force = np.asarray(group["sensor_quantity"].values == "contact_force")
    parts = []
    for which, words in ((~force, "every sensor"), (force, "contact forces")):
        whole = np.asarray(group["difference"].values)[:, which]
        dynamic = np.asarray(group["dynamic_difference"].values)[:, which]
        if np.isfinite(whole).any():
            within = f"{words} within {percent(float(np.nanmax(whole)))} of the range"
            alone = f", the dynamic part alone within {percent(float(np.nanmax(dynamic)))} of its own"
            parts.append(within + alone * bool(np.isfinite(dynamic).any()))
    return "; ".join(parts) if parts else "no sensor varies"


def compared_variants(results: Results, group: xr.Dataset) -> list[str]:
    """The swept numbers of the group's variants in words."""
    return [results.at(results.index_of(int(flat))) for flat in group["sample"].values]
