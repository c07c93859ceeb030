"""Kinds of study that other packages bring: the documentation's example, installed and run."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "extending.md"


OTHER = """\
class K:
    name = "other"
    summary = question = start = ""
    check = findings = figures = None
KIND = K()
"""


def blocks(language: str) -> str:
    (found,) = re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    return str(found)


@pytest.fixture
def packages(tmp_path: Path) -> Path:
    """A folder with the example as an installed package."""
    home = tmp_path / "packages"
    info = home / "static_share-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: static-share\nVersion: 1.0\n")
    (line,) = [line for line in blocks("toml").splitlines() if "=" in line]
    (info / "entry_points.txt").write_text("[wanderlast.kinds]\n" + line.replace('"', "") + "\n")
    (home / "static_share.py").write_text(blocks("python"))
    return home


def wanderlast(packages: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(packages), str(ROOT)])
    return subprocess.run(
        [sys.executable, "-m", "studies", *arguments],
        cwd=packages.parent,
        env=os.environ | {"PYTHONPATH": path, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_commands_know_it(packages: Path) -> None:
    assert "static-share" in wanderlast(packages, "list").stdout
    assert wanderlast(packages, "init", "static-share", "mine.toml").returncode == 0
    assert wanderlast(packages, "check", "mine.toml").returncode == 0
    run = wanderlast(packages, "run", "mine.toml")
    assert run.returncode == 0, run.stderr
    with xr.open_dataset(packages.parent / "mine.nc") as found:
        share = found["static_share"].values
        assert ((share > 0.3) & (share <= 1.0 + 1e-6)).all()
    report = wanderlast(packages, "report", "mine.nc")
    assert report.returncode == 0, report.stderr
    page = (packages.parent / "mine-report" / "report.html").read_text(encoding="utf-8")
    assert "of the largest reading is static" in page


def test_another_text_of_it_is_another_run(packages: Path) -> None:
    key = (
        "import engine; from studies.runs.identity import run_key; "
        "print(run_key(engine.Study(kind='static-share', title='x')))"
    )
    keys = set()
    for text in ("", "# mended\n"):
        (packages / "static_share.py").write_text(blocks("python") + text)
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(packages), str(ROOT)])}
        done = subprocess.run([sys.executable, "-c", key], env=environment, capture_output=True, text=True, check=True)
        keys.add(done.stdout)
    assert len(keys) == 2


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("raise RuntimeError('broken')\n", "cannot be imported"),
        ("KIND = 3\n", "is no kind of study"),
        (OTHER, "other"),
    ],
)
def test_what_is_no_kind_is_refused(packages: Path, text: str, says: str) -> None:
    (packages.parent / "mine.toml").write_text('schema_version = 1\nkind = "static-share"\n')
    (packages / "static_share.py").write_text(text)
    done = wanderlast(packages, "check", "mine.toml")
    assert done.returncode == 2
    assert says in done.stderr and "entry point" in done.stderr


def test_names_of_the_program_stay_its_own(packages: Path) -> None:
    entry = packages / "static_share-1.0.dist-info" / "entry_points.txt"
    entry.write_text("[wanderlast.kinds]\npassage = static_share:KIND\n")
    assert wanderlast(packages, "check", "passage").returncode == 0
