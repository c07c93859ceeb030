"""The march of several ties as a kernel: against dense matrices, on systems that no study file need describe."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.kernels.layout import (
    CLOSED,
    CURVE,
    FORCE,
    LANES,
    RATE,
    STATISTICS,
    Lanes,
    Newmark,
    Observation,
    Record,
    State,
    Ties,
)
from engine.kernels.stepping.march import march_many
from engine.kernels.stepping.start import solve_initial_acceleration, watch_start
from results_schema.arrays import Array

STATIONS, BLOCKS = 12, 2
SCHEMES = {"average acceleration": Newmark(0.25, 0.5), "damped": Newmark(0.3025, 0.6)}


@dataclass(frozen=True)
class System:
    """Modes with ties, each of a kind: "mass", "force", "rigid", or with "spring" and "damper" in its name.

    p, rate, curve (n, modes, ties), drive (n, ties): kinematics of a mass  p.q'' + rate.q'/h + curve.q/h2 + drive g/h2
    and of a damper  p.q' + curve.q/h + drive g/h;  level (n, ties): gap p.q + level g;  residual (n, ties, ties) m/N;
    mass, damper, spring, load (blocks, ties, LANES), zeta, mobility (blocks, modes, LANES), gravity, h (blocks, LANES).
    """

    kinds: tuple[str, ...]
    omega: Array
    zeta: Array
    inverse_modal_mass: Array
    p: Array
    rate: Array
    curve: Array
    drive: Array
    level: Array
    residual: Array
    mass: Array
    damper: Array
    spring: Array
    load: Array
    gravity: Array
    h: Array

    def are(self, word: str) -> NDArray[np.bool_]:
        """(ties,) whether a word is part of a tie's kind."""
        return np.array([word in kind for kind in self.kinds])


def system(kinds: tuple[str, ...], modes: int) -> System:
    """Random numbers; rows that vary along the way, variants that differ in everything a lane may have to itself."""
    random, ties = np.random.default_rng(len(kinds) + modes), len(kinds)
    along = np.linspace(0.0, 1.0, STATIONS)[:, None, None]
    moved, damped = (
        np.array([any(w in k for w in words) for k in kinds]) for words in (("mass", "rigid"), ("damper",))
    )

    def varying(size: float) -> Array:
        return size * (random.normal(size=(1, modes, ties)) + along * random.normal(size=(1, modes, ties)))

    def of(*words: str, low: float, high: float) -> Array:
        chosen = np.array([any(word in kind for word in words) for kind in kinds])
        return np.where(chosen[:, None], random.uniform(low, high, (BLOCKS, ties, LANES)), 0.0)

    p, flexible = varying(1.0), random.normal(size=(STATIONS, ties, ties))
    return System(
        kinds=kinds,
        omega=np.linspace(1.0, 9.0, modes),
        zeta=random.uniform(0.0, 0.1, (BLOCKS, modes, LANES)),
        inverse_modal_mass=random.uniform(0.5, 2.0, (BLOCKS, modes, LANES)),
        p=p,
        rate=np.where(moved, varying(0.03), np.where(damped, p, 0.0)),
        curve=np.where(moved | damped, varying(0.01), 0.0),
        drive=np.where(moved | damped, 1e-3 * random.normal(size=(STATIONS, ties)), 0.0),
        level=0.1 * random.normal(size=(STATIONS, ties)),
        residual=0.01 * flexible @ flexible.transpose(0, 2, 1) + 0.001 * flexible,  # not symmetric
        mass=of("mass", low=0.1, high=2.0),
        damper=of("damper", low=0.1, high=2.0),
        spring=of("spring", low=10.0, high=50.0),
        load=of("mass", "force", low=1.0, high=5.0),
        gravity=random.uniform(5.0, 10.0, (BLOCKS, LANES)),
        h=random.uniform(0.04, 0.08, (BLOCKS, LANES)),
    )


def start_of(one: System) -> tuple[Array, Array]:
    """Some displacements and velocities (modes,)."""
    q, v = np.random.default_rng(1).normal(size=(2, one.omega.size))
    return 0.1 * q, 0.2 * v


