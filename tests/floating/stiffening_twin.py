"""What displacements of second order add to the equations, beside particles that they move.

python -m tests.floating.stiffening_twin, with kernels that are not compiled. On the tree of `loads_twin` every place of
a track comes nearer by half of int (v'^2 + w'^2), times numbers of its own along each axis. The equations have it to
first order in the elastic coordinates, so that these are small here, and what it adds is compared, not the whole. A
portal, whose mass lies beside its track, turns freely. Then each term is switched off in turn.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from engine.floating.bodies.frame_shortening import FrameShortening
from engine.floating.bodies.shortening import BeamShortening
from engine.floating.model import FloatingModel, build
from engine.kernels.floating import bodies, carriages, equations, following, loads, tracks
from engine.scene.study import Study
from results_schema.arrays import Array
from tests.floating import loads_twin, residual_twin
from tests.floating.bodies.test_frames_of_beams import PORTAL, study
from tests.floating.scenes import mutated

ELASTIC = [1, 2, 3, 4, 9, 10, 12]  # what is sprung too
SMALL, AGREE, DIFFER = 1e-4, 2e-4, 2e-3  # deflections; of the largest addition
ALONG = np.array([1.0, 0.4, -0.7])  # the axes along which places come nearer
ROUNDING = 1e-9  # of the largest addition to a portal
Fields = Callable[..., tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Skewed(BeamShortening):
    """A beam's, along three axes."""

    axes: int = 3

    def along(self, x: Array) -> Array:
        return np.multiply.outer(ALONG, super().along(x)[:, :, 0]).transpose(1, 2, 0, 3, 4)

    @cached_property
    def integrals(self) -> tuple[Array, Array]:
        whole, moments = super().integrals
        return np.multiply.outer(ALONG, whole[0]), np.multiply.outer(ALONG, moments[0])


def shortened(bare: Fields) -> Fields:
    """Displacements and rotations of a beam whose places come nearer as it bends."""
    nodes, weights = np.polynomial.legendre.leggauss(12)

    def fields(s: np.ndarray, *body: object) -> tuple[np.ndarray, np.ndarray]:
        moved, turned = bare(s, *body)
        for place, d in zip(s, moved, strict=True):
            slopes = bare(0.5 * place * (nodes + 1.0), *body)[1][:, 1:]
            d -= 0.5 * ALONG * ((0.5 * place * weights) @ (slopes**2).sum(axis=1))
        return moved, turned

    return fields


def whole(model: FloatingModel, y: np.ndarray, u: np.ndarray, a: np.ndarray) -> np.ndarray:
    """What is left of the equations, by particles and virtual work."""
    inertia, springs = residual_twin.left_of_particles(model, y, u, a)
    return inertia + springs - loads_twin.of_loads(y) - loads_twin.of_springs(y, u)


def stiff(study: Study) -> FloatingModel:
    """The tree with tracks that come nearer along three axes."""
    model = build(study.with_values({"frame.upper.stiffening": True, "frame.lower.stiffening": True}))
    for name, body in model.bodies.items():
        assert isinstance(body.shortening, BeamShortening)
        skewed = Skewed(body.shortening.fields, body.shortening.places, body.shortening.masses)
        model.bodies[name] = replace(body, shortening=skewed)
    return model


