"""Small datasets as a study would hand them over, and ways to let the disk fail."""

import errno
import os
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr

from results_schema.store import files
from results_schema.variables import axes, expand

SENSORS = {"midspan": "m", "support": "N m"}
CARRIAGES = ("table",)
RESULTS = ("midspan_max", "lag of é")
ATTRIBUTES = {
    "Conventions": "CF-1.11",
    "title": "A bed, <script>, {{7*7}}, $ and \nümlauts",
    "history": "2026-11-21 wanderlast run",
    "schema_version": 2,
    "study_kind": "march",
    "study": "schema_version = 1\ntitle = 'Brücke'\n",
    "study_sha256": "ab" * 32,
    "packages": ["numpy 2.4.6", "xarray 2026.9"],
    "run_seconds": 1.25,
}


def march(shape: tuple[int, ...] = (4, 3)) -> xr.Dataset:
    """A complete dataset of the march over a grid of speeds and masses (shape () for a study without a sweep)."""
    dims = ("speed", "mass")[: len(shape)]
    numbers = np.arange(1.0, np.prod(shape) + 1).reshape(shape)
    variables = {}
    for index, (name, variable) in enumerate(expand("march", SENSORS, CARRIAGES).items()):
        if variable.lead == "grid":
            data = np.asarray(numbers / (index + 3), variable.dtype)
            data = np.zeros_like(data) if variable.flags else data
            data = np.stack([data, 2 * data], axis=-1) if variable.dims == ("result",) else data
            variables[name] = ((*dims, *variable.dims), data, variable.attributes())
    result = ("result", list(RESULTS), axes()["result"].attributes())
    dataset = xr.Dataset(variables, coords={"result": result}, attrs=ATTRIBUTES)
    for name, size in zip(dims, shape, strict=True):
        dataset = dataset.assign_coords({name: (name, np.arange(1.0, size + 1), {"units": "kg", "long_name": name})})
    if shape:
        ratio = axes()["speed_ratio"]
        dataset = dataset.assign_coords(speed_ratio=("speed", dataset.speed.values / 7, ratio.attributes()))
    return dataset


def with_histories(dataset: xr.Dataset, chosen: tuple[int, ...] = (0, 5)) -> xr.Dataset:
    """The dataset with histories of a few variants, on five stations."""
    history = ("history", np.array(chosen), axes()["history"].attributes() | {"units": "1"})
    elapsed = (("history", "station"), np.linspace(0, 1, 5 * len(chosen)).reshape(-1, 5))
    dataset = dataset.assign_coords(history=history, elapsed=(*elapsed, axes()["elapsed"].attributes()))
    for name in SENSORS:
        attributes = expand("march", SENSORS, CARRIAGES)[name].attributes()
        dataset[name] = (("history", "station"), np.sin(elapsed[1]), attributes)
    return dataset


_AUDITED = {
    ("float64", ("sample", "result")): np.array([[1e-4, 1e-5], [2e-4, 1e-2], [np.nan, np.nan]]),
    ("float64", ("result",)): np.array([1e-3, np.nan]),
    ("float64", ("sample",)): np.array([1e-3, 1e-3, 1e-2]),
    ("int64", ()): np.array(2),
    ("int8", ("sample",)): np.array([0, 1, 3], dtype=np.int8),
}


def groups() -> dict[str, xr.Dataset]:
    """The groups `/audit` and `/model/bed`."""
    audit = xr.Dataset(  # NaN where it is allowed
        {
            name: (variable.dims, _AUDITED[variable.dtype, variable.dims], variable.attributes())
            for name, variable in expand("/audit").items()
        },
        coords={
            "sample": ("sample", np.arange(3), axes()["sample"].attributes()),
            "result": ("result", list(RESULTS), axes()["result"].attributes()),
            "scheme": ("sample", np.array(["fox-goodwin", "é", ""]), axes()["scheme"].attributes()),
        },
    )
    model = xr.Dataset(
        {
            "frequency": ("body_mode", np.array([1.5, 6.0]), {"units": "Hz", "long_name": "frequency"}),
            "length": ((), 15.0, {"units": "m", "long_name": "length"}),
            "mass": ((), 1200.0, {"units": "kg", "long_name": "mass"}),
        }
    )
    number = ("body_mode", [1, 2], axes()["body_mode"].attributes())
    return {"/audit": audit, "/model/bed": model.assign_coords(body_mode=number)}


class FailNth(files.Faults):
    """Lets the N-th operation among some meet a full disk; `count` tells how many there were."""

    def __init__(self, number: int, among: Callable[[str, Path], bool] = lambda operation, path: True) -> None:
        self.number, self.among, self.count = number, among, 0

    def before(self, operation: str, path: Path) -> None:
        if self.among(operation, path):
            self.count += 1
            if self.count == self.number:
                self.fail(operation, path)

    def fail(self, operation: str, path: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


class ReadOnlyFrom(FailNth):
    """The disk becomes read-only before the N-th operation."""

    def before(self, operation: str, path: Path) -> None:
        self.count += 1
        if self.count >= self.number:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))


class KillNth(FailNth):
    """Kills the process, as SIGKILL or a power cut would, in the N-th operation."""

    def fail(self, operation: str, path: Path) -> None:
        if operation == "fsync" and path.is_file():
            # What was not synced is not on the disk after a power cut.
            os.truncate(path, path.stat().st_size // 2)
        os.kill(os.getpid(), signal.SIGKILL)


def in_child(action: Callable[[], None]) -> int:
    """Run `action` in a forked process; 0, the signal's number as a negative one, or 1 for an exception."""
    child = os.fork()
    if child == 0:
        try:
            action()
        except BaseException:
            os._exit(1)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status)
