"""Sprung masses: the engine's march against the naive twin, limits, energy, order, and what each term is worth."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from engine.batch.execution import run
from engine.batch.plan import make_plan
from engine.march.step_rules import contact_omega, least_steps
from engine.model.scene_model import build_model
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.errors import BadInput
from results_schema.status import Fidelity
from tests.engine import twin as twins
from tests.engine.build import aboard, beam, cruise, fixed, force, mass, oscillator, shuttle, swing, under
from tests.engine.build import study_of_steps as study
from tests.engine.twin import solve_twin
from tests.march.test_twin import DAMPED, ENTERING, SPRINGS, case, compare, scheme
from tests.naive import scene as scenes
from tests.reference import closed_forms, values

CROSSING = cruise(0.0, 1.0, 0.8)
SENSORS = {
    "place": fixed(0.61),
    "moment": fixed(0.3713, "bending_moment"),
    "below": under("car"),
    "below_acceleration": under("car", "acceleration"),
    "up": aboard("car"),
    "up_rate": aboard("car", "velocity"),
    "up_acceleration": aboard("car", "acceleration"),
}


def car(motion: Any = CROSSING, **changes: Any) -> dict[str, Any]:
    return oscillator(0.6, 40.0, motion, **changes)


FULL = {"wheel_mass": 0.2, "damping": 1.5}
ONE = car(**FULL)
TWO = {"car": ONE, "next": oscillator(0.3, 25.0, cruise(1.2, -0.1, 1.03), delay=0.217, wheel_mass=0.1, damping=0.7)}
SCENES: dict[str, Callable[[], Study]] = {
    "wheel, spring and damper": lambda: case(beam(modes=7), ONE, steps=96),
    "one mode, free vibration": lambda: case(beam(modes=1), car(cruise(0.0, 1.0, 0.8, after=0.8), **FULL)),
    "off both ends": lambda: case(beam(), car(cruise(-0.3, 1.4, 0.8), **FULL)),
    "two and a mass and dampers": lambda: case(
        beam(supports=DAMPED), TWO | {"third": mass(0.3, cruise(0.0, 1.0, 0.9), headway=0.3)}, steps=96
    ),
    "springs, second one arrives": lambda: case(beam(supports=SPRINGS, damping_ratio=0.02), TWO),
    "instant turns": lambda: case(beam(supports=SPRINGS), car(shuttle(0.8, 0.1, 1.0, 0.0, 2), **FULL)),
    "sinusoidal": lambda: case(beam(damping_ratio=0.02), car(swing(0.5, 0.4, 0.7, 1), damping=0.8)),
    "waypoints from off the body": lambda: case(beam(supports=SPRINGS), car(ENTERING, **FULL)),
    "equilibrium of two": lambda: case(
        beam(),
        {"car": car(shuttle(0.3, 0.8, 1.7, 0.1, 1), **FULL), "next": oscillator(0.4, 30.0, swing(0.6, 0.2, 1.0, 1))},
        steps=90,
    ),
    "waits, stands while another passes, free vibration": lambda: case(
        beam(damping_ratio=0.02),
        {
            "car": car(shuttle(0.3, 0.8, 1.7, 0.1, 1), **FULL, delay=0.1),
            "next": mass(0.4, cruise(0.0, 1.0, 0.5, after=0.7)),
        },
        steps=90,
    ),
    "on two bodies": lambda: case(
        beam(),
        {"car": ONE, "next": TWO["next"] | {"on": "table"}, "third": TWO["next"]},
        steps=96,
        body={"bed": beam(), "table": beam(supports=SPRINGS, modes=3, youngs_modulus=2.0)},
    ),
    "own weight, springs, entering": lambda: case(
        beam(own_weight=True, supports=SPRINGS), car(cruise(-0.2, 1.1, 0.8), **FULL)
    ),
    "own weight, equilibrium": lambda: case(beam(own_weight=True), car(shuttle(0.2, 0.9, 0.8, 0.0, 1), **FULL)),
    "linear acceleration": lambda: case(beam(), ONE, **scheme("linear-acceleration")),
    "scaled Fox-Goodwin": lambda: case(beam(modes=6, damping_ratio=0.02), ONE, **scheme("scaled-fox-goodwin")),
    "scaled Fox-Goodwin, turning": lambda: case(
        beam(supports=SPRINGS, modes=6), car(shuttle(0.8, 0.1, 1.0, 0.0, 1), **FULL), **scheme("scaled-fox-goodwin")
    ),
    "HHT-alpha": lambda: case(beam(), ONE, **scheme("hht-alpha", alpha=-0.1)),
    "generalized-alpha, turning": lambda: case(
        beam(supports=DAMPED),
        car(shuttle(0.3, 0.8, 1.0, 0.0, 1), **FULL),
        **scheme("generalized-alpha", rho_inf=0.3),
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_engine_agrees_with_the_twin(name: str) -> None:
    given = SCENES[name]()
    given = given.with_values({"sensor": SENSORS})
    steps = int(given.solver.steps)  # type: ignore[arg-type]
    assert compare(given) > 0.5 * steps * len(given.sensor)


TERMS: dict[str, Callable[[scenes.Load], scenes.Load]] = {
    "convective rate": lambda load: replace(load, sprung=replace(spring(load), convective=False)),
    "wheel's inertia": lambda load: replace(load, mass=0.0, convective_mass=0.0),
    "wheel's convective terms": lambda load: replace(load, convective_mass=0.0),
    "damper": lambda load: replace(load, sprung=replace(spring(load), damping=0.0)),
    "spring": lambda load: replace(load, sprung=replace(spring(load), stiffness=1.01 * spring(load).stiffness)),
    "sprung mass's inertia": lambda load: replace(load, sprung=replace(spring(load), mass=1.01 * spring(load).mass)),
    "sprung mass's weight": lambda load: replace(load, sprung=replace(spring(load), weight=0.0)),
    "wheel's weight": lambda load: replace(load, weight=0.0),
}


def spring(load: scenes.Load) -> scenes.Sprung:
    assert load.sprung is not None
    return load.sprung


@pytest.mark.parametrize("term", TERMS)
def test_every_term_counts(term: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the term the twin leaves the engine by far more than the tolerance."""
    given = case(beam(), ONE, sensor=SENSORS)
    whole = twins.load_of
    monkeypatch.setattr(twins, "load_of", lambda *args: TERMS[term](whole(*args)))
    with pytest.raises(AssertionError):
        compare(given, 1e-4)


