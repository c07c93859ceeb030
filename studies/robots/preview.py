"""What `check` tells of robots: what they are and do, and what a run of them will take, from some seconds of it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from engine.march.stepper import Halted
from results_schema.status import Status, label
from studies.protocol.parts import Foreseen, TextTable
from studies.results.formatting import counted, number, quantity, scientific, spanned
from studies.results.places import spread

if TYPE_CHECKING:
    from engine.robots.converge import Converged
    from engine.robots.model import RobotModel
    from engine.scene.study import Study
    from engine.scene.sweep import Cases
    from studies.robots.question import Question

MOST_PLANNED = 64  # variants whose cycle times are told
MEASURED = 2  # variants by thread that are marched
ENOUGH = 1.0  # s after which no further one is begun
PATIENCE = 10.0  # s until some are done
UNFINISHED = 2.0  # times these that variants take of which none was done
AUDIT = 2.6  # times a variant that one takes in an audit: itself, and a march one level beyond in modes and steps
#: Of histories as they are: 0.73 of the portal's, 0.97 of a gantry's that hardly rests.
PACKED = 0.85
SHORT = 0.05  # s of a march that is there to compile kernels
NUMBERS = 16  # of every robot or rail


def tables(study: Study) -> Iterator[TextTable]:
    """Robots, and when they move; of the scene without sweep, cycle times of the sweep."""
    from engine.robots.model import build
    from engine.robots.modes import with_open_modes
    from engine.robots.plans import plans_of, reach
    from engine.robots.results import ways
    from engine.scene.sweep import expand

    model, cases, rows = build(with_open_modes(study.without_sweep())), expand(study), []
    for r, (name, robot) in enumerate(study.robot.items()):
        arm, payloads = study.arm[robot.arm], model.system.stays[r, : len(robot.moves) + 1, -2]
        mass = arm.mass + sum(link.mass for link in arm.links)
        far = quantity(reach(arm, robot), "m")
        done = quantity(float(model.done[r]), "s", 4)
        rows.append((name, " and ".join(robot.rails), f"{number(mass, 5)} kg", far, f"{spanned(payloads)} kg", done))
    cycles = []
    for variant in spread(cases.size, MOST_PLANNED):
        own = cases.study_of(study, variant)
        robots = list(own.robot.values())
        cycles.append(plans_of([own.arm[robot.arm] for robot in robots], robots).done.max())
    title = f"Robots: a cycle of all of them takes {spanned(cycles, partial(number, digits=4))} s"
    yield TextTable(title, ("robot", "stands on", "mass", "reach", "payload", "is done after"), rows)
    moves = dict[str, list[str]]()
    for way in ways(model):
        told = f"{number(way.start)} to {number(way.end)}"
        moves.setdefault(model.robots[way.robot], []).append(told)
    yield TextTable(
        "Moves (s), without sweep", ("robot", "times"), [(name, ", ".join(own)) for name, own in moves.items()]
    )


def foreseen(study: Study, question: Question, threads: int, audited: int) -> Foreseen:
    """What a run takes, by some of its variants, which are marched as it does."""
    from engine.batch.executors import run_jobs
    from engine.bodies.modal.description import MAX_MODES
    from engine.march.halting import stoppable
    from engine.robots.converge import Ladder, climb, converge
    from engine.robots.modes import MODES, open_bodies
    from engine.scene.sweep import expand

    cases, base = expand(study), study.without_sweep()
    climb(Ladder.of(base, SHORT, 0.0), question.zero)  # compiles
    found: dict[int, Converged] = {}
    begun = time.perf_counter()

    def job(variant: int) -> None:
        if found and time.perf_counter() > begun + ENOUGH:
            return
        own = cases.study_of(study, variant)
        late = begun + PATIENCE
        try:
            with stoppable(lambda: time.perf_counter() > late):
                found[variant] = converge(own, question.duration, question.after, question.zero)
        except Halted:
            return

    some = spread(cases.size, MEASURED * threads)
    run_jobs([partial(job, variant) for variant in (*some[::MEASURED], *some[1::MEASURED])], threads)
    took = time.perf_counter() - begun
    each = took / len(found) if found else UNFINISHED * took / len(some)
    marches = cases.size + (len(study.robot) if question.one_at_a_time and len(study.robot) > 1 else 0)
    marches += 1 + len(question.mode_counts) // 3 if question.mode_counts else 0
    again = AUDIT * threads * np.ceil(audited / threads)
    marched = [one.model.study.body[name].modes for one in found.values() for name in open_bodies(study)]
    most = min(max(map(int, marched), default=MODES[0]), MAX_MODES)  # no study file may fix more
    fuller = study.with_values({f"body.{name}.modes": most for name in open_bodies(study)})
    table = _taken(cases, {variant: found[variant] for variant in sorted(found)})
    return Foreseen(fuller, table, float(each * (marches + again)), _bytes(study, cases), audited, _doubt(found))


def _doubt(found: dict[int, Converged]) -> str:
    """What is said where no variant was done in time, or some fall over, which takes no time; "" otherwise."""
    if not found:
        return f"{PATIENCE:.0f} seconds were not enough for a variant to converge: this may take longer"
    fallen = sum(one.status == Status.FALLS_OVER for one in found.values())
    which = f"all {len(found)}" if fallen == len(found) else f"{fallen} of {len(found)}"
    said = f"{which} variants that were tried fall over: a joint is softer than the weight that it has to hold up"
    return said if fallen else ""


def _taken(cases: Cases, found: dict[int, Converged]) -> TextTable:
    """What some variants were marched with."""
    headings = ("variant", "modes of all rails", "steps", "estimated error", "status")
    rows = [
        (
            f"{variant:,}",
            str(one.model.modes),
            f"{one.steps:,}",
            scientific(one.worst),
            label(one.status),
        )
        for variant, one in found.items()
    ]
    return TextTable(f"What {counted(len(rows), 'variant')} of {cases.size:,} took, as in a run", headings, rows)


def _bytes(study: Study, cases: Cases) -> int:
    """What an archive has: mostly its histories."""
    from engine.batch.plan import shown
    from engine.robots.model import build
    from engine.robots.modes import with_open_modes
    from engine.robots.results import KEPT

    model: RobotModel = build(with_open_modes(study.without_sweep()))
    ends = max(rail.ends.size for rail in model.rails.values())
    station = 1 + 6 * len(model.robots) + len(model.rails) * ends
    variant = 8 * (NUMBERS * (len(model.robots) + len(model.rails)))
    return int(PACKED * 8 * shown(study, cases.size).size * KEPT * station + cases.size * variant)
