"""What the equations promise whatever the numbers: linearity, mirror images, reversibility, energy, orders, and that
every term is felt."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from engine.batch.execution import run
from engine.batch.plan import make_plan
from engine.march.march import March, prepare
from engine.scene.study import Study
from results_schema.arrays import Array
from tests.engine import twin
from tests.engine.build import beam, cruise, fixed, force, mass, shuttle, swing, under
from tests.engine.build import study_of_steps as study
from tests.engine.reading import Reading
from tests.engine.twin import march_twin
from tests.naive import newmark, ode
from tests.naive import scene as scenes

ALL = {"histories": "all"}
SPRINGS = [{"at": 0.0, "stiffness": 60.0, "rotational": 0.3}, {"at": 0.8, "stiffness": 90.0, "damping": 0.5}]
MIRRORED = [{"at": 0.2, "stiffness": 90.0, "damping": 0.5}, {"at": 1.0, "stiffness": 60.0, "rotational": 0.3}]
QUANTITIES = ("displacement", "velocity", "acceleration", "bending_moment", "shear_force")


def test_response_is_linear_in_gravity() -> None:
    """Twice and ten times the gravity: sensors and contact forces in proportion, places the same."""
    sensors = {quantity: fixed(0.31, quantity) for quantity in QUANTITIES}
    carriages = {"car": mass(0.5, cruise(-0.1, 1.2, 0.9, after=0.5)), "next": mass(0.3, shuttle(0.2, 0.9, 1.0, 0.0, 1))}
    bed = beam(supports=SPRINGS, own_weight=True, damping_ratio=0.01)
    sweep = {"weight": {"of": "gravity", "values": [1.0, 2.0, 10.0]}}
    ds = run(study(bed, carriages, sensor=sensors, sweep=sweep, output=ALL, solver={"steps": 150}))
    names = [*sensors, "car_contact_force_max", "next_contact_force_min", *(f"{name}_max" for name in sensors)]
    compared = 0
    for name in names:
        values = ds[name].transpose("weight", ...).values
        scale = np.abs(values[0]).max()
        for factor, scaled in zip((2.0, 10.0), values[1:], strict=True):
            np.testing.assert_allclose(scaled, factor * values[0], rtol=0, atol=1e-10 * factor * scale, equal_nan=False)
            compared += np.size(scaled)
    assert compared > 1000
    assert np.ptp(ds.displacement_max_position.values) == 0.0


def test_mirror_image() -> None:
    """Backward on a beam is forward on the mirrored one; shear changes its sign."""
    sensors = {quantity: fixed(0.31, quantity) for quantity in QUANTITIES}
    sensors["below"] = under("car", "bending_moment")
    there = {name: {**sensor, "at": 0.69} if "at" in sensor else sensor for name, sensor in sensors.items()}
    forward = study(
        beam(supports=SPRINGS), mass(0.5, cruise(-0.1, 1.2, 0.9)), sensor=sensors, output=ALL, solver={"steps": 200}
    )
    backward = study(
        beam(supports=MIRRORED), mass(0.5, cruise(1.1, -0.2, 0.9)), sensor=there, output=ALL, solver={"steps": 200}
    )
    one, other = run(forward), run(backward)
    for name in sensors:
        sign = -1.0 if name == "shear_force" else 1.0
        scale = np.nanmax(np.abs(one[name].values))
        numbers = np.isfinite(one[name].values)
        assert numbers.sum() > 150
        np.testing.assert_allclose(
            sign * other[name].values[numbers], one[name].values[numbers], rtol=0, atol=1e-9 * scale, equal_nan=False
        )
    assert float(one.car_contact_force_min) == pytest.approx(float(other.car_contact_force_min), rel=1e-9)
    assert float(one.car_contact_force_min_position) == pytest.approx(1 - float(other.car_contact_force_min_position))


def ready(given: Study) -> March:
    """The march of a study's first 16 variants."""
    plan = make_plan(given)
    [group] = plan.groups
    return prepare(group.tables, plan.values(group, group.variants[:16]), np.zeros(0, dtype=np.int64))


def closure(solver: dict[str, Any]) -> float:
    """How far a march there and back in time, velocities and motion reversed, ends from where it started."""
    sweep = {"mass": {"of": "carriage.car.mass", "from": 0.1, "to": 2.0, "count": 16}}
    solver = solver | {"static_correction": False}  # whose coordinates are damped
    there, back = (
        ready(study(beam(modes=6, supports=SPRINGS[:1] + MIRRORED[1:]), mass(0.5, way), sweep=sweep, solver=solver))
        for way in (cruise(0.1, 0.9, 0.8), cruise(0.9, 0.1, 0.8))
    )
    rng = np.random.default_rng(1)
    shape = there.state.q.shape
    there.state.q[:], there.state.v[:] = rng.normal(size=shape), rng.normal(size=shape)
    q, v = there.state.q.copy(), there.state.v.copy()
    there.go()
    assert np.abs(there.state.q - q).max() > 0.1
    back.state.q[:], back.state.v[:] = there.state.q, -there.state.v
    back.go()
    return float(max(np.abs(back.state.q - q).max() / np.abs(q).max(), np.abs(back.state.v + v).max() / 1e2))


