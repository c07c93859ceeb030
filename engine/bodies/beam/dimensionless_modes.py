"""Modes of a uniform Euler-Bernoulli beam on any set of pinned, clamped or elastic restraints.

Hierarchical finite elements between the restraints, with the *curvature* as unknown. With q_n the orthonormal
Legendre polynomials of an element, w'' = sum c_n q_n, w = z_0 + z_1 x + (w'' integrated twice), so that

    strain energy   1/2 (|c|^2 + |t|^2),   t_j = sqrt(k_j) r_j[w] for every elastic restraint: the identity,
    mass            1/2 |G (z, c)|^2,      G = coefficients of w in the same polynomials (a banded closed form).

Rigid restraints and the compatibility of the t_j are linear constraints; with (z, c) = E y their solution that
keeps the strain energy |y|^2, the singular values of G E are 1/omega and its left singular vectors are the
modes of unit mass. No number is squared, and a Jacobi singular value decomposition keeps the relative accuracy of
every frequency, from soft springs to the highest mode. All dimensionless: L = EI = rho A = 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from engine.bodies.beam.statics import Restraint, rigid_body_modes
from engine.bodies.modal.modal_body import Array
from engine.kernels.shapes import Span, beam_shapes
from engine.linear_algebra import one_thread
from results_schema.lazy_imports import linalg

_LAST_BIT = 1e-17
SHARED = 32  # modes that a body is decomposed into at least: studies ask for few and for many of the same one
# A mode is four waves on spans of at least so much width times wave number, Legendre polynomials below, where waves of
# rigid motion would cancel. On six beams with 32 modes any value from 0.3 to 9 gave the same shapes within 1e-13.
BENT = 6.0
PINNED = (Restraint(0.0, 0, 0.0), Restraint(1.0, 0, 0.0))
ORDERS = 4  # a shape and three derivatives

Table = tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class UnitModes:
    """Modes of the dimensionless beam: N modes on the spans between `nodes` (E + 1,).

    omega (N,); integral (N,) of each shape.
    """

    nodes: Array
    omega: Array
    integral: Array
    spans: tuple[Span, ...]

    def derivatives(self, x: Array, orders: Sequence[int], scale: Sequence[float] = (1.0,) * ORDERS) -> Array:
        """d^j phi/dx^j at x (S,) in [0, 1] for several j, times the scale of each; (orders, S, N); at an inner node
        from the right."""
        found = np.empty((len(orders), len(x), len(self.omega)))
        wanted, times = np.array(orders, dtype=np.int64), np.array(scale[: len(orders)])
        element = np.searchsorted(self.nodes[1:-1], x, side="right")
        for e, span in enumerate(self.spans):
            here = np.flatnonzero(element == e) if len(self.spans) > 1 else np.arange(len(x))
            if len(here):
                left, right = self.nodes[e], self.nodes[e + 1]
                local = np.clip((2.0 * x[here] - left - right) / (right - left), -1.0, 1.0)
                beam_shapes(local, here, span, wanted, times, found)
        return found

    def rows(self, x: Array, derivative: int) -> Array:
        """One of them, (S, N)."""
        return np.asarray(self.derivatives(x, (derivative,))[0])

    def lowest(self, count: int) -> UnitModes:
        """The lowest modes alone, without polynomials that only higher ones need."""
        spans = tuple(_lowest(span, count) for span in self.spans)
        return UnitModes(self.nodes, self.omega[:count], self.integral[:count], spans)


def _lowest(span: Span, count: int) -> Span:
    slow = min(count, span.series.shape[2])
    waves = slice(0, count - slow)
    parts = (np.ascontiguousarray(part[waves]) for part in span[1:])
    return Span(np.ascontiguousarray(span.series[:, :, :slow]), *parts)


def _pinned(modes: int) -> UnitModes:
    """sqrt(2) sin(k pi x): about the middle a cosine where k is odd, else a sine.

    >>> np.round(unit_modes(PINNED, 2).rows(np.array([0.0, 0.25, 1.0]), 0) / np.sqrt(2.0), 3) + 0.0
    array([[0.   , 0.   ],
           [0.707, 1.   ],
           [0.   , 0.   ]])
    """
    k = np.arange(1.0, modes + 1.0)
    sine, cosine = (
        np.array(one)[np.arange(1, modes + 1) % 4] for one in ((1.0, 0.0, -1.0, 0.0), (0.0, 1.0, 0.0, -1.0))
    )
    waves = np.sqrt(2.0) * np.stack([sine, cosine, np.zeros(modes), np.zeros(modes)], axis=1)
    span = Span(np.zeros((ORDERS, 1, 0)), 0.5 * k, 0.5 * np.pi * k, waves, np.pi * k)
    integral = np.sqrt(2.0) / np.pi * (1.0 - (-1.0) ** k) / k
    return UnitModes(np.array([0.0, 1.0]), (np.pi * k) ** 2, integral, (span,))


@lru_cache(maxsize=256)
def unit_modes(restraints: tuple[Restraint, ...], modes: int) -> UnitModes:
    """Modes of the dimensionless beam. Up to `SHARED` they are the lowest of so many, which are computed once."""
    if restraints == PINNED:
        return _pinned(modes)
    if modes < SHARED:
        return _decomposed(restraints, SHARED).lowest(modes)
    return _decomposed(restraints, modes)


@lru_cache(maxsize=64)
def _decomposed(restraints: tuple[Restraint, ...], modes: int) -> UnitModes:
    import scipy.linalg  # noqa: F401, its library is to be held too; not needed to import the engine

    with one_thread():
        return _solved(restraints, modes)


def _solved(restraints: tuple[Restraint, ...], modes: int) -> UnitModes:
    """The eigenvalue problem of so many modes."""
    space = _CurvatureSpace.between(restraints, modes)
    rigid_lines = rigid_body_modes(restraints)
    rigid = space.deflection[:, :2] @ rigid_lines.T
    embedding = _embedding(space, restraints)
    factor = space.deflection @ embedding
    factor -= rigid @ (rigid.T @ factor)
    held = min(modes, len(rigid_lines))
    periods, left, right = _jacobi_svd(factor)
    omega = np.concatenate([np.zeros(held), 1.0 / periods[: modes - held]])
    shapes = np.hstack([rigid[:, :held], left[:, : modes - held]])
    curvature = np.zeros((space.size, modes))
    curvature[:, held:] = embedding[2:] @ _stresses(factor, shapes[:, held:], right, omega[held:]) * omega[held:]
    sign = _orientation(space.series(shapes, 2), space.nodes, modes)
    return space.modes(omega, shapes * sign, curvature * sign)


@dataclass(frozen=True, eq=False)
class _CurvatureSpace:
    """Trial functions (z_0, z_1, c): a line plus a curvature of `terms[e]` Legendre polynomials on element e.

    deflection, slope: coefficients of w and w' in the elements' orthonormal polynomials, two and one more per
    element than the curvature; node_value, node_slope (E + 1, 2 + size): w and w' at the nodes.
    """

    nodes: Array
    terms: tuple[int, ...]
    deflection: Array
    slope: Array
    node_value: Array
    node_slope: Array

    @classmethod
    def between(cls, restraints: Sequence[Restraint], modes: int) -> _CurvatureSpace:
        """Elements between the restraints, fine enough for `modes` modes at the accuracy of float64."""
        nodes = np.unique([0.0, 1.0, *(one.at for one in restraints)])
        highest = math.pi * (modes + len(restraints) + 1)  # each restraint raises a mode by one place at most
        terms = tuple(_terms(0.5 * highest * h) for h in np.diff(nodes))
        size = sum(terms)
        value, slope = np.eye(2, 2 + size)
        values, slopes, deflections, rotations = [value], [slope], [], []
        start = 2
        for h, p in zip(np.diff(nodes), terms, strict=True):
            once = 0.5 * h * _integral(p)
            rotation, deflection = np.zeros((p + 1, 2 + size)), np.zeros((p + 2, 2 + size))
            rotation[:, start : start + p] = once
            rotation[0] += math.sqrt(h) * slope
            deflection[:, start : start + p] = 0.5 * h * _integral(p + 1) @ once
            deflection[0] += math.sqrt(h) * (value + 0.5 * h * slope)
            deflection[1] += math.sqrt(h / 12.0) * h * slope
            value = value + math.sqrt(h) * rotation[0]
            slope = slope.copy()
            slope[start] += math.sqrt(h)
            values.append(value)
            slopes.append(slope)
            deflections.append(deflection)
            rotations.append(rotation)
            start += p
        return cls(nodes, terms, np.vstack(deflections), np.vstack(rotations), np.array(values), np.array(slopes))

    @property
    def size(self) -> int:
        """Number of curvature coefficients."""
        return sum(self.terms)

    def series(self, coefficients: Array, more: int) -> Table:
        """Coefficients in orthonormal polynomials, `more` per element than the curvature's, as series of P_m."""
        found, start = [], 0
        for h, p in zip(np.diff(self.nodes), self.terms, strict=True):
            norms = np.sqrt((2.0 * np.arange(p + more) + 1.0) / h)
            found.append(coefficients[start : start + p + more] * norms[:, None])
            start += p + more
        return tuple(found)

    def modes(self, omega: Array, shapes: Array, curvature: Array) -> UnitModes:
        """Series of all derivatives, each from the coefficients that hold it best (no differentiation of w)."""
        lines = np.linalg.lstsq(self.deflection[:, :2], shapes - self.deflection[:, 2:] @ curvature, rcond=None)[0]
        slope = self.slope @ np.vstack([lines, curvature])
        widths = np.diff(self.nodes)
        bending = self.series(curvature, 0)
        shear = tuple(np.polynomial.legendre.legder(one) * (2.0 / h) for one, h in zip(bending, widths, strict=True))
        deflection = self.series(shapes, 2)
        integral = sum(one[0] * h for one, h in zip(deflection, widths, strict=True))
        parts = zip(deflection, self.series(slope, 1), bending, shear, strict=True)
        spans = tuple(_span(series, float(h), np.sqrt(omega)) for series, h in zip(parts, widths, strict=True))
        return UnitModes(self.nodes, omega, np.asarray(integral), spans)


