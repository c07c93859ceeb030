"""Texts of pages: numbers with their units once and on one line, and what is printed of what is folded."""

import re
from pathlib import Path

from results_schema.status import Status
from studies.reporting import answers
from studies.reporting.drawing import write_drawing
from studies.reporting.report import _unbroken, write_report
from tests.pictures.test_report import archive, check_standing_alone, plain
from tests.studies import scenes

TRAIN = """\
[train.tram]
on = "bed"
kind = "oscillator"
mass = ["50 kg", 0.2]
stiffness = ["2 kN/m", "3 kN/m"]
damping = [30, 45]
spacing = ["2.4 m"]
motion = { kind = "cruise", start = 0.0, end = 10.0, speed = "30 km/h" }
"""


def test_listed_numbers_have_their_units_once(tmp_path: Path) -> None:
    page = write_report(archive(tmp_path, scenes.run("passage", extra=TRAIN)), tmp_path / "out")
    shown = plain(check_standing_alone(page.read_text(encoding="utf-8")).text)
    for text in ("mass50 kg, 0.2 kg", "stiffness2 kN/m, 3 kN/m", "damping30, 45 N s/m", "spacing2.4 m motion"):
        assert text in shown
    assert "kg kg" not in shown and "N/m N/m" not in shown


def test_on_paper_accuracy_is_printed_and_the_study_file_is_not(tmp_path: Path) -> None:
    """By the style of the page alone, where the browser knows how; drawings have no last page for a folded line."""
    dataset = scenes.run("passage", scenes.pace("passage"))
    text = write_report(archive(tmp_path, dataset), tmp_path / "out").read_text(encoding="utf-8")
    by_name = {name: how for how, name in re.findall(r'<details(?: class="(\w+)")?>\n<summary>([A-Z][\w ]+\w)', text)}
    assert by_name["How exact"] == by_name["Where the numbers come from"] == "printed"
    assert by_name["The study file"] == by_name["What the archive holds"] == "screen"
    drawing = write_drawing(scenes.study("passage"), tmp_path / "drawing").read_text(encoding="utf-8")
    assert '<details class="screen">\n<summary>The study file' in drawing
    paper = text.partition("@media print")[2].partition("</style>")[0]
    assert "details.screen { display: none; }" in paper and "details.printed::details-content" in paper
    assert "max-width: 150mm" not in paper


def test_lines_do_not_end_within_numbers() -> None:
    """A hyphen would be such a place, a minus sign is none."""
    assert "-" not in _unbroken("0.5 m/s² ± 1.9e-5 m/s²") and "e-x" in _unbroken("pipe-x")


def test_keys_in_sentences_are_set_as_code(tmp_path: Path) -> None:
    """Escaped as the rest of the text, of answers and of the meanings of results."""
    given = scenes.run("passage", scenes.pace("passage"))
    given["status"][:] = Status.TOLERANCE_MISSED
    told = [text for text in answers.answer(given) if "`" in text]
    page = write_report(archive(tmp_path, given), tmp_path / "out").read_text(encoding="utf-8")
    body = page.partition("<h2>")[2].partition("<pre>")[0]
    assert told and "`" not in body and "instants of <code>elapsed</code>" in page
    assert re.search(r"<code>(solver\.tolerance|tolerance = (&#34;told&#34;|0\.\d+))</code>", body)
