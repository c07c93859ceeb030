"""What people see: tables and messages on standard output, a progress bar on standard error."""

from __future__ import annotations

import json
import os
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from engine.kernels.compiling import WORDS as COMPILING
from results_schema.errors import printable
from studies.commands.error_exit import drop_stdout
from studies.results.formatting import duration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import JustifyMethod

WIDTH = 80  # of output that no terminal shows
LONGEST_CELL = 400
GAP = 2  # between the columns of a table
SECONDS_PER_LINE = 30.0  # of what a run tells where no terminal shows a bar: ten lines in a log of five minutes

_NUMBER = re.compile(r"-?[\d.,e-]+( [^\s\d]\S*)*")
_UNIT = r"[^\s\d±=]\S*( (?:m|s|kg)(?:/\S+|[²³⁴])?[,;.)]?(?!\S))?"  # a word, and what follows N in N m
_SYMBOL = r"[A-Za-z]+(?: (?:m|s|kg|rad)-?\d)+(?!\S)|N m(?!\S)"  # of an archive, such as m s-2
_PIECE = re.compile(rf"(?:± )?\(?-?\d[\d.,e-]*(?<!,)( {_UNIT})?(?!\S)|{_SYMBOL}|\S+")


class _Output(Console):
    """Standard output whose reader may leave at any time."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        drop_stdout()


def _output() -> Console:
    console = _Output(highlight=False, emoji=False, markup=False, soft_wrap=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = WIDTH
    return console


def say(*lines: str) -> None:
    """Print lines as they are, without wrapping."""
    console = _output()
    for line in lines:
        console.print(Text(printable(line, 10_000)), soft_wrap=True)


def warn(*lines: str) -> None:
    """Print lines on standard error."""
    with suppress(OSError):
        for line in lines:
            click.echo(printable(line, 10_000), err=True)


def say_json(content: Mapping[str, Any]) -> None:
    """Print one JSON object; numbers that are not finite as null."""
    _output().out(json.dumps(_finite(content), indent=2, allow_nan=False))


def paragraphs(*texts: str) -> None:
    """Print sentences, wrapped as cells of tables are, with nothing between them but line breaks."""
    console = _output()
    for line in (line for text in texts for line in _wrapped(printable(text, 10_000), console.width)):
        console.print(Text(line), soft_wrap=True)


def table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]], tallest: int = LONGEST_CELL) -> None:
    """Print a table of text; columns of numbers stand to the right. Cells break between words, never within a number
    or before its unit; where columns have no room for that, or cells take more than so many lines, every row is a
    block of its own."""
    cells = [[printable(cell, LONGEST_CELL) for cell in row] for row in rows]
    console = _output()
    numeric = [all(_NUMBER.fullmatch(cell) for cell in column) for column in zip(*cells, strict=True)]
    widths = _widths([headings, *cells], console.width, numeric)
    for line in _wrapped(printable(title, LONGEST_CELL), console.width) if title else []:
        console.print(Text(line, "bold"), soft_wrap=True)
    lines = [[_wrapped(cell, width) for cell, width in zip(row, widths, strict=False)] for row in cells]
    if not widths or max((len(cell) for row in lines for cell in row), default=0) > tallest:
        _blocks(console, headings, cells)
        return
    shown = Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False)
    for place, (heading, width) in enumerate(zip(headings, widths, strict=True)):
        side: JustifyMethod = "right" if cells and numeric[place] else "left"
        shown.add_column(Text("\n".join(_wrapped(heading, width)), "dim"), justify=side, no_wrap=True, width=width)
    for row in lines:
        shown.add_row(*(Text("\n".join(cell)) for cell in row))
    console.print(shown)
    console.line()


def _blocks(console: Console, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Rows below one another: the first cell, then all others, each behind its heading; lists on lines of their own."""
    for name, *others in rows:
        told = [f"{heading} {cell}".strip() for heading, cell in zip(headings[1:], others, strict=True)]
        short = "; ".join(text for text in told if "," not in text)
        for indent, text in ((0, name), *((GAP, text) for text in (short, *(text for text in told if "," in text)))):
            for line in _wrapped(text, console.width - indent):
                console.print(Text(" " * indent + line), soft_wrap=True)
    console.line()


def _pieces(text: str) -> list[str]:
    """A text in pieces that stay on one line: a number with its unit, or a word.

    >>> _pieces("-2.5 kN m ± 15 N m at 139 km/h, variant 21")
    ['-2.5 kN m', '± 15 N m', 'at', '139 km/h,', 'variant', '21']
    >>> _pieces("m s-2 or N m")
    ['m s-2', 'or', 'N m']
    """
    return [found[0] for found in _PIECE.finditer(text)]


def _wrapped(text: str, width: int) -> list[str]:
    """Lines of a text, as many pieces on each as have room.

    >>> _wrapped("smallest at 139 km/h", 12), _wrapped("", 3)
    (['smallest at', '139 km/h'], [''])
    """
    lines = [""]
    for piece in _pieces(text):
        longer = f"{lines[-1]} {piece}".lstrip()
        lines[-1:] = [longer] if len(longer) <= width or not lines[-1] else [lines[-1], piece]
    return lines


