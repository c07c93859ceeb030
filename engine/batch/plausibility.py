"""What a user should know before believing a study: things that are allowed and yet often a mistake."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from engine.accuracy.grids import SceneGrid
from engine.batch.plan import Plan
from engine.bodies.modal.modal_body import ModalBody
from engine.model.lane_table import moving_mass, weight
from engine.scene.study import doubts
from engine.scene.sweep import broken
from engine.statics.directions import told_of
from results_schema.arrays import Array

FAST = 3.0  # times the critical speed
HEAVY = 2.0  # times the body's mass
LONG = 100.0  # times the body's length: a way
DEEP = 0.1  # of the length: a static deflection beyond linear bending


def remarks(plan: Plan) -> list[str]:
    """One sentence per remark, each once, in the order of `REMARKS`; none for an ordinary study."""
    return list(dict.fromkeys(sentence for remark in REMARKS for sentence in remark(plan)))


def _partly_inert(plan: Plan) -> Iterator[str]:
    """Of the scene without sweep."""
    if sentence := told_of(plan.base):
        yield sentence


def _doubtful(plan: Plan) -> Iterator[str]:
    for doubt in doubts(plan.study):
        if found := broken(plan.study, plan.cases, doubt):
            values = found[0]
            said = f"{doubt.where} = {doubt.amount(values)}: {doubt.what}, expected {doubt.expected}"
            yield f"{said}; {doubt.meant(values) or 'is the unit right?'}"


def _unsupported(plan: Plan) -> Iterator[str]:
    riding = {carriage.rides for carriage in plan.base.carriages}
    for number, part in enumerate(plan.base.bodies):
        if part.modal.rigid_modes and number not in riding:
            yield f"nothing holds body {part.name} fully: it will move away as a rigid body"


def _released(plan: Plan) -> Iterator[str]:
    for part in plan.base.bodies:
        if part.own_weight and plan.study.start == "rest":
            yield (
                f"body {part.name} is released undeformed at time 0 and rings under its own weight; "
                'initial = "equilibrium" starts it in its sag'
            )


def _leaves_between(plan: Plan) -> Iterator[str]:
    for carriage in plan.base.carriages:
        low, high = carriage.rider.motion.range()
        if high - low > LONG * carriage.rider.length:
            yield (
                f"{carriage.name} goes from {low:.4g} to {high:.4g} m, and its body is {carriage.rider.length:.4g} m "
                "long: are the units right?"
            )
        if carriage.rider.stays and (low < 0.0 or high > carriage.rider.length):
            yield (
                f"the way of {carriage.name} leaves its body ({low:.4g} to {high:.4g} m of "
                f"{carriage.rider.length:.4g} m), where it does not act: a spline may pass beyond its waypoints"
            )


def _fast(plan: Plan) -> Iterator[str]:
    """Of the first carriage, beside omega_1 L/pi."""
    worst, fastest = 0.0, 0.0
    for grid in plan.grids:
        scene = grid.scene
        speed = float((scene.carriages[0].rider.top_speed / _time_scale(grid)).max())
        ratio = speed * np.pi / (scene.first_omega * scene.leading_body.modal.length)
        worst, fastest = max((worst, fastest), (ratio, speed))
    if worst > FAST:
        yield (
            f"some variants run at up to {worst:.3g} times the critical speed omega_1 L/pi, at {fastest:.3g} m/s: "
            "are the units right?"
        )


def _heavy(plan: Plan) -> Iterator[str]:
    ratios = [moving_mass(g.scene, g.values, number).max() / body.mass for g, number, body in _carriages(plan)]
    worst = max(ratios, default=0.0)
    if worst > HEAVY:
        yield (
            f"a carriage weighs up to {worst:.3g} times its body: are the units right? If they are, look at more modes "
            "and steps before believing it"
        )


def _deep(plan: Plan) -> Iterator[str]:
    worst, most = 0.0, 0.0
    for grid, number, body in _carriages(plan):
        if not body.rigid_modes:
            s = np.linspace(0.0, body.length, 33)
            deflection = np.abs(body.influence_at(s, s)).max() * np.abs(weight(grid.scene, grid.values, number)).max()
            worst, most = max((worst, most), (float(deflection / body.length), float(deflection)))
    if worst > 1.0:
        yield (
            f"the static deflection alone is {most:.3g} m, {worst:.3g} times the length; no structure bends so far: "
            "are the units of stiffness, length and load right?"
        )
    elif worst > DEEP:
        yield f"the static deflection alone reaches {worst:.3g} of the length: beyond small-deflection theory"


def _carriages(plan: Plan) -> Iterator[tuple[SceneGrid, int, ModalBody]]:
    """Every carriage of every scene by its number, and the body on which it rides."""
    for grid in plan.grids:
        for number, carriage in enumerate(grid.scene.carriages):
            yield grid, number, grid.scene.bodies[carriage.body].modal


def _thin(plan: Plan) -> Iterator[str]:
    """Fewer than 20 fixed steps in a first period."""
    for grid in plan.grids:
        if grid.fixed:
            periods = float(_time_scale(grid).max()) * grid.scene.first_omega / (2.0 * np.pi)
            steps = grid.unit * grid.scene.scheme.stride
            if steps < 20.0 * periods:
                yield f"{steps} steps are only {steps / periods:.2g} in a first period of the body"


def _time_scale(grid: SceneGrid) -> Array:
    """(V,) s per unit of scene time."""
    return grid.values.scene_time_scale


REMARKS: tuple[Callable[[Plan], Iterator[str]], ...]
REMARKS = (_partly_inert, _doubtful, _unsupported, _released, _leaves_between, _fast, _heavy, _deep, _thin)
