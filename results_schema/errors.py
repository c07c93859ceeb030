"""Every error a user can meet, each with the exit code of the command, and values as messages show them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path


class WanderlastError(Exception):
    """An error with one readable message; base of all others and exit code of a bug of our own.

    >>> print(BadInput("must be positive", where="body.bed.length", expected="> 0 m", received="-3"))
    body.bed.length: must be positive; expected > 0 m, received -3
    """

    exit_code = 1

    def __init__(self, what: str, *, where: str = "", expected: str = "", received: str = "", remedy: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.where = where
        self.expected = expected
        self.received = received
        self.remedy = remedy

    def __str__(self) -> str:
        found = ", ".join(
            f"{word} {value}" for word, value in (("expected", self.expected), ("received", self.received)) if value
        )
        message = f"{self.where}: {self.what}" if self.where else self.what
        remedy = f"remedy: {self.remedy}" if self.remedy else ""
        return "; ".join(part for part in (message, found, remedy) if part)


class Remark(UserWarning):
    """What is allowed in a study and yet often a mistake; Python tells it by `warnings`, the commands in a line."""


class BadInput(WanderlastError):
    """Bad input or usage: refused before anything is computed or written."""

    exit_code = 2

    def moved(self, where: str, what: str = "") -> BadInput:
        """The same refusal of another place, and in other words."""
        return BadInput(
            what or self.what, where=where, expected=self.expected, received=self.received, remedy=self.remedy
        )


class ArchiveError(WanderlastError):
    """An archive or a part of one that is damaged, foreign or of a newer schema."""

    exit_code = 4


class WorkersGaveUp(WanderlastError):
    """The workers could not go on; finished work is kept."""

    exit_code = 70


class OutputFailed(WanderlastError):
    """Writing failed (disk full, read-only); finished work is kept. Carries the path and the free bytes there."""

    exit_code = 74

    def __init__(
        self,
        what: str,
        *,
        path: Path | str = "",
        free_bytes: int | None = None,
        expected: str = "",
        received: str = "",
        remedy: str = "",
    ) -> None:
        super().__init__(what, where=str(path), expected=expected, received=received, remedy=remedy)
        self.path = path
        self.free_bytes = free_bytes

    def __str__(self) -> str:
        message = super().__str__()
        return message if self.free_bytes is None else f"{message}; {self.free_bytes} bytes free there"


class ArchiveBusy(WanderlastError):
    """Another run holds this archive."""

    exit_code = 75


class Interrupted(WanderlastError):
    """Stopped by a signal; finished work is kept."""

    exit_code = 130


def printable(text: str, limit: int) -> str:
    """Text on one line of bounded length; control characters, which a terminal would obey, as escapes."""
    text = text if len(text) <= limit else f"{text[: limit - 3]}..."
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A hint at the known name that is most like a word, or at what a mapping has of it; "" for none.

    >>> did_you_mean("lenght", ["length", "area"]), did_you_mean("crain", {"crane": "crane.nc"}), did_you_mean("a", [])
    ('did you mean "length"?', 'did you mean "crane.nc"?', '')
    """
    meant = known if isinstance(known, Mapping) else {name: name for name in known}
    near = get_close_matches(word[:100], list(meant), n=1)
    return f'did you mean "{meant[near[0]]}"?' if near else ""


def shortened(value: object, limit: int = 60) -> str:
    """A value as the user would have written it, on one line of bounded length."""
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list | tuple):
        text = f"[{', '.join(shortened(item) for item in value[:8])}{', ...' if len(value) > 8 else ''}]"
    else:
        text = str(value).lower() if isinstance(value, bool) else f'"{value}"' if isinstance(value, str) else str(value)
    return printable(text, limit)
