"""A rigid body in modal coordinates: heave and pitch about its centre of mass, each with unit modal mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.modal.modal_body import Array, ModalBody
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.rigid.rigid import Rigid


@dataclass(frozen=True)
class RigidShapes:
    """phi = (1/sqrt(m), (s - centre)/sqrt(J))."""

    mass: float
    inertia: float
    centre: float

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j phi / ds^j at the stations `s` (S,) for several j, as (orders, S, 2)."""
        arm = np.asarray(s, dtype=np.float64) - self.centre
        none = np.zeros_like(arm)
        shapes = {0: (none + 1.0, arm), 1: (none, none + 1.0)}
        sizes = np.sqrt([self.mass, self.inertia])
        return np.stack([np.stack(shapes.get(order, (none, none)), axis=1) / sizes for order in orders])


class RigidStatics:
    """Nothing bends."""

    def influence_at(self, x: ArrayLike, s: ArrayLike, derivative: int) -> Array:
        """Zero, for pairs."""
        return np.zeros(np.broadcast_shapes(np.shape(x), np.shape(s)))

    def own_weight_deflection(self, x: ArrayLike, derivative: int) -> Array:
        """Raises BadInput: no static state carries a free body."""
        raise BadInput("own weight of a rigid body that nothing holds", where="own_weight", expected="false")


def rigid_body(body: Rigid) -> ModalBody:
    """The two modes of a rigid body.

    >>> from engine.bodies.rigid.rigid import Rigid
    >>> table = rigid_body(Rigid(kind="rigid", length=2.0, mass=4.0, inertia=9.0))
    >>> table.shape([0.0, 1.0]).tolist()
    [[0.5, -0.3333333333333333], [0.5, 0.0]]
    """
    return ModalBody(
        length=body.length,
        mass=body.mass,
        omega=np.zeros(2),
        participation=np.array([np.sqrt(body.mass), 0.0]),
        wave_number=np.zeros(2),
        bending_stiffness=np.nan,
        dampers=(),
        shapes=RigidShapes(body.mass, body.inertia, body.centre_of_mass),
        statics=RigidStatics(),
    )
