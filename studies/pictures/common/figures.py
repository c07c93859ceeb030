"""The common look of all figures, and how they become SVG and PNG.

Figures are drawn without pyplot (no global state, no display). No text is read as mathematics, so that a title such as
"$x$ {{7*7}}" stands as it was written.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from html import escape
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import FigureCanvasBase as Canvas
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure as Drawing
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from results_schema.arrays import Array
from studies.results.formatting import ALIKE, number

INK, MUTED, HAIR = "#22272e", "#69707a", "#d9dde2"
LIMIT = "_limit"  # the label of lines at limits, which legends leave out
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"
DISTINCT = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
SEQUENTIAL = "viridis"
FEW_DECADES = 300.0
FLAT = 0.05  # of the largest value, shown to either side of what is constant

BESIDE: Mapping[str, Any] = {
    "loc": "upper left",
    "bbox_to_anchor": (1.01, 1.02),
    "alignment": "left",
    "borderpad": 0.0,
}
SCREEN, FINE = 100.0, 200.0  # dots per inch: of pictures in SVG, of PNG
WIDTH = 7.6  # inches: the width of the page's column
STYLE: Any = {
    "text.parse_math": False,
    "text.color": INK,
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.labelsize": 8.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "grid.color": HAIR,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "xtick.minor.size": 0.0,
    "ytick.minor.size": 0.0,
    "lines.linewidth": 1.5,
    "lines.markersize": 4.0,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "legend.title_fontsize": 8.0,
    "savefig.facecolor": "white",
    "svg.fonttype": "path",
    "path.simplify_threshold": 0.3,
}


@dataclass(frozen=True, eq=False)
class Figure:
    """A drawing with its plain file name, its title and its caption.

    on_method: it shows how exact the answer is or how it was computed, not the answer. moving: an SVG element without
    script that shows in pages what the drawing holds of one instant.
    """

    name: str
    title: str
    caption: str
    drawing: Drawing
    on_method: bool = False
    moving: str = ""

    def _repr_html_(self) -> str:
        """How notebooks show it."""
        return f"<h4>{escape(self.title)}</h4>{svg(self)}<p>{escape(self.caption)}</p>"


def draw(name: str, title: str, caption: str, height: float, fill: Callable[[Drawing], None]) -> Figure:
    """A figure of the page's width and `height` inches, filled by `fill` in the common look."""
    with matplotlib.rc_context(STYLE):
        drawing = Drawing(figsize=(WIDTH, height), layout="constrained")
        FigureCanvasAgg(drawing)
        fill(drawing)
    return Figure(plain_name(name), title, caption, drawing)


def on_method(figure: Figure) -> Figure:
    """The figure as one that shows how exact the answer is or how it was computed."""
    return replace(figure, on_method=True)


def _settle(figure: Figure) -> None:
    """Lay the figure out once and keep that: every further layout would differ in the last digit."""
    engine = figure.drawing.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        engine.execute(figure.drawing)
        figure.drawing.set_layout_engine("none")


@contextmanager
def _printed(figure: Figure, canvas: type[Canvas], dots: float) -> Iterator[Any]:
    """The canvas of a figure that is laid out, with so many dots per inch. It prints with one drawing of everything;
    `savefig` takes one more to find a layout that is there."""
    drawing, own, usual = figure.drawing, figure.drawing.canvas, figure.drawing.dpi
    _settle(figure)
    try:
        drawing.set_dpi(dots)
        yield canvas(drawing)
    finally:
        drawing.set_canvas(own)
        drawing.set_dpi(usual)


def plain_name(text: str) -> str:
    """A file name of small letters, digits and dashes, whatever the text holds.

    >>> plain_name("../a <script> Title/"), plain_name("???")
    ('a-script-title', 'figure')
    """
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")[:60].strip("-") or "figure"


def svg(figure: Figure) -> str:
    """The figure as an SVG element that may stand in a page beside others; the same figure gives the same text."""
    if figure.moving:
        return figure.moving
    stream = io.StringIO()
    style = {**STYLE, "svg.hashsalt": figure.name}
    with matplotlib.rc_context(style), _printed(figure, FigureCanvasSVG, SCREEN) as canvas:
        canvas.print_svg(stream, metadata={"Date": None, "Creator": None})
    text = stream.getvalue()
    # matplotlib repeats every text as a comment.
    element = re.sub(r"<!--.*?-->\n?", "", text[text.index("<svg") :], flags=re.DOTALL)
    # Identifiers must differ between the figures of one page.
    element = re.sub(r'\bid="', f'id="{figure.name}-', element)
    return re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{figure.name}-", element)


