"""Steps without iteration beside the equations of motion that they solve.

python -m tests.floating.given_twin, with kernels that are not compiled. An arm in space on two driven joints carries a
mass and an oscillator on given ways, and loads. After one step from a random state nothing may be left of the equations
in full, and contact forces are theirs; with torques, which are linearised, if the arm is stiff. Then
each term is switched off in turn.
"""

from types import ModuleType

import numpy as np

from engine.floating.lanes import in_blocks, lanes
from engine.floating.model import FloatingModel, build
from engine.kernels.floating import given, march
from engine.kernels.floating.equations import residual
from engine.kernels.floating.following import follow_frame
from engine.kernels.floating.layout import STATISTICS, Lane, Record, Weights
from engine.kernels.floating.motions import motions_at
from engine.kernels.layout import LANES
from engine.scene.variants import VariantValues
from tests.floating.scenes import given_arm, mutated

ALPHA, NEWMARK = Weights(0.3, 0.6, 0.1, 0.2), Weights(0.3, 0.6, 0.0, 0.0)
REPEATED = 4
STEP, AT = 0.2, 0.2  # s: terms of all orders in the step count
ROUNDING, CURVED = 1e-11, 1e-10  # of the largest force: what may be left, and that of what is linearised
FACTOR = 30.0  # times that which must be left without a term
SMALL = 1e-2  # of deflections there
STIFF = {"body.arm.second_moment": 2e-3, "frame.arm.lateral_second_moment": 3e-3}
MODES_ALONE = {"solver.static_correction": False}  # whose random motions are as large as those of a mode

#: Terms of the equations by their text in the kernel, and what stands there without them.
TERMS = {
    "base acceleration": ("dot(shared_vector(system.modes, row, TRANSLATION), base) + ", ""),
    "undeformed places": ("left = left + by * lanes_at(work.turning, (b, VALUES + 3 * a + e))", "pass"),
    "damping": ("damping * lanes_at(state.tried.u, (k,))", "0.0"),
    "damping in the step": ("add_to_matrix(solver.fresh, k, k, ways.of_u * damping)", "pass"),
    "stiffness": ("all_lanes(system.pairs[row, STIFFNESS])", "all_lanes(0.0)"),
    "gyroscopic terms": (
        "keep_matrix(work.turning, b, RATES, by_rate)",
        "keep_matrix(work.turning, b, RATES, ((zero, zero, zero),) * 3)",
    ),
    "Euler terms": ("vector(work.frames, b, ANGULAR)", "(all_lanes(0.0),) * 3"),
    "centrifugal terms": ("turned_by(w, al)", "turned_by(times(0.0, w), al)"),
    "rates in the step": ("mass + ways.of_u * by_rate", "mass"),
    "values in the step": (" + of_coordinate(ways, m) * by_value", ""),
    "values of each coordinate": ("of_coordinate(ways, m) * by_value", "of_coordinate(ways, k) * by_value"),
    "mass in the step": ("mass + ways.of_u", "ways.of_u"),
    "what modes do by rates": ("by_rate = by_rate + both * lanes_at(work.turning, (b, RATES + 3 * a + e))", "pass"),
    "what modes do by values": ("by_value = by_value + both * lanes_at(work.turning, (b, VALUES + 3 * a + e))", "pass"),
    "Coriolis' along the track": ("by_rate = times(2.0 * ds, slope)", "by_rate = times(0.0, slope)"),
    "change of speed": ("times(dds, slope)", "times(0.0, slope)"),
    "slope of a frame that turns": ("times(ds * slope[e], column", "times(0.0 * slope[e], column"),
    "curvature": ("times(ds * ds, vector(work.modes, j, CURVE))", "times(0.0, slope)"),
    "rates under a carriage": ("times(shape[e], column(work.turning, b, RATES + e))", "times(0.0, shape)"),
    "values under a carriage": ("times(shape[e], column(work.turning, b, VALUES + e))", "times(0.0, shape)"),
    "mass of what is sprung": ("mass = mass + carried(lane, c, SPRUNG_MASS)", "pass"),
    "force of what is sprung": ("f = add(f, sprung(", "add(f, sprung("),
    "rate of what is sprung": ("times(u, by_rate)", "times(0.0, by_rate)"),
    "place of what is sprung": ("times(y, by_value)", "times(0.0, by_value)"),
    "spring": ("spring * y", "0.0"),
    "spring in the step": ("of_y * spring", "0.0"),
    "what is sprung by its rate": ("add(up, add(times(ways.of_u, by_rate), ", "add(up, add(times(0.0, by_rate), "),
    "what is sprung by its value": ("by_rate), times(of_y, by_value)))\n", "by_rate), times(0.0, by_value)))\n"),
    "damper": ("damper * u", "0.0"),
    "damper in the step": ("ways.of_u * damper", "0.0"),
    "modes by what is sprung": ("add_to_matrix(solver.fresh, k, z, own", "add_to_matrix(solver.fresh, k, z, 0.0 * own"),
    "what is sprung by modes": ("add_to_matrix(solver.fresh, z, k, own", "add_to_matrix(solver.fresh, z, k, 0.0 * own"),
    "forces of loads": ("dot(shared_vector(system.grip_modes, row, PUSHED), f)", "0.0"),
    "contact force by modes": ("add_vector(work.contacts, c, TOUCHED, by)", "pass"),
    "contact force of what is sprung": ("add_vector(work.contacts, c, CONTACT, by)", "pass"),
    "contact force by what rises": ("rising = times(lanes_at(x.a, (z,)), ", "rising = times(0.0, "),
}  # fmt: skip
#: The same where they are linearised.
LINEARISED = {
    "stiffening by turning": (" - turned_nearer(system, b, row, turning)", ""),
    "stiffening by accelerations": (" - pulled(system, b, row, base)", ""),
    "stiffening by carriages": ("add_to(state.residual, i, by * lanes_at(state.tried.y, (j,)))", "pass"),
    "stiffening by carriages, twice": ("add_to(state.residual, j, by * lanes_at(state.tried.y, (i,)))", "pass"),
    "stiffening by carriages in the step": ("of_coordinate(ways, j) * by", "0.0 * by"),
    "stiffening by carriages in the step, twice": ("of_coordinate(ways, i) * by", "0.0 * by"),
    "stiffening by loads": ("by = by + weighed(system.grip_shorter, p, system.tree[b, SHORTENED], (i, j), f)", "pass"),
    "torques of loads": ("weight * dot(turned, about)", "0.0"),
    "turned torques": ("(-0.5 * weight) * dot(cross(other, turned), about)", "0.0 * about[0]"),
    "loads in the step": ("of_coordinate(ways, first + j) * by", "0.0 * by"),
}  # fmt: skip


