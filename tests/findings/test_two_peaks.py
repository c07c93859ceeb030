"""The pattern of a slow cycle, and where it breaks: two peaks of a bed's middle, one of the tip of an arm."""

import numpy as np
import pytest

import studies
from studies.findings.two_peaks import pattern
from studies.reporting.answers import answer
from studies.results.results import Results
from tests.engine.build import beam, fixed, mass, study, swing

RATES = [0.005, 0.01, 0.02]


@pytest.mark.parametrize(
    ("supports", "at", "reach", "usual", "words"),
    [("clamped-free", 1.0, 0.3, 1, "one peak"), ("pinned-pinned", 0.5, 0.45, 2, "two peaks")],
)
def test_the_pattern_is_that_of_the_slowest(supports: str, at: float, reach: float, usual: int, words: str) -> None:
    """A number of peaks of a faster variant beside it is where it breaks."""
    rates = {"rate": {"of": "carriage.car.motion.frequency", "values": RATES}}
    bed, tables = beam(supports=supports, damping_ratio=0.05), {"sensor": {"seen": fixed(at)}, "sweep": rates}
    found = studies.run(study(bed, mass(0.1, swing(0.5, reach, 0.01, 20)), kind="double-peak", **tables))
    assert pattern(Results.of(found), "seen") == usual
    counts = found.peaks_per_cycle.sel(sensor="seen")
    assert counts.values.tolist() == [usual] * len(RATES)
    broken = found.copy(deep=True)
    broken.peaks_per_cycle.loc[{"rate": RATES[-1]}] = 3
    first = answer(broken)[0]
    assert first.startswith(f"seen: {words} per cycle below 0.02 Hz") and "with 3 peaks" in first
    assert "whatever else" not in first and not any("up to 0.01 Hz" in sentence for sentence in answer(broken))
    broken.peaks_per_cycle.loc[{"rate": RATES[0]}] = np.nan
    assert pattern(Results.of(broken), "seen") == 2
