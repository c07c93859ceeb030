"""Static equilibrium and eigenfrequencies of an unreduced scene with its carriages at given places.

Unknown are the ties' forces and the rigid-body motions of what is free to move: x = G (f + B^T F) + R c, the gaps
B x + S F = 0, and balance R^T (f + B^T F) = 0, with the elastic flexibility G of all bodies and S the springs' own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.modal.flexibility import of_unit_mass
from engine.unreduced.rows import Along, at_positions, nowhere, readings, softness, tie_rows
from engine.unreduced.scene import Unreduced
from engine.unreduced.track import Rows
from results_schema.arrays import Array, Counts
from results_schema.lazy_imports import sparse

UNRESISTED = 1e-9  # of the largest: below it no contact resists a rigid-body motion
BALANCED = 1e-7  # of the weight: more is a load that no contact carries
STATIONS = 64  # solved at a time
DENSE = 400  # degrees of freedom up to which all eigenvalues are computed


class Statics(NamedTuple):
    """Static states at S stations: sensors (S, J), contact forces (S, T) of the model's ties, and x (S, n)."""

    sensors: Array
    forces: Array
    states: Array


def unreduced_statics(model: Unreduced, positions: ArrayLike) -> tuple[Array, Array]:
    """Readings (P, J) of the study's sensors, and the forces (P, T) of the model's ties, at rest under weights and
    forces with the carriages at `positions` (as of `at_positions`).

    Raises BadInput where nothing holds a body, or contacts cannot carry one.
    """
    found = statics_at(model, at_positions(model, positions))
    return found.sensors, found.forces


def unreduced_frequencies(model: Unreduced, positions: ArrayLike, count: int) -> Array:
    """(P, count) lowest natural frequencies, Hz, of bodies and carriages together, which stand still at `positions`;
    motions that nothing resists are left out, and NaN stands where there are no more."""
    _check_held(model)
    along = at_positions(model, positions)
    solver = StaticSolver(model)
    return np.stack([_frequencies(model, solver, along.some(slice(h, h + 1)), count) for h in range(len(along.s))])


def level_state(model: Unreduced) -> tuple[Array, Array]:
    """State (n,) and forces (T,) where everything that rides stands at rest on level rigid ground."""
    if not len(model.riders):
        return np.zeros(model.size), np.zeros(0)
    weight = np.zeros(model.size)
    for name in model.loose:
        weight[model.part(name)] = model.weight[model.part(name)]
    for place in model.sprung.values():
        weight[place] = model.weight[place]
    states, forces = StaticSolver(model).solve(nowhere(model), weight)
    return states[0], forces[0]


def level_readings(model: Unreduced, level: tuple[Array, Array], along: Along) -> Array:
    """(S, J) what sensors on bodies that ride, of sprung masses and of their springs read in a level state at the
    places of stations, where others ride on them; 0 for the others."""
    state, forces = (np.broadcast_to(part, (len(along.s), part.size)) for part in level)
    found = readings(model, along._replace(on=np.zeros_like(along.on))).at_rest(state, forces)
    rides = [
        sensor.reads.of_suspension
        or (not sensor.reads.of_contact and (sensor.carriage is not None or model.study.body_of(name) in model.loose))
        for name, sensor in model.study.sensor.items()
    ]
    return np.where(np.array(rides, dtype=np.bool_), found, 0.0)


def statics_at(model: Unreduced, along: Along) -> Statics:
    """Static states at stations, whatever the speed there."""
    _check_held(model)
    resting = Along.at_rest(along.s, along.on, model.riders)
    level, solver = level_state(model), StaticSolver(model)
    sensors, forces, states = [], [], []
    for first in range(0, len(along.s), STATIONS):
        part = resting.some(slice(first, first + STATIONS))
        state, force = solver.solve(part, model.weight)
        sensors.append(readings(model, part).less(level_readings(model, level, part)).at_rest(state, force))
        forces.append(force)
        states.append(state)
    return Statics(*(np.concatenate(found) for found in (sensors, forces, states)))


