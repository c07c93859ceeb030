"""Every reference number that a passage, a shuttle or a train of the engine can produce."""

import math
from typing import Any

import numpy as np
import pytest

from engine.batch.execution import run
from tests.engine.build import Table, beam, cruise, fixed, force, mass, study, under
from tests.reference import closed_forms, values

STEPS = 20000
SPAN = cruise(0.0, 1.0, 1.0)


def passing(mu: float, alpha: float, end: float = 1.0, **changes: Any) -> Any:
    """A mass of weight 48 on the unit beam of 20 modes, Fox-Goodwin; histories at the quarters of the way."""
    solver: Table = {"scheme": "fox-goodwin", "steps": STEPS, "static_correction": False} | changes.pop("solver", {})
    bed = beam(modes=values.MODES_MOVING_MASS, damping_ratio=changes.pop("zeta", 0.0))
    sensors = {"midspan": fixed(0.5), "below": under("car")}
    way = cruise(0.0, end, math.pi * alpha)
    given = {"gravity": values.WEIGHT / mu, "sensor": sensors, "solver": solver}
    return study(bed, mass(mu, way), output={"histories": {"every": STEPS // 4}}, **given)


@pytest.mark.parametrize("row", values.MOVING_MASS, ids=lambda row: f"mu={row.mu}-alpha={row.alpha}")
def test_moving_mass(row: values.MovingMass) -> None:
    ds = run(passing(row.mu, row.alpha))
    assert float(ds.midspan_max) == pytest.approx(row.largest, abs=1.5e-7)
    assert float(ds.midspan_max_position) == pytest.approx(row.largest_at, abs=5e-5)
    np.testing.assert_allclose(ds.below.values[1:4], row.under, rtol=0, atol=1.5e-7, equal_nan=False)
    assert ds.midspan.values[4] == pytest.approx(row.at_exit, abs=5e-7)


@pytest.mark.parametrize("row", values.MOVING_MASS, ids=lambda row: f"mu={row.mu}-alpha={row.alpha}")
def test_smallest_contact_force_of_a_moving_mass(row: values.MovingMass) -> None:
    """The cruise ends at s = 0.95, so that the extremes cover just that part. The contact force feels the phase of the
    highest mode, whose error (omega h)^4/480 per radian must add up to nothing: 80000 steps."""
    ds = run(passing(row.mu, row.alpha, 0.95, solver={"steps": 80000}))
    assert float(ds.car_contact_force_min) / values.WEIGHT == pytest.approx(row.smallest_force, abs=1.5e-6)
    assert float(ds.car_contact_force_min_position) == pytest.approx(row.smallest_force_at, abs=1e-4)
    assert int(ds.status) == (1 if row.smallest_force < 0.0 else 0)


@pytest.mark.slow
@pytest.mark.parametrize("row", values.MOVING_MASS)
def test_average_acceleration_reaches_the_same_numbers(row: values.MovingMass) -> None:
    """2e-6 at 40000 steps."""
    ds = run(passing(row.mu, row.alpha, solver={"scheme": "average-acceleration", "steps": 40000}))
    assert float(ds.midspan_max) == pytest.approx(row.largest, abs=2e-6)


@pytest.mark.parametrize("row", values.MOVING_MASS_DAMPED_2_PERCENT)
def test_moving_mass_with_damping(row: values.LargestMidspan) -> None:
    ds = run(passing(row.mu, row.alpha, zeta=0.02))
    assert float(ds.midspan_max) == pytest.approx(row.largest, abs=2e-7)


@pytest.mark.parametrize("row", values.MOVING_MASS_WITHOUT_CONVECTIVE)
def test_moving_mass_without_convective_terms(row: values.LargestMidspan) -> None:
    ds = run(passing(row.mu, row.alpha, solver={"fidelity": "mass-without-convective"}))
    assert float(ds.midspan_max) == pytest.approx(row.largest, abs=2e-7)
    assert int(ds.fidelity_used) == 2


def test_moving_force() -> None:
    """20 modes and the static correction, Fox-Goodwin, 20000 steps: all speeds of the table within 1e-6."""
    alphas = list(values.MOVING_FORCE)
    given = study(
        beam(modes=20),
        force(values.WEIGHT, SPAN),
        sweep={"speed": {"of": "carriage.car.motion.speed", "values": [math.pi * alpha for alpha in alphas]}},
        solver={"scheme": "fox-goodwin", "steps": STEPS},
    )
    ds = run(given)
    expected = list(values.MOVING_FORCE.values())
    np.testing.assert_allclose(ds.midspan_max.values, expected, rtol=0, atol=1e-6, equal_nan=False)
    np.testing.assert_allclose(ds.speed_ratio.values, alphas, rtol=1e-12)
    assert np.all(ds.status.values == 0)
    plain = study(beam(), force(values.WEIGHT, SPAN), sweep=given.data["sweep"])
    short = np.abs(run(plain).midspan_max.values - expected)
    assert values.MOVING_FORCE_N20_ERROR < short.max() < 1e-3  # what "auto" promises


def in_units_of(case: values.MovingForceCase, modes: int) -> Table:
    """A pinned beam of a published case."""
    return beam(
        length=case.length,
        youngs_modulus=case.bending_stiffness,
        density=case.mass_per_length,
        modes=modes,
    )


def test_stem() -> None:
    case = values.STEM
    given = study(
        in_units_of(case, 20),
        force(case.force, cruise(0.0, 25.0, case.speed)),
        solver={"scheme": "fox-goodwin", "steps": 10000},
    )
    ds = run(given)
    assert float(ds.midspan_max) == pytest.approx(values.STEM_LARGEST, abs=6e-8)
    assert float(ds.midspan_max_position) / case.speed == pytest.approx(values.STEM_LARGEST_AT, abs=5e-4)


@pytest.mark.parametrize(("modes", "expected"), values.BIGGS_MIDSPAN.items())
def test_biggs(modes: int, expected: tuple[float, ...]) -> None:
    case = values.BIGGS
    given = study(
        in_units_of(case, modes),
        force(case.force, cruise(0.0, case.length, case.speed)),
        solver={"scheme": "fox-goodwin", "steps": 20000, "static_correction": False},
        output={"histories": {"every": 1000}},
    )
    ds = run(given)
    np.testing.assert_allclose(ds.elapsed.values[1:4], values.BIGGS_TIMES, rtol=1e-12)
    np.testing.assert_allclose(ds.midspan.values[1:4], expected, rtol=0, atol=5.5e-6, equal_nan=False)


def test_quasi_static_contact_force() -> None:
    """F/mg - 1 = pi^2 mu alpha^2/3 at midspan once damping has stilled the ringing; F = m (g - D2w)."""
    mu, alpha = values.SMALL_LIMIT_MU, values.SMALL_LIMIT_ALPHA
    gravity = values.WEIGHT / mu
    given = study(
        beam(modes=20, damping_ratio=0.3),
        mass(mu, cruise(0.1, 0.9, math.pi * alpha)),
        gravity=gravity,
        initial="equilibrium",
        sensor={"below": under("car", "acceleration")},
        solver={"steps": 8000},
        output={"histories": {"every": 4000}},
    )
    ds = run(given)
    assert ds.car_position.values[1] == pytest.approx(0.5)
    assert -ds.below.values[1] / gravity == pytest.approx(values.SMALL_LIMIT, rel=2e-2)


def amplitude(ds: Any, station: int, omega: float, zeta: float = 0.0) -> float:
    """|q' + (zeta + i sqrt(1 - zeta^2)) omega q| of mode 1 from midspan's displacement and velocity."""
    rate = complex(zeta, math.sqrt(1.0 - zeta**2)) * omega
    return abs(complex(ds.rate.values[station]) + rate * ds.midspan.values[station]) / omega


def single_mode(carriages: Table, **given: Any) -> Any:
    """One mode of the unit beam; displacement and velocity at midspan at all steps."""
    return study(
        beam(modes=1),
        carriages,
        sensor={"midspan": fixed(0.5), "rate": fixed(0.5, "velocity")},
        solver={"scheme": "fox-goodwin", "steps": 4000, "static_correction": False},
        output={"histories": "all"},
        **given,
    )


@pytest.mark.parametrize("alpha", [*values.RESIDUAL_ZERO_ALPHAS, 0.25, values.RESIDUAL_MAXIMUM_ALPHA, 1.0])
def test_residual_vibration(alpha: float) -> None:
    ds = run(single_mode(force(values.WEIGHT, cruise(0.0, 1.0, math.pi * alpha, after=3.0))))
    unit = 2.0 * values.WEIGHT / math.pi**4
    expected = closed_forms.residual_amplitude(alpha)
    assert amplitude(ds, 4000, math.pi**2) / unit == pytest.approx(expected, abs=1e-6)
    free = ds.midspan.values[4000:]
    assert free.size == 601
    assert np.ptp(free) / 2.0 / unit == pytest.approx(expected, rel=2e-4, abs=1e-6)
    assert ds.elapsed.values[-1] - ds.elapsed.values[4000] == pytest.approx(3.0 * 2.0 / math.pi)


@pytest.mark.parametrize("k", [1.0, 0.5])
def test_train(k: float) -> None:
    """Eight forces d apart at v = f1 d/k against one, without damping and with it."""
    speed = 0.3 * math.pi
    spacing = k * speed / (0.5 * math.pi)
    way = cruise(0.0, 1.0, speed)
    sweep = {"zeta": {"of": "body.bed.damping_ratio", "values": [0.0, 0.02]}}
    one = run(single_mode(force(values.WEIGHT, way), sweep=sweep))
    many = {f"axle{n}": force(values.WEIGHT, way, headway=n * spacing) for n in range(values.TRAIN_FORCES)}
    all_of_them = run(single_mode(many, sweep=sweep))
    for zeta in (0.0, 0.02):
        amplitudes = [amplitude(ds.sel(zeta=zeta), -1, math.pi**2, zeta) for ds in (all_of_them, one)]
        gain = amplitudes[0] / amplitudes[1]
        assert gain == pytest.approx(closed_forms.train_gain(values.TRAIN_FORCES, zeta, k), abs=2e-5)
        if (zeta, k) == (0.02, 1.0):
            assert gain == pytest.approx(values.TRAIN_GAIN_DAMPED, abs=1e-4)
