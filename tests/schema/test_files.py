import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from results_schema.errors import BadInput, OutputFailed
from results_schema.store import files
from tests.schema.samples import FailNth


def test_a_file_appears_whole(tmp_path):
    files.write_text(tmp_path / "a", "one")
    files.write_text(tmp_path / "a", "two")
    assert (tmp_path / "a").read_text() == "two"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


@pytest.mark.fault(26)
def test_every_operation_can_fail_and_the_old_file_stays(tmp_path, monkeypatch):
    path = tmp_path / "a"
    failures = 0
    for number in range(1, 20):
        path.write_text("old")
        faults = FailNth(number)
        monkeypatch.setattr(files, "FAULTS", faults)
        if not _fails(path):
            break
        failures += 1
        # Only the sync of the folder comes after the file is in its place.
        assert path.read_text() == ("new" if faults.count == 5 else "old")
        assert [p.name for p in tmp_path.iterdir()] == ["a"]
    assert failures == 5
    assert path.read_text() == "new"


def _fails(path):
    try:
        files.write_text(path, "new")
    except OutputFailed as error:
        assert error.exit_code == 74
        assert error.path == path
        assert error.free_bytes > 0
        assert str(path) in str(error) and "bytes free" in str(error)
        return True
    return False


def test_a_full_disk_is_told_whatever_a_library_calls_it(tmp_path, monkeypatch):
    """netCDF's says "Permission denied", which sent people to look at the folder's rights."""
    denied = PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    assert "Permission denied" in str(files.output_failed(tmp_path / "a", denied))
    full = shutil.disk_usage(tmp_path)._replace(free=0)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: full)
    told = str(files.output_failed(tmp_path / "a", denied))
    assert "No space left on device" in told and "free some space" in told and "0 bytes free there" in told


def test_the_failures_of_the_netcdf_library_are_output_failures(tmp_path):
    def fail(_: Path) -> None:
        raise RuntimeError("NetCDF: HDF error")

    with pytest.raises(OutputFailed, match="HDF error"):
        files.write_whole(tmp_path / "a", fail)
    with pytest.raises(RuntimeError, match="other"):
        files.write_whole(tmp_path / "a", lambda _: (_ for _ in ()).throw(RuntimeError("other")))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.fault(29)
def test_leftovers_are_cleaned_and_nothing_else(tmp_path):
    for name in (".a.nc.123.wanderlast-tmp", ".b.nc.123.wanderlast-tmp", ".a.nc", "a.nc"):
        (tmp_path / name).touch()
    files.clean_leftovers(tmp_path / "a.nc")
    assert sorted(p.name for p in tmp_path.iterdir()) == [".a.nc", ".b.nc.123.wanderlast-tmp", "a.nc"]


def test_sidecar(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"abc")
    assert not files.sidecar_matches(path)
    files.write_sidecar(path)
    # SHA-256 of "abc", FIPS 180-2, B.1
    digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert files.sidecar(path).read_text() == f"{digest}  a\n"
    assert files.sidecar_matches(path)
    path.write_bytes(b"abd")
    assert not files.sidecar_matches(path)


@pytest.mark.fault(27)
def test_places_where_nothing_can_be_written_are_refused(tmp_path, monkeypatch):
    files.check_output_place(tmp_path / "a.nc")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    for path, text in (
        (tmp_path / "missing" / "a.nc", "does not exist"),
        (tmp_path / "file" / "a.nc", "is a file"),
        (tmp_path / "folder", "is a folder"),
    ):
        with pytest.raises(BadInput, match=text):
            files.check_output_place(path)

    def refuse(**_):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(files.tempfile, "TemporaryFile", refuse)
    with pytest.raises(OutputFailed, match=r"Read-only.*bytes free there") as caught:
        files.check_output_place(tmp_path / "a.nc")
    assert caught.value.exit_code == 74 and caught.value.path == tmp_path


@pytest.mark.fault(28)
def test_only_netcdf_files_are_ever_replaced(tmp_path):
    archive, text, pipe = tmp_path / "a.nc", tmp_path / "notes.txt", tmp_path / "pipe"
    archive.write_bytes(b"\x89HDF\r\n\x1a\n and more")
    text.write_text("\x89HDF")
    os.mkfifo(pipe)
    files.check_replaceable(archive)
    files.check_replaceable(tmp_path / "nothing")
    for path in (text, pipe, Path(os.devnull)):
        with pytest.raises(BadInput, match="never replaced"):
            files.check_replaceable(path)


def test_a_disk_that_is_too_small_is_refused(tmp_path):
    files.check_free(tmp_path, 1, "it")
    with pytest.raises(OutputFailed, match=r"it would not fit .* bytes free there") as caught:
        files.check_free(tmp_path, 1 << 80, "it")
    assert caught.value.path == tmp_path and 0 < caught.value.free_bytes < 1 << 80


REAL_DISKS = """
import sys
sys.path.insert(0, {root!r})
import numpy as np
from pathlib import Path
from results_schema.store import files, parts
from results_schema.store.rows import Chunk, Rows
from results_schema.errors import OutputFailed

full, read_only = Path({full!r}), Path({read_only!r})
try:
    files.check_output_place(read_only / "a.nc")
except OutputFailed as error:
    print("read-only:", error.exit_code)
store = parts.PartStore(full / "a.nc", "key")
kept = 0
try:
    with store:
        for number in range(1000):
            rows = Rows(np.arange(1000) + 1000 * number, dict(x=np.random.default_rng(0).random((1000, 20))))
            store.write(str(number), Chunk(rows).tables)
            kept += 1
except OutputFailed as error:
    print("full:", error.exit_code, str(full) in str(error), error.free_bytes < 200_000)
with store:
    print("kept:", 0 < kept == len(store.finished()))
"""


@pytest.mark.fault(26, 27)
@pytest.mark.skipif(shutil.which("unshare") is None, reason="unshare is not installed")
def test_real_full_and_read_only_disks(tmp_path):
    full, read_only = tmp_path / "full", tmp_path / "read_only"
    full.mkdir()
    read_only.mkdir()
    code = REAL_DISKS.format(root=str(Path(__file__).parents[2]), full=str(full), read_only=str(read_only))
    mounts = f"mount -t tmpfs -o size=1m x '{full}' && mount -t tmpfs -o ro x '{read_only}' || exit 77"
    run = subprocess.run(
        ["unshare", "-Urm", "sh", "-c", f'{mounts}; exec "$@"', "sh", sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
    )
    if run.returncode == 77 or "unshare failed" in run.stderr:
        pytest.skip("this system lets users mount nothing")
    assert run.stdout.splitlines() == ["read-only: 74", "full: 74 True True", "kept: True"], run.stderr
