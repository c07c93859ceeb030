"""The drawing of a study: one page with its scene to scale, its mode shapes as they move, and its key numbers.

As a report it stands by itself, without script; nothing is marched for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from engine.bodies.modal.outline import HELD_AT
from engine.model.distinct_models import base_scene
from engine.model.lane_table import moving_mass, weight
from engine.model.scene_model import SceneModel
from engine.model.station_path import frozen
from engine.scene.study import Study
from engine.scene.sweep import expand
from engine.scene.trains import axle_name
from engine.scene.variants import VariantValues
from engine.statics.coupled_modes import coupled_modes
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.store import files
from studies.at_rest.positions import way_of
from studies.pictures.common.figures import svg
from studies.pictures.moving_shapes import body_pieces, moving, scene_pieces, unseen, view_of_all
from studies.pictures.scene import pictures
from studies.pictures.scene_layout import Layout, Placed, in_a_row, layout, starts, with_first_at
from studies.protocol.study import kind_of
from studies.reporting.report import Drawn, Row, check_folder, page_template
from studies.results.findings_common import has_dampers, told_trains
from studies.results.formatting import number, percent, quantity, spanned, swept_quantity, typed_speed

PAGE = "drawing.html"
SHOWN = 6  # modes
PROBED = 33  # places along a way at which a weight is set down
ROUNDING = 1e-9  # of lengths
_HELD = {frozenset(ways): word for word, ways in HELD_AT.items()}


class Shapes(NamedTuple):
    """Moving pictures with captions under one heading."""

    heading: str
    note: str
    pictures: Sequence[Row]


class Table(NamedTuple):
    """Rows of text under headings."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


def write_drawing(study: Study, folder: Path) -> Path:
    """Write the page into a folder; its path. Raises BadInput before anything is written, as `check` does."""
    check_folder(folder, PAGE)
    remarks = kind_of(study).parts(study).remarks
    text = page_template(PAGE).render(page=page_of(study, remarks))
    files.make_folder(folder)
    files.check_output_place(folder / PAGE)
    files.write_text(folder / PAGE, text)
    return folder / PAGE


def page_of(study: Study, remarks: Sequence[str]) -> SimpleNamespace:
    """Everything that the template shows of a study, plain text but for drawings; remarks: what is worth knowing."""
    model = base_scene(study)
    if not model.bodies:
        raise BadInput(
            "nothing rides on a body and nothing reads one: there is nothing to draw",
            where=study.source.where("sensor"),
            expected="a carriage or a sensor",
        )
    scene = layout(model, in_a_row(model))
    variants = expand(study).size
    drawn = [
        Drawn(place, figure.title, figure.caption, figure.name, svg(figure))
        for place, figure in enumerate(pictures(scene), 1)
    ]
    trains = [Row(name, words) for name, words in told_trains(study)]
    unused = [
        f"nothing rides on body {name} and nothing reads it: it is left out"
        for name in study.body
        if name not in scene.bodies
    ]
    return SimpleNamespace(
        title=study.title or study.kind,
        facts=[Row("kind of study", study.kind), Row("variants", f"{variants:,}"), *trains],
        remarks=[
            f"{text[0].upper()}{text[1:].rstrip('.')}{'' if text[-1] == '?' else '.'}" for text in (*remarks, *unused)
        ],
        figures=drawn,
        shapes=[*(_of_body(model, body) for body in scene.bodies.values() if _moves(study, body)), *_of_whole(model)],
        tables=[
            _without_empty(table)
            for table in (_bodies(scene), _supports(scene), _trains(study), _carriages(scene, study), _sensors(scene))
            if table.rows
        ],
        study_text=study.source.text,
    )


def _without_empty(table: Table) -> Table:
    """The table without columns in which nothing stands."""
    kept = [place for place in range(len(table.headings)) if any(row[place] for row in table.rows)]
    rows = [[row[place] for place in kept] for row in table.rows]
    return table._replace(headings=[table.headings[place] for place in kept], rows=rows)


def _moves(study: Study, body: Placed) -> bool:
    """Whether a body has modes of its own: a rigid one in a frame moves as its frame does."""
    return body.part.name not in study.frame or bool(body.part.modal.omega.any())


