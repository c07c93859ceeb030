"""The equations of motion in space at a random state, beside particles over the ground.

python -m tests.floating.residual_twin, with kernels that are not compiled. A tree of two beams that bend in two planes
and stretch, on skew joints that turn, slide and turn freely; on them a carriage that slides and turns with its track,
and a sprung one that is driven. Particles have places r(y) over the ground; what is left of the equations is
sum m J^T (r'' - g) + K y + D u, with J from complex steps and r'' from differences along the path y + u t + a t^2/2. No
shape integral and no rotating frame appears. Then each term of the equations is switched off in turn: the two must not
agree any more.
"""

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import numpy as np

from engine.floating.lanes import in_blocks, lanes
from engine.floating.model import FloatingModel, build
from engine.kernels.floating import bodies, carriages, equations, following
from engine.kernels.floating.layout import Coordinates, Lane
from engine.kernels.floating.motions import motions_at
from engine.kernels.floating.work import room
from engine.kernels.layout import LANES
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from tests.floating.scenes import mutated

STEP, APART = 1e-30, 1e-2
AGREE, DIFFER = 1e-10, 1e-8  # of the largest inertia force

BEAM = {
    "kind": "beam",
    "area": 2e-3,
    "youngs_modulus": 7e9,
    "density": 2700.0,
    "supports": "pinned-pinned",
    "damping_ratio": 0.03,
    "own_weight": True,
}
UPPER = BEAM | {"length": 3.0, "second_moment": 3e-6, "modes": 2}
LOWER = BEAM | {"length": 2.0, "second_moment": 2e-6, "modes": 2}
AXIS = np.array([0.2, 1.0, -0.3])
TURNED, LOWER_TURNED, AT, SLIDE = (0.3, -0.2, 0.5), (-0.4, 0.7, 0.1), 2.1, np.array([0.1, 0.3, 1.0])
HALVES = np.array([0.3, 0.2, 0.1])  # m, of the six particles that are the carriage
MASS, HEIGHT, GRAVITY = 8.0, -0.4, 9.81


def study() -> Study:
    """The scene."""
    squares = MASS / 3.0 * HALVES**2
    cart = {
        "kind": "mass",
        "on": "upper",
        "mass": MASS,
        "inertia": list(squares.sum() - squares),
        "height": HEIGHT,
        "motion": {"kind": "free", "start": 1.3},
    }
    trolley = {"kind": "oscillator", "on": "lower", "mass": 3.0, "wheel_mass": 1.5, "stiffness": 900.0, "damping": 20.0}
    revolute = {"kind": "revolute", "axis": list(AXIS), "stiffness": 50.0, "damping": 3.0}
    prismatic = {"kind": "prismatic", "axis": list(SLIDE), "stiffness": 700.0, "damping": 5.0}
    return Study(
        kind="moving-frames",
        gravity=GRAVITY,
        body={"upper": UPPER, "lower": LOWER},
        frame={
            "upper": {
                "position": [0.5, -0.2, 0.1],
                "turned": list(TURNED),
                "joints": [revolute],
                "lateral_second_moment": 4e-6,
                "lateral_modes": 1,
                "axial_modes": 1,
            },
            "lower": {
                "on": "upper",
                "at": AT,
                "turned": list(LOWER_TURNED),
                "joints": [prismatic, {"kind": "spherical"}],
            },
        },
        carriage={
            "cart": cart,
            "trolley": trolley | {"motion": {"kind": "cruise", "start": 0.4, "end": 1.9, "speed": 0.7}},
        },
        question={"duration": 1.0},
        solver={"static_correction": False},  # `fields` are of modes alone
    )


def turn(t: np.ndarray) -> np.ndarray:
    """exp of a rotation vector, also a complex one (Rodrigues)."""
    x = t @ t
    angle = np.sqrt(x + 0j)
    a, b = (np.sin(angle) / angle, (1.0 - np.cos(angle)) / x) if abs(x) > 1e-16 else (1.0, 0.5)
    K = np.array([[0.0 * x, -t[2], t[1]], [t[2], 0.0 * x, -t[0]], [-t[1], t[0], 0.0 * x]])
    return np.eye(3) + a * K + b * K @ K


