"""Ties where they take hold of bodies: rows of mode shapes, and what one tie's force does where another one holds.

The kept modes carry  sum phi_k(x) phi_k(s)/omega_k^2  of the static flexibility between two places; what they miss is
the residual flexibility, the whole influence line less that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from engine.kernels.modal_sums import sums_over_modes
from engine.model.ties import Attachment
from results_schema.arrays import Array, Counts, Mask

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import ModalBody
    from engine.model.scene_model import SceneModel
    from engine.model.station_path import Along


ROUNDED = 1e-12  # of the largest of a matrix: less is rounding


def holds(attachment: Attachment, along: Along) -> bool:
    """Whether an attachment touches its body anywhere along a segment."""
    return attachment.rider is None or along[attachment.rider].active


def place(attachment: Attachment, along: Along) -> Array | str:
    """Where it holds: (S,) or (1,) places of the track in m, or the name of a point."""
    if attachment.rider is not None:
        return along[attachment.rider].s
    return attachment.at if isinstance(attachment.at, str) else np.array([attachment.at])


def rows(model: SceneModel, attachment: Attachment, along: Along, derivative: int = 0) -> Array:
    """(S or 1, N of its body) derivative of the mode shapes where it holds; 0 where it does not."""
    if attachment.rider is None and derivative > 0:
        return np.zeros((1, model.bodies[attachment.body].modal.omega.size))
    return np.asarray(shape_derivatives(model, attachment, along, derivative)[derivative])


def shape_derivatives(model: SceneModel, attachment: Attachment, along: Along, highest: int) -> Array:
    """(``highest`` + 1 or more, S or 1, N) the mode shapes and their derivatives; of a fixed place the shapes alone."""
    modal = model.bodies[attachment.body].modal
    if attachment.rider is None:
        return attachment.fixed_row(modal).copy()[None, None]
    way = along[attachment.rider]
    found = way.shapes(modal, highest, attachment.direction)
    return found if way.here is None else np.where(way.here[:, None], found, 0.0)


def modal_flexibility_between(model: SceneModel, one: Attachment, other: Attachment, along: Along) -> Array:
    """(S or 1,) what the kept modes of a body carry of the motion of an attachment per unit force of another, m/N."""
    modal, factor = model.bodies[one.body].modal, one.factor * other.factor
    return factor * carried_by_modes(modal, rows(model, one, along), rows(model, other, along))


def carried_by_modes(modal: ModalBody, left: Array, right: Array) -> Array:
    """(S,) what the modes of a body carry of a static reading: of every mode, left (S or 1, N) is read per unit, and a
    unit force moves it by right (S or 1, N)."""
    found = np.empty(max(len(left), len(right)))
    sums_over_modes(*map(np.ascontiguousarray, (left, right)), modal.modal_flexibility, found)
    return found


def residual_flexibility(model: SceneModel, one: Attachment, other: Attachment, along: Along) -> Array:
    """(S or 1,) what they miss of it."""
    heres = [along[one.rider].here for one in (one, other) if one.rider is not None]
    both = np.logical_and.reduce([here for here in heres if here is not None])
    if not both.any():
        return np.zeros(1)
    places, directions = (place(one, along), place(other, along)), (one.direction, other.direction)
    whole = np.where(both, model.bodies[one.body].modal.flexibility_between(*places, directions), 0.0)
    return np.asarray(one.factor * other.factor * whole - modal_flexibility_between(model, one, other, along))


def shared(model: SceneModel, r: int, s: int, along: Along) -> Iterator[tuple[Attachment, Attachment]]:
    """Grips of the ties r and s that hold the same body."""
    for one in model.attachments[r]:
        for other in model.attachments[s]:
            if one.body == other.body and holds(one, along) and holds(other, along):
                yield one, other


def tie_shapes(model: SceneModel, ties: Sequence[int], along: Along) -> Array:
    """(S, N, R) what some ties read of every coordinate: mode shapes of bodies, and sprung masses."""
    found = np.zeros((along[0].s.size, model.omega.size, len(ties)))
    for place, r in enumerate(ties):
        for attachment in model.attachments[r]:
            if holds(attachment, along):
                shapes = attachment.factor * rows(model, attachment, along)
                found[:, model.bodies[attachment.body].modes, place] += shapes
        if model.first_spring <= r < model.first_push:
            mode = model.springs[r - model.first_spring].mode
            if mode is not None:
                found[:, mode, place] = -1.0
    return found


def residual_rows(model: SceneModel, ties: Counts, missed: Array) -> Array:
    """(S, C, R) by which forces of some ties enter the residual coordinates; missed (S, R, R): the flexibility between
    these ties that the kept modes miss.

    Forces F on a track move their places by y = R F besides the kept modes, R their residual flexibility, and their
    masses by as much: F = -m (s'' + D2 u + y''). So every such tie has one more coordinate, which it alone reads, as
    it is:  y'' + 2 zeta omega y' + omega^2 y = omega^2 R F.  Its inertia, 1/(R omega^2), is one that modes above omega
    have too, and keeps light masses from swinging faster than these.
    """
    found = np.zeros((len(missed), model.corrected.size, ties.size))
    _, own, felt = np.intersect1d(model.corrected, ties, assume_unique=True, return_indices=True)
    square = model.omega[model.residuals][own, None] ** 2
    found[:, own[:, None], felt] = square * without_negative(missed[:, felt[:, None], felt])
    return found


def without_negative(flexibility: Array) -> Array:
    """(S, R, R) the nearest flexibilities that resist every motion: modes of few elements carry more between nodes
    than there is."""
    wrong = _with_negative(flexibility)
    if not wrong.any():
        return flexibility
    own, vectors = np.linalg.eigh(flexibility[wrong])
    found = flexibility.copy()
    found[wrong] = vectors * np.maximum(own, 0.0)[:, None] @ np.swapaxes(vectors, 1, 2)
    return found


def _with_negative(flexibility: Array) -> Mask:
    """(S,) which of symmetric matrices (S, R, R) have a negative eigenvalue: by the pivots of L D L^T, as many as there
    are (Sylvester), but for rounding."""
    left, found = flexibility.copy(), np.zeros(len(flexibility), dtype=np.bool_)
    least = ROUNDED * np.abs(flexibility).max(axis=(1, 2), initial=0.0)
    for k in range(flexibility.shape[1]):
        pivot, column = left[:, k, k].copy(), left[:, k + 1 :, k].copy()
        felt = pivot > least
        found |= (pivot < -least) | (~felt & (np.abs(column).max(axis=1, initial=0.0) > least))
        shares = column / np.where(felt, pivot, np.inf)[:, None]
        left[:, k + 1 :, k + 1 :] -= shares[:, :, None] * column[:, None, :]
    return found


def residual(model: SceneModel, along: Along, ties: Counts) -> Array:
    """(S, ties, ties) flexibility that the kept modes miss between springs and some ties, by their numbers, and between
    pushes along and across tracks, m/N; (0, 0, 0) where there are none, or no static correction."""
    springs = dict(enumerate(model.springs, start=model.first_spring))
    felt = [place for place, r in enumerate(ties) if r in springs and not springs[r].rigid]
    own = [place for place, r in enumerate(ties) if r in model.corrected]
    if not (felt or own) or not model.numerics.static_correction:
        return np.zeros((0, 0, 0))
    found, known = np.zeros((along[0].s.size, ties.size, ties.size)), dict[tuple[Attachment, Attachment], Array]()
    for r in (*felt, *own):
        for s in own if r in own else range(ties.size):
            if s in (own if r in own else felt) and s < r:
                found[:, r, s] = found[:, s, r]
                continue
            for one, other in shared(model, ties[r], ties[s], along):
                first, second = sorted((one.unit, other.unit), key=str)  # dead loads and springs hold the same places
                if (first, second) not in known:
                    known[first, second] = residual_flexibility(model, first, second, along)
                found[:, r, s] += one.factor * other.factor * known[first, second]
    return found
