"""Pieces that other packages bring: the documentation's examples, installed and run."""

import json
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from engine.bodies import BODIES
from engine.scene.carriages import CARRIAGES
from engine.scene.motions.along_bodies import MOTIONS
from engine.scene.settings import ALL_SCHEMES
from results_schema.errors import BadInput
from results_schema.quantities import QUANTITIES
from results_schema.registry import Pieces
from studies.protocol.study import KINDS
from tests.studies import scenes

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
(DECLARED,) = re.findall(r"```toml\n(.*?)```", PAGE, re.S)
POINTS = tomllib.loads(DECLARED)["project"]["entry-points"]
FILES = dict(re.findall(r"`(\w+\.py)`:\n\n```python\n(.*?)```", PAGE, re.S))
TABLES = {table.group: table for table in (BODIES, CARRIAGES, MOTIONS, QUANTITIES, ALL_SCHEMES, KINDS)}

STUDY = """\
schema_version = 1
title = "A magnet glides over a slab"
kind = "static-share"

[body.floor]
kind = "slab"
length = 6.0
width = 1.0
thickness = 0.2
youngs_modulus = "30 GPa"
density = 2500.0
damping_ratio = 0.02
modes = 6

[carriage.cart]
on = "floor"
kind = "magnet"
mass = 200.0
pull = 500.0
motion = { kind = "glide", start = 0.5, end = 5.5, speed = 5.0 }

[sensor.middle]
body = "floor"
at = 3.0

[sensor.tilt]
body = "floor"
at = 0.0
quantity = "slope"

[solver]
scheme = "damped"
steps = 400
audit = 0
"""


def install(home: Path, points: dict[str, dict[str, str]], files: dict[str, str]) -> Path:
    """A folder with a package as it is installed."""
    info = home / "toys-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toys\nVersion: 1.0\n")
    sections = (f"[{group}]\n" + "\n".join(f"{k} = {v}" for k, v in one.items()) for group, one in points.items())
    (info / "entry_points.txt").write_text("\n\n".join(sections) + "\n")
    for name, text in files.items():
        (home / name).write_text(text)
    return home


@pytest.fixture
def packages(tmp_path: Path) -> Path:
    """The examples, installed."""
    return install(tmp_path / "packages", POINTS, FILES)


def python(packages: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(packages), str(ROOT)])
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=packages.parent,
        env=os.environ | {"PYTHONPATH": path, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )


COMMANDS = """
import contextlib, io, json, sys
from studies.commands.cli import main
for line in sys.argv[1:]:
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()) as complained:
        code = main(line.split())
    print(json.dumps([code, said.getvalue(), complained.getvalue()]))
"""


def wanderlast(packages: Path, *commands: str) -> list[tuple[int, str, str]]:
    """What some commands end with, say and complain of, one after another in a process that has these packages."""
    done = python(packages, "-c", COMMANDS, *commands)
    assert done.returncode == 0, done.stderr
    return [tuple(json.loads(line)) for line in done.stdout.splitlines()]


def test_every_sort_has_an_example() -> None:
    assert set(POINTS) == set(TABLES)
    assert {f"{value.partition(':')[0]}.py" for one in POINTS.values() for value in one.values()} == set(FILES)


def test_the_commands_know_the_kind(packages: Path) -> None:
    listed, *others = wanderlast(packages, "list", "init static-share mine.toml", "check mine.toml")
    assert "static-share" in listed[1] and [code for code, *_ in others] == [0, 0]


def test_a_study_of_them_all_is_run(packages: Path) -> None:
    (packages.parent / "all.toml").write_text(STUDY)
    done = wanderlast(packages, "check all.toml", "run all.toml", "report all.nc")
    assert [code for code, *_ in done] == [0, 0, 0], done
    with xr.open_dataset(packages.parent / "all.nc") as found:
        share, tilt = found["static_share"].values, float(found["tilt_max"])
        # of a load at the middle of a pinned beam: F L^2/(16 E I), a part of which stands at rest
        most = (200.0 * 9.80665 + 500.0) * 6.0**2 / (16 * 30e9 * 0.2**3 / 12)
        assert found["tilt_max"].attrs["units"] == "1" and found["scheme_used"] == 8
    assert ((share > 0.3) & (share <= 1.01)).all()
    assert most < tilt < 1.5 * most
    page = (packages.parent / "all-report" / "report.html").read_text(encoding="utf-8")
    assert "of the largest reading is static" in page


WITHOUT = {
    "static-share": ('"passage"', '"static-share"', "kinds", "kind of study"),
    "slope": (
        'under = "table"\nquantity = "bending_moment"',
        'body = "bed"\nat = 2\nquantity = "slope"',
        "quantities",
        "quantity",
    ),
    "damped": ("[solver]", '[solver]\nscheme = "damped"\nsteps = 400', "schemes", "scheme"),
}