def dense(one: System, scheme: Newmark, block: int, lane: int) -> tuple[Array, Array]:
    """Displacements (n, modes) and forces (n, ties) of one variant in SI units: Newmark, all unknowns in one matrix,

    M q'' + C q' + K q = p F        mass:  F = load - m (p.q'' + A.q' + B.q + drive)
    rigid:  p.q'' + A.q' + B.q + drive = 0
    spring and damper:  F + k (p.q + level + R F) + c (p.q' + B.q + drive) = 0
    """
    g, h = one.gravity[block, lane], one.h[block, lane]
    mass = np.diag(1.0 / one.inverse_modal_mass[block, :, lane])
    damp, coupling_stiffness = mass * 2.0 * one.zeta[block, :, lane] * one.omega, mass * one.omega**2
    c, k, rigid = one.damper[block, :, lane], one.spring[block, :, lane], one.are("rigid")
    inertia = (one.mass[block, :, lane] + rigid)[:, None]
    (q, v), a, places, forces = start_of(one), np.zeros(one.omega.size), [], []
    for n in range(STATIONS):
        later, sooner = (scheme.beta * h**2, scheme.gamma * h) if n else (0.0, 0.0)
        if n:
            q, v = q + h * v + (0.5 - scheme.beta) * h**2 * a, v + (1.0 - scheme.gamma) * h * a
        p, rate, curve = one.p[n].T, one.rate[n].T, one.curve[n].T
        of_a, of_v = inertia * p, inertia * rate / h + c[:, None] * p
        of_q = inertia * curve / h**2 + c[:, None] * curve / h + k[:, None] * p
        of_f = np.diag(1.0 - rigid) + k[:, None] * one.residual[n]
        left = np.block(
            [[mass + sooner * damp + later * coupling_stiffness, -p.T], [of_a + sooner * of_v + later * of_q, of_f]],
        )
        own = g * ((inertia[:, 0] / h**2 + c / h) * one.drive[n] + k * one.level[n])
        known = one.load[block, :, lane] - own - of_v @ v - of_q @ q
        found = np.linalg.solve(left, np.concatenate([-damp @ v - coupling_stiffness @ q, known]))
        a = found[: one.omega.size]
        q, v = q + later * a, v + sooner * a
        places.append(q)
        forces.append(found[one.omega.size :])
    return np.array(places), np.array(forces)


def ties_of(one: System, scheme: Newmark) -> Ties:
    """The system's ties as the kernels take them."""
    moves, springs = one.are("mass") | one.are("rigid") | one.are("damper"), one.are("spring")
    rows = np.zeros((*one.p.shape, 4))
    rows[..., FORCE], rows[..., RATE], rows[..., CURVE] = one.p, one.rate, one.curve
    rows[..., CLOSED] = np.where(one.are("mass") | one.are("rigid"), one.p, 0.0)
    rows[1:, ..., CLOSED] += scheme.gamma * rows[1:, ..., RATE] + scheme.beta * rows[1:, ..., CURVE]
    reactive, prescribed = np.flatnonzero(moves | springs), np.flatnonzero(~(moves | springs))
    unity = np.where(one.are("rigid"), 0.0, 1.0)
    return Ties(
        rows, one.drive, one.level, reactive, prescribed, moves, springs, one.residual, unity, rows.any(axis=(0, 3))
    )


def lanes_of(one: System) -> Lanes:
    """Its variants as the kernels take them."""
    h = one.h[:, None]
    return Lanes(
        stiffness=(one.omega[:, None] * h) ** 2,
        damping=2.0 * one.zeta * one.omega[:, None] * h,
        inverse_modal_mass=one.inverse_modal_mass,
        coupling_mass=one.mass + one.damper * h + one.are("rigid")[:, None],
        coupling_stiffness=one.spring * h**2,
        load=one.load * h**2,
        weight=np.zeros((len(one.h), 0, LANES)),
        gravity=one.gravity,
        step=one.h,
    )


