"""Refuses HDF5 files that point at other files: external links, soft links, external storage, virtual datasets.

The netCDF library follows such pointers while it opens a file and has no call to ask for them, so the HDF5 library
that it brought along is asked directly. Where that library cannot be found (an installation that is linked
statically), the check is left out: the system's rights on files are then the only guard.
"""

import ctypes
import sys
from functools import cache
from pathlib import Path
from typing import Any

from results_schema.errors import ArchiveError, BadInput

_HARD_LINK = 0
_DATASET = 5
_VIRTUAL_LAYOUT = 3
_BY_NAME = 0
_INCREASING = 0
_READ_ONLY = 0
_DEFAULT = 0

_Visitor = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int64, ctypes.c_char_p, ctypes.c_void_p, ctypes.c_void_p)


def refuse_pointers(path: Path) -> None:
    """Raise BadInput when the file points at others, ArchiveError when it is no readable HDF5 file.

    Hold `files.NETCDF_LOCK`.
    """
    library = hdf5_library()
    if library is None:
        return
    identifier = library.H5Fopen(str(path).encode(), _READ_ONLY, _DEFAULT)
    if identifier < 0:
        raise ArchiveError("damaged or truncated, or not a netCDF-4 file", where=str(path))
    try:
        found = _pointers(library, identifier)
    finally:
        library.H5Fclose(identifier)
    if found is None:
        raise ArchiveError("damaged: its groups cannot be listed", where=str(path))
    if found:
        raise BadInput(
            "the file points at data in other files",
            where=str(path),
            expected="an archive that holds all of its data",
            received=", ".join(found),
            remedy="do not open files of unknown origin",
        )


def _pointers(library: Any, file: int) -> list[str] | None:
    found: list[str] = []

    def visit(group: int, name: bytes, information: int, _data: int) -> int:
        # The first member of H5L_info2_t is the type of the link, an int.
        shown = name.decode("utf-8", "replace")
        if ctypes.c_int.from_address(information).value != _HARD_LINK:
            found.append(f"link {shown}")
            return 0
        what = _storage_elsewhere(library, group, name)
        if what:
            found.append(f"{what} of {shown}")
        return 0

    visitor = _Visitor(visit)
    outcome = library.H5Lvisit2(file, _BY_NAME, _INCREASING, visitor, None)
    return None if outcome < 0 else found


def _storage_elsewhere(library: Any, group: int, name: bytes) -> str:
    item = library.H5Oopen(group, name, _DEFAULT)
    if item < 0:
        return ""
    try:
        if library.H5Iget_type(item) != _DATASET:
            return ""
        creation = library.H5Dget_create_plist(item)
        external = library.H5Pget_external_count(creation) > 0
        virtual = library.H5Pget_layout(creation) == _VIRTUAL_LAYOUT
        library.H5Pclose(creation)
        return "external storage" if external else "virtual storage" if virtual else ""
    finally:
        library.H5Oclose(item)


@cache
def hdf5_library() -> Any:
    """The HDF5 library of the netCDF4 package with the calls used here declared, or None where it is not found."""
    import netCDF4

    package = Path(netCDF4.__file__).parent
    candidates = [*_loaded(), *_bundled(package)]
    for candidate in candidates:
        try:
            return _declared(ctypes.CDLL(str(candidate)))
        except (OSError, AttributeError):
            continue
    return None


def _loaded() -> list[str]:
    """Files named libhdf5 that this process has mapped (Linux)."""
    try:
        lines = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    paths = {line.split(maxsplit=5)[-1] for line in lines}
    return sorted(path for path in paths if _is_hdf5(Path(path).name))


def _bundled(package: Path) -> list[Path]:
    folders = [package / ".dylibs", package.parent / "netcdf4.libs", package.parent / "netCDF4.libs"]
    folders += [Path(sys.prefix) / "lib"]
    return [path for folder in folders if folder.is_dir() for path in sorted(folder.iterdir()) if _is_hdf5(path.name)]


def _is_hdf5(name: str) -> bool:
    """Whether this is the plain C library (not its high-level, Fortran or C++ companions).

    >>> _is_hdf5("libhdf5-1a2b.so.320"), _is_hdf5("libhdf5_hl.so.320")
    (True, False)
    """
    return name.startswith(("libhdf5-", "libhdf5.", "libhdf5_serial.", "libhdf5_serial-")) and (
        ".so" in name or name.endswith(".dylib")
    )


def _declared(library: Any) -> Any:
    identifier, text = ctypes.c_int64, ctypes.c_char_p
    signatures: dict[str, tuple[Any, list[Any]]] = {
        "H5Fopen": (identifier, [text, ctypes.c_uint, identifier]),
        "H5Fclose": (ctypes.c_int, [identifier]),
        "H5Lvisit2": (ctypes.c_int, [identifier, ctypes.c_int, ctypes.c_int, _Visitor, ctypes.c_void_p]),
        "H5Oopen": (identifier, [identifier, text, identifier]),
        "H5Oclose": (ctypes.c_int, [identifier]),
        "H5Iget_type": (ctypes.c_int, [identifier]),
        "H5Dget_create_plist": (identifier, [identifier]),
        "H5Pget_external_count": (ctypes.c_int, [identifier]),
        "H5Pget_layout": (ctypes.c_int, [identifier]),
        "H5Pclose": (ctypes.c_int, [identifier]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library
