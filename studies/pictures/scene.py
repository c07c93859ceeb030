"""The scene to scale as engineers draw it: bodies, supports, springs, masses, carriages with their ways, sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure as Drawing

from engine.bodies.modal.outline import Elastic, Held
from engine.model.lane_table import moving_mass
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from studies.pictures.common.figures import BLUE, GREEN, INK, MUTED, ORANGE, PURPLE, SKY, VERMILION, WIDTH, Figure, draw
from studies.pictures.moving_shapes import FRONT, PLAN, SIDE, SPACE, view_of
from studies.pictures.scene_layout import TURNED_UP, UP, Layout, Placed
from studies.pictures.scene_names import PLOT, ROW, Label, in_rows, write
from studies.results.formatting import counted, number, quantity

SYMBOL = 1.0 / 42.0  # of the width of the picture
WIDE = 1.5  # least width over height of a picture
SPRING = 3.0  # symbols: half of the length of a spring at most
MOST_NAMED = 16  # nodes of a body, and carriages
FEW_LINES = 30  # that are drawn bold
ON_TRACK, ASIDE = 21, 1e-3  # places of a track that are looked at, and of its length: what lies beside lines
COLOURS = (BLUE, PURPLE, SKY)  # of bodies
FRAMES = " Frames that move, their springs and loads are as at time 0."
ROBOTS = " Robots (dark orange, the tool a triangle) are as at time 0."
AXES, ENDS = np.eye(3), np.array([-1.0, 1.0])

# Symbols as curves between two ends: (part of the way, symbol sizes beside it).
ZIGZAG = [(0.0, 0.0), (0.18, 0.0), *((0.2 + 0.1 * k, 0.35 * (-1) ** k) for k in range(7)), (0.82, 0.0), (1.0, 0.0)]
DASHPOT = (
    [(0.0, 0.75), (0.5, 0.75)],
    [(0.5, 0.55), (0.5, 0.95)],
    [(0.4, 0.5), (0.62, 0.5), (0.62, 1.0), (0.4, 1.0)],
    [(0.62, 0.75), (1.0, 0.75)],
)
TRIANGLE = [(0.0, 0.0), (1.0, 0.6), (1.0, -0.6), (0.0, 0.0), (1.0, 0.6)]  # one side twice: what is open stays open
GROUND = [(0.0, -0.8), (0.0, 0.8)], *([(0.0, t), (0.4, t + 0.3)] for t in np.linspace(-0.8, 0.5, 5))


class Sheet(NamedTuple):
    """Axes on which things in space are drawn in one view (2, 3); u: size of a symbol, m."""

    axes: Any
    view: Array
    u: float

    def line(self, points: Array, **style: Any) -> None:
        """A line through places in space."""
        self.axes.plot(*(points @ self.view.T).T, **{"color": INK, "linewidth": 0.9, **style})

    def symbol(self, start: Array, end: Array, curve: Sequence[tuple[float, float]], **style: Any) -> None:
        """A curve of a symbol between two places in space, unless it is seen from its end."""
        one, other = self.view @ start, self.view @ end
        size = float(np.linalg.norm(other - one))
        if size > 0.05 * self.u:
            aside = np.array([one[1] - other[1], other[0] - one[0]]) / size * self.u
            t, beside = np.array(curve).T
            x, y = (one + t[:, None] * (other - one) + beside[:, None] * aside).T
            look = {"facecolor": "none", "edgecolor": INK, "linewidth": 0.9, "zorder": 2.8, **style}
            self.axes.fill(x, y, closed=False, **look)

    def spring(self, start: Array, end: Array, *, damped: bool) -> None:
        """A spring, with a damper beside it; of a long one the middle, the rest a line."""
        middle, half = 0.5 * (start + end), 0.5 * (end - start)
        part = min(1.0, SPRING * self.u / max(float(np.linalg.norm(half)), self.u))
        for curve in (ZIGZAG, *(DASHPOT if damped else ())):
            self.symbol(middle - part * half, middle + part * half, curve)
        if part < 1.0:
            for outer, sign in ((start, -1.0), (end, 1.0)):
                self.line(np.array([outer, middle + sign * part * half]))

    def ground(self, place: Array, outward: Array) -> None:
        """The hatched line on which something stands; outward (3,): into the ground."""
        for curve in GROUND:
            self.symbol(place, place + self.u * outward, curve)


def pictures(scene: Layout) -> list[Figure]:
    """The scene in one view where it lies in a plane, else in space and from three sides."""
    view = view_of(scene.points)
    return [_picture(scene, view), *([_three(scene)] if view is SPACE else [])]


def _picture(scene: Layout, view: Array) -> Figure:
    ways = _ways(scene)
    flat = (
        np.concatenate([scene.points, *ways.values(), *(scene.touched(name)[None] for name in scene.positions)])
        @ view.T
    )
    width = 1.12 * max(float(np.ptp(flat[:, 0])), WIDE * float(np.ptp(flat[:, 1])))
    u, middle = SYMBOL * width, 0.5 * float(flat[:, 0].min() + flat[:, 0].max())
    low, high = float(flat[:, 1].min()) - 3.5 * u, float(flat[:, 1].max()) + (5.0 + 0.8 * len(ways)) * u
    ends, step = (middle - 0.5 * width, middle + 0.5 * width), ROW * width / PLOT
    above, below = list[Label](), list[Label]()
    for label in _labels(scene, view, u):
        is_high = high - low > 20.0 * u and label.place[1] > 0.5 * (low + high)
        (above if label.above or is_high else below).append(label)
    rows = in_rows(above, ends), in_rows(below, ends)
    top, bottom = (max((one.row + 1.3 for one in found), default=0.3) * step for found in rows)
    study = scene.model.study
    moving = FRAMES * any((study.frame, study.load, study.spring)) + ROBOTS * bool(study.robot)
    caption = f"To scale, in metres; symbols are not.{_legend(scene)}{moving}"

    def fill(drawing: Drawing) -> None:
        axes = drawing.subplots()
        axes.set(xlim=ends, ylim=(low - bottom, high + top), aspect="equal")
        sheet = Sheet(axes, view, u)
        _draw_scene(scene, sheet)
        _draw_ways(scene, ways, sheet)
        _name_nodes(scene, sheet)
        write(rows[0], axes, high, step)
        write(rows[1], axes, low, -step)
        _draw_scale(sheet, high)

    height = PLOT * (high + top - low + bottom) / width + (0.15 if view is SPACE else 0.5)
    return draw("scene", "The scene to scale", caption, height, fill)


def _legend(scene: Layout) -> str:
    """What is drawn how, as sentences; what is not there is not told."""
    study = scene.model.study
    said = [f"{_standing(scene)}; arrows along their ways"] if study.carriage else []
    said += ["green: sensors"] * bool(study.sensor)
    said += ["dashed: a track beside what carries it"] * any(_is_aside(body) for body in scene.bodies.values())
    told = "; ".join(said)
    above = " What rides is drawn a little above its track." * bool(study.carriage)
    return f" {told[0].upper()}{told[1:]}.{above}" if told else ""


def _is_aside(body: Placed) -> bool:
    """Whether a part of a body's track lies beside its lines."""
    track = body.along(body.part.modal.length * np.linspace(0.0, 1.0, ON_TRACK))
    apart = np.full(ON_TRACK, np.inf)
    for line in body.outline.lines:
        start, way = body.at(line.points)[:-1], np.diff(body.at(line.points), axis=0)
        reach = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
        part = np.clip(((track[:, None] - start) * way).sum(axis=2) / reach, 0.0, 1.0)
        off = track[:, None] - start - part[..., None] * way
        apart = np.minimum(apart, np.linalg.norm(off, axis=2).min(axis=1))
    return bool(apart.max() > ASIDE * body.part.modal.length)


