"""Where the theory of frames that move ends: statuses, and the times from which they hold."""

import numpy as np
import pytest

import studies
from engine.floating.model import build
from engine.floating.results import outcome
from engine.floating.theory import MISSING, lacking
from engine.scene.study import Study
from results_schema.status import Status
from studies.kinds.moving_frames import KIND
from studies.results.results import Results
from tests.floating.scenes import ARM, SPIN_UP, steps

RATES = [0.4, 0.9, 6.0]  # rad/s; the arm's lowest frequency is 3.8 rad/s


def spin_up(duration: float, arm: dict[str, object], **more: object) -> Study:
    """The arm of Kane, Ryan and Banerjee (1987)."""
    tables: dict[str, object] = {
        "body": {"arm": ARM | {"modes": 2}},
        "frame": {"arm": {"joints": [SPIN_UP]} | arm},
        "sensor": {"tip": {"body": "arm", "at": 10.0}},
        "question": {"duration": duration},
    }
    return Study(kind="moving-frames", gravity=0.0, **(tables | more))


def test_what_a_body_lacks_is_what_stiffening_gives() -> None:
    """Of a cantilever's first mode 1.193 of the squared rate over its squared frequency (Wright et al. 1982)."""
    model, single = build(spin_up(1.0, {})), build(spin_up(1.0, {}, body={"arm": ARM | {"modes": 1}}))
    body, one, all_of_it = model.bodies["arm"], lacking(single, "arm")[1], lacking(model, "arm")[1]
    assert one * body.omega[0] ** 2 == pytest.approx(1.193, rel=1e-3)
    assert one < all_of_it < 1.05 * one
    assert lacking(model, "arm")[0] == 0.0  # it turns about itself
    assert not lacking(build(spin_up(1.0, {"stiffening": True})), "arm").any()


@pytest.mark.parametrize("mass", [12.0, 120.0])
def test_what_hangs_on_a_body_pulls_at_it_too(mass: float) -> None:
    """A point of mass m at the end: m L int w'^2 over E I int w''^2 by static shapes, within what four modes have."""
    tool = {"kind": "rigid", "length": 0.1, "mass": mass, "inertia": 1e-6, "centre": 0.0}
    arm, joints = ARM | {"modes": 4}, {"joints": [SPIN_UP]}
    study = spin_up(1.0, {}, body={"arm": arm, "tool": tool}, frame={"arm": joints, "tool": {"on": "arm"}})
    # Buckling of a cantilever by a force that keeps its direction: P L^2/(E I) = pi^2/4 where it lacks all of itself
    by_tool = mass * 10.0 * 4.0 * 10.0**2 / (np.pi**2 * 7e10 * 2e-7)
    alone = lacking(build(spin_up(1.0, {}, body={"arm": arm})), "arm")[1]
    assert by_tool < lacking(build(study), "arm")[1] < 1.001 * (by_tool + alone)


def test_the_warning_comes_before_the_march_diverges() -> None:
    """The rate at which 5 % of the stiffness lack is passed seconds before that of the arm's own frequency."""
    study = spin_up(20.0, {})
    model, marched = steps(study, 20.0, 4000, 5)
    found = outcome(model, marched)
    assert found.status[0] == Status.DIVERGED
    (told,) = found.numbers["unstiffened_time"][0]
    rate = 6.0 / 15.0 * told - 6.0 / (2.0 * np.pi) * np.sin(2.0 * np.pi * told / 15.0)
    assert rate == pytest.approx(np.sqrt(MISSING / lacking(model, "arm")[1]), rel=0.02)
    (bent,) = found.numbers["bent_time"][0]
    assert told + 2.0 < bent < found.numbers["duration"][0] or np.isnan(found.numbers["duration"][0])
    assert bent < marched.times[0, -1]


