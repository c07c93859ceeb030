"""Loads and springs in space at a random state, beside virtual work of places over the ground.

python -m tests.floating.loads_twin, with kernels that are not compiled. On the tree of `residual_twin` forces and
torques act at places and along parts, in the axes of the ground and of bodies; springs with dampers join the two bodies
and the ground. A force does the work f . J u at its place, J by complex steps; a torque that of the spin of the track
there; a spring has an energy. Then each term is switched off in turn.
"""

import numpy as np

from engine.floating.model import build
from engine.kernels.floating import equations, loads
from engine.scene.study import Study
from tests.floating import residual_twin as twin
from tests.floating.scenes import mutated

AGREE, DIFFER = 1e-11, 1e-7  # of the largest force
COURSE, FREE_LENGTH = 0.7, 0.4
LOADS = {
    "still": {"on": "upper", "at": 1.1, "force": [3.0, -20.0, 11.0], "torque": [1.0, 2.0, -3.0]},
    "own": {"on": "lower", "force": [5.0, 4.0, -7.0], "torque": [2.0, -1.0, 0.5], "axes": "body"},
    "wind": {"on": "upper", "between": [0.5, 2.5], "force_per_metre": [1.0, 6.0, 2.0]},
    "swirl": {"on": "upper", "between": [1.0, 3.0], "torque_per_metre": [0.3, -2.0, 1.0], "axes": "body"},
    "ramp": {
        "on": "lower",
        "at": 0.6,
        "force": [2.0, 9.0, 4.0],
        "course": {"kind": "steady", "start": COURSE, "rate": 2},
    },
}
SPRINGS = {
    "across": {"ends": [{"on": "upper", "at": 0.8}, {"on": "lower", "at": 1.5}], "stiffness": 80.0, "damping": 6.0},
    "down": {"ends": [{"position": [0.4, 1.0, 2.0]}, {"on": "lower"}], "stiffness": 50.0, "damping": 3.0},
}


def study() -> Study:
    """The tree with loads and springs."""
    data = {key: value for key, value in twin.study().data.items() if key != "schema_version"}
    springs = {name: spring | {"length": FREE_LENGTH} for name, spring in SPRINGS.items()}
    return Study(**(data | {"load": LOADS, "spring": springs}))


