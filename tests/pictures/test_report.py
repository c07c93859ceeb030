"""The report: one page that stands by itself, honest and safe whatever the study file holds."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
import xarray as xr

from results_schema.errors import ArchiveError, BadInput, OutputFailed
from results_schema.status import Status
from results_schema.store import files
from results_schema.store.archive import SCHEMA_VERSION, write_archive
from studies.reporting import answers
from studies.reporting.report import PAGE, write_report
from studies.reporting.summary import Extreme, Range, every
from studies.results.results import Results
from tests.schema.samples import FailNth
from tests.studies import scenes

KINDS = tuple(scenes.MOTIONS)
MINUS = "\N{MINUS SIGN}"
HOSTILE = "<script>alert(1)</script> {{7*7}} {% raw %} $x_1$ ../../x\nnew --> line & \"q\" 'a'"


def archive(folder: Path, dataset: xr.Dataset) -> Path:
    """An archive of a dataset, with the attributes that the command gives it."""
    attributes = {
        "Conventions": "CF-1.11",
        "history": "made by a test",
        "schema_version": SCHEMA_VERSION,
        "packages": ["numpy 2", "scipy 1"],
        "run_seconds": 1.25,
    }
    path = folder / "study.nc"
    write_archive(path, dataset.assign_attrs(attributes))
    return path


class Reader(HTMLParser):
    """Tags with their attributes, and the text between them."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "br", "wbr", "link", "img"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] != "style":
            self.text += data


def check_standing_alone(page: str) -> Reader:
    """No script, nothing from outside, every tag closed; what it links to is inside."""
    reader = Reader(page)
    assert reader.open == []
    for tag, attributes in reader.tags:
        assert tag not in ("script", "link", "img", "iframe", "object", "base", "form")
        for name, value in attributes.items():
            assert not name.startswith("on")
            if name in ("src", "href", "xlink:href", "action"):
                assert value is not None and value.startswith(("#", "data:image/png"))
    assert not re.search(r"url\((?!['\"]?#)|@import|javascript:", page)
    return reader


def plain(text: str) -> str:
    """Text with simple minus signs and simple spaces."""
    return " ".join(text.replace(MINUS, "-").split())


@pytest.mark.parametrize("kind", KINDS)
def test_report_of_every_kind(kind: str, tmp_path: Path) -> None:
    sweep = scenes.pace(kind) if scenes.PACE[kind] else 'mass = { of = "carriage.table.mass", values = [1, 2] }'
    dataset = scenes.run(kind, sweep)
    page = write_report(archive(tmp_path, dataset), tmp_path / "out")
    assert page == tmp_path / "out" / PAGE
    reader = check_standing_alone(page.read_text(encoding="utf-8"))
    drawn = answers.figures(dataset)
    assert sum(tag == "svg" for tag, _ in reader.tags) == len(drawn) > 0
    shown = plain(reader.text)
    for figure in drawn:
        assert plain(figure.title) in shown and plain(figure.caption) in shown
        for ending, start in ((".svg", b"<?xml"), (".png", b"\x89PNG")):
            (file,) = page.parent.glob(f"*-{figure.name}{ending}")
            assert file.read_bytes().startswith(start)
    for sentence in answers.answer(dataset):
        words = sentence.partition(": ")[2] or sentence
        assert plain(words) in shown
    for name in dataset.data_vars:
        assert str(name) in reader.text
    for text in ("midspan", "210 GPa", "numpy 2, scipy 1", "1.25 s", str(dataset.attrs["study_sha256"])):
        assert text in reader.text


def test_the_page_opens_with_six_figures_at_most_and_folds_methods(tmp_path: Path) -> None:
    sweep = f'{scenes.pace("double-peak")}\nmass = {{ of = "carriage.table.mass", values = [50, 100, 200] }}'
    dataset = scenes.run("double-peak", sweep, extra="[output]\npercentiles = [5, 50]")
    found = answers.figures(dataset)
    text = write_report(archive(tmp_path, dataset), tmp_path / "out").read_text(encoding="utf-8")
    unfolded = re.sub(r"<details.*?</details>", "", text, flags=re.DOTALL)
    assert unfolded.count("<figure id=") == min(6, sum(not figure.on_method for figure in found))
    assert text.count("<figure id=") == len(found) and any(figure.on_method for figure in found)
    assert "by status" not in text and "without values" not in text  # all are fine, as the facts say
    assert "<h2>Answer</h2>" in unfolded and "How exact, and how it was computed" not in unfolded
    assert "<th>5 %</th><th>50 %</th>" in unfolded
    # a value and its error break between them alone, and stand beside the sensor that they are of
    assert re.search(r"<td>dynamic_<wbr>amplification<span class=.at.>midspan</span></td>", unfolded)
    assert re.search(r"<td>[\d.]+\N{NO-BREAK SPACE}mm ±\N{NO-BREAK SPACE}[\d.]+\N{NO-BREAK SPACE}.m<span", unfolded)
    for table in re.findall(r"<tbody>(.*?)</tbody>", unfolded, flags=re.DOTALL):
        assert table.count("<tr>") <= 10