def test_variants_beyond_the_theory_keep_their_values() -> None:
    """A slow rate is fine, a middle one is marked, a fast one diverges; stiffened all are fine."""
    sweep = {"rate": {"of": "frame.arm.joints.0.motion.rate", "values": RATES}}
    expected = spin_up(16.0, {"stiffening": False}, sweep=sweep, expected=["beyond-theory", "diverged"])
    found = studies.run(expected)
    assert found["status"].values.tolist() == [Status.OK, Status.BEYOND_THEORY, Status.DIVERGED]
    assert np.isfinite(found["tip_max"]).values.tolist() == [True, True, False]
    assert np.isfinite(found["unstiffened_time"].sel(frame="arm")).values.tolist() == [False, True, True]
    said = [line for line in KIND.findings(Results.of(found)) if "beyond the theory" in line]
    assert "in 2 variants of 3" in said[0]
    assert "in 1 variant of 3" in said[1]
    stiff, open_ = (studies.run(spin_up(16.0, own, sweep=sweep)) for own in ({"stiffening": True}, {}))
    assert (stiff["status"] == Status.OK).all()
    assert np.isnan(stiff["unstiffened_time"]).all()
    for name in stiff.data_vars:  # left open, it is taken where it counts
        np.testing.assert_array_equal(open_[name].values, stiff[name].values, err_msg=str(name))


def test_check_says_so_before_anything_is_marched() -> None:
    """The largest rate of given motions, of a body and of what holds it; nothing where it is slow, or stiffened."""
    sweep = {"rate": {"of": "frame.arm.joints.0.motion.rate", "values": RATES}}
    off = {"stiffening": False}
    (said,) = KIND.remarks(spin_up(20.0, off, sweep=sweep))
    lacks = lacking(build(spin_up(20.0, {})), "arm").max() * 36.0
    assert lacks == pytest.approx(3.0, rel=0.02)
    assert "up to 6 rad/s" in said and "lacks 300 % of its stiffness" in said
    assert KIND.remarks(spin_up(20.0, {"stiffening": True})) == KIND.remarks(spin_up(20.0, {})) == ()
    assert not any("lacks" in said for said in KIND.remarks(spin_up(2.0, off)))  # it has hardly begun to turn
    hub = {"kind": "rigid", "length": 1.0, "mass": 1.0, "inertia": 1.0}
    frames = {"hub": {"joints": [SPIN_UP]}, "arm": {"on": "hub"} | off}
    (said,) = KIND.remarks(spin_up(20.0, {}, body={"hub": hub, "arm": ARM}, frame=frames))
    assert said.startswith("arm is turned with up to 6 rad/s")


def test_stiffening_is_taken_where_it_counts_and_told_where_it_is_refused() -> None:
    """A quarter turn in three first periods, and the swing after it."""
    turn = {"kind": "waypoints", "times": [0.0, 5.0], "values": [0.0, -1.57]}
    slow = turn | {"times": [0.0, 300.0]}
    arm = {"joints": [{"kind": "revolute", "axis": [0, 1, 0], "motion": turn}]}
    damped = {"arm": ARM | {"modes": 2, "damping_ratio": 0.01}}
    open_, refused, stiff = (
        studies.run(spin_up(10.0, arm | own, body=damped)) for own in ({}, {"stiffening": False}, {"stiffening": True})
    )
    assert float(open_.tip_max) == float(stiff.tip_max)
    off = abs(float(refused.tip_max - stiff.tip_max)) / float(stiff.tip_max)
    told = float(refused.estimated_error.sel(result="tip_max"))
    assert 2e-3 < off < told < 20.0 * off and refused.status == Status.OK
    gentle = spin_up(300.0, {"joints": [arm["joints"][0] | {"motion": slow}]}, body=damped)
    left_open, said = (studies.run(one) for one in (gentle, gentle.with_values({"frame.arm.stiffening": False})))
    assert float(left_open.tip_max) == float(said.tip_max)


def test_what_bends_far_is_marked() -> None:
    """A cantilever under its own weight alone, which bends by 2 w L^4/(8 E I) when it is let go: whatever turns."""
    for density, status in ((1300.0, Status.OK), (1600.0, Status.BEYOND_THEORY)):
        body = ARM | {"density": density, "own_weight": True, "modes": 2}
        study = spin_up(12.0, {"joints": []}, body={"arm": body}, solver={"tolerance": 1e-2}).with_values(
            {"gravity": 9.81}
        )
        tip = 2.0 * density * 4e-4 * 9.81 * 1e4 / (8.0 * 7e10 * 2e-7)
        found = studies.run(study)
        assert found["tip_max"] == pytest.approx(tip, rel=0.05)
        assert found["status"] == status
        assert np.isfinite(found["bent_time"]).all() == (status == Status.BEYOND_THEORY)


