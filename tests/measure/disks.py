"""Studies on real disks that are full or read-only: `python -m tests.measure.disks [PAGES]`.

The disks are file systems in memory, mounted in a namespace of this process's own (`unshare -rm`). Each study runs on
disks of every size, PAGES pages of 4096 bytes apart, from what it demands to what is enough; on large ones that shrink,
at random moments, to what is on them; and on ones that are read-only where another run was killed. Every run that
fails says where, with the bytes that are free there, and ends with 74; the same disk, larger or writable, then gets an
archive that equals that of a run without such trouble.
"""

import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import chdir, contextmanager, suppress
from pathlib import Path

from results_schema.store.archive import open_archive
from studies.commands.cli import main as command
from tests.studies.every_way import TEXTS, assert_same_archives
from tests.studies.forked import exit_code, forked

PAGE = 4096
MOMENTS = 40  # of disks that shrink
LARGE = "size=256m"
DISK = Path("disk")
RUN = ("run", "study.toml", "-o", "disk/a.nc")


@contextmanager
def disk(options: str) -> Iterator[None]:
    """A disk with these options of tmpfs."""
    _mount("-t", "tmpfs", "-o", options, "disk", str(DISK))
    try:
        yield
    finally:
        subprocess.run(["umount", str(DISK)], check=True)


def becomes(options: str) -> bool:
    """Whether the disk takes other options."""
    with suppress(subprocess.CalledProcessError):
        _mount("-o", f"remount,{options}", str(DISK))
        return True
    return False


def _mount(*arguments: str) -> None:
    subprocess.run(["mount", *arguments], check=True, capture_output=True)


def fails(number: int) -> str:
    """Where a run failed to write, "" where it came to its end."""
    code = exit_code(number)
    if code in (0, 3):
        return ""
    said = said_at_last()
    # after lines of progress, where the machine is slow
    told = re.fullmatch(r"(?:study: .*\n)*wanderlast: (disk\S*): (?s:.*)\d+ bytes free there\s*", said)
    assert code == 74 and told, (code, said)
    if "would not fit" in said or "folder cannot be written" in said:
        return "refused at first"
    places = {"disk/a.nc": "failed at the archive", "disk/a.nc.lock": "failed at the lock"}
    return places.get(told[1], "failed at parts")


def said_at_last() -> str:
    """By a run."""
    return Path("said").read_text(encoding="utf-8")


def goes_on() -> None:
    """The disk, larger now and writable, gets the archive of a run without trouble."""
    assert not fails(forked(*RUN, screen="said")), said_at_last()
    assert_same_archives(open_archive("disk/a.nc"), open_archive("whole.nc"))
    assert [path.name for path in DISK.iterdir()] == ["a.nc"]


def on_small_disks(pages: int) -> Iterator[str]:
    """What the runs on disks of every size failed at."""
    size, failed = pages * PAGE, "not run yet"
    while failed:
        with disk(f"size={size}"):
            failed = fails(forked(*RUN, screen="said"))
            demanded = re.search(r"expected (\d+) bytes", said_at_last())
            assert becomes(LARGE)
            goes_on()
        yield failed or f"large enough with {size} bytes"
        size += pages * PAGE
        if failed and demanded:
            size = max(size, -(-int(demanded[1]) // PAGE) * PAGE)


def on_shrinking_disks(seconds: float, moments: random.Random) -> Iterator[str]:
    """What the runs failed at whose disk shrank; seconds: of a run on a large one."""
    for _ in range(MOMENTS):
        with disk(LARGE):
            number = forked(*RUN, screen="said")
            time.sleep(moments.uniform(0.0, 1.0) * seconds)
            _shrink()
            failed = fails(number)
            assert becomes(LARGE)
            goes_on()
        yield failed or "finished before it shrank"


def _shrink() -> None:
    """To what is on the disk: no less is taken."""
    while True:
        found = os.statvfs(DISK)
        if becomes(f"size={max(found.f_blocks - found.f_bfree, 1) * PAGE}"):
            return


def on_read_only_disks(seconds: float, moments: random.Random) -> Iterator[str]:
    """What the runs failed at on read-only disks: on an empty one, and where another was killed."""
    for _ in range(MOMENTS // 4):
        with disk(LARGE):
            number = forked(*RUN)
            time.sleep(moments.uniform(0.0, 1.0) * seconds)
            os.kill(number, signal.SIGKILL)
            exit_code(number)
            assert becomes("ro")
            before = sorted(DISK.rglob("*"))
            yield fails(forked(*RUN, screen="said")) or "finished before"
            assert sorted(DISK.rglob("*")) == before
            assert becomes(f"rw,{LARGE}")
            goes_on()


def inside(pages: int) -> None:
    """The line of each study."""
    for name, text in TEXTS.items():
        with tempfile.TemporaryDirectory() as folder, chdir(folder):
            Path("study.toml").write_text(text, encoding="utf-8")
            DISK.mkdir()
            assert command(["run", "study.toml", "-o", "whole.nc"]) in (0, 3)
            with disk(LARGE):
                began = time.monotonic()
                goes_on()
            seconds, moments = time.monotonic() - began, random.Random(name)
            for failed in (
                on_small_disks(pages),
                on_shrinking_disks(seconds, moments),
                on_read_only_disks(seconds, moments),
            ):
                found = ", ".join(f"{count} {what}" for what, count in Counter(failed).items())
                print(f"{name}, {failed.__name__.replace('_', ' ')}: {found}; all archives equal", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["inside"]:
        inside(int(sys.argv[2]))
    else:
        again = [sys.executable, "-m", "tests.measure.disks", "inside", *(sys.argv[1:] or ["1"])]
        os.execvp("unshare", ["unshare", "-rm", *again])
