"""Sentences on what variants were given."""

import numpy as np

import studies
from studies.findings.numerics_used import as_json, told_choices
from studies.results.results import Results
from tests.engine.build import beam, cruise, mass, study

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
