"""What drives exert by recursive Newton-Euler, for any motion of an arm whose rail does not bend."""

from __future__ import annotations

import numpy as np

from engine.kernels.jit import kernel
from engine.kernels.robots.chain import STILL, driven, follow
from engine.kernels.robots.layout import ACTUAL, COLUMNS, PUSH, VALUE
from engine.robots.model import chain_of
from engine.scene.robots import Arm


def drive_forces(arm: Arm, joints: np.ndarray, gravity: float, payload: float = 0.0) -> np.ndarray:
    """(S, J) N and N m. joints (S, J, 3): values, rates, accelerations, that along the rail first; gravity m/s2;
    payload: kg at the tool."""
    chain = chain_of(arm, len(arm.drives))
    return np.asarray(inverse_dynamics(chain, np.array(arm.tool), payload, gravity, joints))


@kernel
def inverse_dynamics(chain, tool, payload, gravity, joints):
    """(S, J) what drives exert at S stations of joints (S, J, 3): values, rates, accelerations; on a base that does not
    move but along x, by joint 0."""
    S, J = joints.shape[:2]
    found, links, still = np.zeros((S, J)), np.zeros((J, COLUMNS)), (0.0, 0.0, 0.0)
    for n in range(S):
        links[:, ACTUAL : ACTUAL + 3] = joints[n]
        place = (joints[n, 0, VALUE], 0.0, 0.0)
        base = place, STILL, still, (joints[n, 0, PUSH], 0.0, gravity), still
        force, _, _ = follow(chain, J, base, payload, (tool[0], tool[1], tool[2]), links, ACTUAL)
        found[n, 0] = force[0]
        for j in range(1, J):
            found[n, j] = driven(chain, j, links, place)
    return found
