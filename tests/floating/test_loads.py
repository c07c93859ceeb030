"""Loads at places of bodies and along them, and springs between places: statics, buckling, energy, another
formulation."""

import numpy as np
import pytest

from engine.floating.model import build
from engine.floating.results import outcome
from engine.scene.study import Study
from tests.floating.scenes import ARM, FLYER, history, steps

LENGTH, STIFFNESS, PER_METRE = 10.0, 7e10 * 2e-7, 1.2


def cantilever(loads: dict[str, object], **frame: object) -> Study:
    """The arm on the ground, heavily damped."""
    return Study(
        kind="moving-frames",
        gravity=0.0,
        body={"arm": ARM | {"modes": 12, "damping_ratio": 0.7}},
        frame={"arm": frame},
        load=loads,
        sensor={"tip": {"body": "arm", "at": LENGTH}},
        question={"duration": 20.0},
    )


def settled(study: Study, duration: float = 25.0, count: int = 5000) -> float:
    """The tip's deflection when it has come to rest, m."""
    model, marched = steps(study, duration, count, count)
    assert marched.status[0] == 0
    return float(history(model, marched, "sensors")[-1, 0])


STATIC = {
    "force at the end": ({"force": [0, 0, 14.0]}, 14.0 * LENGTH**3 / (3.0 * STIFFNESS)),
    "force at a place": ({"at": 4.0, "force": [0, 0, 50.0]}, 50.0 * 16.0 * (30.0 - 4.0) / (6.0 * STIFFNESS)),
    "force along it": ({"between": [0.0, LENGTH], "force_per_metre": [0, 0, 2.0]}, 2.0 * LENGTH**4 / (8.0 * STIFFNESS)),
    "torque at the end": ({"torque": [0, -30.0, 0]}, 30.0 * LENGTH**2 / (2.0 * STIFFNESS)),
    "torque along it": (
        {"between": [0.0, LENGTH], "torque_per_metre": [0, -6.0, 0]},
        6.0 * LENGTH**3 / (3.0 * STIFFNESS),
    ),
}


@pytest.mark.parametrize(("load", "wanted"), STATIC.values(), ids=STATIC)
def test_loads_bend_as_in_statics(load: dict[str, object], wanted: float) -> None:
    """Euler-Bernoulli's cantilever, to what twelve modes leave."""
    assert settled(cantilever({"push": {"on": "arm", **load}})) == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize("axial", [-0.5, 0.5])
def test_an_axial_force_bends_or_straightens(axial: float) -> None:
    """A force across with one along, in parts of Euler's load: the tip by tan(k L)/(k L) or tanh; and none of it
    without stiffening."""
    critical = np.pi**2 * STIFFNESS / (4.0 * LENGTH**2)
    P, Q = axial * critical, 5.0
    k = np.sqrt(abs(P) / STIFFNESS)
    ratio = (np.tan(k * LENGTH) / k - LENGTH) if P < 0.0 else (LENGTH - np.tanh(k * LENGTH) / k)
    push = {"push": {"on": "arm", "force": [P, 0.0, Q]}}
    assert settled(cantilever(push, stiffening=True), 40.0) == pytest.approx(Q / abs(P) * ratio, rel=2e-3)
    assert settled(cantilever(push)) == pytest.approx(Q * LENGTH**3 / (3.0 * STIFFNESS), rel=2e-3)


@pytest.mark.parametrize("by", ["a load", "its weight"])
def test_an_axial_load_along_a_beam_bends_it(by: str) -> None:
    """As a column under its own weight, or by that: the lowest q that bends it is 7.837 E I/L^3 (Greenhill), so that
    half of it makes a force across bend it about twice as far; by statics of the modes."""
    q = 0.5 * 7.837 * STIFFNESS / LENGTH**3
    loads: dict[str, object] = {"across": {"on": "arm", "force": [0.0, 0.0, 5.0], "axes": "body"}}
    if by == "a load":
        loads["down"] = {"on": "arm", "between": [0.0, LENGTH], "force_per_metre": [-q, 0.0, 0.0]}
        study = cantilever(loads, stiffening=True)
    else:  # x is up
        study = cantilever(loads, stiffening=True, turned=[0.0, 0.5 * np.pi, 0.0])
        study = study.with_values({"gravity": q / PER_METRE, "body.arm.own_weight": True})
    # w'' E I = Q (L - x) + q int_x^L (w(s) - w(x)) ds, by differences
    x, h = np.linspace(0.0, LENGTH, 2001, retstep=True)
    slope = np.zeros(x.size)
    for _ in range(60):  # slope' ' = -(Q + q (L - x) slope)/E I, slope(0) = 0, slope'(L) = 0
        load = (5.0 + q * (LENGTH - x) * slope) / STIFFNESS
        further = np.concatenate([np.cumsum((0.5 * (load[1:] + load[:-1]) * h)[::-1])[::-1], [0.0]])
        slope = np.concatenate([[0.0], np.cumsum(0.5 * (further[1:] + further[:-1]) * h)])
    wanted = float(np.sum(0.5 * (slope[1:] + slope[:-1]) * h))
    assert wanted > 1.8 * 5.0 * LENGTH**3 / (3.0 * STIFFNESS)
    assert settled(study, 40.0) == pytest.approx(wanted, rel=2e-3)


