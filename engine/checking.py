"""What a march is compared with to know its error: the same with other steps, with other modes besides, and with the
carriages' own model where a simpler one is marched.

A march of second order misses a third of what separates it from one with half its steps, or four thirds of what
separates it from one with twice as many; one of first order all of it, or twice. What half the modes miss is at least
twice what all of them miss, as that falls with the number of modes or faster; of hardly any modes some more tell.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.bodies.rigid import Rigid
from engine.choice import FEW, fewer_modes
from engine.fidelity import least_steps
from engine.kernels.layout import Alpha
from engine.lanes import LaneValues
from engine.model import SceneModel, simplified
from engine.resonance import contact_omega, least_for_limit, vibrates_freely
from engine.tables import SceneTables
from results_schema.errors import BadInput

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

ALPHA_DOUBT = 1.5  # times that for alpha schemes, which leave their asymptotic range sooner than Newmark's
SURE_ORDER = 2  # of schemes that are of higher order in smooth scenes only
OF_MORE = 1.5  # times what some more modes change is what few of them miss


class Checks(NamedTuple):
    """The marches that a march is compared with.

    steps: with half or twice its steps; of their difference the march misses the part ``missed``. None where the march
    makes its own estimate. modes: with other modes and its own steps, or half of them where ``steps`` has so; of the
    difference to the march with as many steps it misses the part ``modes_missed``. None where there are none. model:
    with the carriages' own model and as many steps as ``modes`` may have; None where it is marched itself.
    """

    steps: SceneTables | None
    missed: float
    modes: SceneTables | None
    modes_missed: float
    model: SceneTables | None = None

    def cost(self, own: SceneTables) -> float:
        """Modes x steps of these marches over those of the march itself."""
        parts = [part for part in (self.steps, self.modes, self.model) if part is not None]
        return sum(part.steps * part.model.body_modes for part in parts) / (own.steps * own.model.body_modes)


def checks_of(tables: SceneTables, compared: Literal["half", "twice"]) -> Checks:
    """The comparisons of a march, with half its steps or with twice as many."""
    model, missed = _with_other_modes(tables.model)
    if tables.model.scheme.stride > 1:
        return Checks(None, 0.0, None if model is None else tables.with_steps(model, 1), missed)
    grown = 2.0 ** min(tables.model.scheme.order, SURE_ORDER)
    doubt = ALPHA_DOUBT if isinstance(tables.scheme, Alpha) else 1.0
    ratio, part = (-2, doubt / (grown - 1.0)) if compared == "half" else (2, doubt * grown / (grown - 1.0))
    modes = None if model is None else tables.with_steps(model, _within_limit(tables.model, model) or min(ratio, 1))
    own = simplified(tables.model, {"solver.fidelity": "full"})
    full = tables.with_steps(own, min(ratio, 1)) if own.fidelity > tables.model.fidelity else None
    return Checks(tables.with_steps(tables.model, ratio), part, modes, missed, full)


def _within_limit(own: SceneModel, other: SceneModel) -> int:
    """Times the steps, a power of two, that keep higher modes as far inside the scheme's limit; 0 where there is no
    limit or no higher mode."""
    higher = float(other.omega.max() / own.omega.max())
    return 2 ** int(np.ceil(np.log2(higher))) if higher > 1.0 and np.isfinite(own.scheme.stability_limit) else 0


def can_be_halved(model: SceneModel, values: LaneValues, steps: Counts) -> NDArray[np.bool_]:
    """(V,) whether half of these steps still keep the rules that no march may break."""
    return can_be_marched(model, values, steps.astype(np.float64) / 2.0)


def can_be_marched(model: SceneModel, values: LaneValues, steps: Array | float) -> NDArray[np.bool_]:
    """(V,) whether so many steps keep the rules that no march may break; springs that vibrate freely keep none of a
    conditionally stable scheme."""
    distinct, inverse = np.unique(values.time_scale(model.carriages[0].name), return_inverse=True)
    contact = values.time_scale(model.carriages[0].name) * contact_omega(model, values) / (2.0 * np.pi)
    if model.springs and np.isfinite(model.scheme.stability_limit):
        never = any(vibrates_freely(carriage) for carriage in model.carriages)
        contact = np.maximum(contact, np.inf if never else least_for_limit(model, values))
    return np.asarray(steps >= np.maximum(least_steps(model, distinct)[inverse], contact))


def _with_other_modes(model: SceneModel) -> tuple[SceneModel | None, float]:
    """The scene with half the modes of every body, or some more where there are few; None where it has no such one. And
    the part of the difference that is missed."""
    if max(part.modal.omega.size for part in model.bodies) < FEW:
        with suppress(BadInput):  # a list of damping ratios has no more of them
            more = _with_modes(model, {part.name: fewer_modes(part.modal.omega.size) for part in model.bodies})
            if more.body_modes > model.body_modes:
                return more, OF_MORE
    least = {part.name: min(part.modal.omega.size, part.modal.rigid_modes + 1) for part in model.bodies}
    halved = {part.name: max(part.modal.omega.size // 2, least[part.name]) for part in model.bodies}
    with suppress(BadInput):  # modes that are to be left out may be beyond
        other = _with_modes(model, halved)
        if other.body_modes < model.body_modes:
            return other, 1.0
    return None, 0.0


def _with_modes(model: SceneModel, counts: Mapping[str, int]) -> SceneModel:
    """The scene with so many modes of its bodies, as far as they have any to choose."""
    bodies = model.study.body
    return simplified(
        model, {f"body.{n}.modes": count for n, count in counts.items() if not isinstance(bodies[n], Rigid)}
    )
