"""Remarks of carriages: swept limits of motions that some variants do not reach, wheels that stay level, runs that end
with a train, loads that vanish on their way or point up, masses that hardly swing on their springs; and bands of
settling that are no band; units that are a prefix off; contacts that yield far; carriages that load nothing, and bodies
that hardly move as they are damped so much."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from engine.batch.plan import Plan
from engine.model.lane_table import weight
from engine.scene.study import Study
from engine.scene.variants import SpringKeys
from engine.study_file.refusals import value_at
from results_schema.arrays import Array
from results_schema.quantities import QUANTITIES

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import ModalBody

IN_A_ROW = 3  # axles: two excite little more than one
RINGS = 5.0  # first periods after a train: of two spans 3.4 m/s2 were seen after one of them, 3.9 after five
SHORT = 0.5  # of the length of the body: a way of a load that passes; cranes' are nine tenths of theirs
WIDE = 0.01  # of the length: a band of settling; cranes sag by a 500th at most, all of which lies within
SLOW = 0.1  # Hz, of a mass on its spring: vehicles swing at 0.5 to 20 Hz, and at a thirtieth of that on N/m for kN/m
YIELDS = 0.5  # of the length of a body, by its springs: coaches yield by a quarter of a metre, a hundredth of theirs
FARTHEST = 100.0  # m from axle to axle: those of the longest wagons stand 20 m apart
MOST_DAMPING = 0.3  # of critical: hardly any structure has more
NEXT_TO_NO_DAMPING = 1e-4  # of critical: springs of steel alone have more; as a ratio is a number of N s/m
_THOUSANDTHS = re.compile(r"(?<=[\d ./*])m(?:Pa\b|N\b(?=\s*\S))")  # of pascals, and of what loads are not
#: Of the largest flexibility of a track: up to there accelerations of a footbridge were a seventh above those on rigid
#: bearings; with 0.009 they were twice, with 0.08 eight times these.
GIVES_WAY = 0.002
PLACES = 9  # along a track, at which that is looked for
BELOW = 1e-9  # relative: a limit that is missed by more is not reached


def unreached(plan: Plan) -> Iterator[str]:
    """One sentence for every swept limit of a carriage."""
    swept = {key for axis in plan.study.sweep.axes.values() for key in axis.of}
    for tie in plan.base.carriages:
        table = plan.study.source.written(f"carriage.{tie.name}")
        for key in tie.rider.motion.reached:
            if f"{table}.motion.{key}" in swept:
                yield from _of_limit(plan, tie.name, table, key)


def _of_limit(plan: Plan, name: str, table: str, key: str) -> Iterator[str]:
    number, found = 0, list[float]()
    for grid in plan.grids:
        study = grid.scene.study
        reached = study.carriage[name].motion.reached[key]
        if reached < (1.0 - BELOW) * study.value(f"carriage.{name}.motion.{key}"):
            number += grid.values.size
            found.append(reached)
    if found:
        unit = plan.study.unit(f"carriage.{name}.motion.{key}")
        low, high = f"{min(found):.4g}", f"{max(found):.4g}"
        most = f"{low if low == high else f'{low} to {high}'} {unit.typed if unit else ''}"
        yield (
            f"the {key} of {table.replace('.', ' ')} is not reached in {number:,} of {plan.size:,} variants: it gets "
            f"to {most} there, so that those which differ in it alone are the same run"
        )


def stays_level(plan: Plan) -> Iterator[str]:
    """One sentence for every body of which contacts at one place of its own track stand one behind the other."""
    for name, carriage in plan.study.carriage.items():
        if level := [" and ".join(names) for names in carriage.level_contacts]:
            yield (
                f"the body on carriage {name} does not pitch, as contacts of it hold it at one place of its track: "
                f"{', '.join(level)} stay level, and press as if it were held so; a frame with a point at each pitches"
            )


def ends_early(plan: Plan) -> Iterator[str]:
    """One sentence for every train that may excite a body in step, whose run hardly goes on after it."""
    for name, train in plan.study.train.items():
        motion = train.motion
        if train.count >= IN_A_ROW and motion.passes and motion.free_vibration < RINGS:
            rest = f"{motion.free_vibration:g} first period{'' if motion.free_vibration == 1.0 else 's'} of the body"
            yield (
                f"the run goes on for {rest} after the last axle of train {name} has left, and where axles come in "
                f"step with the body it swings furthest about then: after = {RINGS:g} in its motion sees more of it"
            )


def vanishes(plan: Plan) -> Iterator[str]:
    """One sentence for every carriage that only passes and whose way ends on its body soon after it begins, and for
    every train whose way does at all."""
    told = set[str]()  # axles of a train have one table
    for tie in plan.base.carriages:
        motion, length = tie.rider.motion, tie.rider.length
        start, end = (float(motion.path(tau).S) for tau in (0.0, motion.duration))
        is_brief = tie.name in plan.study.axles or abs(end - start) < SHORT * length
        table = plan.study.source.written(f"carriage.{tie.name}").replace(".", " ")
        if motion.passes and 0.0 < end < length and is_brief and table not in told:
            told.add(table)
            yield (
                f"{table} is gone from {end:g} m on, where its {motion.kind} ends on a body of {length:g} m: an end at "
                "or beyond that of the body lets it leave, other motions let it stop"
            )


def pulsates_together(plan: Plan) -> Iterator[str]:
    """One sentence where one of several forces sets off later, whose phases count from the run's start. Axles of a
    train are meant to pulsate in step."""
    study, swept = plan.study, {key for axis in plan.study.sweep.axes.values() for key in axis.of}
    each = [name for name, own in study.carriage.items() if own.pulsates and name not in study.axles]
    phases = [f"carriage.{name}.pulsation.phase" for name in each]
    later = [name for name in each if study.carriage[name].start_time > 0.0 or f"carriage.{name}.delay" in swept]
    if len(each) > 1 and later and not any(key in swept or study.value(key) for key in phases):
        yield (
            f"phases count from the run's start, not from when {' and '.join(later)} set{'s' * (len(later) == 1)} off, "
            "so that persons of one pace walk in step: a phase of -2 pi frequency delay begins one as it sets off"
        )


def pulls_by_pulsation(plan: Plan) -> Iterator[str]:
    """One sentence for every force that pulls for a part of its swing."""
    told = set[str]()  # axles of a train have one table
    for name, own in plan.study.carriage.items():
        table = plan.study.source.written(f"carriage.{name}").replace(".", " ")
        if own.pulsates and table not in told:
            force, amplitude = (plan.study.value(f"carriage.{name}.{key}") for key in ("force", "pulsation.amplitude"))
            if 0.0 < force < abs(amplitude):
                told.add(table)
                yield f"{table} pulls for a part of each swing, as its amplitude, {amplitude:.4g} N, is above its force"


def strikes_all_modes(plan: Plan) -> Iterator[str]:
    """One sentence for every body whose accelerations are read, and which loads step onto or off where it gives way."""
    study = plan.study
    read = {study.body_of(name) for name, sensor in study.sensor.items() if QUANTITIES[sensor.quantity].rate > 1}
    for part in plan.base.bodies:
        if part.name in read and not part.modal.rigid_modes and (soft := _soft_ends(plan, part.name, part.modal)):
            yield (
                f"loads step onto {part.name} or off it within no time at {' and '.join(soft)}, where it gives way, "
                "which strikes every mode: accelerations are larger there than of wheels that roll over a joint, and a "
                "frequency_limit of their sensors leaves fast modes out"
            )


def _soft_ends(plan: Plan, name: str, modal: ModalBody) -> list[str]:
    """Ends of the track of a body that give way and that loads pass."""
    motions = [one.motion for one in plan.study.carriage.values() if one.on == name and one.motion.passes]
    passed = [float(motion.path(tau).S) for motion in motions for tau in (0.0, motion.duration)]
    places = np.linspace(0.0, modal.length, PLACES)
    flexible = np.abs(modal.influence_at(places, places))
    soft = flexible[[0, -1]] > GIVES_WAY * flexible.max()
    over = [any(place <= 0.0 for place in passed), any(place >= modal.length for place in passed)]
    return [f"{end:g} m" for end, here in zip((0.0, modal.length), soft & over, strict=True) if here]


def begins_on_it(plan: Plan) -> Iterator[str]:
    """Of what crosses and begins where a track gives way, in a study that starts in equilibrium for something else in
    it: by itself it would come onto a body at rest."""
    study, bodies = plan.study, {part.name: part.modal for part in plan.base.bodies}
    if study.initial is not None or study.start != "equilibrium":
        return
    for tie in plan.base.carriages:
        name, own = study.carriage[tie.name].on, study.carriage[tie.name]
        place, places = float(own.motion.path(0.0).S), np.linspace(0.0, bodies[name].length, PLACES)
        if own.motion.passes and 0.0 <= place <= bodies[name].length:
            flexible = np.abs(bodies[name].influence_at(np.append(places, place), np.append(places, place)))
            if flexible[-1] > GIVES_WAY * flexible.max():
                yield (
                    f"{tie.name} begins at {place:g} m of {name} with its static deflection, as a study in which "
                    "something stands or turns starts in equilibrium: a start before the track lets it come onto it"
                )
                return


def points_up(plan: Plan) -> Iterator[str]:
    """One sentence for every plain force that is negative."""
    for name, carriage in plan.study.carriage.items():
        table = plan.study.source.written(f"carriage.{name}").replace(".", " ")
        for key in carriage.forces:
            if plan.study.value(f"carriage.{name}.{key}") < 0.0:
                yield f"the force of {table} is negative, so that it lifts: weights are positive"


def has_no_band(plan: Plan) -> Iterator[str]:
    """One sentence for every sensor whose band of settling is as large as its body."""
    for name, sensor in plan.study.sensor.items():
        for part in plan.base.bodies:
            if part.name == plan.study.body_of(name) and (sensor.settling_band or 0.0) > WIDE * part.modal.length:
                yield (
                    f"settling_band of sensor {name}, {sensor.settling_band:g} m, is more than a hundredth of "
                    f"{part.name}: was a smaller unit meant?"
                )


def sprung(plan: Plan) -> dict[str, tuple[Array, Array]]:
    """The smallest and largest natural frequencies (Hz) and damping ratios of masses on their springs, of each scene,
    by the tables that describe them."""
    found: dict[str, list[list[float]]] = {}
    for grid in plan.grids:
        for name in (name for name, one in plan.study.carriage.items() if one.suspension is not None):
            keys = SpringKeys.of_carriage(name)
            own = (grid.values.columns.get(key, grid.values.study.value(key)) for key in keys)  # few are swept
            stiffness, damping, mass = map(np.asarray, own)
            omega = np.sqrt(stiffness / mass)
            parts = omega / (2.0 * np.pi), damping / (2.0 * mass * omega)
            ends = [end() for part in parts for end in (part.min, part.max)]
            found.setdefault(plan.study.source.written(f"carriage.{name}"), []).append(ends)
    return {table: (np.array(own)[:, :2], np.array(own)[:, 2:]) for table, own in found.items()}


def swings_slowly(plan: Plan) -> Iterator[str]:
    """One sentence for every mass on a spring that is far too soft."""
    for table, (frequencies, _) in sprung(plan).items():
        if frequencies.min() < SLOW and not has_unit(plan.study, f"{table}.stiffness"):
            yield (
                f"the sprung mass of {table.replace('.', ' ')} swings at {frequencies.min():.2g} Hz on its spring: "
                "were kilonewtons per metre meant?"
            )
    yield from _yields_far(plan)


def _yields_far(plan: Plan) -> Iterator[str]:
    """One sentence for every contact that yields by a good part of the length of the body that stands on it."""
    found = dict[tuple[str, str], float]()
    for grid in plan.grids:
        for number, tie in enumerate(grid.scene.carriages):
            if tie.rides is None:
                continue
            heaviest = float(weight(grid.scene, grid.values, number).max())
            most = YIELDS * grid.scene.bodies[tie.rides].modal.length
            contacts = grid.scene.study.carriage[tie.name].riding_contacts
            for (name, contact), load in zip(contacts.items(), tie.loads, strict=True):
                key = SpringKeys.of_contact(tie.name, name).stiffness
                softest = np.inf if contact.is_rigid else float(grid.values.column(key).min())
                sunk = load.share * heaviest / softest
                if sunk > most:
                    found[tie.name, name] = max(sunk, found.get((tie.name, name), 0.0))
    for (carriage, name), sunk in found.items():
        table = plan.study.source.written(f"carriage.{carriage}")
        yield f"{table}.contacts.{name} yields by {sunk:.3g} m under the weight that it bears: is its stiffness right?"


def does_not_swing(plan: Plan) -> Iterator[str]:
    """One sentence for every mass on a spring that is damped beyond swinging, or next to not at all."""
    for table, (frequencies, ratios) in sprung(plan).items():
        if ratios.max() > 1.0:
            yield (
                f"the sprung mass of {table.replace('.', ' ')}, of {frequencies.max():.3g} Hz on its spring, is damped "
                f"by up to {ratios.max():.3g} times what lets it swing: is its mass right, in kg?"
            )
        elif 0.0 < ratios.max() < NEXT_TO_NO_DAMPING and not has_unit(plan.study, f"{table}.damping"):
            yield (
                f"the sprung mass of {table.replace('.', ' ')} is damped by {ratios.max():.2g} of critical damping: "
                "its damping is in N s/m; of a damping ratio zeta it is 2 zeta sqrt(stiffness mass)"
            )


def far_apart(plan: Plan) -> Iterator[str]:
    """One sentence for every train whose axles stand farther apart than any do."""
    for name, train in plan.study.train.items():
        apart = float(np.diff(train.distances, prepend=0.0).max()) * train.spacing_scale
        if apart > FARTHEST:
            length = train.length
            yield f"axles of train {name} stand up to {apart:g} m apart, {length:g} m in all: were millimetres meant?"


def in_thousandths(plan: Plan) -> Iterator[str]:
    """One sentence for every value that is written in millinewtons or millipascals."""
    for key, text in _texts(plan.study.data):
        if found := _THOUSANDTHS.search(text):
            unit, large = found[0], f"M{found[0][1:]}"
            yield f'{key} = "{text}": {unit} is a thousandth of {unit[1:]}; was {large}, a million, meant?'


def _texts(table: Any, here: str = "") -> Iterator[tuple[str, str]]:
    """All texts of a study file by their dotted keys."""
    entries = table.items() if isinstance(table, Mapping) else enumerate(table)
    for key, value in entries:
        if isinstance(value, str):
            yield f"{here}{key}", value
        elif isinstance(value, Mapping | list | tuple):
            yield from _texts(value, f"{here}{key}.")


def has_unit(study: Study, path: str) -> bool:
    """Whether the values of a dotted key, those of a sweep where it is swept, are written with a unit."""
    swept = [axis.values or (axis.from_, axis.to) for axis in study.sweep.axes.values() if path in axis.of]
    try:
        own = value_at(study.data, path.split("."))
    except KeyError:  # left out
        own = None
    values = (value for part in swept or [own] for value in (part if isinstance(part, list | tuple) else [part]))
    return any(isinstance(value, str) for value in values)


#: In the order in which they are told.
def loads_nothing(plan: Plan) -> Iterator[str]:
    """Masses without gravity, of which none pushes otherwise."""
    loads = (weight(grid.scene, grid.values, n) for grid in plan.grids for n in range(len(grid.scene.carriages)))
    pushes = any(own.pulsates for own in plan.study.carriage.values()) or plan.base.pushes
    if not pushes and not any(np.any(load) for load in loads):
        yield "no carriage loads its body: gravity is 0, and none has a force; all that is read stays 0"


def damped_out(plan: Plan) -> Iterator[str]:
    """Bodies whose first mode that swings is damped as hardly any structure is, by Rayleigh's numbers or a list; of one
    ratio for all modes that is told elsewhere."""
    most = dict[str, float]()
    for grid in plan.grids:
        for part in grid.scene.bodies:
            spec, omega = plan.study.body[part.name], part.modal.omega[part.modal.rigid_modes :][:1]
            if omega.size and (spec.rayleigh is not None or spec.modal_ratios):
                whole = part.modal.omega[: part.modal.rigid_modes + 1]
                ratio = grid.values.damping_rates(part.name, whole)[-1] / (2.0 * omega[0])
                most[part.name] = max(most.get(part.name, 0.0), float(ratio.max()))
    for name, ratio in most.items():
        if ratio > MOST_DAMPING:
            more = "; a and b exchanged?" if plan.study.body[name].rayleigh is not None else ""
            yield (
                f"body.{name}.damping_ratio damps its first mode by {ratio:.3g} of critical: hardly any structure is "
                f"damped so much, expected at most {MOST_DAMPING:g}, steel 0.005, concrete 0.02{more}"
            )


OF_WAYS_AND_LOADS = (
    unreached,
    stays_level,
    ends_early,
    vanishes,
    strikes_all_modes,
    begins_on_it,
    points_up,
    has_no_band,
    pulsates_together,
    pulls_by_pulsation,
    loads_nothing,
    damped_out,
)
