"""The tangent of Newton's method beside central differences of the residual.

python -m tests.floating.tangent_twin, with kernels that are not compiled. At a random state of `loads_twin`: what a
change of the accelerations does to the residual, by itself and through the coordinates and velocities that follow from
it in a step. Then each way is switched off in turn.
"""

from types import ModuleType

import numpy as np

from engine.floating.lanes import in_blocks, lanes
from engine.floating.model import FloatingModel, build
from engine.kernels.floating import march, newton
from engine.kernels.floating.equations import residual
from engine.kernels.floating.layout import STATISTICS, Coordinates, Lane, Record, Weights
from engine.kernels.floating.motions import motions_at
from engine.kernels.floating.state import ways_of
from engine.kernels.layout import LANES
from engine.scene.variants import VariantValues
from tests.floating import loads_twin, residual_twin
from tests.floating.scenes import mutated

STEP, GAMMA = 0.02, 0.5
AGREE, DIFFER = 1e-4, 1e-3  # of the largest entry of each column
AT = 1  # the lane that is compared

TERMS = {
    "what follows in coordinates": ("put_lanes(x.y, (k,), y + of_coordinate(ways, k) * by)", "pass"),
    "what follows in velocities": ("put_lanes(x.u, (k,), u + ways.of_u * by)", "pass"),
    "accelerations": ("put_lanes(x.a, (k,), a + by)", "pass"),
}


def both(model: FloatingModel, *modules: ModuleType) -> tuple[list[np.ndarray], np.ndarray]:
    """The tangents (N, N) by the modules, and by central differences of the residual."""
    table = lanes(model, VariantValues(model.study, {}, 1), np.full(1, STEP))
    lane, N = Lane(*(in_blocks(part)[0] for part in table)), model.size
    blank = np.zeros((1, 1, STATISTICS, LANES))
    state, solver, *_ = march.room_to_march(model.system, lane, Record(np.zeros(1), *[blank] * 6))
    motions_at(lane.motions, np.zeros(LANES), np.zeros(LANES), solver.work.piece, solver.work.motions)
    for part, values in zip(state.tried, residual_twin.state(model, 1), strict=True):
        part[:] = values[:, None]
    state.weight[:], solver.memory[newton.SCALE] = 1.0, 0.1
    state.beta[:] = np.linspace(0.2, 0.3, N)[:, None]
    ways = ways_of(state, Weights(0.0, GAMMA, 0.0, 0.0), np.full(LANES, STEP))
    found = []
    for module in modules:
        module.tangent(model.system, lane, state, ways, solver)
        found.append(solver.fresh[:, :, AT].copy())
    wanted, out = np.zeros((N, N)), np.zeros((N, LANES))
    for k in range(N):
        for sign in (1.0, -1.0):
            x = Coordinates(*(part.copy() for part in state.tried))
            for part, way in zip(x, (state.beta[k] * STEP**2, GAMMA * STEP, 1.0), strict=True):
                part[k] += sign * way * 1e-3
            residual(model.system, lane, x, solver.work, out)
            wanted[:, k] += sign * out[:, AT] / 2e-3
    return found, wanted


def main() -> None:
    model = build(loads_twin.study())
    modules = {"tangent": newton} | {name: mutated(newton, *term) for name, term in TERMS.items()}
    tangents, wanted = both(model, *modules.values())
    for (name, module), found in zip(modules.items(), tangents, strict=True):
        gap = (np.abs(found - wanted).max(axis=0) / np.abs(wanted).max(axis=0)).max()
        print(f"{'' if module is newton else 'without '}{name}: {gap:.1e}")
        assert gap < AGREE if module is newton else gap > DIFFER, name


if __name__ == "__main__":
    main()
