"""Studies of bodies whose frames move: from the study file to the dataset and its sentences."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import studies
from engine.floating.model_choice import choose
from engine.scene.study import Study, load
from engine.scene.sweep import expand
from engine.scene.variants import VariantValues
from results_schema.errors import BadInput
from results_schema.status import Status
from results_schema.store.archive import open_archive
from studies.commands.catalogue import built_in
from studies.commands.preview import preview
from studies.kinds.sliding_mass import KIND
from studies.moving.parts import periods
from studies.pictures.moving_frames import pictures
from studies.protocol.options import RunOptions
from studies.protocol.study import kind_of
from studies.results.formatting import quantity, spanned
from studies.results.results import Results
from studies.runs.runner import run_to_archive
from tests.floating.scenes import ARM, PAPER_BEAM, sliding_mass

SWEPT = {
    "mass": {"of": "carriage.load.mass", "values": [50.0, 100.0]},
    "damping": {"of": "body.beam.damping_ratio", "values": [0.0, 0.02]},
}


def paper(duration: float = 6.0, **more: object) -> Study:
    """The paper's beam with a sweep."""
    data = sliding_mass().data | {"kind": "sliding-mass", "question": {"duration": duration}, "sweep": SWEPT}
    return Study(**{key: value for key, value in (data | more).items() if key != "schema_version"})


@pytest.mark.fault(20)
def test_a_sweep_is_the_same_whatever_shares_it_out() -> None:
    one, two = (studies.run(paper(), threads=threads) for threads in (1, 2))
    for name, variable in one.variables.items():
        assert variable.equals(two[name].variable), name
    assert one["status"].dims == ("mass", "damping")
    assert (one["status"] != Status.TOLERANCE_MISSED).all()
    assert one["load_position"].dims == ("mass", "damping", "station")
    assert one["load_period"].shape == (2, 2)


def test_what_is_told_of_errors_holds() -> None:
    """Against the same at a hundredth of the tolerance."""
    found = studies.run(paper())
    better = studies.run(paper(solver={"tolerance": 1e-6}))
    assert (better["steps_used"] > found["steps_used"]).any()
    gap = np.abs(found["load_position"] - better["load_position"]).max("station") / 15.0
    told = found["estimated_error"].sel(result="load_position_max")
    assert (gap < 1e-3).all()
    assert (gap <= told + 1e-6).all()


def test_the_answer_stands_beside_the_paper() -> None:
    study = paper()
    said = KIND.findings(Results.of(studies.run(study)))
    assert "period" not in said[0]  # six seconds are less than one
    assert any("reaches 16.75 m/s²" in sentence and "it is 20." in sentence for sentence in said)


def test_another_body_does_not_stand_beside_the_paper() -> None:
    found = studies.run(paper(0.5))
    for key, value in {"length": 16.0, "second_moment": 9e-6, "modes": "auto", "supports": "clamped-clamped"}.items():
        other = paper(0.5, body={"beam": PAPER_BEAM | {key: value}})
        assert "Hartweg" not in "".join(KIND.findings(Results.of(found, other)))
    assert "Hartweg" in "".join(KIND.findings(Results.of(found)))


def test_what_each_swept_number_does_is_told() -> None:
    """Of the sensor that the answer begins with: the worst of all others that are swept, in one march and another."""
    stiffness = {"of": "body.beam.youngs_modulus", "values": [2.1e11, 4.2e11]}
    swept = {"mass": SWEPT["mass"], "stiffness": stiffness}
    dataset = studies.run(paper(0.5, sensor={"middle": {"body": "beam", "at": 7.5}}, sweep=swept))
    said = " ".join(KIND.findings(Results.of(dataset)))
    size = np.maximum(np.abs(dataset["middle_max"]), np.abs(dataset["middle_min"])).max("mass").values
    fall = re.search(r"With the worst .* the largest displacement falls by (\S+) % over stiffness 210 to 420 GPa", said)
    assert fall is not None and float(fall[1]) == pytest.approx(100.0 * (1.0 - size[1] / size[0]), abs=0.5)


def test_a_kind_with_figures() -> None:
    dataset = studies.run(paper())
    names = [figure.name for figure in studies.figures(dataset)]
    assert {"histories", "load-portrait"} <= set(names)


def test_a_mass_that_lifts_off_is_marked() -> None:
    study = paper().with_values({"carriage.load.motion.start": 4.0})
    status = studies.run(study)["status"]
    assert status.sel(mass=100.0, damping=0.0) == Status.SEPARATED
    assert status.sel(mass=50.0, damping=0.02) == Status.OK


