import shutil
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor

import netCDF4
import numpy as np
import pytest
import xarray as xr

from results_schema.errors import OutputFailed
from results_schema.store import files
from results_schema.store.archive import describe, open_archive, output_state, write_archive
from results_schema.validate import validate
from results_schema.variables import expand
from tests.schema.samples import ATTRIBUTES, CARRIAGES, SENSORS, FailNth, groups, in_child, march, with_histories


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.nc"


def same(left, right):
    """Identical values, dims and attributes (an attribute's type may become a numpy one)."""
    xr.testing.assert_equal(left, right)
    assert set(left.coords) == set(right.coords)
    for name in [None, *left.variables]:
        a, b = (left, right) if name is None else (left[name], right[name])
        assert a.attrs.keys() == b.attrs.keys()
        for key in a.attrs:
            np.testing.assert_array_equal(a.attrs[key], b.attrs[key])


@pytest.mark.parametrize("root", [march(), march(()), with_histories(march())])
def test_what_is_written_is_read(path, root):
    write_archive(path, root, groups())
    archive = open_archive(path)
    same(archive.root, root)
    assert set(archive.groups) == {"/audit", "/model/bed"}
    for name, group in groups().items():
        same(archive.groups[name], group)
    validate(archive.root, "march", expand("march", SENSORS, CARRIAGES))


def test_xarray_opens_root_and_groups_without_us(path):
    root = with_histories(march())
    write_archive(path, root, groups())
    with xr.open_dataset(path) as found:
        xr.testing.assert_equal(found, root)
        assert set(found.coords) == set(root.coords)
        assert found.status.dtype == np.int8
        assert found.midspan_max.attrs["units"] == "m"
    for name, group in groups().items():
        with xr.open_dataset(path, group=name) as found:
            xr.testing.assert_equal(found, group)


def test_nan_survives_and_coordinates_have_no_fill_value(path):
    root = march()
    root.midspan_max[0, 0] = np.nan
    root["speed"].attrs["_FillValue"] = np.nan
    write_archive(path, root)
    with netCDF4.Dataset(path) as raw:
        assert np.isnan(raw["midspan_max"]._FillValue)
        for name in root.coords:
            assert "_FillValue" not in raw[name].ncattrs()
        assert "_FillValue" not in raw["status"].ncattrs()
    assert np.isnan(open_archive(path).root.midspan_max[0, 0])


def test_filters_flags_and_attributes_on_disk(path):
    write_archive(path, march(), groups())
    with netCDF4.Dataset(path) as raw:
        filters = raw["midspan_max"].filters()
        assert (filters["zlib"], filters["complevel"], filters["shuffle"], filters["fletcher32"]) == (True, 1, 1, 1)
        assert not any(filters[name] for name in ("szip", "zstd", "bzip2", "blosc"))
        assert raw["status"].flag_values.dtype == np.int8
        assert raw["status"].flag_meanings.split()[1] == "separated"
        assert raw["midspan_max"].coordinates == "speed_ratio"
        assert raw.Conventions == "CF-1.11" and raw.schema_version == 2
        assert raw.study == ATTRIBUTES["study"]
        assert raw.title == ATTRIBUTES["title"]
        assert not raw.cmptypes and not raw.vltypes and not raw.enumtypes


def test_what_packing_hardly_shrinks_is_left_as_it_is(path):
    root = march().isel(speed=[0] * 1000, mass=[0] * 200).drop_vars(["speed", "mass", "speed_ratio"], errors="ignore")
    root["midspan_max"][:] = np.random.default_rng(1).normal(size=root["midspan_max"].shape)
    write_archive(path, root)
    with netCDF4.Dataset(path) as raw:
        assert raw["midspan_max"].filters()["fletcher32"] and not raw["midspan_max"].filters()["zlib"]
        assert raw["status"].filters()["zlib"]
    np.testing.assert_array_equal(open_archive(path).root["midspan_max"].values, root["midspan_max"].values)


