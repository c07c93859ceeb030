"""The naive march against the order-8 integration, closed forms, and what the equations conserve."""

import math
from functools import cache

import numpy as np
import pytest

from tests.naive import motions, newmark, ode, scene
from tests.reference import closed_forms, passages
from tests.reference.closed_forms import PinnedBeam

BEAM = PinnedBeam(3)


def sprung_body_shape(s: float, derivative: int) -> scene.Array:
    """Rows of bouncing, pitching and one bending-like shape: phi(s) != 0 at both ends, which makes impulses matter."""
    k = 4.0
    bend = [math.cos(k * s), -k * math.sin(k * s), -(k**2) * math.cos(k * s)][derivative]
    pitch = [math.sqrt(3.0) * (2.0 * s - 1.0), 2.0 * math.sqrt(3.0), 0.0][derivative]
    return np.array([1.0 if derivative == 0 else 0.0, pitch, bend])


SPRUNG_OMEGA = np.array([1.7, 3.1, 8.0])


def crossing(mass: float, zeta: float, speed: float = 0.25 * math.pi) -> scene.Scene:
    """A mass crosses the pinned beam of three modes; weight 48."""
    load = scene.moving_mass(mass, 48.0 / mass, motions.cruise(0.0, 1.0, speed))
    return scene.Scene(BEAM.phi, BEAM.omega, np.full(3, zeta), (load,))


def sprung_scene(phases: tuple[scene.Phase, ...], mass: float = 0.4) -> scene.Scene:
    """A mass on the body with moving ends, 2 % damping."""
    load = scene.moving_mass(mass, 9.81, phases)
    return scene.Scene(sprung_body_shape, SPRUNG_OMEGA, np.full(3, 0.02), (load,))


@cache
def crossed() -> tuple[scene.Scene, newmark.History]:
    """A damped passage, by the ordinary differential equation."""
    case = crossing(0.5, 0.02)
    return case, ode.solve(case, np.linspace(0.0, case.loads[0].leave, 11), scene.rest(case), 1.0)