#: Terms by their text in the equations, or in what these call, and what stands there without them.
TERMS = {
    "turning": (" - turned_nearer(system, b, pair, turning)", ""),
    "acceleration": (" - pulled(system, b, pair, acc)", ""),
    "acceleration along y": (" + system.pairs[pair, NEARING + 1] * acc[1]", ""),
    "acceleration along z": (" + system.pairs[pair, NEARING + 2] * acc[2]", ""),
    "under a carriage": ("pulled = -1.0 * pulled_nearer(", "pulled = -0.0 * pulled_nearer("),
    "under a carriage, twice": (
        "            if i != j:\n                add_to(out, j, pulled",
        "            if False:\n                add_to(out, j, pulled",
    ),
    "under a carriage, along y": ("part = pull[1]", "part = 0.0 * pull[1]"),
    "under a carriage, along z": ("part = pull[2]", "part = 0.0 * pull[2]"),
    "where a body hangs": ("-1.0 * shorter_by(system.hanging_shorter", "-0.0 * shorter_by(system.hanging_shorter"),
    "under a load": ("r = r - shorter_by(", "r = r - 0.0 * shorter_by("),
    "what hangs or acts, along y": ("table[place, 1, i, j] * f[1]", "0.0"),
    "what hangs or acts, along z": ("table[place, 2, i, j] * f[2]", "0.0"),
}
#: Of a body whose mass lies beside its track.
TURNING = {
    "x by y": ("moment[0][1] * turning[0][1]", "0.0"),
    "x by z": ("moment[0][2] * turning[0][2]", "0.0"),
    "y": (" + dot(moment[1], turning[1])", ""),
    "z": (" + dot(moment[2], turning[2])", ""),
}


def left_of(model: FloatingModel, state: tuple[np.ndarray, ...], old: str = "", new: str = "") -> np.ndarray:
    """What is left of the equations, by kernels of another text."""
    below = (tracks, following, bodies, carriages, loads)
    return residual_twin.left_of(mutated(equations, old, new, *below) if old else equations, model, *state)


def of_tree() -> None:
    bare_study = loads_twin.study()
    model, stiffened = build(bare_study), stiff(bare_study)
    state = residual_twin.state(model, 4)
    for part in state:
        part[ELASTIC] *= SMALL
    bare = residual_twin.fields
    without = whole(model, *state)
    residual_twin.fields = shortened(bare)  # type: ignore[assignment]
    wanted = whole(model, *state) - without
    residual_twin.fields = bare
    compare(wanted, left_of(model, state), stiffened, state, TERMS, (AGREE, DIFFER))


def of_portal() -> None:
    """It turns about its track's beginning: its mass, accelerated as far as it is undeformed, does work on G q."""
    frame = {"joints": [{"kind": "spherical"}]}
    model, stiffened = (build(study(PORTAL | {"modes": 10}, frame | {"stiffening": on})) for on in (False, True))
    rng = np.random.default_rng(2)
    state = tuple(scale * rng.normal(size=model.size) for scale in (1e-3, 1.0, 1.0))
    state[0][:3] = 0.0
    w, al, q = state[1][:3], state[2][:3], state[0][3:]
    own, wanted = stiffened.bodies["portal"].shortening, np.zeros(model.size)
    assert isinstance(own, FrameShortening)
    for places, masses, G in own.weighed():
        c = places - own.origin
        acceleration = np.array([0.0, 0.0, -9.81]) + np.cross(al, c) + np.cross(w, np.cross(w, c))
        wanted[3:] -= np.einsum("g,ga,gaij,j->i", masses, acceleration, own.pairs.symmetric(G), q)
    compare(wanted, left_of(model, state), stiffened, state, TURNING, (ROUNDING, DIFFER))


def compare(
    wanted: np.ndarray,
    without: np.ndarray,
    model: FloatingModel,
    state: tuple[np.ndarray, ...],
    terms: dict[str, tuple[str, str]],
    bounds: tuple[float, float],
) -> None:
    """What a model adds, with all terms, and without each."""

    def gap(*text: str) -> float:
        return float(np.abs(left_of(model, state, *text) - without - wanted).max() / np.abs(wanted).max())

    agree, differ = bounds
    print(f"added: {gap():.1e}")
    assert gap() < agree
    for name, text in terms.items():
        off = gap(*text)
        print(f"without {name}: {off:.1e}")
        assert off > differ, name


def main() -> None:
    of_tree()
    of_portal()


if __name__ == "__main__":
    main()