def place(y: np.ndarray, body: str, x: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A place of a body over the ground, the attitude of its frame and that of the track there."""
    R = twin.turn(np.array(twin.TURNED)) @ twin.turn(twin.AXIS / np.linalg.norm(twin.AXIS) * y[0])
    r = np.array([0.5, -0.2, 0.1])

    def along(beam: dict, q: np.ndarray, parts: tuple[int, int], at: float) -> tuple[np.ndarray, np.ndarray]:
        moved, turned = twin.fields(np.array([at + 0j]), beam, q, *parts)
        return moved[0] + np.array([at, 0.0, 0.0]), twin.turn(turned[0])

    if body == "lower":
        d, E = along(twin.UPPER, y[1:5], (1, 1), twin.AT)
        r, R = r + R @ d, R @ E @ twin.turn(np.array(twin.LOWER_TURNED))
        r, R = r + R @ (twin.SLIDE / np.linalg.norm(twin.SLIDE) * y[5]), R @ twin.turn(y[6:9])
        d, E = along(twin.LOWER, y[9:11], (0, 0), x)
    else:
        d, E = along(twin.UPPER, y[1:5], (1, 1), x)
    return r + R @ d, R, R @ E


def steps_of(y: np.ndarray) -> list[np.ndarray]:
    """Complex steps along every coordinate."""
    return [y + 1j * twin.STEP * e for e in np.eye(y.size)]


def of_force(y: np.ndarray, body: str, x: float, f: np.ndarray) -> np.ndarray:
    """(N,) generalised forces of a force over the ground."""
    return np.array([place(step, body, x)[0].imag @ f for step in steps_of(y)]) / twin.STEP


def of_torque(y: np.ndarray, body: str, x: float, torque: np.ndarray) -> np.ndarray:
    """(N,) generalised forces of a torque over the ground: dE E^T is the turning."""
    E = place(y + 0j, body, x)[2].real
    found = []
    for step in steps_of(y):
        W = place(step, body, x)[2].imag / twin.STEP @ E.T
        found.append(np.array([W[2, 1], W[0, 2], W[1, 0]]) @ torque)
    return np.array(found)


def of_loads(y: np.ndarray) -> np.ndarray:
    """(N,) generalised forces of all loads, those along parts by Gauss."""
    found = np.zeros(y.size)
    for load in LOADS.values():
        body, length = str(load["on"]), {"upper": 3.0, "lower": 2.0}[str(load["on"])]
        start, end = load.get("between", (load.get("at", length),) * 2)
        half = 0.5 * (end - start)
        nodes, weights = np.polynomial.legendre.leggauss(30)
        places = np.stack([start + half * (nodes + 1.0), half * weights], axis=1)
        R = place(y + 0j, body, 0.0)[1].real if load.get("axes") == "body" else np.eye(3)
        scale = COURSE if "course" in load else 1.0
        for x, weight in places if half else [(start, 1.0)]:
            for key, work in (("force", of_force), ("torque", of_torque)):
                for word in (key, f"{key}_per_metre"):
                    found += weight * scale * work(y, body, x, R @ np.array(load.get(word, [0.0] * 3)))
    return found


def of_springs(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """(N,) generalised forces of all springs by their energy, and of their dampers."""

    def length(state: np.ndarray, ends: list[dict]) -> complex:
        one, other = (
            np.array(end["position"]) if "position" in end else place(state, end["on"], end.get("at", 2.0))[0]
            for end in ends
        )
        return np.sqrt((one - other) @ (one - other))

    found = np.zeros(y.size)
    for spring in SPRINGS.values():
        rate = np.array([length(step, spring["ends"]).imag for step in steps_of(y)]) / twin.STEP
        longer = length(y + 0j, spring["ends"]).real - FREE_LENGTH
        found -= (spring["stiffness"] * longer + spring["damping"] * (rate @ u)) * rate
    return found


#: Terms of the loads, by their text in the kernel, and what stands there without them.
TERMS = {
    "axes of the ground": ("f, about = turned_in(E, f), turned_in(E, about)", "pass"),
    "course": ("f, about = times(factor, f), times(factor, about)", "pass"),
    "force on the frame": ("    add_vector(work.frames, b, FORCE, times(-system.grips[p, WEIGHT], f))\n", ""),
    "d x f on the frame": ("times(-1.0, cross(arm(system, p, x), f))", "no_vector()"),
    "phi in d": (
        "d = add(combined(system.grip_modes, row, PUSHED, n, x.y, first), shared_vector(",
        "d = add(no_vector(), shared_vector(",
    ),
    "phi^T f": ("r = dot(shared_vector(system.grip_modes, p * widest + i, PUSHED), f)", "r = no_vector()[0]"),
    "torque on the frame": ("    add_vector(work.frames, b, TORQUE, times(-weight, about))\n", ""),
    "psi^T t": ("add_to(out, first + i, -weight * dot(turning, about))", "pass"),
    "psi q in psi": (
        "turning = spin_of(t, shared_vector(system.grip_modes, row + i, TWISTED))",
        "turning = shared_vector(system.grip_modes, row + i, TWISTED)",
    ),
    "weight of a torque": (
        "b, row, weight = system.gripped[p], p * system.track.shape[4], system.grips[p, WEIGHT]",
        "b, row, weight = system.gripped[p], p * system.track.shape[4], 1.0",
    ),
    "spring": ("pull = lanes_at(lane.links, (k, 0)) * (length - lanes_at(lane.links, (k, 2)))", "pull = 0.0"),
    "free length": ("(length - lanes_at(lane.links, (k, 2)))", "length"),
    "damper": (" + lanes_at(lane.links, (k, 1)) * dot(e, drift)", ""),
    "w x d of a spring's end": ("add(cross(vector(work.frames, b, SPIN), d), rate)", "rate"),
    "phi q' of a spring's end": (
        "add(cross(vector(work.frames, b, SPIN), d), rate)",
        "cross(vector(work.frames, b, SPIN), d)",
    ),
    "the other end of a spring": ("own if end == 0 else times(-1.0, own)", "own if end == 0 else times(0.0, own)"),
}


def main() -> None:
    with_loads, without = build(study()), build(twin.study())
    for seed in range(3):
        y, u, a = twin.state(without, seed)
        bare = twin.left_of(equations, without, y, u, a)
        wanted = -of_loads(y) - of_springs(y, u)
        found = twin.left_of(equations, with_loads, y, u, a) - bare
        gap = np.abs(found - wanted).max() / np.abs(wanted).max()
        print(f"state {seed}: {gap:.1e}")
        assert gap < AGREE, (found, wanted)
    for name, (old, new) in TERMS.items():
        found = twin.left_of(mutated(equations, old, new, loads), with_loads, y, u, a) - bare
        gap = np.abs(found - wanted).max() / np.abs(wanted).max()
        print(f"without {name}: {gap:.1e}")
        assert gap > DIFFER, name


if __name__ == "__main__":
    main()
