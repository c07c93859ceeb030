"""What a user should know before believing a study of robots on rails: what is allowed and yet often a mistake."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from studies.results.formatting import quantity

if TYPE_CHECKING:
    from engine.scene.study import Study
    from engine.scene.sweep import Cases

#: Of the torque that turns what hangs on a hinge back to where it rests: a softer one leaves it hanging as on a rope.
SOFT = 0.1


def remarks(study: Study) -> tuple[str, ...]:
    """One sentence per remark, each once; none for an ordinary study."""
    from engine.batch.plausibility import doubtful, half_united
    from engine.scene.sweep import expand

    cases = expand(study)
    found = [*doubtful(study, cases), *half_united(study), *_pushed_along(study, cases), *_idle(study), *_in_one(study)]
    return tuple(dict.fromkeys(found))


def _idle(study: Study) -> Iterator[str]:
    """Robots that nobody tells to do anything."""
    for name, robot in study.robot.items():
        if not robot.moves:
            yield f"{name} has no moves and stands where it starts: are [[robot.{name}.moves]] missing?"


def _in_one(study: Study) -> Iterator[str]:
    """Robots that start at one place of a rail."""
    for (one, first), (other, second) in combinations(study.robot.items(), 2):
        if set(first.rails) & set(second.rails) and first.start[:1] == second.start[:1]:
            place = quantity(first.start[0], "m")
            yield f"{one} and {other} start at one place of their rails, {place}, and nothing keeps robots apart"


def _pushed_along(study: Study, cases: Cases) -> Iterator[str]:
    """Hinges that hang as on a rope in all variants, whose drives are told the forces of the plan."""
    swept = {path: float(np.max(axis.values)) for axis in cases.axes for path in axis.paths}
    for name, robot in study.robot.items():
        if robot.feedforward != "plan":
            continue
        links, tool = study.arm[robot.arm].links, np.linalg.norm(study.arm[robot.arm].tool)
        for number, link in enumerate(links):
            last = number == len(links) - 1
            moment = link.mass * np.linalg.norm(link.centre) + robot.payload * robot.payload_scale * tool * last
            torque = float(study.gravity * moment)
            stiffness = swept.get(f"arm.{robot.arm}.links.{number}.stiffness", link.stiffness or np.inf)
            if not link.slides and stiffness < SOFT * torque:
                yield (
                    f"link {number} of {robot.arm} is held by {quantity(stiffness, 'N m/rad')}, and hangs with up to "
                    f'{quantity(torque, "N m")}: with robot.{name}.feedforward = "plan" its drive pushes it along '
                    'all the same, so that it hardly swings; is "gravity" meant?'
                )