def left(module: ModuleType, model: FloatingModel, scheme: Weights, small: float) -> float:
    """The largest force that is left, and by which contact forces are off, over the largest force."""
    table = lanes(model, VariantValues(model.study, {}, 1), np.full(1, STEP))
    lane = Lane(*(in_blocks(part)[0] for part in table))
    blank = np.zeros((1, 1, STATISTICS, LANES))
    state, solver, *_ = march.room_to_march(model.system, lane, Record(np.zeros(1), *[blank] * 6))
    work, rng = solver.work, np.random.default_rng(5)
    motions_at(lane.motions, np.full(LANES, AT), np.full(LANES, AT), work.piece, work.motions)
    for k, part in enumerate((state.now.y, state.now.u, state.now.a, state.inner)):
        part[:] = small * 10.0 ** min(k, 2) * rng.normal(size=(model.size, 1))
    state.beta[:] = np.linspace(0.2, 0.4, model.size)[:, None]
    for b in range(len(model.bodies)):  # those that rest are followed once
        follow_frame(model.system, lane, b, state.now, work)
    for _ in range(REPEATED if scheme is NEWMARK else 1):  # which does not ask for accelerations before
        regular = module.step_given(model.system, lane, scheme, np.full(LANES, STEP), state, solver)
        assert (regular == 1.0).all()
        for part in (state.now.a, state.before, state.earlier):
            part[:] = state.tried.a
    contacts, out = work.contacts.copy(), np.zeros((model.size, LANES))
    residual(model.system, lane, state.tried, work, out)
    largest = np.abs(work.contacts).max()
    return float(max(np.abs(out).max(), np.abs(contacts - work.contacts).max()) / largest)


def main() -> None:
    scenes = (
        (given_arm(), ALPHA, 1.0, ROUNDING, TERMS),
        (given_arm(curved=True).with_values(STIFF | MODES_ALONE), NEWMARK, SMALL, CURVED, LINEARISED),
    )
    for study, scheme, small, bound, terms in scenes:
        model = build(study)
        found = left(given, model, scheme, small)
        assert found < bound, found
        for name, (old, new) in terms.items():
            found = left(mutated(given, old, new), model, scheme, small)
            assert found > FACTOR * bound, (name, found)
            print(f"without {name} {found:.1e} is left")


if __name__ == "__main__":
    main()