@pytest.mark.parametrize("term", ["level", "climb"])
def test_the_sag_counts(term: str, monkeypatch: pytest.MonkeyPatch) -> None:
    given = case(beam(own_weight=True), ONE, sensor=SENSORS)
    whole = twins.sagging_spring

    def without(*args: Any) -> scenes.Sprung | None:
        found = whole(*args)
        return None if found is None else replace(found, **{term: 0.0})

    monkeypatch.setattr(twins, "sagging_spring", without)
    with pytest.raises(AssertionError):
        compare(given, 1e-4)


def test_what_the_modes_left_out_would_add_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    given = case(beam(), ONE, sensor=SENSORS)
    whole = twins.scene_of

    def without(*args: Any) -> Any:
        bed, scene, *rest = whole(*args)
        return bed, replace(scene, missed=None), *rest

    monkeypatch.setattr(twins, "scene_of", without)
    with pytest.raises(AssertionError):
        compare(given, 1e-4)


# ---- published numbers, limits of the spring, energy, order, steps, and what is refused ----


WHOLE = {"histories": "all"}


def bridge(case: values.SprungMass, modes: int, steps: int) -> Study:
    bed = beam(
        length=case.length,
        second_moment=case.second_moment,
        youngs_modulus=case.youngs_modulus,
        density=case.mass_per_length,
        modes=modes,
    )
    vehicle = oscillator(case.mass, case.stiffness, cruise(0.0, case.length, case.speed))
    sensors = {"midspan": fixed(0.5 * case.length), "body": aboard("car", "acceleration")}
    return study(bed, vehicle, sensor=sensors, solver={"steps": steps, "static_correction": False})