@pytest.mark.parametrize("histories", ["all", "none"])
def test_a_mass_that_slides_over_an_end_is_archived(histories: str, tmp_path: Path) -> None:
    """Its histories end there, of places with three numbers too; and where no variant has a history."""
    study = paper(3.0, output={"histories": histories}).with_values({"carriage.load.motion.speed": 6.0})
    outcome = run_to_archive(study, tmp_path / "off.nc", RunOptions())
    found = open_archive(outcome.archive).root
    assert (found["status"] == Status.SEPARATED).all() and (found["duration"] < 2.5).all()
    assert ("end_place" in found) == (histories == "all")
    if histories == "all":
        gone = np.isnan(found["end_place"]).all(dim=("frame", "component"))
        assert not gone.isel(station=0).any() and gone.isel(station=-1).all()


def test_open_modes_are_as_many_as_pilots_find_enough() -> None:
    """What these leave out is told, beside the same with eight modes; a tighter tolerance takes more of them."""
    paper_of = {"body.beam.modes": "auto", "solver.tolerance": 1e-2}
    found, finer = (
        studies.run(paper(2.0, sweep={}).with_values(paper_of | more)) for more in ({}, {"solver.tolerance": 1e-3})
    )
    eight = studies.run(paper(2.0, sweep={}).with_values({"body.beam.modes": 8, "solver.tolerance": 1e-4}))
    assert found["modes_used"] < finer["modes_used"] and found["status"] == Status.OK
    apart = abs(found["load_position_max"] - eight["load_position_max"]) / 15.0
    assert 0.0 < apart < found["estimated_error"].sel(result="load_position_max") < 1e-2


def test_what_fixed_modes_leave_out_is_told_and_not_held() -> None:
    """One mode of the paper beside eight: no error is told smaller than it is, and none makes a status."""
    one, eight = (
        studies.run(paper(2.0, sweep={}).with_values({"body.beam.modes": modes, "solver.tolerance": 1e-3}))
        for modes in (1, 8)
    )
    assert one["status"] == Status.OK
    for name, scale in {"load_position_max": 15.0, "load_speed_max": abs(float(eight["load_speed_max"]))}.items():
        apart = abs(one[name] - eight[name]) / scale
        assert 1e-4 < apart < one["estimated_error"].sel(result=name) < 300.0 * apart
    alone = one["estimated_error"].sel(result="load_contact_force_max")
    assert alone > 0.05


def test_what_fixed_modes_across_the_track_leave_out_is_told_beside_open_ones() -> None:
    flyer = load(built_in()["free-flyer"]).without_sweep()
    given = {"body.hull.modes": "auto", "frame.hull.lateral_modes": 1, "frame.hull.joints.0.rate.2": 0.1}
    study = flyer.with_values(given | {"question.duration": 5.0})
    one = choose(study, VariantValues(study, {}, 1), np.full(1, 5.0), 5.0)
    flat = study.with_values({"frame.hull.lateral_modes": 0})
    none = choose(flat, VariantValues(flat, {}, 1), np.full(1, 5.0), 5.0)
    assert np.nanmax(one.by_fixed.error) > 1e-6 and not none.by_fixed.error.any()


def test_every_kind_that_keeps_bodies_still_refuses_frames() -> None:
    with pytest.raises(BadInput, match=r"load\.push"):
        kind_of(Study(kind="eigenfrequencies", body={"arm": ARM}, load={"push": {"on": "arm", "force": [0, 0, 1]}}))
    data = {key: value for key, value in sliding_mass().data.items() if key not in ("schema_version", "question")}
    with pytest.raises(BadInput, match="carriages go where they are told") as refused:
        kind_of(Study(**(data | {"kind": "trajectory"})))
    assert 'kind = "moving-frames"' in str(refused.value)


def broken(**tables: object) -> Callable[[], object]:
    data = {key: value for key, value in sliding_mass().data.items() if key != "schema_version"}
    return lambda: kind_of(Study(**(data | tables))).parts(Study(**(data | tables)))


