"""The documentation tells the truth: its table of results, its examples, its links."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import studies
from engine.batch.plan import make_plan
from engine.scene.study import load
from studies.commands import catalogue
from studies.protocol.study import kind_of
from tests import gallery
from tests.readme import README


def test_the_table_of_results_is_the_declarations() -> None:
    """In a process of its own: tests declare kinds too."""
    made = "import tests.readme as r; t = r.RESULTS.read_text(); import sys; sys.exit(t != r.with_declarations(t))"
    finished = subprocess.run([sys.executable, "-c", made], cwd=README.parent, check=False)
    assert finished.returncode == 0, "run: python -m tests.readme"


def pages() -> list[Path]:
    return [README, *sorted(README.parent.glob("docs/*.md"))]


def examples(language: str) -> list[tuple[str, str]]:
    """All blocks of a language, with the page that each stands on."""
    return [
        (page.name, block)
        for page in pages()
        for block in re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.S)
    ]


def test_the_gallery_shows_every_built_in_study() -> None:
    page = (README.parent / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert page == gallery.page(), "run: python -m tests.gallery NAME"
    measured = catalogue.measured()
    assert set(gallery.shown()) == set(measured)
    assert all(made["code"] == 0 for made in measured.values())


def test_links_lead_somewhere() -> None:
    for page in pages():
        text = page.read_text(encoding="utf-8")
        heads = {
            re.sub(r"[^\w -]", "", head).strip().lower().replace(" ", "-")
            for head in re.findall(r"^#+ (.*)", text, re.M)
        }
        for link in re.findall(r"\]\(([^)]+)\)", text):
            path, _, anchor = link.partition("#")
            assert link.startswith("http") or (page.parent / path).exists(), f"{page.name}: {link}"
            assert path or anchor in heads, link


def test_the_readme_leads_to_every_page() -> None:
    linked = set(re.findall(r"\]\(docs/([^)#]+)\)", README.read_text(encoding="utf-8")))
    assert linked == {page.name for page in pages()[1:]}


def test_the_readme_is_two_screens() -> None:
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 100


def test_study_files_run() -> None:
    whole = [load(block) for _, block in examples("toml") if "schema_version" in block]
    marched = [study for study in whole if not study.frame and not study.robot]
    sizes = [make_plan(s, reduction=kind_of(s).reduction(s), results=s.kind).size for s in marched]
    assert sizes == [160, 1, 122, 1, 1, 6, 5, 81, 156, 8]
    (moving,) = (study for study in whole if study.frame)
    assert studies.run(moving)["status"].size == 1


def test_the_jib_sinks_as_by_hand() -> None:
    """Its own bending, and the turn and shortening of the column, whose sides `up` turns; the arm is at its face."""
    (jib,) = (load(block) for _, block in examples("toml") if "[body.jib]" in block)
    weight, youngs = 500.0 * 9.80665, 2.1e11
    for up, second_moment in (([1, 0, 0], 4e-5), ([0, 1, 0], 1e-5)):
        given = jib.with_values({"body.jib.member.column.up": up, "solver.fidelity": "static"})
        found = studies.run(given)
        bends, turns = weight * 2.0**3 / (3.0 * youngs * 2e-5), 2.3**2 * weight * 3.0 / (youngs * second_moment)
        assert float(found.end_max) == pytest.approx(bends + turns + weight * 3.0 / (youngs * 0.01), rel=1e-9)
        assert float(found.foot_max) == pytest.approx(weight, rel=1e-9)


def test_the_pier_of_two_spans_carries_what_it_does_by_hand() -> None:
    """By the theorem of three moments, for a force at any place of a bridge of two spans a and b."""
    (bridge,) = (load(block) for _, block in examples("toml") if "pier = [32, 0]" in block)
    found = studies.run(bridge.with_values({"solver.fidelity": "static"}))
    a, b, places = 32.0, 24.0, np.linspace(0.0, 1.0, 100_001)
    carried = [
        x / own + x * (own**2 - x**2) / (2.0 * own * (a + b)) * (1.0 / a + 1.0 / b)
        for own in (a, b)
        for x in [own * places]
    ]
    assert float(found.pier_max) == pytest.approx(30e3 * np.max(carried), rel=1e-4)
    assert np.max(carried) > 1.01


def test_the_load_on_a_rope_swings_as_a_pendulum() -> None:
    """What is left after a stop: 4 a/w^2 |sin(w t/2) sin(w T/2)|, t to reach the speed and T to begin to stop."""
    (crane,) = (load(block) for _, block in examples("toml") if "[arm.hoist]" in block)
    found = studies.run(crane)
    for scale, swing in zip(found.acceleration.values, found.error_holding.sel(robot="trolley").values, strict=True):
        speed = min(1.25, np.sqrt(10.0 * scale))
        omega = np.sqrt(9.81 / 6.0)
        left = np.sin(0.5 * omega * speed / scale) * np.sin(0.5 * omega * 10.0 / speed)
        assert swing == pytest.approx(4.0 * scale / omega**2 * abs(left), rel=0.03, abs=1e-3)


def test_pieces_of_study_files_are_toml() -> None:
    assert all(tomllib.loads(block) for _, block in examples("toml"))


def test_the_python_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One after another, those after the first with its study as the file that they load."""
    monkeypatch.chdir(tmp_path)
    first, *others = [block for page, block in examples("python") if page == "python.md"]
    lines = [line for line in first.splitlines() if "engine.load" not in line and not line.endswith(".plot()")]
    names: dict[str, Any] = {}
    exec("\n".join(lines), names)
    assert names["ds"].dynamic_amplification.sel(sensor="midspan", mass=100).shape == (40,)
    for block in others:
        exec(block, names)
    assert Path("my-study.nc").exists() and Path("my-report/report.html").exists()
    assert 0.0 < names["both"].midspan_max.std("scheme").max() < 1e-4
    assert names["ds"].peaks_per_cycle.values.ravel().tolist() == [2, 1, 2]
    assert names["spectrum"].dims == ("train", "speed") and (names["spectrum"].diff("train") > 1e-3).all()


def test_every_folder_of_code_is_told_of() -> None:
    text = (README.parent / "docs" / "structure.md").read_text(encoding="utf-8")
    folders = {path.parent.relative_to(README.parent).as_posix() for path in README.parent.glob("*/**/*.py")}
    rooms = {folder for folder in folders if folder.startswith(("results_schema", "engine/", "studies/"))}
    assert {
        folder for folder in rooms if not folder.startswith("engine/bodies/") and f"`{folder}/`" not in text
    } == set()


def test_results_over_the_static_range_say_what_it_is() -> None:
    page = (README.parent / "docs" / "results.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if "static range R" in line]
    assert {line.split("`")[1] for line in rows} == {"loop_area", "odd_rms", "even_excess"}
    meaning = "the largest minus the smallest static value of the sensor while the carriage is on the cruise part"
    assert all(meaning in line or "R, as in `loop_area`" in line for line in rows)
