"""Lines that people write and TOML does not read, each with what to write instead."""

from __future__ import annotations

import re

_NUMBER = r"[+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?"
_LINES = "TOML has lines key = value below headers such as [body.bed]"
_NOT_JSON = f"this looks like JSON or Python; {_LINES}"
_QUOTED = "quotation marks around a number with a unit"
_WHAT_TO_WRITE = tuple(
    (re.compile(pattern), remedy)
    for pattern, remedy in (
        (r"""^[{\[]?\s*(?:\{|"[^"]*"\s*:)|=\s*(?:dict\(|\{\s*["']\w+["']\s*:)""", _NOT_JSON),
        (r"[\u201c-\u201f\u00ab\u00bb\u2018\u2019]", 'straight quotation marks: "..."'),
        (r"[^\S \t]|[\u200b\ufeff]", "type the spaces of this line again: one of them is another character"),
        (r"""^[^"'#]*\s//""", "a comment begins with #"),
        (r"^[\w.-]+\s*:", "an equals sign; " + _LINES),
        (r"=\s*True\b", "in small letters: true"),
        (r"=\s*False\b", "in small letters: false"),
        (r"=\s*(?:None|null|nil)\b", "leave the key out where it has no value"),
        (r"=\s*$", 'a value after the "="'),
        (rf"=\s*({_NUMBER}),(\d+)\s*([^\W\d].*)$", rf'a decimal point, and {_QUOTED}: "\1.\2 \3"'),
        (r"=\s*([+-]?\d+),(\d{3})\s*$", r"a number without a comma: \1\2, or \1.\2 if a decimal point was meant"),
        (r"=\s*([+-]?\d+),(\d+)\s*$", r"a decimal point: \1.\2"),
        (rf"=\s*{_NUMBER}\s*[*/+^-]|=\s*\w+\(", "write the result: a study file does not calculate"),
        (rf"=\s*({_NUMBER})\s*([^\W\d]\S*)\s*$", rf'{_QUOTED}: "\1 \2"'),
        (r'^[^"#]*"[^"]*$', "a quotation mark is missing"),
        (r"=\s*[^\W\d]\w*\s*$", "quotation marks around a word"),
    )
)  # fmt: skip
_TWICE = {
    "Cannot overwrite a value": "this key stands further up in the same table: keep one of the two",
    "Cannot declare": "this table is there already, further up: put its keys together",
}


def what_to_write(line: str, complaint: str) -> str:
    """A remedy for a line of a study file of which the reader of TOML complains, or "".

    >>> what_to_write("length = 25,5 m", "")
    'a decimal point, and quotation marks around a number with a unit: "25.5 m"'
    """
    for words, remedy in _TWICE.items():
        if complaint.startswith(words):
            return remedy
    found = ((pattern.search(line), remedy) for pattern, remedy in _WHAT_TO_WRITE)
    return next((match.expand(remedy) for match, remedy in found if match), "")
