"""Kills of workers at random moments: `python -m tests.measure.worker_kills [KILLS]`.

Each study is run on two workers again and again, and every few seconds one of the worker processes that are there is
killed (SIGKILL): one that starts, waits or works. Every run comes to its end by itself, with 70 where a piece met it
four times in a row (the next start goes on then), no part is ever bad, and each archive equals that of a run on
threads.
"""

import os
import random
import signal
import sys
import tempfile
import time
from contextlib import chdir, suppress
from pathlib import Path

import psutil

from results_schema.store.archive import open_archive
from studies.commands.cli import main as command
from tests.measure.kills import bad_parts
from tests.studies.every_way import TEXTS, assert_same_archives
from tests.studies.forked import exit_code, forked
from tests.studies.small import LONG

SECONDS = 1.0, 6.0  # between two kills: a worker takes about two to start
STUDIES = {
    "marched": LONG.replace("1300, count = 300", "1100, count = 40").replace("40000\naudit = 2", "10000\naudit = 0"),
    "at rest": TEXTS["at rest"],
    "frames that move": TEXTS["frames that move"].replace("[7000.0, 8500.0]", f"{[7e3 + 10.0 * n for n in range(40)]}"),
    "robots": TEXTS["robots"],
}


def workers_of(number: int) -> list[psutil.Process]:
    """The worker processes of a run."""
    found = list[psutil.Process]()
    with suppress(psutil.Error):
        for child in psutil.Process(number).children():
            with suppress(psutil.Error):
                found += [child] if "engine.batch.worker_process" in child.cmdline() else []
    return found


def stopped(number: int) -> bool:
    """Whether a run stands still now; False where it has come to its end (it can still be waited for)."""
    os.kill(number, signal.SIGSTOP)
    state = os.waitid(os.P_PID, number, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
    return state is not None and state.si_code == os.CLD_STOPPED


def killed(name: str, most: int, moments: random.Random) -> dict[str, int]:
    """What became of the runs of one study, in this folder."""
    Path("study.toml").write_text(STUDIES[name], encoding="utf-8")
    assert command(["run", "study.toml", "-o", "whole.nc"]) in (0, 3)
    whole = open_archive("whole.nc")
    found = {"kills": 0, "bad parts": 0, "parts seen": 0, "given up": 0, "archives": 0}
    while found["kills"] < most or not found["archives"] or Path("a.nc.parts").exists():
        number = forked("run", "study.toml", "--workers", "2", "-o", "a.nc", screen="said")
        while stopped(number):
            found["bad parts"] += bad_parts(Path("a.nc.parts"))
            found["parts seen"] += len(list(Path("a.nc.parts").glob("*.nc")))
            os.kill(number, signal.SIGCONT)
            time.sleep(moments.uniform(*SECONDS))
            if found["kills"] < most and (there := workers_of(number)):
                with suppress(psutil.Error):  # it may be gone already
                    moments.choice(there).send_signal(signal.SIGKILL)
                found["kills"] += 1
        code = exit_code(number)
        assert code in (0, 3, 70), (code, Path("said").read_text(encoding="utf-8"))
        if code == 70:
            found["given up"] += 1
            continue
        found["archives"] += 1
        assert_same_archives(open_archive("a.nc"), whole)
        Path("a.nc").unlink()
    return found


def main(kills: int) -> None:
    """The line of each study."""
    for name in STUDIES:
        with tempfile.TemporaryDirectory() as folder, chdir(folder):
            found = killed(name, -(-kills // len(STUDIES)), random.Random(name))
        print(
            f"{name}: {', '.join(f'{count} {what}' for what, count in found.items())}; all archives equal", flush=True
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
