"""What an archive says of its making: the study, the program and its packages, the machine, the time."""

import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from engine.batch.handshake import version_of
from engine.scene.study import Study
from results_schema.cores import cores
from results_schema.store.archive import FILES, files_text
from results_schema.store.reading import SCHEMA_VERSION
from studies.protocol.study import study_attributes
from studies.runs.identity import PIECES, SOURCES, files_of, foreign_pieces, sources, sources_hash

CONVENTIONS = "CF-1.11"
PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "xarray", "netCDF4", "dask", "pydantic", "pint")
DIGITS = 12  # of the hash of our sources: people compare them


def attributes(study: Study, key: str, seconds: float) -> Mapping[str, Any]:
    """Root attributes of an archive. key: what the results belong to; seconds: duration of this run."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {
        "Conventions": CONVENTIONS,
        **study_attributes(study),
        **({FILES: files_text(hashes)} if (hashes := files_of(study)) else {}),
        **({PIECES: pieces} if (pieces := foreign_pieces(study)) else {}),
        "schema_version": SCHEMA_VERSION,
        "results_key": key,
        SOURCES: sources_hash(sources())[:DIGITS],
        "packages": [f"{name} {version_of(name)}" for name in ("wanderlast", *PACKAGES)],
        "python": platform.python_version(),
        "machine": machine(),
        "run_seconds": round(seconds, 3),
        "history": f"{now} wanderlast {version_of('wanderlast')}: run of {study.kind}",
    }


def machine() -> str:
    """The machine in one line: processor, number of cores, system."""
    count = cores()
    return f"{_processor()}, {count} core{'s' if count > 1 else ''}, {platform.system()} {platform.release()}"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())
