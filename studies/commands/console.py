"""What people see: tables and messages on standard output, a progress bar on standard error."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from results_schema.errors import printable
from results_schema.status import Status, label
from studies.commands.error_exit import drop_stdout
from studies.results.formatting import counted, number, quantity

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from results_schema.store.archive import Summary
    from studies.commands.bench import Throughput
    from studies.commands.catalogue import Entry
    from studies.commands.preview import Preview
    from studies.runs.runner import Outcome

WIDTH_OF_FILES = 140  # of output that no terminal shows
LONGEST_CELL = 200

_NUMBER = re.compile(r"-?[\d.,e-]+( [^\s\d]\S*)*")


class _Output(Console):
    """Standard output whose reader may leave at any time."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        drop_stdout()


def _output() -> Console:
    console = _Output(highlight=False, emoji=False, markup=False, soft_wrap=False)
    return console if console.is_terminal else _Output(highlight=False, emoji=False, markup=False, width=WIDTH_OF_FILES)


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


def table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of text; columns of numbers stand to the right."""
    cells = [[printable(cell, LONGEST_CELL) for cell in row] for row in rows]
    shown = Table(box=None, padding=(0, 2, 0, 0))
    for place, heading in enumerate(headings):
        numeric = all(_NUMBER.fullmatch(row[place]) for row in cells)
        shown.add_column(Text(heading, "dim"), justify="right" if numeric else "left", overflow="fold")
    for row in cells:
        shown.add_row(*map(Text, row))
    console = _output()
    console.print(Text(printable(title, LONGEST_CELL), "bold"), soft_wrap=True)
    console.print(shown)
    console.print()


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on standard error, if that is a terminal; call what it gives with what is done and the total."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, TimeRemainingColumn(), console=console, disable=not console.is_terminal, transient=True)
    with bar:
        task = bar.add_task(label, total=None)

        def show(finished: int, total: int) -> None:
            bar.update(task, completed=finished, total=total)

        yield show


def show_preview(shown: Preview) -> None:
    """What `check` found."""
    for part in shown.tables:
        table(part.title, part.headings, part.rows)
    say(shown.cost)
    if shown.remarks:
        say("", "Worth knowing", *(f"- {remark}" for remark in shown.remarks))


def show_studies(entries: Iterable[Entry], kinds: Iterable[tuple[str, str]]) -> None:
    """The built-in studies, and the kinds of study."""
    table("Built-in studies", ("name", "kind", "title"), [(e.name, e.kind, e.title) for e in entries])
    table('Kinds of study (start one with "wanderlast init KIND")', ("kind", "answers"), list(kinds))


def show_archive(summary: Summary) -> None:
    """What is inside an archive, who made it, is it whole."""
    from studies.commands.preview import size

    say(f"{summary.path}: {'whole' if summary.whole else 'DAMAGED'}, {size(summary.file_bytes)}", "")
    table("Made", ("", ""), [(key, _line(value)) for key, value in summary.attributes.items()])
    table("Dimensions", ("dimension", "length"), [(name, str(length)) for name, length in summary.dimensions.items()])
    table("Status", ("status", "variants"), [(name, f"{count:,}") for name, count in summary.status_counts.items()])
    rows = [(v.name, v.group, ", ".join(v.dims), v.dtype, v.units, v.long_name) for v in summary.variables]
    table("Variables", ("name", "group", "dimensions", "type", "unit", "meaning"), rows)


def show_outcome(outcome: Outcome) -> None:
    """What a run found: the range of every result and the variants there, statuses, the archive."""
    from studies.findings.numerics_used import told_choices
    from studies.reporting import summary
    from studies.results.results import Results
    from studies.runs.audit import told_audit

    results, whole = outcome.results, Results.of(outcome.results)
    rows = [
        (
            f"{found.name} {found.sensor}".strip(),
            quantity(found.smallest.value, found.units, beside=found.size),
            found.smallest.where,
            quantity(found.largest.value, found.units, beside=found.size),
            found.largest.where,
        )
        for found in summary.ranges(whole)
    ]
    table(results.attrs["title"], ("result", "smallest", "where", "largest", "where"), rows)
    told = [*told_choices(whole), *told_audit(outcome.audit, whole)]
    say(*_about_statuses(summary.counts(results), summary.noun(results)), *told, _about_work(outcome))


def show_throughput(found: Throughput) -> None:
    """What `bench` measured."""
    say(
        f"{found.scheme}, {counted(found.ties, 'tie')}, {found.modes} modes, {found.steps} steps, "
        f"{found.variants} variants, "
        f"{counted(found.threads, 'thread')}, best of {found.best_of}: {number(found.seconds)} s",
        f"{number(found.case_mode_steps_per_second / 1e9)} thousand million modes x steps x variants per second, "
        f"{number(found.variants_per_second, 4)} variants per second",
    )


def _about_statuses(counts: Mapping[str, int], noun: str) -> Iterator[str]:
    for status in Status:
        if label(status) in counts:
            message = "" if status == Status.OK else f" ({status.message})"
            yield f"{counted(counts[label(status)], noun)} {label(status)}{message}"


def _about_work(outcome: Outcome) -> str:
    from studies.findings.numerics_used import is_marched
    from studies.reporting import summary

    variants = counted(int(outcome.results["status"].size), summary.noun(outcome.results))
    if outcome.was_finished:
        return f"{outcome.archive} holds the finished results of this very study; nothing to do"
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
