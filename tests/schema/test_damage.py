import ctypes

import netCDF4
import numpy as np
import pytest
import xarray as xr

from results_schema.errors import ArchiveError, BadInput, WanderlastError
from results_schema.store.archive import describe, open_archive, output_state, write_archive
from results_schema.store.links import hdf5_library
from tests.schema.samples import ATTRIBUTES, groups, in_child, march


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "a.nc"
    write_archive(path, march(), groups())
    return path


def refused(path, text, error=ArchiveError):
    for action in (open_archive, describe):
        with pytest.raises(error, match=text) as caught:
            action(path)
        assert str(path) in str(caught.value)


def test_missing_files_and_folders_are_bad_input(tmp_path):
    refused(tmp_path / "none.nc", "no such file", BadInput)
    refused(tmp_path, "not a file", BadInput)


@pytest.mark.parametrize("content", [b"", b"CDF\x01" + bytes(100), b"title = 'x'", b"\x89HDF\r\n\x1a\n"])
def test_other_files_are_refused(tmp_path, content):
    path = tmp_path / "a.nc"
    path.write_bytes(content)
    refused(path, "not a netCDF-4 file|damaged")


@pytest.mark.fault(37)
@pytest.mark.parametrize("part", [0.001, 0.3, 0.9, 0.9999])
def test_truncated_archives_are_refused(path, part):
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * part)])
    refused(path, "damaged|not a netCDF-4")
    if part > 0.01:
        with pytest.raises(ArchiveError):
            output_state(path, ATTRIBUTES["study_sha256"])


@pytest.mark.fault(38)
def test_a_foreign_netcdf_is_refused(tmp_path):
    path = tmp_path / "a.nc"
    xr.Dataset({"t2m": ("time", np.ones(3))}, attrs={"Conventions": "CF-1.6"}).to_netcdf(path)
    refused(path, "another program.*received Conventions")


def change(path, action):
    with netCDF4.Dataset(path, "a") as dataset:
        action(dataset)


@pytest.mark.fault(38)
def test_a_newer_schema_is_refused(path):
    change(path, lambda dataset: dataset.setncattr("schema_version", 3))
    refused(path, "newer version; expected schema_version up to 2, received 3")


def test_the_schema_of_before_estimated_errors_is_refused(path):
    change(path, lambda dataset: dataset.setncattr("schema_version", 1))
    refused(path, "before archives held estimated_error.*expected schema_version 2, received 1.*run the study again")


@pytest.mark.fault(38)
def test_missing_and_added_variables_are_found(path):
    change(path, lambda dataset: dataset.renameVariable("midspan_max", "midspam_max"))
    refused(path, "missing.*without /midspan_max float64 4x3")
    change(path, lambda dataset: dataset.renameVariable("midspam_max", "midspan_max"))
    open_archive(path)
    change(path, lambda dataset: dataset.createVariable("more", "i4", ()))
    refused(path, "not listed in its contents.*/more")


def changed_scalar(dataset):
    dataset["status"].flag_meanings = "all is fine now here ok yes"


def changed_text(dataset):
    dataset["audit/scheme"][0] = "fox-goodwim"


def changed_study(dataset):
    dataset.study = "schema_version = 2"


@pytest.mark.parametrize("action", [changed_scalar, changed_text, changed_study])
def test_changed_texts_and_attributes_are_found(path, action):
    change(path, action)
    with pytest.raises(ArchiveError, match="not those that were written"):
        open_archive(path)
    summary = describe(path)
    assert not summary.whole and "not those" in summary.damage


@pytest.mark.fault(38)
def test_a_small_file_that_claims_terabytes_is_refused_before_loading(tmp_path):
    path = tmp_path / "a.nc"
    with netCDF4.Dataset(path, "w") as dataset:
        dataset.setncatts(ATTRIBUTES)
        dataset.createDimension("n", 10**12)
        dataset.createVariable("status", "f8", ("n",), zlib=True, chunksizes=(10**6,))
    assert path.stat().st_size < 20_000
    refused(path, "claims more data.*received 8000000000000 bytes")


def test_an_archive_of_equal_numbers_is_not_taken_for_a_bomb(tmp_path):
    path = tmp_path / "a.nc"
    zeros = {name: (("speed",), np.zeros(3_000_000, np.int8)) for name in ("status", "fidelity_used")}
    write_archive(path, xr.Dataset(zeros, attrs=ATTRIBUTES))
    assert path.stat().st_size < 6_000_000 / 100
    assert open_archive(path).root.status.size == 3_000_000


