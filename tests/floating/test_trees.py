"""Bodies in a tree: two links, rigid and flexible, and a spring-driven joint."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from engine.floating.converge import levels
from engine.floating.results import differences, ends, frame_signals, outcome, results_of
from engine.scene.study import Study
from tests.floating.scenes import ARM, FOX_GOODWIN, history, steps

HINGE = {"kind": "revolute", "axis": [0, 1, 0]}
TIP = {"kind": "rigid", "length": 0.2, "mass": 2.0, "inertia": 0.01}
LINK = {"kind": "rigid", "length": 1.0, "mass": 2.0, "inertia": 2.0 / 12.0, "own_weight": True}


def double_pendulum(upper: dict[str, object], lower: dict[str, object], **second: object) -> Study:
    return Study(
        kind="moving-frames",
        gravity=9.81,
        body={"upper": upper, "lower": lower},
        frame={"upper": {"joints": [HINGE]}, "lower": {"on": "upper", "joints": [HINGE | {"start": 0.5} | second]}},
    )


def test_two_rigid_links_against_lagrange() -> None:
    """Absolute angles (below the horizontal) of two slender links, equations from a textbook, by SciPy, to 1e-9: the
    steps' error is of order 2 and extrapolated away."""
    m, length, g = 2.0, 1.0, 9.81

    def rates(t: float, s: np.ndarray) -> np.ndarray:
        a, b, da, db = s
        M = np.array([[4 / 3, 0.5 * np.cos(a - b)], [0.5 * np.cos(a - b), 1 / 3]]) * m * length**2
        curve = 0.5 * m * length**2 * np.sin(a - b)
        force = np.array(
            [-curve * db**2 + 1.5 * m * g * length * np.cos(a), curve * da**2 + 0.5 * m * g * length * np.cos(b)]
        )
        return np.concatenate([[da, db], np.linalg.solve(M, force)])

    # turning about +y brings x up: an angle of the joint is one above the horizontal
    exact = solve_ivp(rates, (0.0, 1.0), [0.0, -0.5, 0.0, 0.0], rtol=1e-12, atol=1e-12).y[:, -1]
    ends = []
    for count in (2000, 4000, 8000):
        model, marched = steps(double_pendulum(LINK, LINK), 1.0, count, count)
        ends.append(history(model, marched, "ends", 0, 6)[-1])
    wanted = [np.cos(exact[0]), 0.0, np.sin(exact[0])]
    wanted += [wanted[0] + np.cos(exact[1]), 0.0, wanted[2] + np.sin(exact[1])]
    errors = [np.abs(end - wanted).max() for end in ends]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)
    once = [(4.0 * fine - coarse) / 3.0 for coarse, fine in pairwise(ends)]
    assert (16.0 * once[1] - once[0]) / 15.0 == pytest.approx(wanted, abs=1e-9)


def test_ends_of_what_is_short_are_compared_by_what_carries_it() -> None:
    """How far the far end of a payload of 0.1 mm is off was told by its own length: more than the whole of it."""
    model, marched = steps(double_pendulum(LINK, LINK | {"length": 1e-4}), 1.0, 800, 8)
    whole, off = outcome(model, marched), outcome(model, replace(marched, history=marched.history.copy()))
    off.history[:, -1, ends(model)] += 1e-3
    names = [result.name for result in results_of(model)]
    apart = dict(zip(names, differences(model, off, whole)[:, 0], strict=True))
    assert apart["far end of upper"] == pytest.approx(1e-3)
    assert apart["far end of lower"] == pytest.approx(1e-3)


def test_a_flexible_double_pendulum_keeps_its_energy() -> None:
    """To 1e-4 over 10 s with 350 steps per first period; order 2."""
    beam = {
        "kind": "beam",
        "length": 1.0,
        "area": 4e-4,
        "second_moment": 2e-8,
        "youngs_modulus": 7e10,
        "density": 3000.0,
        "modes": 2,
        "own_weight": True,
    }
    study = double_pendulum(beam | {"supports": "pinned-pinned"}, beam | {"supports": "clamped-free"})
    drifts = []
    for per_period in (350, 700):
        count = int(10.0 * 120.0947844956109 / (2.0 * np.pi) * per_period)
        model, marched = steps(study, 10.0, count, 11)
        kinetic, potential = history(model, marched, "whole", 0, 2).T
        drifts.append(np.abs(kinetic + potential - kinetic[0] - potential[0]).max() / kinetic.max())
    assert drifts[0] < 1e-4
    assert np.log2(drifts[0] / drifts[1]) == pytest.approx(2.0, abs=0.4)


def test_a_controlled_joint_follows_its_motion() -> None:
    """A stiff controller holds a joint near the motion that it steers to; a driven one is on it."""
    motion = {"kind": "waypoints", "times": [0, 1], "values": [0.5, 1.0]}
    found = []
    for own in ({"stiffness": 1e7, "damping": 1e4}, {}):
        joint = {"motion": motion, **own} | ({"start": 0.5} if own else {"start": None})
        joint = {key: value for key, value in joint.items() if value is not None}
        hinge = HINGE | joint
        study = Study(
            kind="moving-frames",
            gravity=9.81,
            body={"upper": LINK, "lower": LINK},
            frame={"upper": {"joints": [HINGE]}, "lower": {"on": "upper", "joints": [hinge]}},
        )
        model, marched = steps(study, 1.0, 4000, 4000, FOX_GOODWIN)
        found.append(history(model, marched, "ends", 0, 6)[-1])
    assert found[0] == pytest.approx(found[1], abs=1e-4)


