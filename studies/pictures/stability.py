"""Figures of the maps of stability: what was run as lines and cells, the theory over it in vermilion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure as Drawing

from results_schema.lazy_imports import xr
from studies.pictures.common import figures as look
from studies.pictures.common.figures import (
    Figure,
    banded,
    colour_bar,
    draw,
    legend_beside,
    logarithmic,
    printed,
    shades,
    zero_line,
)
from studies.results.formatting import counted, number, percent
from studies.stability_maps.rigid import INERTIAL, STEPS

NOTABLE = 1.1  # overshoot from which on a scheme gets a colour
GROWS = 1.001  # per period: less is rounding


class Drawn(NamedTuple):
    """How a map is drawn: title from its results, caption, height in inches, and what fills it."""

    title: Callable[[Any], str]
    caption: str
    height: float
    fill: Callable[[Any, Drawing], None]


def pictures(dataset: xr.Dataset, names: Sequence[str]) -> list[Figure]:
    """One figure per map, in the order of the names."""
    found = []
    for name in names:
        drawn = DRAWN[name]
        found.append(draw(name, drawn.title(dataset), drawn.caption, drawn.height, partial(drawn.fill, dataset)))
    return found


def _separation(dataset: xr.Dataset, drawing: Drawing) -> None:
    """Smallest contact force over the speed, a curve per mass, and where each opens."""
    axes = drawing.subplots()
    masses = dataset["separation_mass_ratio"].values
    for mass, colour in zip(masses, shades(len(masses)), strict=True):
        one = dataset.sel(separation_mass_ratio=mass)
        speed, force = dataset["separation_speed_ratio"].values, one["smallest_contact_force"].values
        held = ~(speed > float(one["separation_onset"]))
        axes.plot(speed, force, color=colour, lw=0.7, alpha=0.35)
        opens = [float(one["separation_onset"])] if np.isfinite(one["separation_onset"]) else []
        solid = np.append(speed[held], opens), np.append(force[held], [0.0 for _ in opens])
        axes.plot(*solid, color=colour, label=printed(mass))
        if opens:
            axes.plot(opens, 0.0, "o", color=look.VERMILION, ms=5.0, zorder=3.0)
    axes.plot([], [], "o", color=look.VERMILION, ms=5.0, label="opens first")
    zero_line(axes)
    axes.set(
        ylim=(-2.0, 1.05), xlim=(0.0, None), xlabel="speed ratio v/(ω₁ L/π)", ylabel="smallest contact force / weight"
    )
    legend_beside(axes, "mass ratio")


def _overshoot(dataset: xr.Dataset, drawing: Drawing) -> None:
    """Largest displacement and velocity over omega h; schemes that overshoot in colour."""
    rows = drawing.subplots(1, 2)
    x = dataset["overshoot_step"].values
    both = np.fmax(dataset["displacement_overshoot"].values, dataset["velocity_overshoot"].values)
    largest = np.nanmax(both, axis=1)
    notable = [str(label) for label, value in zip(dataset["scheme"].values, largest, strict=True) if value > NOTABLE]
    colours = dict(zip(notable, (*look.DISTINCT, look.INK), strict=False))
    for axes, name in zip(rows, ("displacement", "velocity"), strict=True):
        for label in dataset["scheme"].values:
            values = dataset[f"{name}_overshoot"].sel(scheme=label)
            known = str(label) in colours
            style = {"color": colours[str(label)], "zorder": 3.0} if known else {"color": look.HAIR, "zorder": 2.0}
            axes.plot(x, values, marker="o", ms=3.0, label=str(label) if known else "_others", **style)
        axes.set(xlabel="ω h", title=f"largest {name} over the true one")
        logarithmic(axes.xaxis)
        logarithmic(axes.yaxis)
    rows[1].plot([], [], color=look.HAIR, label="all others")
    legend_beside(rows[1])


def _rigid(dataset: xr.Dataset, drawing: Drawing) -> None:
    """Contact force on the way, and the size of its ringing."""
    left, right = drawing.subplots(1, 2, width_ratios=(1.7, 1.0))
    ties = [str(name) for name in dataset["tie"].values]
    calm = _calmest(dataset)
    colours = dict.fromkeys(ties, look.MUTED) | {INERTIAL: look.INK, ties[1]: look.BLUE, calm: look.VERMILION}
    x = dataset["passage_fraction"]
    shown = {ties[1]: {"lw": 0.4, "alpha": 0.6}, INERTIAL: {"lw": 1.8}, calm: {"lw": 0.9}}
    for name, style in shown.items():
        left.plot(x, dataset["contact_force"].sel(tie=name), color=colours[name], **style)
    left.set(ylim=(0.0, 2.0), xlabel="place of the mass over the length", ylabel="contact force / weight")
    ringing = dataset["contact_ringing"].values
    places = np.arange(len(ties))[::-1]
    right.barh(places, ringing, color=[colours[name] for name in ties], height=0.6)
    logarithmic(right.xaxis)
    low = right.get_xlim()[0]
    for place, value in zip(places, ringing, strict=True):
        if not np.isfinite(value):
            right.text(low * 1.3, place, "blows up", va="center", color=look.MUTED)
    right.set_yticks(places, ties)
    right.yaxis.tick_right()
    right.tick_params(axis="y", length=0.0)
    right.grid(visible=False, axis="y")
    right.set_xlabel("ringing / weight")


def _calmest(dataset: xr.Dataset) -> str:
    """The tie that departs least from the mass as inertia."""
    ties = dataset["tie"].values
    departure = np.where(ties == INERTIAL, np.inf, dataset["contact_departure"].fillna(np.inf).values)
    return str(ties[int(np.argmin(departure))])


def _separation_title(dataset: xr.Dataset) -> str:
    """From which speed on the mass lifts off first."""
    onset = dataset["separation_onset"].values
    if not np.isfinite(onset).any():
        return "The mass keeps its contact at all speeds"
    return f"The mass would lift off from {number(float(np.nanmin(onset)), 2)} of the critical speed on"


def _rigid_title(dataset: xr.Dataset) -> str:
    """How strongly a mass rings that is tied by its place."""
    ringing = dataset["contact_ringing"].values[dataset["tie"].values != INERTIAL]
    if not np.isfinite(ringing).all():
        return "A mass that is tied by its place makes some schemes blow up"
    return f"A mass that is tied by its place rings by up to {number(float(ringing.max()), 2)} times its weight"


def _schemes(dataset: xr.Dataset, drawing: Drawing) -> None:
    """Growth per step over omega h: schemes with a limit above, those without below."""
    rows = drawing.subplots(2, 1, sharex=True)
    limited = np.isfinite(dataset["critical_step"].values)
    for axes, chosen, title in zip(rows, (limited, ~limited), ("with a limit", "without a limit"), strict=True):
        x = dataset["frequency_step"].values
        labels = dataset["scheme"].values[chosen]
        for place, (label, colour) in enumerate(zip(labels, (*look.DISTINCT, look.MUTED), strict=False)):
            one = dataset.sel(scheme=label)
            axes.plot(x, one["scheme_growth"], color=colour, label=str(label))
            axes.plot(
                x[place % 5 :: 5], one["scheme_radius_theory"].values[place % 5 :: 5], ".", color=look.INK, ms=3.0
            )
        axes.plot([], [], ".", color=look.INK, ms=3.0, label="theory")
        axes.axhline(1.0, color=look.MUTED, linewidth=0.7, zorder=1.5)
        axes.set(ylim=(0.85, 2.0) if title == "with a limit" else (0.0, 1.1), ylabel="growth per step", title=title)
        legend_beside(axes)
        logarithmic(axes.xaxis)
    for value in dataset["critical_step"].values[limited]:
        rows[0].axvline(value, color=look.HAIR, linewidth=0.8, zorder=1.0)
    rows[1].set_xlabel("ω h: natural frequency times the step")


def _lagged(dataset: xr.Dataset, drawing: Drawing) -> None:
    """Threshold over the number of modes, and growth over the mass."""
    left, right = drawing.subplots(1, 2)
    counts, steps = dataset["mode_count"].values, dataset["relative_step"].values
    for step, marker, size in zip(steps, "os^vD", (7.0, 4.5, 3.0, 2.5, 2.0), strict=False):
        critical = dataset["critical_mass_ratio"].sel(relative_step=step)
        style = {"mfc": "none", "linestyle": "none", "marker": marker, "ms": size}
        left.plot(counts, critical, color=look.BLUE, label=f"run, ω₁ h = {printed(step)}", **style)
    left.plot(counts, dataset["critical_mass_ratio_theory"], color=look.VERMILION, lw=1.0, label="theory m φ·φ = 1")
    left.set(xlabel="number of modes", ylabel="mass ratio from which on it grows")
    logarithmic(left.yaxis)
    left.legend()
    middle = dataset["lagged_growth"].isel(relative_step=len(steps) // 2)
    shown = counts[np.unique(np.linspace(0, len(counts) - 1, 5).round().astype(int))]
    for count, colour in zip(shown, shades(len(shown)), strict=True):
        right.plot(dataset["lagged_mass_ratio"], middle.sel(mode_count=count), color=colour, label=str(count))
    right.axhline(1.0, color=look.MUTED, linewidth=0.7, zorder=1.5)
    right.set(ylim=(0.8, 3.0), xlabel="mass ratio", ylabel="growth per step")
    logarithmic(right.xaxis)
    right.legend(title="modes")


def _alias(dataset: xr.Dataset, drawing: Drawing) -> None:
    """Largest growth over the masses, a curve per number of modes and speed, for both schemes."""
    rows = drawing.subplots(2, 1, sharex=True, sharey=True)
    worst = dataset["growth"].max("alias_mass_ratio")
    counts = dataset["alias_mode_count"].values
    for axes, scheme in zip(rows, dataset["alias_scheme"].values, strict=True):
        for count, colour in zip(counts, shades(len(counts)), strict=True):
            curves = worst.sel(alias_scheme=scheme, alias_mode_count=count).transpose("step_multiple", ...)
            lines = axes.plot(dataset["step_multiple"], curves.values, color=colour, lw=0.8)
            lines[0].set_label(str(count))
        axes.axvline(1.0, color=look.VERMILION, linewidth=1.5)
        axes.axhline(1.0, color=look.MUTED, linewidth=0.7, zorder=1.5)
        axes.set(ylabel="growth per passage", title=str(scheme))
    legend_beside(rows[0], "modes")
    rows[0].annotate("the alias rule", (1.02, 0.92), xycoords=("data", "axes fraction"), color=look.VERMILION, va="top")
    logarithmic(rows[1].xaxis)
    ticks = [t for t in (0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0) if t <= float(dataset["step_multiple"].max())]
    rows[1].set_xticks(ticks)
    rows[1].set_xlabel("steps over the steps of the alias rule")


def _shuttle(dataset: xr.Dataset, drawing: Drawing) -> None:
    """Multipliers over frequency and mass, without and with damping, and the tongue's line."""
    rows = drawing.subplots(1, 2, sharey=True)
    edges = [GROWS, 1.05, 1.2, 1.5, 2.0, 3.0]
    mass = dataset["shuttle_mass_ratio"].values
    for axes, damping in zip(rows, dataset["shuttle_damping_ratio"].values, strict=True):
        grid = dataset["multiplier"].sel(shuttle_damping_ratio=damping).values
        axes.grid(visible=False)
        frequency = dataset["shuttle_frequency_ratio"].values
        mesh = axes.pcolormesh(frequency, mass, grid, shading="nearest", rasterized=True, **banded(edges))
        axes.plot(dataset["tongue_theory"], mass, color=look.VERMILION, linewidth=1.8, label="formula for one mode")
        axes.set(xlabel="frequency over ω₁", title=f"damping {printed(100.0 * damping)} %", xlim=(frequency[0], None))
        axes.set_ylim(mass[0] - 0.5 * (mass[1] - mass[0]), mass[-1])
    rows[0].set_ylabel("mass ratio")
    rows[0].legend(loc="lower left", labelcolor="white")
    colour_bar(rows[1], mesh, "largest growth per period", ticks=edges)


