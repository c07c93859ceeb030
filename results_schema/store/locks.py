"""One run per archive: a lock file that the system itself releases when its holder dies."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from results_schema.errors import ArchiveBusy
from results_schema.store.files import output_failed


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