def _standing(scene: Layout) -> str:
    """Where carriages stand, as the beginning of a sentence."""
    if not scene.model.study.train:
        return "Carriages (dark orange) stand where they start, those that follow as far behind as they trail"
    first = next(iter(scene.model.study.axles))
    hidden = len(scene.model.carriages) - len(scene.positions)
    left_out = f", {counted(hidden, 'axle')} further off left out" if hidden else ""
    stay = not all(carriage.motion.passes for carriage in scene.model.study.carriage.values())
    others = ", those that stay on their bodies as they start" if stay else ""
    return f"Carriages (dark orange) stand as {first} has come to {number(scene.positions[first])} m{left_out}{others}"


def _draw_scale(sheet: Sheet, high: float) -> None:
    """A scale along x; in space directions and a length instead."""
    axes = sheet.axes
    axes.grid(visible=False)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    if sheet.view is not SPACE:
        axes.set_xlabel(f"{'x' if sheet.view is SIDE else 'y'} (m)")
        return
    axes.set_xticks([])
    axes.spines["bottom"].set_visible(False)
    left, right = axes.get_xlim()
    corner, look = np.array([right - 6.0 * sheet.u, high - sheet.u]), {"color": MUTED, "fontsize": 7.5}
    for axis, name in zip(AXES, "xyz", strict=True):
        arrow = {"arrowstyle": "<-", "color": MUTED, "shrinkA": 0.0}
        axes.annotate(name, corner, corner + 2.6 * sheet.u * sheet.view @ axis, arrowprops=arrow, **look)
    long = round_length(0.2 * (right - left))
    ends = corner + sheet.u * np.array([3.0, -3.2]) + np.array([[-long], [0.0]]) * (sheet.view @ AXES[0])
    axes.plot(*ends.T, color=MUTED, linewidth=2.0)
    axes.text(*ends[0], f"{number(long)} m along x ", ha="right", va="center", **look)