def _widths(rows: Sequence[Sequence[str]], screen: int, numeric: Sequence[bool]) -> list[int]:
    """Widths of columns that wrap between words alone, the first one not at all where others can, as those of numbers;
    none where not even their longest words fit.

    >>> rows = [("variants", "scheme", "steps"), ("5", "average-acceleration", "800 to 118,400")]
    >>> _widths(rows, 42, (True, False, False))
    [8, 20, 10]
    >>> rows = [("result", "largest", "at"), ("speed", "-2.57 m/s", "mass 1 kg, speed 2 m/s")]
    >>> _widths(rows, 32, (False, True, False))
    [6, 9, 13]
    >>> _widths(rows, 20, (False, True, False))
    []
    """
    columns = list(zip(*rows, strict=True))
    whole = [max(map(len, column)) for column in columns]
    least = [max(len(piece) for cell in column for piece in [*_pieces(cell), ""]) for column in columns]
    unbroken = [place == 0 or bool(known) for place, known in enumerate(numeric or [False] * len(columns))]
    for kept in (unbroken, [place == 0 for place in range(len(columns))], [False] * len(columns)):
        found = [full if keep else word for full, word, keep in zip(whole, least, kept, strict=True)]
        left = screen - GAP * (len(columns) - 1) - sum(found)
        if left >= 0:
            break
    if left < 0:
        return []
    left = min(left, sum(whole) - sum(found))
    while left:  # for the column whose longest cell takes the most lines
        place = max(range(len(columns)), key=lambda n: whole[n] / max(found[n], 1))
        found[place] += 1
        left -= 1
    return found


def heading(title: str) -> None:
    """Print a title and an empty line."""
    _output().print(Text(printable(title, LONGEST_CELL), "bold"), soft_wrap=True)
    blank()


def blank() -> None:
    """Print an empty line."""
    _output().line()


class Bar(NamedTuple):
    """What moves a progress bar: `show` has what is done and the total, `say` what is being done, `note` how far that
    is where nothing is counted yet."""

    show: Callable[[int, int], None]
    say: Callable[[str], None]
    note: Callable[[str], None]


@contextmanager
def progress_bar(label: str, seconds: float = SECONDS_PER_LINE) -> Iterator[Bar]:
    """A progress bar on standard error; where that is no terminal, a line every so many seconds."""
    console = Console(stderr=True)
    if not console.is_terminal:
        with _progress_lines(label, seconds) as lines:
            yield lines
        return
    columns = (TextColumn("{task.description}"), BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, TimeRemainingColumn(), console=console, transient=True)
    with bar:
        task = bar.add_task(label, total=None)

        def show(finished: int, total: int) -> None:
            bar.update(task, completed=finished, total=total)

        def note(words: str) -> None:
            bar.update(task, description=f"{label}: {words}" if words else label)

        yield Bar(show, partial(say_stage, label, console=bar.console), note)


@contextmanager
def _progress_lines(label: str, seconds: float) -> Iterator[Bar]:
    """Lines by a thread of their own, as long as the block lasts."""
    now: dict[str, Any] = {"words": "", "resumed": None, "finished": 0, "total": 0, "note": ""}
    ended, started = threading.Event(), time.monotonic()

    def tell() -> None:
        while not ended.wait(seconds):
            warn(progress_line(label, time.monotonic() - started, **now))

    def show(finished: int, total: int) -> None:
        resumed = finished if now["resumed"] is None else now["resumed"]
        now.update(resumed=resumed, finished=finished, total=total)

    def say(words: str) -> None:
        if words == COMPILING:  # what else comes before the first line would be silence
            say_compiling(label, words)
        else:
            now.update(words=words)

    def note(words: str) -> None:
        now.update(note=words)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield Bar(show, say, note)
    finally:
        ended.set()
        teller.join()


def progress_line(
    label: str, seconds: float, *, words: str, resumed: int | None, finished: int, total: int, note: str = ""
) -> str:
    """How far a run is after some seconds; resumed: of what is finished, what was so before.

    >>> progress_line("bridge", 62.0, words="marching", resumed=40, finished=80, total=400)
    'bridge: marching; 80 of 400 after 62 s, about 8.3 min left'
    >>> progress_line("bridge", 62.0, words="choosing", resumed=0, finished=0, total=400, note="2 of 9 scenes")
    'bridge: choosing, 2 of 9 scenes; 0 of 400 after 62 s'
    """
    told = ", ".join(filter(None, (words, note)))
    doing = f"{label}: {told}; " if told else f"{label}: "
    done = finished - (resumed or 0)
    left = f", about {duration(seconds * (total - finished) / done)} left" if done and finished < total else ""
    return f"{doing}{finished:,} of {total:,} after {duration(seconds)}{left}"


def say_compiling(label: str, words: str) -> None:
    """Tell on standard error that kernels are compiled, on a terminal or not: nothing else comes for a while."""
    if Console(stderr=True).is_terminal:
        say_stage(label, words)
    else:
        warn(f"{label}: {words}")


def say_stage(label: str, words: str, console: Console | None = None) -> None:
    """Tell on standard error what is being done, if that is a terminal."""
    console = console or Console(stderr=True)
    if console.is_terminal:
        console.print(Text(f"{label}: {printable(words, LONGEST_CELL)}", "dim"))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and value - value != 0.0 else value