def _of_body(model: SceneModel, body: Placed) -> Shapes:
    """The lowest modes of a body by itself."""
    name, omega = body.part.name, body.part.modal.omega
    rates = VariantValues(model.study, {}, 1).damping_rates(name, omega)[:, 0]
    shapes = [list(body_pieces(body, unit)) for unit in np.eye(omega.size)[:SHOWN]]
    view, shown = view_of_all(shapes), []
    largest = max(float(np.abs(piece.motion).max()) for shape in shapes for piece in shape)
    for mode, shape in enumerate(shapes):
        picture = moving(shape, view, f"mode {mode + 1}")
        damping = (
            f"damping {percent(float(rates[mode] / (2.0 * omega[mode])))}" if omega[mode] > 0.0 else "moves freely"
        )
        said = (f"{number(float(omega[mode]) / (2.0 * np.pi))} Hz", damping, unseen(shape, largest))
        shown.append(Row(f"mode {mode + 1}", ", ".join(filter(None, said)), picture))
    kept = f"The lowest {len(shown)} modes" if omega.size > len(shown) else "All its modes"
    beside = " Damping is of the body alone: its dampers come on top." * has_dampers(model.study, name)
    return Shapes(f"Mode shapes of {name}", f"{kept}, without carriages; grey: at rest.{beside}", shown)


def _of_whole(model: SceneModel) -> Iterator[Shapes]:
    """The lowest modes of bodies and carriages together, the first carriage where it starts, or half-way where it only
    passes; nothing where carriages are but forces."""
    if not any(model.reacts(number) for number in range(len(model.carriages))):
        return
    with suppress(BadInput):  # a vehicle that is longer than its body never stands on it with all its contacts
        low, high = way_of(model.study)
        first = model.carriages[0].name
        passes = model.study.carriage[first].motion.passes
        place = 0.5 * (low + high) if passes else min(max(starts(model)[first], low), high)
        found = coupled_modes(model, VariantValues(model.study, {}, 1), frozen(model, np.array([place])), SHOWN)
        scene = layout(model, with_first_at(model, place))
        known = np.flatnonzero(np.isfinite(found.omega[0, 0]))
        shapes = [scene_pieces(scene, found.shapes[0, 0, :, mode]) for mode in known]
        view, shown = view_of_all(shapes), []
        largest = max(float(np.abs(piece.motion).max()) for shape in shapes for piece in shape)
        for mode, shape in zip(known, shapes, strict=True):
            hertz = float(found.omega[0, 0, mode]) / (2.0 * np.pi)
            picture = moving(shape, view, f"mode {mode + 1} of the whole")
            said = (f"{number(hertz)} Hz", unseen(shape, largest))
            shown.append(Row(f"mode {mode + 1}", ", ".join(filter(None, said)), picture))
        behind = ", the other axles of its train in their row" * (first in model.study.axles)
        note = (
            f"Bodies and carriages together, undamped, with {first} at {number(place, 4)} m of its track{behind}; "
            "motions that nothing resists are left out."
        )
        yield Shapes("Mode shapes of the whole with its carriages", note, shown)


def _bodies(scene: Layout) -> Table:
    rows = []
    for name, body in scene.bodies.items():
        modal = body.part.modal
        stiffness = quantity(modal.bending_stiffness, "N m2") if np.isfinite(modal.bending_stiffness) else ""
        made = ", ".join(f"{what}: {count:,}" for what, count in body.outline.counts.items())
        first = ", ".join(number(float(f)) for f in modal.omega[:SHOWN] / (2.0 * np.pi))
        if not modal.omega.any():
            first = "rigid: does not bend"
        kind = scene.model.study.body[name].kind
        rows.append(
            (
                name,
                kind,
                f"{number(modal.length, 4)} m",
                _extent(body),
                quantity(modal.mass, "kg", 4),
                stiffness,
                first,
                made,
            )
        )
    headings = (
        "body",
        "kind",
        "track",
        "extent x, y, z",
        "mass",
        "bending stiffness E I",
        "frequencies (Hz)",
        "made of",
    )
    return Table("Bodies", headings, rows)


def _extent(body: Placed) -> str:
    points = body.at(np.concatenate([line.points for line in body.outline.every_line]))
    points[np.abs(points) < ROUNDING * np.abs(points).max()] = 0.0
    return " x ".join(number(float(size), 4) for size in np.ptp(points, axis=0)) + " m"


