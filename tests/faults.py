"""The faults that the program survives, and the tests of each: `python -m tests.faults` writes docs/faults.md anew.

A test says which it covers by `@pytest.mark.fault(NUMBER, ...)`.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

TESTS = Path(__file__).parent
PAGE = TESTS.parent / "docs" / "faults.md"

FAULTS = {
    "Study files": {
        1: "TOML syntax, a key twice: 2 with the line. A byte-order mark is read over; UTF-16 and Latin-1: 2",
        2: "An unknown or misspelt key: 2 with the nearest name",
        3: 'A wrong type (`true` or `"12"` for a number): 2',
        4: "nan, inf, 1e400, integers beyond 64 bits, thousands of digits, anywhere: 2",
        5: "Nesting 3000 deep, a file beyond 64 MB: 2",
    },
    "Finite-element files": {
        6: "Empty, binary, truncated, wrongly encoded, nodes missing or twice, including itself: 2 with file, line and "
        "card; read in a process of its own with limits of time and memory",
        7: "NaN or infinite coordinates, elements without length, negative stiffness or mass: 2 with the element",
        8: "An INCLUDE that leaves the model's folder: 2",
    },
    "Physics": {
        9: "Mass, stiffness, length, density that are not positive, negative damping: 2 with key and place in its axis",
        10: "Speed 0 or negative: 2; never an endless march",
        11: "A path that never touches its body, or that leaves it where it must stay: 2",
        12: "A fixed step above the scheme's limit: 2 with the limit and a suggestion",
        13: "Steps beyond counting, or beyond the most that are marched: 2",
        14: "A grid beyond 64 bits, memory or disk: 2 with the sizes, before anything is allocated",
        15: "An empty axis, a value twice, zipped axes of different lengths: 2",
        16: "Resonance without damping: finite, equal to the closed form, no false alarm",
    },
    "Numbers": {
        17: "A diverging variant: its status and first bad step, NaN results, code 3",
        18: "Failed variants are left out of every ranking and counted in the report",
        19: "One bad lane leaves its neighbours as they are, bit for bit",
        20: "Chunks, threads, order, neighbours: the same bits",
        21: "A resumed archive equals an uninterrupted one but for the time and the machine",
        22: "A singular tie, eigenvalues or iterations that fail: that variant alone",
        23: "An index out of range in a kernel is found",
    },
    "Interruption": {
        24: "SIGKILL anywhere: only chunks in flight are lost",
        25: "SIGINT, SIGTERM: it stops within 2 s and goes on later; a second Ctrl-C ends it at once",
        26: "A full disk at any write: 74 with path and free bytes, finished chunks whole",
        27: "An output folder that is missing, read-only or a file: refused before computing",
        28: "An output that exists: resumed, done already, or 2; never replaced without `--overwrite`",
        29: "What a power cut leaves (temporary, empty, missing parts): found by checksum, computed again",
        30: "A second run on the same archive: 75 at once",
    },
    "Workers": {
        31: "A worker that is killed: the same result",
        32: "A chunk that kills its worker: halved down to the variant, which is marked crashed, the rest finished, 3",
        33: "A limit of memory: smaller chunks, then 70",
        34: "Scheduler or network lost: 70",
        35: "A worker with other versions or another arithmetic: refused",
        36: "A damaged or unwritable kernel cache, several processes at once: compiled anew, private",
    },
    "Archives": {
        37: "A part or archive truncated, without rows, with a bit flipped: 4 with its name; on resume computed again",
        38: "A newer schema, foreign netCDF, a missing variable, a small file that claims terabytes: 4 before loading",
    },
    "Security": {
        39: "Titles and labels with `<script>`, `{{7*7}}`, `$`, line breaks, `../`: escaped, plain names of files",
        40: "External storage and links in HDF5, a scheduler without TLS on another host: refused, 2",
    },
    "Found by attack": {
        41: "A file of the model that changed: 2, or done again with `--overwrite`",
        42: "Something that comes to the output's place while the study runs: it stays, 2",
        43: "Parts of another study or program copied into the folder: computed again",
        44: "A flipped bit that leads the netCDF library astray: 4, never a signal",
        45: "Finite numbers of absurd size: 2 with the key; no warnings of libraries on the screen",
        46: "Resuming on a small disk demands only what is left; remedies fit the cause",
        47: "A report opens nothing but its archive, and what that says of its study is checked: 4",
        48: "Leaving after a signal is in time, whatever threads still do, and while kernels compile",
        49: "A folder `<archive>.parts` with files of others: 2, and nothing of it is deleted",
        50: "ASCII screens: plain letters, 0. A finished study on a read-only disk: 0. Too little `ulimit -v`: 70",
    },
}


def page() -> str:
    """docs/faults.md: every fault with what it gets and the tests that say so."""
    found, lines = covered(), [HEAD]
    for section, faults in FAULTS.items():
        lines += [f"## {section}", "", "| | fault | tests |", "|---|---|---|"]
        lines += [f"| {number} | {text} | {_listed(found.get(number, []))} |" for number, text in faults.items()]
        lines.append("")
    return "\n".join(lines)


HEAD = """\
# Faults that the program survives

Numbers are exit codes: 2 bad input, 3 finished with statuses other than ok, 4 a damaged or foreign archive, 70 workers
or memory gave up, 74 input or output failed, 75 another run holds the archive. The tests are those marked with
`pytest.mark.fault(NUMBER)`; this page is generated (`python -m tests.faults`). Slow ones run in `.ci/slow`.
"""


def _listed(tests: list[tuple[str, str, bool]]) -> str:
    files: dict[str, list[str]] = {}
    for file, name, slow in tests:
        files.setdefault(file, []).append(f"`{name}`{' (slow)' if slow else ''}")
    return "; ".join(f"{file}: {', '.join(names)}" for file, names in files.items())


def covered() -> dict[int, list[tuple[str, str, bool]]]:
    """The tests of each fault: file, name, and whether it is slow by design."""
    found: dict[int, list[tuple[str, str, bool]]] = {}
    for path in sorted(TESTS.rglob("test_*.py")):
        for test in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(test, ast.FunctionDef) and test.name.startswith("test_"):
                words = [ast.unparse(decorator) for decorator in test.decorator_list]
                entry = (path.relative_to(TESTS).as_posix(), test.name.removeprefix("test_"), _is_slow(words))
                for number in _numbers(test):
                    found.setdefault(number, []).append(entry)
    return found


def _is_slow(decorators: list[str]) -> bool:
    return any(word in ("pytest.mark.slow", "pytest.mark.extras") for word in decorators)


def _numbers(test: ast.FunctionDef) -> Iterator[int]:
    for decorator in test.decorator_list:
        if isinstance(decorator, ast.Call) and ast.unparse(decorator.func) == "pytest.mark.fault":
            yield from (ast.literal_eval(argument) for argument in decorator.args)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
