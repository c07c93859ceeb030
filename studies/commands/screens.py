"""What the commands show on standard output: previews, lists, archives, what became of runs, comparisons, paces."""

from __future__ import annotations

import math
import shlex
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from results_schema.status import Status, label
from studies.commands.console import blank, heading, paragraphs, say, table, warn
from studies.findings.numerics_used import is_marched, told_choices
from studies.protocol.study import kind_named
from studies.reporting.answers import found_of, short_answer_of
from studies.results.cells import percentile_spans
from studies.results.findings_common import missed_most, remedy
from studies.results.formatting import counted, listed, number, quantity, spanned
from studies.results.results import Results
from studies.runs.audit_findings import told_accuracy, told_audit
from studies.runs.unreduced import told_unreduced

if TYPE_CHECKING:
    from results_schema.store.archive import Summary
    from studies.commands.bench import Throughput
    from studies.commands.catalogue import Entry
    from studies.commands.preview import Preview
    from studies.protocol.parts import TextTable
    from studies.reporting.comparison import Comparison, Difference
    from studies.reporting.summary import Range
    from studies.runs.runner import Outcome

BESIDE = ("_position", "_time", "_rms", "_used", "elapsed")  # endings of what `info` lists with --all alone
LONGEST_LIST = 300  # letters
MOST_ALIKE = 4  # results that are the same in every variant and told with their value
RESIDUAL = "_residual"  # ending of residual vibrations
TALLEST = 4  # lines of a row of that table
MOST_ROWS = 14  # of the table at the end of a run, which is to stay on the screen


def show_preview(shown: Preview) -> None:
    """What `check` found: what looks wrong before all numbers that follow from it."""
    doubts, others = _sorted(shown.remarks)
    if doubts:
        paragraphs("Is this meant?", *(f"- {remark}" for remark in doubts), "")
    for part in shown.tables:
        table(part.title, part.headings, part.rows)
    paragraphs(shown.cost)
    if others:
        paragraphs("", "Worth knowing", *(f"- {remark}" for remark in others))


def warn_of(remarks: Sequence[str]) -> None:
    """The same of a run, on standard error."""
    doubts, others = _sorted(remarks)
    warn(*(f"is this meant? {remark}" for remark in doubts), *(f"worth knowing: {remark}" for remark in others))


