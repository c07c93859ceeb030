"""What the foreshortening of bent tracks adds to the equations, beside particles that it moves.

python -m tests.floating.stiffening_twin, with kernels that are not compiled. On the tree of `loads_twin` every place of
a track comes nearer to its beginning by half of int (v'^2 + w'^2). The equations have it to first order in the elastic
coordinates, so that these are small here, and what it adds is compared, not the whole. Then each term is switched off
in turn.
"""

from collections.abc import Callable

import numpy as np

from engine.floating.model import FloatingModel, build
from engine.kernels.floating import bodies, carriages, equations, loads
from engine.scene.study import Study
from tests.floating import loads_twin, residual_twin
from tests.floating.scenes import mutated

ELASTIC = [1, 2, 3, 4, 9, 10, 12]  # what is sprung too
SMALL, AGREE, DIFFER = 1e-4, 2e-4, 2e-3  # deflections; of the largest addition
Fields = Callable[..., tuple[np.ndarray, np.ndarray]]


def shortened(bare: Fields) -> Fields:
    """Displacements and rotations of a beam whose places come nearer to its beginning as it bends."""
    nodes, weights = np.polynomial.legendre.leggauss(12)

    def fields(s: np.ndarray, *body: object) -> tuple[np.ndarray, np.ndarray]:
        moved, turned = bare(s, *body)
        for place, d in zip(s, moved, strict=True):
            slopes = bare(0.5 * place * (nodes + 1.0), *body)[1][:, 1:]
            d[0] -= 0.5 * (0.5 * place * weights) @ (slopes**2).sum(axis=1)
        return moved, turned

    return fields


def whole(model: FloatingModel, y: np.ndarray, u: np.ndarray, a: np.ndarray) -> np.ndarray:
    """What is left of the equations, by particles and virtual work."""
    inertia, springs = residual_twin.left_of_particles(model, y, u, a)
    return inertia + springs - loads_twin.of_loads(y) - loads_twin.of_springs(y, u)


def stiff(study: Study) -> Study:
    """The same with tracks that grow shorter."""
    return study.with_values({"frame.upper.stiffening": True, "frame.lower.stiffening": True})


#: Terms by their text in the equations, or in the loads, and what stands there without them.
TERMS = {
    "turning": ("system.pairs[pair, STIFFENING + 1] * across", "0.0"),
    "acceleration along": (" - system.pairs[pair, STIFFENING] * acc[0]", ""),
    "under a carriage": ("r = r - foreshortening_at(", "r = r - 0.0 * foreshortening_at("),
    "where a body hangs": ("-1.0 * shorter_by(system.hanging_shorter", "-0.0 * shorter_by(system.hanging_shorter"),
    "under a load": ("r = r - shorter_by(", "r = r - 0.0 * shorter_by("),
}


def main() -> None:
    bare_study = loads_twin.study()
    model, stiffened = build(bare_study), build(stiff(bare_study))
    y, u, a = residual_twin.state(model, 4)
    for part in (y, u, a):
        part[ELASTIC] *= SMALL
    bare = residual_twin.fields
    without = whole(model, y, u, a)
    residual_twin.fields = shortened(bare)  # type: ignore[assignment]
    wanted = whole(model, y, u, a) - without
    residual_twin.fields = bare
    without = residual_twin.left_of(equations, model, y, u, a)

    def gap(module: object) -> float:
        found = residual_twin.left_of(module, stiffened, y, u, a) - without  # type: ignore[arg-type]
        return float(np.abs(found - wanted).max() / np.abs(wanted).max())

    print(f"added: {gap(equations):.1e}")
    assert gap(equations) < AGREE
    for name, (old, new) in TERMS.items():
        off = gap(mutated(equations, old, new, bodies, carriages, loads))
        print(f"without {name}: {off:.1e}")
        assert off > DIFFER, name


if __name__ == "__main__":
    main()
