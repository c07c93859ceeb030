"""What is shipped, and that README, constraints and continuous integration say the same."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from studies.commands import catalogue

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def versions_tried() -> dict[str, str]:
    """Versions of the constraints file by normalised name."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pairs = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(name): version for name, version in pairs}


def test_versions_tried_lie_in_the_ranges() -> None:
    tested = versions_tried()
    extras = [text for name in ("test", "nastran", "ansys", "jax") for text in PROJECT["optional-dependencies"][name]]
    wanted = [Requirement(text) for text in (*PROJECT["dependencies"], *extras)]
    assert len(wanted) >= 16
    for requirement in wanted:
        version = tested[canonicalize_name(requirement.name)]
        assert requirement.specifier.contains(version), requirement
        assert len(requirement.specifier) > 0, requirement


def test_the_slow_command_installs_all_extras() -> None:
    asked = re.search(r"-e '\.\[(.*)\]'", (ROOT / ".ci" / "slow").read_text(encoding="utf-8"))
    assert asked is not None and set(asked[1].split(",")) == set(PROJECT["optional-dependencies"])


@pytest.mark.parametrize("name", ["run", "slow"])
def test_the_readme_has_the_commands_that_ci_runs(name: str) -> None:
    script = (ROOT / ".ci" / name).read_text(encoding="utf-8")
    command = re.search(r"^(\.ci/venv && .*)\Z", script, re.DOTALL | re.MULTILINE)
    assert command is not None
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert _one_line(command[1]) in _one_line(readme) and f"`.ci/{name}`" in readme


def test_data_files_lie_inside_their_package() -> None:
    found = {path.name for path in (ROOT / "studies").rglob("*") if path.suffix in (".toml", ".part")}
    shipped = {path.name for path in (*catalogue.built_in().values(), *catalogue.starts().values())}
    assert shipped | {catalogue.EVERY_STUDY.name} == found


def _one_line(text: str) -> str:
    return " ".join(text.split())
