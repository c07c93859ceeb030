"""What a run would do, from its plan and a few seconds of measuring: the scene, the work and its time, as tables."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np

from engine.accuracy.grids import SceneGrid
from engine.batch.audit import audited
from engine.batch.dataset import model_groups
from engine.batch.plan import Plan
from engine.batch.remarks_of_carriages import sprung
from engine.model.attachment import tie_shapes
from engine.model.distinct_models import base_scene
from engine.model.lane_table import moving_mass, weight
from engine.model.scene_model import SceneModel
from engine.model.station_path import Along, frozen
from engine.scene.sensors import Envelope, Sensor
from engine.scene.study import Study
from engine.scene.sweep import Cases, cells_of, expand
from engine.scene.trains import axle_name
from engine.scene.variants import VariantValues
from engine.statics.coupled_modes import CoupledModes, coupled_modes
from results_schema.arrays import Array
from studies.commands import planned_numerics as chosen
from studies.commands.forecast import AROUND, Forecast, forecast
from studies.commands.sampled import sampled
from studies.findings.in_step import WITH_MASSES, masses_ride, speeds_in_step
from studies.protocol.parts import Foreseen, Pieces, TextTable, Variants
from studies.results.axes import Axis
from studies.results.findings_common import has_dampers, told_trains
from studies.results.formatting import (
    Scale,
    counted,
    duration,
    number,
    percent,
    quantity,
    spanned,
    typed_speed,
)

FREQUENCIES_SHOWN = 6
STANDS = 33  # places of a carriage's way
JUST_BEYOND = 1.1  # times the highest speed of a sweep, up to which a resonance is felt at it


@dataclass(frozen=True)
class Preview:
    """What `check` tells: tables, a line with the cost, and what is worth knowing beside it."""

    tables: tuple[TextTable, ...]
    cost: str
    remarks: tuple[str, ...]


@singledispatch
def preview(parts: Any, threads: int, compiled: float = 0.0) -> Preview:
    """The explanation of a study's work for so many threads. compiled: seconds in which kernels were compiled so far,
    as only a first run does."""
    raise NotImplementedError


@preview.register
def _of_variants(parts: Variants, threads: int, compiled: float = 0.0) -> Preview:
    """That of a plan, from a few seconds of measuring."""
    plan = parts.plan
    seen = forecast(plan, threads, compiled=compiled)
    tables = (
        *(_study(plan), _bodies(plan.base), _tracks(plan.base), *_checks(plan.base)),
        *(_limits(plan.base), _sprung(plan), _standing(plan)),
        *(_sweep(plan.study, plan.cases), _ratios(plan)),
        *_in_step(plan),
        TextTable(seen.title, chosen.HEADINGS, seen.rows),
    )
    room = f"at most {size(seen.plan.memory_bytes)} of memory and {size(seen.plan.disk_bytes)} on the disk"
    cost = f"About {duration(seen.seconds)} on {counted(threads, 'thread')}, {room}.{_audit(seen)}{_unreduced(plan)}"
    remark = (seen.remark,) if seen.remark else ()
    return Preview(tuple(table for table in tables if table.rows), cost, (*parts.remarks, *remark))


def _audit(seen: Forecast) -> str:
    """How many variants are audited."""
    wanted = seen.plan.study.solver.audit
    if wanted == "auto" and not seen.plan.converges and seen.plan.choice is None:
        return ""
    return _audited(audited(seen.plan), wanted)


def _unreduced(plan: Plan) -> str:
    """That what was foreseen leaves out what may take most."""
    wanted = min(plan.study.output.unreduced, plan.size)
    if not wanted:
        return ""
    return f" On top of that {counted(wanted, 'variant')} by the unreduced model, seconds to minutes each."


def _audited(variants: int, wanted: int | str) -> str:
    if variants:
        return f" Then {counted(variants, 'variant')} are audited." if variants > 1 else " Then 1 variant is audited."
    return (
        " No audit." if wanted == 0 else " No audit: it would take too long; audit = N audits N variants all the same."
    )


@preview.register
def _of_pieces(parts: Pieces, threads: int, compiled: float = 0.0) -> Preview:
    """That of pieces, one after another, and the time they take."""
    kind, study, pieces = parts.kind, parts.study, parts.pieces
    rows = [("kind", study.kind), ("asks", kind.question), *[("pieces", str(len(pieces)))] * (len(pieces) > 1)]
    cases, around = expand(study), AROUND * (time.process_time() - compiled)
    seen = kind.foreseen(study, threads, parts.audited)
    each = {} if seen else sampled(pieces, threads)
    if kind.sweeps:
        rows.insert(1, ("variants", f"{cases.size:,}"))
        rows += told_trains(study)
    tables = (
        TextTable(study.title or study.source.name, ("", ""), rows),
        *(_of_scene(seen.study if seen else study, cases) if kind.sweeps else ()),
        *kind.tables(study),
        seen.table if seen else _work(parts, each),
    )
    cost = _measured(seen, around, threads) if seen else _expected(parts, around + sum(each.values()), threads)
    if kind.audit_seconds:
        cost += _audited(seen.audited if seen else parts.audited, study.solver.audit)
    remarks = [*parts.remarks, *([seen.remark] if seen and seen.remark else [])]
    return Preview(tuple(table for table in tables if table.rows), cost, tuple(remarks))


def _work(parts: Pieces, seconds: Mapping[str, float]) -> TextTable:
    """Pieces with the time that each takes."""
    work = [(piece.name, piece.words, duration(seconds[piece.name])) for piece in parts.pieces]
    return TextTable("Pieces, each kept when it is finished", ("piece", "what it does", "about"), work)


def _expected(parts: Pieces, seconds: float, threads: int) -> str:
    return f"About {duration(seconds)} on {counted(threads, 'thread')}, at most {size(parts.disk_bytes)} on the disk."


def _measured(seen: Foreseen, around: float, threads: int) -> str:
    room = f"about {size(seen.bytes)} for the archive, and as much for its parts while it runs"
    room = room if seen.bytes else "with an archive of a size that nothing tells yet"
    return f"About {duration(seen.seconds + around)} on {counted(threads, 'thread')}, {room}."


def _of_scene(study: Study, cases: Cases) -> Iterator[TextTable]:
    """The scene of a study that is computed in pieces, as a march's preview shows it."""
    base = base_scene(study)
    yield _bodies(base)
    yield _tracks(base)
    yield from _checks(base)
    yield _sweep(study, cases)


