"""How far places of arms are from where the rigid arm would have them."""

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import studies
from engine.floating.model import build
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.findings.absolute_errors import absolute_errors
from studies.kinds.moving_frames import KIND
from studies.pictures.common.figures import LIMIT
from studies.pictures.moving_frames import pictures
from studies.protocol.study import kind_named, kind_of
from studies.results.formatting import quantity
from studies.results.results import Results

LINK = {
    "kind": "beam",
    "length": 1.5,
    "area": 4e-4,
    "second_moment": 2e-8,
    "youngs_modulus": 7e10,
    "density": 2700.0,
    "supports": "clamped-free",
    "damping_ratio": 0.02,
    "modes": 2,
    "own_weight": True,
}
TIP = {"kind": "rigid", "length": 0.2, "mass": 0.5, "inertia": 0.01, "own_weight": True}
TIMES, ANGLES = [0.0, 0.3, 0.8], [0.1, 0.5, 0.9]
BASE = {"axis": [0.2, 0.4, 1.0], "motion": {"kind": "waypoints", "times": TIMES, "values": ANGLES}}
PUSHED = {"axis": [1.0, 0.0, 0.3], "motion": {"kind": "swing", "centre": 0.05, "amplitude": 0.1, "frequency": 0.9}}
SOFT = {"axis": [0.1, 1.0, 0.0], "stiffness": 600.0, "damping": 9.0, "motion": {"kind": "steady", "rate": 0.7}}
FREE = {"kind": "free"}
HINGE = {"kind": "revolute", "axis": [0, 1, 0]}
STILL = HINGE | {"motion": {"kind": "waypoints", "times": [0, 1], "values": [0, 0]}}
MOVE = HINGE | {"motion": {"kind": "waypoints", "times": [0, 0.5], "values": [0, 0.6]}}


def reads(body: str, at: float, **more: object) -> dict[str, object]:
    return {"body": body, "at": at, "quantity": "position_error"} | more


def arm(body: dict[str, object], frame: dict[str, object], **more: object) -> Study:
    data: dict[str, object] = {"gravity": 9.81, "question": {"duration": 1.0}, "solver": {"tolerance": 1e-2}}
    return Study(**(data | {"kind": "moving-frames", "body": body, "frame": frame} | more))


def in_space() -> Study:
    """A body on two driven joints, a second one on a joint that a controller steers, a third held fast on it."""
    lateral = {"lateral_second_moment": 3e-8, "lateral_modes": 2}
    return arm(
        {"upper": LINK, "lower": LINK | {"length": 1.2}, "tool": TIP},
        {
            "upper": lateral
            | {
                "turned": [0.1, -0.2, 0.3],
                "position": [0.1, 0.2, 0.3],
                "joints": [{"kind": "revolute"} | BASE, {"kind": "prismatic"} | PUSHED],
            },
            "lower": lateral | {"on": "upper", "turned": [0.2, 0.0, -0.4], "joints": [{"kind": "revolute"} | SOFT]},
            "tool": {"on": "lower", "at": 0.7, "turned": [0.3, -0.5, 0.2]},
        },
        sensor={
            "tool": reads("tool", 0.2),
            "across": reads("tool", 0.2, direction=[1.0, -2.0, 2.0]),
            "elbow": reads("upper", 1.5, direction="x"),
            "wrist": reads("lower", 1.2),
        },
        solver={"steps": 2000},
    )


