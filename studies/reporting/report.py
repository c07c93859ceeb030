"""The report of an archive: one page that stands by itself, and its figures as files.

The page holds everything: figures as inline SVG, its style, no script, nothing from outside. What comes from a study's
file is text, escaped in the page and drawn as it stands in figures.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from markupsafe import Markup, escape

from engine.study_file.document import Beside
from results_schema.errors import BadInput
from results_schema.lazy_imports import xr
from results_schema.status import Status, label
from results_schema.store import files
from results_schema.store.archive import Archive, open_archive
from results_schema.variables import Variable, expand
from studies.findings.numerics_used import told_choices
from studies.pictures.common import estimates, unreduced
from studies.pictures.common.figures import png, svg
from studies.protocol.study import kind_named
from studies.reporting.answers import figures_of, found_of
from studies.reporting.side_by_side import side_by_side
from studies.reporting.summary import every, in_tables, left_out, noun
from studies.results.axes import Axis
from studies.results.formatting import counted, number, unit_text
from studies.results.results import Results
from studies.runs import audit
from studies.runs.archived import results_of
from studies.runs.audit_findings import told_accuracy, told_audit
from studies.runs.datasets import archive_of
from studies.runs.unreduced import GROUP, told_unreduced

if TYPE_CHECKING:
    from jinja2 import Template

    from engine.scene.study import Study

PAGE = "report.html"
TEMPLATES = Path(__file__).parent / "templates"
LONG_TEXT = 120
UNIT = re.compile(  # the space between a number and its unit, and that within N m
    r"(?<=\d) (?=(?:%|[nµmkMG]?(?:m|N|Pa|Hz|s|g|J|rad|t)(?![a-z])))|(?:(?<=\d [nµmkMG]N)|(?<=\d N)) (?=m(?![a-z]))"
)
SENTENCE = re.compile(r"(?<=\.) (?=[A-Z])")  # between two sentences
MOST_OPEN = 6  # figures of the question that stand unfolded


class Row(NamedTuple):
    """A name, what it is, and a remark."""

    name: str
    value: str
    remark: str = ""


class Drawn(NamedTuple):
    """A figure as it stands in the page; files: its plain name, to which .svg and .png belong."""

    number: int
    title: str
    caption: str
    files: str
    svg: str


@dataclass(frozen=True)
class Finding:
    """A statement of the answer; subject: the sensor, carriage or envelope that it is about, or "". more: the sentences
    behind its first one, where this stands alone."""

    subject: str
    text: str
    more: str = ""


def write_report(archive: Path | str, folder: Path | str) -> Path:
    """Write the page of an archive and its figures (SVG and PNG) into a folder; the page's path.

    Raises BadInput (no such archive, no such place) and ArchiveError before anything is written, and OutputFailed.
    """
    folder = Path(folder)
    check_folder(folder, PAGE)
    return _write(open_archive(archive), folder)


def report(dataset: xr.Dataset, folder: Path | str, study: Study | None = None) -> Path:
    """Write the page of a dataset of `studies.run` as `write_report` does that of an archive; the page's path.

    study: as of `studies.write`. Raises BadInput and OutputFailed.
    """
    folder = Path(folder)
    check_folder(folder, PAGE)
    return _write(archive_of(dataset, folder.name, study), folder)


def _write(source: Archive, folder: Path) -> Path:
    results = results_of(source)
    figures = [
        *figures_of(results),
        *estimates.observed(results, source.groups.get(audit.GROUP)),
        *estimates.compared(source.groups.get(audit.GROUP)),
        *unreduced.pictures(results, source.groups.get(GROUP)),
    ]
    drawn = [
        Drawn(place, figure.title, figure.caption, f"{place:02d}-{figure.name}", svg(figure))
        for place, figure in enumerate(figures, 1)
    ]
    page = page_of(source, results, drawn, sum(not figure.on_method for figure in figures))
    text = page_template(PAGE).render(page=page)
    files.make_folder(folder)
    files.check_output_place(folder / PAGE)
    for figure, one in zip(figures, drawn, strict=True):
        files.write_text(folder / f"{one.files}.svg", f'<?xml version="1.0" encoding="utf-8"?>\n{one.svg}')
        files.write_whole(folder / f"{one.files}.png", partial(Path.write_bytes, data=png(figure)))
    for name in _figures_of(folder / PAGE) - {one.files for one in drawn}:
        for ending in (".svg", ".png"):
            files.remove_file(folder / f"{name}{ending}")
    files.write_text(folder / PAGE, text)
    return folder / PAGE


def _figures_of(page: Path) -> set[str]:
    """The plain names of the figures of an earlier report, which are ours as its page names them."""
    with suppress(OSError):
        return set(re.findall(r'<figure id="(\d+-[\w-]+)">', page.read_text(encoding="utf-8", errors="replace")))
    return set()


def page_of(source: Archive, results: Results, drawn: Sequence[Drawn], of_question: int) -> SimpleNamespace:
    """Everything that the template shows of an archive, plain text but for the drawings; of these so many of the
    question come before those on methods.

    figures, more_figures: of the question, open and folded. accuracy: in one sentence; exactness, method_figures: how
    exact the answer is and how it was computed, folded.
    """
    kind = kind_named(results.study.kind)
    open_figures = min(of_question, MOST_OPEN)
    findings = [_finding(results, text) for text in found_of(results)]
    return SimpleNamespace(
        title=results.study.title or str(source.root.attrs.get("title", "")) or kind.name,
        question=kind.question,
        noun=noun(source.root),
        facts=_facts(results, noun(source.root)),
        lead=_lead(findings[0]) if findings else None,
        findings=findings[1:],
        accuracy=_sentence(told_accuracy(source.groups.get(audit.GROUP), results)),
        exactness=_exactness(source, results),
        figures=drawn[:open_figures],
        more_figures=drawn[open_figures:of_question],
        method_figures=drawn[of_question:],
        statuses=_statuses(results),
        left_out=left_out(results),
        scene=_scene(results),
        sweep=_sweep(results),
        results=_results(results),
        beside=side_by_side(results, in_tables(results)),
        percentiles=[f"{value:g} %" for value in results.percentiles],
        declarations=_declarations(results),
        provenance=_provenance(source),
        study_text=results.study.source.text,
    )


def _exactness(source: Archive, results: Results) -> list[str]:
    """What every variant took, what the audit says, and the comparison with the unreduced model, as sentences."""
    audited = [f"{_sentence(text)}." for text in told_audit(source.groups.get(audit.GROUP), results)]
    return [*told_choices(results), *audited, *told_unreduced(source.groups.get(GROUP))]


def _sentence(text: str) -> str:
    """Text with a capital letter."""
    return f"{text[:1].upper()}{text[1:]}"


def page_template(name: str) -> Template:
    """The template of a page that stands by itself."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"soft": _soft, "minus": _minus, "coded": _coded, "unbroken": _unbroken}
    return environment.get_template(name)