def test_average_acceleration_is_reversible() -> None:
    assert closure({"steps": 300}) < 1e-12
    assert closure({"steps": 300, "scheme": "newmark", "beta": 0.3025, "gamma": 0.6}) > 1e-3
    assert closure({"steps": 300, "scheme": "hht-alpha", "alpha": -0.05}) > 1e-3
    assert closure({"steps": 300, "scheme": "generalized-alpha", "rho_inf": 1.0}) < 1e-12


def modal_history(given: Study, zeta: float, steps: int) -> tuple[Any, Array, Array, Array]:
    """Dataset, instants, and modal coordinates and velocities (S, 3), recovered from three places."""
    places = (0.17, 0.42, 0.71)
    sensors = {f"w{i}": fixed(x) for i, x in enumerate(places)}
    sensors |= {f"v{i}": fixed(x, "velocity") for i, x in enumerate(places)}
    sensors |= {"below": under("car"), "rate": under("car", "velocity"), "change": under("car", "acceleration")}
    tables = given.data | {"sensor": sensors, "solver": {"steps": steps, "static_correction": False}, "output": ALL}
    tables = tables | {"body": {"bed": beam(modes=3, damping_ratio=zeta)}}
    ds = run(Study(**tables))
    bed = twin.bed_of(given, "bed")
    rows = np.array([bed.phi(x, 0)[:3] for x in places])
    q, v = (np.stack([ds[f"{kind}{i}"].values for i in range(3)], axis=1) for kind in "wv")
    return ds, ds.elapsed.values, np.linalg.solve(rows, q.T).T, np.linalg.solve(rows, v.T).T


@pytest.mark.parametrize("zeta", [0.0, 0.03])
def test_energy_changes_by_the_work_of_the_drive_and_the_dampers(zeta: float) -> None:
    """E = q'.q'/2 + q.W^2 q/2 + m w_c'^2/2 - m g w_c; dE/dt = -F s' w'(s) - sum 2 zeta omega q'^2; a residual of
    second order in the step."""
    speed, kilograms, gravity = 0.8, 0.5, 9.81
    given = study(beam(modes=3), mass(kilograms, cruise(0.0, 1.0, speed)))
    bed = twin.bed_of(given, "bed")
    residuals = []
    for steps in (400, 800, 1600):
        ds, t, q, v = modal_history(given, zeta, steps)
        below, rate = ds.below.values, ds.rate.values
        contact = kilograms * (gravity - ds.change.values)
        tilt = np.array([bed.phi(s, 1) @ q[n] for n, s in enumerate(ds.car_position.values)])
        energy = 0.5 * (v**2).sum(axis=1) + 0.5 * (q**2 * bed.omega**2).sum(axis=1)
        energy += 0.5 * kilograms * rate**2 - kilograms * gravity * below
        power = -contact * speed * tilt - (2.0 * zeta * bed.omega * v**2).sum(axis=1)
        work = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (power[1:] + power[:-1]))])
        residuals.append(np.abs(energy - energy[0] - work).max() / np.abs(energy).max())
    assert residuals[0] < 1e-2
    assert residuals[0] / residuals[1] == pytest.approx(4.0, rel=0.1)
    assert residuals[1] / residuals[2] == pytest.approx(4.0, rel=0.1)


SCHEMES: dict[str, tuple[dict[str, Any], float]] = {
    "average": ({"scheme": "average-acceleration"}, 2.0),
    "linear": ({"scheme": "linear-acceleration"}, 2.0),
    "central": ({"scheme": "central-difference"}, 2.0),
    "half": ({"scheme": "newmark", "beta": 0.3, "gamma": 0.5}, 2.0),
    "damped": ({"scheme": "newmark", "beta": 0.3025, "gamma": 0.6}, 1.0),
    "fox-goodwin": ({"scheme": "fox-goodwin"}, 2.0),
    "scaled-fox-goodwin": ({"scheme": "scaled-fox-goodwin"}, 2.0),
    "hht-alpha": ({"scheme": "hht-alpha", "alpha": -0.05}, 2.0),
    "hht-alpha, most": ({"scheme": "hht-alpha", "alpha": -1 / 3}, 2.0),
    "generalized-alpha": ({"scheme": "generalized-alpha", "rho_inf": 0.8}, 2.0),
    "generalized-alpha, most": ({"scheme": "generalized-alpha", "rho_inf": 0.0}, 2.0),
}
COUNTS = (1600, 3200, 6400)