def rigid_arm(times: np.ndarray) -> dict[str, np.ndarray]:
    """(T, 3) the ends of the bodies of `in_space`, none of which bends, on joints that are where they are told."""
    axes = {name: np.array(joint["axis"]) for name, joint in (("base", BASE), ("pushed", PUSHED), ("soft", SOFT))}
    axes = {name: axis / np.linalg.norm(axis) for name, axis in axes.items()}
    turned = CubicSpline(TIMES, ANGLES, bc_type="clamped")(np.minimum(times, TIMES[-1]))
    slid = 0.05 + 0.1 * np.sin(2.0 * np.pi * 0.9 * times)
    found: dict[str, list[np.ndarray]] = {"upper": [], "lower": [], "tool": []}
    for t, angle, way in zip(times, turned, slid, strict=True):
        E = Rotation.from_rotvec([0.1, -0.2, 0.3]) * Rotation.from_rotvec(angle * axes["base"])
        r = np.array([0.1, 0.2, 0.3]) + E.apply(way * axes["pushed"]) + E.apply([1.5, 0.0, 0.0])
        found["upper"].append(r)
        E = E * Rotation.from_rotvec([0.2, 0.0, -0.4]) * Rotation.from_rotvec(0.7 * t * axes["soft"])
        found["lower"].append(r + E.apply([1.2, 0.0, 0.0]))
        r = r + E.apply([0.7, 0.0, 0.0])
        found["tool"].append(r + (E * Rotation.from_rotvec([0.3, -0.5, 0.2])).apply([0.2, 0.0, 0.0]))
    return {name: np.array(places) for name, places in found.items()}


def test_an_arm_in_space_beside_its_ends_and_a_rigid_arm_by_matrices() -> None:
    """Whole histories to 1e-12 m, lengths and directions; extremes are no less than those."""
    found = studies.run(in_space())
    rigid = rigid_arm(found["elapsed"].values)
    apart = {name: found["end_place"].sel(frame=name).values - places for name, places in rigid.items()}
    wanted = {
        "tool": np.linalg.norm(apart["tool"], axis=1),
        "across": apart["tool"] @ [1.0 / 3.0, -2.0 / 3.0, 2.0 / 3.0],
        "elbow": apart["upper"][:, 0],
        "wrist": np.linalg.norm(apart["lower"], axis=1),
    }
    for name, values in wanted.items():
        assert np.ptp(values) > 1e-3, name
        assert found[name].values == pytest.approx(values, abs=1e-12), name
        assert found[f"{name}_max"] >= values.max() - 1e-12
        assert found[f"{name}_min"] <= values.min() + 1e-12
        assert found[f"{name}_rms"] == pytest.approx(np.sqrt(np.mean(values**2)), rel=1e-2)


def test_a_place_within_a_link_beside_its_displacement() -> None:
    """Of one link in a plane what it bends is all, where it does not come nearer by it."""
    sensors = {"off": reads("upper", 0.9), "bend": {"body": "upper", "at": 0.9}}
    found = studies.run(arm({"upper": LINK}, {"upper": {"joints": [MOVE], "stiffening": False}}, sensor=sensors))
    assert found["off"].values == pytest.approx(np.abs(found["bend"].values), abs=1e-14)
    assert found["off_max"] == pytest.approx(max(float(found["bend_max"]), -float(found["bend_min"])), rel=1e-9)
    assert found["off_min"] == 0.0


def test_a_rigid_arm_whose_joint_lags_behind_its_controller() -> None:
    """The chord of the angle that is missed, by the attitude of its frame."""
    joint = HINGE | {"stiffness": 50.0, "damping": 1.0, "motion": {"kind": "steady", "rate": 0.8}}
    study = arm({"tool": TIP}, {"tool": {"joints": [joint]}}, sensor={"tip": reads("tool", 0.2)})
    found = studies.run(study)
    angle = 2.0 * np.arctan2(found["frame_attitude"].sel(quaternion="y"), found["frame_attitude"].sel(quaternion="w"))
    missed = angle.isel(frame=0).values - 0.8 * found["elapsed"].values
    assert np.ptp(missed) > 0.01
    assert found["tip"].values == pytest.approx(np.abs(0.4 * np.sin(0.5 * missed)), abs=1e-12)


