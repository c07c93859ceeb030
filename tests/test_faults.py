"""Every fault of docs/faults.md has a test that says so."""

from tests import faults

NUMBERS = [number for section in faults.FAULTS.values() for number in section]


def test_they_are_numbered() -> None:
    assert list(range(1, 51)) == NUMBERS


def test_every_fault_has_a_test() -> None:
    found = faults.covered()
    assert set(found) == set(NUMBERS)


def test_the_page_is_made_from_the_tests() -> None:
    assert faults.PAGE.read_text(encoding="utf-8") == faults.page(), "run: python -m tests.faults"