def _span(series: Sequence[Array], width: float, wave_number: Array) -> Span:
    """Modes (their wave numbers (N,)) between two nodes, from the Legendre series (P, N) of all derivatives."""
    slow = int(np.count_nonzero(wave_number * width < BENT))
    low = [_trimmed(one[:, :slow]) for one in series]
    kept = np.zeros((ORDERS, max(len(one) for one in low), slow))
    for order, one in enumerate(low):
        kept[order, : len(one)] = one
    fast = wave_number[slow:]
    rate = 0.5 * width * fast
    waves = _waves(series[0][:, slow:], series[2][:, slow:] / fast**2, rate)
    return Span(kept, rate / np.pi, rate, waves, fast)


def _trimmed(table: Array) -> Array:
    """A series (P, N) without its last polynomials as far as they are rounding, but for two."""
    sizes = np.abs(table).max(axis=1, initial=0.0)
    last = int(np.max(np.flatnonzero(sizes > _LAST_BIT * sizes.max()), initial=1))
    return table[: last + 1]


def _waves(deflection: Array, curvature: Array, rate: Array) -> Array:
    """Amplitudes (N, 4) of sine, cosine and both exponentials (`Span`), from Legendre series (P, N) of w and w''/k^2.

    As w'''' = k^4 w, the trigonometric part is (w - w''/k^2)/2 and the other one (w + w''/k^2)/2. Each is fitted at
    places that lie alike on both sides of the middle, where what is odd and what is even do not mix.
    """
    half = np.cos(np.linspace(0.0, 0.5 * np.pi, 2 * len(deflection), endpoint=False))
    x = np.concatenate([half, -half])[:, None]
    w, bent = _at(x[:, 0], deflection), _at(x[:, 0], curvature)
    near, far = np.exp(-rate * (1.0 + x)), np.exp(-rate * (1.0 - x))
    sine, cosine = (_fitted(0.5 * (w - bent), part) for part in (np.sin(rate * x), np.cos(rate * x)))
    even, odd = (_fitted(0.5 * (w + bent), part) for part in (far + near, far - near))
    return np.stack([sine, cosine, even - odd, even + odd], axis=1)


