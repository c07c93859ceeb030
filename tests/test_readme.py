"""The documentation tells the truth: its table of results, its study file, its links."""

from __future__ import annotations

import re
import subprocess
import sys
from typing import Any

from engine.batch.plan import make_plan
from engine.scene.study import load
from studies.protocol.study import kind_of
from tests.readme import README


def test_the_table_of_results_is_the_declarations() -> None:
    """In a process of its own: tests declare kinds too."""
    made = "import tests.readme as r; t = r.RESULTS.read_text(); import sys; sys.exit(t != r.with_declarations(t))"
    finished = subprocess.run([sys.executable, "-c", made], cwd=README.parent, check=False)
    assert finished.returncode == 0, "run: python -m tests.readme"


def test_links_lead_somewhere() -> None:
    for page in (README, *README.parent.glob("docs/*.md")):
        text = page.read_text(encoding="utf-8")
        heads = {
            re.sub(r"[^\w -]", "", head).strip().lower().replace(" ", "-")
            for head in re.findall(r"^#+ (.*)", text, re.M)
        }
        for link in re.findall(r"\]\(([^)]+)\)", text):
            path, _, anchor = link.partition("#")
            assert link.startswith("http") or (page.parent / path).exists(), link
            assert path or anchor in heads, link


def test_the_study_file_runs() -> None:
    text = README.read_text(encoding="utf-8")
    block = next(block for block in re.findall(r"```toml\n(.*?)```", text, re.S) if "schema_version" in block)
    study = load(block)
    kind = kind_of(study)
    assert make_plan(study, reduction=kind.reduction(study), results=kind.name).size == 160


def test_the_python_example_runs() -> None:
    text = README.read_text(encoding="utf-8")
    block = next(block for block in re.findall(r"```python\n(.*?)```", text, re.S))
    lines = [line for line in block.splitlines() if "engine.load" not in line and not line.endswith(".plot()")]
    names: dict[str, Any] = {}
    exec("\n".join(lines), names)
    assert names["ds"].dynamic_amplification.sel(sensor="midspan", mass=100).shape == (40,)
