"""Rigid bodies in space: torque-free tumbling in closed form, a chain of six joints by another Newton-Euler."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipkinc

from engine.kernels.floating.observe import BODY_ATTITUDE, BODY_SPIN
from engine.scene.study import Study
from results_schema.errors import BadInput
from studies.moving.parts import quaternions
from tests.floating.scenes import history, steps


def extrapolated(found: list[np.ndarray]) -> np.ndarray:
    """What marches with steps that double tend to, as their errors are of orders 2, 4 and so on."""
    order = 2
    while len(found) > 1:
        factor = 2.0**order
        found = [(factor * fine - coarse) / (factor - 1.0) for coarse, fine in pairwise(found)]
        order += 2
    return found[0]


def tumbling(inertia: np.ndarray, start: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Spin in its own axes and attitude of a body that nothing turns, at rest's axes at time 0 (Landau and Lifshitz,
    Mechanics, section 37): for I1 < I2 < I3 and M^2 > 2 E I2, all of the start positive."""
    I1, I2, I3 = inertia
    E2, M2 = start @ (inertia * start), (inertia * start) @ (inertia * start)
    M = np.sqrt(M2)
    size = np.sqrt(
        [
            (E2 * I3 - M2) / (I1 * (I3 - I1)),
            (E2 * I3 - M2) / (I2 * (I3 - I2)),
            (M2 - E2 * I1) / (I3 * (I3 - I1)),
        ]
    )
    m = (I2 - I1) * (E2 * I3 - M2) / ((I3 - I2) * (M2 - E2 * I1))
    rate = np.sqrt((I3 - I2) * (M2 - E2 * I1) / (I1 * I2 * I3))
    first = ellipkinc(np.arcsin(start[1] / size[1]), m)

    def spin(time: float) -> np.ndarray:
        sn, cn, dn, _ = ellipj(first + rate * time, m)
        return size * np.array([cn, sn, dn])

    def precession(time: float) -> float:
        w = spin(time)[:2]
        return float(M * (inertia[:2] * w) @ w / ((inertia[:2] * w) @ (inertia[:2] * w)))

    def attitude(time: float, turned: float) -> np.ndarray:
        """In axes of which the third is along the angular momentum, with Euler's angles."""
        L = inertia * spin(time) / M
        angles = [turned, np.arccos(L[2]), np.arctan2(L[0], L[1])]
        return np.asarray(Rotation.from_euler("ZXZ", angles).as_matrix())

    turned = quad(precession, 0.0, t, epsabs=1e-13, epsrel=1e-13, limit=200)[0]
    return spin(t), attitude(0.0, 0.0).T @ attitude(t, turned)


def test_torque_free_tumbling() -> None:
    """A rigid body in space near its middle axis, in closed form (Jacobi's elliptic functions); order 2."""
    inertia, start = np.array([1.0, 2.0, 3.0]), np.array([0.1, 1.5, 0.2])
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"hull": {"kind": "rigid", "length": 2.0, "mass": 5.0, "inertia": 1.0}},
        frame={"hull": {"inertia": list(inertia), "joints": [{"kind": "free", "rate": list(start)}]}},
    )
    spin, attitude = tumbling(inertia, start, 10.0)
    x, y, z, w = Rotation.from_matrix(attitude).as_quat(canonical=True)
    wanted = np.concatenate([[w, x, y, z], spin])
    found = []
    for count in (2000, 4000, 8000, 16000):
        model, marched = steps(study, 10.0, count, count)
        spin, attitude = (history(model, marched, "frames", *part)[-1] for part in ((BODY_SPIN, 3), (BODY_ATTITUDE, 9)))
        found.append(np.concatenate([quaternions(attitude), spin]))
    errors = [np.abs(one - wanted).max() for one in found]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.05)
    assert extrapolated(found) == pytest.approx(wanted, abs=1e-9)


def test_several_moments_of_inertia_stand_in_the_frame() -> None:
    body = {"hull": {"kind": "rigid", "length": 2.0, "mass": 5.0, "inertia": [1.0, 2.0, 3.0]}}
    with pytest.raises(BadInput, match=r"body\.hull\.inertia: several moments of inertia.*in \[frame.NAME\]"):
        Study(kind="moving-frames", body=body, frame={"hull": {"joints": [{"kind": "free"}]}})