def round_length(most: float) -> float:
    """The largest of 1, 2, 5, 10, ... that is no more.

    >>> round_length(0.37), round_length(7.0), round_length(1.0)
    (0.2, 5.0, 1.0)
    """
    decade = 10.0 ** math.floor(math.log10(most))
    return max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= most)


def _three(scene: Layout) -> Figure:
    low, high = scene.points.min(axis=0), scene.points.max(axis=0)
    size = 1.15 * np.maximum(high - low, 0.15 * float((high - low).max()))
    x, y, z = size
    u = 0.6 * SYMBOL * float(x + y)

    def fill(drawing: Drawing) -> None:
        (side, front), (plan, empty) = drawing.subplots(2, 2, width_ratios=[x, y], height_ratios=[z, y])
        empty.set_axis_off()
        for axes, view, (across, up) in ((side, SIDE, "xz"), (front, FRONT, "yz"), (plan, PLAN, "xy")):
            _draw_scene(scene, Sheet(axes, view, u))
            middle, half = view @ (0.5 * (low + high)), view @ (0.5 * size) + 2.0 * u
            axes.set(xlim=middle[0] + half[0] * ENDS, ylim=middle[1] + half[1] * ENDS)
            axes.set(xlabel=f"{across} (m)", ylabel=f"{up} (m)", aspect="equal")
            axes.locator_params(nbins=4)

    height = float(min(6.5, 0.9 * WIDTH * (z + y) / (x + y) + 1.2))
    return draw("views", "From three sides", "From the side, from the front and from above.", height, fill)


def _draw_scene(scene: Layout, sheet: Sheet) -> None:
    study = scene.model.study
    for place, body in enumerate(scene.bodies.values()):
        frame = study.frame.get(body.part.name)
        _draw_body(body, sheet, COLOURS[place % len(COLOURS)], stands=frame is None or frame.stands)
    for name in scene.positions:
        _draw_carriage(scene, name, sheet)
    for name, line in scene.robots.items():
        for foot in scene.feet(name):
            sheet.line(np.array([foot, line[0]]), color=VERMILION)
        sheet.line(line, color=VERMILION, linewidth=1.8, marker="o", markersize=3.0, zorder=3.0)
        sheet.line(line[-1:], color=VERMILION, marker="v", markersize=6.0, zorder=3.1)
    for name, ends in scene.springs.items():
        sheet.spring(ends[0], ends[1], damped=study.spring[name].damping > 0.0)
    for name in study.load:
        _draw_load(scene, name, sheet)
    for envelope in study.envelope.values():
        body = scene.bodies[envelope.body]
        sheet.line(body.along(envelope.along(body.part.modal.length)), color=SKY, linewidth=7.0, alpha=0.4, zorder=1.2)
    for sensor in study.sensor.values():
        where = scene.read(sensor)
        if where is not None:
            sheet.line(where[None], color=GREEN, marker="o", markersize=4.5, zorder=5.0)


def _draw_body(body: Placed, sheet: Sheet, colour: str, *, stands: bool) -> None:
    outline = body.outline
    width, gap = 2.2 if len(outline.lines) <= FEW_LINES else 0.8, np.full((1, 3), np.nan)
    joined = np.concatenate([part for line in outline.lines for part in (body.at(line.points), gap)])
    sheet.line(joined, color=colour, linewidth=width, solid_capstyle="round", zorder=2.0)
    if outline.cloud is not None:
        sheet.line(body.at(outline.cloud.points), color=colour, linestyle="", marker=".", markersize=2.0, zorder=2.0)
    sheet.line(body.at(outline.track), linestyle=(0, (5, 3)), zorder=1.9)
    for held in outline.held if stands else ():
        _draw_support(body, held, sheet)
    if not stands:
        sheet.line(body.along(0.0)[None], marker="o", markersize=5.0, markerfacecolor="white", zorder=2.7)
    for spring in outline.springs:
        _draw_spring(body, spring, sheet)
    for lump in outline.masses:
        sheet.line(body.at(lump.place)[None], marker="s", markersize=8.0, color=colour, markeredgecolor=INK, zorder=4.0)
    if len(outline.nodes) <= MOST_NAMED:
        for place in outline.nodes.values():
            sheet.line(body.at(place)[None], marker="o", markersize=2.6, zorder=2.6)


