"""Kills of a running study at random moments: `python -m tests.measure.kills [KILLS]`.

Each study is run again and again, and most of its runs are killed (SIGKILL). No part may ever be bad (unlike its
checksum, or not to be read), and each archive that comes to its end equals that of an uninterrupted run.
"""

import os
import random
import signal
import sys
import tempfile
import time
from contextlib import chdir
from pathlib import Path

from results_schema.store import files
from results_schema.store.archive import open_archive
from results_schema.store.reading import opened, read_tables
from studies.commands.cli import main as command
from tests.studies.every_way import TEXTS, assert_same_archives
from tests.studies.forked import exit_code, forked
from tests.studies.small import SCENES

STUDIES = {**TEXTS, "marched": SCENES.replace("to = 1070.0, count = 8", "to = 1150.0, count = 16")}
STUDIES = {name: STUDIES[name] for name in ("marched", "frames that move", "robots")}


def bad_parts(folder: Path) -> int:
    """Parts with a checksum that are not as it says, or cannot be read."""
    count = 0
    for path in folder.glob("*.nc"):
        if files.sidecar(path).exists():
            with opened(path) as dataset:
                read_tables(path, dataset)
            count += not files.sidecar_matches(path)
    return count


def killed(name: str, kills: int, moments: random.Random) -> dict[str, int]:
    """What became of the runs of one study, in this folder."""
    folder = Path()
    Path("study.toml").write_text(STUDIES[name], encoding="utf-8")
    assert command(["run", "study.toml", "-o", "whole.nc"]) in (0, 3)
    began = time.monotonic()
    assert exit_code(forked("run", "study.toml", "-o", "again.nc")) in (0, 3)
    seconds, whole = time.monotonic() - began, open_archive("whole.nc")
    Path("again.nc").unlink()
    found = {"kills": 0, "bad parts": 0, "parts seen": 0, "finished": 0}
    while found["kills"] < kills:
        number = forked("run", "study.toml", "-o", "a.nc", screen="said")
        time.sleep(moments.uniform(0.0, 1.0) * seconds)
        os.kill(number, signal.SIGKILL)
        ended = exit_code(number)
        found["bad parts"] += bad_parts(folder / "a.nc.parts")
        found["parts seen"] += len(list((folder / "a.nc.parts").glob("*.nc")))
        if ended == -signal.SIGKILL:
            found["kills"] += 1
            if not Path("a.nc").exists():
                continue
        assert ended in (0, 3, -signal.SIGKILL), (ended, Path("said").read_text(encoding="utf-8"))
        assert_same_archives(open_archive("a.nc"), whole)
        assert exit_code(forked("run", "study.toml", "-o", "a.nc")) in (0, 3)
        Path("a.nc").unlink()
        found["finished"] += 1
        left = {path.name for path in folder.iterdir()} - {"study.toml", "whole.nc", "said"}
        assert left <= {"a.nc.parts", "a.nc.lock"}, left
    assert exit_code(forked("run", "study.toml", "-o", "a.nc")) in (0, 3)
    assert_same_archives(open_archive("a.nc"), whole)
    return found


def main(kills: int) -> None:
    """The line of each study."""
    for name in STUDIES:
        with tempfile.TemporaryDirectory() as folder, chdir(folder):
            found = killed(name, kills // len(STUDIES) + 1, random.Random(name))
        print(
            f"{name}: {', '.join(f'{count} {what}' for what, count in found.items())}; all archives equal", flush=True
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