@pytest.mark.fault(39)
@pytest.mark.parametrize("kind", ["passage", "double-peak"])
def test_hostile_titles_are_text(kind: str, tmp_path: Path) -> None:
    page = write_report(archive(tmp_path, scenes.run(kind, title=HOSTILE)), tmp_path / "out")
    text = page.read_text(encoding="utf-8")
    reader = check_standing_alone(text)
    assert HOSTILE in reader.text and "{{7*7}}" in text and "&lt;script&gt;" in text
    names = sorted(path.name for path in page.parent.iterdir())
    assert all(re.fullmatch(r"\d\d-[a-z0-9-]+\.(svg|png)|report\.html", name) for name in names)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "study.nc"]


@pytest.mark.fault(18)
def test_failed_variants_are_counted_with_their_message(tmp_path: Path) -> None:
    dataset = scenes.with_failures(scenes.run("passage", scenes.pace("passage")), 2)
    page = write_report(archive(tmp_path, dataset), tmp_path / "out")
    reader = check_standing_alone(page.read_text(encoding="utf-8"))
    assert "what swings grew beyond all numbers, by itself or by steps that are too long; no values" in reader.text
    assert "2 diverged (left out)" in reader.text
    assert not re.search(r"\bnan\b", reader.text.replace("NaN where", ""))


def test_the_same_archive_gives_the_same_page(tmp_path: Path) -> None:
    source = archive(tmp_path, scenes.run("passage"))
    pages = [write_report(source, tmp_path / "out").read_bytes() for _ in range(2)]
    assert pages[0] == pages[1]


def test_figures_of_an_earlier_report_are_removed_and_nothing_else(tmp_path: Path) -> None:
    found = []
    for extra in (scenes.pace("passage"), ""):
        write_report(archive(tmp_path, scenes.run("passage", extra)), tmp_path / "out")
        found.append({path.name for path in (tmp_path / "out").iterdir()})
        for name in ("01-own.svg", "99-own.png", "notes.txt"):
            (tmp_path / "out" / name).touch()
    assert {"01-own.svg", "99-own.png", "notes.txt"} <= found[1]
    earlier = {name for name in found[0] if name[:2].isdecimal()}
    page = (tmp_path / "out" / PAGE).read_text(encoding="utf-8")
    kept = {name for name in earlier if f'<figure id="{name[:-4]}">' in page}
    assert earlier - kept and not (earlier - kept) & found[1]


def test_places_that_cannot_be_written_are_refused_before_anything_is_drawn(tmp_path: Path) -> None:
    source = archive(tmp_path, scenes.run("passage"))
    with pytest.raises(BadInput, match="no such file"):
        write_report(tmp_path / "nothing.nc", tmp_path / "out")
    with pytest.raises(BadInput, match="folder is a file"):
        write_report(source, source)
    with pytest.raises(BadInput, match="does not exist"):
        write_report(source, tmp_path / "a" / "b")
    assert not (tmp_path / "out").exists()


def test_a_damaged_archive_is_refused(tmp_path: Path) -> None:
    source = archive(tmp_path, scenes.run("passage"))
    content = source.read_bytes()
    source.write_bytes(content[: len(content) // 2])
    with pytest.raises(ArchiveError, match=str(source)):
        write_report(source, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.fault(26)
def test_a_full_disk_leaves_no_half_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = archive(tmp_path, scenes.run("passage", scenes.pace("passage")))
    monkeypatch.setattr(files, "FAULTS", FailNth(3, lambda operation, path: operation == "write"))
    with pytest.raises(OutputFailed, match="No space left"):
        write_report(source, tmp_path / "out")
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert len(written) == 2 and PAGE not in written


def test_errors_beneath_the_digits_of_a_value_are_not_told() -> None:
    def end(error: float) -> Extreme:
        return Extreme(31.83, {}, {}, error)

    found = Range("frequency", "", "Hz", end(3e-7), end(1e-2))
    assert [found.said(one, 4) for one in (found.smallest, found.largest)] == ["31.83 Hz", "31.83 Hz ± 0.01 Hz"]


@pytest.mark.parametrize(("lost", "words"), [(0, "every variant"), (2, "all 2 variants with values")])
def test_what_is_the_same_is_so_in_the_variants_that_have_values(lost: int, words: str, tmp_path: Path) -> None:
    """Of four, every second one lost."""
    dataset = scenes.run("passage", scenes.pace("passage"))
    dataset["midspan_max"].values[:] = 1e-3
    dataset = scenes.with_failures(dataset, 2) if lost else dataset
    page = write_report(archive(tmp_path, dataset), tmp_path / "report").read_text(encoding="utf-8")
    assert f"in {words}" in page.replace("\N{NO-BREAK SPACE}", " ")
    dataset["status"].values[:3] = Status.DIVERGED
    assert every(Results.of(dataset)) == "the one variant with values"
    dataset["status"].values[:] = Status.DIVERGED
    assert every(Results.of(dataset)) == "every variant"
