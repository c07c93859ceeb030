"""Text files of models, line by line: every line knows where it stands, and includes stay in the model's folder."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from results_schema.errors import BadInput, shortened

MAX_BYTES = 500_000_000
MAX_INCLUDES = 32  # within each other
_REAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD]?[+-]\d+|[eEdD]\d+)?")
_EXPONENT = re.compile(r"([\d.])([eEdD]?)([+-]?\d+)$")
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")
_ABSOLUTE = re.compile(r"[/\\~]|[A-Za-z]\w*:")


@dataclass(frozen=True)
class Line:
    """A line of a text file, with the file's path and its number from 1."""

    path: str
    number: int
    text: str

    def fault(self, what: str, *, card: str = "", expected: str = "", received: str = "") -> BadInput:
        """A refusal that names file, line and card."""
        where = ", ".join(part for part in (self.path, f"line {self.number}", card) if part)
        return BadInput(what, where=where, expected=expected, received=shortened(received) if received else "")


Includes = Callable[[Line, Iterator[Line]], str | None]


def no_such_file(path: str) -> BadInput:
    """What is raised where a path leads to no file."""
    remedy = "" if Path(path).is_absolute() else f"paths count from the working folder, which is {Path.cwd()}"
    return BadInput("no such file", where=path, expected="a file", remedy=remedy)


def file_bytes(path: str) -> bytes:
    """The bytes of a file. Raises BadInput where there is none, or it is empty or too large."""
    file = Path(path)
    try:
        if not file.is_file():
            raise no_such_file(path)
        size = file.stat().st_size
        if size > MAX_BYTES:
            raise BadInput("the file is too large", where=path, expected=f"at most {MAX_BYTES} bytes")
        found = file.read_bytes()
    except (OSError, ValueError) as error:
        raise BadInput("the file cannot be read", where=path, received=str(error)) from None
    if not found:
        raise BadInput("the file is empty", where=path)
    return found


def lines_of(path: str, raw: bytes) -> list[Line]:
    """The lines of a text. Raises BadInput for binary data and other encodings than UTF-8."""
    if b"\0" in raw:
        raise BadInput("this is a binary file", where=path, expected="text in UTF-8")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        number = raw.count(b"\n", 0, error.start) + 1
        raise BadInput("wrong encoding", where=f"{path}, line {number}", expected="text in UTF-8") from None
    found = [Line(path, number, line) for number, line in enumerate(re.split(r"\r\n|\r|\n", text), start=1)]
    for line in found:
        if _CONTROL.search(line.text):
            raise line.fault("this is a binary file", expected="text in UTF-8")
    if not any(line.text.strip() for line in found):
        raise BadInput("the file is empty", where=path)
    return found


def read_lines(path: str, includes: Includes | None = None) -> list[Line]:
    """All lines of a file, with those of included files in the place of their includes.

    includes: takes a line and those after it; the path that it includes, or None. Raises BadInput.
    """
    folder = Path(path).parent
    return _expanded(path, includes, folder, (str(Path(path).resolve()),))


def _expanded(path: str, includes: Includes | None, folder: Path, chain: tuple[str, ...]) -> list[Line]:
    found: list[Line] = []
    lines = iter(lines_of(path, file_bytes(path)))
    for line in lines:
        name = includes(line, lines) if includes else None
        if name is None:
            found.append(line)
            continue
        target = _inside(line, name, folder)
        resolved = str(target.resolve())
        if resolved in chain:
            raise line.fault("this file includes itself", received=name)
        if len(chain) > MAX_INCLUDES:
            raise line.fault("includes within includes", expected=f"at most {MAX_INCLUDES}")
        found += _expanded(str(target), includes, folder, (*chain, resolved))
    return found


def _inside(line: Line, name: str, folder: Path) -> Path:
    """The file that an include names. Raises BadInput where it leaves the model's folder."""
    parts = re.split(r"[/\\]", name)
    expected = "a file in the model's folder"
    if not name.strip() or _ABSOLUTE.match(name) or ".." in parts:
        raise line.fault("this include leaves the model's folder", expected=expected, received=name)
    target = folder.joinpath(*parts)
    if len(parts) == 1:  # beside the file that includes it
        target = Path(line.path).parent / name
    try:
        kept = target.resolve().is_relative_to(folder.resolve())
        there = target.is_file()
    except (OSError, ValueError, RuntimeError):
        kept, there = True, False
    if not kept:
        raise line.fault("this include leaves the model's folder", expected=expected, received=name)
    if not there:
        raise line.fault("there is no such file to include", expected=expected, received=name)
    return target


def written(path: Path, lines: list[Line]) -> str:
    """The path of a new file with these lines, includes in their places, for packages that read by themselves."""
    path.write_text("\n".join(line.text for line in lines) + "\n", encoding="utf-8")
    return str(path)


def read_paths(lines: list[Line]) -> list[str]:
    """The files that lines come from, included ones too."""
    return list(dict.fromkeys(line.path for line in lines))


def real(line: Line, text: str, *, card: str = "", noun: str = "a number") -> float:
    """A finite number as models write it: 1.5, 1.5E+3, 1.5D+3, 1.5+3. Raises BadInput.

    >>> real(Line("a", 1, ""), "-7.5-3")
    -0.0075
    """
    word = text.strip()
    if not _REAL.fullmatch(word):
        what = f"{noun} that is not finite" if re.match(r"[+-]?(nan|inf)", word.lower()) else f"{noun} is wanted here"
        raise line.fault(what, card=card, expected="a finite number", received=word or "nothing")
    found = float(_EXPONENT.sub(r"\1e\3", word) if re.search(r"[eEdD]|[\d.][+-]", word) else word)
    if not math.isfinite(found):
        raise line.fault(f"{noun} that is not finite", card=card, expected="a finite number", received=word)
    return found


def whole(line: Line, text: str, *, card: str = "", noun: str = "a node's number") -> int:
    """An integer above 0 within 18 digits. Raises BadInput."""
    word = text.strip()
    if not re.fullmatch(r"\+?\d{1,18}", word, re.ASCII) or int(word) == 0:
        raise line.fault(f"{noun} is wanted here", card=card, expected="an integer > 0", received=word or "nothing")
    return int(word)