def _sorted(remarks: Sequence[str]) -> tuple[list[str], list[str]]:
    """Those that ask whether something is meant, and the others."""
    doubts = [remark for remark in remarks if "?" in remark]
    return doubts, [remark for remark in remarks if "?" not in remark]


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
    results = [name for name in own if not name.endswith(BESIDE)]
    histories = [v.name for v in root if "history" in v.dims]
    groups = sorted({v.group for v in summary.variables} - {"/"})
    said = {
        "title": attributes.get("title", ""),
        "kind": attributes.get("study_kind", ""),
        "variants": f"{sum(summary.status_counts.values()):,}{f' = {shape}' if len(grid) > 1 else ''}",
        "status": ", ".join(f"{name} {count:,}" for name, count in summary.status_counts.items()),
        "results": _some(results),
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
    from studies.reporting.side_by_side import side_by_side

    results = Results.of(outcome.results)
    heading(outcome.results.attrs["title"])
    said, left = short_answer_of(results)
    paragraphs(*said, *([f"{counted(left, 'more sentence')}: run -v, or the report."] if left else []))
    if not summary.is_measured(outcome.results):  # the grid of those that measure is of methods: its ends say nothing
        found = summary.in_tables(results)
        show_ranges(found, results.percentiles, summary.every(results), side_by_side(results, found))
        paragraphs(*told_loosely(found, results.status_counts), *filter(None, [summary.left_out(results)]))
        _percentiles(results, [_name(one) for one in found][:MOST_ROWS])
    _show_accuracy(outcome, results)


def _show_accuracy(outcome: Outcome, results: Results, *details: str) -> None:
    """How exact it is, further sentences, and what to do next."""
    accuracy = told_accuracy(outcome.audit, results)
    paragraphs(*_about_statuses(results), *([f"Accuracy: {accuracy}"] if accuracy else []))
    paragraphs(*told_unreduced(outcome.unreduced), *details)
    paragraphs(f"{_about_work(outcome)}. Next: wanderlast report {shlex.quote(str(outcome.archive))}")


def show_details(outcome: Outcome) -> None:
    """In place of that all sentences, the range of every result that people read with both variants, and how a run was
    computed: models, schemes, work, and the audit."""
    from studies.reporting import summary

    results = Results.of(outcome.results)
    heading(outcome.results.attrs["title"])
    paragraphs(*found_of(results))
    shown = summary.shown(results)
    rows = [
        (_name(found), found.said(end), "" if found.is_constant else end.where)
        for found in shown
        for end in ((found.largest,) if found.is_constant else (found.smallest, found.largest))
    ]
    if not summary.is_measured(outcome.results):
        blank()
        table("Smallest and largest of results", ("result", "value", "where"), rows)
        _percentiles_over_all(shown, results.percentiles)
        _percentiles(results, [_name(one) for one in shown])
    _show_accuracy(outcome, results, *told_choices(results), *told_audit(outcome.audit, results))


def show_ranges(
    found: Sequence[Range], percentiles: Sequence[float], every: str, beside: TextTable | None = None
) -> None:
    """Each result with its range, and where the end is that tells most, or for a few values of a swept number side by
    side; in a sentence those that do not change.

    every: those over which they do not, in words. beside: the table with these side by side, where there is one.
    """
    blank()
    if not any(one.extreme.words for one in found):
        table("", ("result", "value"), [(_name(one), one.said(one.extreme)) for one in found])
        return
    parts = [f"{number(part)} %" for part in percentiles]
    rows = [
        (
            _name(one),
            *(one.value(value) for value in (one.smallest.value, *one.percentiles, one.largest.value)),
            _where(one),
        )
        for one in found
        if not one.is_constant
    ]
    if beside and not parts:
        table(beside.title, beside.headings, beside.rows[:MOST_ROWS], tallest=TALLEST)
    elif rows:
        table("", ("result", "smallest", *parts, "largest", ""), rows[:MOST_ROWS], tallest=TALLEST)
    if rows[MOST_ROWS:]:
        paragraphs(f"{counted(len(rows) - MOST_ROWS, 'more result')}: run -v, or the report.")
    alike = [(one, f"{_name(one)} {one.value(one.largest.value)}") for one in found if one.is_constant]
    same = [words for one, words in alike if not one.partly]
    if same:
        more = f" and {len(same) - MOST_ALIKE} more" if len(same) > MOST_ALIKE else ""
        paragraphs(f"The same in {every}: {', '.join(same[:MOST_ALIKE])}{more}.")
    if some := [f"{words} {one.partly}" for one, words in alike if one.partly]:
        paragraphs(f"The same where there is one: {', '.join(some[:MOST_ALIKE])}.")


def told_loosely(found: Sequence[Range], occurring: Container[Status]) -> list[str]:
    """The results of a sweep whose error is large beside them. Residual vibrations are held to a part of a sensor's
    largest static value: what tells them closer, unless that is missed as it is. occurring: statuses of variants."""
    loose = [one for one in found if one.is_loose and one.extreme.words]
    if not loose:
        return []
    ringing = next((one.name.removesuffix(RESIDUAL) for one in loose if one.name.endswith(RESIDUAL)), "")
    closer = f" Residual vibrations are known more closely with a smaller tolerance (sensor.{ringing}.tolerance)."
    words = ", ".join(f"{_name(one)} {one.said(one.extreme)}" for one in loose)
    helps = ringing and Status.TOLERANCE_MISSED not in occurring
    return [f"Told errors of more than a tenth of the value: {words}.{closer if helps else ''}"]


def _where(found: Range) -> str:
    """Where the end of a range is that tells most; "" where both are told by the same digits."""
    if found.value(found.smallest.value) == found.value(found.largest.value):
        return ""
    return f"{'largest' if found.telling is found.largest else 'smallest'} {found.telling.at.replace('_', ' ')}"


def _percentiles_over_all(found: Sequence[Range], percentiles: Sequence[float]) -> None:
    """Of results over all variants, where the study asks for some."""
    told = [one for one in found if one.percentiles and not one.is_constant]
    if told:
        parts = [f"{number(part)} %" for part in percentiles]
        rows = [(_name(one), *map(one.value, one.percentiles)) for one in told]
        table("Percentiles over all variants", ("result", *parts), rows)


def _percentiles(results: Results, shown: Sequence[str]) -> None:
    """Of an archive of several cells, in which each has its own."""
    found = {name: (units, values) for name, units, values in percentile_spans(results) if name in shown}
    rows = [
        (name, *(spanned(span, partial(quantity, units=units)) for span in values.T))
        for name, (units, values) in sorted(found.items(), key=lambda one: shown.index(one[0]))
    ]
    if rows:
        parts = [f"{number(part)} %" for part in results.study.output.percentiles]
        table(f"Percentiles of {counted(results.size, 'cell')}, from one to another", ("result", *parts), rows)


def _name(found: Range) -> str:
    return f"{found.name} {found.sensor}".strip()


def show_comparison(found: Comparison) -> None:
    """What differs between two archives."""
    changes = [(change.key, _value(change.first), _value(change.second)) for change in found.changes]
    if changes:
        table("The studies differ", ("key", "first", "second"), changes)
    if found.programs:
        paragraphs(f"Made by different states of the program: {listed(found.programs)}.")
    only = f"; {found.only_first:,} only in the first, {found.only_second:,} only in the second"
    alone = only if found.only_first or found.only_second else ""
    paragraphs(f"{counted(found.variants, 'variant')} in both{alone}.")
    paragraphs(*(f"{count:,} of them: {old} -> {new}" for (old, new), count in found.statuses.items()))
    apart = [one for one in found.differences if one.largest]
    if apart:
        blank()
        untold = any(one.unknown for one in apart)  # a column of zeros says nothing
        counts = [(f"{one.beyond:,}", *([f"{one.unknown:,}"] if untold else [])) for one in apart]
        values = [(one.name, *_quantities(one, *one.values), *_beside(one)) for one in apart]
        title = "Where they differ most; beyond: variants that do by more than told errors"
        title += "; untold: where none is known" * untold
        headings = ("result", "first", "second", "apart", "errors", "beyond", *["untold"] * untold)
        table(title, headings, [(*own, *count) for own, count in zip(values, counts, strict=True)])
        ends = [(one.name, *_quantities(one, *one.extremes), one.where) for one in apart]
        smallest = ", of what ends in _min the smallest" * any(one.name.endswith("_min") for one in apart)
        table(f"Values of largest size{smallest}", ("result", "first", "second", "they differ most at"), ends)
    if found.only_in_one:
        paragraphs(f"Only in one of them, or in another shape: {_some(found.only_in_one)}.")
    same = [one.name for one in found.differences if not one.largest]
    if same:
        paragraphs(f"Equal in every variant: {_some(same)}.")
    paragraphs("They agree within their estimated errors." if found.agree else "They differ.")
    if not found.agree and not (found.statuses or found.only_in_one or any(one.beyond for one in apart)):
        without = _some([one.name for one in apart if one.unknown])
        paragraphs(f"Wherever errors are told they explain it; none is told of {without}, whose differences count.")
    blurred = [one.name for one in apart if one.blurred and not one.beyond]
    if blurred:
        paragraphs(
            f"Of {listed(blurred)} told errors are larger than the values, so that lying within them says nothing."
        )


def _quantities(found: Difference, *values: float) -> Iterator[str]:
    """Values of a result with their unit."""
    return (quantity(value, found.units) for value in values)


def _beside(found: Difference) -> Iterator[str]:
    """How far both values of a result are apart where they differ most (0: rounding beside its largest), and its errors
    together there."""
    yield quantity(found.largest, found.units, beside=max(map(abs, found.extremes)))
    yield quantity(found.allowed, found.units, 2) if math.isfinite(found.allowed) else "unknown"


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
        if status is Status.TOLERANCE_MISSED and kind_named(results.study.kind).missed(results):
            continue
        if (count := counts.get(label(status), 0)) and status != Status.OK:
            part = "as the study expects, " if label(status) in expected else ""
            most, helps = (missed_most(results), remedy(results)) if status is Status.TOLERANCE_MISSED else ("", "")
            many = f"{counted(count, noun)} of {sum(counts.values()):,} {label(status)}"
            also = _opened_besides(results, count) if status is Status.SEPARATED else ""
            yield f"{many}: {part}{status.message}{most}.{also}{helps}"


def _opened_besides(results: Results, told: int) -> str:
    """In how many variants more than their status tells a contact opens, as it tells the gravest alone."""
    more = int((results.kept.values & ~results.held).sum()) - told
    return f" So it is in {counted(more, 'variant')} more, whose status tells something else first." if more > 0 else ""


def _about_work(outcome: Outcome) -> str:
    from studies.reporting import summary

    variants = counted(sum(summary.counts(outcome.results).values()), summary.noun(outcome.results))
    if outcome.was_finished:
        return f"{outcome.archive} held the finished results of this study: nothing to do"
    resumed = f"{outcome.resumed:,} of them" if is_marched(outcome.results) else counted(outcome.resumed, "piece")
    earlier = f", {resumed} finished by an earlier start" if outcome.resumed else ""
    return f"{outcome.archive}: {variants} in {number(outcome.seconds)} s{earlier}"


def _some(names: Sequence[str]) -> str:
    """Names as far as they fit into some lines, and how many more there are.

    >>> _some(["midspan_max"] * 3), len(_some(["midspan_max"] * 40))
    ('midspan_max, midspan_max, midspan_max', 309)
    """
    fitting = [name for place, name in enumerate(names) if len(", ".join(names[: place + 1])) <= LONGEST_LIST]
    more = len(names) - len(fitting)
    return f"{', '.join(fitting)}{f' and {more} more' if more else ''}"


def _line(value: Any) -> str:
    """An attribute on one line; of a long text only how long it is."""
    if isinstance(value, str) and "\n" in value:
        return f"a text of {value.count(chr(10)) + 1} lines"
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