def test_a_rigid_arm_that_is_driven_is_where_it_is_told() -> None:
    """To rounding, which is no error that a tolerance could miss; beside a link that bends, so that there is something
    to march."""
    frames = {"upper": {"position": [3.0, 2.0, 1.0], "joints": [{"kind": "revolute"} | BASE]}}
    frames |= {"lower": {"on": "upper", "joints": [MOVE]}, "spring": {"on": "lower"}}
    bodies = {"upper": TIP, "lower": TIP, "spring": LINK}
    sensors = {"tip": reads("lower", 0.2), "down": reads("lower", 0.2, direction="z"), "bent": reads("spring", 1.5)}
    found = studies.run(arm(bodies, frames, sensor=sensors))
    assert found["tip_max"] < 1e-14 and abs(found["down_min"]) < 1e-14 and found["bent_max"] > 1e-3
    assert found["status"] == Status.OK


def still(stiffer: float = 1.0) -> Study:
    """Two links that hang out level, in which all soon rests."""
    body = LINK | {"damping_ratio": 0.8, "modes": 6, "youngs_modulus": 7e11 * stiffer}
    frames = {"upper": {"joints": [STILL]}, "lower": {"on": "upper", "joints": [STILL]}}
    return arm(
        {"upper": body, "lower": body | {"length": 1.2, "second_moment": 1e-8}},
        frames,
        sensor={"tip": reads("lower", 1.2), "down": reads("lower", 1.2, direction="z")},
        question={"duration": 3.0},
        solver={"steps": 2000},
    )


def test_two_level_links_sag_as_cantilevers() -> None:
    """Under their own weight, the second one on the turned end of the first: the closed form to 1e-5."""
    q, EI, length, out = 4e-4 * 2700.0 * 9.81, 7e11 * 2e-8, 1.5, 1.2
    P, M = q * out, 0.5 * q * out**2
    sag = (q * length**4 / 8.0 + P * length**3 / 3.0 + M * length**2 / 2.0) / EI
    turned = (q * length**3 / 6.0 + P * length**2 / 2.0 + M * length) / EI
    wanted = sag + turned * out + q * out**4 / (8.0 * 0.5 * EI)
    found = studies.run(still())
    for name in ("tip", "down"):  # z points down
        assert float(found[name][-1]) == pytest.approx(wanted, rel=1e-5)


def test_a_stiff_arm_is_a_rigid_one() -> None:
    soon = {"question.duration": 0.3}
    soft, stiff = (float(studies.run(still(by).with_values(soon))["tip_max"]) for by in (1.0, 1e4))
    assert 0.0 < stiff < 1.1e-4 * soft


def swung(tolerance: float, **more: object) -> Study:
    """Two links that swing and stop, with a payload."""
    frames = {"upper": {"joints": [MOVE]}, "lower": {"on": "upper", "joints": [MOVE]}, "tool": {"on": "lower"}}
    body = LINK | {"second_moment": 3e-7}
    return arm(
        {"upper": body, "lower": body | {"length": 1.2}, "tool": TIP},
        frames,
        sensor={"tip": reads("tool", 0.2), "down": reads("tool", 0.2, direction="z")},
        sweep={"mass": {"of": "body.tool.mass", "values": [0.3, 0.6]}},
        solver={"tolerance": tolerance},
        **more,
    )


@pytest.fixture(scope="module")
def coarse() -> xr.Dataset:
    return studies.run(swung(1e-2))


def test_what_is_told_of_errors_holds(coarse: xr.Dataset) -> None:
    """Beside the same at a two-hundredth of the tolerance, extremes after the stop too."""
    fine, results = studies.run(swung(5e-5)), Results.of(coarse)
    assert (coarse["status"] == Status.OK).all()
    assert (fine["steps_used"] > 2 * coarse["steps_used"]).all()
    for name in ("tip_max", "tip_after_stop_max", "tip_after_stop_min", "down_max", "down_after_stop_min"):
        apart, told = np.abs(coarse[name] - fine[name]).values, absolute_errors(results, name)
        scale = fine[f"{name.partition('_')[0]}_max"].values
        assert (apart <= told + 5e-5 * scale).all(), name
        assert (told < 1e-2 * fine["down_max"]).all(), name