def test_impulses_become_momenta() -> None:
    """A free body that is pushed off its middle and twisted, both in the ground's axes: momentum is the force's
    integral, angular momentum that of the torque and of r x f, with order 2."""
    swing = {"kind": "swing", "centre": 1.0, "amplitude": 0.5, "frequency": 0.7}
    force, torque = np.array([30.0, -20.0, 60.0]), np.array([5.0, 40.0, -10.0])
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"hull": FLYER},
        frame={"hull": {"joints": [{"kind": "free", "rate": [0.1, 0.3, 0.2]}]}},
        load={"jet": {"on": "hull", "force": list(force), "torque": list(torque), "course": swing}},
    )
    gaps = []
    for count in (4000, 8000):
        model, marched = steps(study, 2.0, count)
        t = marched.times[0]
        factor = 1.0 + 0.5 * np.sin(2.0 * np.pi * 0.7 * t)
        whole, end = history(model, marched, "whole", 2, 6), history(model, marched, "ends", 0, 3)
        rates = factor[:, None] * np.concatenate([np.tile(force, (t.size, 1)), torque + np.cross(end, force)], axis=1)
        h = t[1] - t[0]
        impulse = h / 3.0 * (rates[0] + rates[-1] + 4.0 * rates[1:-1:2].sum(axis=0) + 2.0 * rates[2:-1:2].sum(axis=0))
        gaps.append(np.abs(whole[-1] - whole[0] - impulse).max() / np.abs(impulse).max())
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2.0, abs=0.2)
    assert gaps[1] < 1e-5


def test_springs_between_bodies_keep_energy() -> None:
    """Two free bodies joined by two springs, one of them to the ground: order 2; momentum changes by the ground's
    alone."""
    free = {"kind": "free"}
    links = {
        "tether": {"ends": [{"on": "one"}, {"on": "two", "at": 0.0}], "stiffness": 400.0, "length": 0.5},
        "anchor": {"ends": [{"on": "two", "at": 5.0}, {"position": [8.0, 0.0, 3.0]}], "stiffness": 50.0, "length": 1.0},
    }
    joints = {
        "one": {"joints": [free | {"rate": [0.0, 0.4, 0.1]}]},
        "two": {"position": [11.0, 0.5, 0.2], "joints": [free]},
    }
    study = Study(kind="moving-frames", gravity=0.0, body={"one": FLYER, "two": FLYER}, frame=joints, spring=links)
    drifts = []
    for count in (2000, 4000):
        model, marched = steps(study, 4.0, count, 10)
        kinetic, potential = history(model, marched, "whole", 0, 2).T
        assert np.ptp(potential) > 0.3 * potential[0] > 0.0
        drifts.append(np.abs(kinetic + potential - kinetic[0] - potential[0]).max() / potential[0])
    assert drifts[0] < 1e-3
    assert np.log2(drifts[0] / drifts[1]) == pytest.approx(2.0, abs=0.3)


def test_a_spring_at_a_track_that_grows_shorter_keeps_energy() -> None:
    """It pulls obliquely at a beam's end, which comes nearer by half of int w'^2: order 2."""
    spring = {"ends": [{"on": "arm"}, {"position": [14.0, 0.0, 3.0]}], "stiffness": 40.0, "length": 1.0}
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"arm": ARM | {"modes": 3}},
        frame={"arm": {"stiffening": True}},
        spring={"stay": spring},
    )
    drifts = []
    for count in (4000, 8000):
        model, marched = steps(study, 4.0, count, 10)
        kinetic, potential = history(model, marched, "whole", 0, 2).T
        assert np.ptp(potential) > 0.05 * potential[0] > 0.0
        drifts.append(np.abs(kinetic + potential - potential[0]).max() / np.ptp(potential))
    assert drifts[1] < 1e-4
    assert np.log2(drifts[0] / drifts[1]) == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("stiffness", [1e2, 1e6])
def test_a_body_between_two_springs_rests(stiffness: float) -> None:
    """Pulled as far by either."""
    for place in np.linspace(0.3, 2.9, 6):
        one, other = ([place + 0.5 + side, 0.2, 0.1] for side in (1.7, -1.7))
        study = Study(
            kind="moving-frames",
            gravity=0.0,
            body={"block": {"kind": "rigid", "length": 1.0, "mass": 3.7, "inertia": 0.31}},
            frame={"block": {"position": [place, 0.2, 0.1], "joints": [{"kind": "free"}]}},
            spring={
                name: {
                    "ends": [{"on": "block", "at": 0.5}, {"position": end}],
                    "stiffness": stiffness,
                    "length": 0.6,
                }
                for name, end in (("one", one), ("other", other))
            },
            question={"duration": 0.1},
        )
        model, found = steps(study, 0.1, 800)
        assert found.status[0] == 0
        assert np.abs(history(model, found, "ends")[:, 0] - place - 1.0).max() < 1e-12


@pytest.mark.parametrize("count", [25, 26, 27])
def test_extremes_lie_between_stations(count: int) -> None:
    """Of a beam that is let go: its end swings from 0 to twice what its weight deflects it at rest, and no step ends at
    the top. At stations alone 0.05 to 0.17 % of it are missing; rates are told as they are there."""
    arm = ARM | {"modes": 1, "own_weight": True, "second_moment": 2e-5}
    tip = {"body": "arm", "at": LENGTH}
    study = Study(
        kind="moving-frames",
        gravity=9.81,
        body={"arm": arm},
        sensor={"tip": tip, "speed": tip | {"quantity": "velocity"}},
        question={"duration": 1.0},
    )
    omega = build(study).first_omega
    model, marched = steps(study, 1.02 * 2.0 * np.pi / omega, count)
    found, twice = outcome(model, marched).numbers, 2.0 * settled(study.with_values({"body.arm.damping_ratio": 0.7}))
    assert found["tip_max"][0] == pytest.approx(twice, rel=1e-4)
    assert found["tip_max_time"][0] == pytest.approx(np.pi / omega, rel=0.01)
    assert history(model, marched, "sensors")[:, 0].max() < twice * (1.0 - 4e-4)
    assert found["speed_max"][0] == history(model, marched, "sensors", 1).max()