def _frozen(dataset: xr.Dataset, drawing: Drawing) -> None:
    """The frozen station's growth beside the real passage's, a panel per mass."""
    masses, counts = dataset["held_mass_ratio"].values, dataset["held_mode_count"].values
    rows = drawing.subplots(1, len(masses), sharey=True)
    x = dataset["centrifugal_number"].values
    least = float(dataset["passage_growth"].isel(held_mode_count=-1).min())
    low = min(0.8, max(0.1, 0.9 * least))
    for axes, mass in zip(np.atleast_1d(rows), masses, strict=True):
        one = dataset.sel(held_mass_ratio=mass)
        for count, colour in zip(counts, shades(len(counts)), strict=True):
            held = one["frozen_growth"].sel(held_mode_count=count)
            axes.plot(x, held, color=colour, lw=1.0, ls="--", label=f"frozen, {counted(int(count), 'mode')}")
        axes.plot(
            x, one["passage_growth"].isel(held_mode_count=-1), color=look.BLUE, label=f"passage, {counts[-1]} modes"
        )
        axes.set(ylim=(low, 20.0), xlabel="speed ratio · √(mass ratio)", title=f"mass ratio {printed(mass)}")
        logarithmic(axes.yaxis)
        if "frozen_limit" in dataset:
            limit = float(dataset["frozen_limit"])
            axes.axvline(limit, color=look.VERMILION, linewidth=1.0, label=f"frozen, all modes: {number(limit, 4)}")
    np.atleast_1d(rows)[0].set_ylabel("growth in the time of one passage")
    legend_beside(np.atleast_1d(rows)[-1])


