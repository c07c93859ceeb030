"""The finished pieces of a run that measures: one immutable netCDF-4 file each, from which a killed run goes on.

They lie in the folder of the run (see `results_schema.store.run_folder`). A piece counts when its SHA-256 does and it
carries the key of the run; it is sealed like an archive.
"""

from __future__ import annotations

import hashlib
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from results_schema.errors import ArchiveError
from results_schema.store import files
from results_schema.store.reading import read_tables
from results_schema.store.run_folder import RunFolder, folder_of
from results_schema.store.tables import CONTENTS, DIGEST, from_dataset, seal, to_dataset
from results_schema.store.writing import write_tables

if TYPE_CHECKING:
    import xarray as xr

_START, _SUFFIX = "piece-", ".nc"
_NAME, _KEY = "piece", "run_key"


class PieceStore(RunFolder):
    """The pieces of one archive by name, locked while the `with` block lasts. Entering raises as `RunFolder`."""

    def write(self, name: str, dataset: xr.Dataset) -> Path:
        """Store one finished piece.

        Raises OutputFailed when the disk cannot take it, ValueError for what an archive cannot hold.
        """
        tables = {"/": from_dataset(dataset.assign_attrs({_NAME: name, _KEY: self._key}))}
        added = seal(tables)
        path = self._folder / (_START + hashlib.sha1(name.encode()).hexdigest() + _SUFFIX)

        def fill(temporary: Path) -> None:
            write_tables(temporary, tables, added)

        files.write_whole(path, fill)
        files.write_sidecar(path)
        return path

    def finished(self) -> dict[str, xr.Dataset]:
        """All valid pieces by name, read whole; whatever else lies in the folder is deleted."""
        found = {}
        for path in sorted(self._folder.glob(f"*{_SUFFIX}")):
            try:
                if not files.sidecar_matches(path):
                    raise ArchiveError("this piece is not what was written", where=str(path))
                name, dataset = _read(path, self._key)
                found[name] = dataset
            except ArchiveError:
                files.remove_file(path)
        for path in sorted(self._folder.iterdir()):
            lonely = path.name.endswith(f"{_SUFFIX}.sha256") and not path.with_suffix("").exists()
            if lonely or not (path.suffix == _SUFFIX or path.name.endswith(".sha256") or path == self._key_file):
                files.remove_file(path)
        return found


def pieces_so_far(archive_path: Path | str) -> int:
    """Number of valid pieces beside an archive. Only reads: another run may be at work there."""
    found = 0
    for path in sorted(folder_of(archive_path).glob(f"{_START}*{_SUFFIX}")):
        with suppress(ArchiveError):
            found += files.sidecar_matches(path)
    return found


def _read(path: Path, key: str) -> tuple[str, xr.Dataset]:
    """Name and dataset of a piece. Raises ArchiveError, also where it belongs to another run than that of the key."""
    import netCDF4

    try:
        with files.NETCDF_LOCK, netCDF4.Dataset(path, "r") as stored:
            dataset = to_dataset(read_tables(path, stored)["/"])
    except (OSError, RuntimeError) as error:
        raise ArchiveError(f"this piece is damaged ({error})", where=str(path)) from error
    if dataset.attrs.get(_KEY) != key:
        raise ArchiveError("this piece belongs to another run", where=str(path))
    name = str(dataset.attrs[_NAME])
    for added in (CONTENTS, DIGEST, _NAME, _KEY):
        dataset.attrs.pop(added, None)
    return name, dataset
