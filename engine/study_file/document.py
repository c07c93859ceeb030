"""A study file as text and as plain data: TOML that is safe to look at, or a refusal that names the place."""

from __future__ import annotations

import codecs
import hashlib
import json
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from stat import S_ISREG
from typing import Any, NoReturn

import numpy as np

from engine.study_file.checks import NO_JERK, NO_LIMIT, NOT_MEANT, SIZES, is_meant
from engine.study_file.syntax_remedies import what_to_write
from results_schema.errors import BadInput, printable, shortened

#: Of a study's text, 160,000 samples of three numbers: 1.2 MB of such take 0.3 s to read, 20 MB 5 s, and 20 MB of what
#: is slowest to read 40 s.
MAX_BYTES = 10_000_000
MAX_DEPTH = 32
MAX_INTEGER = 2**63 - 1
FLOAT_DIGITS = 1000
INTEGER_DIGITS = 4300  # Python itself refuses to read decimal integers that are longer

# A key of a hundred parts or more. TOML allows it, the reader takes quadratic time and memory for it.
_LONG_KEY = re.compile(
    r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){100}""",
)
_AS_TEXT = "save it as UTF-8, as every editor can (Notepad: Save as, encoding UTF-8)"
_PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")


@dataclass(frozen=True)
class Source:
    """Where the data came from: the file's name as the user gave it ("" for keywords), its text and SHA-256.

    written_as: the tables that were written for others that were made of them, by their dotted keys.
    """

    name: str
    text: str
    sha256: str
    written_as: Mapping[str, str] = field(default_factory=dict)

    def where(self, key: str = "", line: int | None = None) -> str:
        """The place of a fault in words.

        >>> Source("bed.toml", "", "").where("body.bed.length", line=7)
        'bed.toml, line 7: body.bed.length'
        """
        place = ", ".join(part for part in (self.name, f"line {line}" if line else "") if part)
        return printable(": ".join(part for part in (place, self.written(key)) if part), 400)

    def written(self, key: str) -> str:
        """A dotted key as it was written: of a table that was made of another one, the key of that."""
        table = ".".join(key.split(".")[:2])
        return self.written_as.get(table, table) + key[len(table) :]

    def fault(self, key: str, what: str, *, expected: str = "", received: str = "", remedy: str = "") -> BadInput:
        """A refusal that names the file and the dotted key."""
        return BadInput(what, where=self.where(key), expected=expected, received=received, remedy=remedy)


@dataclass(frozen=True)
class Document:
    """Plain data (dict, list, str, bool, int within 64 bits, finite float, dates) with its source."""

    data: dict[str, Any]
    source: Source


class Beside:
    """What the program itself knows of a table, beside what a user wrote; no text gives one, and none is written."""


class _Unusable(str):
    """The text of a float that no study can mean; kept as text until the key is known."""


def read_document(path_or_text: str | Path) -> Document:
    """Read a TOML file, or TOML text if the argument is a string with a line break.

    Raises BadInput (faults 1, 4, 5) for a file that cannot be read, is larger than 10 MB or is not UTF-8, for TOML
    errors with their line, and with their key for numbers that are not finite, beyond 64 bits or of no size that a
    study may mean.
    """
    if isinstance(path_or_text, str) and "\n" in path_or_text:
        name, raw = "", path_or_text.encode("utf-8", "surrogatepass")
    else:
        name, raw = str(path_or_text), _file_bytes(path_or_text)
    raw = raw.removeprefix(codecs.BOM_UTF8)
    source = Source(name, _text(name, raw), hashlib.sha256(raw).hexdigest())
    return Document(_plain_table(_parsed(source), source), source)


def document_of(data: Mapping[str, Any], name: str = "") -> Document:
    """The document of data given from Python; its text is the data written as TOML.

    Numbers and arrays of numpy, xarray and pint become plain ones. Raises BadInput, also for a text of more than 10 MB,
    which could not be read again.

    >>> document_of({"gravity": 9.81, "body": {"bed": {"length": np.float64(15)}}}).source.text
    'gravity = 9.81\\n\\n[body.bed]\\nlength = 15.0\\n'
    """
    plain = _plain_table(data, Source(name, "", ""))
    text = write_document(plain)
    raw = text.encode("utf-8", "replace")
    _check_size(name, len(raw))
    return Document(plain, Source(name, text, hashlib.sha256(raw).hexdigest()))


def write_document(data: Mapping[str, Any]) -> str:
    """TOML text of plain data; reading it gives the same data."""
    blocks = [_block(header, table) for header, table in _tables("", data)]
    return "\n".join(block for block in blocks if block)


def _file_bytes(path: Any) -> bytes:
    from results_schema.store.files import SIGNATURE

    if not isinstance(path, str | Path):
        expected, remedy = "the path of a study file, or its text", "engine.Study(**tables) takes the tables of a dict"
        raise BadInput("this is no file", where="study", expected=expected, received=type(path).__name__, remedy=remedy)
    name = str(path)
    try:
        if not S_ISREG(Path(path).stat().st_mode):
            raise BadInput("this is not a file", where=name, expected="a study file (TOML)")
        with open(path, "rb") as file:
            raw = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or str(error)
        raise BadInput(f"the study file cannot be read: {reason}", where=printable(name, 200)) from None
    if raw.startswith(SIGNATURE):
        what, remedy = "this is an archive of results, not a study", f"xarray.open_dataset({shortened(name)})"
        raise BadInput(what, where=printable(name, 200), expected="a study file (TOML)", remedy=remedy)
    if len(raw) > MAX_BYTES:
        _check_size(name, Path(path).stat().st_size)
    return raw


def _check_size(name: str, size: int) -> None:
    """Refuse a text that nobody wants to wait for; name: of its file. Raises BadInput."""
    if size > MAX_BYTES:
        raise BadInput(
            "the study is too large",
            where=name or "study",
            expected=f"a text of at most {MAX_BYTES / 1e6:g} MB",
            received=f"{size / 1e6:.3g} MB",
            remedy="an axis as a range (count) or a sample of it (sobol) is short; or several studies of fewer values",
        )


def _text(name: str, raw: bytes) -> str:
    _check_size(name, len(raw))
    source = Source(name, "", "")
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" in raw[:2]:
        raise BadInput("this text is UTF-16", where=source.where(), expected="TOML in UTF-8", remedy=_AS_TEXT)
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise BadInput(
            "a character that is not UTF-8",
            where=source.where(line=line),
            expected="a study file: TOML in UTF-8",
            received=f"byte 0x{raw[error.start]:02x}",
            remedy=_AS_TEXT,
        ) from None


def _parsed(source: Source) -> dict[str, Any]:
    """The file's tables; numbers that no study can mean as `_Unusable`."""
    if not source.text.strip():
        remedy = "begin with a commented one: wanderlast init passage FILE.toml"
        raise BadInput("the file is empty", where=source.where(), expected="a study (TOML)", remedy=remedy)
    if long_key := _LONG_KEY.search(source.text):
        _refuse_nesting(source, source.text.count("\n", 0, long_key.start()) + 1)
    try:
        return _tables_of(source.text)
    except RecursionError:
        _refuse_nesting(source, None)
    except tomllib.TOMLDecodeError as error:
        place, complaint = _PLACE.search(str(error)), _PLACE.sub("", str(error))
        line = int(place[1]) if place and place[1] else source.text.count("\n") + 1
        written = source.text.split("\n")[line - 1]
        column = int(place[2]) if place and place[2] else len(written) + 1
        raise BadInput(
            f"not valid TOML: {complaint}",
            where=source.where(line=line),
            received=shortened(written.strip()),
            remedy=printable(what_to_write(source.text, line, column, complaint), 200),
        ) from None


