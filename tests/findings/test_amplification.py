"""Errors of what a study derives from other results."""

import numpy as np
import pytest
import xarray as xr

from studies.findings.amplification import with_derived_errors
from tests.studies import scenes


@pytest.mark.parametrize("kind", ["passage", "double-peak"])
@pytest.mark.parametrize("swept", [True, False])
def test_the_error_of_an_amplification_is_the_larger_of_both_extremes(kind: str, swept: bool) -> None:
    found = scenes.run(kind, scenes.pace(kind) if swept else "")
    for sensor in ("midspan", "moment"):
        own = found.estimated_error.sel(result=f"dynamic_amplification {sensor}")
        ends = [found.estimated_error.sel(result=f"{sensor}_{end}").values for end in ("max", "min")]
        np.testing.assert_array_equal(own.values, np.maximum(*ends))
        assert np.isfinite(own.values).all() and own.dims == found.status.dims
        assert float(found.tolerance.sel(result=f"dynamic_amplification {sensor}")) == 1e-3
    assert found.estimated_error.dtype == np.float32 and found.estimated_error.dims[-1] == "result"
    assert found.result.attrs["long_name"] == "reported number"


def test_an_error_that_is_not_known_stays_so() -> None:
    given = xr.Dataset(
        {
            "estimated_error": (("speed", "result"), np.float32([[1e-3, np.nan], [2e-3, 1e-3]])),
            "tolerance": ("result", [1e-2, 1e-2]),
        },
        coords={"result": ["a", "b"]},
    )
    found = with_derived_errors(given, {"a over b": ("a", "b")})
    np.testing.assert_array_equal(found.estimated_error.sel(result="a over b"), np.float32([np.nan, 2e-3]))
    xr.testing.assert_identical(found.sel(result=["a", "b"]), given)