def _schemes_title(dataset: xr.Dataset) -> str:
    """How many schemes blow up, and from which step on."""
    limits = dataset["critical_step"].values
    known = limits[np.isfinite(limits)]
    if not known.size:
        return "No scheme blows up, however long the step"
    return f"{known.size} of {limits.size} schemes blow up over long steps, first from ω h = {number(known.min())} on"


def _lagged_title(dataset: xr.Dataset) -> str:
    """From which mass on lagged inertia blows up."""
    critical = dataset["critical_mass_ratio"].values
    if not np.isfinite(critical).any():
        return "Inertia that lags a step blows up at no mass"
    least = number(float(np.nanmin(critical)), 2)
    return f"Inertia that lags a step blows up from mass ratio {least} on, with most modes"


def _alias_title(dataset: xr.Dataset) -> str:
    """How fast vibrations grow below the rule's steps."""
    few = dataset["growth"].where(dataset["step_multiple"] < 1.0)
    return f"With fewer steps than the alias rule's, vibrations grow up to {number(float(few.max()))} times per passage"


def _shuttle_title(dataset: xr.Dataset) -> str:
    """The part of the map in which a swinging mass shakes its body."""
    grown = dataset["multiplier"].isel(shuttle_damping_ratio=0).values > GROWS
    damping = percent(float(dataset["shuttle_damping_ratio"][0]))
    part = percent(float(grown.mean()))
    return f"A swinging mass shakes its body ever more in {part} of the map at damping {damping}"