def test_debians_ncdump_reads_it(path):
    write_archive(path, march(), groups())
    if shutil.which("ncdump"):
        text = subprocess.run(["ncdump", str(path)], check=True, capture_output=True, text=True).stdout
        assert "midspan_max:units" in text and "fox-goodwin" in text
        return
    # Without ncdump: HDF5 1.10, on which Debian 12's is built, reads superblocks up to version 3.
    start = path.read_bytes()[:9]
    assert start[:8] == b"\x89HDF\r\n\x1a\n"
    assert start[8] <= 3
    with netCDF4.Dataset(path) as raw:
        assert raw.data_model == "NETCDF4"
        for place in (raw, raw["audit"], raw["model/bed"]):
            for variable in place.variables.values():
                used = {name for name, value in (variable.filters() or {}).items() if value}
                assert used <= {"zlib", "complevel", "shuffle", "fletcher32"}


def test_same_dataset_same_bytes(path):
    root = with_histories(march())
    write_archive(path, root, groups())
    first = path.read_bytes()
    time.sleep(1.1)  # a time stamp in the file would differ now
    write_archive(path, root, groups())
    assert path.read_bytes() == first
    other = path.with_name("other.nc")
    assert in_child(lambda: write_archive(other, with_histories(march()), groups())) == 0
    assert other.read_bytes() == first


def test_a_long_study_text_is_kept(path):
    study = "# ä long comment\n" * 20_000
    write_archive(path, march().assign_attrs(study=study))
    assert open_archive(path).root.attrs["study"] == study


def test_datasets_that_an_archive_cannot_hold_are_refused(path):
    for root, text in (
        (march().drop_vars("status"), "status"),
        (march().drop_attrs(), "study_kind"),
        (march().isel(speed=slice(0)), "speed: expected at least one"),
        (march().assign(wrong=("speed", [True] * 4)), "wrong: expected text or numbers"),
        (march().assign_attrs(schema_version=3), "schema_version"),
        (march().assign_attrs(wrong=[]), "attribute"),
    ):
        with pytest.raises(ValueError, match=text):
            write_archive(path, root)
    assert list(path.parent.iterdir()) == []


@pytest.mark.fault(26)
def test_a_full_disk_at_any_operation_leaves_the_old_archive(path, monkeypatch):
    write_archive(path, march())
    old = path.read_bytes()
    failed = 0
    for number in range(1, 20):
        monkeypatch.setattr(files, "FAULTS", FailNth(number))
        try:
            write_archive(path, march((2, 2)))
        except OutputFailed as error:
            assert error.path == path
            failed += 1
            assert number == 5 or path.read_bytes() == old
        else:
            break
    assert failed == 5
    assert open_archive(path).root.sizes["speed"] == 2


def test_output_states(path):
    sha = ATTRIBUTES["study_sha256"]
    assert output_state(path, sha) == "absent"
    path.write_text("notes")
    assert output_state(path, sha) == "another study"
    write_archive(path, march())
    assert output_state(path, sha) == "same study, finished"
    assert output_state(path, "cd" * 32) == "another study"


def test_describe_tells_what_is_inside(path):
    root = march()
    root.status[0, :2] = 1
    write_archive(path, root, groups())
    summary = describe(path)
    assert summary.whole and summary.damage == ""
    assert summary.dimensions == {"speed": 4, "mass": 3, "result": 2}
    assert summary.status_counts == {"ok": 10, "separated": 2}
    assert summary.attributes["study_sha256"] == ATTRIBUTES["study_sha256"]
    assert "contents" not in summary.attributes
    found = {(v.group, v.name): v for v in summary.variables}
    assert found["/", "support_max"].units == "N m"
    assert found["/", "support_max"].dims == ("speed", "mass")
    assert "step instants" in found["/", "support_max"].meaning
    assert found["/audit", "scheme"].dtype == "text"
    assert ("/model/bed", "frequency") in found


def test_threads_take_turns_in_the_netcdf_library(tmp_path):
    paths = [tmp_path / f"{number}.nc" for number in range(4)]
    for path in paths:
        write_archive(path, march(), groups())
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(open_archive, paths * 5))
    assert len(found) == 20
    for archive in found:
        xr.testing.assert_equal(archive.root, march())
