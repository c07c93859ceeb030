import pickle

import pytest

from results_schema import errors
from results_schema.errors import BadInput, OutputFailed, WanderlastError

CODES = {
    "WanderlastError": 1,
    "BadInput": 2,
    "ArchiveError": 4,
    "WorkersGaveUp": 70,
    "OutputFailed": 74,
    "ArchiveBusy": 75,
    "Interrupted": 130,
}


def test_every_error_has_its_exit_code():
    classes = [
        value
        for value in vars(errors).values()
        if isinstance(value, type) and issubclass(value, errors.WanderlastError)
    ]
    found = {one.__name__: one.exit_code for one in classes}
    assert found == CODES


def test_the_message_names_place_expected_received_and_remedy():
    error = BadInput(
        "must be positive",
        where="study.toml: body.bed.length",
        expected="> 0 m",
        received="-3",
        remedy="give a length",
    )
    assert str(error) == (
        "study.toml: body.bed.length: must be positive; expected > 0 m, received -3; remedy: give a length"
    )
    assert (error.where, error.expected, error.received) == ("study.toml: body.bed.length", "> 0 m", "-3")


def test_a_bare_message_has_no_empty_clauses():
    assert str(BadInput("unknown kind")) == "unknown kind"
    assert str(BadInput("unknown kind", received="x")) == "unknown kind; received x"


@pytest.mark.parametrize(
    "error", [BadInput("a", where="b", remedy="c"), OutputFailed("full", path="x/y.nc", free_bytes=12)]
)
def test_errors_travel_between_processes(error: WanderlastError):
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert str(copy) == str(error)
    assert vars(copy) == vars(error)


def test_a_failed_output_tells_path_and_free_bytes():
    assert str(OutputFailed("full", path="x/y.nc", free_bytes=12)) == "x/y.nc: full; 12 bytes free there"