def size(count: int) -> str:
    """A number of bytes as people say it.

    >>> size(2_500), size(300 * 2**20)
    ('2.44 KiB', '300 MiB')
    """
    value, unit = float(count), "bytes"
    for larger in ("KiB", "MiB", "GiB", "TiB", "PiB"):
        if value < 1000.0:
            break
        value, unit = value / 1024.0, larger
    return f"{number(value)} {unit}"


def _study(plan: Plan) -> TextTable:
    study = plan.study
    shape = " x ".join(f"{length} {dim}" for dim, length in zip(plan.cases.dims, plan.cases.shape, strict=True))
    variants = f"{plan.size:,} = {shape}" if len(plan.cases.dims) > 1 else f"{plan.size:,}"
    rows = [("kind", study.kind), ("variants", variants), ("start", _START[study.start])]
    if not study.output.keeps_variants:
        cells = cells_of(study, plan.cases)
        rows.insert(2, ("kept", f"{study.output.keep} of {counted(cells.size, 'cell')}"))
    rows += told_trains(study)
    return TextTable(study.title or study.source.name, ("", ""), rows)


_START = {"rest": "undeformed, at rest", "equilibrium": "static equilibrium of the first position"}


def _bodies(base: SceneModel) -> TextTable:
    values, rows = VariantValues(base.study, {}, 1), []
    for part in base.bodies:
        omega = part.modal.omega
        rates = values.damping_rates(part.name, omega)[:, 0]
        elastic = omega > 0.0
        ratios = rates[elastic] / (2.0 * omega[elastic])
        pushed = base.excited(part)[:FREQUENCIES_SHOWN]
        frequencies = omega[:FREQUENCIES_SHOWN] / (2.0 * np.pi)
        shown = ", ".join(number(f) if own else f"({number(f)})" for f, own in zip(frequencies, pushed, strict=True))
        more = " ..." if omega.size > FREQUENCIES_SHOWN else ""
        if not elastic.any():
            rows.append((part.name, f"{number(part.modal.mass, 5)} kg", "rigid", "does not bend", "none"))
            continue
        damping = f"{spanned(ratios)}{' without its dampers' * has_dampers(base.study, part.name)}"
        rows.append((part.name, f"{number(part.modal.mass, 5)} kg", str(omega.size), shown + more, damping))
    aside = " (in brackets: loads on the track do not move these modes)" if any("(" in row[3] for row in rows) else ""
    return TextTable(f"Bodies{aside}", ("body", "mass", "modes", "frequencies (Hz)", "damping ratio"), rows)