LOAD = {"kind": "mass", "on": "beam", "mass": 1.0, "motion": {"kind": "free", "start": 2.0}}
REVOLUTE = {"kind": "revolute", "axis": [0, 1, 0]}
PRISMATIC = {"kind": "prismatic", "axis": [0, 1, 0]}
STEADY = {"kind": "steady", "rate": "1 deg/s"}
TOP = {"position": [0, 0, 1]}
SENSOR = {"body": "beam", "at": 0.0}
PUSH = {"carriage": "load", "quantity": "contact_force"}


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"initial": "equilibrium"}, "slides freely"),
        ({"question": {}}, r"question\.duration"),
        ({"output": {"histories": {"every": 3}}}, "some 800 times"),
        ({"solver": {"scheme": "central-difference", "fidelity": "force"}}, "have no such model"),
        ({"carriage": {"load": LOAD | {"kind": "force", "force": 1.0, "mass": None}}}, "mass"),
        ({"carriage": {"load": LOAD | {"delay": 1.0}}}, "set off at time 0"),
        ({"carriage": {"load": LOAD | {"motion": {"kind": "free", "start": 20.0}}}}, "starts on its body"),
        ({"frame": {"other": {}}}, "no such body"),
        ({"frame": {"beam": {"at": 1.0}}}, "the ground has no track"),
        ({"frame": {"beam": {"joints": [REVOLUTE | {"axis": [0, 0, 0]}]}}}, "this direction has no length"),
        ({"frame": {"beam": {"joints": [REVOLUTE | {"stiffness": "1 N/m"}]}}}, "rotational stiffness"),
        ({"frame": {"beam": {"joints": [REVOLUTE | {"rate": "1 Hz"}]}}}, r"rate of turning \(rad/s\)"),
        ({"frame": {"beam": {"joints": [PRISMATIC | {"start": "1 deg"}]}}}, r"a length \(m\)"),
        ({"frame": {"beam": {"joints": [PRISMATIC | {"motion": STEADY}]}}}, "a speed"),
        ({"load": {"p": {"on": "other", "force": [0, 0, 1]}}}, "no such body"),
        ({"load": {"p": {"on": "beam"}}}, "a load without a force"),
        ({"load": {"p": {"on": "beam", "at": 20.0, "force": [0, 0, 1]}}}, "a load off its body"),
        ({"load": {"p": {"on": "beam", "force_per_metre": [0, 0, 1]}}}, "does not fit this load"),
        ({"load": {"p": {"on": "beam", "between": [3, 2], "force_per_metre": [0, 0, 1]}}}, "begins at the one"),
        ({"load": {"p": {"on": "beam", "force": [0, 0, "1 N m"]}}}, r"a force \(N\)"),
        ({"spring": {"s": {"ends": [{"on": "beam"}, {}], "length": 1.0}}}, "on a body or over the ground"),
        ({"spring": {"s": {"ends": [{"on": "beam", "at": -1}, TOP], "length": 1.0}}}, r"ends\.0\.at"),
        ({"spring": {"s": {"ends": [{"on": "that"}, TOP], "length": 1.0}}}, "no such body"),
        ({"frame": {"beam": {"lateral_modes": 2}}}, "lateral_second_moment"),
        ({"sensor": {"under": {"under": "load", "quantity": "velocity"}}}, "only the displacement"),
        ({"sensor": {"push": PUSH}}, r"without a sensor; .*remedy: load_contact_force_max, load_contact_force_min and"),
        ({"sensor": {"under": {"under": "load", "quantity": "acceleration"}}}, "the history load_acceleration_z in"),
        ({"sensor": {"low": SENSOR | {"quantity": "velocity", "frequency_limit": 3.0}}}, "read all modes"),
        ({"sensor": {"foot": SENSOR | {"quantity": "support_reaction"}}}, "supports of bodies in frames that move"),
    ],
)
def test_what_cannot_be_is_refused(tables: dict[str, object], words: str) -> None:
    with pytest.raises(BadInput, match=words):
        broken(**tables)()


def test_numbers_of_joints_may_be_swept() -> None:
    joint = REVOLUTE | {"motion": {"kind": "spin-up", "rate": 1.0, "time": 1.0}}
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"arm": ARM | {"modes": 2}},
        frame={"arm": {"joints": [joint], "stiffening": True}},
        sensor={"tip": {"body": "arm", "at": 10.0}},
        sweep={"rate": {"of": "frame.arm.joints.0.motion.rate", "values": [0.5, 1.0]}},
        question={"duration": 1.5},
    )
    assert expand(study).size == 2
    tip = studies.run(study)["tip_max"]
    assert tip[1] > 1.5 * tip[0] > 0.0


def spun_up(rates: list[float], steps: object = "auto", **more: object) -> xr.Dataset:
    """An arm that is spun up to some rates."""
    joint = REVOLUTE | {"motion": {"kind": "spin-up", "rate": 1.0, "time": 15.0}}
    sweep = {"rate": {"of": "frame.arm.joints.0.motion.rate", "values": rates}} | more
    return studies.run(
        Study(
            kind="moving-frames",
            gravity=0.0,
            body={"arm": ARM},
            frame={"arm": {"joints": [joint], "stiffening": True}},
            sensor={"tip": {"body": "arm", "at": 10.0}},
            sweep=sweep,
            solver={"steps": steps},
            question={"duration": 20.0},
        )
    )