def _fitted(values: Array, function: Array) -> Array:
    """(N,) least-squares amplitudes of functions (S, N) in values (S, N)."""
    return np.asarray(np.sum(values * function, axis=0) / np.sum(function**2, axis=0))


def _at(x: Array, series: Array) -> Array:
    """Legendre series (P, N) at x (S,) in [-1, 1], as (S, N)."""
    return np.asarray(np.polynomial.legendre.legvander(x, len(series) - 1) @ series)


def _terms(wave: float) -> int:
    """Legendre terms on [-1, 1] that hold exp(i wave x) to the last bit: wave^n/(2n+1)!! bounds the next ones."""
    n, bound = 0, 1.0
    while n < wave or bound > _LAST_BIT:
        n += 1
        bound *= wave / (2 * n + 1)
    return max(n, 5)


def _integral(p: int) -> Array:
    """(p + 1, p): integral from -1 of orthonormal Legendre polynomials on [-1, 1], in the same polynomials."""
    n = np.arange(p)
    up = 1.0 / np.sqrt((2.0 * n + 1.0) * (2.0 * n + 3.0))
    matrix = np.zeros((p + 1, p))
    matrix[n + 1, n] = up
    matrix[n[1:] - 1, n[1:]] = -up[:-1]
    matrix[0, 0] = 1.0
    return matrix