def _refuse_nesting(source: Source, line: int | None) -> NoReturn:
    raise BadInput("nested too deeply", where=source.where(line=line), expected=f"at most {MAX_DEPTH} levels")


def _tables_of(text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text, parse_float=_float_or_text)
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # an integer that Python refuses to read: one beyond 64 bits stands in, and is refused by key
        shorter = re.sub(rf"\d[\d_]{{{INTEGER_DIGITS - 1},}}", "9" * 40, text)
        return tomllib.loads(shorter, parse_float=_float_or_text)


def _float_or_text(text: str) -> float | _Unusable:
    value = float(text)
    return value if is_meant(value) and len(text) <= FLOAT_DIGITS else _Unusable(text)


def _plain_table(data: Mapping[str, Any], source: Source) -> dict[str, Any]:
    return {key: _plain(value, (key,), source) for key, value in data.items() if value is not None}


def _plain(value: Any, keys: tuple[str, ...], source: Source) -> Any:
    """A copy made of Python's own types; BadInput with the dotted key for numbers that no study can mean.

    Keys with None, which only Python can give, are left out: they stand for the default.
    """
    if len(keys) > MAX_DEPTH:
        _refuse_nesting(source, None)
    if hasattr(value, "__array__") or hasattr(value, "to_base_units"):
        value = _from_other_packages(value)
    if isinstance(value, Mapping):
        return {key: _plain(item, (*keys, str(key)), source) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple | range):
        return [_plain(item, (*keys, str(index)), source) for index, item in enumerate(value)]
    if isinstance(value, _Unusable) or (isinstance(value, float) and not is_meant(value)):
        _refuse_number(value, f"a finite number, {SIZES}", keys, source)
    if isinstance(value, int) and not -MAX_INTEGER - 1 <= value <= MAX_INTEGER:
        _refuse_number(value, "an integer within 64 bits", keys, source)
    return value


