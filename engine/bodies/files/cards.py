"""Bulk data of Nastran: cards with their lines, and the faults that readers of such files pass over."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from engine.bodies.files.text import Line, real, whole
from results_schema.errors import BadInput

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]{0,7}\*?$")
_INCLUDE = re.compile(r"\s*INCLUDE\s*(.*)$", re.IGNORECASE)
_SECTION = re.compile(r"\s*BEGIN\b", re.IGNORECASE)
_READ = ("GRID", "SPOINT", "EXTRN", "DMIG", "CORD2R", "CORD2C", "CORD2S")
_TRIPLE = 4  # fields of an entry of a DMIG column: node, direction, real and imaginary part
_MOST_SCALARS = 100_000


@dataclass(frozen=True)
class Card:
    """A card: its name, its fields after the name, and the line where it starts. section: of the bulk data, from 0."""

    name: str
    fields: tuple[str, ...]
    line: Line
    section: int

    def field(self, index: int) -> str:
        """A field from 0, "" where the card is shorter."""
        return self.fields[index] if index < len(self.fields) else ""

    def whole(self, index: int, noun: str = "a node's number") -> int:
        """A field as a number > 0. Raises BadInput."""
        return whole(self.line, self.field(index), card=self.name, noun=noun)

    def real(self, index: int, noun: str) -> float:
        """A field as a finite number, 0 where it is empty. Raises BadInput."""
        word = self.field(index)
        return real(self.line, word, card=self.name, noun=noun) if word else 0.0

    def fault(self, what: str, *, expected: str = "", received: str = "") -> BadInput:
        """A refusal that names file, line and card."""
        return self.line.fault(what, card=self.name, expected=expected, received=received)


def included(line: Line, after: Iterator[Line]) -> str | None:
    """The file that an INCLUDE names, which may go on over lines up to its closing quote; None for other lines."""
    match = _INCLUDE.match(line.text)
    if match is None:
        return None
    text = match.group(1).strip()
    quote = text[:1]
    if quote not in ("'", '"'):
        return text.split("$")[0].strip()
    while quote not in text[1:]:
        more = next(after, None)
        if more is None:
            raise line.fault("the file is truncated", card="INCLUDE", expected="a closing quote")
        text += more.text.strip()
    return text[1:].partition(quote)[0]


def cards_of(lines: list[Line]) -> list[Card]:
    """The cards that describe nodes, rows and matrices: fixed fields of 8 or 16 characters, or free ones. Raises
    BadInput where a card goes on after nothing."""
    found: list[Card] = []
    name, head, fields, section = "", lines[0], list[str](), 0
    for line in lines:
        text = line.text.partition("$")[0].rstrip()
        if not text:
            continue
        start, parts = _fields(text)
        if start in ("", "*", "+") or start[0] in "*+":
            if not name and start != "":
                raise line.fault("a line goes on after nothing", received=text)
            fields += parts
            continue
        _finish(found, name, fields, head, section)
        section += bool(_SECTION.match(text))
        name, head, fields = start.rstrip("*").upper(), line, parts
        if name in _READ and not _NAME.match(start):
            raise line.fault("the card cannot be read", received=text)
    _finish(found, name, fields, head, section)
    return found


def _finish(found: list[Card], name: str, fields: list[str], line: Line, section: int) -> None:
    if name in _READ:
        found.append(Card(name, tuple(fields), line, section))


def _fields(text: str) -> tuple[str, list[str]]:
    """The first field of a line and those after it."""
    if "," in text:
        words = [word.strip() for word in text.split(",")]
        return words[0], (words[1:9] + [""] * 8)[:8]
    text = text.expandtabs(8)
    start, width, count = text[:8].strip(), 8, 8
    if start.endswith("*") or start.startswith("*"):
        width, count = 16, 4
    return start, [text[8 + width * index : 8 + width * (index + 1)].strip() for index in range(count)]


def check_nodes(cards: list[Card]) -> dict[int, Card]:
    """GRID cards by node; in each section of the bulk data a node stands once. Raises BadInput."""
    found: dict[int, Card] = {}
    seen: dict[tuple[int, int], Card] = {}
    systems = {card.whole(0, "a number of a coordinate system") for card in cards if card.name.startswith("CORD2")}
    for card in (card for card in cards if card.name == "GRID"):
        number = card.whole(0)
        if (card.section, number) in seen:
            first = seen[(card.section, number)].line
            raise card.fault(f"node {number} is defined twice", expected=f"first in {first.path}, line {first.number}")
        for index in range(2, 5):
            card.real(index, f"a coordinate of node {number}")
        for index in (1, 5):
            system = card.field(index)
            if system not in ("", "0", "-1") and card.whole(index, "a coordinate system") not in systems:
                raise card.fault(f"there is no coordinate system {system}", expected="a CORD2R, CORD2C or CORD2S card")
        seen[(card.section, number)] = found[number] = card
    for card in (card for card in cards if card.name.startswith("CORD2")):
        for index in range(2, 11):
            card.real(index, "a number of a coordinate system")
    return found


def scalars(cards: list[Card]) -> list[int]:
    """Numbers of all SPOINT cards. Raises BadInput."""
    found: dict[int, None] = {}
    for card in (card for card in cards if card.name == "SPOINT"):
        words = [word for word in card.fields if word]
        if len(words) == 3 and words[1].upper() == "THRU":
            first, last = (whole(card.line, word, card="SPOINT") for word in (words[0], words[2]))
            if not first <= last <= first + _MOST_SCALARS:
                raise card.fault("the range cannot be right", received=" ".join(words))
            found |= dict.fromkeys(range(first, last + 1))
        else:
            found |= dict.fromkeys(whole(card.line, word, card="SPOINT") for word in words)
    return list(found)


def rows_of(cards: list[Card]) -> list[tuple[int, int]]:
    """Node and direction (1 to 6, 0 for scalars) of every row by the EXTRN cards; empty without. Raises BadInput."""
    found: dict[tuple[int, int], None] = {}
    for card in (card for card in cards if card.name == "EXTRN"):
        words = [word for word in card.fields if word]
        if len(words) % 2:
            raise card.fault("pairs of node and directions are wanted here", received=" ".join(words[-3:]))
        for number, directions in zip(words[::2], words[1::2], strict=True):
            node = whole(card.line, number, card="EXTRN")
            for direction in _directions(card, directions):
                if (node, direction) in found:
                    raise card.fault(f"node {node} stands here twice", expected="each direction once")
                found[node, direction] = None
    return list(found)


def _directions(card: Card, word: str) -> list[int]:
    if word == "0":
        return [0]
    if not re.fullmatch("[1-6]{1,6}", word):
        raise card.fault("directions are wanted here", expected="digits of 1 to 6, or 0", received=word)
    return [int(digit) for digit in word]


def check_matrices(cards: list[Card]) -> set[str]:
    """Names of the DMIG matrices; every entry is a finite real number of a node and a direction. Raises BadInput."""
    found: set[str] = set()
    for card in (card for card in cards if card.name == "DMIG"):
        name = card.field(0).lower()
        if not name:
            raise card.fault("the name of the matrix is missing")
        if card.field(1) == "0":
            if card.field(2) not in ("1", "2", "6", "9") or card.field(3) not in ("1", "2", "3", "4"):
                raise card.fault("the head of a matrix cannot be read", received=" ".join(card.fields[:4]))
            found.add(name)
            continue
        if name not in found:
            raise card.fault(f"a column of {name} before its head", expected="DMIG, name, 0, ...")
        _check_entry(card, 1)
        entries = card.fields[4:]
        for start in range(0, len(entries), _TRIPLE):
            if any(entries[start : start + _TRIPLE]):
                _check_entry(card, 4 + start)
                node = card.field(4 + start)
                real(card.line, card.field(6 + start), card="DMIG", noun=f"an entry of node {node}")
    return found


def _check_entry(card: Card, index: int) -> None:
    card.whole(index)
    if card.field(index + 1) not in ("", "0", "1", "2", "3", "4", "5", "6"):
        raise card.fault("no such direction", expected="0 to 6", received=card.field(index + 1))