def fields(s: np.ndarray, body: dict, q: np.ndarray, lateral: int, axial: int) -> tuple[np.ndarray, np.ndarray]:
    """Displacements and rotation vectors (S, 3) of a pinned beam: its modes along z, y, x in this order."""
    length, n = body["length"], body["modes"]
    scale = np.sqrt(2.0 / (body["density"] * body["area"] * length))

    def sines(count: int, shift: float) -> tuple[np.ndarray, np.ndarray]:
        k = (np.arange(1, count + 1) - shift) * np.pi / length
        return scale * np.sin(np.multiply.outer(s, k)), scale * k * np.cos(np.multiply.outer(s, k))

    w, dw = (part @ q[:n] for part in sines(n, 0.0))
    v, dv = (part @ q[n : n + lateral] for part in sines(lateral, 0.0))
    u, _ = (part @ q[n + lateral : n + lateral + axial] for part in sines(axial, 0.5))
    return np.stack([u, v, w], axis=1), np.stack([0.0 * w, -dw, dv], axis=1)


def particles(y: np.ndarray, trolley: complex) -> tuple[np.ndarray, np.ndarray]:
    """Places (P, 3) and masses; y: angle, four modes, slide, three of the spherical joint, two modes, places of the
    cart and of the sprung mass; trolley: its place."""
    x, dm = np.polynomial.legendre.leggauss(40)
    R = turn(np.array(TURNED)) @ turn(AXIS / np.linalg.norm(AXIS) * y[0])
    r = np.array([0.5, -0.2, 0.1])

    def along(body: dict, q: np.ndarray, lateral: int, axial: int, places: np.ndarray) -> np.ndarray:
        moved, _ = fields(places, body, q, lateral, axial)
        return moved + np.multiply.outer(places, np.array([1.0, 0.0, 0.0]))

    def whole(body: dict) -> tuple[np.ndarray, np.ndarray]:
        mass = body["density"] * body["area"] * body["length"]
        return 0.5 * body["length"] * (x + 1.0), 0.5 * mass * dm

    q1, q2 = y[1:5], y[9:11]
    places, masses = whole(UPPER)
    found, weights = [r + along(UPPER, q1, 1, 1, places) @ R.T], [masses]
    E = turn(fields(y[11:12], UPPER, q1, 1, 1)[1][0])
    middle = along(UPPER, q1, 1, 1, y[11:12])[0] + E @ np.array([0.0, 0.0, HEIGHT])
    corners = np.concatenate([np.diag(HALVES), -np.diag(HALVES)])
    found.append(r + (middle + corners @ E.T) @ R.T)
    weights.append(np.full(6, MASS / 6.0))
    hung = np.array([AT + 0j])
    held = turn(fields(hung, UPPER, q1, 1, 1)[1][0])
    r2 = r + R @ along(UPPER, q1, 1, 1, hung)[0]
    R2 = R @ held @ turn(np.array(LOWER_TURNED))
    r2, R2 = r2 + R2 @ (SLIDE / np.linalg.norm(SLIDE) * y[5]), R2 @ turn(y[6:9])
    places, masses = whole(LOWER)
    found.append(r2 + along(LOWER, q2, 0, 0, places) @ R2.T)
    weights.append(masses)
    wheel = along(LOWER, q2, 0, 0, np.array([trolley]))
    sprung = wheel + np.array([0.0, 0.0, 1.0]) * y[12]
    found += [r2 + wheel @ R2.T, r2 + sprung @ R2.T]
    weights += [np.array([1.5]), np.array([3.0])]
    return np.concatenate(found), np.concatenate(weights)