DRAWN: Mapping[str, Drawn] = {
    "schemes": Drawn(
        _schemes_title,
        "A vibration without damping, marched 50 steps by every scheme: above 1 it grows from step to step although "
        "nothing drives it. Dots are closed forms. The step counts in units of the fastest vibration that the model "
        "keeps, ω its frequency and h the step.",
        4.6,
        _schemes,
    ),
    "lagged-inertia": Drawn(
        _lagged_title,
        "Frozen: the mass is held at midspan and its inertia force is taken from the step before, as in a coupling of "
        "two programs. Left: from which mass on that grows. Right: how fast, at the middle one of the steps.",
        3.2,
        _lagged,
    ),
    "alias": Drawn(
        _alias_title,
        "Growth of the fastest-growing vibration from passage to passage, largest over mass ratios 0.25 to 1; one "
        "curve per number of modes and speed ratio. The truth is what curves come to at the right. The line is the "
        "rule that the program keeps to, with a margin of 1.5.",
        4.2,
        _alias,
    ),
    "shuttle": Drawn(
        _shuttle_title,
        "Largest growth per period of a mass that swings over the whole body, s = L/2 + L/2 sin(Ωt). Dark is stable. "
        "Without damping narrow bands are those of the modes that are kept: more modes have others.",
        3.2,
        _shuttle,
    ),
    "frozen": Drawn(
        lambda dataset: "A frozen station is not a passage",
        "Frozen (dashed): the mass is held at midspan, but the terms of its speed act. Where the stiffness that they "
        "leave is negative it diverges; on supports that are not alike it may also swing ever more (flutter), at any "
        "speed. Passage: the mass really crosses at that speed.",
        3.2,
        _frozen,
    ),
    "separation": Drawn(
        _separation_title,
        "Smallest contact force on the first 98 % of the way over the weight; below zero the track would have to pull. "
        "From there on (thin) the equations are no longer true and the program marks the variant as separated.",
        3.0,
        _separation,
    ),
    "overshoot": Drawn(
        lambda dataset: "Stable schemes may still overshoot",
        "An oscillator without damping is deflected and let go. With steps much longer than its period (ω h large) the "
        "first 20 steps of some stable schemes throw it far beyond 1. Left: displacement. Right: velocity over ω times "
        "the first deflection.",
        3.2,
        _overshoot,
    ),
    "rigid-tie": Drawn(
        _rigid_title,
        f"The contact force of one passage of {STEPS} steps: the mass as inertia, as the program marches it, and tied "
        "by its place, by average acceleration and by the scheme that follows best. Right: how strongly the force "
        "jumps up and down from step to step.",
        3.4,
        _rigid,
    ),
}
