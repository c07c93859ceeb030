"""What few pilots tell of errors that nothing else is measured of."""

import numpy as np
import pytest

from engine.accuracy.few_pilots import MOST, FewPilots

PLACES = np.linspace(0.0, 1.0, 16)


def told(pilots: FewPilots, *places: float) -> np.ndarray:
    return pilots.told({"mass": np.array(places)}, len(places))


def test_the_nearest_tell_what_is_near() -> None:
    """Of an error that rises by a factor of 1,000 over a sweep; no less than the true one, and not the largest."""
    pilots = FewPilots({"mass": PLACES}, 1000.0 ** PLACES[None])
    where = np.linspace(0.03, 0.97, 20)
    found = told(pilots, *where)[0]
    assert np.all(found >= 1000.0**where)
    assert np.all(found[:10] < 30.0 * 1000.0 ** where[:10])
    assert np.all(found <= MOST * 1000.0)


def test_what_neighbours_tell_too_little_of_grows_for_all() -> None:
    """One of the pilots is off by ten times as much as those around it: so may others be, up to half more than it."""
    error = np.ones((2, 16))
    error[0, 7] = 10.0
    found = told(FewPilots({"mass": PLACES}, error), 0.1, 0.9)
    assert np.all(found[0] > 1.2)
    assert np.all(found[0] <= 10.0 * MOST)
    assert found[1] == pytest.approx(MOST)


def test_what_is_a_pilot_has_its_own_error() -> None:
    """Where one swept number decides whether what is fixed matters, its neighbours tell a thousand times too much."""
    error = np.array([[1e-5, 1e-2, 1e-5], [np.nan, 1.0, 1.0]])
    found = told(FewPilots({"mass": np.array([-0.4, 0.0, 0.4])}, error), -0.4, 0.0, 0.4, 0.1)
    assert found[0, :3] == pytest.approx(error[0])
    assert found[0, 3] >= 1e-2
    assert found[1, 0] >= 1.0


def test_pilots_without_an_estimate_say_nothing() -> None:
    error = np.array([[1.0, np.nan, 3.0], [np.nan] * 3, [0.0] * 3])
    found = told(FewPilots({"mass": np.array([1.0, 2.0, 3.0])}, error), 1.1, 2.9)
    assert np.all(found[0] >= 3.0)
    assert np.isnan(found[1]).all()
    assert not found[2].any()


def test_a_pilot_alone_tells_its_own_error() -> None:
    assert FewPilots({}, np.array([[0.3]])).told({}, 2) == pytest.approx(0.3)
