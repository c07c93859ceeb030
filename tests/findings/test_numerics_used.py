"""Along lines through the parameter space no result of a study jumps where another model is chosen."""

import numpy as np
import pytest
import xarray as xr

import studies
from engine.batch.execution import run
from engine.observation.cycle_reduction import Compared, Reduction
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from studies.findings.numerics_used import as_json, told_choices
from studies.kinds.asymmetry import AsymmetryReduction
from studies.kinds.double_peak import DoublePeakReduction
from studies.results.results import Results
from tests.engine.build import Table, beam, cruise, mass, shuttle, study, swing

MOST_CHANGES = 8  # of what is chosen along a line, that are looked at
BED = beam(modes="auto", damping_ratio=0.05)
OUT_AND_BACK = mass(0.3, shuttle(0.1, 0.9, 0.3, 0.1, 4))
SWUNG = mass(0.3, swing(0.5, 0.4, 0.15, 4))
LINES: dict[str, tuple[str, Table, Reduction, str, float, float]] = {
    "lag by speed": ("asymmetry", OUT_AND_BACK, AsymmetryReduction(), "carriage.car.motion.speed", 0.05, 0.5),
    "lag by damping": ("asymmetry", OUT_AND_BACK, AsymmetryReduction(), "body.bed.damping_ratio", 0.02, 0.1),
    "peaks by pace": ("double-peak", SWUNG, DoublePeakReduction(), "carriage.car.motion.frequency", 0.05, 0.25),
    "peaks by mass": ("double-peak", SWUNG, DoublePeakReduction(), "carriage.car.mass", 0.01, 1.0),
}


def changes(found: xr.Dataset) -> Array:
    """Places along the line next to which model, modes, scheme or steps change, on both sides."""
    used = np.stack([found[f"{name}_used"].values for name in ("fidelity", "modes", "scheme", "steps")])
    places = np.flatnonzero((np.diff(used, axis=1) != 0).any(axis=0))
    places = places[np.unique(np.linspace(0, places.size - 1, MOST_CHANGES).astype(np.int64))]
    return np.union1d(places, places + 1)


@pytest.mark.parametrize("name", LINES)
def test_no_jumps_where_the_choice_changes(name: str) -> None:
    """What is chosen on both sides of a change is marched again until it converges."""
    kind, carriage, reduction, path, low, high = LINES[name]
    given = study(BED, carriage, kind=kind)
    line = np.geomspace(low, high, 300)
    chosen = run(given.with_values({"sweep": {"line": {"of": path, "values": line.tolist()}}}), reduction=reduction)
    places = changes(chosen)
    assert places.size >= 2
    sweep = {"line": {"of": path, "values": line[places].tolist()}}
    converged = run(given.with_values({"sweep": sweep}), reduction=reduction)
    one, two = (
        {key: side[key].values for key in reduction.outputs(given)} for side in (chosen[dict(line=places)], converged)
    )
    scale = np.stack([converged[f"{sensor}_static"].values for sensor in given.sensor], axis=1)
    compared = Compared(
        one, two, scale, np.zeros_like(scale.T), VariantValues(given, {path: line[places]}, places.size)
    )
    for jump in reduction.differences(compared).values():
        assert np.all(jump <= given.solver.tolerance)


def test_peaks_where_the_cycle_is_closed() -> None:
    """Two numbers of steps tell the same peaks, within what both say of their errors."""
    pace = mass(0.3, swing(0.5, 0.4, 0.228777, 2))
    bed = beam(modes=12, damping_ratio=0.02)
    one, two = (
        run(study(bed, pace, kind="double-peak", solver={"steps": steps}), reduction=DoublePeakReduction())
        for steps in (3200, 2400)
    )
    gap = np.nanmax(np.abs(one.peak_value.values - two.peak_value.values)) / float(one.midspan_static)
    assert gap <= 2.0 * float(one.error_estimate + two.error_estimate)


# ---- sentences ----


ZETA = {"zeta": {"of": "body.bed.damping_ratio", "values": [0.0, 0.4]}}


def found(schemes: tuple[int, int] = (0, 1)) -> Results:
    """Two variants, as if they had been marched by these schemes with 4 and 8 modes."""
    bed = beam(modes="auto", supports="clamped-free")
    given = study(bed, mass(0.1, cruise(0.3, 1.0, 0.05)), sweep=ZETA, solver={"audit": 0})
    dataset = studies.run(given)
    for name, values in (("scheme_used", schemes), ("modes_used", (4, 8))):
        dataset[name].values[:] = np.array(values)
    return Results.of(dataset)


def test_schemes_are_told_where_there_are_several() -> None:
    assert "Variants by scheme: average-acceleration 1, fox-goodwin 1." in told_choices(found())
    assert not any("by scheme" in said for said in told_choices(found((0, 0))))


def test_every_model_has_an_entry_of_its_own() -> None:
    results = found()
    (entry,) = as_json(results)
    assert entry["model"] == "mass" and entry["variants"] == 2 and entry["without_estimate"] == 0
    assert entry["modes"] == [4, 8] and entry["schemes"] == ["average-acceleration", "fox-goodwin"]
    assert entry["largest_error_estimate"] == results.dataset.error_estimate.values.max()
    assert entry["mean_work"] == results.dataset.work.values.mean()
