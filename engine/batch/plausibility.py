"""What a user should know before believing a study: things that are allowed and yet often a mistake."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from engine.accuracy.grids import SceneGrid
from engine.batch.plan import Plan
from engine.batch.remarks_of_carriages import (
    OF_WAYS_AND_LOADS,
    does_not_swing,
    far_apart,
    has_unit,
    in_thousandths,
    swings_slowly,
)
from engine.bodies.modal.modal_body import ModalBody
from engine.bodies.modal.section_doubts import gravity_doubt
from engine.model.lane_table import moving_mass, weight
from engine.observation.signals import build_sensors
from engine.scene.study import Study
from engine.scene.sweep import Cases, broken
from engine.statics.directions import left_out, told_of
from results_schema.arrays import Array
from results_schema.quantities import QUANTITIES

FAST = 3.0  # times the critical speed
RACING = 150.0  # m/s: trains have run at 160, machines at 10; km/h read as m/s begin with 200
HEAVY = 4.0  # times the body's mass: a head of a machine tool weighed 2.2 times its beam, and was asked about
LONG = 100.0  # times the body's length: a way
DEEP = 0.07  # of the length: a bed on soft springs sags by 0.06 of it, a beam whose load had a wrong unit by 0.083
# Of the weight of the body that carries them, in the heaviest variant: loads together. Trains and tables press with 5 %
# to five times of it (those of built-in studies with 14 to 85 %), with a thousandth where kN were written as N. People
# on footbridges and small tools are as light in truth: what is written with its unit is believed.
LIGHT = 0.005
SAME_PLACE = 1e-9  # of a length: nearer places are one
MOMENTS = 33  # of a motion between two of its breaks, at which its acceleration is looked at


def remarks(plan: Plan) -> list[str]:
    """One sentence per remark, each once, in the order of `REMARKS`; none for an ordinary study."""
    return list(dict.fromkeys(sentence for remark in REMARKS for sentence in remark(plan)))


def check_limits(plan: Plan) -> None:
    """Refuse a frequency limit below every mode of its body in every variant. Raises BadInput."""
    for key, (body, limits, first) in _limits(plan).items():
        if (limits < first).all():
            what = f"no mode of {body} has so low a frequency, so that this would read 0"
            expected, received = f"at least its first natural frequency, {first.min():.4g} Hz", f"{limits.max():.4g} Hz"
            raise plan.study.source.fault(f"{key}.frequency_limit", what, expected=expected, received=received)


def _silent(plan: Plan) -> Iterator[str]:
    for key, (body, limits, first) in _limits(plan).items():
        if (limits < first).any() and (limits >= first).any():
            yield (
                f"{key.replace('.', ' ')} reads 0 in some variants: the first frequency of {body}, up to "
                f"{first.max():.4g} Hz, is above its frequency_limit there"
            )


def _reads_nothing(plan: Plan) -> Iterator[str]:
    """Of the scene without sweep; frequency limits are told of elsewhere."""
    limited = _limits(plan)
    for sensor in build_sensors(plan.base):
        if sensor.silent(plan.base) and f"sensor.{sensor.name}" not in limited:
            reads = sensor.quantity.replace("_", " ")
            why = "as at a support, a free end or by symmetry"
            yield f"sensor {sensor.name} reads 0: its body has no {reads} there, {why}"


def _between_places(plan: Plan) -> Iterator[str]:
    """Of envelopes of what has its peaks over supports and at ends of members; of the scene without sweep."""
    bodies = {part.name: part.modal for part in plan.base.bodies}
    for name, envelope in plan.study.envelope.items():
        body = bodies[envelope.body]
        places = envelope.along(body.length)
        joints = [at for at in body.joints if places[0] < at < places[-1]]
        off = [at for at in joints if np.abs(places - at).min() > SAME_PLACE * body.length]
        if off and len(joints) < envelope.places and QUANTITIES[envelope.quantity].has_kinks:
            more = f", and {len(off) - 1} more," if len(off) > 1 else ""
            yield (
                f"no place of envelope {name} is at {off[0]:.6g} m of {envelope.body}{more} where {envelope.quantity} "
                "has a kink (a support, or the end of a member): a sensor there reads the peak, or other places"
            )


def _limits(plan: Plan) -> dict[str, tuple[str, Array, Array]]:
    """Sensors and envelopes with a frequency limit by their dotted keys: the body, and for each scene the limit and the
    first natural frequency, Hz."""
    found = {}
    for table in ("sensor", "envelope"):
        for name, reader in getattr(plan.study, table).items():
            if reader.frequency_limit is not None:
                own = [getattr(grid.scene.study, table)[name].frequency_limit for grid in plan.grids]
                bodies = [part for grid in plan.grids for part in grid.scene.bodies if part.name == reader.body]
                first = np.array([part.modal.omega[0] for part in bodies]) / (2.0 * np.pi)
                found[f"{table}.{name}"] = reader.body, np.array(own), first
    return found


def _partly_inert(plan: Plan) -> Iterator[str]:
    """Of the scene without sweep."""
    if sentence := told_of(plan.base, of_loads=True):
        number, force = _braked(plan)
        name = plan.base.carriages[number].name if number >= 0 else ""
        if "along" in left_out(plan.study).get(name, ()):
            sentence += f"; the force that brakes {name}, up to {_newtons(force)}, does not push along it either"
        yield sentence


def _braking(plan: Plan) -> Iterator[str]:
    """Not where the sentence before asks for the same."""
    study, could, (number, force) = plan.study, left_out(plan.study), _braked(plan)
    asked = any("along" in ways for ways in could.values()) and number >= 0
    if number < 0 or (asked and told_of(plan.base, of_loads=True)):
        return
    tie = plan.base.carriages[number]
    remedy = "a track that moves along itself, as of frames and imported models that sway, takes inertia_along = true"
    if "along" in could.get(tie.name, ()):
        remedy = f"{study.source.written(f'carriage.{tie.name}')}.inertia_along = true brings it"
    elif study.carriage[tie.name].riding_body is not None:
        remedy = "bodies on contacts never push along"
    ridden = list(dict.fromkeys(study.carriage[tie.name].ridden))
    its, it, axis = ("its track", "it", "the track lies beside its axis")
    if len(ridden) > 1:
        its, it, axis = ("their tracks", "them", "these lie beside their axes")
    who = f"the force that brakes {tie.name}, up to {_newtons(force)}, does not push {' and '.join(ridden)}"
    yield f"{who} along {its}, nor bend {it} where {axis}; {remedy}"


def _braked(plan: Plan) -> tuple[int, float]:
    """Where residual vibration is asked for, the carriage that the largest force (N) speeds up or brakes, among those
    that do not push their bodies along, and that force; -1 where there is none."""
    study = plan.study
    if not study.output.residual or study.solver.fidelity in ("force", "static"):
        return -1, 0.0
    riding = {carriage.riding_body for carriage in study.carriage.values()}  # held along by their own motions
    forces = {
        number: max(_along(grid, number) for grid in plan.grids)
        for number, tie in enumerate(plan.base.carriages)
        if (own := study.carriage[tie.name]).inertial and "along" not in own.pushes and own.on not in riding
    }
    number = max(forces, key=lambda found: forces[found], default=-1)
    return (number, forces[number]) if number >= 0 and forces[number] > 0.0 else (-1, 0.0)


def _along(grid: SceneGrid, number: int) -> float:
    """The largest force (N) that speeds up or brakes a carriage; instant reversals are left out."""
    motion = grid.scene.carriages[number].rider.motion
    bounds = np.array([0.0, *motion.breaks(), motion.duration])
    tau = (bounds[:-1, None] + np.diff(bounds)[:, None] * np.linspace(0.0, 1.0, MOMENTS)).ravel()
    pace = grid.scene.carriages[number].rider.pace / _time_scale(grid)
    largest = max(float(np.abs(motion.path(tau, side).ddS).max()) for side in ("left", "right"))
    moved = [moving_mass(grid.scene, grid.values, one) for one in (number, *_carried(grid, number))]
    return largest * float(grid.values.in_si("N", sum(moved) * pace**2).max())


def _carried(grid: SceneGrid, number: int) -> list[int]:
    """Carriages on the body that a carriage brings."""
    study, ties = grid.scene.study, grid.scene.carriages
    brought = study.carriage[ties[number].name].riding_body
    return [one for one, tie in enumerate(ties) if brought is not None and study.carriage[tie.name].on == brought]


def doubtful(study: Study, cases: Cases) -> Iterator[str]:
    """Numbers that are hardly meant."""
    for doubt in (gravity_doubt(), *study.doubts()):
        if found := broken(study, cases, doubt):
            values = found[0]
            said = f"{doubt.where} = {doubt.amount(values)}: {doubt.what}, expected {doubt.expected}"
            yield f"{said}; {doubt.meant(values) or 'is the unit right?'}"


def half_united(study: Study) -> Iterator[str]:
    """Of lists alone: the ends of a range are refused."""
    for name, axis in study.sweep.axes.items():
        unit = study.unit(axis.of[0])
        if unit is not None and (mixed := axis.half_united()):
            united, bare = mixed
            yield f'sweep.{name} lists {bare:g} without a unit beside "{united}": is {bare:g} {unit.typed} meant?'


def _unsupported(plan: Plan) -> Iterator[str]:
    riding = {carriage.rides for carriage in plan.base.carriages}
    for number, part in enumerate(plan.base.bodies):
        if part.modal.rigid_modes and number not in riding:
            yield f"nothing holds body {part.name} fully: it will move away as a rigid body"


def _far_beside(plan: Plan) -> Iterator[str]:
    for part in plan.base.bodies:
        lever, length = plan.study.body[part.name].lever, part.modal.length
        if lever > length:
            beside = f"the track of body {part.name} lies {lever:.4g} m beside its axis"
            yield f"{beside}, which is {length:.4g} m long: is the unit of track.offset right?"


def _released(plan: Plan) -> Iterator[str]:
    for part in plan.base.bodies:
        if part.own_weight and plan.study.start == "rest":
            yield (
                f"body {part.name} is released undeformed at time 0 and rings under its own weight; "
                'initial = "equilibrium" starts it in its sag'
            )


def _leaves_between(plan: Plan) -> Iterator[str]:
    for carriage in plan.base.carriages:
        low, high = carriage.rider.motion.range()
        if high - low > LONG * carriage.rider.length:
            yield (
                f"{carriage.name} goes from {low:.4g} to {high:.4g} m, and its body is {carriage.rider.length:.4g} m "
                "long: are the units right?"
            )
        if carriage.rider.stays and (low < 0.0 or high > carriage.rider.length):
            yield (
                f"the way of {carriage.name} leaves its body ({low:.4g} to {high:.4g} m of "
                f"{carriage.rider.length:.4g} m), where it does not act: a spline may pass beyond its waypoints"
            )


def _fast(plan: Plan) -> Iterator[str]:
    """Of the first carriage, beside omega_1 L/pi."""
    worst, fastest = 0.0, 0.0
    for grid in plan.grids:
        scene = grid.scene
        speed = scene.carriages[0].rider.top_speed / _time_scale(grid)
        ratio = float(speed.max()) * np.pi / (scene.first_omega * scene.leading_body.modal.length)
        worst, fastest = max((worst, fastest), (ratio, float(grid.values.in_si("m s-1", speed)[speed.argmax()])))
    if worst > FAST:
        yield (
            f"some variants run at up to {worst:.3g} times the critical speed omega_1 L/pi, at {fastest:.3g} m/s: "
            "are the units right?"
        )


def _racing(plan: Plan) -> Iterator[str]:
    """Of the fastest carriage whose speed is written without a unit."""
    tops = {}
    for number, tie in enumerate(plan.base.carriages):
        table = plan.study.source.written(f"carriage.{tie.name}")
        if not has_unit(plan.study, f"{table}.motion.speed"):
            speeds = ((g.values, g.scene.carriages[number].rider.top_speed / _time_scale(g)) for g in plan.grids)
            top = max(float(values.in_si("m s-1", speed).max()) for values, speed in speeds)
            tops[table] = top, plan.study.carriage[tie.name].motion.pace
    table, (top, pace) = max(tops.items(), key=lambda found: found[1][0], default=("", (0.0, None)))
    if top > RACING:
        yield (
            f"{table.replace('.', ' ')} runs at speeds up to {top:.4g} m/s ({3.6 * top:,.0f} km/h): "
            f"{'were km/h meant?' if pace == 'speed' else 'are the units right?'}"
        )


def _heavy(plan: Plan) -> Iterator[str]:
    ratios = [
        moving_mass(g.scene, g.values, number).max() / body.mass
        for g, number, body in _carriages(plan)
        if body.mass > 0.0 and not _weighs_with_unit(plan.study, g.scene.carriages[number].name)
    ]
    worst = max(ratios, default=0.0)
    if worst > HEAVY:
        yield f"a carriage weighs up to {worst:.3g} times its body: are the units right?"


def _deep(plan: Plan) -> Iterator[str]:
    worst, most = 0.0, 0.0
    for grid, number, body in _carriages(plan):
        if not body.rigid_modes:
            s = np.linspace(0.0, body.length, 33)
            deflection = np.abs(body.influence_at(s, s)).max() * np.abs(weight(grid.scene, grid.values, number)).max()
            worst, most = max((worst, most), (float(deflection / body.length), float(deflection)))
    if worst > 1.0:
        yield (
            f"the static deflection alone is {most:.3g} m, {worst:.3g} times the length; no structure bends so far: "
            "are the units of stiffness, length and load right?"
        )
    elif worst > DEEP:
        yield (
            f"the static deflection alone reaches {worst:.3g} of the length: beyond small-deflection theory; are the "
            "units of load and stiffness right?"
        )


def _light(plan: Plan) -> Iterator[str]:
    """Of all loads on a body together, at their heaviest."""
    study = plan.study
    for body, part in enumerate(plan.base.bodies):
        loads = {number: tie.name for number, tie in enumerate(plan.base.carriages) if tie.body == body}
        share, load = max(_pressing(grid, body, loads) for grid in plan.grids)
        matter = (_weighs_with_unit(study, name) or _excites(study, name) for name in loads.values())
        if 0.0 < share < LIGHT and not any(matter):
            names = dict.fromkeys(study.source.written(f"carriage.{name}").replace(".", " ") for name in loads.values())
            masses = any(study.carriage[name].reacts for name in loads.values())
            press = "loads of {} together press" if len(loads) > 1 else "load of {} presses"
            yield (
                f"the {press.format(' and '.join(names))} with {_newtons(load)}, {100 * share:.2g} % of the weight of "
                f"{part.name}, {_newtons(load / share)}: "
                f"{'are the units right?' if masses else 'were kilonewtons meant?'}"
            )


def _excites(study: Study, name: str) -> bool:
    """Whether it is not by its weight alone that a carriage matters: it pulsates, or others go along what it is."""
    own = study.carriage[name]
    return own.pulsates or any(other.on == own.riding_body for other in study.carriage.values())


def _pressing(grid: SceneGrid, body: int, carriages: Iterable[int]) -> tuple[float, float]:
    """The largest load of some carriages on a body, over its weight and in N; 0 where it has no weight."""
    load = sum((np.abs(weight(grid.scene, grid.values, number)) for number in carriages), np.zeros(grid.values.size))
    own = grid.scene.bodies[body].modal.mass * grid.values.gravity
    share = np.divide(load, own, out=np.zeros_like(load), where=own > 0.0)
    return float(share.max()), float(grid.values.in_si("N", load)[share.argmax()])


def _weighs_with_unit(study: Study, carriage: str) -> bool:
    """Whether anything that makes the weight of a carriage is written with a unit."""
    own, table = study.carriage[carriage], study.source.written(f"carriage.{carriage}")
    return any(has_unit(study, f"{table}.{key}") for key in (*own.masses, *own.forces))


def _newtons(force: float) -> str:
    """A force in words.

    >>> _newtons(5700.0), _newtons(3.53e6), _newtons(19.0)
    ('5.7 kN', '3.53 MN', '19 N')
    """
    size, unit = next((found for found in ((1e6, "MN"), (1e3, "kN")) if force >= found[0]), (1.0, "N"))
    return f"{force / size:.3g} {unit}"


def _carriages(plan: Plan) -> Iterator[tuple[SceneGrid, int, ModalBody]]:
    """Every carriage of every scene by its number, and the body on which it rides."""
    for grid in plan.grids:
        for number, carriage in enumerate(grid.scene.carriages):
            yield grid, number, grid.scene.bodies[carriage.body].modal


def _thin(plan: Plan) -> Iterator[str]:
    """Fewer than 20 fixed steps in a first period."""
    for grid in plan.grids:
        if grid.fixed:
            periods = float(_time_scale(grid).max()) * grid.scene.first_omega / (2.0 * np.pi)
            steps = grid.unit * grid.scene.scheme.stride
            if steps < 20.0 * periods:
                yield f"{steps} steps are only {steps / periods:.2g} in a first period of the body"


def _brief_rest(plan: Plan) -> Iterator[str]:
    """Of the variant that has the least time to ring on, where it is told how far that goes."""
    if not plan.study.output.residual:
        return
    periods = []
    for grid in plan.grids:
        riders, period = grid.scene.riders, 2.0 * np.pi / grid.scene.first_omega
        rest = max(rider.end for rider in riders) - max(rider.rests_from for rider in riders)
        free = max(rider.motion.free_vibration for rider in riders)
        periods.append(rest * float(_time_scale(grid).min()) / period + free)
    if 0.0 < min(periods) < 1.0:
        yield (
            f"after the last carriage has come to rest the run lasts {min(periods):.2g} first periods of the body, so "
            "that residual vibration may swing further than is told: a longer dwell (or after) shows it all"
        )


def _time_scale(grid: SceneGrid) -> Array:
    """(V,) s per unit of scene time."""
    return grid.values.scene_time_scale


REMARKS: tuple[Callable[[Plan], Iterator[str]], ...] = (
    _partly_inert,
    _braking,
    lambda plan: doubtful(plan.study, plan.cases),
    lambda plan: half_united(plan.study),
    lambda plan: (f"{part.name}: {doubt}" for part in plan.base.bodies for doubt in part.modal.doubts),
    in_thousandths,
    far_apart,
    _unsupported,
    _far_beside,
    _released,
    _leaves_between,
    _fast,
    _racing,
    _heavy,
    _light,
    swings_slowly,
    does_not_swing,
    _silent,
    _reads_nothing,
    _between_places,
    _deep,
    _thin,
    _brief_rest,
    *OF_WAYS_AND_LOADS,
)
