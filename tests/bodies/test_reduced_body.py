"""Reduced bodies in files: bit for bit the same body, and damaged or foreign files refused."""

from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

import engine
from engine.batch.plan import make_plan
from engine.bodies.modal.modal_body import ModalBody
from engine.bodies.reduced.body import load_body, save_body
from engine.scene.study import load
from engine.study_file.document import write_document
from results_schema.errors import ArchiveError, BadInput
from results_schema.store import bodies
from studies.runs.identity import run_key
from tests.bodies.frames import LENGTH, beam, body, straight
from tests.bodies.test_frame_reduction import portal
from tests.bodies.test_frame_study import STUDY

X = np.linspace(0.0, 6.0, 23)
S = np.linspace(0.0, 6.0, 17)


def answers(found: ModalBody, own_weight: bool) -> list[Any]:
    """Everything a march asks a body."""
    assert found.sections is not None
    values: list[Any] = [found.length, found.mass, found.omega, found.participation, found.wave_number]
    values += [found.bending_stiffness, found.rigid_modes, found.gravity_share]
    values += [function(X, j) for j in range(4) for function in (found.shape, lambda x, j: found.influence(x, S, j))]
    values += [found.sections.rows(q, X) for q in ("bending_moment", "shear_force", "axial_force", "stress")]
    values += [found.sections.influence_at("stress", X, 2.2)]
    if found.points is not None:
        for name in found.points.numbers:
            values += [found.points.row(name), found.points.influence(name, X, 2)]
            values += [found.points.between(name, "point.top"), found.points.section_influence("stress", name, X)]
    if own_weight:
        values += [found.own_weight_deflection(X), found.sections.own_weight("stress", X)]
    return values


@pytest.mark.parametrize("held", [True, False])
def test_a_file_gives_the_same_body(tmp_path: Path, held: bool) -> None:
    table = portal(interface=["d", "e"], track={"members": ["one", "two", "three"], "offset": [0.0, 0.2, 0.0]})
    table |= {"point": {"top": {"node": "c"}}} if held else {}
    original = body(table if held else table | {"supports": {}, "interface": []})
    save_body(original, tmp_path / "body.nc")
    for one, other in zip(answers(load_body(tmp_path / "body.nc"), held), answers(original, held), strict=True):
        assert np.array_equal(one, other, equal_nan=True)
    assert len(original.joints) == 2 and set(original.joints) <= set(load_body(tmp_path / "body.nc").joints)
    first, again = (tmp_path / "body.nc").read_bytes(), tmp_path / "again.nc"
    save_body(load_body(tmp_path / "body.nc"), again)
    assert again.read_bytes() == first


def test_fewer_modes_are_the_lowest(tmp_path: Path) -> None:
    original = body(portal())
    save_body(original, tmp_path / "body.nc")
    few = load_body(tmp_path / "body.nc", 4)
    assert np.array_equal(few.omega, original.omega[:4])
    assert np.array_equal(few.shape(X, 2), original.shape(X, 2)[:, :4])
    assert few.sections is not None and original.sections is not None
    assert np.array_equal(few.sections.rows("stress", X), original.sections.rows("stress", X)[:, :4])
    with pytest.raises(BadInput, match="at most the 10 modes"):
        load_body(tmp_path / "body.nc", 11)


def test_a_uniform_beam_is_not_saved(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="a frame"):
        save_body(beam(("pinned", "pinned"), 3), tmp_path / "body.nc")
    with pytest.raises(BadInput, match="folder does not exist"):
        save_body(body(straight({})), tmp_path / "none" / "body.nc")


def test_damaged_and_foreign_files(tmp_path: Path) -> None:
    path = tmp_path / "body.nc"
    save_body(body(straight({"a": "clamped"}, elements=2)), path)
    whole = path.read_bytes()
    middle = len(whole) // 2
    turned = bytes(byte ^ 255 for byte in whole[middle : middle + 4000])
    flipped = whole[:middle] + turned + whole[middle + len(turned) :]
    for broken in (whole[:middle], whole[:8], b"", flipped, b"CDF\x01" + whole):
        path.write_bytes(broken)
        with pytest.raises(ArchiveError):
            load_body(path)
    with pytest.raises(BadInput, match="no such file"):
        load_body(tmp_path / "other.nc")


