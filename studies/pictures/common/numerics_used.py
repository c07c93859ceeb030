"""Which model, how many modes and how many steps every variant of a sweep was computed with."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm
from matplotlib.figure import Figure as Drawing
from matplotlib.patches import Patch

from results_schema.arrays import Array
from results_schema.status import Fidelity
from studies.findings.numerics_used import MODEL, MODES, NAMES, STEPS, WORK, is_marched, known, models, of_variants
from studies.pictures.common import figures as look
from studies.pictures.common.figures import Figure, colour_bar, draw, logarithmic, on_method
from studies.pictures.common.sweep_view import DAMPING, MASSES, View, along_axis, draw_map, view
from studies.results.axes import PACES, VARIANT
from studies.results.formatting import counted, listed
from studies.results.places import spread
from studies.results.results import Results

NOTHING = "#bcc3cb"  # where no step was marched
COLOURS = {
    Fidelity.STATIC: NOTHING,
    Fidelity.FORCE: look.SKY,
    Fidelity.MASS_WITHOUT_CONVECTIVE: look.GREEN,
    Fidelity.MASS: look.BLUE,
    Fidelity.TIED: look.PURPLE,
    Fidelity.GIVEN_FRAME: look.VERMILION,
    Fidelity.FRAME: look.ORANGE,
}
NOUNS = {MODEL: "model", MODES: "modes", STEPS: "steps"}
MOST_TICKS = 4
VECTOR_CELLS = 1000  # of one map


def pictures(results: Results) -> list[Figure]:
    """The choice over the sweep; nothing of what is the same in all variants."""
    varied = [name for name in NOUNS if np.unique(known(of_variants(results, name))).size > 1]
    if not varied or not is_marched(results.dataset):
        return []
    seen = chosen_view(results)
    alike = [_alike(results, name) for name in NOUNS if name not in varied]
    what = f"{listed([NOUNS[name] for name in varied])} of every variant shown".capitalize()
    caption = seen.caption(f"{what}.", f"All: {listed(alike)}." if alike else "")
    height = 3.4 if seen.y is not None else 0.6 + 1.35 * len(varied)
    fill = partial(_draw_maps if seen.y is not None else _draw_lines, seen, varied)
    return [on_method(draw("choice", _title(known(of_variants(results, WORK))), caption, height, fill))]


def _alike(results: Results, name: str) -> str:
    """What is the same in all variants, in words."""
    value = int(known(of_variants(results, name))[0])
    return NAMES[Fidelity(value)] if name == MODEL else counted(value, NOUNS[name].removesuffix("s"))


def _title(work: Array) -> str:
    """What most variants took, and the dearest."""
    if not work.size:
        return "What variants were computed with"
    half = f"took {np.median(work):,.0f} modes × steps or fewer" if np.median(work) else "needed statics alone"
    return f"Half of the variants {half}, none more than {work.max():,.0f}"


def chosen_view(results: Results) -> View:
    """Along the pace, and along the other axis on which the choice changes most often."""
    chosen = np.nan_to_num(np.stack([of_variants(results, name) for name in NOUNS]))
    changes = {}
    for axis in results.axes:
        if len(axis.values) > 1 and axis.dim != VARIANT:
            changed = np.diff(chosen, axis=1 + results.dims.index(axis.dim)) != 0.0
            changes[f".{axis.paths[0]}"] = changed.any(axis=0).sum() * len(axis.values)
    ranked = sorted(changes, key=lambda path: -changes[path])
    return view(results, (*PACES, *ranked), (*ranked, *MASSES, *DAMPING))


def _draw_maps(seen: View, varied: list[str], drawing: Drawing) -> None:
    """One map beside the other, the keys above."""
    assert seen.x is not None and seen.y is not None
    row = drawing.subplots(1, len(varied), squeeze=False, sharex=True, sharey=True)[0]
    for axes, name in zip(row, varied, strict=True):
        values = of_variants(seen.results, name)
        if name == MODEL:
            used = models(seen.results)
            places = np.where(np.isfinite(values), np.searchsorted(used, np.nan_to_num(values)), np.nan)
            _map(axes, seen, places, [COLOURS[model] for model in used])
            axes.set_title("model")
            keys = [Patch(color=COLOURS[model], label=NAMES[model]) for model in used]
            drawing.legend(handles=keys, loc="outside upper left", ncols=len(keys), handlelength=1.0)
        else:
            _draw_numbers(axes, seen, values, NOUNS[name], "top" if len(varied) > 1 else "right")
        axes.set_xlabel(seen.x.title)
    row[0].set_ylabel(seen.y.title)


def _draw_numbers(axes: Axes, seen: View, values: Array, label: str, side: str) -> None:
    """A map of whole numbers with its bar; grey where they are 0, as nothing was marched."""
    if (values == 0.0).any():
        _map(axes, seen, np.where(values == 0.0, 0.0, np.nan), [NOTHING])
    levels = np.unique(known(values[values > 0.0]))
    mesh = _map(axes, seen, np.where(values > 0.0, values, np.nan), LogNorm(levels[0] / 1.01, levels[-1] * 1.01))
    ticks = [float(levels[place]) for place in spread(levels.size, MOST_TICKS)]
    colour_bar(axes, mesh, label, location=side).set_ticks(ticks, labels=[f"{tick:,.0f}" for tick in ticks])


def _map(axes: Axes, seen: View, values: Array, colours: list[str] | LogNorm) -> Any:
    """A map of numbers in the sweep's shape; in a list of colours of 0, 1, ... . Large ones are pictures, as there are
    several in one figure."""
    style: dict[str, Any] = {"cmap": look.SEQUENTIAL, "norm": colours}
    if isinstance(colours, list):
        places = np.arange(len(colours) + 1) - 0.5
        style = {"cmap": ListedColormap(colours), "norm": BoundaryNorm(places, len(colours))}
    mesh = draw_map(axes, seen, seen.results.dataset["status"].copy(data=values), **style)
    mesh.set_rasterized(np.size(mesh.get_array()) > VECTOR_CELLS)
    return mesh


def _draw_lines(seen: View, varied: list[str], drawing: Drawing) -> None:
    """One row below the other along the one axis there is; points alone where that is sampled."""
    assert seen.x is not None
    rows = drawing.subplots(len(varied), 1, squeeze=False, sharex=True)[:, 0]
    style = {"linestyle": ""} if seen.is_sampled else {"drawstyle": "steps-mid", "linewidth": 1.0}
    for axes, name in zip(rows, varied, strict=True):
        values = seen.plane(seen.results.dataset["status"].copy(data=of_variants(seen.results, name)))
        if name == MODEL:
            used = models(seen.results)
            values = np.where(np.isfinite(values), np.searchsorted(used, np.nan_to_num(values)), np.nan)
            axes.set_yticks(range(len(used)), [NAMES[model].replace(" without", "\nwithout") for model in used])
            axes.set_ylim(-0.5, len(used) - 0.5)
        at = seen.points if seen.is_sampled else slice(None)
        axes.plot(seen.along(seen.x)[at], values[at], color=look.BLUE, marker="o", markersize=3.0, **style)
        axes.set_ylabel("" if name == MODEL else NOUNS[name])
        if name != MODEL and not (values == 0.0).any():
            logarithmic(axes.yaxis)
    along_axis(rows[-1], seen)