@pytest.mark.fault(22)
def test_a_variant_that_does_not_converge_is_so_alone() -> None:
    """Newton's method finds no step for a mass on which dry friction sets in like a switch; that of the other variant,
    which slides freely, stays as it is."""

    def slid(coulomb: list[float]) -> xr.Dataset:
        motion = {"kind": "free", "start": 2.0, "slip_speed": 1e-9}
        load = {"kind": "mass", "on": "beam", "mass": 100.0, "motion": motion}
        sweep = {"coulomb": {"of": "carriage.load.motion.coulomb", "values": coulomb}}
        return studies.run(paper(2.0, carriage={"load": load}, sweep=sweep, solver={"steps": 100}))

    both, alone = slid([0.3, 0.0]), slid([0.0])
    assert both["status"].values.tolist() == [Status.NOT_CONVERGED, Status.OK]
    for name in ("load_position_max", "load_position", "end_place", "frame_rate"):
        values = both[name].transpose("coulomb", ...).values
        assert np.isnan(values[0]).all() and np.isfinite(values[1]).all(), name
        assert values[1].tobytes() == alone[name].transpose("coulomb", ...).values[0].tobytes(), name


def test_steps_are_those_of_all_variants() -> None:
    with pytest.raises(BadInput, match=r"sweep\.count\.of.*share their steps"):
        spun_up([1.0, 2.0], count={"of": "solver.steps", "values": [50, 100]})


def test_numbers_of_joints_have_units() -> None:
    """Degrees and millimetres beside the same in SI, also where they are swept; `rate` has the unit of its joint."""
    turn = REVOLUTE | {"stiffness": "3 kN m/rad", "damping": "2 N m s/rad", "start": "3 deg", "rate": "30 deg/s"}
    slide = PRISMATIC | {"stiffness": "40 N/mm", "damping": "5 N s/mm", "start": "2 mm", "rate": "-20 mm/s"}
    plain = [
        REVOLUTE | {"stiffness": 3000.0, "damping": 2.0, "start": np.pi / 60.0, "rate": np.pi / 6.0},
        PRISMATIC | {"stiffness": 4e4, "damping": 5e3, "start": 2e-3, "rate": -0.02},
    ]

    def ends(joints: list[dict[str, object]], turned: list[object], rates: list[object]) -> np.ndarray:
        study = Study(
            kind="moving-frames",
            gravity=0.0,
            body={"arm": ARM | {"modes": 1}},
            frame={"arm": {"joints": joints, "turned": turned}},
            sensor={"tip": {"body": "arm", "at": 10.0}},
            sweep={"rate": {"of": "frame.arm.joints.0.rate", "values": rates}},
            question={"duration": 0.5},
        )
        assert expand(study).axes[0].units == "rad s-1"
        return np.asarray(studies.run(study)["end_place"].values)

    wanted = ends(plain, [0.0, np.pi / 2.0, 0.0], [np.pi / 6.0, np.pi / 3.0])
    assert ends([turn, slide], [0, "90 deg", 0], ["30 deg/s", "10 rpm"]) == pytest.approx(wanted, abs=1e-12)


def test_open_modes_hold_a_tight_tolerance() -> None:
    """Faster modes ask a scheme with a limit for more steps: beside many modes at a hundredth of the tolerance."""
    body = {"beam": PAPER_BEAM | {"modes": "auto"}}
    found = studies.run(paper(body=body, solver={"tolerance": 1e-4}))
    better = studies.run(paper(body={"beam": PAPER_BEAM | {"modes": 24}}, solver={"tolerance": 1e-6}))
    assert (found["status"] < Status.UNRESOLVED).all()
    for name in ("load_position_max", "load_position_min"):
        assert found[name].values == pytest.approx(better[name].values, abs=1e-4 * 15.0)


def test_periods_of_histories() -> None:
    """Of sines at few stations, one of which lie on the middle, one that ends early, one that passes it once."""
    times = np.tile(np.linspace(0.0, 60.0, 241), (4, 1))
    rate = 2.0 * np.pi / np.array([9.3, 8.0, 7.1, 200.0])[:, None]
    places, speeds = 7.0 + 5.0 * np.sin(rate * times), 5.0 * rate * np.cos(rate * times)
    places[2, 200:] = np.nan
    assert periods(times, places, speeds) == pytest.approx([9.3, 8.0, 7.1, np.nan], rel=1e-4, nan_ok=True)


