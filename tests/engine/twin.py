"""The same scenes for the naive twin: phases, modes, statics and readings, with nothing of the engine's march.

Pinned beams come from closed forms; for other supports the modal body is the engine's, which has tests of its own.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from engine.model.lane_table import RESIDUAL_DAMPING
from engine.scene.study import Study
from tests.naive import motions, ode
from tests.naive import newmark as naive
from tests.naive import scene as scenes
from tests.naive.scene import Array, Damper, Load, Phase, Scene, State
from tests.reference import closed_forms

GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class Bed:
    """A beam as rows phi(x, j), frequencies, and its statics: influence(x, s, j) per N, sag(x, j) per m/s2, 0 where
    its own weight does not act."""

    length: float
    stiffness: float
    omega: Array
    phi: Callable[[float, int], Array]
    influence: Callable[[float, float, int], float]
    sag: Callable[[float, int], float]
    own_modal: Array
    dampers: tuple[tuple[float, float], ...]

    def missed(self, x: float, s: float, derivative: int) -> float:
        """Influence line minus kept modes."""
        soft = self.omega > 0.0
        kept = self.phi(x, derivative)[soft] * self.phi(s, 0)[soft] / self.omega[soft] ** 2
        return self.influence(x, s, derivative) - float(np.sum(kept))


def pinned_influence(x: float, s: float, derivative: int, length: float, stiffness: float) -> float:
    """Derivatives of the influence line of a pinned beam: deflection, -M/EI and -V/EI per unit force."""
    if derivative == 0:
        return closed_forms.influence_pinned(x, s, length, stiffness)
    left = x < s or x >= length  # where it jumps, the limit from the right; at the end from the left
    if derivative == 2:
        return -((length - s) * x if x <= s else s * (length - x)) / (length * stiffness)
    return -((length - s) if left else -s) / (length * stiffness)


def bed_of(study: Study, name: str) -> Bed:
    """The body of a study without sweep."""
    table: Any = study.body[name]
    stiffness, line_mass = table.bending_stiffness, table.mass_per_length
    if table.supports == "pinned-pinned":
        beam = closed_forms.PinnedBeam(table.modes, table.length, stiffness, line_mass)
        phi, omega = beam.phi, beam.omega
        own = beam.own_weight

        def influence(x: float, s: float, derivative: int) -> float:
            return pinned_influence(x, s, derivative, table.length, stiffness)

        def sag(x: float, derivative: int) -> float:
            k, z = line_mass / (24.0 * stiffness), x
            el = table.length
            poly = np.polynomial.Polynomial([0.0, el**3, 0.0, -2.0 * el, 1.0])
            return float(k * poly.deriv(derivative)(z)) if derivative else float(k * poly(z))

        dampers: tuple[tuple[float, float], ...] = ()
    else:
        modal = table.build()
        omega, own, dampers = modal.omega, modal.participation, modal.dampers

        def phi(s: float, derivative: int) -> Array:
            return modal.shape([s], derivative)[0]

        def influence(x: float, s: float, derivative: int) -> float:
            return float(modal.influence([x], [s], derivative)[0, 0])

        def sag(x: float, derivative: int) -> float:
            return float(modal.own_weight_deflection([x], derivative)[0])

    nothing: Callable[[float, int], float] = lambda x, derivative: 0.0  # noqa: E731
    return Bed(
        table.length,
        stiffness,
        omega,
        lru_cache(maxsize=None)(phi),
        influence,
        sag if table.own_weight else nothing,
        own,
        dampers,
    )


def damping_of(spec: Any, omega: Array) -> Array:
    """Ratios of all modes; the last of a list goes on."""
    if hasattr(spec, "rayleigh"):
        a, b = spec.rayleigh
        return a / (2.0 * omega) + 0.5 * b * omega
    return np.pad(np.atleast_1d(np.array(spec, dtype=np.float64)), (0, omega.size), mode="edge")[: omega.size]


def cruise_on(start: float, end: float, speed: float, begin: float, length: float) -> tuple[Phase, ...]:
    """The part of a cruise that lies on the body."""
    low, high = (min(max(x, 0.0), length) for x in (start, end))
    return motions.cruise(low, high, speed, begin + abs(low - start) / speed)


def spline_on(times: Any, places: Any, begin: float, length: float) -> tuple[Phase, ...]:
    """The one stretch of a spline's way that lies on the body."""
    spline = CubicSpline(np.array(times), np.array(places), bc_type=((1, 0.0), (1, 0.0)))
    fine = np.linspace(times[0], times[-1], 20001)
    inside = (spline(fine) >= 0.0) & (spline(fine) <= length)
    edges = [float(times[0])] if inside[0] else []
    for i in np.flatnonzero(np.diff(inside.astype(int))):
        end = 0.0 if min(spline(fine[i]), spline(fine[i + 1])) < 0.0 else length
        edges.append(brentq(lambda t, e=end: spline(t) - e, fine[i], fine[i + 1], xtol=1e-15))
    edges += [float(times[-1])] if inside[-1] else []
    assert len(edges) == 2
    s, ds, dds = spline, spline.derivative(1), spline.derivative(2)
    return (
        Phase(
            begin + edges[0],
            begin + edges[1],
            lambda t: min(max(float(s(t - begin)), 0.0), length),
            lambda t: float(ds(t - begin)),
            lambda t: float(dds(t - begin)),
        ),
    )