def left_of_particles(
    model: FloatingModel, y: np.ndarray, u: np.ndarray, a: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Inertia less weight, and springs and dampers, by particles; together what is left of the equations."""
    at, speed = 0.4, 0.7

    def path(t: float) -> np.ndarray:
        return particles(y + u * t + 0.5 * a * t * t + 0j, at + speed * t)[0].real

    masses = particles(y + 0j, at)[1]
    h = APART
    # sixth order: the coefficients of a second difference over seven places
    weights = {0: -49.0 / 18.0, 1: 1.5, 2: -0.15, 3: 1.0 / 90.0}
    acceleration = weights[0] * path(0.0) + sum(weights[k] * (path(k * h) + path(-k * h)) for k in (1, 2, 3))
    acceleration = acceleration / h**2 - np.array([0.0, 0.0, GRAVITY])
    J = np.stack([particles(y + 1j * STEP * e, at)[0].imag / STEP for e in np.eye(y.size)], axis=-1)
    left = np.einsum("p,pan,pa->n", masses, J, acceleration)
    stiffness, damping = np.zeros(y.size), np.zeros(y.size)
    for name in ("upper", "lower"):
        omega = model.bodies[name].omega
        modes = slice(model.first[name], model.first[name] + omega.size)
        stiffness[modes], damping[modes] = omega**2, 0.06 * omega
    for k, stiff, damp in ((0, 50.0, 3.0), (5, 700.0, 5.0), (12, 900.0, 20.0)):
        stiffness[k], damping[k] = stiff, damp
    return left, stiffness * y + damping * u


def left_of(module: ModuleType, model: FloatingModel, y: np.ndarray, u: np.ndarray, a: np.ndarray) -> np.ndarray:
    """What is left of the equations, by the kernels of a module, in the second lane; others stand elsewhere."""
    table = lanes(model, VariantValues(model.study, {}, 1), np.ones(1))
    lane = Lane(*(in_blocks(part)[0] for part in table))
    work, out = room(model.system, lane), np.zeros((y.size, LANES))
    now = np.zeros(LANES)
    motions_at(lane.motions, now, now, work.piece, work.motions)
    scaled = np.arange(LANES, dtype=np.float64)
    x = Coordinates(*(np.multiply.outer(part, scaled) for part in (y, u, a)))
    x.y[11] = y[11]  # on the track
    module.residual(model.system, lane, x, work, out)
    return out[:, 1]


#: Terms of the equations, by their text in the kernel, and what stands there without them.
TERMS = {
    # of a body, (9)
    "m a": ("add(times(system.bodies[b, MASS], acc), add(cross(al, S)", "add(no_vector(), add(cross(al, S)"),
    "al x S": ("add(cross(al, S), cross(w, cross(w, S)))", "cross(w, cross(w, S))"),
    "w x (w x S)": ("add(cross(al, S), cross(w, cross(w, S)))", "cross(al, S)"),
    "2 w x sum t q'": ("times(2.0, cross(w, drift))", "no_vector()"),
    "sum t q''": ("cross(w, drift)), push)", "cross(w, drift)), no_vector())"),
    "S x a": ("add(cross(S, acc), Jal)", "Jal"),
    "J al": ("add(cross(S, acc), Jal)", "cross(S, acc)"),
    "w x J w": (", cross(w, Jw))", ", no_vector())"),
    "sum ax(H) q''": ("times(dda, axial(H))", "no_vector()"),
    "2 (w tr N - N^T w)": ("times(2.0 * du, add(", "times(0.0 * du, add("),
    "J, linear in q": ("yy = yy + q * (H[1][1] + F[1][1])", "pass"),
    "H, linear in q": ("q = lanes_at(x.y, (first + j,))", "q = 0.0"),
    "t . a": ("dot(shared_vector(system.modes, row, TRANSLATION), acc) + dot(axial(H)", "dot(axial(H)"),
    "ax(H) . al": (" + dot(axial(H), al)", ""),
    "w . H w": (" + dot(w, turned_out(H, w))", ""),
    "tr(H) w . w": (" - (H[0][0] + H[1][1] + H[2][2]) * square", ""),
    "2 w . sum ax(H_ji) q_j'": ("2.0 * dot(w, axial(B)) * lanes_at(x.u, (first + j,))", "0.0"),
    "M q''": (" + (B[0][0] + B[1][1] + B[2][2]) * lanes_at(x.a, (first + j,))", ""),
    "K q": ("r = r + stiffness * lanes_at(x.y, (first + j,))", "pass"),
    "D q'": ("lanes_at(lane.damping, (row,)) * lanes_at(x.u, (first + i,)) - (H", "-(H"),
    # of what moves on it, (11)-(20)
    "al x d": ("add(acc, add(cross(al, d), ", "add(acc, add(no_vector(), "),
    "w x (w x d)": ("add(acc, add(cross(al, d), cross(w, cross(w, d))))", "add(acc, cross(al, d))"),
    "2 w x d'": ("return add(acc, times(2.0, cross(w, rate)))", "return acc"),
    "J_T s'": ("times(ds, tangent))\n    change", "no_vector())\n    change"),
    "phi q''": ("add(combined_there(at, SHAPE, n, x.a, first), times(2.0 * ds", "add(no_vector(), times(2.0 * ds"),
    "2 phi' q' s'": ("times(2.0 * ds, combined_there(at, SLOPE, n, x.u, first))", "no_vector()"),
    "phi'' q s'^2": ("times(ds * ds, combined_there(at, CURVE, n, x.y, first))", "no_vector()"),
    "(I + J_T) s''": ("times(dds, tangent)))", "no_vector()))"),
    "psi q''": ("ddt = combined_there(at, TURN, n, x.a, first)", "ddt = no_vector()"),
    "2 psi' q' s'": ("times(2.0 * ds, combined_there(at, TURN_SLOPE, n, x.u, first))", "no_vector()"),
    "psi'' q s'^2": ("times(ds * ds, combined_there(at, TURN_CURVE, n, x.y, first))", "no_vector()"),
    "J_R s''": ("times(dds, slope)))", "no_vector()))"),
    "w x w_s": ("own_change), cross(w, own))", "own_change), no_vector())"),
    "w_s x I w_s": (", cross(whole, inertia_times(E, lane, c, whole)))", ", no_vector())"),
    # back on the body, (21)
    "f on the frame": ("    add_vector(work.frames, b, FORCE, f)\n", ""),
    "d x f on the frame": ("    add_vector(work.frames, b, TORQUE, cross(d, f))\n", ""),
    "torque on the frame": ("        add_vector(work.frames, b, TORQUE, about)\n", ""),
    "phi^T f": ("add_to(out, first + i, dot(vector(work.modes, i, SHAPE), f))", "pass"),
    "psi^T t": ("add_to(out, first + i, dot(spin_of(t, vector(at, i, TURN)), about))", "pass"),
    "tangent . f": ("dot(tangent, f) - along_track", "-along_track"),
    "psi' q . t": ("add_to(out, k, dot(spin_of(t, combined_there(at, TURN_SLOPE, n, x.y, first)), about))", "pass"),
    "sprung mass": ("add_to(out, z, own_force[2] + ", "add_to(out, z, "),
    # through joints
    "phi^T F where a body hangs": ("dot(shared_vector(system.modes, row + i, HANGING_SHAPE), F) + ", ""),
    "psi^T T where a body hangs": (" + dot(turning, T)", ""),
    "spring of a joint": (" + stiffness * value", ""),
    "damper of a joint": (" + damping * rate", ""),
}


def state(model: FloatingModel, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random coordinates, velocities and accelerations; the spherical joint stands where its step begins."""
    draw: Callable[..., np.ndarray] = np.random.default_rng(seed).normal
    y, u, a = 0.2 * draw(size=model.size), 0.5 * draw(size=model.size), draw(size=model.size)
    y[6:9], y[11] = 0.0, 1.3
    return y, u, a


def main() -> None:
    model = build(study())
    lower = model.bodies["lower"]
    # particles along a line have no inertia about it
    model.bodies["lower"] = replace(lower, own_inertia=np.zeros(3))
    assert model.size == 13
    for seed in range(3):
        y, u, a = state(model, seed)
        inertia, springs = left_of_particles(model, y, u, a)
        wanted, largest = inertia + springs, np.abs(inertia).max()
        found = left_of(equations, model, y, u, a)
        gap = np.abs(found - wanted).max() / largest
        print(f"state {seed}: {gap:.1e}")
        assert gap < AGREE, (found, wanted)
    for name, (old, new) in TERMS.items():
        gap = (
            np.abs(left_of(mutated(equations, old, new, following, bodies, carriages), model, y, u, a) - wanted).max()
            / largest
        )
        print(f"without {name}: {gap:.1e}")
        assert gap > DIFFER, name


if __name__ == "__main__":
    main()