def _from_other_packages(value: Any) -> Any:
    """Numbers of numpy, xarray or pandas as Python's own, quantities of pint as the texts that a user would write."""
    if not hasattr(value, "to_base_units"):
        return np.asarray(value).tolist()
    unit, numbers = f"{value.units:~D}".replace(" ** ", "**"), np.asarray(value.magnitude).tolist()
    return _with_unit(numbers, unit) if unit else numbers


def _with_unit(number: Any, unit: str) -> Any:
    return [_with_unit(item, unit) for item in number] if isinstance(number, list) else f"{number!r} {unit}"


def _refuse_number(value: str | float, expected: str, keys: Sequence[str], source: Source) -> NoReturn:
    token = re.escape(value[:FLOAT_DIGITS]) if isinstance(value, str) else r"\d[\d_]{18,}"
    found = [match.start() for match in re.finditer(rf"(?<![\w.]){token}(?![\w.])", source.text)]
    line = source.text.count("\n", 0, found[0]) + 1 if len(found) == 1 else None
    huge = isinstance(value, int) and value.bit_length() > 128
    received = printable(value, 60) if isinstance(value, str) else "more than 128 bits" if huge else str(value)
    where, remedy = source.where(".".join(keys), line), ""
    if received.lstrip("+") == "inf":
        remedy = NO_JERK if keys[-1] == "jerk" else NO_LIMIT if keys[0] == "sweep" else ""
    raise BadInput(NOT_MEANT, where=where, expected=expected, received=received, remedy=remedy)


def _tables(header: str, table: Mapping[str, Any]) -> Iterable[tuple[str, Mapping[str, Any]]]:
    yield header, table
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _tables(f"{header}.{_key(key)}" if header else _key(key), value)


def _block(header: str, table: Mapping[str, Any]) -> str:
    written = {key: value for key, value in table.items() if not isinstance(value, Mapping | Beside)}
    own = [f"{_key(key)} = {_literal(value)}\n" for key, value in written.items()]
    needed = own or not table  # an empty table is still a table
    return "".join([f"[{header}]\n" if header and needed else "", *own])


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _quoted(key)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _literal(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, list):
        return f"[{', '.join(_literal(item) for item in value)}]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_literal(item)}" for key, item in value.items()) + "}"
    return repr(value) if isinstance(value, int | float) else str(value)