def _soft(text: str) -> Markup:
    """A name or key that may break after an underscore and a dot."""
    return Markup(re.sub(r"(_|\.(?=\w))", r"\1<wbr>", str(escape(text))))


def _minus(text: str) -> str:
    """Numbers with a true minus sign, and on one line with their unit.

    >>> _minus("-1.5 kN m at 12 % of 3 m/s, 2 modes").replace("\N{NO-BREAK SPACE}", "_").replace("\N{MINUS SIGN}", "~")
    '~1.5_kN_m at 12_% of 3_m/s, 2 modes'
    """
    text = re.sub(r"(?<![\w.-])-(?=\d)", "\N{MINUS SIGN}", text)
    return UNIT.sub("\N{NO-BREAK SPACE}", text)


def _coded(text: str) -> Markup:
    """What stands between back-ticks as code.

    >>> print(_coded("a `tolerance < 1` on <b>, ` alone"))
    a <code>tolerance &lt; 1</code> on &lt;b&gt;, ` alone
    """
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def _unbroken(text: str) -> str:
    """A value that breaks between it and its error alone; lines end behind hyphens, but not at a minus sign.

    >>> _unbroken("1.5 kN m ± 2e-5 N m").replace("\N{NO-BREAK SPACE}", "_").replace("\N{MINUS SIGN}", "~")
    '1.5_kN_m ±_2e~5_N_m'
    """
    text = re.sub(r"(?<=\de)-(?=\d)", "\N{MINUS SIGN}", text)
    return text.replace(" ", "\N{NO-BREAK SPACE}").replace("\N{NO-BREAK SPACE}±", " ±")


