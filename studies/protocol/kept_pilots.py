"""What pilots found as a part of a run, so that a run that goes on need not measure again."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from results_schema.arrays import Counts
from results_schema.errors import ArchiveError
from results_schema.store.tables import Table, from_arrays

if TYPE_CHECKING:
    from engine.accuracy.choice import Found
    from studies.protocol.store import Store

NAME = "pilots"  # of the part
_SCENE, _PILOTS = "scene", "pilots"


class KeptPilots:
    """Keeps what pilots found in a run's store; as of `engine.accuracy.choice.Kept`."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def read(self, drawn: Counts) -> Found | None:
        """What these pilots found, where the store holds just that."""
        if NAME not in self._store.finished():
            return None
        with suppress(ArchiveError):  # damaged: they are measured again
            found = _found(self._store.read(NAME)["/"])
            if np.array_equal(np.sort(found.pilots), np.sort(drawn)):
                return found
        return None

    def write(self, found: Found) -> None:
        """Keep it."""
        measured = {field.name: getattr(found.measured, field.name) for field in fields(found.measured)}
        values = {_SCENE: found.scene, _PILOTS: found.pilots, **measured}
        arrays = {name: np.asarray(value) for name, value in values.items()}
        flags = {name: array.astype(np.int8) for name, array in arrays.items() if array.dtype == np.bool_}
        self._store.write(NAME, {"/": from_arrays(arrays | flags)})


def _found(table: Table) -> Found:
    """What a part holds."""
    from engine.accuracy.choice import Found
    from engine.accuracy.climb import Measured

    values = {name: column.data for name, column in table.columns.items()}
    scene, pilots = int(values.pop(_SCENE)), values.pop(_PILOTS)
    whole = {"marched": values["marched"] != 0, "work": float(values["work"]), "free": bool(values["free"])}
    return Found(scene, pilots, Measured(**(values | whole)))