class Chain:
    """Links in a row, each on one joint: places, axes, masses and inertias in a frame that stands still; forces are
    gathered about joints. Nothing of the program is used."""

    def __init__(self, links: int) -> None:
        draw = np.random.default_rng(5).uniform
        self.lengths, self.masses = draw(0.3, 0.8, links), draw(1.0, 3.0, links)
        self.centres = draw(0.2, 0.8, links) * self.lengths
        self.inertias = draw(0.03, 0.1, (links, 3)) + 0.05
        self.turned, self.axes = draw(-1.5, 1.5, (links, 3)), draw(-1.0, 1.0, (links, 3))
        self.axes /= np.linalg.norm(self.axes, axis=1)[:, None]
        self.slides = np.arange(links) == 3
        self.springs, self.dampers = np.zeros(links), np.zeros(links)
        self.springs[3], self.dampers[[1, 3]] = 60.0, (0.3, 2.0)
        self.start, self.rates = draw(-0.3, 0.3, links), draw(-1.0, 1.0, links)

    def study(self) -> Study:
        body, frame = {}, {}
        for k, length in enumerate(self.lengths):
            body[f"link{k}"] = {
                "kind": "rigid",
                "length": length,
                "mass": self.masses[k],
                "inertia": 1.0,
                "centre": self.centres[k],
                "own_weight": True,
            }
            joint = {
                "kind": "prismatic" if self.slides[k] else "revolute",
                "axis": list(self.axes[k]),
                "start": self.start[k],
                "rate": self.rates[k],
                "stiffness": self.springs[k],
                "damping": self.dampers[k],
            }
            held = {"on": f"link{k - 1}"} if k else {}
            own = {"inertia": list(self.inertias[k]), "turned": list(self.turned[k]), "joints": [joint]}
            frame[f"link{k}"] = held | own
        return Study(kind="moving-frames", gravity=9.81, body=body, frame=frame)

    def forces(self, y: np.ndarray, u: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What joints have to give for accelerations, by d'Alembert about each joint in turn; and the end's place."""
        R, p = np.eye(3), np.zeros(3)
        w, dw, v = np.zeros(3), np.zeros(3), np.array([0.0, 0.0, -9.81])  # v: acceleration less gravity
        at, axes, loads = [], [], []
        for k in range(y.size):
            R = R @ Rotation.from_rotvec(self.turned[k]).as_matrix()
            e = R @ self.axes[k]
            at.append(p)
            axes.append(e)
            if self.slides[k]:
                d = e * y[k]
                v = v + np.cross(dw, d) + np.cross(w, np.cross(w, d)) + 2.0 * u[k] * np.cross(w, e) + a[k] * e
                p = p + d
            else:
                dw = dw + a[k] * e + u[k] * np.cross(w, e)
                w = w + u[k] * e
                R = R @ Rotation.from_rotvec(self.axes[k] * y[k]).as_matrix()
            c = R[:, 0] * self.centres[k]
            F = self.masses[k] * (v + np.cross(dw, c) + np.cross(w, np.cross(w, c)))
            J = R @ np.diag(self.inertias[k]) @ R.T
            loads.append((p + c, F, J @ dw + np.cross(w, J @ w)))
            d = R[:, 0] * self.lengths[k]
            v = v + np.cross(dw, d) + np.cross(w, np.cross(w, d))
            p = p + d
        found = np.zeros(y.size)
        for k in range(y.size):
            force = sum(F for _, F, _ in loads[k:])
            torque = sum(T + np.cross(r - at[k], F) for r, F, T in loads[k:])
            found[k] = axes[k] @ (force if self.slides[k] else torque)
        return found, p

    def rates_of(self, _: float, state: np.ndarray) -> np.ndarray:
        y, u = np.split(state, 2)
        none = np.zeros(y.size)
        bias = self.forces(y, u, none)[0]
        M = np.stack([self.forces(y, u, e)[0] - bias for e in np.eye(y.size)], axis=1)
        given = -self.springs * y - self.dampers * u
        return np.concatenate([u, np.linalg.solve(M, given - bias)])


def test_a_chain_of_six_joints() -> None:
    """Skew joints, one of which slides on a spring, two damped: the end's place by another recursion and SciPy, to
    1e-9, the steps' error extrapolated away."""
    chain, duration = Chain(6), 0.2
    start = np.concatenate([chain.start, chain.rates])
    exact = solve_ivp(chain.rates_of, (0.0, duration), start, "DOP853", rtol=1e-12, atol=1e-12).y[:6, -1]
    wanted = chain.forces(exact, np.zeros(6), np.zeros(6))[1]
    ends = []
    for count in (500, 1000, 2000, 4000):
        model, marched = steps(chain.study(), duration, count, count)
        ends.append(history(model, marched, "ends", 15, 3)[-1])
    errors = [np.abs(end - wanted).max() for end in ends]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.1)
    assert extrapolated(ends) == pytest.approx(wanted, abs=1e-9)
