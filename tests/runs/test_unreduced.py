"""Studies that compare themselves with the unreduced finite-element model: archive, sentences, figure, refusals."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.scene.study import Study
from engine.unreduced.comparison import Compared
from results_schema.errors import BadInput
from results_schema.store.archive import Archive, open_archive
from results_schema.validate import validate
from results_schema.variables import expand
from studies.commands.preview import preview
from studies.commands.screens import show_outcome
from studies.protocol.listener import Listener
from studies.protocol.options import RunOptions
from studies.protocol.study import kind_of
from studies.reporting.report import write_report
from studies.runs import unreduced
from studies.runs.runner import UNREDUCED, run_to_archive
from tests.engine.build import beam, cruise, fixed, mass, shuttle
from tests.unreduced.test_unreduced import RIGID, frame, riding

SENSORS = {"middle": fixed(0.5), "aboard": fixed(0.2, body="table"), "moment": fixed(0.3713, "bending_moment")}


def table_study(**changes: Any) -> Study:
    """A rigid table out and back on a frame, at two speeds, one of which is compared."""
    tables: dict[str, Any] = {
        "schema_version": 1,
        "kind": "asymmetry",
        "initial": "equilibrium",
        "gravity": 9.81,
        "body": {"bed": frame(16, modes=24), "table": RIGID},
        "carriage": {"table": riding(shuttle(0.3, 0.7, 0.4, 0.2, 1))},
        "sensor": SENSORS,
        "solver": {"steps": 2400},
        "output": {"unreduced": 1},
        "sweep": {"speed": {"of": "carriage.table.motion.speed", "values": [0.2, 0.4]}},
    }
    return Study(**(tables | changes))


def archived(study: Study, folder: Path) -> Archive:
    run_to_archive(study, folder / "found.nc", RunOptions())
    return open_archive(folder / "found.nc")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return archived(table_study(), tmp_path_factory.mktemp("unreduced"))


def test_the_group_is_as_declared(archive: Archive) -> None:
    group = archive.groups[unreduced.GROUP]
    names = [str(name) for name in group["sensor"].values]
    assert names == ["middle", "aboard", "moment", "contact_table_front", "contact_table_rear"]
    validate(group, unreduced.GROUP, expand(unreduced.GROUP))
    assert group["sample"].values.tolist() == [1]
    assert group["degrees_of_freedom"].values.tolist() == [2 * 16 + 15 + 1 + 2]
    assert group["unreduced_steps"].values.tolist() == [19200]


def test_its_histories_are_those_of_the_study(archive: Archive) -> None:
    group = archive.groups[unreduced.GROUP].isel(sample=0)
    own = archive.root.isel(speed=1)
    np.testing.assert_allclose(group["marched"].values[0], own["middle"].values, rtol=1e-9)
    np.testing.assert_allclose(group["elapsed"].values, own["elapsed"].values, rtol=1e-12)
    np.testing.assert_allclose(group["position"].values, own["table_position"].values, rtol=1e-12)


def test_both_models_agree(archive: Archive) -> None:
    group = archive.groups[unreduced.GROUP]
    assert (group["difference"].values < 3e-3).all()
    assert (group["dynamic_difference"].values < 1e-2).all()
    np.testing.assert_array_equal(group["static_difference"].values[0, :2] < 1e-9, True)
    assert (group["dynamic_range"].values[0, :2] > 0.05).all()
    carried = group["unreduced_static"].values[0, 3:].sum(axis=0)
    np.testing.assert_allclose(carried, RIGID["mass"] * 9.81, rtol=1e-9)


def test_the_report_says_and_shows_it(archive: Archive, tmp_path: Path) -> None:
    page = write_report(archive.path, tmp_path / "report").read_text(encoding="utf-8")
    page = page.replace("\N{NO-BREAK SPACE}", " ")
    said = unreduced.told_unreduced(archive.groups[unreduced.GROUP])
    assert "50 degrees of freedom, in 1 variant: every sensor within" in said[0] and "contact forces within" in said[0]
    assert all(sentence in page for sentence in said)
    assert list((tmp_path / "report").glob("*-unreduced.svg")) and "Against the unreduced" in page


def test_without_the_option_there_is_no_group(tmp_path: Path) -> None:
    study = table_study(output={"unreduced": 0}, sweep={})
    assert unreduced.GROUP not in archived(study, tmp_path).groups
    assert unreduced.told_unreduced(None) == []


def test_whole_passages_with_free_vibration(tmp_path: Path) -> None:
    """A mass leaves a beam; its contact force is read although no sensor asks for it, and has gaps."""
    motion = cruise(-0.2, 1.2, 0.5, after=1.0)
    study = table_study(
        body={"bed": beam(modes=20, damping_ratio=0.02)},
        carriage={"car": mass(0.3, motion)},
        sensor={"middle": fixed(0.5)},
        kind="passage",
        initial="rest",
        sweep={},
    )
    group = archived(study, tmp_path).groups[unreduced.GROUP]
    assert group["sensor"].values.tolist() == ["middle", "contact_car"]
    np.testing.assert_array_equal(np.isnan(group["marched"].values), np.isnan(group["unreduced"].values))
    assert np.isnan(group["unreduced"].values[0, 1]).any() and float(group["difference"][0, 0]) < 1e-3


def test_numbers_are_parts_of_ranges() -> None:
    """By hand: histories of range 4 and 3, a dynamic part of range 2, a constant static response."""
    whole, static = np.array([[0.0, 4.0, 2.0], [1.0, 4.0, 3.0]]), np.array([[0.0, 2.0, 2.0], [3.0, 3.0, 3.0]])
    marched = whole + np.array([[0.0, 0.4, np.nan], [0.0, 0.0, -0.3]])
    given = Compared(
        {"a": "displacement", "b": "stress"}, np.zeros(3), np.zeros(3), marched, static, whole, static, 1, 1
    )
    found = unreduced._gaps(given)
    np.testing.assert_allclose(found["difference"], [0.1, 0.1])
    np.testing.assert_allclose(found["dynamic_difference"], [0.2, 0.1])
    np.testing.assert_allclose(found["dynamic_range"], [0.5, 1.0])
    assert found["static_difference"][0] == 0.0 and np.isnan(found["static_difference"][1])


def test_what_cannot_be_unreduced_is_refused_first(tmp_path: Path) -> None:
    study = table_study(body={"bed": frame(16, mass_matrix="lumped"), "table": RIGID})
    with pytest.raises(BadInput, match=r"body\.bed\.mass_matrix"):
        run_to_archive(study, tmp_path / "found.nc", RunOptions())
    assert not list(tmp_path.iterdir())


def test_a_study_that_measures_refuses_it(tmp_path: Path) -> None:
    scene = {
        "body": {"bed": beam()},
        "carriage": {"car": mass(0.25, cruise(0.0, 1.0, 0.3))},
        "sensor": {"m": fixed(0.5)},
    }
    study = Study(schema_version=1, kind="stability", output={"unreduced": 1}, **scene)
    with pytest.raises(BadInput, match=r"output\.unreduced"):
        run_to_archive(study, tmp_path / "found.nc", RunOptions())


def test_a_force_that_is_rounding_beside_others_has_no_range() -> None:
    """An axial force of 1e-12 N beside contact forces of hundreds differs by nothing that counts."""
    whole = np.array([[1e-12, -2e-12, 0.0], [700.0, 500.0, 600.0]])
    names = {"axial": "axial_force", "shoe": "contact_force"}
    found = unreduced._gaps(Compared(names, np.zeros(3), np.zeros(3), 2.0 * whole, whole, whole, whole, 1, 1))
    assert np.isnan(found["difference"][0]) and found["difference"][1] == 3.5


def test_a_run_and_what_is_foreseen_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """While it is computed, when it is done, and when it is found finished; `check` foresees its time apart."""
    stages: list[str] = []
    first = run_to_archive(table_study(), tmp_path / "found.nc", RunOptions(), listener=Listener(stage=stages.append))
    assert UNREDUCED in stages
    again = run_to_archive(table_study(), tmp_path / "found.nc", RunOptions())
    assert not first.was_finished and again.was_finished
    for outcome in (first, again):
        show_outcome(outcome)
        assert "Against the unreduced finite-element model of " in " ".join(capsys.readouterr().out.split())
    cost = preview(kind_of(table_study()).parts(table_study()), 1).cost
    assert cost.endswith(" On top of that 1 variant by the unreduced model, seconds to minutes each.")
