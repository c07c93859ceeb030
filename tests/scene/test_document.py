"""Faults 1, 4 and 5: files that are no study files, and numbers that no study can mean."""

import hashlib
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.scene.study import load
from engine.study_file.document import MAX_BYTES, document_of, read_document, write_document
from results_schema.errors import BadInput
from tests.scene.sample import MINIMAL, SAMPLE


def refused(text: str | Path) -> str:
    with pytest.raises(BadInput) as error:
        load(text)
    assert error.value.exit_code == 2
    return str(error.value)


@pytest.mark.fault(1, 5)
@pytest.mark.parametrize(
    ("raw", "words"),
    [
        ("kind = 'a'\n".encode("utf-16"), ["UTF-16", "save it as UTF-8"]),
        (b"kind = 'a'\ntitle = '\xff'\n", ["line 2", "0xff"]),
        (b"kind = 'a'\n\0\n", ["line 2"]),
        (bytes(range(256)), ["UTF-8"]),
        (b"", ["empty"]),
        (b"kind = 'a'\nkind = 'b'\n", ["line 2", "Cannot overwrite"]),
        (b"[body.a]\n[body.b]\n[body.a]\n", ["line 3", "twice"]),
        (b"a = 1\nb =\n", ["line 2", "Invalid value"]),
        (b"a = 'x", ["line 1", "Expected"]),
    ],
)
def test_files(tmp_path: Path, raw: bytes, words: list[str]) -> None:
    file = tmp_path / "study.toml"
    file.write_bytes(raw)
    message = refused(file)
    assert "study.toml" in message
    assert all(word in message for word in words), message


@pytest.mark.fault(5)
def test_sizes(tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    with file.open("wb") as place:
        place.truncate(MAX_BYTES + 1)
    message = refused(file)
    assert all(word in message for word in ("study.toml", "at most 10 MB", "received 10 MB", "sobol")), message
    assert "at most 10 MB" in refused("#\n" * (MAX_BYTES // 2 + 1))
    with pytest.raises(BadInput, match="study: the study is too large"):  # from Python, before anything is run
        document_of({"values": np.random.default_rng(1).uniform(0.1, 0.2, 600_000)})


def test_what_is_no_file(tmp_path: Path) -> None:
    assert "No such file" in refused(tmp_path / "none.toml")
    assert "not a file" in refused(tmp_path)
    assert "null" in refused("a\0b")


@pytest.mark.fault(4, 45)
@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("nan", ["finite", "received nan"]),
        ("-inf", ["finite", "received -inf"]),
        ("1e400", ["finite", "received 1e400"]),
        ("-1E+400", ["finite", "received -1E+400"]),
        ("9223372036854775808", ["64 bits", "9223372036854775808"]),
        ("0x" + "f" * 5000, ["64 bits"]),
        ("1" * 5000, ["64 bits"]),
        ("1." + "1" * 5000, ["finite"]),
        ("1_" * 4000 + "1", ["64 bits"]),
        ("[1.0, [2.0, nan]]", ["length.1.1"]),
        ("{ a = inf }", ["length.a"]),
        ("1e31", ["0 or of a size from 1e-50 to 1e+30", "received 1e31"]),
        ("-5e-324", ["of a size", "received -5e-324"]),
        ('"1e28 km"', ["of a size", '"1e28 km"']),
    ],
)
@pytest.mark.parametrize("sample", [SAMPLE, MINIMAL])
def test_numbers(sample: str, value: str, words: list[str]) -> None:
    message = refused(sample.replace("length = 15.0", f"length = {value}"))
    assert "body.bed.length" in message
    assert all(word in message for word in words), message
    assert len(message) < 500


def test_line_of_a_number() -> None:
    line = SAMPLE.split("\n").index("length = 15.0") + 1
    assert f"line {line}: body.bed.length" in refused(SAMPLE.replace("length = 15.0", "length = 1e999"))


@pytest.mark.fault(5)
@pytest.mark.parametrize(
    "text",
    [
        "x = " + "[" * 3000 + "]" * 3000 + "\n",
        "x = " + "{a = " * 3000 + "1" + "}" * 3000 + "\n",
        ".".join("a" * 3000) + " = 1\n",
        "[" + ".".join("a" * 3000) + "]\n",
        'x = {"a"' + ' . "a"' * 3000 + " = 1}\n",
        "a." * 400_000 + "b = 1\n",
        "[" * 900_000 + "\n",
        "".join(f"[{'a.' * 40}b{i}]\n" for i in range(3000)),
    ],
)
def test_nesting(text: str) -> None:
    assert "nested" in refused(text) or "[" * 900_000 in text


def test_text_is_kept() -> None:
    document = read_document(SAMPLE)
    assert document.source.text == SAMPLE
    assert document.source.sha256 == hashlib.sha256(SAMPLE.encode()).hexdigest()
    assert document.data == tomllib.loads(SAMPLE)


@pytest.mark.fault(1)
def test_a_byte_order_mark_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "marked.toml").write_bytes(b"\xef\xbb\xbf" + SAMPLE.encode())
    assert read_document(tmp_path / "marked.toml").source.sha256 == hashlib.sha256(SAMPLE.encode()).hexdigest()