@pytest.mark.parametrize(("modes", "steps"), [(1, 5000), (20, 100000)])
def test_sprung_mass_yang_yau(modes: int, steps: int) -> None:
    found = run(bridge(values.YANG_YAU, modes, steps), threads=1)
    assert float(found.midspan_max) == pytest.approx(values.YANG_YAU.largest_midspan[modes], rel=1e-6)
    largest = max(float(found.body_max), -float(found.body_min))
    assert largest == pytest.approx(values.YANG_YAU_BODY_ACCELERATION[modes], rel=4e-6)  # six digits are known
    assert int(found.fidelity_used) == Fidelity.TIED and int(found.modes_used) == modes


def test_sprung_mass_vbi_2d() -> None:
    found = run(bridge(values.VBI_2D, 40, values.VBI_2D_STEPS), threads=1)
    assert float(found.midspan_max) == pytest.approx(values.VBI_2D.largest_midspan[40], rel=1e-6)


def crossed(carriage: dict[str, Any], **changes: Any) -> Any:
    sensors = {"place": fixed(0.61), "moment": fixed(0.61, "bending_moment"), "below": under("car")}
    given = {"sensor": sensors, "output": WHOLE, "solver": {"steps": 400}} | changes
    return run(study(beam(damping_ratio=0.01), carriage, **given), threads=1)


def gap(one: Any, other: Any) -> float:
    """Largest difference of two histories over the larger one's size."""
    return float(np.nanmax(np.abs(one.values - other.values)) / np.nanmax(np.abs(other.values)))


def test_a_stiff_spring_is_a_rigid_mass() -> None:
    """The difference goes with 1/k, once the spring's own oscillation is damped, on the same modes: a rigid mass knows
    nothing of those that are left out."""
    solver = {"steps": 3200, "static_correction": False}
    rigid = crossed(mass(0.5, CROSSING), solver=solver)
    found = []
    for stiffness in (1e4, 4e4):
        damping = 0.7 * 2.0 * np.sqrt(0.3 * stiffness)
        sprung = oscillator(0.3, stiffness, CROSSING, wheel_mass=0.2, damping=damping)
        found.append(gap(crossed(sprung, solver=solver).place, rigid.place))
    assert found[1] < 3e-3
    assert found[1] < 0.6 * found[0]


def test_a_soft_spring_is_a_force() -> None:
    weight = 0.5 * 9.81
    constant = crossed(force(weight, CROSSING))
    found = [gap(crossed(oscillator(0.5, k, CROSSING)).place, constant.place) for k in (1e-3, 1e-5)]
    assert found[1] < 1e-6
    assert found[0] == pytest.approx(100.0 * found[1], rel=0.05)


@pytest.mark.parametrize(("fidelity", "like"), [("force", force(7.848, CROSSING)), ("mass", mass(0.8, CROSSING))])
def test_lower_fidelities_lock_the_spring(fidelity: str, like: dict[str, Any]) -> None:
    sprung = oscillator(0.6, 40.0, CROSSING, wheel_mass=0.2, damping=1.5)
    found = crossed(sprung, solver={"steps": 400, "fidelity": fidelity})
    assert gap(found.place, crossed(like).place) < 1e-12
    assert int(found.fidelity_used) == Fidelity[fidelity.upper()]


