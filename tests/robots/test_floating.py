"""A robot that stands on a bed and swings its arm, beside floating frames; and what rails leave out that do not grow
shorter as they bend. Without gravity, as both start undeformed then."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from engine.floating.results import frame_signals
from engine.robots.model import build
from engine.robots.shortening import beyond_linear
from engine.scene.study import Study
from tests.floating.scenes import FOX_GOODWIN as WEIGHTS
from tests.floating.scenes import steps
from tests.naive.robots_as_particles import told
from tests.robots.scenes import FOX_GOODWIN, marched, rail

LINKS, DURATION, COUNT = (0.8, 0.6), 1.5, 3000
LIMITS = {"speed": 6.0, "acceleration": 20.0, "jerk": 200.0}
#: How much softer a bed is, and where the robot stands on it.
OTHER_PLACES = [(1.0, 5.0), (20.0, 5.0), (20.0, 10.0)]
HELD = {"west": ["x", "y", "z", "rx"], "east": ["y", "z"]}


def swinging(softer: float, place: float, axis: list[float], modes: int, elements: int) -> Study:
    """An arm of two links, of which a spring drives the first; axis: of its joint."""
    bed = rail(0.0, modes=modes, elements=elements) | {"supports": HELD, "spring": {}}
    bed["node"] = {"west": [0, 0, 0], "east": [12, 0, 0]}
    bed["section"]["box"]["youngs_modulus"] /= softer
    one = {"kind": "revolute", "axis": axis, "mass": 90, "centre": [0.5 * LINKS[0], 0, 0], "inertia": [4, 5, 5]}
    two = {"kind": "revolute", "axis": [0, 1, 0], "place": [LINKS[0], 0, 0], "mass": 60, "inertia": [1, 3, 3]}
    links = [one | LIMITS | {"stiffness": 8e5, "damping": 4e3}, two | LIMITS | {"centre": [0.5 * LINKS[1], 0, 0]}]
    arm = {"mass": 200, "centre": [0.1, 0, 0], "inertia": [20, 30, 30], "tool": [LINKS[1], 0, 0], "links": links}
    moves = [{"to": [place, 1.2, 0.9]}, {"to": [place, -0.8, -0.4]}]
    robot = {"arm": "swinger", "rails": ["bed"], "start": [place, 0.2, 0.3], "moves": moves, "feedforward": "gravity"}
    tables: dict[str, Any] = {"body": {"bed": bed}, "arm": {"swinger": arm | {"rail": LIMITS}}, "robot": {"r": robot}}
    solver = {"static_correction": False, "tolerance": 1e-6}
    return Study(kind="portal", gravity=0.0, solver=solver, **tables)


def floated(study: Study, bed: dict[str, Any], **frame: Any) -> tuple[np.ndarray, np.ndarray]:
    """Times, and (S, 3) where the tool is, of the robot on a bed of modes alone: y, z of floating frames are turned."""
    robot, arm = study.robot["r"], study.arm["swinger"]
    times = np.linspace(0.0, DURATION, 1000)
    plan = np.array([told(robot, arm, t)[0][0].astype(float) for t in times])

    def joint(j: int) -> list[dict[str, Any]]:
        link, axis = arm.links[j - 1], np.array(arm.links[j - 1].axis) * [1, -1, -1]
        way = {"kind": "waypoints", "times": times.tolist(), "values": plan[:, j].tolist()}
        soft = {} if link.is_rigid else {"stiffness": link.stiffness, "damping": link.damping, "start": plan[0, j]}
        return [{"kind": "revolute", "axis": axis.tolist(), "motion": way} | soft]

    def rigid(length: float, solid: Any) -> dict[str, Any]:
        return {"kind": "rigid", "length": length, "mass": solid.mass, "inertia": solid.inertia[1], "own_weight": True}

    pairs = zip(("one", "two"), LINKS, arm.links, strict=True)
    bodies = {"bed": bed | {"own_weight": True}, "base": rigid(0.2, arm)} | {n: rigid(L, own) for n, L, own in pairs}
    frames: dict[str, Any] = {
        "base": {"on": "bed", "at": robot.start[0], "inertia": arm.inertia},
        "one": {"on": "base", "at": 0.0, "inertia": arm.links[0].inertia, "joints": joint(1)},
        "two": {"on": "one", "inertia": arm.links[1].inertia, "joints": joint(2)},
    }
    frames |= {"bed": frame} if frame else {}
    model, found = steps(
        Study(kind="moving-frames", gravity=0.0, body=bodies, frame=frames, solver={"static_correction": False}),
        DURATION,
        COUNT,
        1,
        WEIGHTS,
    )
    own = found.history[0][:, frame_signals(model)].reshape(found.times.shape[1], len(bodies), -1)[:, -1]
    assert list(model.bodies)[-1] == "two"
    tools = own[:, :3] + own[:, 9:18].reshape(-1, 3, 3) @ [LINKS[1], 0, 0]
    return found.times[0], tools * [1, -1, -1]


def longest(record: Any) -> float:
    """m, of the errors of a tool."""
    return float(np.linalg.norm(record.robots[:, 0, 3:6] - record.robots[:, 0, :3], axis=1).max())


@pytest.mark.parametrize(("softer", "apart"), [(1.0, 4e-4), (20.0, 1e-4)])
def test_a_robot_on_a_bed_does_what_floating_frames_do(softer: float, apart: float) -> None:
    """In space, with the same modes of the bed, of the longest error; what is left is the spline of its moves."""
    study = swinging(softer, 5.0, [0, 0, 1], 8, 12)
    _, record = marched(study, DURATION / COUNT, DURATION, scheme=FOX_GOODWIN)
    times, tools = floated(study, study.body["bed"].model_dump(exclude_unset=True))
    own = [np.interp(times, record.coordinates[:, 0, 3], record.robots[:, 0, 3 + k]) for k in range(3)]
    assert np.abs(np.array(own).T - tools).max() < apart * longest(record)


@pytest.mark.parametrize(
    ("softer", "place"), [(5.0, 6.0), *(pytest.param(*case, marks=pytest.mark.slow) for case in OTHER_PLACES)]
)
def test_what_rails_leave_out_that_do_not_grow_shorter(softer: float, place: float) -> None:
    """Against floating frames of a beam that does and one that does not: told once to ten times."""
    study = swinging(softer, place, [0, 1, 0], 14, 24)
    model, record = marched(study, DURATION / COUNT, DURATION, scheme=FOX_GOODWIN)
    box = study.body["bed"].model_dump()["section"]["box"]
    keys = ("area", "second_moment", "youngs_modulus", "density")
    beam = {"kind": "beam", "length": 12.0, "supports": "pinned-pinned", "modes": 6, "damping_ratio": 0.02}
    beam |= {key: box[key] for key in keys}
    stiffened, plain = (floated(study, beam, stiffening=own)[1] for own in (True, False))
    error = longest(record)
    true = np.linalg.norm(stiffened - plain, axis=1).max() / error
    assert true < beyond_linear(model, record, np.array([error]))[0] < 10.0 * true


@pytest.mark.parametrize("stiffness", [0.0, 3e6, 1e15])
def test_supports_pull_at_a_rail_that_would_grow_shorter(stiffness: float) -> None:
    """Springs at both ends, in a row with the beam; none at the one, and walls."""
    study = swinging(1.0, 5.0, [0, 1, 0], 8, 12).data
    bed = study["body"]["bed"]
    own = 0.03 * bed["section"]["box"]["youngs_modulus"] / 12.0
    if stiffness:
        ends = {end: {"node": end, "stiffness": [stiffness, 0, 0]} for end in ("west", "east")}
        bed = bed | {"supports": {"west": ["y", "z", "rx"], "east": ["y", "z"]}, "spring": ends}
    model = build(Study(**study | {"body": {"bed": bed}}))
    wanted = 1.0 / (1.0 / own + 2.0 / stiffness) if stiffness else 0.0
    assert model.rails["bed"].pull == pytest.approx(wanted, rel=1e-5, abs=1e-3)