def column(masses: list[float], body: dict[str, object], turned: float = 90.0, **more: object) -> Study:
    """The arm on end, with a mass on top: z points down, as gravity does."""
    head = {"kind": "rigid", "length": 0.1, "mass": masses[0], "inertia": 1e-6, "centre": 0.0}
    tables: dict[str, object] = {
        "body": {"arm": ARM | {"modes": 6, "damping_ratio": 0.02} | body, "head": head},
        "frame": {"arm": {"turned": [0, f"{turned} deg", 0]}, "head": {"on": "arm"}},
        "sensor": {"tip": {"body": "arm", "at": 10.0}},
        "sweep": {"m": {"of": "body.head.mass", "values": masses}},
        "question": {"duration": 0.1},
        "expected": ["beyond-theory"],
    }
    return Study(kind="moving-frames", gravity=9.81, **(tables | more))


EULER = np.pi**2 * 7e10 * 2e-7 / (4.0 * 10.0**2) / 9.81  # kg
LIGHT = {"density": 1e-3}


def test_what_buckles_under_what_stands_on_it_is_told() -> None:
    """Euler's load of a cantilever; what stands upright exactly would stand still, and be fine."""
    found = studies.run(column([0.5 * EULER, 0.99 * EULER, 1.01 * EULER], LIGHT))
    ratio = found["buckling_ratio"].sel(frame="arm").values
    np.testing.assert_allclose(ratio, [0.5, 0.99, 1.01], rtol=2e-3)
    assert found["status"].values.tolist() == [Status.OK, Status.OK, Status.BEYOND_THEORY]
    assert np.isnan(found["buckling_ratio"].sel(frame="head")).all()
    (said,) = (line for line in KIND.findings(Results.of(found)) if "buckles" in line)
    assert "in 1 variant of 3" in said and "1.01 times what it can carry" in said
    hanging = studies.run(column([EULER, 9.0 * EULER], LIGHT, turned=-90.0))
    assert np.isnan(hanging["buckling_ratio"]).all() and (hanging["status"] == Status.OK).all()


def test_columns_buckle_by_their_own_weight_and_by_what_stands_halfway() -> None:
    """Greenhill (1881): w L^3/(E I) = 7.8373; a carriage that stands halfway loads half of the column."""
    heavy = {"density": 7.8373 * 7e10 * 2e-7 / (10.0**3 * 9.81 * 4e-4)}
    own = studies.run(column([1e-6], heavy))
    assert own["buckling_ratio"].sel(frame="arm").item() == pytest.approx(1.0, rel=2e-3)
    stands = {"kind": "standing", "at": 5.0}
    carriage = {"kind": "mass", "on": "arm", "mass": 3.0 * EULER, "bilateral": True, "motion": stands}
    halfway = studies.run(column([1e-6], LIGHT, carriage={"table": carriage}))
    assert halfway["buckling_ratio"].sel(frame="arm").item() == pytest.approx(0.75, rel=5e-3)


def test_a_column_sways_more_under_what_stands_on_it_though_it_has_no_joint() -> None:
    """H (tan kL - kL)/(k P), k^2 = P/(E I); a mast that was clamped to the ground, and left open, was not softened.
    Beyond Euler's load it finds no rest, and others keep their values."""
    H, shares = 2.0, np.array([0.2, 0.6, 1.2])
    P = shares[:2] * EULER * 9.81
    k = np.sqrt(P / (7e10 * 2e-7))
    head = {"kind": "mass", "on": "arm", "bilateral": True, "mass": 1.0, "motion": {"kind": "standing", "at": 10.0}}
    study = column(
        [1e-6],
        LIGHT,
        carriage={"head": head},
        load={"wind": {"on": "arm", "at": 10.0, "force": [H, 0.0, 0.0]}},
        sweep={"m": {"of": "carriage.head.mass", "values": list(shares * EULER)}},
        initial="equilibrium",
    )
    found = studies.run(study)
    assert found["status"].values.tolist() == [Status.OK, Status.OK, Status.NOT_CONVERGED]
    sways = np.abs(found["tip_max"].values[:2])
    np.testing.assert_allclose(sways, H * (np.tan(10.0 * k) - 10.0 * k) / (k * P), rtol=2e-3)
