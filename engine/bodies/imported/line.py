"""The track of an imported body between its nodes: mode shapes, statics, stress and strain.

Between two nodes the deflection is the cubic of both values and slopes (mechanics section 1). Slopes are the nodes'
rotations about the axis across track and load; or those of the C2 spline through the values (not-a-knot), where the
model has none. Either way value and slope are linear in the model's displacements u: z = B u. A load on the track acts
through the same B, so that w(x; s) = h(x)^T B G B^T h(s), G the whole model's flexibility, h the cubics: what a direct
solve with this interpolation gives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.frame.shapes import end_weights
from engine.bodies.frame.track import track_places
from engine.bodies.modal.modal_body import Array, refuse_loose
from engine.kernels.shapes import combined_rows
from results_schema.errors import BadInput

# Of value and slope at the left end, then at the right one: coefficients of x^0 to x^3 on [0, 1].
_CUBIC = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])
_ENDS = 4


def cubics(places: Array, s: ArrayLike, derivative: int) -> tuple[Any, Array]:
    """Which of the (2 P) values and slopes, value and slope by node, act at the stations (S,): numbers (S, 4) and
    weights (S, 4) of d^j/ds^j; at a node from the right."""
    at = track_places(s, float(places[-1]), derivative)
    left = np.clip(np.searchsorted(places, at, side="right") - 1, 0, len(places) - 2)
    length = np.diff(places)[left]
    x = np.clip((at - places[left]) / length, 0.0, 1.0)
    return 2 * left[:, None] + np.arange(_ENDS), end_weights(_CUBIC, x, length, derivative)


@dataclass(frozen=True, eq=False)
class LineShapes:
    """Shapes of N modes: values and slopes (2 P, N) at places (P,), m; unit modal mass."""

    places: Array
    ends: Array

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j phi_k/ds^j at the stations `s` (S,) for several j, as (orders, S, N); at a node from the right."""
        parts = [cubics(self.places, s, order) for order in orders]
        found = np.empty((len(orders), len(parts[0][0]), self.ends.shape[1]))
        combined_rows(parts[0][0], np.stack([weights for _, weights in parts]), self.ends, found)
        return found


@dataclass(frozen=True, eq=False)
class LineStatics:
    """Influence functions along a track: flexibility (2 P, 2 P) between values and slopes at places (P,); weight
    (2 P,): the same under own weight per unit gravity; rigid: number of rigid-body modes."""

    places: Array
    flexibility: Array
    weight: Array
    rigid: int

    def influence_at(self, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` per unit force at `s`, m^(1-j)/N, for pairs that are broadcast against each
        other; summed in a fixed order."""
        place, load = np.broadcast_arrays(np.atleast_1d(x), np.atleast_1d(s))
        taken, takes = cubics(self.places, place.reshape(-1), derivative)
        acting, acts = cubics(self.places, load.reshape(-1), 0)
        found: Array = np.zeros(place.size)
        for one in range(_ENDS):
            for other in range(_ENDS):
                found += takes[:, one] * acts[:, other] * self.flexibility[taken[:, one], acting[:, other]]
        return found.reshape(place.shape)

    def own_weight_deflection(self, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) under own weight per unit gravity, m^(1-j)/(m/s^2)."""
        refuse_loose(self.rigid)
        return self.under_response(self.weight, x, derivative)

    def under_response(self, response: Array, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) where values and slopes are `response` (2 P,)."""
        numbers, weights = cubics(self.places, x, derivative)
        return np.asarray(np.sum(weights * response[numbers], axis=1))


def _refuse(quantity: str) -> NoReturn:
    what, expected = f"{quantity} is not available on an imported body", "displacement, velocity or acceleration"
    raise BadInput(what, where="sensor", expected=expected)


class NoSections:
    """An imported body has no section forces, and without a recovery matrix no stress or strain: BadInput."""

    def rows(self, quantity: str, *_: Any, **__: Any) -> NoReturn:
        """Raises BadInput."""
        _refuse(quantity)

    influence_at = own_weight = under_response = rows


@dataclass(frozen=True, eq=False)
class LineRecovered:
    """What a recovery matrix tells at the nodes of a track, linear in between, of K quantities one after the other: of
    N modes, values (K P, N); per unit value and slope loads, response (K P, 2 P); under own weight per unit gravity,
    weight (K P,)."""

    statics: LineStatics
    quantities: tuple[str, ...]
    values: Array
    response: Array
    weight: Array

    def rows(self, quantity: str, s: ArrayLike) -> Array:
        """A quantity of every mode at the stations `s` (S,), as (S, N). Raises BadInput for one that is not told."""
        return self._along(quantity, s, self.values)

    def influence_at(self, quantity: str, x: ArrayLike, s: ArrayLike) -> Array:
        """A quantity at `x` per unit force at `s`, for pairs that are broadcast against each other."""
        place, load = np.broadcast_arrays(np.atleast_1d(x), np.atleast_1d(s))
        left, share = self._between(quantity, place.reshape(-1))
        acting, acts = cubics(self.statics.places, load.reshape(-1), 0)
        found: Array = np.zeros(place.size)
        for end in range(_ENDS):
            column = acting[:, end]
            told = (1.0 - share) * self.response[left, column] + share * self.response[left + 1, column]
            found += acts[:, end] * told
        return found.reshape(place.shape)

    def own_weight(self, quantity: str, x: ArrayLike) -> Array:
        """A quantity at `x` (X,) under the body's own weight, per unit gravity."""
        refuse_loose(self.statics.rigid)
        return self.under_response(quantity, self.weight, x)

    def under_response(self, quantity: str, response: Array, x: ArrayLike) -> Array:
        """A quantity at `x` (X,) where all are `response` (K P,) at the nodes."""
        return self._along(quantity, x, response[:, None])[:, 0]

    def _along(self, quantity: str, x: ArrayLike, values: Array) -> Array:
        left, share = self._between(quantity, x)
        return np.asarray((1.0 - share[:, None]) * values[left] + share[:, None] * values[left + 1])

    def _between(self, quantity: str, x: ArrayLike) -> tuple[Any, Array]:
        """Among the values of a quantity that of the node left of every place (X,), and how far towards the next one
        it lies."""
        if quantity not in self.quantities:
            _refuse(quantity)
        places = self.statics.places
        at = track_places(x, float(places[-1]))
        left = np.clip(np.searchsorted(places, at, side="right") - 1, 0, len(places) - 2)
        return self.quantities.index(quantity) * len(places) + left, (at - places[left]) / np.diff(places)[left]
