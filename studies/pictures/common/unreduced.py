"""The march of modes beside the unreduced finite-element model: histories, and their dynamic parts alone."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from results_schema.lazy_imports import xr
from studies.pictures.common.figures import BLUE, VERMILION, Figure, draw, legend_of_all, note, on_method, zero_line
from studies.results.formatting import counted, percent, scale_for
from studies.results.results import Results
from studies.runs.unreduced import compared_variants

MOST_SENSORS = 4
STYLES = (("unreduced", "unreduced model", VERMILION, "-", 2.6), ("marched", "march of modes", BLUE, (0, (4, 2)), 1.2))


def pictures(results: Results, group: xr.Dataset | None) -> list[Figure]:
    """One figure of the variant whose dynamic parts differ most; none without the group."""
    if group is None:
        return []
    gaps = np.nan_to_num(np.asarray(group["dynamic_difference"].values, dtype=np.float64))
    sample = int(gaps.max(axis=1).argmax())
    names = _shown(group)
    height = 0.8 + 1.8 * len(names)
    caption = _caption(results, group, sample, len(names))
    gap = percent(float(np.nanmax(np.asarray(group["difference"].values, dtype=np.float64))))
    title = f"The march of modes follows the unreduced finite-element model within {gap} of the range"
    return [on_method(draw("unreduced", title, caption, height, partial(_draw, group, sample, names)))]


def _shown(group: xr.Dataset) -> list[str]:
    """Sensors with a dynamic part first, in the study's order."""
    names = [str(name) for name in group["sensor"].values]
    varies = np.isfinite(group["dynamic_difference"].values).any(axis=0)
    order = sorted(range(len(names)), key=lambda place: (not varies[place], place))
    of_force = group["sensor_quantity"].values == "contact_force"
    forces = [place for place in order if of_force[place]]
    others = [place for place in order if place not in forces]
    picked = [*others[: MOST_SENSORS - min(1, len(forces))], *forces[:1]]
    return [names[place] for place in picked]


def _caption(results: Results, group: xr.Dataset, sample: int, shown: int) -> str:
    of = compared_variants(results, group)[sample]
    freedoms, steps = (int(group[name].values[sample]) for name in ("degrees_of_freedom", "unreduced_steps"))
    left_out = group.sizes["sensor"] - shown
    more = f" {counted(left_out, 'more history')} in the archive.".replace("historys", "histories") if left_out else ""
    whose = f"{of}: " if of else ""
    return (
        f"{whose}left the histories, right their dynamic parts, the history less the static response of the same model "
        f"at the same places. {freedoms:,} degrees of freedom, {steps:,} steps by average acceleration.{more}"
    )


def _draw(group: xr.Dataset, sample: int, names: list[str], drawing: Drawing) -> None:
    rows = drawing.subplots(len(names), 2, squeeze=False, sharex=True)
    picked = group.isel(sample=sample)
    time = np.asarray(picked["elapsed"].values, dtype=np.float64)
    for (left, right), name in zip(rows, names, strict=True):
        one = picked.sel(sensor=name)
        unit = str(one["sensor_unit"].values)
        for axes, parts in ((left, False), (right, True)):
            lines = [np.asarray(one[key].values - parts * one[f"{key}_static"].values) for key, *_ in STYLES]
            finite = [line[np.isfinite(line)] for line in lines]
            scale = scale_for(float(max(np.abs(line).max(initial=0.0) for line in finite)), unit)
            if not finite[0].size:
                note(axes, "nothing recorded")
                continue
            for line, (_, label, colour, style, width) in zip(lines, STYLES, strict=True):
                axes.plot(time, line * scale.factor, color=colour, linestyle=style, linewidth=width, label=label)
            axes.set_title(f"{name}{', dynamic part' if parts else ''}")
            axes.set_ylabel(scale.unit)
        zero_line(right)
    for axes in rows[-1]:
        axes.set_xlabel("time (s)")
    legend_of_all(drawing, rows[0][0])