def test_after_the_stop_is_the_end_of_the_history(coarse: xr.Dataset) -> None:
    after = coarse.where(coarse["elapsed"] >= 0.5 - 1e-9)
    for name in ("tip", "down"):
        scale = abs(coarse[name]).max("station")
        for end, found in {"max": after[name].max("station"), "min": after[name].min("station")}.items():
            value = coarse[f"{name}_after_stop_{end}"]
            assert (abs(value - found) < 2e-3 * scale).all()
            assert (coarse[f"{name}_after_stop_{end}_time"] >= 0.5 - 2e-3).all()
    assert (coarse["tip_after_stop_max"] <= coarse["tip_max"]).all()


def test_extremes_after_a_stop_begin_at_the_stop() -> None:
    """Of an error that grows or falls from there on: they began at the first station behind it, a step off at most, of
    which twice the steps with the same station told nothing."""
    ends, steps = ("max", "min"), np.array([111, 215, 423, 839])  # 0.5 s is within a step of these and of twice as many
    given = arm({"upper": LINK}, {"upper": {"joints": [MOVE]}}, sensor={"tip": reads("upper", 1.5)})
    given = given.with_values({"question.duration": 0.52})
    exact, *found = (studies.run(given.with_values({"solver.steps": int(n)})) for n in (26 * 400, *steps))
    (first,) = (end for end in ends if float(exact[f"tip_after_stop_{end}_time"]) == pytest.approx(0.5, abs=1e-12))
    name = f"tip_after_stop_{first}"
    assert all(float(one[f"{name}_time"]) == pytest.approx(0.5, abs=1e-12) for one in found)
    off = np.array([abs(float(one[name] - exact[name])) for one in found])
    assert -np.polyfit(np.log(steps), np.log(off), 1)[0] == pytest.approx(2.0, abs=0.2)


def test_a_length_is_smallest_where_its_vector_passes_between_stations() -> None:
    """By squares of lengths, which are below 0 there where steps are long, it was told to be 0, without an error."""
    joint, sideways = MOVE | {"axis": [0, 1, 0.02]}, {"lateral_second_moment": 3e-8, "lateral_modes": 1}
    frame, sensor = {"upper": sideways | {"joints": [joint]}}, {"tip": reads("upper", 1.5)}
    given = arm({"upper": LINK}, frame, sensor=sensor, gravity=0.0)
    coarse, fine = (studies.run(given.with_values({"solver.steps": n})) for n in (400, 6400))
    smallest = float(fine["tip_after_stop_min"])
    assert 0.0 < smallest < 1e-3 * float(fine["tip_after_stop_max"])
    assert float(coarse["tip"].where(coarse["elapsed"] > 0.5).min()) > 10.0 * smallest
    assert float(coarse["tip_after_stop_min"]) == pytest.approx(smallest, rel=1e-3)


def test_the_answer_tells_how_far_the_tip_strays(coarse: xr.Dataset) -> None:
    said = KIND.findings(Results.of(coarse))
    whole, after = (next(i for i, one in enumerate(said) if word in one) for word in ("tip: the", "After the stop"))
    most, rest = (quantity(float(coarse[name].max()), "m") for name in ("tip_max", "tip_after_stop_max"))
    assert (
        f"position error at 200 mm of tool, from where the rigid arm would have it, is {most} at mass 0.6 kg"
        in said[whole]
    )
    assert after == whole + 1 and f"up to {rest} at mass 0.6 kg; of all variants least, " in said[after]
    assert any("down: the largest position error at 200 mm of tool along z" in one for one in said)


def test_the_answer_of_one_variant_and_without_a_stop() -> None:
    sensors = {"tip": reads("upper", 1.5, direction=[0, 0, 1])}
    frames = {"upper": {"joints": [HINGE | {"motion": {"kind": "steady", "rate": 0.1}}]}}
    found = studies.run(arm({"upper": LINK}, frames, sensor=sensors, question={"duration": 0.2}))
    most = quantity(max(float(found["tip_max"]), -float(found["tip_min"])), "m")
    said = KIND.findings(Results.of(found))
    assert any("at 1.5 m of upper along (0, 0, 1)" in one for one in said)
    assert any(one.startswith("tip: ") and one.endswith(f"would have it, is {most}.") for one in said)
    assert not any("After the stop" in one for one in said)