def test_messages_hold_no_control_characters() -> None:
    message = refused('schema_version = 1\n"\\u001b[31mred\\n" = "\\u001b"\n')
    assert message.isprintable()


def test_numpy_becomes_plain() -> None:
    data = {"a": np.float32(0.5), "b": np.array([[1, 2], [3, 4]]), "c": (np.int8(3), None), "d": None, "e": np.True_}
    plain = document_of({key: value for key, value in data.items() if key != "c"}).data
    assert plain == {"a": 0.5, "b": [[1, 2], [3, 4]], "e": True}
    assert [type(value) for value in plain.values()] == [float, list, bool]
    with pytest.raises(BadInput, match=r"a\.1"):
        document_of({"a": np.array([1.0, np.nan])})


scalars = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
)
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text("ab. \"'é\n", max_size=5), inner, max_size=4),
    max_leaves=12,
)


@given(st.dictionaries(st.text("abc-_ .", max_size=6), values, max_size=4))
@settings(max_examples=150, deadline=None)
def test_written_data_read_back(data: dict[str, Any]) -> None:
    assert tomllib.loads(write_document(data)) == data


# text of a study file with one slip -> line that the refusal names, remedy
SLIPS = {
    'supports = [\n  { at = 0, k = "1 N/m" }\n  # right\n  { at = 40, k = "1 N/m" },\n]\n': (
        4,
        "a comma is missing at the end of the line before, line 2",
    ),
    "a = [\n1,\n2\n3\n]\n": (4, "a comma is missing at the end of the line before, line 3"),
    "a = [{ b = 1 } { b = 2 }]\n": (1, "a comma is missing before { b = 2 }]"),
    "a = { b = 1 c = 2 }\n": (1, "a comma is missing before c = 2 }"),
    "a = [1, 2\nb = 3\n": (2, "a ] is missing: a list ends with it"),
    "a = [{ b = 1 },\n{ b = 2 }\n\n[body.x]\nb = 1\n": (4, "a ] is missing: a list ends with it"),
    "a = { b = 1, c = 2\nd = 3\n": (1, "what begins with { ends with } in the same line"),
    "a = [\n  { b = 1, c = 2,\n]\n": (2, "what begins with { ends with } in the same line"),
    "a = { b = 1, }\n": (1, "no comma before the }"),
    "a = [\n  { b: 1 },\n]\n": (2, "= instead of the colon"),
    'a = "1 m\nb = 3\n': (1, "a quotation mark is missing"),
    'a = ["1 m, "2 m"]\n': (1, "a quotation mark is missing"),
    "a = '1 m\nb = 3\n": (3, "a quotation mark is missing in line 1"),
    'a = 1 m"\n': (1, 'quotation marks around a number with a unit: "1 m"'),
    "a = [1 m, 2 m]\n": (1, 'quotation marks around a number with a unit: "1 m"'),
    "a = 2 %\n": (1, 'quotation marks around a number with a unit: "2 %"'),
    "a = { of = carriage.car.mass, values = [1] }\n": (1, 'quotation marks around a word: "carriage.car.mass"'),
    "length 15\n": (1, "an equals sign between key and value"),
    "youngs modulus = 1\n": (1, "a key without spaces, such as second_moment"),
    "a = { b = 1, b = 2 }\n": (1, "this key stands twice between the same braces: keep one of the two"),
    "a = 1\n[a.b]\nc = 1\n": (2, "what has a value further up cannot be the header of a table as well"),
    "[a]\nb = 1\n[a]\nc = 1\n": (3, "this table is there already, further up: put its keys together"),
    "[body.beam\nb = 3\n": (1, "a ] is missing at the end of the header"),
    "body.beam]\nb = 3\n": (1, "a [ is missing before the header"),
    "[body.my beam]\nb = 3\n": (1, "a name without spaces, such as main_beam"),
    "[[sensor.x]\nb = 3\n": (1, "one [ before and one ] behind the header"),
    "a = [1, 2]]\n": (1, "there is a ] too many"),
    "a = 1;\n": (1, "no ; at the end of the line"),
    "a = 1 b = 3\n": (1, "each key on a line of its own"),
    "a = 1 the length\n": (1, "a comment begins with #"),
    "a = (1, 2)\n": (1, "a list stands in square brackets: [1, 2]"),
    "a = .5\n": (1, "a digit before the decimal point: 0."),
    "a = 5.\n": (1, "a digit after the decimal point: .0"),
}


@pytest.mark.fault(1)
@pytest.mark.parametrize("text", SLIPS)
def test_what_to_write_instead(text: str) -> None:
    line, remedy = SLIPS[text]
    with pytest.raises(BadInput) as refused:
        read_document(text)
    assert (refused.value.where, refused.value.remedy) == (f"line {line}", remedy)