def phases_of(motion: Any, begin: float, length: float) -> tuple[Phase, ...]:
    """A motion that sets off at `begin`, on its body."""
    if motion.kind == "cruise":
        return cruise_on(motion.start, motion.end, motion.speed, begin, length)
    if motion.kind == "waypoints":
        return spline_on(motion.times, motion.positions, begin, length)
    if motion.kind == "point-to-point":
        found = trapezoid(motion)
    elif motion.kind == "sinusoidal":
        found = motions.sinusoidal(motion.centre, motion.amplitude, 2.0 * math.pi * motion.frequency, motion.cycles)
    elif motion.turn == 0.0:
        found = motions.instant_out_and_back(motion.start, motion.end, motion.speed, motion.cycles)
    else:
        found = motions.out_and_back(motion.start, motion.end, motion.speed, motion.turn, motion.cycles)
    return tuple(motions.shifted(phase, begin) for phase in found)


def trapezoid(motion: Any) -> tuple[Phase, ...]:
    """A point-to-point motion without a limit of jerk that reaches its speed, and its rest."""
    assert motion.jerk is None
    way = abs(motion.end - motion.start)
    up, push = motion.speed / motion.acceleration, motion.acceleration / way
    steady = way / motion.speed - up
    assert steady > 0.0
    parts = [(up, push, 0.0), (steady, 0.0, 0.0), (up, -push, 0.0)]
    moving = motions.point_to_point(motion.start, motion.end, parts)
    return motions.joined((*moving, standing(motion.end, moving[-1].end, moving[-1].end + motion.dwell)))


def standing(at: float, start: float, end: float) -> Phase:
    """A carriage that stands."""
    return Phase(start, end, lambda t: at, lambda t: 0.0, lambda t: 0.0)


def start_of(carriage: Any) -> float:
    """Seconds after time 0 at which a carriage sets off."""
    trails = 0.0 if carriage.headway is None else float(carriage.headway / carriage.motion.speed)
    return float(carriage.delay or 0.0) + trails


