"""Small studies of each kind, and datasets of them with variants that failed."""

from functools import lru_cache

import numpy as np
import xarray as xr

import engine
import studies
from engine.scene.study import Study
from results_schema.status import Status

BED = """\
[body.bed]
kind = "beam"
length = 10.0
area = 0.01
second_moment = 8e-6
youngs_modulus = "210 GPa"
density = 7850
supports = "pinned-pinned"
damping_ratio = 0.03
modes = 3

[carriage.table]
on = "bed"
kind = "mass"
mass = 100.0

[sensor.midspan]
body = "bed"
at = 5.0

[sensor.moment]
under = "table"
quantity = "bending_moment"
"""
MOTIONS = {
    "asymmetry": 'kind = "out-and-back"\nstart = 5.0\nend = 9.6\nspeed = 3.0\nturn = 0.1\ncycles = 2',
    "double-peak": 'kind = "sinusoidal"\ncentre = 5.0\namplitude = 4.8\nfrequency = 0.4\ncycles = 3',
    "passage": 'kind = "cruise"\nstart = 0.0\nend = 10.0\nspeed = 8.0',
    "trajectory": 'kind = "waypoints"\ntimes = [0, 1, 3]\npositions = [1, 8, 4]',
}
PACE = {"asymmetry": "speed", "double-peak": "frequency", "passage": "speed", "trajectory": None}


def text_of(kind: str, sweep: str = "", title: str = "a table on a bed", extra: str = "") -> str:
    """A study file; sweep: the lines of its table."""
    heading = f'schema_version = 1\nkind = "{kind}"\ntitle = {quoted(title)}'
    swept = f"[sweep]\n{sweep}\n" if sweep else ""
    return f"{heading}\n\n{BED}\n[carriage.table.motion]\n{MOTIONS[kind]}\n\n{extra}\n\n{swept}"


def quoted(text: str) -> str:
    """A TOML string of any text."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def pace(kind: str, low: float = 1.0, high: float = 8.0, count: int = 4) -> str:
    """A sweep's line that varies the pace of the motion."""
    key = PACE[kind]
    if key == "frequency":
        low, high = 0.05 * low, 0.05 * high
    return f'pace = {{ of = "carriage.table.motion.{key}", from = {low}, to = {high}, count = {count} }}'


def study(kind: str, sweep: str = "", **options: str) -> Study:
    """A small study, loaded."""
    return engine.load(text_of(kind, sweep, **options))


@lru_cache(maxsize=64)
def _found(kind: str, sweep: str, **options: str) -> xr.Dataset:
    return studies.run(study(kind, sweep, **options))


def run(kind: str, sweep: str = "", **options: str) -> xr.Dataset:
    """A small study, run once for all tests; a copy of what it found."""
    return _found(kind, sweep, **options).copy(deep=True)


def with_failures(dataset: xr.Dataset, every: int) -> xr.Dataset:
    """The same with every so-manieth variant diverged: status and NaN, as the engine leaves them."""
    failed = np.zeros(dataset["status"].size, dtype=bool)
    failed[::every] = True
    changed = dataset.copy(deep=True)
    status = changed["status"].values.reshape(-1)
    status[failed] = int(Status.DIVERGED)
    changed["status"].values[...] = status.reshape(dataset["status"].shape)
    for array in changed.data_vars.values():
        grid = array.dims[: dataset["status"].ndim] == dataset["status"].dims
        if grid and array.dtype.kind == "f":
            array.values.reshape(failed.size, -1)[failed] = np.nan
    return changed


def with_errors(dataset: xr.Dataset, error: float, *results: str) -> xr.Dataset:
    """The same with these results, or all, estimated so loosely, held to no tolerance."""
    changed = dataset.copy(deep=True)
    which = np.isin(changed["result"].values, results) if results else np.ones(changed.sizes["result"], dtype=bool)
    changed["estimated_error"].values[..., which] = error
    changed["tolerance"].values[which] = np.nan
    return changed