def _name_nodes(scene: Layout, sheet: Sheet) -> None:
    look: Any = {"color": MUTED, "fontsize": 6.5, "rotation": 35.0, "rotation_mode": "anchor", "zorder": 2.6}
    for body in scene.bodies.values():
        if len(body.outline.nodes) <= MOST_NAMED:
            for name, place in body.outline.nodes.items():
                sheet.axes.text(*(sheet.view @ body.at(place) + 0.33 * sheet.u), name, **look)


def _draw_support(body: Placed, held: Held, sheet: Sheet) -> None:
    """A hatched line where it may not bend away either, else triangles: one below where it carries, else one on each
    side that is held. Held about its own axis alone a member bends freely."""
    place, u = body.at(held.place), sheet.u
    own = [body.turn @ axis for axis, word in zip(AXES, "xyz", strict=True) if word in held.ways]
    about = [axis for axis, word in zip(AXES, ("rx", "ry", "rz"), strict=True) if word in held.ways]
    if own and any(abs(axis @ held.outward) < 0.7 for axis in about):
        sheet.ground(place, body.turn @ held.outward)
        return
    carries = any(abs(axis[2]) > 0.7 for axis in own)
    for outward in [-UP] if carries else [-axis for axis in own]:
        base = place + u * outward
        sheet.symbol(place, base, TRIANGLE, facecolor="white")
        sheet.ground(base + (0.3 * u * outward if carries and len(own) == 1 else 0.0), outward)  # a gap: a roller


def _draw_spring(body: Placed, spring: Elastic, sheet: Sheet) -> None:
    place, u = body.at(spring.place), sheet.u
    if spring.to is not None:
        sheet.spring(place, body.at(spring.to), damped=spring.damped)
        return
    pulled = [axis for axis, rate in zip(body.turn.T, spring.stiffness, strict=True) if rate > 0.0]
    alone = spring.damped and not (pulled or any(spring.rotational))  # a damper, whose direction is not known here
    for axis in [UP] if alone else pulled:
        outward = -np.sign(axis.sum()) * axis
        end = place + 2.2 * u * outward
        sheet.spring(place, end, damped=spring.damped)
        sheet.ground(end, outward)
    if any(spring.rotational):
        sheet.line(place[None], marker="o", markersize=9.0, markerfacecolor="none", markeredgecolor=INK)


def _draw_carriage(scene: Layout, name: str, sheet: Sheet) -> None:
    carriage, u, foot = scene.model.study.carriage[name], sheet.u, scene.touched(name)
    body, place = scene.bodies[carriage.on], scene.positions[name]
    edge = min(max(place, 0.0), body.part.modal.length)
    if edge != place:  # the way to it goes on beyond the end of its body
        sheet.line(body.along(np.array([edge, place])), color=MUTED, linewidth=0.8, zorder=1.1)
    for standing in scene.contacts.get(name, ()):
        top = standing.below + (standing.above - standing.below) @ UP * UP
        sheet.line(np.array([top, standing.above]), linewidth=1.6)
        if standing.contact.is_rigid:
            sheet.line(np.array([standing.below, top]), linewidth=2.6)
        else:
            sheet.spring(standing.below, top, damped=standing.contact.damping > 0.0)
    if carriage.suspension is not None:
        sheet.line((foot + 0.35 * u * UP)[None], marker="o", markersize=6.0, markerfacecolor="white", zorder=3.0)
        wheel, foot = foot + 0.6 * u * UP, foot + 2.2 * u * UP
        sheet.spring(wheel, foot, damped=carriage.suspension.damping > 0.0)
    if carriage.moving_mass > 0.0:
        across, up = scene.bodies[carriage.on].forward * 0.8 * u, 1.1 * u * UP
        corners = np.array([foot - across, foot + across, foot + across + up, foot - across + up])
        sheet.axes.fill(*(corners @ sheet.view.T).T, facecolor=VERMILION, edgecolor=INK, linewidth=0.7, zorder=3.0)
    elif carriage.riding_body is None:
        _arrow(sheet, foot + 2.6 * u * UP, foot, VERMILION)


