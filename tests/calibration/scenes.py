"""Random scenes for the calibration of the choice of models: beams, motions, carriages and sensors from a seed.

A beam has L = E I = rho A = 1, so that a carriage's mass is its mass ratio mu, and alpha = v/(omega_1 L/pi).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.jobs import InTurn
from engine.batch.plan import Plan, make_plan
from engine.model.distinct_models import base_scene
from engine.scene.study import Study
from results_schema.arrays import Array
from studies.protocol.study import kind_of
from tests.engine.build import Table, beam, cruise, fixed, force, mass, oscillator, shuttle, study, swing, under

Random = np.random.Generator

SLOWEST, FASTEST = 0.002, 0.6  # alpha
GRAVITY = 9.81
KINDS = {"cruise": "passage", "out-and-back": "asymmetry", "sinusoidal": "double-peak"}
ENDS = ("pinned-pinned", "clamped-clamped", "clamped-pinned", "pinned-clamped", "clamped-free", "free-clamped")
SPRUNG = ("end springs", "inner springs", "three springs", "springs and dampers")
CYCLES = ((1, 2, 3, 4, 5, 6), (0.3, 0.25, 0.15, 0.1, 0.1, 0.1))


def draw(seed: int, number: int, size: int, tolerance: float) -> Study:
    """Scene of a number in the sample of a seed, with variants that differ in speed, mass, damping and, on a spring, in
    stiffness and its damper; no other scene has a say in it."""
    random = np.random.default_rng([seed, number])
    supports = _supports(random)
    motion = _motion(random, list(KINDS)[number % len(KINDS)])
    kind = str(random.choice(["mass", "force", "oscillator"], p=[0.7, 0.12, 0.18]))
    if kind == "oscillator" and "after" in motion:
        motion["after"] = 0.0  # conditionally stable schemes, such as the references', march no springs in it
    bed = beam(supports=supports, modes="auto")
    sensors = {"place": fixed(_between(random, 0.1, 0.9)), "below": under("car")}
    if reads_moment(number):
        sensors["moment"] = fixed(_on_the_way(random, motion), "bending_moment")
    first = float(base_scene(study(bed | {"modes": 4}, mass(1.0, motion))).first_omega)
    alpha, mu = _alphas(random, size), _log(random, 0.01, 1.0, size)
    zeta = np.where(random.random(size) < 0.25, 0.0, random.uniform(0.0, 0.1, size))
    carriage, columns = _carriage(random, kind, motion, mu, first)
    columns |= {_pace_key(motion): _pace(motion, alpha * first / np.pi), "body.bed.damping_ratio": zeta}
    axes = {f"axis{n}": {"of": path, "values": column.tolist()} for n, (path, column) in enumerate(columns.items())}
    tables = {"kind": KINDS[motion["kind"]], "sensor": sensors, "sweep": {"zip": True} | axes, "gravity": GRAVITY}
    return study(bed, carriage, **tables, solver={"tolerance": tolerance})


FIXED = ("steps", "modes", "scheme", "fidelity", "static correction")


def with_fixed(given: Study, seed: int, number: int) -> Study:
    """A scene with one or two of its numerics fixed, in turn and at random. Raises BadInput where they break a rule."""
    random = np.random.default_rng([seed, number, 1])
    names = {FIXED[number % len(FIXED)], str(random.choice(FIXED))}
    found: dict[str, Any] = {}
    if "steps" in names:
        found["solver.steps"] = int(_log(random, 100, 10000, 1)[0])
    if "modes" in names:
        found["body.bed.modes"] = int(random.integers(2, 13))
    if "scheme" in names:
        found["solver.scheme"] = str(random.choice(["average-acceleration", "fox-goodwin", "richardson", "hht-alpha"]))
        found |= {"solver.alpha": -0.05} if found["solver.scheme"] == "hht-alpha" else {}
    if "fidelity" in names:
        found["solver.fidelity"] = str(random.choice(["force", "mass", "full"]))
    if "static correction" in names:
        found["solver.static_correction"] = False
    return given.with_values(found)


def planned(study: Study) -> Plan:
    """The plan of a study, chosen for."""
    kind = kind_of(study)
    plan = make_plan(study, reduction=kind.reduction(study), results=kind.name)
    plan.choose(InTurn())
    return plan


def judged(plan: Plan, count: int, seed: int | list[int]) -> NDArray[np.int64]:
    """Some variants that are no pilots."""
    others = np.arange(plan.size) if plan.choice is None else np.setdiff1d(np.arange(plan.size), plan.choice.pilots)
    return np.sort(np.random.default_rng(seed).permutation(others)[:count])


def reads_moment(number: int) -> bool:
    """Whether the scene of a number reads a bending moment too: every third of each kind."""
    return number // len(KINDS) % 3 == 0


def _alphas(random: Random, size: int) -> Array:
    """(V,) from a band of random width within the whole range: a sweep has its slowest and its fastest."""
    whole = np.log(FASTEST / SLOWEST)
    width = random.uniform(0.15, 0.7) * whole
    low = np.log(SLOWEST) + random.uniform(0.0, whole - width)
    return np.asarray(np.exp(random.uniform(low, low + width, size)))


def _pace_key(motion: Table) -> str:
    return "carriage.car.motion." + ("frequency" if motion["kind"] == "sinusoidal" else "speed")


def _pace(motion: Table, speed: Array) -> Array:
    """(V,) speeds, or frequencies with these top speeds."""
    return speed / (2.0 * np.pi * motion["amplitude"]) if motion["kind"] == "sinusoidal" else speed


def _between(random: Random, low: float, high: float) -> float:
    return float(random.uniform(low, high))


def _on_the_way(random: Random, motion: Table) -> float:
    """A place that the load passes: off its way a beam on springs may have no static moment to compare with."""
    reach = motion.get("amplitude", 0.0)
    ends = (motion["centre"] - reach, motion["centre"] + reach) if reach else (motion["start"], motion["end"])
    low, high = (min(max(end, 0.0), 1.0) for end in (min(ends), max(ends)))
    return float(low + (high - low) * _between(random, 0.1, 0.9))


def _log(random: Random, low: float, high: float, size: int) -> Array:
    return np.exp(random.uniform(np.log(low), np.log(high), size))


def _supports(random: Random) -> str | list[Table]:
    """Supports that hold the beam: both ends in words, or springs."""
    if random.random() < 0.6:
        return str(random.choice(ENDS))
    name = str(random.choice(SPRUNG))
    low, high = (0.0, 1.0) if name == "end springs" else (_between(random, 0.0, 0.3), _between(random, 0.7, 1.0))
    places = [low, _between(random, 0.4, 0.6), high] if name == "three springs" else [low, high]
    springs = [{"at": at, "stiffness": float(_log(random, 20.0, 5000.0, 1)[0])} for at in places]
    for spring in springs:
        if random.random() < 0.3:
            spring["rotational"] = float(_log(random, 0.1, 100.0, 1)[0])
        if name == "springs and dampers" or random.random() < 0.1:
            spring["damping"] = float(_log(random, 0.05, 5.0, 1)[0])
    return springs


def _motion(random: Random, kind: str) -> Table:
    """A motion of a kind, at some pace."""
    cycles = int(random.choice(CYCLES[0], p=CYCLES[1]))
    low, high = _between(random, 0.0, 0.35), _between(random, 0.6, 1.0)
    if kind == "cruise":
        way = [(0.0, 1.0), (low, high), (-_between(random, 0.02, 0.3), 1.0 + _between(random, 0.02, 0.3))]
        start, end = way[int(random.integers(3))]
        if random.random() < 0.3:
            start, end = end, start
        return cruise(start, end, 1.0, after=float(random.choice([0.0, 0.0, 0.5, 3.0])))
    if kind == "out-and-back":
        turn = 0.0 if random.random() < 0.25 else _between(random, 0.02, 0.25)
        return shuttle(low, high, 1.0, turn, cycles)
    centre = _between(random, 0.35, 0.65)
    return swing(centre, _between(random, 0.1, 0.99) * min(centre, 1.0 - centre), 1.0, cycles)


def _carriage(random: Random, kind: str, motion: Table, mu: Array, first: float) -> tuple[Table, dict[str, Array]]:
    """The carriage, and what of it varies. A spring is soft to stiff: 0.2 to 8 times the beam's first frequency."""
    if kind == "mass":
        return mass(1.0, motion), {"carriage.car.mass": mu}
    if kind == "force":
        return force(1.0, motion), {"carriage.car.force": GRAVITY * mu}
    wheel = float(random.choice([0.0, 0.05, 0.3]))
    omega, ratio = first * _log(random, 0.2, 8.0, mu.size), random.uniform(0.0, 0.2, mu.size)
    sprung = (1.0 - wheel) * mu
    columns = {"mass": sprung, "stiffness": sprung * omega**2, "damping": 2.0 * ratio * sprung * omega}
    columns |= {"wheel_mass": wheel * mu} if wheel else {}
    return oscillator(1.0, 1.0, motion), {f"carriage.car.{key}": column for key, column in columns.items()}
