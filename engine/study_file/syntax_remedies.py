"""What to write instead of a line of a study file of which the reader of TOML complains."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_NUMBER = r"[+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?"
_LINES = "TOML has lines key = value below headers such as [body.bed]"
_NOT_JSON = f"this looks like JSON or Python; {_LINES}"
_QUOTED = "quotation marks around a number with a unit"
_QUOTED_WORD = 'quotation marks around a word: "{0}"'
_MISSING_QUOTE = "a quotation mark is missing"
_OPEN_QUOTE = re.compile(r"^[^'#\"]*'[^']*$")
_CALCULATES = "write the result: a study file does not calculate"
_OPEN_LIST = "a ] is missing: a list ends with it"
_OPEN_TABLE = "what begins with {{ ends with }} in the same line"
_LONG_TABLE = _OPEN_TABLE + "; a longer table has a header of its own, such as [carriage.NAME.motion]"
_ENTRY = r"""(?:[{"']|[+-]?\.?\d|\[(?![\w.-]+\]\s*(?:#|$))).*"""
_KEY = r"[\w.-]+\s*="

# Complaint, the line up to the place that it is of, what begins there -> remedy, with the groups of both.
_AT_PLACE = tuple(
    (complaint, re.compile(before), re.compile(rest), remedy)
    for complaint, before, rest, remedy in (
        ("Unclosed", rf"({_NUMBER})\s*$", r"([^\W\d][^\s,\]}]*|[%°])\s*(?:[,\]}]|$)", f'{_QUOTED}: "{{0}} {{1}}"'),
        ("Unclosed", r"[\d)]\s*$", r"[*/+^-].*$", _CALCULATES),
        (
            "Unclosed array",
            r"^\s*$",
            rf"{_ENTRY}$",
            "a comma is missing at the end of the line before, line {previous}",
        ),
        ("Unclosed array", r"\S\s*$", rf"{_ENTRY}$", "a comma is missing before {rest}"),
        ("Unclosed array", r"", rf"(?:$|{_KEY}|\[)", _OPEN_LIST),
        ("Unclosed inline table", r"", rf"{_KEY}", "a comma is missing before {rest}"),
        ("Unclosed inline table", r"", r"(?:#.*|\].*)?$", _OPEN_TABLE),
        ("Invalid initial character", r"[{,]\s*$", r"\}", "no comma before the }}"),
        ("Invalid initial character", r"=.*,\s*$", r"(?:#.*)?$", _OPEN_TABLE),
        ("Invalid initial character", r"=\s*\{\s*$", r"(?:#.*)?$", _LONG_TABLE),
        ("Expected '=' after", r"[{,]\s*[\w.\"'-]+\s*$", r":", "= instead of the colon"),
        ("Expected '=' after", r"^[^\[]*$", r"\]\s*$", "a [ is missing before the header"),
        ("Expected '=' after", r"^[\w ]+$", r"[\w ]+=", "a key without spaces, such as second_moment"),
        ("Expected '=' after", r"", r"[^:=]*$", "an equals sign between key and value"),
        ("Expected ']' at the end", r"", r"(?:#.*)?$", "a ] is missing at the end of the header"),
        ("Expected ']' at the end", r"", r"\w", "a name without spaces, such as main_beam"),
        ("Expected ']]' at the end", r"", r"", "one [ before and one ] behind the header"),
        ("Expected newline", r"", r"[\]}]", "there is a {first} too many"),
        ("Expected newline", r"", r"[,;]\s*(?:#.*)?$", "no {first} at the end of the line"),
        ("Expected newline", r"", rf"{_KEY}", "each key on a line of its own"),
        ("Expected newline", r"=\s*[+-]?\d+$", r"\.\s*$", "a digit after the decimal point: .0"),
        ("Expected newline", r"=\s*[+-]?0$", r"\d", "the number without 0 before it"),
        ("Expected newline", rf"=\s*{_NUMBER}\s+$", r"[^\W\d]\S*\s+\S", "a comment begins with #"),
        ("Invalid value", r"", r"[+-]?\.\d", "a digit before the decimal point: 0."),
        ("Invalid value", r"", r"\(", "a list stands in square brackets: [1, 2]"),
        ("Invalid value", r"", r"(?!True|False)([^\W\d][\w.-]*)\s*[,\]}]", _QUOTED_WORD),
        ("Invalid value", r"=\s*$", r"(?!True|False)([^\W\d][\w-]*)\s*(?:#.*)?$", _QUOTED_WORD),
        ("Invalid value", r"", r",", "a value before this comma"),
        ("Duplicate inline table key", r"", r"", "this key stands twice between the same braces: keep one of the two"),
        ("Unescaped", r"", r"", r"straight single quotation marks around text with \: 'C:\data'"),
        (
            "Cannot overwrite a value",
            r"^\[",
            r"",
            "what has a value further up cannot be the header of a table as well",
        ),
        ("Cannot overwrite a value", r"", r"", "this key stands further up in the same table: keep one of the two"),
        ("Cannot declare", r"", r"", "this table is there already, further up: put its keys together"),
    )
)
# Characters that no line has where a number, a word or a list stands as it should: looked at first.
_CHARACTERS = tuple(
    (re.compile(pattern), remedy)
    for pattern, remedy in (
        (r"[\u201c-\u201f\u00ab\u00bb\u2018\u2019]", 'straight quotation marks: "..."'),
        (r"[^\S \t]|[\u200b\ufeff]", "type the spaces of this line again: one of them is another character"),
        (r"""^[^"'#]*\s//""", "a comment begins with #"),
        (rf"""=\s*({_NUMBER})\s*([^\W\d][^\s"']*|[%°])["']?\s*$""", rf'{_QUOTED}: "\1 \2"'),
        (r'^[^"#]*"[^"]*(?:"[^"]*"[^"]*)*$', _MISSING_QUOTE),
        (_OPEN_QUOTE, _MISSING_QUOTE),
    )
)
_IN_LINE = tuple(
    (re.compile(pattern), remedy)
    for pattern, remedy in (
        (r"""^[{\[]?\s*(?:\{|"[^"]*"\s*:)|=\s*(?:dict\(|\{\s*["']\w+["']\s*:)""", _NOT_JSON),
        (r"^[\w.-]+\s*:", "an equals sign; " + _LINES),
        (r"=\s*True\b|[\[,]\s*True\s*[,\]]", "in small letters: true"),
        (r"=\s*False\b|[\[,]\s*False\s*[,\]]", "in small letters: false"),
        (r"=\s*(?:None|null|nil)\b", "leave the key out where it has no value"),
        (r"=\s*$", 'a value after the "="'),
        (rf"=\s*({_NUMBER}),(\d+)\s*([^\W\d].*)$", rf'a decimal point, and {_QUOTED}: "\1.\2 \3"'),
        (r"=\s*([+-]?\d+),(\d{3})\s*$", r"a number without a comma: \1\2, or \1.\2 if a decimal point was meant"),
        (r"=\s*([+-]?\d+),(\d+)\s*$", r"a decimal point: \1.\2"),
        (rf"=\s*{_NUMBER}\s*[*/+^-]|=\s*\w+\(", _CALCULATES),
        (r"=\s*[^\W\d]\w*\s*$", "quotation marks around a word"),
    )
)  # fmt: skip


def what_to_write(text: str, line: int, column: int, complaint: str) -> str:
    """A remedy for the place in a study file's text of which the reader of TOML complains, or "".

    >>> what_to_write("length = 25,5 m", 1, 12, "Expected newline or end of document after a statement")
    'a decimal point, and quotation marks around a number with a unit: "25.5 m"'
    """
    lines = text.split("\n")
    written = lines[line - 1]
    before, rest = written[: column - 1], written[column - 1 :].strip()
    if complaint == 'Expected "\'"':  # looked for up to the end of the text
        opened = next((number for number, one in enumerate(lines, 1) if _OPEN_QUOTE.search(one)), line)
        return f"{_MISSING_QUOTE} in line {opened}"
    return (
        _in_line(_CHARACTERS, written)
        or _at_place(lines[: line - 1], before, rest, complaint)
        or _in_line(_IN_LINE, written)
    )


def _in_line(table: Iterable[tuple[re.Pattern[str], str]], written: str) -> str:
    found = ((pattern.search(written.strip()), remedy) for pattern, remedy in table)
    return next((match.expand(remedy) for match, remedy in found if match), "")


def _at_place(above: Sequence[str], before: str, rest: str, complaint: str) -> str:
    for words, ahead, behind, remedy in _AT_PLACE:
        if complaint.startswith(words) and (first := ahead.search(before)) and (second := behind.match(rest)):
            previous = max((n for n, one in enumerate(above, 1) if re.match(r"\s*[^\s#]", one)), default=1)
            shown = {"previous": previous, "first": rest[:1], "rest": rest[:40]}
            return remedy.format(*first.groups(), *second.groups(), **shown)
    return ""