def check_folder(folder: Path, page: str) -> None:
    """Raise BadInput where a page cannot be written into a folder."""
    if folder.exists() and not folder.is_dir():
        raise BadInput("the page's folder is a file", where=str(folder), expected="a folder", received="a file")
    if not folder.parent.is_dir():
        raise BadInput("the folder above the page's does not exist", where=str(folder.parent), remedy="create it first")
    files.check_output_place((folder if folder.exists() else folder.parent) / page)


def _facts(results: Results, noun: str) -> list[Row]:
    """The run in a line."""
    known = {Status.OK: 0} | results.status_counts
    statuses = [Row(f"status {label(status)}", f"{count:,}") for status, count in known.items()]
    counts = [Row(f"{noun}s", f"{results.variants:,}"), *statuses]
    return [Row("kind of study", results.study.kind), *(counts if results.size > 1 or _statuses(results) else ())]


def _finding(results: Results, text: str) -> Finding:
    subject, colon, rest = text.partition(": ")
    if colon and subject in (*results.sensors, *results.study.carriage, *results.envelopes):
        return Finding(subject, rest)
    return Finding("", text)


def _lead(first: Finding) -> Finding:
    """The first statement with its first sentence alone: what stands in large letters is short."""
    text, *more = SENTENCE.split(first.text, 1)
    return replace(first, text=text, more="".join(more))


def _statuses(results: Results) -> list[Row]:
    """How many have which status; nothing where all are well, which the facts say."""
    if set(results.status_counts) == {Status.OK}:
        return []
    return [Row(label(status), f"{count:,}", status.message) for status, count in results.status_counts.items()]


def _scene(results: Results) -> dict[str, list[Row]]:
    """The tables of the study file as they were written, by heading; the sweep has its own table."""
    swept = {path: name for name, axis in results.study.sweep.axes.items() for path in axis.of}
    found: dict[str, list[Row]] = {}
    for name, value in results.study.data.items():
        if name in ("sweep", "schema_version", "title", "kind"):
            continue
        if name in ("body", "train", "carriage", "sensor", "envelope"):
            for own, table in value.items():
                found[f"{name} {own}"] = _rows(results, f"{name}.{own}", table, swept)
        elif isinstance(value, dict):
            found[name] = _rows(results, name, value, swept)
        else:
            found.setdefault("whole scene", []).append(_row(results, name, value, swept))
    return found


def _rows(results: Results, here: str, table: Mapping[str, Any], swept: Mapping[str, str]) -> list[Row]:
    """Leaves of a table; what lies deeper is named with a dot."""
    found = []
    for key, value in table.items():
        path = f"{here}.{key}"
        if isinstance(value, Beside):
            continue
        if isinstance(value, dict):
            inner = _rows(results, path, value, swept)
            found += [row._replace(name=f"{key}.{row.name}") for row in inner]
        else:
            found.append(_row(results, path, value, swept))
    return found


def _row(results: Results, path: str, value: Any, swept: Mapping[str, str]) -> Row:
    text = _in_words(results, path, value)
    remark = f"swept: {swept[path]}" if path in swept else ""
    return Row(path.rsplit(".", 1)[-1], text if len(text) <= LONG_TEXT else f"{text[: LONG_TEXT - 1]}…", remark)


