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

from results_schema.errors import printable
from results_schema.status import Status, label
from studies.commands.error_exit import drop_stdout
from studies.findings.numerics_used import is_marched, told_choices
from studies.reporting.answers import answer_of
from studies.results.findings_common import missed_most
from studies.results.formatting import counted, duration, number, quantity
from studies.results.results import Results
from studies.runs.audit import told_accuracy, told_audit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import JustifyMethod

    from results_schema.store.archive import Summary
    from studies.commands.bench import Throughput
    from studies.commands.catalogue import Entry
    from studies.commands.preview import Preview
    from studies.reporting.comparison import Comparison
    from studies.reporting.summary import Range
    from studies.results.results import Results
    from studies.runs.runner import Outcome

WIDTH = 80  # of output that no terminal shows
LONGEST_CELL = 400
GAP = 2  # between the columns of a table
SECONDS_PER_LINE = 30.0  # of what a run tells where no terminal shows a bar: ten lines in a log of five minutes
MOST_ROWS = 14  # of the table at the end of a run, which is to stay on the screen

_NUMBER = re.compile(r"-?[\d.,e-]+( [^\s\d]\S*)*")


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
    """Print sentences, wrapped between words, with nothing between them but line breaks."""
    console = _output()
    for text in texts:
        console.print(Text(printable(text, 10_000)))


