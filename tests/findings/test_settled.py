"""What is left of the start in the last cycle, of motions to and fro."""

import numpy as np
import pytest

import studies
from studies.findings.settled import remainder_of_start, told_unsettled
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
    """Over the cycles before the last one; the mass, a tenth of the beam's, makes it slower, the most at midspan."""
    left = remainder_of_start(results_of(motion))
    np.testing.assert_allclose(left, np.exp(-ZETA * OMEGA / (1.0 + 0.1 * 2.0) * 2.0 * time), rtol=1e-4)


ELASTIC = [{"at": at, "stiffness": 300.0, "damping": damping} for at, damping in ((0.0, 4.0), (1.0, 4.0))]
LOCKED = [{"at": at, "stiffness": 300.0, "damping": damping} for at, damping in ((0.0, 4e3), (1.0, 4e3))]


@pytest.mark.parametrize(
    ("bed", "kilograms", "least"),
    [
        (beam(damping_ratio=0.03), 1.0, 0.6),
        (beam(damping_ratio=0.01, supports=ELASTIC), 0.3, 0.6),
        (beam(damping_ratio=0.05, supports=LOCKED), 0.3, 0.2),  # these creep by little, and slowly
    ],
    ids=["a heavy mass", "dampers", "dampers that hold their place"],
)
def test_what_is_said_to_be_left_is_no_less_than_what_is(bed: Table, kilograms: float, least: float) -> None:
    """By the histories of last cycles beside those of many: the mass at its worst place tells a little too much."""

    def last(cycles: int) -> Results:
        motion = swing(0.5, 0.2, 0.31, cycles)
        tables = {"kind": "double-peak", "output": {"histories": "all"}, "initial": "rest"}
        tables["solver"] = {"steps": 3200, "tolerance": 0.5}
        return Results.of(studies.run(study(bed, mass(kilograms, motion), **tables)))

    (two, three, settled) = (last(cycles) for cycles in (2, 3, 60))
    rows = [np.asarray(found.dataset["midspan"]) for found in (two, three, settled)]
    apart = [np.sqrt(np.mean((row - rows[-1]) ** 2)) for row in rows[:2]]
    told = np.log(remainder_of_start(two) / remainder_of_start(three))
    assert least < float(told) / np.log(apart[0] / apart[1]) < 1.05


def test_double_peaks_say_what_the_start_still_holds_and_how_many_cycles_it_takes() -> None:
    rate = ZETA * OMEGA / 1.2
    (told,) = told_unsettled(results_of(swing(0.5, 0.2, 0.5, 3)))
    enough = int(np.ceil(1.0 - np.log(1e-3) / (rate * 2.0)))
    assert told.startswith("In 1 of 1 variant more than 0.1 % of the start's vibration is left")
    assert f"; {enough} cycles" in told
    assert f"at most {percent(float(np.exp(-rate * 4.0)))} of it" in told
    assert told_unsettled(results_of(swing(0.5, 0.2, 0.5, enough))) == []


def test_the_cycles_that_would_be_enough_are_those_of_the_variant_that_needs_most() -> None:
    """By its own cycles: those of another one, with more of them, would say four times as many."""
    numbers = {"of": "carriage.car.motion.cycles", "values": [3, 12]}
    tables = {"kind": "double-peak", "sensor": {"midspan": fixed(0.5)}, "sweep": {"cycles": numbers}}
    given = study(beam(damping_ratio=ZETA), mass(0.1, swing(0.5, 0.2, 0.5, 3)), **tables)
    (told,) = told_unsettled(Results.of(studies.run(given)))
    enough = int(np.ceil(1.0 - np.log(1e-3) / (ZETA * OMEGA / 1.2 * 2.0)))
    assert told.startswith("In 2 of 2 variants") and f"; {enough} cycles would be enough" in told