@pytest.mark.parametrize(
    ("scheme", "order"),
    [
        (newmark.Newmark(), 2),
        (newmark.Newmark(1 / 6, 1 / 2), 2),
        (newmark.Newmark(0.0, 0.5), 2),
        (newmark.Newmark(0.3025, 0.6), 1),
    ],
)
def test_order_is_fitted(scheme: newmark.Newmark, order: int) -> None:
    case, reference = crossed()
    end = case.loads[0].leave
    counts = np.array([400, 800, 1600])
    errors = []
    for count in counts:
        history = newmark.march(case, newmark.grid(case, 0.0, end, int(count)), scene.rest(case), scheme)
        errors.append(np.abs(history.q[:: count // 10] - reference.q).max())
    fitted = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert fitted == pytest.approx(order, abs=0.06)


def test_two_masses_a_force_dampers_and_own_weight_agree_with_the_ode() -> None:
    loads = (
        scene.moving_mass(0.3, 9.81, motions.cruise(0.0, 1.0, 0.8)),
        scene.mass_without_convective(0.2, 9.81, motions.cruise(1.0, 0.0, 0.5, begin=0.25)),
        scene.moving_force(5.0, motions.cruise(0.2, 0.9, 0.7, begin=0.5)),
    )
    damper = scene.Damper(BEAM.phi(0.3, 0), 0.5)
    case = scene.Scene(BEAM.phi, BEAM.omega, np.full(3, 0.01), loads, (damper,), 9.81 * BEAM.own_weight)
    times = newmark.grid(case, 0.0, 3.0, 4000)
    march = newmark.march(case, times, scene.rest(case), newmark.Newmark(1 / 12, 1 / 2))
    chosen = np.unique(np.concatenate([np.arange(0, len(times), 400), [e.step for e in march.before]]))
    exact = ode.solve(case, times[chosen], scene.rest(case), 1.0)
    assert len(march.before) == len(exact.before) == 5
    for name, tolerance in (("q", 1e-5), ("v", 1e-4), ("a", 2e-2), ("contact_force", 3e-3), ("w_under", 1e-5)):
        found, expected = getattr(march, name)[chosen], getattr(exact, name)
        assert np.isfinite(found).sum() > 0
        np.testing.assert_allclose(found, expected, atol=tolerance * np.nanmax(np.abs(expected)), rtol=0)


def test_naive_ode_agrees_with_the_other_reference() -> None:
    case = crossing(0.5, 0.02)
    found = ode.solve(case, np.linspace(0.0, case.loads[0].leave, 9), scene.rest(case), 1.0)
    other = passages.cruise(passages.variants(3, [(0.5, 0.02, 1.0)]), 0.25, [])
    n = [int(np.argmin(np.abs(other.t - t))) for t in found.t]
    np.testing.assert_allclose(found.displacement(BEAM.phi(0.5, 0)), other.midspan[n, 0], atol=1e-9)
    np.testing.assert_allclose(found.contact_force[:, 0], other.contact_force[n, 0], atol=1e-6)


@pytest.mark.parametrize("alpha", [0.3, 1.0])
def test_moving_force_has_its_closed_form(alpha: float) -> None:
    speed = math.pi * alpha
    load = scene.moving_force(48.0, motions.cruise(0.0, 1.0, speed))
    case = scene.Scene(BEAM.phi, BEAM.omega, np.zeros(3), (load,))
    found = ode.solve(case, np.linspace(0.0, 1.0 / speed, 9), scene.rest(case), 1.0)
    exact = closed_forms.moving_force(BEAM, 48.0, speed, 0.37, found.t)
    np.testing.assert_allclose(found.displacement(BEAM.phi(0.37, 0)), exact, atol=1e-10)


def test_reversal_impulse_is_the_limit_of_ever_sharper_turns() -> None:
    speed = 0.6
    sharp = sprung_scene(motions.instant_out_and_back(0.2, 0.8, speed, 1))
    start = scene.State(scene.equilibrium(sharp, 0.0).q, np.array([0.2, -0.1, 0.3]))
    turn_at = sharp.loads[0].phases[1].start
    after = ode.solve(sharp, [0.0, 0.5, turn_at, 1.5], start, 1.0)
    [event] = after.before
    row, slope_row = sprung_body_shape(0.8, 0), sprung_body_shape(0.8, 1)
    jump = closed_forms.reversal_impulse(0.4, row, slope_row, after.q[2], -2.0 * speed)
    np.testing.assert_allclose(after.v[2] - event.v, jump, rtol=1e-10)
    assert np.abs(jump).max() > 0.01
    errors = []
    for depth in (0.02, 0.01, 0.005):
        blended = ode.solve(_blended(depth, speed), [0.0, 0.5, 1.5], start, 1.0)
        errors.append(np.abs(blended.q[-1] - after.q[-1]).max())
    assert errors[2] < 0.3 * errors[0]
    assert errors[2] < 0.05 * np.abs(jump).max()


def _blended(depth: float, speed: float) -> scene.Scene:
    """Out at full speed, then a cosine turn of `depth` before 0.8, then back."""
    turn = [p for p in motions.out_and_back(0.2, 0.8, speed, depth / 0.6, 1)][2:5]
    shift = turn[0].start - (0.6 - depth) / speed
    first = motions.cruise(0.2, 0.8 - depth, speed)[0]
    moved = [motions.shifted(phase, -shift) for phase in turn]
    return sprung_scene(motions.joined([first, *moved]))


def test_arrival_conserves_momentum_of_the_contact() -> None:
    """A mass lands on a moving end with a vertical speed of its own; a heavy one imposes its speed on the point."""
    base = sprung_scene(motions.cruise(0.0, 1.0, 0.5, begin=0.4))
    load = scene.Load(base.loads[0].phases, 0.4 * 9.81, 0.4, 0.4, arrival_speed=-0.7)
    case = scene.Scene(base.phi, base.omega, base.zeta, (load,))
    start = scene.State(np.array([0.1, 0.05, -0.02]), np.array([0.3, -0.2, 0.5]))
    history = newmark.march(case, newmark.grid(case, 0.0, 1.0, 200), start)
    [event] = history.before
    q, row, slope = history.q[event.step], sprung_body_shape(0.0, 0), sprung_body_shape(0.0, 1)
    vertical = row @ history.v[event.step] + 0.5 * (slope @ q)
    modal_change = history.v[event.step] - event.v
    np.testing.assert_allclose(modal_change, -0.4 * row * (vertical + 0.7), rtol=1e-10)
    mismatch = float(row @ event.v + 0.5 * (slope @ q) + 0.7)
    np.testing.assert_allclose(modal_change, closed_forms.arrival_impulse(0.4, row, mismatch), rtol=1e-10)
    assert event.contact_force[0] == 0.0
    assert history.contact_force[event.step, 0] != 0.0
    other = ode.solve(case, [0.0, 0.4, 0.7, 1.0], start, 1.0)
    np.testing.assert_allclose(history.q[-1], other.q[-1], atol=3e-5)


def test_an_event_between_two_instants_is_refused() -> None:
    case = sprung_scene(motions.cruise(0.3, 1.0, 0.7))
    with pytest.raises(ValueError, match="not an instant of the grid"):
        newmark.march(case, np.linspace(0.0, 2.0, 38), scene.rest(case))