def table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of text; columns of numbers stand to the right."""
    cells = [[printable(cell, LONGEST_CELL) for cell in row] for row in rows]
    shown = Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False)
    console = _output()
    widths = _widths([headings, *cells], console.width)
    for place, (heading, width) in enumerate(zip(headings, widths, strict=True)):
        numeric = all(_NUMBER.fullmatch(row[place]) for row in cells)
        side: JustifyMethod = "right" if numeric else "left"
        shown.add_column(Text(heading, "dim"), justify=side, overflow="fold", no_wrap=place == 0, width=width)
    for row in cells:
        shown.add_row(*map(Text, row))
    if title:
        console.print(Text(printable(title, LONGEST_CELL), "bold"), soft_wrap=True)
    console.print(shown)
    console.line()


def _widths(rows: Sequence[Sequence[str]], screen: int) -> list[int | None]:
    """Widths of columns that wrap between words alone, the first one not at all; None where rich finds them by itself:
    all fit as they are, or not even their longest words.

    >>> _widths([("variants", "scheme", "steps"), ("5", "average-acceleration", "800 to 118,400")], 42)
    [8, 20, 10]
    """
    columns = list(zip(*rows, strict=True))
    whole = [max(map(len, column)) for column in columns]
    least = [max(len(word) for cell in column for word in [*cell.split(), ""]) for column in columns]
    least[0] = whole[0]
    left = screen - GAP * (len(columns) - 1) - sum(least)
    if left < 0 or sum(whole) - sum(least) <= left:
        return [None] * len(columns)
    while left:  # for the column whose longest cell takes the most lines
        place = max(range(len(columns)), key=lambda n: whole[n] / least[n])
        least[place] += 1
        left -= 1
    return list(least)


def _heading(title: str) -> None:
    _output().print(Text(printable(title, LONGEST_CELL), "bold"), soft_wrap=True)
    _output().line()


class Bar(NamedTuple):
    """What moves a progress bar: call `show` with what is done and the total, `say` with what is being done."""

    show: Callable[[int, int], None]
    say: Callable[[str], None]


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

        yield Bar(show, partial(say_stage, label, console=bar.console))


@contextmanager
def _progress_lines(label: str, seconds: float) -> Iterator[Bar]:
    """Lines by a thread of their own, as long as the block lasts."""
    now: dict[str, Any] = {"words": "", "resumed": None, "finished": 0, "total": 0}
    ended, started = threading.Event(), time.monotonic()

    def tell() -> None:
        while not ended.wait(seconds):
            warn(progress_line(label, time.monotonic() - started, **now))

    def show(finished: int, total: int) -> None:
        resumed = finished if now["resumed"] is None else now["resumed"]
        now.update(resumed=resumed, finished=finished, total=total)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield Bar(show, lambda words: now.update(words=words))
    finally:
        ended.set()
        teller.join()


def progress_line(label: str, seconds: float, *, words: str, resumed: int | None, finished: int, total: int) -> str:
    """How far a run is after some seconds; resumed: of what is finished, what was so before.

    >>> progress_line("bridge", 62.0, words="marching", resumed=40, finished=80, total=400)
    'bridge: marching; 80 of 400 after 62 s, about 8.3 min left'
    """
    doing = f"{label}: {words}; " if words else f"{label}: "
    done = finished - (resumed or 0)
    left = f", about {duration(seconds * (total - finished) / done)} left" if done and finished < total else ""
    return f"{doing}{finished:,} of {total:,} after {duration(seconds)}{left}"


def say_stage(label: str, words: str, console: Console | None = None) -> None:
    """Tell on standard error what is being done, if that is a terminal."""
    console = console or Console(stderr=True)
    if console.is_terminal:
        console.print(Text(f"{label}: {printable(words, LONGEST_CELL)}", "dim"))


def show_preview(shown: Preview) -> None:
    """What `check` found."""
    for part in shown.tables:
        table(part.title, part.headings, part.rows)
    say(shown.cost)
    if shown.remarks:
        say("", "Worth knowing", *(f"- {remark}" for remark in shown.remarks))


def show_studies(
    entries: Iterable[Entry], measured: Mapping[str, Mapping[str, Any]], kinds: Iterable[tuple[str, str]]
) -> None:
    """The built-in studies with the time they take, and the kinds of study."""
    rows = [
        (e.name, f"{measured[e.name]['seconds']:.0f} s" if e.name in measured else "minutes", e.title) for e in entries
    ]
    table("Built-in studies (wanderlast run NAME)", ("name", "about", "question"), rows)
    table('Kinds of study (start one with "wanderlast init KIND")', ("kind", "answers"), list(kinds))


def show_archive(summary: Summary) -> None:
    """What is inside an archive, who made it, is it whole: on one screen."""
    from studies.commands.preview import size

    attributes, root = summary.attributes, [v for v in summary.variables if v.group == "/"]
    state = "whole" if summary.whole else "DAMAGED"
    paragraphs(f"{summary.path}: {state}, {size(summary.file_bytes)}")
    grid = next((v.dims for v in root if v.name == "status"), ())
    shape = " x ".join(f"{name} {summary.dimensions[name]:,}" for name in grid)
    own = [v.name for v in root if v.dims[: len(grid)] == grid and v.name not in grid and v.units]
    if "status_name" in summary.dimensions:
        own = [v.name for v in root if v.dims[: len(grid) + 1] == (*grid, "result") and v.dtype != "text"]
    results = [name for name in own if not name.endswith("_position")]
    histories = [v.name for v in root if "history" in v.dims]
    groups = sorted({v.group for v in summary.variables} - {"/"})
    said = {
        "title": attributes.get("title", ""),
        "kind": attributes.get("study_kind", ""),
        "variants": f"{sum(summary.status_counts.values()):,}{f' = {shape}' if len(grid) > 1 else ''}",
        "status": ", ".join(f"{name} {count:,}" for name, count in summary.status_counts.items()),
        "results": ", ".join(results),
        "histories": ", ".join(histories),
        "groups": ", ".join(groups),
        "made": attributes.get("history", ""),
        "in": f"{number(float(attributes['run_seconds']))} s" if "run_seconds" in attributes else "",
        "on": attributes.get("machine", ""),
    }
    table("", ("", ""), [(name, _line(value)) for name, value in said.items() if value])
    paragraphs(
        f"wanderlast info {summary.path} --all lists every variable with its meaning, --study prints the study file."
    )


def show_everything(summary: Summary) -> None:
    """Every attribute, dimension and variable of an archive."""
    from studies.commands.preview import size

    say(f"{summary.path}: {'whole' if summary.whole else 'DAMAGED'}, {size(summary.file_bytes)}", "")
    table("Made", ("", ""), [(key, _line(value)) for key, value in summary.attributes.items()])
    table("Dimensions", ("dimension", "length"), [(name, str(length)) for name, length in summary.dimensions.items()])
    table("Status", ("status", "variants"), [(name, f"{count:,}") for name, count in summary.status_counts.items()])
    for group in sorted({v.group for v in summary.variables}):
        rows = [(v.name, ", ".join(v.dims), v.units, v.long_name) for v in summary.variables if v.group == group]
        table(f"Variables of {group}", ("name", "dimensions", "unit", "meaning"), rows)


def show_outcome(outcome: Outcome) -> None:
    """The answer of a run in sentences, the results that were asked for, their accuracy, and what to do next."""
    from studies.reporting import summary

    results = Results.of(outcome.results)
    _heading(outcome.results.attrs["title"])
    paragraphs(*answer_of(results))
    if not summary.is_measured(outcome.results):  # the grid of those that measure is of methods: its ends say nothing
        _ranges(summary.in_tables(results), results.percentiles)
    accuracy = told_accuracy(outcome.audit, results)
    paragraphs(*_about_statuses(results), *([f"Accuracy: {accuracy}"] if accuracy else []))
    paragraphs(f"{_about_work(outcome)}. Next: wanderlast report {outcome.archive}")


def show_details(outcome: Outcome) -> None:
    """How a run was computed: the range of every result with both variants, models, schemes, work, and the audit."""
    from studies.reporting import summary

    results = Results.of(outcome.results)
    rows = [
        (_name(found), found.said(end.value), end.where)
        for found in summary.ranges(results)
        for end in (found.smallest, found.largest)
    ]
    _output().line()
    table("Smallest and largest of every result", ("result", "value", "where"), rows)
    paragraphs(*told_choices(results), *told_audit(outcome.audit, results))


def _ranges(found: Sequence[Range], percentiles: Sequence[float]) -> None:
    """Each result with its range, and the variant of the end of larger size."""
    axes = list(dict.fromkeys(name for one in found for name in one.extreme.words))
    _output().line()
    if not axes:
        table("", ("result", "value"), [(_name(one), one.said(one.extreme.value)) for one in found])
        return
    parts = [f"{number(part)} %" for part in percentiles]
    where = f"extreme at {', '.join(name.replace('_', ' ') for name in axes)}"
    rows = [
        (
            _name(one),
            *(one.said(value) for value in (one.smallest.value, *one.percentiles, one.largest.value)),
            ", ".join(one.extreme.words.values()),
        )
        for one in found
    ]
    table("", ("result", "smallest", *parts, "largest", where), rows[:MOST_ROWS])
    if rows[MOST_ROWS:]:
        paragraphs(f"{len(rows) - MOST_ROWS} more results: run -v, or the report.")


def _name(found: Range) -> str:
    return f"{found.name} {found.sensor}".strip()


def show_comparison(found: Comparison) -> None:
    """What differs between two archives."""
    changes = [(change.key, _value(change.first), _value(change.second)) for change in found.changes]
    if changes:
        table("The studies differ", ("key", "first", "second"), changes)
    only = f"; {found.only_first:,} only in the first, {found.only_second:,} only in the second"
    apart = only if found.only_first or found.only_second else ""
    paragraphs(f"{counted(found.variants, 'variant')} in both{apart}.")
    paragraphs(*(f"{count:,} of them: {old} -> {new}" for (old, new), count in found.statuses.items()))
    rows = [
        (
            one.name,
            quantity(one.largest, one.units),
            f"{one.beyond:,}",
            one.where,
        )
        for one in found.differences
        if one.largest
    ]
    if rows:
        _output().line()
        table("", ("result", "largest difference", "beyond both errors", "at"), rows)
    if found.only_in_one:
        paragraphs(f"Only in one of them, or in another shape: {', '.join(found.only_in_one)}.")
    same = [one.name for one in found.differences if not one.largest]
    if same:
        paragraphs(f"Equal in every variant: {', '.join(same)}.")
    paragraphs("They agree within their estimated errors." if found.agree else "They differ.")


def _value(value: Any) -> str:
    return "-" if value is None else str(value)


def show_throughput(found: Throughput) -> None:
    """What `bench` measured."""
    say(
        f"{found.scheme}, {counted(found.ties, 'tie')}, {found.modes} modes, {found.steps} steps, "
        f"{found.variants} variants, "
        f"{counted(found.threads, 'thread')}, best of {found.best_of}: {number(found.seconds)} s",
        f"{number(found.case_mode_steps_per_second / 1e9)} thousand million modes x steps x variants per second, "
        f"{number(found.variants_per_second, 4)} variants per second",
    )


def _about_statuses(results: Results) -> Iterator[str]:
    from studies.reporting import summary

    counts, noun = summary.counts(results.dataset), summary.noun(results.dataset)
    expected = results.study.expected
    for status in Status:
        if (count := counts.get(label(status), 0)) and status != Status.OK:
            part = "as the study expects, " if label(status) in expected else ""
            most = missed_most(results) if status is Status.TOLERANCE_MISSED else ""
            yield f"{counted(count, noun)} of {sum(counts.values()):,} {label(status)}: {part}{status.message}{most}."


def _about_work(outcome: Outcome) -> str:
    from studies.reporting import summary

    variants = counted(sum(summary.counts(outcome.results).values()), summary.noun(outcome.results))
    if outcome.was_finished:
        return f"{outcome.archive} held the finished results of this study: nothing to do"
    resumed = f"{outcome.resumed:,} of them" if is_marched(outcome.results) else counted(outcome.resumed, "piece")
    earlier = f", {resumed} finished by an earlier start" if outcome.resumed else ""
    return f"{outcome.archive}: {variants} in {number(outcome.seconds)} s{earlier}"


def _line(value: Any) -> str:
    """An attribute on one line; of a long text only how long it is."""
    if isinstance(value, str) and "\n" in value:
        return f"a text of {value.count(chr(10)) + 1} lines"
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and value - value != 0.0 else value
