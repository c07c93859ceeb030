"""A second derivation of a beam in a moving frame with a mass that slides on it, in a plane: particles over the ground.

Every particle's place r(y) is written down; its velocity is J u with J = dr/dy, so that Lagrange's equations are
sum m J^T (J u' + dJ/dt u) = sum m J^T g - K y - D u. J comes from complex steps, dJ/dt u from a difference along u.
No shape integral, no rotating frame, no term of (9) or (20) appears; SciPy solves the equations.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

STEP, APART = 1e-30, 1e-4


@dataclass(frozen=True)
class Particles:
    """places: y (N,) -> (P, 2) m over the ground, x and z (down); masses (P,) kg; stiffness, damping (N,) of
    coordinates; gravity along z, m/s2. given: t -> value, rate and acceleration of coordinates (by number) whose
    motion is given."""

    places: Callable[[np.ndarray], np.ndarray]
    masses: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    gravity: float
    given: dict[int, Callable[[float], tuple[float, float, float]]]

    def jacobian(self, y: np.ndarray) -> np.ndarray:
        """(P, 2, N)."""
        columns = [self.places(y + 1j * STEP * e).imag / STEP for e in np.eye(y.size)]
        return np.stack(columns, axis=-1)

    def accelerations(self, t: float, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """(N,) of all coordinates."""
        J = self.jacobian(y)
        ahead, back = self.jacobian(y + APART * u), self.jacobian(y - APART * u)
        bent = np.einsum("pan,n->pa", ahead - back, u) / (2.0 * APART)
        force = np.einsum("p,pan,pa->n", self.masses, J, np.array([0.0, self.gravity]) - bent)
        force -= self.stiffness * y + self.damping * u
        M = np.einsum("p,pan,pam->nm", self.masses, J, J)
        found = np.zeros(y.size)
        for k, motion in self.given.items():
            found[k] = motion(t)[2]
        free = [k for k in range(y.size) if k not in self.given]
        found[free] = np.linalg.solve(M[np.ix_(free, free)], (force - M @ found)[free])
        return found

    def march(self, y: np.ndarray, u: np.ndarray, times: np.ndarray) -> np.ndarray:
        """(T, N) coordinates at times."""
        N = y.size

        def rates(t: float, state: np.ndarray) -> np.ndarray:
            place, speed = state[:N].copy(), state[N:].copy()
            for k, motion in self.given.items():
                place[k], speed[k], _ = motion(t)
            return np.concatenate([speed, self.accelerations(t, place, speed)])

        found = solve_ivp(rates, (0.0, times[-1]), np.concatenate([y, u]), "DOP853", times, rtol=1e-10, atol=1e-12)
        assert found.success
        return found.y[:N].T


def beam_in_plane(
    wave: Callable[[np.ndarray], np.ndarray], x: np.ndarray, dm: np.ndarray, mass: float, modes: int
) -> tuple[Callable[[np.ndarray], np.ndarray], np.ndarray]:
    """Places of a beam's particles at x with masses dm, and of a mass that slides on it; y = (x, z, angle about y,
    modes, place of the mass). wave: complex places (S,) -> (S, modes)."""
    shapes = wave(x)

    def places(y: np.ndarray) -> np.ndarray:
        along = np.concatenate([x.astype(y.dtype), y[-1:]])
        across = np.concatenate([shapes @ y[3 : 3 + modes], wave(y[-1:]) @ y[3 : 3 + modes]])
        c, s = np.cos(y[2]), np.sin(y[2])
        return np.stack([y[0] + c * along + s * across, y[1] - s * along + c * across], axis=1)

    return places, np.append(dm, mass)
