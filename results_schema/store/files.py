"""The only module that opens, writes, syncs and replaces files of results.

A file appears under its name whole or not at all: it is written beside, closed, synced, moved over the name, and
the folder is synced.
"""

import errno
import hashlib
import os
import shutil
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path

from results_schema.errors import BadInput, OutputFailed

# The netCDF and HDF5 libraries are not safe under threads: every call into them holds this lock.
NETCDF_LOCK = threading.RLock()

TEMPORARY = ".wanderlast-tmp"
SIDECAR = ".sha256"
SIGNATURE = b"\x89HDF\r\n\x1a\n"


class Faults:
    """What goes wrong before an operation ("open", "write", "fsync", "replace"): nothing, except in tests."""

    def before(self, operation: str, path: Path) -> None:
        """Called before each operation; a test's subclass raises OSError or kills the process here."""


FAULTS = Faults()


def write_whole(path: Path | str, write: Callable[[Path], object], look: Callable[[], None] = lambda: None) -> None:
    """Let `write` fill a temporary file beside `path`, then put it in the place of `path`.

    look: called just before that; what it raises leaves the old file. Raises OutputFailed (path, free bytes) when the
    system or the netCDF library cannot write; the old file stays.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}{TEMPORARY}")
    try:
        FAULTS.before("open", temporary)
        temporary.touch()
        FAULTS.before("write", temporary)
        write(temporary)
        _sync(temporary)
        FAULTS.before("replace", path)
        look()
        os.replace(temporary, path)
        _sync(path.parent)
    except BaseException as error:
        _discard(temporary)
        if isinstance(error, OSError) or (isinstance(error, RuntimeError) and str(error).startswith("NetCDF:")):
            raise output_failed(path, error) from error
        raise


def output_failed(path: Path, error: BaseException) -> OutputFailed:
    """The error for a failed operation on `path`, with the bytes that are free there."""
    reason, free = getattr(error, "strerror", None) or str(error), _free_bytes(path.parent)
    is_full = getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    if free == 0 and not is_full:  # of which netCDF's library says "Permission denied"
        reason, is_full = os.strerror(errno.ENOSPC), True
    remedy = f"{'free some space or ' if is_full else ''}choose another place, then run again: finished work is kept"
    return OutputFailed(f"cannot write ({reason})", path=path, free_bytes=free, remedy=remedy)


def _free_bytes(folder: Path) -> int | None:
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return None


def _sync(path: Path) -> None:
    FAULTS.before("fsync", path)
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _discard(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError:
        # The disk that failed may refuse this too; the next start cleans up.
        return


def clean_leftovers(path: Path | str) -> None:
    """Remove temporary files that a killed run left beside `path`; call it while holding the lock of `path`."""
    path = Path(path)
    for entry in path.parent.iterdir():
        if entry.name.startswith(f".{path.name}.") and entry.name.endswith(TEMPORARY):
            _discard(entry)


def write_text(path: Path | str, text: str) -> None:
    """Write a small UTF-8 file whole. Raises OutputFailed."""
    write_whole(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def make_folder(path: Path) -> None:
    """Create a folder (its parent exists) and sync the parent. Raises OutputFailed."""
    try:
        FAULTS.before("open", path)
        path.mkdir(exist_ok=True)
        _sync(path.parent)
    except OSError as error:
        raise output_failed(path, error) from error


def remove_folder(path: Path) -> None:
    """Remove a folder with everything in it, if it is there. Raises OutputFailed."""
    try:
        if path.exists():
            FAULTS.before("open", path)
            shutil.rmtree(path)
    except OSError as error:
        raise output_failed(path, error) from error


def remove_file(path: Path) -> None:
    """Remove a file and its sidecar, if they are there. Raises OutputFailed."""
    try:
        path.unlink(missing_ok=True)
        sidecar(path).unlink(missing_ok=True)
    except OSError as error:
        raise output_failed(path, error) from error


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def sidecar(path: Path) -> Path:
    """The file beside `path` that holds its SHA-256, in the form that `sha256sum --check` reads."""
    return path.with_name(path.name + SIDECAR)


def write_sidecar(path: Path) -> None:
    """Store the SHA-256 of a finished file beside it. Raises OutputFailed."""
    try:
        digest = sha256_of(path)
    except OSError as error:
        raise output_failed(path, error) from error
    write_text(sidecar(path), f"{digest}  {path.name}\n")


def sidecar_matches(path: Path) -> bool:
    """Whether the file is the one its sidecar was written for (False where either is missing or unreadable)."""
    try:
        return sidecar(path).read_text(encoding="utf-8") == f"{sha256_of(path)}  {path.name}\n"
    except (OSError, UnicodeDecodeError):
        return False


def check_output_place(path: Path | str) -> None:
    """Refuse a place where `path` could not be written, before anything is computed.

    Raises BadInput when the folder is missing or a file, or when `path` itself is a folder, and OutputFailed when
    the folder is read-only or the disk full. Leaves nothing behind.
    """
    path = Path(path)
    folder = path.parent
    if not folder.exists():
        raise BadInput("the output folder does not exist", where=str(folder), remedy="create it first")
    if not folder.is_dir():
        raise BadInput("the output folder is a file", where=str(folder), expected="a folder", received="a file")
    if path.is_dir():
        raise BadInput("the output is a folder", where=str(path), expected="the name of a file", received="a folder")
    try:
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(b"0")
    except (PermissionError, FileNotFoundError) as error:
        raise _read_only(folder, error) from error
    except OSError as error:
        if error.errno == errno.EROFS:
            raise _read_only(folder, error) from error
        raise output_failed(path, error) from error


def check_new_place(path: Path, otherwise: str = "remove it first") -> None:
    """The same for a file that replaces none, but what may be done ``otherwise``. Raises BadInput and OutputFailed."""
    check_output_place(path)
    if path.exists():
        raise BadInput("there is a file already", where=str(path), remedy=f"choose another name, or {otherwise}")


def check_place(path: Path, *, overwrite: bool) -> None:
    """The same for a file that replaces another one if so asked. Raises BadInput and OutputFailed."""
    if overwrite:
        check_output_place(path)
    else:
        check_new_place(path, "replace it (--overwrite, in Python overwrite=True)")


def check_replaceable(path: Path | str) -> None:
    """Refuse to put an archive in the place of anything that none has ever been. Raises BadInput."""
    path = Path(path)
    if path.exists() and not is_hdf5(path):
        what, expected = "what is there is no archive, and is never replaced", "no file, or a netCDF-4 file"
        raise BadInput(what, where=str(path), expected=expected, remedy="choose another place, or move it away")


def is_hdf5(path: Path) -> bool:
    """Whether this is a file that begins as every netCDF-4 (HDF5) file does."""
    try:
        # Only files: to open a pipe would wait for its other end.
        if not path.is_file():
            return False
        with path.open("rb") as stream:
            return stream.read(len(SIGNATURE)) == SIGNATURE
    except OSError:
        return False


def check_free(folder: Path, needed: int, what: str) -> None:
    """Refuse a disk with fewer than `needed` free bytes for `what`. Raises OutputFailed."""
    free = _free_bytes(folder)
    if free is not None and needed > free:
        raise OutputFailed(
            f"{what} would not fit on the disk",
            path=folder,
            free_bytes=free,
            expected=f"{needed} bytes",
            remedy="fewer variants, sensors or histories, or another place",
        )


def _read_only(folder: Path, error: OSError) -> OutputFailed:
    return OutputFailed(
        "the output folder cannot be written",
        path=folder,
        free_bytes=_free_bytes(folder),
        expected="a writable folder",
        received=str(error.strerror),
        remedy="choose another folder",
    )