def test_energy_goes_where_it_belongs() -> None:
    """What the body, both masses and the spring hold changes by the work of the driven motion and the damper's loss.

    d/dt (T + V) = -F s' (phi'.q) - c (rate)^2, F being the contact force (mechanics, small limits and invariants), here
    from the momentum of both masses. Modal coordinates come from as many fixed sensors as there are modes.
    """
    carriage = oscillator(0.6, 40.0, CROSSING, wheel_mass=0.2, damping=1.5)
    places = (0.2, 0.55, 0.7)
    sensors = {f"w{n}": fixed(x) for n, x in enumerate(places)}
    sensors |= {f"v{n}": fixed(x, "velocity") for n, x in enumerate(places)}
    for quantity in ("displacement", "velocity", "acceleration"):
        sensors |= {f"up_{quantity}": aboard("car", quantity), f"low_{quantity}": under("car", quantity)}
    solver = {"steps": 4000, "static_correction": False}
    found = run(study(beam(modes=3), carriage, sensor=sensors, output=WHOLE, solver=solver), threads=1)
    bed = closed_forms.PinnedBeam(3, 1.0, 1.0, 1.0)
    rows = np.array([bed.phi(x, 0) for x in places])
    q = np.linalg.solve(rows, np.array([found[f"w{n}"].values for n in range(3)]))
    v = np.linalg.solve(rows, np.array([found[f"v{n}"].values for n in range(3)]))
    up, rate, lift = (found[f"up_{name}"].values for name in ("displacement", "velocity", "acceleration"))
    low, fall, drop = (found[f"low_{name}"].values for name in ("displacement", "velocity", "acceleration"))
    t = found.elapsed.values
    slope = np.sum(np.array([bed.phi(0.8 * time, 1) for time in t]).T * q, axis=0)
    moving = 0.5 * np.sum(v**2, axis=0) + 0.3 * rate**2 + 0.1 * fall**2
    elastic = 0.5 * np.sum((bed.omega[:, None] * q) ** 2, axis=0) + 20.0 * (up - low + 0.6 * 9.81 / 40.0) ** 2
    held = moving + elastic - 9.81 * (0.6 * up + 0.2 * low)
    force = 0.8 * 9.81 - 0.6 * lift - 0.2 * drop
    power = -0.8 * force * slope - 1.5 * (rate - fall) ** 2
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t))])
    assert np.ptp(work) > 0.1 * np.ptp(moving)
    assert np.abs(held - held[0] - work).max() < 2e-5 * np.ptp(moving)


def test_second_order_against_an_explicit_method() -> None:
    carriage = oscillator(0.6, 40.0, CROSSING, wheel_mass=0.2, damping=1.5)
    sensors = {"place": fixed(0.61), "up": aboard("car"), "up_rate": aboard("car", "velocity")}
    steps = (200, 400, 800)
    kept = {"static_correction": False}
    exact = solve_twin(study(beam(modes=2), carriage, sensor=sensors, solver=kept), "bed", np.linspace(0.0, 1.25, 101))
    errors = []
    for count in steps:
        solver = kept | {"steps": count}
        found = run(study(beam(modes=2), carriage, sensor=sensors, solver=solver, output=WHOLE), threads=1)
        every = count // 100
        rest = 0.6 * 9.81 / 40.0
        pairs = (
            (found.place, exact.history.q @ exact.scene.phi(0.61, 0)),
            (found.up, exact.history.q[:, -1] - rest),
            (found.up_rate, exact.history.v[:, -1]),
        )
        errors.append([np.abs(one.values[::every] - other).max() / np.ptp(other) for one, other in pairs])
    order = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(order[-1] - 2.0) < 0.1), order


def test_a_mass_at_rest_stands_as_deep_as_the_whole_beam_gives_way() -> None:
    """One mode carries 98.6 % of W L^3/(48 EI)."""
    weight = 0.6 * 9.81
    standing = {"kind": "cruise", "start": 0.5, "end": 0.500001, "speed": 1e-6}
    given = study(beam(modes=1), car(standing), sensor={"up": aboard("car")}, initial="equilibrium")
    assert float(run(given, threads=1).up_max) == pytest.approx(weight / 48.0, rel=1e-9)


def test_two_modes_tell_a_slow_mass_what_many_do() -> None:
    """Without what the others would add it is off by a hundredth."""
    slow = car(cruise(0.0, 1.0, 0.02), damping=1.5)
    given = {"sensor": {"up": aboard("car")}, "output": WHOLE}

    def found(modes: int, **solver: Any) -> Any:
        return run(study(beam(modes=modes), slow, solver={"steps": 4000} | solver, **given), threads=1).up

    many = found(32)
    assert gap(found(2), many) < 2e-4
    assert gap(found(2, static_correction=False), many) > 5e-3