def load_of(study: Study, name: str, length: float, end: float, number: int = 0) -> Load:
    """A carriage as a load; one that does not cruise stands on its place before and after its motion. number: of its
    sprung mass's coordinate."""
    carriage: Any = study.carriage[name]
    begin = start_of(carriage)
    phases = phases_of(carriage.motion, begin, length)
    if carriage.motion.kind != "cruise":
        if begin > 0.0:
            phases = (standing(phases[0].s(phases[0].start), 0.0, begin), *phases)
        stays = carriage.motion.kind != "waypoints" or 0.0 <= carriage.motion.positions[-1] <= length
        if stays and phases[-1].end < end * (1.0 - 1e-12):
            phases = (*phases, standing(phases[-1].s(phases[-1].end), phases[-1].end, end * (1.0 + 1e-9)))
        phases = motions.joined(phases)
    if carriage.kind == "force":
        return scenes.moving_force(carriage.force, phases)
    if carriage.kind == "oscillator":
        wheel = scenes.moving_mass(carriage.wheel_mass, study.gravity, phases)
        weight = carriage.mass * study.gravity
        above = scenes.Sprung(number, carriage.mass, carriage.stiffness, carriage.damping, weight)
        return replace(wheel, sprung=above)
    if study.solver.fidelity == "force":
        return scenes.moving_force(carriage.mass * study.gravity, phases)
    if study.solver.fidelity == "mass-without-convective":
        return scenes.mass_without_convective(carriage.mass, study.gravity, phases)
    return scenes.moving_mass(carriage.mass, study.gravity, phases)


class Twin(NamedTuple):
    """One body with its loads, the names of its carriages, and what the naive march made of it.

    sagging: the coordinates count from the body's own sag, which is exact.
    """

    bed: Bed
    scene: Scene
    riders: tuple[str, ...]
    gravity: float
    history: naive.History


def march_twin(study: Study, body: str, t: Array) -> Twin:
    """March one body of a study at the instants t."""
    bed, scene, riders, start = scene_of(study, body, float(t[-1]))
    gravity = study.gravity
    sagging: dict[str, Any] = {  # the coordinates count from the body's exact own sag
        "at": lambda t, side: heavy(scene, bed, gravity, t, side),
        "strike": lambda t, state: arrival_on_sag(scene, bed, gravity, t, state),
    }
    history = naive.march(scene, t, start, scheme_of(study), **(sagging if study.body[body].own_weight else {}))
    return Twin(bed, scene, riders, gravity, history)


def solve_twin(study: Study, body: str, t: Array) -> Twin:
    """One body of a study, on which no weight of its own acts, at the instants t by DOP853."""
    bed, scene, riders, start = scene_of(study, body, float(t[-1]))
    scale = sum(load.weight * float(np.abs(bed.phi(0.5 * bed.length, 0)).max()) for load in scene.loads)
    softest = float(bed.omega[bed.omega > 0.0].min())
    return Twin(bed, scene, riders, study.gravity, ode.solve(scene, t, start, scale / softest**2))


def scene_of(study: Study, body: str, end: float) -> tuple[Bed, Scene, tuple[str, ...], State]:
    """One body of a study up to an instant, the names of its carriages, and its first state."""
    bed = bed_of(study, body)
    riders = tuple(name for name, carriage in study.carriage.items() if carriage.on == body)
    modes = bed.omega.size
    sprung = [name for name in riders if study.carriage[name].kind == "oscillator"]  # type: ignore[attr-defined]
    numbers = {name: modes + number for number, name in enumerate(sprung)}
    felt = 0
    loads = [load_of(study, name, bed.length, end, numbers.get(name, 0)) for name in riders]
    if study.solver.static_correction:
        for place in (place for place, load in enumerate(loads) if load.convective_mass > 0.0):
            loads[place] = replace(loads[place], residual=modes + len(sprung) + felt)
            felt += 1
    phi = padded_by(bed.phi, len(sprung) + felt)
    dampers = tuple(Damper(phi(at, 0), c, at) for at, c in bed.dampers)
    table: Any = study.body[body]
    zeta = damping_of(table.damping_ratio, bed.omega)
    own = zeta[-1] + RESIDUAL_DAMPING, bed.omega[-1]
    zeta, omega = (
        np.concatenate([of, np.zeros(len(sprung)), np.full(felt, last)])
        for of, last in zip((zeta, bed.omega), own, strict=True)
    )
    missed = partial(bed.missed, derivative=0) if study.solver.static_correction else None
    scene = Scene(phi, omega, zeta, tuple(loads), dampers, missed=missed)
    own = bool(table.own_weight)
    if study.start == "equilibrium":
        return bed, scene, riders, scenes.equilibrium(at_rest(scene, bed, study.gravity), 0.0)
    start = scenes.rest(scene)
    if own:
        start.q[:modes] = -study.gravity * bed.own_modal / bed.omega**2
    return bed, scene, riders, start


