"""The same equations by an explicit Runge-Kutta method of order 8, piecewise between events."""

from collections.abc import Sequence

import numpy as np
from scipy.integrate import solve_ivp

from tests.naive.newmark import Event, History, collect, snapped
from tests.naive.scene import Array, Scene, Side, State, acceleration, contact_forces, events, impulse

RTOL = 1e-11


def boundaries(scene: Scene) -> set[float]:
    """Every boundary between phases, smooth ones too: no step may cross a place where a derivative jumps."""
    return {t for load in scene.loads for phase in load.phases for t in (phase.start, phase.end)}


def _advance(scene: Scene, state: State, a: float, b: float, atol: float) -> State:
    """The state just before b, from the state just after a; no event and no phase boundary between them."""
    n = len(scene.omega)
    middle = 0.5 * (a + b)

    def slope(t: float, y: Array) -> Array:
        # the end points belong to this piece: left of b, right of a
        side: Side = "right" if t < middle else "left"
        now = State(y[:n], y[n:])
        return np.concatenate([now.v, acceleration(scene, t, now, side)])

    solution = solve_ivp(slope, (a, b), np.concatenate(state), method="DOP853", rtol=RTOL, atol=atol)
    if not solution.success:
        raise RuntimeError(solution.message)
    return State(solution.y[:n, -1], solution.y[n:, -1])


def solve(scene: Scene, times: Sequence[float] | Array, start: State, scale: float) -> History:
    """Histories at `times` (S,) from `start` by DOP853, rtol 1e-11, atol 1e-13 of `scale` (a typical size of q).

    Events need not be among `times`, but those within 1e-9 of the range of an instant are taken to lie on it. Limits
    from the left and right are as in `newmark.History`.
    """
    marks = set(events(scene)) | boundaries(scene)
    t = np.array(sorted(times), dtype=np.float64)
    tolerance = 1e-9 * (t[-1] - t[0])
    for mark in marks:
        nearest = int(np.argmin(np.abs(t - mark)))
        t[nearest] = mark if abs(t[nearest] - mark) <= tolerance else t[nearest]
    stops = sorted(set(t) | {m for m in marks if t[0] < m < t[-1]})
    whole, inner = snapped(scene, stops)
    states, a = [start], [acceleration(scene, whole[0], start, "right")]
    before: list[Event] = []
    for n in range(1, len(whole)):
        state = _advance(scene, states[-1], whole[n - 1], whole[n], 1e-13 * scale)
        side: Side = "right" if n < len(whole) - 1 else "left"
        if n in inner:
            old = acceleration(scene, whole[n], state, "left")
            before.append(Event(n, whole[n], state.v, old, contact_forces(scene, whole[n], state, old, "left")))
            state = State(state.q, state.v + impulse(scene, whole[n], state))
        states.append(state)
        a.append(acceleration(scene, whole[n], state, side))
    return _chosen(collect(scene, whole, states, a, before), t)


def _chosen(history: History, t: Array) -> History:
    """Only the instants that were asked for; events keep the number of the asked instant at or after them."""
    keep = np.searchsorted(history.t, t)
    before = tuple(e._replace(step=int(np.searchsorted(t, e.t))) for e in history.before)
    return History(
        t,
        history.q[keep],
        history.v[keep],
        history.a[keep],
        history.contact_force[keep],
        history.position[keep],
        history.w_under[keep],
        before,
    )