def marched(one: System, scheme: Newmark) -> tuple[Array, Array]:
    """(blocks, n, modes, LANES) displacements and (blocks, n, ties, LANES) forces of the kernels."""
    modes, ties, shape = one.omega.size, len(one.kinds), one.zeta.shape
    fours, signals = 4 * ((modes + 3) // 4), modes + ties
    watch = Observation(
        on_q=np.eye(modes, fours)[None],
        on_v=np.zeros((1, 0, fours)),
        on_a=np.zeros((1, 0, fours)),
        signal=np.arange(modes),
        order=np.zeros(modes, dtype=np.int64),
        static=np.tile(np.eye(signals, ties, -modes), (STATIONS, 1, 1)),
        offset=np.zeros((STATIONS, signals)),
        offset_order=np.zeros(signals, dtype=np.int64),
        counted=np.ones((STATIONS, signals), dtype=np.bool_),
        summed=np.ones(signals, dtype=np.bool_),
    )
    history = np.full((BLOCKS, STATIONS, signals, LANES), np.nan)
    record = Record(np.zeros((BLOCKS, signals, STATISTICS, LANES)), np.arange(STATIONS), history)
    q, v = (np.ascontiguousarray(np.broadcast_to(x[:, None], shape)) for x in start_of(one))
    state = State(q, v, np.zeros(shape), np.zeros(shape))
    table, lanes = ties_of(one, scheme), lanes_of(one)
    solve_initial_acceleration(table, lanes, state)
    watch_start(table, lanes, state, watch, record, 0)
    march_many(table, lanes, state, watch, record, scheme, 0)
    np.testing.assert_allclose(state.q, history[:, -1, :modes], rtol=1e-12, equal_nan=False)
    return history[:, :, :modes], history[:, :, modes:]


def assert_dense(one: System, scheme: Newmark) -> None:
    """Displacements and forces of some variants, at every station, within 1e-9 of their size."""
    places, forces = marched(one, scheme)
    for block, lane in ((0, 0), (0, 7), (BLOCKS - 1, LANES - 1)):
        for found, expected in zip((places, forces), dense(one, scheme, block, lane), strict=True):
            size = np.abs(expected).max(axis=0).max()
            assert 1e-3 < size < 1e4
            np.testing.assert_allclose(found[block, :, :, lane], expected, rtol=0, atol=1e-9 * size, equal_nan=False)


EVERY = ("mass", "spring", "force", "rigid", "spring and damper", "damper")
SYSTEMS = {
    "one mass": (("mass",), 4),
    "one spring": (("spring",), 3),
    "one rigid": (("rigid",), 5),
    "two rigid": (("rigid", "rigid"), 6),
    "two springs": (("spring", "spring"), 7),
    "a spring and a dead load": (("force", "spring"), 4),
    "springs and dampers": (("spring and damper", "spring and damper", "spring"), 8),
    "every kind": (EVERY, 9),
    "every kind, twice": (EVERY + EVERY[::-1], 17),
    "eight masses": (("mass",) * 8, 10),
    "nine springs": (("spring",) * 9, 10),
    "dead loads alone": (("force", "force", "force"), 2),
}


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=list(SCHEMES))
@pytest.mark.parametrize(("kinds", "modes"), SYSTEMS.values(), ids=list(SYSTEMS))
def test_as_dense_matrices(kinds: tuple[str, ...], modes: int, scheme: Newmark) -> None:
    assert_dense(system(kinds, modes), scheme)


@pytest.mark.parametrize("kinds", [("spring", "spring"), EVERY], ids=["springs", "every kind"])
def test_nothing_missed_may_be_left_out(kinds: tuple[str, ...]) -> None:
    """A residual of zeros and one without ties are the same, bit for bit."""
    zeros = replace(system(kinds, 6), residual=np.zeros((STATIONS, len(kinds), len(kinds))))
    for found, expected in zip(
        marched(replace(zeros, residual=np.zeros((0, 0, 0))), SCHEMES["damped"]),
        marched(zeros, SCHEMES["damped"]),
        strict=True,
    ):
        np.testing.assert_array_equal(found, expected)
        assert np.isfinite(found).all()