def _embedding(space: _CurvatureSpace, restraints: Sequence[Restraint]) -> Array:
    """(z, c) = E y with strain energy |y|^2/2 for the curvature and all elastic restraints, none for rigid motion.

    Restraints: sqrt(d) t - R_c c = R_z z. As many as fix the lines z (stiff ones first) are solved for z; the
    others constrain (t, c), and an orthonormal basis of what they leave keeps the energy.
    """
    kinds = (space.node_value, space.node_slope)
    rows = [kinds[one.order][np.searchsorted(space.nodes, one.at)] for one in restraints]
    functionals = np.array(rows).reshape(len(rows), 2 + space.size)
    on_lines = functionals[:, :2]
    compliance = np.array([one.compliance for one in restraints])
    soft = np.flatnonzero(compliance > 0.0)
    stress = np.zeros((len(rows), len(soft) + space.size))
    stress[soft, np.arange(len(soft))] = np.sqrt(compliance[soft])
    stress[:, len(soft) :] = -functionals[:, 2:]

    rank = 2 - len(rigid_body_modes(restraints))
    weight = 1.0 / np.sqrt(compliance + 0.01)  # the beam's own compliance, 1/48 and less
    order = linalg.qr((on_lines * weight[:, None]).T, mode="r", pivoting=True)[1] if rank else np.arange(len(rows))
    base, others = order[:rank], order[rank:]
    lines = np.linalg.pinv(on_lines[base]) @ stress[base] if rank else np.zeros((2, stress.shape[1]))
    embedding = np.vstack([lines, np.eye(space.size, stress.shape[1], k=len(soft))])
    if not len(others):
        return embedding
    constraints = stress[others] - on_lines[others] @ lines
    basis = linalg.qr(constraints.T)[0]
    return np.asarray(embedding @ basis[:, len(others) :])


def _jacobi_svd(matrix: Array) -> tuple[Array, Array, Array]:
    """Singular values (descending) and vectors with high relative accuracy, whatever the scale of the columns."""
    from scipy.linalg.lapack import dgejsv

    values, left, right, work, _, info = dgejsv(matrix, joba=0, jobu=0, jobv=0, jobr=0, jobp=0)
    if info != 0:
        raise ArithmeticError(f"modes of a beam: dgejsv did not converge (info {info})")
    return values * (work[0] / work[1]), left, right


def _stresses(factor: Array, shapes: Array, right: Array, omega: Array) -> Array:
    """Right singular vectors, each entry from the source that rounds it less.

    The decomposition rounds all entries alike; factor^T shapes omega rounds in proportion to the column, which
    keeps the high polynomials of the low modes clean (the third derivative multiplies them by their degree squared).
    """
    projected = (factor.T @ shapes) * omega
    rounding = np.linalg.norm(factor, axis=0)[:, None] * omega
    return np.where(rounding < 1.0, projected, right[:, : len(omega)])


def _orientation(series: Table, nodes: Array, modes: int) -> Array:
    """+1 or -1 per mode: the first place that reaches half of the largest value becomes positive."""
    x = np.linspace(0.0, 1.0, 16 * modes + 1)
    element = np.searchsorted(nodes[1:-1], x, side="right")
    middles, widths = 0.5 * (nodes[1:] + nodes[:-1])[element], np.diff(nodes)[element]
    local = np.clip(2.0 * (x - middles) / widths, -1.0, 1.0)
    values = np.concatenate([_at(local[element == e], one) for e, one in enumerate(series)])
    first = np.argmax(np.abs(values) >= 0.5 * np.abs(values).max(axis=0), axis=0)
    return np.where(values[first, np.arange(modes)] < 0.0, -1.0, 1.0)