def test_an_archive_is_no_body(tmp_path: Path) -> None:
    path = tmp_path / "other.nc"
    with netCDF4.Dataset(path, "w") as dataset:
        dataset.setncatts({"schema_version": 1})
    with pytest.raises(ArchiveError, match="holds no reduced body"):
        load_body(path)
    with netCDF4.Dataset(path, "w") as dataset:
        dataset.setncatts({"body_version": bodies.BODY_VERSION + 1})
    with pytest.raises(ArchiveError, match="newer version"):
        load_body(path)


def test_a_study_with_a_reduced_body(tmp_path: Path) -> None:
    table = STUDY["body"]["bridge"]
    path = tmp_path / "bridge.nc"
    save_body(body(table), path)
    reduced = {"kind": "reduced", "file": str(path), "damping_ratio": 0.01}
    base = {key: part for key, part in STUDY.items() if key != "sweep"}
    expected = engine.run(load(write_document(base)))
    found = engine.run(load(write_document(base | {"body": {"bridge": reduced}})))
    assert float(found.middle_max) == float(expected.middle_max)
    assert float(found.here_max) == float(expected.here_max)
    for wrong in (str(tmp_path / "none.nc"), str(tmp_path)):
        text = write_document(base | {"body": {"bridge": reduced | {"file": wrong}}})
        with pytest.raises(BadInput, match=r"body\.bridge\.file: no reduced body can be read"):
            load(text)
    far = base | {"body": {"bridge": reduced}, "sensor": {"far": {"body": "bridge", "at": LENGTH}}}
    with pytest.raises(BadInput, match="off its body"):
        load(write_document(far))


def test_a_study_that_names_a_damaged_body_is_bad_input(tmp_path: Path) -> None:
    """Wherever a byte of the file is another one; what is not noticed changes nothing."""
    path = tmp_path / "bridge.nc"
    save_body(body(STUDY["body"]["bridge"]), path)
    whole, refused = path.read_bytes(), list[str]()
    base = {key: part for key, part in STUDY.items() if key != "sweep"}
    text = write_document(base | {"body": {"bridge": {"kind": "reduced", "file": str(path)}}})
    for place in np.random.default_rng(2).integers(0, len(whole), 60).tolist():
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 16]) + whole[place + 1 :])
        try:
            make_plan(load(text))
        except BadInput as error:
            refused.append(error.where)
    assert len(refused) > 10 and all(where.endswith("body.bridge.file") for where in refused)


def test_parts_belong_to_the_content_of_the_file(tmp_path: Path) -> None:
    """An interrupted run does not go on with another body of the same name."""
    path = tmp_path / "bridge.nc"
    keys = []
    for elements in (2, 4):
        save_body(body(straight({"a": "clamped"}, elements=elements)), path)
        base = {key: part for key, part in STUDY.items() if key != "sweep"}
        reduced = {"bridge": {"kind": "reduced", "file": str(path)}}
        sensors, gravity = {"middle": {"body": "bridge", "at": 1.0}}, 0.0
        text = write_document(base | {"body": reduced, "sensor": sensors, "gravity": gravity})
        keys.append(run_key(load(text)))
    assert keys[0] != keys[1]


def test_stress_needs_fibre_distances_in_the_file(tmp_path: Path) -> None:
    table = straight({"a": "pinned", "b": ["z"]}, plane="xz")
    section = {key: value for key, value in table["section"]["rail"].items() if not key.startswith("fibre")}
    save_body(body(table | {"section": {"rail": section}}), tmp_path / "plain.nc")
    sensor = {"body": "bridge", "at": 1.0, "quantity": "stress"}
    changed = STUDY | {"body": {"bridge": {"kind": "reduced", "file": str(tmp_path / "plain.nc")}}, "sweep": {}}
    with pytest.raises(BadInput, match=r"sensor\.tension\.quantity"):
        load(write_document(changed | {"sensor": {"tension": sensor}}))
