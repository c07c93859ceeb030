"""What is left of the start in the last cycle, of motions to and fro."""

import numpy as np
import pytest

import studies
from studies.findings import theory
from studies.findings.settled import told_unsettled
from studies.results.formatting import percent
from studies.results.results import Results
from tests.engine.build import Table, beam, fixed, mass, shuttle, study, swing

OMEGA = np.pi**2  # of the pinned beam of the tests
ZETA = 0.02


def results_of(motion: Table) -> Results:
    given = study(beam(damping_ratio=ZETA), mass(0.1, motion), kind="double-peak", sensor={"midspan": fixed(0.5)})
    return Results.of(studies.run(given))


@pytest.mark.parametrize(
    ("motion", "time"),
    [
        (swing(0.5, 0.2, 0.25, 3), 4.0),
        (shuttle(0.2, 0.8, 0.3, 0.0, 3), 4.0),
        (shuttle(0.2, 0.8, 0.3, 0.1, 3), 4.0 * (1.0 + 0.1 * (np.pi - 2.0))),
    ],
)
def test_it_dies_out_by_the_damping_of_the_first_mode(motion: Table, time: float) -> None:
    """Over the cycles before the last one."""
    left = theory.remainder_of_start(results_of(motion))
    np.testing.assert_allclose(left, np.exp(-ZETA * OMEGA * 2.0 * time), rtol=1e-6)


def test_double_peaks_say_what_the_start_still_holds_and_how_many_cycles_it_takes() -> None:
    (told,) = told_unsettled(results_of(swing(0.5, 0.2, 0.5, 3)))
    enough = int(np.ceil(1.0 - np.log(1e-3) / (ZETA * OMEGA * 2.0)))
    assert told.startswith("In 1 of 1 variant more than 0.1 % of the start is left") and f"; {enough} cycles" in told
    assert f"at most {percent(float(np.exp(-ZETA * OMEGA * 4.0)))} of it" in told
    assert told_unsettled(results_of(swing(0.5, 0.2, 0.5, enough))) == []
