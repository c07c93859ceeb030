"""What an unfinished run keeps beside its archive: one folder of finished work, with a key, under a lock.

Beside an archive `a.nc` lie `a.nc.lock`, held by the run, and the folder `a.nc.parts` with a file `key`: what the
work in the folder was computed from. Only work with the run's own key is gone on from.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from results_schema.errors import BadInput
from results_schema.store import files
from results_schema.store.locks import Lock

_KEY_FILE = "key"


def folder_of(archive_path: Path | str) -> Path:
    """The folder of an archive's unfinished run."""
    archive_path = Path(archive_path)
    return archive_path.with_name(archive_path.name + ".parts")


def stored_key(folder: Path) -> str:
    """The key of the work in a folder, "" where it cannot be told."""
    try:
        return (folder / _KEY_FILE).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return ""


class RunFolder:
    """The folder of one archive's run, locked while the `with` block lasts.

    key: what the results depend on. look: called under the lock, before anything is touched; it may refuse what lies
    at the archive's place.
    Entering raises ArchiveBusy when another run holds the archive, and BadInput when the work there has another
    key (see `discard_foreign`).
    """

    def __init__(self, archive_path: Path | str, key: str, look: Callable[[], object] = lambda: None) -> None:
        archive_path = Path(archive_path)
        self._archive = archive_path
        self._folder = folder_of(archive_path)
        self._lock = Lock(archive_path.with_name(archive_path.name + ".lock"))
        self._key, self._look = key, look
        self._discard = False

    @classmethod
    def discard_foreign(cls, archive_path: Path | str, key: str, look: Callable[[], object] = lambda: None) -> Self:
        """A folder that removes work with another key on entering instead of refusing it (`--overwrite`)."""
        store = cls(archive_path, key, look)
        store._discard = True
        return store

    def __enter__(self) -> Self:
        self._lock.take()
        try:
            self._look()
            self._open()
        except BaseException:
            self._lock.release()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def _open(self) -> None:
        files.clean_leftovers(self._archive)
        if self._folder.exists() and not self._folder.is_dir():
            raise BadInput("a file is in the way of the parts", where=str(self._folder), remedy="move it away")
        found = stored_key(self._folder)
        if found and found != self._key and not self._discard:
            raise BadInput(
                "unfinished parts of another study or program version are there",
                where=str(self._folder),
                expected=f"key {self._key}",
                received=f"key {found}",
                remedy="finish that run with its own study and version, or discard its parts with --overwrite",
            )
        if found != self._key:
            # Without a key (a power cut before the first part) nothing in the folder can be trusted.
            files.remove_folder(self._folder)
        files.make_folder(self._folder)
        if found != self._key:
            files.write_text(self._key_file, self._key + "\n")

    @property
    def key(self) -> str:
        """What the work in the folder belongs to."""
        return self._key

    @property
    def _key_file(self) -> Path:
        return self._folder / _KEY_FILE

    def remove(self) -> None:
        """Remove all of it: the archive is written."""
        files.remove_folder(self._folder)