def _in_words(results: Results, path: str, value: Any) -> str:
    """A value of the study file with its unit, which texts have already; what is listed with those of its own."""
    if isinstance(value, list | tuple) and any(isinstance(item, dict) for item in value):
        return "; ".join(_in_words(results, f"{path}.{place}", item) for place, item in enumerate(value))
    if isinstance(value, list | tuple) and any(isinstance(item, str) for item in value):
        return ", ".join(_in_words(results, path, item) for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {_in_words(results, f'{path}.{key}', item)}" for key, item in value.items())
    if isinstance(value, str):
        return value
    try:
        unit = results.study.unit(path)
    except (KeyError, ValueError, TypeError):
        unit = None
    return f"{_plain(value)} {unit_text(unit.symbol) if unit is not None else ''}".strip()


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ", ".join(map(_plain, value))
    return number(value, 9) if isinstance(value, float) else str(value)


def _sweep(results: Results) -> list[Row]:
    """Every swept number with its span, those too along which an archive of cells has no results."""
    from engine.scene.sweep import expand

    found = []
    for one in expand(results.study).axes if results.study.sweep.axes else ():
        axis = Axis.of_scene(results.study, one)
        found.append(Row(axis.noun, f"{axis.span}, {counted(axis.values.size, 'value')}", ", ".join(one.of)))
    return found


def _results(results: Results) -> list[tuple[str, ...]]:
    """Name, sensor, smallest and largest with their errors and places, and percentiles, of the results that answer."""
    rows: list[tuple[str, ...]] = []
    for found in in_tables(results):
        both = (found.smallest, found.largest)
        ends, alike = [found.said(end, 4) for end in both], found.is_constant and results.size > 1
        low, high = ((found.partly or f"in {every(results)}") if alike else end.where for end in both)
        between = [found.value(value, 4) for value in found.percentiles]
        rows.append((found.name, found.sensor, ends[0], low, ends[1], high, *between))
    return rows


def _declarations(results: Results) -> list[tuple[str, ...]]:
    """Name, dimensions, unit and meaning of every variable in the archive."""
    declared = expand(results.study.results_kind, results.sensors, tuple(results.study.carriage), results.envelopes)
    names = [str(name) for name in results.dataset.data_vars]
    return [_declaration(results, declared[name]) for name in names if name in declared]


def _declaration(results: Results, variable: Variable) -> tuple[str, ...]:
    own = tuple(map(str, results.dataset[variable.name].dims))
    swept = own[: len(results.dims)] == results.dims
    dims = ", ".join(("variant", *own[len(results.dims) :]) if swept else own)
    units = "" if variable.flags is not None else unit_text(str(results.dataset[variable.name].attrs.get("units", "1")))
    words = variable.long_name + (f": {variable.meaning}" if variable.meaning else "")
    return (variable.name, dims, units, words)


def _provenance(source: Archive) -> list[Row]:
    """Root attributes that say where the numbers come from; the study's text has its own place."""
    wanted = {
        "history": "made by",
        "study_sha256": "study file, SHA-256",
        "study_files": "files of the model, SHA-256",
        "results_key": "study, files and program",
        "packages": "packages",
        "python": "Python",
        "machine": "machine",
        "run_seconds": "run time",
        "Conventions": "conventions",
        "schema_version": "schema",
    }
    found = [Row("archive", source.path.name)] * source.path.is_file()  # none of a dataset
    for key, words in wanted.items():
        if key in source.root.attrs:
            found.append(Row(words, _attribute(key, source.root.attrs[key])))
    return found


def _attribute(key: str, value: Any) -> str:
    if isinstance(value, str):
        return value
    parts = [value] if np.ndim(value) == 0 else list(value)
    text = ", ".join(part if isinstance(part, str) else number(float(part), 6) for part in parts)
    return f"{text} s" if key == "run_seconds" else text