def test_without_its_package_a_study_and_its_archive_are_refused_in_words(packages: Path, tmp_path: Path) -> None:
    """The archive is whole: it is the package that is missed, and named."""
    text = scenes.text_of("passage", extra="[solver]\naudit = 0")
    for name, (old, new, *_) in WITHOUT.items():
        assert old in text
        (packages.parent / f"{name}.toml").write_text(text.replace(old, new, 1))
    done = wanderlast(packages, *(f"run {name}.toml" for name in WITHOUT))
    assert all(code in (0, 3) for code, *_ in done), done
    commands = "run {}.toml", "report {}.nc", "info {}.nc", "info {}.nc --study"
    done = wanderlast(tmp_path / "gone", *(command.format(name) for name in WITHOUT for command in commands))
    for number, (name, (_, _, group, noun)) in enumerate(WITHOUT.items()):
        run, report, info, printed = done[4 * number : 4 * number + 4]
        assert run[0] == 2 and name in run[2] and "is the package installed" in run[2]
        said = f'this archive needs the {noun} "{name}" of the package toys 1.0 '
        for code, _, complained in (report, info):
            assert code == 4 and "not what it holds" not in complained and len(complained.splitlines()) == 1
            assert f"{said}(entry point {name} of wanderlast.{group})" in complained
        assert f"{name}.nc: whole" in info[1] and printed[0] == 0


def test_the_unreduced_model_knows_the_body_and_refuses_the_quantity(packages: Path) -> None:
    (packages.parent / "all.toml").write_text(STUDY)
    code = """
import engine
from engine.unreduced.scene import unreduced_model
from results_schema.errors import BadInput
study = engine.load("all.toml")
try:
    unreduced_model(study)
except BadInput as error:
    print(error)
print(unreduced_model(study.with_values({"sensor.tilt.quantity": "shear_force"})).size)
"""
    refused, size = python(packages, "-c", code).stdout.splitlines()
    assert "sensor.tilt.quantity" in refused and "slope" in refused
    assert int(size) == 2 * (64 + 1) - 2


def test_another_text_of_any_is_another_run(packages: Path) -> None:
    (packages.parent / "all.toml").write_text(STUDY)
    keys = """
import sys, pathlib, engine
from studies.runs.identity import run_key
print(run_key(engine.load("all.toml")))
for name in sys.argv[1:]:
    file = pathlib.Path("packages", name)
    file.write_text(file.read_text() + "# mended")
    print(run_key(engine.load("all.toml")))
"""
    done = python(packages, "-c", keys, *FILES)
    assert done.returncode == 0, done.stderr
    assert len(set(done.stdout.split())) == 1 + len(FILES)


def table_with(group: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> Pieces[Any]:
    """The table of a sort with one more piece, called `toy`."""
    module = f"toy_{group.partition('.')[2]}"
    home = install(tmp_path / "packages", {group: {"toy": f"{module}:TOY"}}, {f"{module}.py": text})
    monkeypatch.syspath_prepend(str(home))
    monkeypatch.delitem(sys.modules, module, raising=False)
    return replace(TABLES[group])


@pytest.mark.parametrize("group", TABLES)
@pytest.mark.parametrize(
    ("text", "says"),
    [("raise RuntimeError('broken')\n", "cannot be imported.*broken"), ("TOY = 3\n", "toy_.*:TOY is no .*without")],
)
def test_what_is_none_is_refused(
    group: str, text: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = table_with(group, tmp_path, monkeypatch, text)
    assert "toy" in table
    with pytest.raises(BadInput, match=f"entry point toy = .*{says}"):
        table["toy"]


@pytest.mark.parametrize("group", TABLES)
def test_another_name_is_refused(group: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ((name, value),) = POINTS[group].items()
    module, _, piece = value.partition(":")
    text = FILES[f"{module}.py"].replace('declare("static-share"', 'declare("toy"')
    table = table_with(group, tmp_path, monkeypatch, f"{text}\nTOY = {piece}\n")
    with pytest.raises(BadInput, match=f'expected .*"toy", received the name "{name}"'):
        table["toy"]


def test_an_unfinished_class_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = FILES["glide.py"].replace("def law(", "def other(") + "\nTOY = Glide\n"
    with pytest.raises(BadInput, match="without law"):
        table_with("wanderlast.motions", tmp_path, monkeypatch, text)["toy"]


def test_a_quantity_that_bodies_would_have_to_know_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = FILES["slope.py"].replace("derivative=1", "derivative=1, of_section=True") + "\nTOY = SLOPE\n"
    with pytest.raises(BadInput, match="without of_section = False"):
        table_with("wanderlast.quantities", tmp_path, monkeypatch, text)["toy"]


def test_names_of_the_program_stay_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = install(tmp_path / "packages", {"wanderlast.motions": {"cruise": "nowhere:TOY"}}, {})
    monkeypatch.syspath_prepend(str(home))
    assert replace(MOTIONS)["cruise"] is MOTIONS["cruise"] and "cruise" not in replace(MOTIONS).foreign
