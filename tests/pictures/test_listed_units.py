"""Numbers of the study file in reports have their units once."""

from pathlib import Path

from studies.reporting.report import write_report
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