def swing(centre: float, amplitude: float, frequency: float) -> dict[str, object]:
    return {"kind": "swing", "centre": centre, "amplitude": amplitude, "frequency": frequency}


#: Of a robot: what each drive steers to, its stiffness and its damping.
DRIVES = {
    "slide": (swing(0.0, 0.4, 0.9), 4e4, 300.0),
    "arm": (swing(0.3, 0.5, 1.3), 3e4, 120.0),
    "forearm": (swing(-0.5, 0.6, 1.7), 9e3, 40.0),
}


def robot_on_a_bed() -> Study:
    """A slide that runs along a rail on a bed which bends, an arm on it and a forearm; the bed is undamped."""

    def link(length: float, mass: float) -> dict[str, object]:
        return {"kind": "rigid", "length": length, "mass": mass, "inertia": mass * length**2 / 12.0, "own_weight": True}

    def joint(name: str, **kind: object) -> list[dict[str, object]]:
        motion, stiffness, damping = DRIVES[name]
        return [kind | {"motion": motion, "stiffness": stiffness, "damping": damping, "start": motion["centre"]}]

    bed = {
        "kind": "beam",
        "length": 6.0,
        "area": 4e-3,
        "second_moment": 4e-6,
        "youngs_modulus": 7e10,
        "density": 2700.0,
        "supports": "pinned-pinned",
        "modes": 3,
        "own_weight": True,
    }
    return Study(
        kind="moving-frames",
        gravity=9.81,
        body={
            "bed": bed,
            "rail": link(0.2, 1.0),
            "slide": link(0.2, 30.0),
            "arm": link(0.8, 15.0),
            "forearm": link(0.6, 8.0),
        },
        frame={
            "rail": {"on": "bed", "at": 2.2},
            "slide": {"on": "rail", "at": 0.0, "joints": joint("slide", kind="prismatic", axis=[1, 0, 0])},
            "arm": {"on": "slide", "at": 0.2, "joints": joint("arm", **HINGE)},
            "forearm": {"on": "arm", "joints": joint("forearm", **HINGE)},
        },
    )


def unbalanced(count: int) -> float:
    """Work of the drives less what their damping takes and what the energy of everything grows by, over that work. A
    drive's force at its joint is -k (q - p) - d (q' - p'), p what it steers to; it is given power by p'. Joints are
    told from the frames of both bodies."""
    model, marched = steps(robot_on_a_bed(), 1.5, count)
    t, bodies = marched.times[0], list(model.bodies)
    frames = marched.history[0][:, frame_signals(model)].reshape(t.size, len(bodies), -1)
    place, velocity, spin, rows = (
        dict(zip(bodies, np.moveaxis(frames[..., part], 1, 0), strict=True))
        for part in (slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 18))
    )
    attitude = {name: own.reshape(-1, 3, 3) for name, own in rows.items()}

    def turned(one: str, other: str) -> tuple[np.ndarray, np.ndarray]:
        between = np.einsum("tji,tjk->tik", attitude[one], attitude[other])
        return np.arctan2(between[:, 0, 2], between[:, 0, 0]), (spin[other] - spin[one])[:, 1]

    along, apart = attitude["rail"][:, :, 0], place["slide"] - place["rail"]
    turning = np.cross(np.einsum("tij,tj->ti", attitude["rail"], spin["rail"]), apart)
    slid = np.sum(along * apart, axis=1), np.sum(along * (velocity["slide"] - velocity["rail"] - turning), axis=1)
    found = {"slide": slid, "arm": turned("slide", "arm"), "forearm": turned("arm", "forearm")}
    work, taken = 0.0, 0.0
    for name, (motion, stiffness, damping) in DRIVES.items():
        phase = 2.0 * np.pi * float(motion["frequency"])
        wanted = motion["centre"] + motion["amplitude"] * np.sin(phase * t)
        rate = motion["amplitude"] * phase * np.cos(phase * t)
        gap, drift = found[name][0] - wanted, found[name][1] - rate
        work += np.trapezoid((-stiffness * gap - damping * drift) * rate, t)
        taken += np.trapezoid(damping * drift**2, t)
    energy = history(model, marched, "whole", 0, 2).sum(axis=1)
    return float(abs(work - taken - (energy[-1] - energy[0])) / work)


def test_the_drives_of_a_robot_on_a_bed_do_the_work() -> None:
    """Work of joint drives = change of energy + dissipation, to 1e-6 at small steps, with order 2."""
    errors = [unbalanced(count) for count in (10_000, 40_000)]
    assert errors[1] < 1e-6
    assert 0.5 * np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("bodies", [{"arm": ARM}, {"arm": ARM, "tip": TIP}], ids=["an arm", "an arm and a rigid body"])
def test_levels_have_more_and_more_steps(bodies: dict[str, object]) -> None:
    """By the same modes; a rigid body leaves none open, though it names none."""
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body=bodies,
        frame={"tip": {"on": "arm"}} if "tip" in bodies else {},
        load={"push": {"on": "arm", "force": [0.0, 0.0, 1.0]}},
        question={"duration": 1.0},
    )
    found = list(levels(study, 1.0, 2))
    assert len(found) == 12
    assert len({level.model.modes for level in found}) == 1