def padded_by(phi: scenes.Shape, coordinates: int) -> scenes.Shape:
    """Rows with zeros for more coordinates."""
    if not coordinates:
        return phi
    return lru_cache(maxsize=None)(lambda s, derivative: np.append(phi(s, derivative), np.zeros(coordinates)))


BETA = {"average-acceleration": 1 / 4, "linear-acceleration": 1 / 6, "fox-goodwin": 1 / 12, "central-difference": 0.0}
BETA["auto"] = BETA["average-acceleration"]  # with fixed steps


def scheme_of(study: Study) -> naive.Newmark | naive.GeneralizedAlpha:
    """The scheme that a study names."""
    solver = study.solver
    if solver.scheme == "newmark":
        assert solver.beta is not None and solver.gamma is not None
        return naive.Newmark(solver.beta, solver.gamma)
    if solver.scheme == "hht-alpha":
        assert solver.alpha is not None
        return naive.GeneralizedAlpha(0.0, -solver.alpha)
    if solver.scheme == "generalized-alpha":
        assert solver.rho_inf is not None
        rho = solver.rho_inf
        return naive.GeneralizedAlpha((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0))
    if solver.scheme == "scaled-fox-goodwin":
        return naive.Newmark(1 / 12, 0.5, 2.0)
    return naive.Newmark(BETA[solver.scheme], 0.5)


def sagging_weight(bed: Bed, load: Load, gravity: float, t: float, side: scenes.Side) -> float:
    """Weight of a load less its inertia along the curve of the body's sag."""
    phase = load.phase(t, side)
    if phase is None:
        return 0.0
    s, ds, dds = phase.s(t), phase.ds(t), phase.dds(t)
    curve = ds**2 * bed.sag(s, 2) + dds * bed.sag(s, 1)
    return load.weight - load.convective_mass * gravity * curve


def heavy(scene: Scene, bed: Bed, gravity: float, t: float, side: scenes.Side) -> Scene:
    """The scene of one instant, its loads with the weights that they have along the sag."""
    loads = tuple(
        replace(
            load,
            weight=sagging_weight(bed, load, gravity, t, side),
            sprung=sagging_spring(bed, load, gravity, t, side),
        )
        for load in scene.loads
    )
    return replace(scene, loads=loads)


def at_rest(scene: Scene, bed: Bed, gravity: float) -> Scene:
    """The scene with its springs over the body's sag, nothing moving at time 0."""
    sprung = [sagging_spring(bed, load, gravity, 0.0, "right") for load in scene.loads]
    loads = [
        replace(load, sprung=None if one is None else replace(one, climb=0.0))
        for load, one in zip(scene.loads, sprung, strict=True)
    ]
    return replace(scene, loads=tuple(loads))


def sagging_spring(bed: Bed, load: Load, gravity: float, t: float, side: scenes.Side) -> scenes.Sprung | None:
    """The spring of a load over the curve of the body's sag."""
    phase = load.phase(t, side)
    if load.sprung is None or phase is None:
        return load.sprung
    s = phase.s(t)
    climb = load.sprung.convective * phase.ds(t) * gravity * bed.sag(s, 1)
    return replace(load.sprung, level=gravity * bed.sag(s, 0), climb=climb)


def arrival_on_sag(scene: Scene, bed: Bed, gravity: float, t: float, state: State) -> Array:
    """Impulse at an event, with the slope of the sag."""
    jump = scenes.impulse(scene, t, state)
    extra = np.zeros_like(jump)
    for load in scene.loads:
        before, after = load.phase(t, "left"), load.phase(t, "right")
        if after is not None:
            change = after.ds(t) - (0.0 if before is None else before.ds(t))
            slope = gravity * bed.sag(after.s(t), 1)
            extra += load.convective_mass * scene.phi(after.s(t), 0) * change * slope
    return jump - np.linalg.solve(scenes.struck(scene, t), extra)