@pytest.fixture(scope="module")
def errors() -> dict[str, list[float]]:
    """Largest error of midspan over eight instants, over the largest value, by scheme and step count."""
    tables = study(beam(modes=3), mass(0.5, cruise(0.0, 1.0, 0.25 * math.pi)))
    bed = twin.bed_of(tables, "bed")
    load = twin.load_of(tables, "car", 1.0, 2.0)
    case = scenes.Scene(bed.phi, bed.omega, np.zeros(3), (load,))
    end = load.leave
    exact = ode.solve(case, np.linspace(0.0, end, 9), scenes.rest(case), 1.0).displacement(bed.phi(0.5, 0))
    found: dict[str, list[float]] = {}
    for name, (scheme, _) in SCHEMES.items():
        for steps in COUNTS:
            solver = {**scheme, "steps": steps, "static_correction": False, "tolerance": 0.5}
            ds = run(Study(**(tables.data | {"solver": solver, "output": {"histories": {"every": steps // 8}}})))
            assert ds.midspan.size == 9
            found.setdefault(name, []).append(float(np.abs(ds.midspan.values - exact).max() / np.abs(exact).max()))
    return found


@pytest.mark.parametrize("name", SCHEMES)
def test_order_is_fitted(name: str, errors: dict[str, list[float]]) -> None:
    fitted = -np.polyfit(np.log(COUNTS), np.log(errors[name]), 1)[0]
    assert fitted == pytest.approx(SCHEMES[name][1], abs=0.06)


Change = Callable[[pytest.MonkeyPatch], None]
ROWS = scenes.convective_rows


def without_row(number: int) -> Change:
    """Leave out 2 s' phi' (1) or everything that multiplies q (2)."""

    def change(patch: pytest.MonkeyPatch) -> None:
        def rows(phi: Any, phase: Any, t: float) -> Any:
            found = list(ROWS(phi, phase, t))
            found[number] = np.zeros_like(found[number])
            return tuple(found)

        patch.setattr(scenes, "convective_rows", rows)

    return change


def without_derivative(name: str) -> Change:
    """Leave out s'^2 phi'' or s'' phi' alone."""

    def change(patch: pytest.MonkeyPatch) -> None:
        def rows(phi: Any, phase: Any, t: float) -> Any:
            row, rate, both = ROWS(phi, phase, t)
            bent = phase.ds(t) ** 2 * phi(phase.s(t), 2)
            return row, rate, both - bent if name == "centripetal" else bent

        patch.setattr(scenes, "convective_rows", rows)

    return change


def without_impulse(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(newmark, "impulse", lambda scene, t, state: np.zeros_like(state.v))


def without_sag_drive(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(twin, "sagging_weight", lambda bed, load, gravity, t, side: load.weight)


def without_damping(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(twin, "damping_of", lambda spec, omega: np.zeros_like(omega))


def without_dampers(patch: pytest.MonkeyPatch) -> None:
    bed_of = twin.bed_of
    patch.setattr(twin, "bed_of", lambda given, name: replace(bed_of(given, name), dampers=()))


def without_correction(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(twin.Bed, "missed", lambda self, x, s, derivative: 0.0)


def without_residual(patch: pytest.MonkeyPatch) -> None:
    def kept_alone(scene: scenes.Scene, t: float, side: scenes.Side, j: int) -> Array:
        phase = scene.loads[j].phase(t, side)
        return np.zeros(len(scene.omega)) if phase is None else scene.phi(phase.s(t), 0)

    patch.setattr(scenes, "driven", kept_alone)


def without_its_damping(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(twin, "RESIDUAL_DAMPING", 0.0)


HALF = mass(0.5, cruise(0.0, 1.0, 0.8))
ON_SPRINGS = {"car": mass(0.5, cruise(0.0, 1.0, 0.8)), "next": mass(0.4, cruise(0.0, 1.0, 1.0), delay=0.3)}
TERMS: dict[str, tuple[Change, dict[str, Any], dict[str, Any]]] = {
    "Coriolis": (without_row(1), beam(), HALF),
    "centripetal": (without_derivative("centripetal"), beam(), HALF),
    "along the track": (without_derivative("along"), beam(), mass(0.5, swing(0.5, 0.3, 0.6, 1))),
    "arrival impulse": (without_impulse, beam(supports=SPRINGS), ON_SPRINGS),
    "reversal impulse": (without_impulse, beam(), mass(0.5, shuttle(0.3, 0.8, 1.0, 0.0, 1))),
    "own weight": (without_sag_drive, beam(own_weight=True), HALF),
    "damping": (without_damping, beam(damping_ratio=0.02), HALF),
    "damper": (without_dampers, beam(supports=SPRINGS), HALF),
    "static correction": (without_correction, beam(), force(5.0, cruise(0.0, 1.0, 0.8))),
    "what a mass feels of missed modes": (without_residual, beam(), HALF),
    "damping of that": (without_its_damping, beam(), HALF),
}


@pytest.mark.parametrize("term", TERMS)
def test_every_term_is_felt(term: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The twin agrees with the engine; without the term it is off by a thousand times the tolerance or more."""
    change, bed, carriages = TERMS[term]
    sensors = {"place": fixed(0.61)}
    given = study(bed, carriages, sensor=sensors, output=ALL, solver={"steps": 100})
    ds = run(given)

    def difference() -> float:
        whole = march_twin(given, "bed", ds.elapsed.values)
        expected = Reading(given, whole, given.sensor["place"]).values
        return float(np.abs(ds.place.values - expected).max() / np.abs(expected).max())

    assert difference() < 1e-9
    change(monkeypatch)
    assert difference() > 1e-4