def _tracks(base: SceneModel) -> TextTable:
    """Which end of a track is its beginning, where nodes have names: its members may be listed either way."""
    ends = {part.name: base.study.body[part.name].track_ends for part in base.bodies}
    rows = [(name, *nodes, quantity(base.study.body[name].length, "m")) for name, nodes in ends.items() if nodes]
    return TextTable("Tracks", ("body", "begins at node", "ends at node", "length"), rows)


def _checks(base: SceneModel) -> Iterator[TextTable]:
    """One table per body that was checked when it was imported."""
    for part in base.bodies:
        yield TextTable(f"Import of {part.name}", ("looked at", "found"), part.modal.checks)


def _limits(base: SceneModel) -> TextTable:
    """How many of the modes above every sensor with a frequency limit counts."""
    rows, study = [], base.study
    frequencies = {part.name: part.modal.omega / (2.0 * np.pi) for part in base.bodies}
    limits = [(name, one.body, one.frequency_limit) for name, one in study.sensor.items()]
    limits += [(name, one.body, one.frequency_limit) for name, one in study.envelope.items()]
    for name, body, limit in limits:
        if limit is not None:
            own = frequencies[str(body)]
            count = int(np.count_nonzero(own <= limit))
            which = f"{count} of {own.size}" if count < own.size else f"all {count}, and more where more are computed"
            rows.append((name, f"{number(limit)} Hz", which if count else "none: it reads 0"))
    return TextTable("Frequency limits", ("sensor or envelope", "up to", "modes that count"), rows)


def _sprung(plan: Plan) -> TextTable:
    """Masses on their springs, as if these stood on the ground."""
    rows = [
        (table.partition(".")[2], f"{spanned(frequencies.ravel())} Hz", spanned(ratios.ravel()))
        for table, (frequencies, ratios) in sprung(plan).items()
    ]
    return TextTable("Sprung masses by themselves", ("carriage", "natural frequency", "damping ratio"), rows)


def _standing(plan: Plan) -> TextTable:
    """What the first carriage does where it stands, in the scene without its sweep; not of trains and of bodies on
    contacts, which press in several places, nor on bodies that move away."""
    base = plan.base
    tie, values, rows = base.carriages[0], VariantValues(base.study, {}, 1), []
    body = base.bodies[tie.body].modal
    if not body.rigid_modes and not base.study.train and base.study.carriage[tie.name].riding_body is None:
        low, high = np.clip(tie.rider.range, 0.0, body.length)
        places = np.linspace(low, high, STANDS)
        sag = np.abs(body.influence_at(places, places) * weight(base, values, 0)[0])
        along = frozen(base, places)
        modes = coupled_modes(base, values, along, 1)
        most = f"up to {quantity(float(sag.max()), 'm')}, at {quantity(float(places[sag.argmax()]), 'm')}"
        frequencies = spanned(modes.omega.ravel() / (2.0 * np.pi))
        rows.append((tie.name, most, f"{frequencies} Hz", _damping_with_it(base, values, along, modes)))
    where = ", in the scene without its sweep" * bool(plan.study.sweep.axes)
    headings = ("carriage", "static deflection under it alone", "lowest frequency with it", "its damping ratio")
    return TextTable(f"Where the first carriage stands{where}", headings, rows)


