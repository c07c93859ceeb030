"""Further figures of the maps of stability: separation, overshoot, the rigid tie."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure as Drawing

from studies.maps.rigid import INERTIAL, STEPS
from studies.pictures.common import figures as look
from studies.pictures.common.figures import legend_beside, logarithmic, printed, shades, zero_line
from studies.results.formatting import number

if TYPE_CHECKING:
    import xarray as xr

NOTABLE = 1.1  # overshoot from which on a scheme gets a colour


class Drawn(NamedTuple):
    """How a map is drawn: title from its results, caption, height in inches, and what fills it."""

    title: Callable[[Any], str]
    caption: str
    height: float
    fill: Callable[[Any, Drawing], None]


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


SEPARATION = Drawn(
    _separation_title,
    "Smallest contact force on the first 98 % of the way over the weight; below zero the track would have to pull. "
    "From there on (thin) the equations are no longer true and the program marks the variant as separated.",
    3.0,
    _separation,
)
OVERSHOOT = Drawn(
    lambda dataset: "Stable schemes may still overshoot",
    "An oscillator without damping is deflected and let go. With steps much longer than its period (ω h large) the "
    "first 20 steps of some stable schemes throw it far beyond 1. Left: displacement. Right: velocity over ω times the "
    "first deflection.",
    3.2,
    _overshoot,
)
RIGID_TIE = Drawn(
    _rigid_title,
    f"The contact force of one passage of {STEPS} steps: the mass as inertia, as the program marches it, and tied by "
    "its place, by average acceleration and by the scheme that follows best. Right: how strongly the force jumps up "
    "and down from step to step.",
    3.4,
    _rigid,
)