def _check_held(model: Unreduced) -> None:
    """Refuse a body that does not ride and is free to move."""
    for name, body in model.bodies.items():
        if body.rigid.shape[1] and name not in model.loose:
            what = "nothing holds this body, so it has no static equilibrium"
            raise model.study.source.fault(f"body.{name}.supports", what)


@dataclass(frozen=True, eq=False)
class StaticSolver:
    """Static equilibria of one scene."""

    model: Unreduced

    @property
    def springs(self) -> Counts:
        """The ties whose forces follow from the equilibrium; the others are given."""
        return np.flatnonzero([tie.link in ("spring", "rigid") for tie in self.model.ties])

    @cached_property
    def others(self) -> Array:
        """(n, springs) the riders' side of the springs."""
        return np.array([self.model.ties[j].other for j in self.springs]).reshape(len(self.springs), self.model.size).T

    @cached_property
    def held(self) -> tuple[Array, Array]:
        """(n, r1), (n, r2): rigid-body motions that contacts resist, and those that nothing does."""
        model = self.model
        felt = self.others.T @ model.rigid
        if not model.rigid.shape[1]:
            return model.rigid, model.rigid
        _, sizes, directions = np.linalg.svd(felt)
        rank = int(np.count_nonzero(sizes > UNRESISTED * sizes.max(initial=0.0)))
        return model.rigid @ directions[:rank].T, model.rigid @ directions[rank:].T

    @cached_property
    def _other_solved(self) -> Array:
        return self.model.elastic(self.others)

    def forms(self, along: Along) -> tuple[Array, Array, Array]:
        """Of S stations: B^T (S, n, k), G B^T (S, n, k) and the springs' own flexibility (S, k, k)."""
        model, springs = self.model, self.springs
        columns = _columns(model, tie_rows(model, along), springs)
        count, size, k = columns.shape
        flat = columns.transpose(1, 0, 2).reshape(size, count * k)
        solved = model.elastic(flat).reshape(size, count, k).transpose(1, 0, 2)
        own = np.diag([model.ties[j].compliance for j in springs])
        soft = softness(model, along)[:, springs[:, None], springs] + own
        return columns + self.others, solved + self._other_solved, soft

    def solve(self, along: Along, weight: Array) -> tuple[Array, Array]:
        """States (S, n) and forces (S, T) under constant loads (n,) and the weights of carriages."""
        model, springs = self.model, self.springs
        given = _given(model, along)
        rows = tie_rows(model, along)
        loads = np.tile(weight, (len(along.s), 1))
        for j in np.flatnonzero(np.any(given, axis=0)):
            np.add.at(
                loads, (np.arange(len(loads))[:, None], rows.freedoms[:, j]), rows.values[:, j] * given[:, j, None]
            )
        held, forms = self.held, self.forms(along)
        soft = softness(model, along)
        lift = np.einsum("skt,st->sk", soft[:, springs], given)
        state, force = _coupled(forms, held[0], (loads, model.elastic(loads.T).T), lift)
        self._check(loads + np.einsum("snk,sk->sn", forms[0], force), held[1], loads)
        forces = given.copy()
        forces[:, springs] = force
        return state, forces

    def _check(self, balance: Array, free: Array, loads: Array) -> None:
        """Refuse loads that nothing carries."""
        size = np.abs(loads @ self.model.rigid).max(initial=0.0)
        if np.abs(balance @ free).max(initial=0.0) > BALANCED * size:
            what = "the contacts of this scene cannot carry what rides on them"
            expected = "contacts about the centre of mass, at least two under a body that can pitch"
            raise self.model.study.source.fault("carriage", what, expected=expected)


