"""The figure of what an audit observed."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import xarray as xr

from studies.pictures.common import estimates
from studies.results.axes import Axis
from studies.results.results import Results

NAN = np.nan


def group() -> xr.Dataset:
    """Three variants with three results, the last of which is only told."""
    observed = [[1e-4, 2e-4, 0.5], [4e-4, NAN, 0.5], [NAN, NAN, 0.5]]
    estimated = [[1e-3, 5e-4, 0.7], [8e-4, 5e-4, 0.7], [NAN, NAN, NAN]]
    return xr.Dataset(
        {
            "observed_error": (("sample", "result"), np.array(observed)),
            "estimated_error": (("sample", "result"), np.array(estimated)),
            "tolerance": ("result", np.array([1e-3, 2e-3, NAN])),
            "tolerance_asked": ("sample", np.array([1.0, 0.5, 1.0])),
        },
        coords={"sample": np.arange(3), "speed": ("sample", np.array([3.0, 1.0, 2.0]))},
    )


def drawn(given: xr.Dataset) -> list[Any]:
    speed = Axis("speed", "speed", {"carriage.car.motion.speed": 1}, np.array([1.0, 2.0, 3.0]), "m s-1")
    return estimates.observed(cast(Results, SimpleNamespace(axis=lambda *_: speed, axes=(speed,))), given)


def test_every_variant_has_its_worst_error_over_the_tolerance_of_what_is_held() -> None:
    (figure,) = drawn(group())
    (axes,) = figure.drawing.axes
    lines = {line.get_label(): line for line in axes.get_lines()}
    assert set(lines) == {"tolerance", "observed", "estimated"}
    np.testing.assert_array_equal(lines["tolerance"].get_ydata(), 1.0)
    np.testing.assert_array_equal(lines["observed"].get_xdata(), [3.0, 1.0, 2.0])
    np.testing.assert_allclose(lines["observed"].get_ydata(), [0.1, 0.8, NAN])
    np.testing.assert_allclose(lines["estimated"].get_ydata(), [1.0, 1.6, NAN])


def test_nothing_is_drawn_where_nothing_is_held() -> None:
    told = group()
    told["tolerance"][:] = NAN
    assert drawn(told) == []


def test_a_single_variant_is_no_figure() -> None:
    assert drawn(group().isel(sample=[0])) == []