def _damping_with_it(base: SceneModel, values: VariantValues, along: Along, modes: CoupledModes) -> str:
    """What damping ratios of the bodies' own modes and dampers beside springs leave to modes with what rides on them;
    "" where dampers hold the bodies too."""
    if any(has_dampers(base.study, part.name) for part in base.bodies):
        return ""
    rates = np.concatenate([values.damping_rates(part.name, part.modal.omega) for part in base.bodies])
    by_mode = np.einsum("kv,vskn->vsn", rates, modes.shapes[:, :, : len(rates)] ** 2)
    damped = {r: spring for r, spring in enumerate(base.springs, start=base.first_spring) if spring.damped}
    gaps = np.einsum("skr,vskn->rvsn", tie_shapes(base, list(damped), along), modes.shapes)
    for gap, spring in zip(gaps, damped.values(), strict=True):
        by_mode += values.column(spring.keys.damping)[:, None, None] * gap**2
    return spanned((by_mode / (2.0 * modes.omega)).ravel())


def _sweep(study: Study, cases: Cases) -> TextTable:
    rows = [
        (
            axis.name,
            str(len(axis.values)),
            Axis.of_scene(study, axis).span,
            ", ".join(axis.of),
        )
        for axis in cases.axes
    ]
    return TextTable("Sweep", ("axis", "values", "range", "sets"), rows)


def _ratios(plan: Plan) -> TextTable:
    """Ratios of the first carriage that decide how dynamic the scene is, over all variants."""
    name = plan.base.carriages[0].name
    found: dict[str, list[Array]] = {}
    for grid in plan.grids:
        for ratio, values in _ratios_of(grid, name):
            found.setdefault(ratio, []).append(values)
    rows = [(ratio, spanned(np.concatenate(values))) for ratio, values in found.items()]
    return TextTable(f"Ratios of {name}", ("ratio", "range"), rows)


def _in_step(plan: Plan) -> Iterator[TextTable]:
    """Swept speeds at which the axles of a train come once in a period of one of the first frequencies."""
    study, bodies = plan.study, model_groups(plan.base) if plan.study.train else {}
    readers: list[Sensor | Envelope] = [*study.sensor.values(), *study.envelope.values()]
    for name, train in study.train.items():
        axle = axle_name(name, 0)
        speeds = np.concatenate([grid.values.speed(axle) for grid in plan.grids])
        between, typed = (float(speeds.min()), float(speeds.max())), typed_speed(study, axle)
        one_speed, body = between[0] == between[1], bodies[f"/model/{train.on}"]
        looked = (between[0], JUST_BEYOND * between[1])
        found = [] if one_speed else speeds_in_step(study, name, body, looked, readers)
        within = [one for one in found if one.speed <= between[1]]
        most = max(within, key=lambda one: one.swing, default=None)
        rows = [
            (
                _of_speed(one.speed, typed) + ", beyond" * (one.speed > between[1]),
                f"{number(one.frequency)} Hz",
                quantity(one.way, "m"),
                percent(one.part),
                f"{quantity(one.swing, one.units, 2)}{', the strongest' * (one is most)}",
            )
            for one in found
        ]
        heading = f"Speeds at which axles of {name} push in step with a frequency of {train.on}"
        heading += WITH_MASSES * masses_ride(study, name)
        yield TextTable(
            heading, ("speed", "frequency", "way in a period", "part of its load", "swing of its mode"), rows
        )


def _of_speed(speed: float, typed: Scale | None) -> str:
    return quantity(speed, "m s-1") if typed is None else f"{number(speed * typed.factor)} {typed.unit}"


def _ratios_of(grid: SceneGrid, name: str) -> Iterator[tuple[str, Array]]:
    scene, values = grid.scene, grid.values
    rider, time_scale = scene.carriages[0].rider, values.time_scale(name)
    critical = scene.first_omega * scene.leading_body.modal.length / np.pi
    if scene.study.has_critical_speed:
        yield "top speed over the critical speed omega_1 L/pi", rider.top_speed / time_scale / critical
    if rider.motion.period is not None:
        yield "cycles per first period of the body", 2.0 * np.pi / scene.first_omega / time_scale
    if scene.study.carriage[name].inertial:
        yield "mass over the body's mass", moving_mass(scene, values, 0) / scene.leading_body.modal.mass
