"""What a variant gets: a model, a number of modes, a number of steps, and the errors that these are to leave."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.bodies.beam import Beam
from engine.bodies.frame import Frame
from engine.fidelity import STEPS_PER_PERIOD
from engine.kernels.schemes import Scheme
from engine.ladder import full_fidelity
from engine.lanes import LaneValues
from engine.model import SceneModel, simplified
from engine.scene import Study
from engine.timeline import Window
from results_schema.status import Fidelity, SchemeUsed, label

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

LEVELS = (2, 3, 4, 6, 8, 12, 16, 24)  # numbers of modes that are chosen from
FEW, MORE = 4, 3  # fewer modes than these are compared with so many more, others with half
USUAL = 1e-3  # the tolerance at which `STEPS_PER_PERIOD` is right where nothing is known
MOST_SIMPLER = 0.7  # of the tolerance that a simpler model may take
FINER = 2.0  # times the steps that are safe: half of them must be so too
AIM = 0.6  # of the tolerance that choices aim at: of 100 errors some two are beyond 1/0.6 times their estimate
MOST_CHOSEN = 4e6  # steps over a passage or cycle for the sake of the tolerance; what asks for more misses it


class Asked(NamedTuple):
    """What a study asks of a choice: the lowest model that tells what it reports, what is recorded, and the part of
    what whole histories are off by that the reported is."""

    least: Fidelity
    window: Window
    reported: float


class Choice(NamedTuple):
    """What V variants get: a model (number of `Fidelity`), modes of every body whose modes are "auto", a scheme (number
    of `SchemeUsed`), steps for the tolerance; and the errors that these leave, NaN where nobody can tell.

    decay: the error of all these modes over that of as many as `checking` compares them with. ruled: 1 where the steps
    are more than the tolerance asks for, by the rules that no march may break. felt: modes that ring noticeably.
    """

    fidelity: Array
    modes: Array
    scheme: Array
    steps: Array
    error_fidelity: Array
    error_modes: Array
    error_steps: Array
    decay: Array
    ruled: Array
    felt: Array

    def of(self, lanes: Counts | NDArray[np.bool_]) -> Choice:
        """Some of them."""
        return Choice(*(part[lanes] for part in self))


def fewer_modes(kept: int) -> int:
    """The number of modes that so many are compared with."""
    return kept // 2 if kept >= FEW else kept + MORE


def automatic_bodies(scene: SceneModel) -> tuple[str, ...]:
    """Bodies whose number of modes is chosen: those of beams and frames that carry loads, and ride on nothing."""
    riding = {carriage.rides for carriage in scene.carriages}
    ridden = {carriage.body for carriage in scene.carriages}
    return tuple(
        part.name
        for number, part in enumerate(scene.bodies)
        if number in ridden - riding and _is_free(scene.study.body[part.name])
    )


def with_choice(scene: SceneModel, fidelity: Fidelity, modes: int, scheme: SchemeUsed) -> SceneModel:
    """A scene with a chosen model, number of modes and scheme; the same scene where nothing is chosen."""
    changes: dict[str, object] = {f"body.{name}.modes": modes for name in automatic_bodies(scene)} if modes else {}
    if scene.study.solver.fidelity == "auto" and fidelity < full_fidelity(scene):
        changes["solver.fidelity"] = fidelity.name.lower()
    if scheme is not scheme_used(scene.study):
        changes["solver.scheme"] = label(scheme)
    return simplified(scene, changes) if changes else scene


def fixed_steps(study: Study, values: LaneValues) -> bool:
    """Whether the study says how many steps."""
    return study.solver.steps != "auto" or "solver.steps" in values.columns


def scheme_used(study: Study) -> SchemeUsed:
    """The scheme of a study as archives number it."""
    return SchemeUsed[study.solver.integration.name.upper().replace("-", "_")]


def usual_steps(values: LaneValues) -> Array:
    """(V,) steps per period where nothing but the tolerance is known."""
    return STEPS_PER_PERIOD * np.sqrt(USUAL / values.of("solver.tolerance"))


def true_steps(values: LaneValues, scheme: Scheme) -> Array:
    """(V,) steps per period with which a scheme has the period error of average acceleration with `usual_steps`."""
    square, fourth = scheme.period_error
    error = (2.0 * np.pi / usual_steps(values)) ** 2 / 12.0
    return 2.0 * np.pi * (np.sqrt(square / error) if square > 0.0 else (fourth / error) ** 0.25)


def _is_free(body: object) -> bool:
    """Whether a body's modes are ours to choose; those of a reduced or imported one are few already."""
    if isinstance(body, Frame) and (body.interface or body.leave_out):
        return False
    return isinstance(body, Beam | Frame) and body.modes == "auto" and not isinstance(body.damping_ratio, tuple)
