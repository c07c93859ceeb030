"""The finished parts of a run: one immutable netCDF-4 file each, from which a killed run goes on.

Beside an archive `a.nc` lie `a.nc.lock`, held by the run, and the folder `a.nc.parts` with a file `key` (what they were
computed from, and the study's name), the parts, and the SHA-256 of each. A part counts when its SHA-256 does and it
carries the same key.
"""

import fcntl
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import IO, NamedTuple, Self

import numpy as np

from results_schema.blocks import IN_MEMORY
from results_schema.errors import ArchiveBusy, ArchiveError, BadInput
from results_schema.store import files
from results_schema.store.files import output_failed
from results_schema.store.reading import opened, read_tables
from results_schema.store.rows import VARIANTS, RowsOnDisk
from results_schema.store.tables import CONTENTS, DIGEST, Table
from results_schema.store.writing import PLAIN, write_tables


class Lock:
    """An exclusive lock on `path` ("<archive>.lock"), taken at once or not at all.

    Raises ArchiveBusy when another run holds it, OutputFailed when the lock file cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = -1

    def take(self) -> None:
        """Take the lock; it is held until `release` or the end of the process."""
        while self._descriptor < 0:
            try:
                descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            except OSError as error:
                raise output_failed(self._path, error) from error
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                os.close(descriptor)
                raise ArchiveBusy(
                    "another run holds this archive", where=str(self._path), remedy="wait for it or stop it"
                ) from error
            except OSError as error:
                os.close(descriptor)
                raise output_failed(self._path, error) from error
            if self._is_current(descriptor):
                self._descriptor = descriptor
            else:
                # The former holder removed this file between our open and our lock: try the new one.
                os.close(descriptor)

    def release(self) -> None:
        """Remove the lock file and let go (the removal comes first, so that nobody locks a file about to vanish)."""
        if self._descriptor >= 0:
            self._path.unlink(missing_ok=True)
            os.close(self._descriptor)
            self._descriptor = -1

    def _is_current(self, descriptor: int) -> bool:
        try:
            return os.path.samestat(os.fstat(descriptor), self._path.stat())
        except FileNotFoundError:
            return False


_KEY_FILE = "key"
_KEY = "run_key"
_SUFFIX = ".nc"
_NOBODY = np.empty(0, np.int64)

Part = Mapping[str, Table]


class Origin(NamedTuple):
    """The study that parts are of: its name, its text, and what another text has otherwise, in words ("" where it
    cannot be told)."""

    name: str = ""
    text: str = ""
    changed: Callable[[str], str] = lambda _: ""


UNNAMED = Origin()


class PartStore:
    """The parts of one archive by name, locked while the `with` block lasts.

    key: what the results depend on. study: whose they are, kept beside them. look: called under the lock, before
    anything is touched; it may refuse what lies at the archive's place. discard: parts with another key are removed
    instead of refused (`--overwrite`).
    Entering raises ArchiveBusy when another run holds the archive, and BadInput when parts there have another key, or
    files that are none of ours lie among them.
    """

    def __init__(
        self,
        archive: Path | str,
        key: str,
        look: Callable[[], object] = lambda: None,
        *,
        study: Origin = UNNAMED,
        discard: bool = False,
    ) -> None:
        self.key, self._study = key, study
        self._archive, self._folder = Path(archive), _folder_of(archive)
        self._lock = Lock(Path(f"{archive}.lock"))
        self._look, self._discard = look, discard
        self._written: dict[Path, np.ndarray] = {}  # by this process, with their variants: whole

    def __enter__(self) -> Self:
        self._lock.take()
        try:
            self._look()
            self._open()
        except BaseException:
            self._lock.release()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def _open(self) -> None:
        files.clean_leftovers(self._archive)
        if self._folder.exists() and not self._folder.is_dir():
            raise BadInput("a file is in the way of the parts", where=str(self._folder), remedy="move it away")
        if others := _not_ours(self._folder):
            what, remedy = "files that no run has put there are among the parts", "move them away"
            raise BadInput(what, where=str(self._folder), received=", ".join(others), remedy=remedy)
        found = _stored_key(self._folder)
        if found and found != self.key and not self._discard:
            changed = self._study.changed(_stored_text(self._folder))
            raise BadInput(
                "unfinished parts of another study or program version are there",
                where=str(self._folder),
                expected="those of this very study" if changed else f"key {self.key}",
                received=changed or f"key {found}",
                remedy="finish that run with its own study and version, or discard its parts with --overwrite",
            )
        if found != self.key:
            # Without a key (a power cut before the first part) nothing in the folder can be trusted.
            files.remove_folder(self._folder)
        files.make_folder(self._folder)
        if found != self.key:
            files.write_text(self._folder / _KEY_FILE, f"{self.key}\n{self._study.name}\n{self._study.text}")

    def write(self, name: str, part: Part) -> Path:
        """Store one finished part, tables by group ("/" first).

        Raises OutputFailed when the disk cannot take it, ValueError for what a netCDF-4 file of ours cannot hold.
        """
        root = part["/"]
        tables = {**part, "/": replace(root, attributes={**root.attributes, _KEY: self.key})}
        path = self._folder / (name + _SUFFIX)
        files.write_whole(path, partial(write_tables, tables=tables, filters=PLAIN))
        files.write_sidecar(path)
        self._written[path] = _variants_of(root)
        return path

    def finished(self) -> dict[str, np.ndarray]:
        """The variants of every valid part by name (none in a piece); whatever else lies in the folder is deleted."""
        others = (path for path in self._folder.glob(f"*{_SUFFIX}") if path not in self._written)
        found = dict(sorted((_valid(others, self.key) | self._written).items()))
        kept = {self._folder / _KEY_FILE, *found, *map(files.sidecar, found)}
        for path in sorted(self._folder.iterdir()):
            if path not in kept:
                files.remove_file(path)
        return {path.stem: variants for path, variants in found.items()}

    def read(self, name: str) -> Part:
        """One part. Raises ArchiveError where it turns out damaged; it is deleted then."""
        path = self._folder / (name + _SUFFIX)
        try:
            with opened(path) as dataset:
                tables = read_tables(path, dataset)
        except ArchiveError as error:
            files.remove_file(path)
            self._written.pop(path, None)
            what = f"this part cannot be used ({error.what})"
            raise ArchiveError(what, where=str(path), remedy="run again: it is computed again") from error
        own = {key: value for key, value in tables["/"].attributes.items() if key not in (_KEY, CONTENTS, DIGEST)}
        return {**tables, "/": replace(tables["/"], attributes=own)}

    def scratch(self) -> IO[bytes]:
        """A file without a name, gone when it is closed, on the disk of the parts. Raises OutputFailed."""
        try:
            return tempfile.TemporaryFile(dir=self._folder, suffix=files.TEMPORARY)
        except OSError as error:
            raise output_failed(self._folder, error) from error

    def rows(self, variants: int, size: int) -> RowsOnDisk | None:
        """Where to put results of so many variants, of at most so many bytes; None: in memory. Raises OutputFailed."""
        return RowsOnDisk(self.scratch(), self._folder, variants) if size > IN_MEMORY else None

    def remove(self) -> None:
        """Remove all of it: the archive is written."""
        files.remove_folder(self._folder)


def _not_ours(folder: Path) -> list[str]:
    """Some names in a folder that no run gives: any but its key, parts, their checksums and leftovers of a power cut;
    without a key, which comes first, any but leftovers."""
    if not folder.is_dir():
        return []
    keyed = (folder / _KEY_FILE).is_file()
    endings = (files.TEMPORARY, *((_SUFFIX, f"{_SUFFIX}{files.SIDECAR}") if keyed else ()))
    names = sorted(entry.name for entry in folder.iterdir() if entry.is_dir() or not entry.name.endswith(endings))
    return [name for name in names if name != _KEY_FILE][:3]


def finished_so_far(archive: Path | str) -> list[np.ndarray] | None:
    """The variants of every valid part beside an archive, None where there are no parts.

    Only reads: another run may be at work there.
    """
    folder = _folder_of(archive)
    return list(_valid(folder.glob(f"*{_SUFFIX}"), _stored_key(folder)).values()) if folder.is_dir() else None


def bytes_so_far(archive: Path | str) -> int:
    """What the parts beside an archive take of the disk."""
    folder = _folder_of(archive)
    with suppress(OSError):  # none, or a run that is at work there has just replaced one
        return sum(path.stat().st_size for path in folder.iterdir())
    return 0


def unfinished_study(archive: Path | str) -> str:
    """The name of the study whose unfinished parts lie beside an archive, "" where it cannot be told."""
    return _stored(_folder_of(archive), 1)


def _valid(paths: Iterable[Path], key: str) -> dict[Path, np.ndarray]:
    """The parts among files with their own SHA-256 and this key, and the variants that they hold."""
    found = {}
    for path in sorted(paths):
        with suppress(ArchiveError, BadInput):
            if files.sidecar_matches(path):
                with opened(path) as dataset:
                    if getattr(dataset, _KEY, "") == key:
                        known = dataset.variables.get(VARIANTS)
                        found[path] = _NOBODY if known is None else np.asarray(known[...])
    return found


def _variants_of(root: Table) -> np.ndarray:
    """The variants that a part's first table names, none in a piece."""
    known = root.columns.get(VARIANTS)
    return _NOBODY if known is None else np.asarray(known.data)


def _folder_of(archive: Path | str) -> Path:
    """The folder of an archive's unfinished run."""
    return Path(f"{archive}.parts")


def _stored_text(folder: Path) -> str:
    """The text of the study whose parts are in a folder, "" where it cannot be told."""
    try:
        return (folder / _KEY_FILE).read_text(encoding="utf-8").partition("\n")[2].partition("\n")[2]
    except (OSError, UnicodeDecodeError):
        return ""


def _stored_key(folder: Path) -> str:
    """The key of the parts in a folder, "" where it cannot be told."""
    return _stored(folder, 0)


def _stored(folder: Path, line: int) -> str:
    """A line of the file beside the parts in a folder, "" where it cannot be told."""
    try:
        return [*(folder / _KEY_FILE).read_text(encoding="utf-8").splitlines(), "", ""][line].strip()
    except (OSError, UnicodeDecodeError):
        return ""