def _draw_load(scene: Layout, name: str, sheet: Sheet) -> None:
    """Arrows to the places of a force; a ring where there is but a torque."""
    load = scene.model.study.load[name]
    force = np.array(getattr(load, load.keys[0]) or np.zeros(3))
    away = (scene.bodies[load.on].axes if load.axes == "body" else TURNED_UP) @ force
    for place in scene.loaded(name):
        if force.any():
            _arrow(sheet, place - 3.0 * sheet.u * away / np.linalg.norm(away), place, ORANGE)
        else:
            sheet.line(place[None], marker="o", markersize=9.0, markerfacecolor="none", markeredgecolor=ORANGE)


def _arrow(sheet: Sheet, start: Array, end: Array, colour: str, style: str = "-|>") -> None:
    look: Any = {"arrowstyle": f"{style},head_width=0.22,head_length=0.45", "color": colour, "linewidth": 1.1}
    sheet.axes.annotate("", sheet.view @ end, sheet.view @ start, arrowprops=look | {"shrinkA": 0.0, "shrinkB": 0.0})


def _ways(scene: Layout) -> dict[str, Array]:
    """(2, 3) the distinct ways, from where they start, by the first carriage of each."""
    found, known = dict[str, Array](), set[tuple[str, float, float]]()
    for name, carriage in scene.model.study.carriage.items():
        low, high = carriage.motion.range()
        if carriage.motion.passes and float(carriage.motion.path(0.0).S) > low:
            low, high = high, low
        if (carriage.on, low, high) not in known:
            known.add((carriage.on, low, high))
            found[name] = scene.bodies[carriage.on].along(np.array([low, high]))
    return found


def _draw_ways(scene: Layout, ways: dict[str, Array], sheet: Sheet) -> None:
    """Arrows from where carriages start to where their ways end, or both ways, above their tracks."""
    for place, (name, ends) in enumerate(ways.items()):
        lifted = ends + (4.4 + 0.8 * place) * sheet.u * UP
        _arrow(
            sheet, lifted[0], lifted[1], ORANGE, "-|>" if scene.model.study.carriage[name].motion.passes else "<|-|>"
        )
        for pair in zip(ends, lifted, strict=True):
            sheet.line(np.array(pair), color=ORANGE, linewidth=0.5, linestyle=":", zorder=1.0)


def _labels(scene: Layout, view: Array, u: float) -> list[Label]:
    """Names of bodies and carriages, which stand above, and of sensors, masses and envelopes."""
    study, found = scene.model.study, list[Label]()
    for place, body in enumerate(scene.bodies.values()):
        at, colour = body.along(0.15 * body.part.modal.length), COLOURS[place % len(COLOURS)]
        found.append(Label(view @ at, body.part.name, colour, above=True))
        for lump in body.outline.masses:
            found.append(Label(view @ body.at(lump.place), f"{lump.name} ({number(lump.mass)} kg)", INK))
    shown, alone = list(scene.positions), VariantValues(study, {}, 1)
    numbers = {tie.name: number for number, tie in enumerate(scene.model.carriages)}
    for name in shown if len(shown) <= MOST_NAMED else shown[:: len(shown) - 1]:
        carriage = study.carriage[name]
        mass = float(moving_mass(scene.model, alone, numbers[name])[0])
        load = f"{number(mass)} kg" if mass > 0.0 else quantity(carriage.sum_of(carriage.forces), "N")
        found.append(Label(view @ (scene.touched(name) + u * UP), f"{name} ({load})", VERMILION, above=True))
    for name, sensor in study.sensor.items():
        where = scene.read(sensor)
        if where is not None:
            found.append(Label(view @ where, name, GREEN))
    for name, line in scene.robots.items():
        found.append(Label(view @ line[-1], name, VERMILION))
    for name, ends in scene.springs.items():
        found.append(Label(view @ ends.mean(axis=0), name, INK))
    for name in study.load:
        found.append(Label(view @ scene.loaded(name).mean(axis=0), name, ORANGE))
    for name, envelope in study.envelope.items():
        body = scene.bodies[envelope.body]
        middle = float(np.mean(envelope.along(body.part.modal.length)))
        found.append(Label(view @ body.along(middle), f"envelope {name}", SKY))
    return found