def test_a_limit_of_position_errors_is_told(coarse: xr.Dataset) -> None:
    most = float(coarse["tip_max"].max())
    for limit, expected in ((0.5 * most, "exceeds"), (2.0 * most, "nowhere")):
        given = Results.of(coarse).study.with_values({"question.position_error": limit})
        said = next(one for one in kind_of(given).findings(Results(coarse, given)) if one.startswith("tip: "))
        assert "Its absolute value exceeds" in said and expected in said
        (drawn,) = (one for one in pictures(Results(coarse, given)) if one.name == "position-errors")
        assert ("Orange: limits that the study names." in drawn.caption) == (expected == "exceeds")


def test_a_limit_after_the_stop_is_told_behind_it(coarse: xr.Dataset) -> None:
    most = float(np.maximum(coarse["tip_after_stop_max"], -coarse["tip_after_stop_min"]).max())
    for limit, expected in ((0.5 * most, "exceeds"), (2.0 * most, "nowhere")):
        given = Results.of(coarse).study.with_values({"question.residual": {"position_error": limit}})
        said = next(one for one in kind_of(given).findings(Results(coarse, given)) if one.startswith("After the stop"))
        assert "Its absolute value exceeds" in said and expected in said
        (drawn,) = (one for one in pictures(Results(coarse, given)) if one.name == "position-errors")
        lines = [line.get_label() == LIMIT for axes in drawn.drawing.axes for line in axes.get_lines()]
        assert any(lines) == (expected == "exceeds")
        assert {axes.get_yscale() for axes in drawn.drawing.axes} == {"linear"}
    given = Results.of(coarse).study.with_values({"question.residual": {"position_error": 0.01 * most}})
    (drawn,) = (one for one in pictures(Results(coarse, given)) if one.name == "position-errors")
    assert {axes.get_yscale() for axes in drawn.drawing.axes} == {"log"}  # or it would lie on the axis


def test_a_limit_after_the_stop_that_no_sensor_reads_is_refused() -> None:
    question = {"duration": 0.2, "residual": {"position_error": 1e-3}}
    frames = {"upper": {"joints": [HINGE | {"motion": {"kind": "steady", "rate": 0.1}}]}}
    with pytest.raises(BadInput, match=r"question\.residual\.position_error: .* no sensor reads"):
        kind_named("moving-frames").check(arm({"upper": LINK}, frames, question=question))


def test_the_figure_has_both_panels(coarse: xr.Dataset) -> None:
    (figure,) = (one for one in studies.figures(coarse) if one.name == "position-errors")
    assert figure.title.startswith("The largest position error at 200 mm of tool is")
    titles = [axes.get_title(loc="left") for axes in figure.drawing.axes]
    assert titles == [
        f"{tip} {when}" for tip in ("tip", "down along z") for when in ("in the whole time", "after the stop")
    ]


@pytest.mark.parametrize("motion", [{"kind": "swing", "amplitude": 0.2, "frequency": 2.0}, MOVE["motion"]])
def test_without_a_stop_within_the_time_nothing_is_told_after_it(motion: object) -> None:
    frames = {"upper": {"joints": [HINGE | {"motion": motion}]}}
    found = studies.run(arm({"upper": LINK}, frames, sensor={"tip": reads("upper", 1.5)}, question={"duration": 0.4}))
    assert np.isnan(found["tip_after_stop_max"]) and np.isnan(found["tip_after_stop_min_time"])
    assert found["status"] == Status.OK and found["tip_max"] > 0.0