def test_a_job_without_histories() -> None:
    """More variants than have one: the numbers of all are there."""
    study = paper(2.0, sweep={"mass": {"of": "carriage.load.mass", "from": 20.0, "to": 90.0, "count": 90}})
    found = studies.run(study)
    assert found["load_position_max"].notnull().all()
    assert found.sizes["history"] < 90


def test_numbers_of_loads_and_springs_may_be_swept() -> None:
    """Each variant has its own, with units; one by one they are the same."""
    tables: dict[str, object] = {
        "body": {"arm": ARM | {"modes": 2}},
        "load": {
            "push": {
                "on": "arm",
                "between": [2, "800 cm"],
                "force_per_metre": [0, 0, "2 N/m"],
                "torque_per_metre": [0, "1 N m/m", 0],
                "course": {"kind": "swing", "amplitude": 1.0, "frequency": 0.3},
            }
        },
        "spring": {"prop": {"ends": [{"on": "arm"}, {"position": [10, 0, 1]}], "length": 1, "stiffness": "20 N/m"}},
        "sensor": {"tip": {"body": "arm", "at": 10.0}},
    }
    sweep = {
        "push": {"of": "load.push.force_per_metre.2", "values": ["1 N/m", "3 N/m"]},
        "often": {"of": "load.push.course.frequency", "values": [0.2, 0.5]},
        "soft": {"of": "spring.prop.stiffness", "values": [0.0, "1 kN/m"]},
    }
    study = Study(kind="moving-frames", gravity=0.0, question={"duration": 4.0}, sweep=sweep, **tables)
    found = studies.run(study)
    assert (found["status"] == Status.OK).all()
    for place in np.ndindex(2, 2, 2):
        own = {axis["of"]: axis["values"][k] for axis, k in zip(sweep.values(), place, strict=True)}
        alone = studies.run(
            Study(kind="moving-frames", gravity=0.0, question={"duration": 4.0}, **tables).with_values(own)
        )
        assert found["tip_max"].values[place] == pytest.approx(float(alone["tip_max"]), rel=1e-9)


def test_a_check_forecasts_by_pieces_that_it_computes() -> None:
    """What these were marched with is what a run marches them with; it takes as long for each more."""
    study = paper(2.0)
    found, shown = studies.run(study), preview(kind_of(study).parts(study), 1)
    table = next(table for table in shown.tables if table.title == "What 1 piece of 1 took, as in a run")
    ((variants, modes, steps, error, status),) = table.rows
    used = found["steps_used"].values
    assert (variants, modes, status) == ("0 to 3", "1", "ok")
    assert steps == spanned(used.reshape(-1).astype(float)) and float(error) < 0.01
    assert re.match(r"About \S+ (ms|s|min) on 1 thread, about .* for the archive", shown.cost)  # by the clock


def test_a_limit_is_told_with_where_it_is_exceeded() -> None:
    """In words and in the figure, of the quantity that has one; the energy in words too."""
    joint = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "spin-up", "rate": 1.0, "time": 1.0}}
    moment = {"body": "arm", "at": 0.0, "quantity": "bending_moment"}
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"arm": ARM | {"modes": 2}},
        frame={"arm": {"joints": [joint], "stiffening": True}},
        sensor={"root": moment, "tip": {"body": "arm", "at": 10.0}},
        sweep={"rate": {"of": "frame.arm.joints.0.motion.rate", "values": [0.25, 0.5, 1.0]}},
        question={"duration": 1.5, "displacement": 10.0},
        solver={"tolerance": 0.05},
    )
    found = studies.run(study)
    most = np.maximum(abs(found["tip_max"]), abs(found["tip_min"])).values
    assert (np.diff(most) > 0.0).all()
    assert "tip: the displacement goes from " in kind_of(study).findings(Results.of(found))[0]
    assert "exceeds 10 m nowhere from 0.25 to 1 rad/s" in kind_of(study).findings(Results.of(found))[0]
    limit = float(np.round(0.5 * (most[0] + most[1]), 3))
    found = studies.run(study.with_values({"question.displacement": limit}))
    told = kind_of(study).findings(Results.of(found))
    assert f"exceeds {quantity(limit, 'm')} from 0.5 rad/s to the end of the sweep, 1 rad/s" in told[0]
    assert told[1].startswith("root: the ") and "exceeds" not in told[1]
    assert any(text.startswith("The energy of everything (motion, bending") for text in told)
    sizes = next(one for one in pictures(Results.of(found)) if one.name == "largest-displacement")
    assert "beyond the limit" in sizes.title and "Orange: limits" in sizes.caption
    with pytest.raises(BadInput, match=r"question\.displacement: must be > 0"):
        kind_of(study).check_tables(study.with_values({"question.displacement": 0.0}))
