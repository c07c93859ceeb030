"""What floats free keeps its momentum, and the answer says by how much the steps miss that."""

import numpy as np

import studies
from studies.reporting.answers import answer
from studies.results.formatting import quantity
from tests.floating.studies.scenes import driven


def test_of_what_floats_it_is_told_how_far_momentum_drifts() -> None:
    """By the histories; nothing where gravity acts, or a joint holds the body."""
    free = {"kind": "free", "velocity": [0.1, 0.0, 0.02], "rate": [0.0, 0.2, 0.0]}
    given = driven(arm={"supports": "free-free"}, joints=[free])
    found = studies.run(given)
    (said,) = (text for text in answer(found) if text.startswith("Nothing outside acts on these bodies"))
    for name, units in (("momentum", "kg m/s"), ("angular_momentum", "kg m2/s")):
        values = found[name].values
        drift, most = float(np.abs(values - values[0]).max()), float(np.abs(values).max())
        assert 0.0 < drift < 1e-3 * most
        assert f"by up to {quantity(drift, units)} of {quantity(most, units)}" in said
    falls = given.with_values({"gravity": 9.81})
    assert not any("Nothing outside" in text for one in (driven(), falls) for text in answer(studies.run(one)))