def _coupled(
    forms: tuple[Array, Array, Array], rigid: Array, loads: tuple[Array, Array], lift: Array
) -> tuple[Array, Array]:
    """States and springs' forces from B^T, G B^T, S; R; loads f and G f (S, n); gaps that given forces open (S, k)."""
    wide, solved, soft = forms
    k, r = soft.shape[1], rigid.shape[1]
    bend = np.einsum("snk,snl->skl", wide, solved) + soft
    turn = np.einsum("snk,nr->skr", wide, rigid)
    unit = np.maximum(np.einsum("skk->s", bend), 1e-300)[:, None, None]
    size = np.maximum(np.abs(turn).max(axis=(1, 2), initial=0.0), 1e-300)[:, None, None]
    matrix = np.zeros((len(soft), k + r, k + r))
    matrix[:, :k, :k], matrix[:, :k, k:] = bend / unit, turn / size
    matrix[:, k:, :k] = np.swapaxes(turn, 1, 2) / size
    right = np.concatenate([-np.einsum("snk,sn->sk", wide, loads[1]) - lift, -(loads[0] @ rigid)], axis=1)
    right[:, :k] /= unit[:, 0]
    right[:, k:] /= size[:, 0]
    found = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    force, motion = found[:, :k], found[:, k:] * (unit / size)[:, 0]
    return loads[1] + np.einsum("snk,sk->sn", solved, force) + motion @ rigid.T, force


def _columns(model: Unreduced, rows: Rows, ties: Counts) -> Array:
    """(S, n, k) the bodies' side of some ties as dense columns."""
    count = len(rows.freedoms)
    found = np.zeros((count, model.size, len(ties)))
    station = np.arange(count)[:, None]
    for place, j in enumerate(ties):
        np.add.at(found[:, :, place], (station, rows.freedoms[:, j]), rows.values[:, j])
    return found


def _given(model: Unreduced, along: Along) -> Array:
    """(S, T) N: forces of the ties that are known at rest: forces and weights of masses in contact."""
    found = np.zeros((len(along.s), len(model.ties)))
    for j, tie in enumerate(model.ties):
        load = tie.force if tie.link == "force" else tie.mass * model.study.gravity * (tie.link == "mass")
        found[:, j] = load * along.on[:, tie.rider]
    return found


def _frequencies(model: Unreduced, solver: StaticSolver, along: Along, count: int) -> Array:
    """(count,) at one station, by the flexibility of the whole scene: G_c M x = x/omega^2."""
    mass = _mass_with_carriages(model, along)
    held, free = solver.held
    forms = solver.forms(along)
    free = of_unit_mass(free, mass)

    def flexibility(loads: Array) -> Array:
        balanced = loads - mass @ (free @ (free.T @ loads))
        wide = [np.repeat(part, loads.shape[1], axis=0) for part in forms]
        state, _ = _coupled(
            (wide[0], wide[1], wide[2]), held, (balanced.T, model.elastic(balanced).T), np.zeros((loads.shape[1], 1))
        )
        return np.asarray(state.T - free @ (free.T @ (mass @ state.T)))

    values = _largest(flexibility, mass, min(count, model.size - free.shape[1]))
    found = np.full(count, np.nan)
    found[: len(values)] = np.sqrt(1.0 / values) / (2.0 * np.pi)
    return found


def _mass_with_carriages(model: Unreduced, along: Along) -> Any:
    """(n, n) sparse: masses in contact ride with their bodies."""
    found = model.mass
    rows = tie_rows(model, along)
    for j, tie in enumerate(model.ties):
        if tie.link in ("mass", "push") and along.on[0, tie.rider]:
            row = sparse.csc_array(Rows(rows.freedoms[:, j], rows.values[:, j]).columns(model.size))
            found = found + tie.mass * (row @ row.T)
    return sparse.csc_array(found)


def _largest(flexibility: Any, mass: Any, count: int) -> Array:
    """The largest positive eigenvalues of G M, descending."""
    size = mass.shape[0]
    if size <= DENSE or 3 * count > size:
        from scipy.linalg import eigh

        soft = mass @ flexibility(mass.toarray())
        values = eigh(0.5 * (soft + soft.T), mass.toarray(), eigvals_only=True)
        return np.asarray(values[::-1][:count])
    from scipy.sparse.linalg import LinearOperator, eigsh

    inverse = LinearOperator((size, size), matvec=lambda load: flexibility(load.reshape(-1, 1))[:, 0], dtype=np.float64)
    start = flexibility((mass @ np.random.default_rng(0).standard_normal(size))[:, None])[:, 0]
    found = eigsh(
        mass, count, mass, 0.0, OPinv=inverse, v0=start, ncv=max(2 * count + 1, 40), return_eigenvectors=False
    )
    return np.asarray(np.sort(1.0 / found)[::-1])