def test_a_lost_contact_is_told() -> None:
    found = run(study(beam(), oscillator(0.1, 100.0, cruise(0.0, 1.0, 6.0), wheel_mass=0.5)), threads=1)
    assert int(found.status) == 1 and float(found.car_contact_force_min) < 0.0
    light = run(study(beam(), oscillator(0.6, 4000.0, cruise(0.0, 1.0, 6.0))), threads=1)
    assert int(light.status) == 1 and np.isfinite(float(light.car_separation_position))


def test_the_mass_rests_again_before_it_comes_back() -> None:
    """A way that leaves the body and comes back: on the second visit the mass arrives as it did on the first."""
    positions = {"kind": "waypoints", "times": [0.0, 1.0, 2.0], "positions": [0.5, 1.6, 0.5]}
    sensors = {"up": aboard("car"), "rate": aboard("car", "velocity")}
    carriage = oscillator(0.6, 40.0, positions, damping=1.0)
    found = run(
        study(beam(damping_ratio=0.3), carriage, sensor=sensors, output=WHOLE, solver={"steps": 400}), threads=1
    )
    here = np.isfinite(found.up.values)
    back = np.flatnonzero(~here)[-1] + 1
    assert not here.all() and here[-1]
    assert abs(float(found.up.values[back])) < 1e-3 * float(found.up_max)


def test_steps_follow_the_springs() -> None:
    """No step is longer than a period of the contact on its spring."""
    least = []
    for stiffness in (100.0, 1e5):
        given = study(beam(modes=2), oscillator(0.5, stiffness, CROSSING))
        model, one = build_model(given, {}, {}), VariantValues(given, {}, 1)
        least.append(float(least_steps(model, one)[0]))
        assert least[-1] >= 1.25 * float(contact_omega(model, one)[0]) / (2.0 * np.pi)
        assert int(run(given, threads=1).steps_used) >= least[-1]
    assert least[1] > 5 * least[0]
    for solver in ({}, {"solver.scheme": "hht-alpha", "solver.alpha": -0.04}):
        with pytest.raises(BadInput, match="longer than a period of the contact"):
            run(given.with_values({"solver.steps": 100} | solver), threads=1)
    stiff = given.with_values({"carriage.car.stiffness": 1e11, "solver": {"scheme": "hht-alpha", "alpha": -0.05}})
    with pytest.raises(BadInput, match="longer than 300 periods of the contact"):
        run(stiff.with_values({"solver.steps": 100}), threads=1)
    with pytest.raises(BadInput, match="stability limit"):
        run(given.with_values({"solver.steps": 200, "solver.scheme": "central-difference"}), threads=1)
    auto = given.with_values({"solver.scheme": "central-difference"})
    assert int(run(auto, threads=1).status) in (0, 1)


def test_bad_sensors_are_refused() -> None:
    def sensing(sensor: dict[str, Any], carriage: dict[str, Any] | None = None) -> str:
        with pytest.raises(BadInput) as refused:
            study(beam(), carriage or oscillator(0.6, 40.0, CROSSING), sensor={"one": sensor})
        return str(refused.value)

    assert "no such carriage" in sensing({"carriage": "cra"})
    assert "no sprung mass" in sensing({"carriage": "car"}, mass(0.6, CROSSING))
    assert "exactly one place" in sensing({"carriage": "car", "under": "car"})
    assert "exactly one place" in sensing({"carriage": "car", "at": 0.5, "body": "bed"})
    assert "no bending_moment" in sensing({"carriage": "car", "quantity": "bending_moment"})


@pytest.mark.parametrize("scheme", ["average-acceleration", "richardson"])
def test_the_steps_suggested_for_a_stiff_spring_are_accepted(scheme: str) -> None:
    """For several stiffnesses, since half of all numbers are even."""

    def given(stiffness: float, steps: int) -> Study:
        car = oscillator(0.5, stiffness, cruise(0.0, 1.0, 0.3))
        return study(beam(modes=1), car, solver={"scheme": scheme, "steps": steps, "fidelity": "full"})

    for stiffness in np.linspace(1.9e6, 2.6e6, 8):
        with pytest.raises(BadInput, match="contact on its spring") as caught:
            make_plan(given(float(stiffness), 150))
        assert make_plan(given(float(stiffness), int(caught.value.remedy.split()[2]))).groups