def _supports(scene: Layout) -> Table:
    rows: list[tuple[str, ...]] = []
    for name, body in scene.bodies.items():
        for held in body.outline.held:
            rows.append(
                (
                    name,
                    held.name,
                    _place(body.at(held.place)),
                    _HELD.get(frozenset(held.ways), f"held in {', '.join(held.ways)}"),
                )
            )
        for spring in body.outline.springs:
            rates = [
                f"{axis} {quantity(rate, 'N m-1')}" for axis, rate in zip("xyz", spring.stiffness, strict=True) if rate
            ]
            rates += [
                f"about {axis} {quantity(rate, 'N m')}/rad"
                for axis, rate in zip("xyz", spring.rotational, strict=True)
                if rate
            ]
            rows.append(
                (
                    name,
                    spring.name,
                    _place(body.at(spring.place)),
                    "spring: " * bool(rates) + ", ".join([*rates, *["damper"] * spring.damped]),
                )
            )
        for lump in body.outline.masses:
            rows.append((name, lump.name, _place(body.at(lump.place)), f"mass {quantity(lump.mass, 'kg')}"))
    return Table("Supports, springs and masses", ("body", "name", "x, y, z", "what"), rows)


def _place(point: Array) -> str:
    return ", ".join(number(float(part), 4) for part in np.round(point, 9) + 0.0) + " m"


def _trains(study: Study) -> Table:
    rows = []
    for name, train in study.train.items():
        low, high = train.motion.range()
        rows.append(
            (
                name,
                train.on,
                train.kind,
                str(train.count),
                quantity(train.length, "m", 4),
                spanned(train.axle_loads, partial(quantity, units=train.units, digits=4)),
                quantity(train.load, train.units, 4),
                f"{number(low, 4)} to {number(high, 4)} m",
                _speeds(study, axle_name(name, 0)),
            )
        )
    headings = ("train", "on", "kind", "axles", "length", "load per axle", "in all", "way", "speed")
    return Table("Trains", headings, rows)


def _speeds(study: Study, carriage: str) -> str:
    """The top speed of a carriage, or those of the slowest and the fastest variant where the sweep changes them."""
    here, cases = f"carriage.{carriage}.motion.", expand(study)
    axes = [axis for axis in cases.axes if any(path.startswith(here) for path in axis.paths)]
    ends = [(axis.dim, int(pick(axis.values))) for axis in axes for pick in (np.argmin, np.argmax)]
    places = [[end if dim == own else 0 for dim in cases.dims] for own, end in ends]
    variants = [cases.study_of(study, int(np.ravel_multi_index(place, cases.shape))) for place in places]
    motions = [one.carriage[carriage].motion for one in variants or [study]]
    words = partial(swept_quantity, units="m s-1", typed=typed_speed(study, carriage))
    return spanned([motion.max_speed / motion.time_scale for motion in motions], words)


def _carriages(scene: Layout, study: Study) -> Table:
    model, rows = scene.model, []
    values = VariantValues(model.study, {}, 1)
    for index, tie in enumerate(model.carriages):
        if tie.name in study.axles:
            continue
        carriage, modal = model.study.carriage[tie.name], model.bodies[tie.body].modal
        force, (low, high) = float(weight(model, values, index)[0]), carriage.motion.range()
        s = np.linspace(max(low, 0.0), min(high, modal.length), PROBED)
        across = abs(float(scene.bodies[carriage.on].axes[2, 2])) if carriage.on in scene.bodies else 1.0
        sags = not modal.rigid_modes and across > ROUNDING  # not where it stands upright
        deflection = across * float(np.abs(modal.influence_at(s, s)).max()) * abs(force) if sags else 0.0
        sag = quantity(deflection, "m") if sags else ""
        if sag and len(carriage.riding_contacts) > 1:  # which share it
            sag += " of its weight at one point"
        way = f"{number(low, 4)} to {number(high, 4)} m, {carriage.motion.kind}"
        mass = float(moving_mass(model, values, index)[0])
        rows.append(
            (
                tie.name,
                ", ".join(dict.fromkeys(carriage.ridden)),
                carriage.kind,
                quantity(mass, "kg", 4) if mass else "",
                quantity(force, "N"),
                sag,
                way,
                _speeds(study, tie.name),
            )
        )
    headings = ("carriage", "on", "kind", "mass", "weight", "largest static deflection under it", "way", "top speed")
    return Table("Carriages", headings, rows)


def _sensors(scene: Layout) -> Table:
    study, rows = scene.model.study, []
    for name, sensor in study.sensor.items():
        spot = sensor.spot
        if sensor.rides is not None:
            where = f"moves with {sensor.rides}"
        elif spot is None or spot.key == "at":
            where = f"at {number(sensor.at or 0.0, 4)} m of its track"
        else:
            place = study.body[str(sensor.body)].spot_place(spot)
            where = f"{spot.key} {getattr(spot, spot.key):}" + ("" if place is None else f" at {_place(place)}")
        rows.append((name, sensor.words, study.body_of(name), f"{where}{sensor.way_in_words}"))
    return Table("Sensors", ("sensor", "quantity", "body", "where"), rows)