@pytest.mark.fault(37)
def test_zero_rows_and_types_of_others_are_refused(tmp_path):
    path = tmp_path / "a.nc"
    with netCDF4.Dataset(path, "w") as dataset:
        dataset.setncatts(ATTRIBUTES)
        dataset.createDimension("n", None)
        dataset.createVariable("status", "i1", ("n",))
    refused(path, "no rows; received status")
    with netCDF4.Dataset(path, "w") as dataset:
        dataset.setncatts(ATTRIBUTES)
        dataset.createVLType(np.int32, "ragged")
    refused(path, "types that archives do not have")


@pytest.mark.fault(37)
def test_a_flipped_bit_in_the_data_is_found_and_the_file_named(tmp_path):
    path = tmp_path / "a.nc"
    noise = np.random.default_rng(1).random((200, 200))
    write_archive(path, march((200, 200)).assign(midspan_max=(("speed", "mass"), noise)))
    content = path.read_bytes()
    found = 0
    for place in range(2000, len(content), len(content) // 40):
        flipped = bytearray(content)
        flipped[place] ^= 1
        path.write_bytes(flipped)
        try:
            open_archive(path)
        except ArchiveError as error:
            found += str(path) in str(error)
    assert found > 25


@pytest.mark.fault(44)
@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_no_flipped_bit_gives_wrong_numbers_or_a_crash(path, count):
    """Some bits anywhere in a small archive: refused with the file's name, or read as if nothing were."""
    content = path.read_bytes()
    expected = open_archive(path)
    places = np.random.default_rng(0).integers(0, 8 * len(content), count)
    outcomes = []
    for place in places:
        flipped = bytearray(content)
        flipped[place // 8] ^= 1 << (place % 8)
        path.write_bytes(flipped)

        def read():
            try:
                found = open_archive(path)
            except WanderlastError as error:
                assert str(path) in str(error)
                return
            xr.testing.assert_identical(found.root, expected.root)
            for name in expected.groups:
                xr.testing.assert_identical(found.groups[name], expected.groups[name])

        outcomes.append(in_child(read))
    assert outcomes == [0] * len(places)


@pytest.mark.fault(37)
def test_a_lost_chunk_is_not_read_as_fill_values(tmp_path):
    """The index of the chunks carries no checksum of HDF5: an entry that is lost gives NaN without an error."""
    path = tmp_path / "a.nc"
    write_archive(path, march())
    with netCDF4.Dataset(path, "a") as dataset:
        dataset["support_rms"][:] = np.nan
    with pytest.raises(ArchiveError, match="values or attributes"):
        open_archive(path)
    assert not describe(path).whole


def h5(name, *arguments):
    """Call the HDF5 library; integers are identifiers, bytes are names."""
    function = getattr(hdf5_library(), name)
    if function.argtypes is None:
        function.restype = ctypes.c_int64
    return function(*[ctypes.c_int64(a) if isinstance(a, int) and function.argtypes is None else a for a in arguments])


pytestmark_hdf5 = pytest.mark.skipif(hdf5_library() is None, reason="the HDF5 library is linked statically")


@pytest.mark.fault(40)
@pytestmark_hdf5
@pytest.mark.parametrize("group", [b"/", b"/audit"])
def test_external_links_are_refused(path, group):
    secret = path.with_name("secret.nc")
    with netCDF4.Dataset(secret, "w") as dataset:
        dataset.createVariable("key", "i4", ())
    file = h5("H5Fopen", bytes(path), 1, 0)
    assert h5("H5Lcreate_external", bytes(secret), b"/key", file, group + b"/elsewhere", 0, 0) == 0
    h5("H5Fclose", file)
    refused(path, "points at data in other files.*elsewhere", BadInput)


@pytest.mark.fault(40)
@pytestmark_hdf5
def test_soft_links_are_refused(path):
    file = h5("H5Fopen", bytes(path), 1, 0)
    assert h5("H5Lcreate_soft", b"/status", file, b"/again", 0, 0) == 0
    h5("H5Fclose", file)
    refused(path, "link again", BadInput)


@pytest.mark.fault(40)
@pytestmark_hdf5
def test_external_storage_is_refused(path):
    outside = path.with_name("outside.bin")
    outside.write_bytes(bytes(80))
    size = (ctypes.c_uint64 * 1)(10)
    file = h5("H5Fopen", bytes(path), 1, 0)
    creation = h5("H5Pcreate", ctypes.c_int64.in_dll(hdf5_library(), "H5P_CLS_DATASET_CREATE_ID_g").value)
    assert h5("H5Pset_external", creation, bytes(outside), 0, 80) == 0
    space = h5("H5Screate_simple", 1, size, None)
    kind = ctypes.c_int64.in_dll(hdf5_library(), "H5T_NATIVE_DOUBLE_g").value
    assert h5("H5Dcreate2", file, b"/leak", kind, space, 0, creation, 0) > 0
    netCDF4.Dataset(path.with_name("x.nc"), "w").close()
    h5("H5Fclose", file)
    assert in_child(lambda: refused(path, "external storage of leak", BadInput)) == 0
