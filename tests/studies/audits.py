"""Studies that are audited, and what their audits found."""

from pathlib import Path
from typing import Any

import xarray as xr

import studies
from engine.scene.study import Study
from studies.protocol.options import RunOptions
from studies.runs.runner import Outcome, run_to_archive
from tests.engine.build import beam, cruise, mass, study

SWEEP = {
    "speed": {"of": "carriage.car.motion.speed", "values": [0.2, 0.5, 0.9]},
    "mass": {"of": "carriage.car.mass", "values": [0.1, 0.3]},
}
POOR = beam(modes=1, damping_ratio=0.02)
RICH = beam(modes=12, damping_ratio=0.02)
FINE = {"audit": 3, "steps": 1600, "tolerance": 2e-3}


def crossing(bed: dict[str, Any], solver: dict[str, Any], **changes: Any) -> Study:
    """A mass over a beam at three speeds."""
    return study(bed, mass(0.2, cruise(0.0, 1.0, 0.5)), **({"sweep": SWEEP, "solver": solver} | changes))


def outcome(given: Study, folder: Path, threads: int = 1) -> Outcome:
    return run_to_archive(given, folder / "found.nc", RunOptions(threads=threads))


def group_of(found: Outcome) -> xr.Dataset:
    assert found.audit is not None
    return found.audit


def by_hand(given: Study, sample: xr.Dataset) -> xr.Dataset:
    """One variant with all terms, 24 modes and 40,000 steps of Fox-Goodwin's scheme."""
    values = {"carriage.car.motion.speed": float(sample["speed"]), "carriage.car.mass": float(sample["mass"])}
    values |= {"body.bed.modes": 24, "solver.steps": 40_000, "solver.audit": 0, "solver.tolerance": 0.5}
    values |= {"solver.fidelity": "auto", "solver.static_correction": True, "solver.scheme": "fox-goodwin"}
    return studies.run(given.without_sweep().with_values(values))
