"""Kernels of frames that move, robots and scenes at rest (those of the march: `test_kernels`), compiled with checks of
every index: none is out of range, and one that is would be found."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.studies.small import ROOT

# What is broken at the end, as its records have no room for what is observed after the start.
BREAKS = {
    "at rest": "",
    "frames that move": """
from engine.floating import march
full = march.Record
march.Record = lambda stations, statistics, history, *rest: full(stations, statistics, history[:, :1], *rest)
""",
    "robots": """
from engine.robots import march
full = march._empty
march._empty = lambda *given: march.Record(*(part[:1] for part in full(*given)))
""",
}
SCRIPT = """
import sys
import studies
from engine.scene.study import load
from tests.studies.every_way import TEXTS

study = load(TEXTS[sys.argv[1]])
assert (studies.run(study, threads=1)["status"] == 0).all()
if sys.argv[2]:
    exec(sys.argv[2])
    try:
        studies.run(study, threads=1)
    except IndexError:
        sys.exit(0)
    sys.exit("nothing was noticed")
"""


@pytest.mark.slow
@pytest.mark.fault(23)
@pytest.mark.parametrize("way", BREAKS)
def test_no_index_out_of_range(tmp_path: Path, way: str) -> None:
    checked = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_OPT": "0", "WANDERLAST_CACHE": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, way, BREAKS[way]],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | checked,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
