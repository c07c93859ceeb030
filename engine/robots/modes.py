"""How many modes rails are marched with, and how much these miss of what robots bend."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.kernels.robots.layout import ALONG, GRIP

if TYPE_CHECKING:
    from engine.kernels.robots.layout import Record
    from engine.robots.model import RobotModel
    from engine.scene.study import Study

#: Modes of each rail where these are open: first, refined, and in audits. 24 leave 2e-3 to 8e-3 of errors on the portal
#: with limits of acceleration from 0.3 to 2, 48 leave 6e-4 to 1.2e-3 beside 64.
MODES = (24, 48, 64)
#: So many times these, doubled so far, where the first miss more than `MOST_MISSED` of what robots bend: a frame whose
#: first modes sway beside its track was told an error of 4e-3 where 0.13 was true.
MOST_TIMES, MOST_MISSED = 8, 0.5
LOOKED_AT = 200  # stations, evenly


def open_bodies(study: Study) -> list[str]:
    """Bodies whose number of modes is open."""
    return [name for name, body in study.body.items() if body.modes_are_open]


def with_open_modes(study: Study, modes: int = MODES[0]) -> Study:
    """The study with so many modes of all bodies whose number is open."""
    own = {name: study.body[name].model_copy(update={"modes": modes}) for name in open_bodies(study)}
    return study.model_copy(update={"body": {**study.body, **own}}) if own else study


def with_modes(study: Study, modes: int) -> Study:
    """The study with so many modes of all bodies."""
    own = {name: body.model_copy(update={"modes": modes}) for name, body in study.body.items()}
    return study.model_copy(update={"body": own})


def with_finer_bodies(study: Study) -> Study:
    """The study with twice the elements of all bodies, and twice the modes of those that fix theirs."""
    own = {name: body.with_more_elements(2) for name, body in study.body.items()}
    own |= {name: body.with_more_modes(2) for name, body in own.items() if not body.modes_are_open}
    return study.model_copy(update={"body": own})


def missed_part(model: RobotModel, resting: Record) -> float:
    """Of the elastic energy that robots give a rail where all rest, the largest part that its modes miss, over rails.

    Robots stand at the nearest ends of elements for that.
    """
    some, found = np.linspace(0, len(resting.grips) - 1, LOOKED_AT).astype(np.int64), 0.0
    for b, rail in enumerate(model.rails.values()):
        loads = np.zeros((some.size, rail.ends.size, 6))
        for r, g in np.argwhere(model.system.body == b):
            grip = resting.grips[some, r, g]
            near = np.abs(grip[:, ALONG, None] - rail.ends).argmin(axis=1)
            loads[np.arange(some.size), near] += grip[:, GRIP : GRIP + 6]
        flat = loads.reshape(some.size, -1)
        missed = np.sum((flat @ rail.missed) * flat, axis=1)
        held = np.sum((flat @ rail.moved.reshape(-1, rail.omega.size) / rail.omega) ** 2, axis=1)
        whole = float((missed + held).max())
        found = max(found, float(missed.max()) / whole if whole > 0.0 else 0.0)
    return found