def png(figure: Figure) -> bytes:
    """The figure as PNG."""
    stream = io.BytesIO()
    with matplotlib.rc_context(STYLE), _printed(figure, FigureCanvasAgg, FINE) as canvas:
        canvas.print_png(stream, metadata={"Software": None})
    return stream.getvalue()


def shades(count: int) -> list[Any]:
    """Colours of `count` ordered values, dark to light but never pale; colour-blind safe."""
    colours = matplotlib.colormaps[SEQUENTIAL]
    return [colours(0.9 * i / max(1, count - 1)) for i in range(count)] if count > 1 else [BLUE]


def logarithmic(axis: Any) -> None:
    """A logarithmic axis with plain numbers at its ticks: at 1, 2, 5 of each decade while there are few of them."""
    axis._set_axes_scale("log")
    low, high = axis.get_view_interval()
    few = 0.0 < low < high < FEW_DECADES * low
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: printed(value)))
    axis.set_minor_locator(NullLocator())  # nothing of minor ticks is drawn, but they take time


def printed(value: float) -> str:
    """A number as figures print it, with a true minus sign."""
    return number(value).replace("-", "\N{MINUS SIGN}")


def is_logarithmic(values: Array) -> bool:
    """Whether positive values span more than a decade in steps that grow with them."""
    values = np.unique(values[np.isfinite(values)])
    if len(values) < 3 or values[0] <= 0.0 or values[-1] / values[0] < 10.0:
        return False
    plain, logs = np.diff(values), np.diff(np.log(values))
    return bool(logs.std() / logs.mean() < plain.std() / plain.mean())


def zero_line(axes: Axes) -> None:
    """A thin line at zero."""
    axes.axhline(0.0, color=MUTED, linewidth=0.7, zorder=1.5)


def limit_line(axes: Axes, value: float, words: str, side: Literal["left", "right"]) -> None:
    """A line at a limit, in the axis's unit, with words on it at the side where curves are low."""
    axes.axhline(value, color=VERMILION, linewidth=1.1, zorder=2.5, label=LIMIT)
    across, at = axes.get_yaxis_transform(), {"left": 0.01, "right": 0.99}[side]
    axes.text(at, value, words, transform=across, ha=side, va="bottom", color=VERMILION, fontsize=8.0)


def telling_limits(figure: Figure) -> Figure:
    """The figure with a sentence on its lines at limits; as it is where no limit lies within its plots."""
    lines = [line for axes in figure.drawing.axes for line in axes.get_lines()]
    if not any(line.get_label() == LIMIT for line in lines):
        return figure
    return replace(figure, caption=f"{figure.caption} Orange: limits that the study names.".strip())


def limit_far(axes: Axes, words: str) -> None:
    """Words on a limit that lies outside the plot."""
    axes.set_title(words, loc="right", color=VERMILION, fontsize=8.0)


def widen(axes: Axes, values: Sequence[Array]) -> None:
    """A vertical axis on which values that differ by rounding alone look constant, with short numbers at its ticks."""
    known = np.concatenate([row[np.isfinite(row)] for row in values])
    largest = float(np.abs(known).max(initial=0.0))
    if known.size and largest > 0.0 and float(np.ptp(known)) < ALIKE * largest:
        middle = float(known.mean())
        axes.set_ylim(middle - FLAT * largest, middle + FLAT * largest)


def note(axes: Axes, text: str) -> None:
    """A remark in place of data."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=MUTED)
    axes.set(xticks=[], yticks=[])


def colour_bar(axes: Axes | Sequence[Axes], mesh: Any, label: str, **options: Any) -> Any:
    """The bar of a map, or of several, with plain numbers."""
    plain = FuncFormatter(lambda value, _: printed(value))
    bar = mesh.axes.figure.colorbar(mesh, ax=axes, label=label, pad=0.02, format=plain, **options)
    bar.outline.set_visible(False)
    bar.ax.minorticks_off()
    return bar


def banded(edges: Sequence[float]) -> dict[str, Any]:
    """Colours for a map in bands between `edges`, as options of the map; values beyond the ends get end colours."""
    colours = matplotlib.colormaps[SEQUENTIAL].resampled(len(edges) + 1)
    return {"cmap": colours, "norm": BoundaryNorm(list(edges), colours.N, extend="both")}


def legend_beside(axes: Axes, title: str = "") -> None:
    """The legend at the right of the plot, away from the data."""
    axes.legend(title=title or None, **BESIDE)


def legend_of_all(drawing: Drawing, axes: Axes) -> None:
    """One legend at the right of the whole figure, with the curves of `axes`."""
    handles, labels = axes.get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside right upper", alignment="left")
