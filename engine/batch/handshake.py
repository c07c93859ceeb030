"""What a process computes with: versions, the program's own text, and its arithmetic on a small sample."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, distributions, version
from pathlib import Path

from results_schema.errors import BadInput

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "dask", "distributed")
PROGRAM = Path(__file__).parents[2]
ROOMS = ("engine", "results_schema", "studies")
PIECES = "wanderlast."  # how the groups of entry points begin by which other packages bring pieces

Computer = Mapping[str, str]


@cache
def own_computer() -> Computer:
    """What this process computes with, by what it is called."""
    return {
        "Python": platform.python_version(),
        **{name: version_of(name) for name in LIBRARIES},
        "the program": _hash_of_program(),
        "pieces of other packages": ", ".join(_foreign()) or "none",
        "the arithmetic of a sample": _arithmetic(),
    }


def check_computer(other: Computer, where: str) -> None:
    """Refuse a process that computes with anything else than this one. Raises BadInput."""
    for name, mine in own_computer().items():
        theirs = other.get(name, "unknown")
        if theirs != mine:
            what = f"{name} of this worker is not as here, so that it may compute other numbers"
            remedy = "install the same versions there, on the same sort of processor"
            raise BadInput(what, where=where, expected=mine, received=theirs, remedy=remedy)


def version_of(package: str) -> str:
    """The version of a package that is installed here."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


def _hash_of_program() -> str:
    digest = hashlib.sha256()
    for path in sorted(path for room in ROOMS for path in (PROGRAM / room).rglob("*.py")):
        digest.update(path.relative_to(PROGRAM).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _foreign() -> list[str]:
    """Pieces that other packages bring, with the versions of these."""
    packages = [(package.version, point) for package in distributions() for point in package.entry_points]
    return sorted(f"{point.group}.{point.name} {own}" for own, point in packages if point.group.startswith(PIECES))


def _arithmetic() -> str:
    """SHA-256 of the bits of a march, of linear algebra and of elementary functions."""
    import numpy as np

    from engine.batch.plan import make_plan
    from engine.linear_algebra import one_thread
    from engine.march.outcome import outcome
    from engine.scene.study import Study

    digest = hashlib.sha256()
    with one_thread():
        plan = make_plan(Study(**SAMPLE))
        (grid,) = plan.grids
        found = outcome(plan.asked, grid.tables(grid.scene, 1), grid.values, np.arange(0, 200, 10)).numbers
        x = np.linspace(0.1, 30.0, 257)
        matrix = np.cos(np.outer(x, x)) + np.diag(x)
        values, vectors = np.linalg.eigh(matrix + matrix.T)
        numbers = [*(found[name] for name in sorted(found)), values, vectors, np.linalg.inv(matrix)]
        for array in (*numbers, np.exp(-x), np.sin(x), np.cosh(x), np.log(x), np.cbrt(x), matrix @ matrix):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]


SAMPLE = {
    "kind": "passage",
    "body": {
        "bed": {
            "kind": "beam",
            "length": 3.0,
            "area": 0.01,
            "second_moment": 1e-5,
            "youngs_modulus": 2.1e11,
            "density": 7850.0,
            "supports": "pinned-pinned",
            "damping_ratio": 0.02,
            "modes": 4,
        }
    },
    "carriage": {
        "car": {
            "on": "bed",
            "kind": "mass",
            "mass": 100.0,
            "motion": {"kind": "cruise", "start": 0.0, "end": 3.0, "speed": 20.0},
        }
    },
    "sensor": {"midspan": {"body": "bed", "at": 1.3}},
    "sweep": {"mass": {"of": "carriage.car.mass", "values": [10.0, 100.0, 200.0]}},
    "solver": {"steps": 200, "fidelity": "full", "scheme": "average-acceleration", "audit": 0},
    "output": {"histories": "none"},
}