def test_each_tip_stops_with_the_joints_that_carry_it() -> None:
    later = HINGE | {"motion": {"kind": "waypoints", "times": [0, 0.7], "values": [0, 0.2]}}
    frames = {"upper": {"joints": [MOVE]}, "lower": {"on": "upper", "joints": [later]}}
    sensors = {"elbow": reads("upper", 1.5), "tip": reads("lower", 1.5)}
    found = studies.run(arm({"upper": LINK, "lower": LINK}, frames, sensor=sensors))
    elbow, tip = (found[name].where(found["elapsed"] >= end - 1e-9) for name, end in (("elbow", 0.5), ("tip", 0.7)))
    assert found["elbow_after_stop_max"] == pytest.approx(float(elbow.max()), rel=1e-3)
    assert found["tip_after_stop_max"] == pytest.approx(float(tip.max()), rel=1e-3)


@pytest.mark.parametrize(
    ("motion", "stop"),
    [
        ({"kind": "waypoints", "times": [0, 0.8], "positions": [0.5, 1.5]}, 0.8),
        ({"kind": "waypoints", "times": [0, 0.3], "positions": [0.5, 1.5]}, 0.5),
    ],
    ids=["later", "sooner"],
)
def test_a_tip_stops_with_what_slides_along_the_bodies_that_carry_it(motion: dict[str, object], stop: float) -> None:
    load = {"on": "upper", "kind": "mass", "mass": 0.4, "motion": motion}
    sensors = {"tip": reads("upper", 1.5)}
    found = studies.run(arm({"upper": LINK}, {"upper": {"joints": [MOVE]}}, sensor=sensors, carriage={"load": load}))
    tip = found["tip"].where(found["elapsed"] >= stop - 1e-9)
    assert found["tip_after_stop_max"] == pytest.approx(float(tip.max()), rel=1e-3)


@pytest.mark.parametrize(
    ("joint", "on"),
    [(FREE, "upper"), ({"kind": "spherical"}, "lower"), (HINGE, "lower"), (HINGE | {"stiffness": 5.0}, "upper")],
    ids=["free", "spherical", "passive", "on a spring"],
)
def test_an_arm_with_a_joint_that_no_motion_tells_is_refused(joint: dict[str, object], on: str) -> None:
    """It says which joint, wherever in the chain, and what helps; displacements are read all the same."""
    frames: dict[str, dict[str, object]] = {"upper": {"joints": [STILL]}, "lower": {"on": "upper", "joints": [STILL]}}
    frames[on]["joints"] = [joint]
    body = {"upper": TIP, "lower": TIP}
    with pytest.raises(BadInput, match=rf"no motion tells frame\.{on}\.joints\.0") as refused:
        build(arm(body, frames, sensor={"tip": reads("lower", 0.2)}))
    words = str(refused.value)
    assert "sensor.tip.quantity" in words and "every joint that carries lower" in words
    assert 'quantity = "displacement"' in words
    build(arm(body, frames, sensor={"tip": {"body": "lower", "at": 0.2}}))


MASS = {"load": {"kind": "mass", "on": "upper", "mass": 1.0, "motion": {"kind": "free", "start": 0.5}}}


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"sensor": {"t": {"under": "load", "quantity": "position_error"}}, "carriage": MASS}, "a place of a body's"),
        ({"sensor": {"t": {"body": "upper", "at": 1.0, "direction": "z"}}}, 'only nodes.*"position_error" has one'),
        ({"sensor": {"t": reads("upper", 1.0, frequency_limit=3.0)}}, "frequency_limit of position_error"),
        ({"sensor": {"t": reads("upper", 1.0) | {"quantity": "tip-error"}}}, "position_error"),
        ({"envelope": {"t": {"body": "upper", "quantity": "position_error"}}}, "one of displacement"),
        ({"kind": "influence", "frame": {}, "sensor": {"t": reads("upper", 1.0)}}, "no joints carry an arm"),
    ],
)
def test_what_cannot_be_is_refused(tables: dict[str, object], words: str) -> None:
    with pytest.raises(BadInput, match=words):
        kind_of(Study(**({"kind": "moving-frames", "question": {"duration": 1.0}, "body": {"upper": LINK}} | tables)))
