"""What studies of an asymmetry say of lags: at which speeds, and over which masses."""

import numpy as np
import xarray as xr

from studies.findings import theory
from studies.kinds.asymmetry import KIND, _lag, _mass
from studies.pictures.asymmetry import pictures
from studies.results.results import Results
from tests.studies import scenes

MASS = 'mass = { of = "carriage.table.mass", values = [50, 100] }'
SAMPLED = scenes.pace("asymmetry").replace("count = 4", "sobol = 4")
DAMPING = 'damping_ratio = { of = "body.bed.damping_ratio", values = [0.01, 0.03, 0.05] }'


def expected(results: Results) -> xr.DataArray:
    """What damping alone gives at midspan."""
    return results.dataset["status"].copy(data=results.everywhere(theory.lag(results, "midspan")))


def test_the_mass_is_told_to_change_the_lag_at_the_lowest_speed_of_samples_too() -> None:
    """At others it changes it by half."""
    dataset = scenes.run("asymmetry", f"{SAMPLED}\n{MASS}")
    dataset["lag"].values[:] = 1e-3
    slowest = dataset["pace"] == dataset["pace"].min()
    dataset["lag"][:] = xr.where((dataset["mass"] > 60.0) & ~slowest, 2e-3, dataset["lag"]).transpose(
        *dataset["lag"].dims
    )
    (said,) = _mass(Results.of(dataset))
    assert said.startswith("The lag hardly feels the mass: from 50 to 100 kg it changes by 0 % at most at ")


def test_lags_beyond_the_speeds_of_the_theory_are_those_of_them_alone() -> None:
    dataset = scenes.run("asymmetry", scenes.pace("asymmetry"))
    known = expected(Results.of(dataset)).values
    dataset["lag"].loc[{"sensor": "midspan"}] = known * np.array([1.0, 1.0, 0.5, 0.25])
    said = _lag(Results.of(dataset), "midspan")
    fast = (known * [1.0, 1.0, 0.5, 0.25])[2:]
    assert said.endswith(f"and the lag is {1e3 * fast.min():.3g} mm to {1e3 * fast.max():.3g} mm.")
    lost = scenes.with_failures(dataset, 4)
    lost["lag"].loc[{"sensor": "midspan"}] = known * np.array([np.nan, 1.0, 1.0, 1.0])
    assert _lag(Results.of(lost), "midspan").endswith("in every variant with values.")
    dataset["lag"].loc[{"sensor": "midspan"}] = known
    assert _lag(Results.of(dataset), "midspan").endswith("in every variant.")
    assert KIND.findings(Results.of(dataset))


def test_titles_are_of_the_whole_sweep_whatever_is_drawn() -> None:
    """Lines are those of the mass with the largest odd part; another one trails more, and differs more from statics."""
    dataset = scenes.run("asymmetry", f"{scenes.pace('asymmetry', 0.2, 2.0)}\n{DAMPING}\n{MASS}")
    dataset["lag"].values[:], dataset["odd_rms"].values[:], dataset["even_excess"].values[:] = 1e-3, 0.02, 0.01
    here = {"pace": dataset["pace"][0], "damping_ratio": 0.05, "sensor": "midspan"}
    dataset["odd_rms"].loc[here | {"mass": 100.0}] = 0.03
    dataset["lag"].loc[here | {"mass": 50.0}] = -7e-3
    dataset["even_excess"].loc[here | {"mass": 50.0}] = 0.5
    figures = {figure.name: figure for figure in pictures(Results.of(dataset))}
    assert figures["lag"].title.endswith("trails by up to 7 mm or runs ahead by up to 1 mm")
    assert "Held at mass 100 kg" in figures["lag"].caption
    assert figures["odd-and-even"].title.endswith(
        "by up to 3 % of the static range, their mean from statics by up to 50 %"
    )
