"""What the command sets up where it is the whole process: streams, warnings, memory, threads, signals."""

import codecs
import io
import os
import resource
import sys
import unicodedata
import warnings

from results_schema.errors import WorkersGaveUp
from results_schema.garbage import collect_seldom
from studies.protocol import stopping

# Of addresses, which libraries and stacks of threads take more of than of memory: a study of a beam on two threads
# takes 0.96 GB, a portal 1.25 GB, and the compiler ends the process where it gets none.
LEAST_MEMORY = 1 << 30

_LETTERS = {
    "µ": "u",
    "μ": "u",
    "×": "x",
    "·": " ",
    "°": "deg",
    "−": "-",
    "±": "+-",
    "–": "-",
    "—": "-",
    "√": "sqrt",
    "π": "pi",
}
_LETTERS |= {"ω": "omega", "Ω": "Omega", "φ": "phi"}


def set_up() -> None:
    """Prepare the process. Raises WorkersGaveUp where it may not have the memory that every command takes."""
    stopping.own_process()
    collect_seldom()
    # OpenBLAS is told before numpy loads it: the threads are the march's own, and those of OpenBLAS wait for each
    # other longer than a product of small matrices takes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # they name lines of sources, for those who write these
    codecs.register_error("plain-letters", _plain_letters)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="plain-letters")
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    if allowed != resource.RLIM_INFINITY and allowed < LEAST_MEMORY:
        expected, received = f"at least {LEAST_MEMORY} bytes", f"{allowed} bytes"
        raise WorkersGaveUp(
            "the limit of memory is too small", expected=expected, received=received, remedy="ulimit -v"
        )


def leave_dask_out() -> None:
    """Let xarray look for dask, as it does at its first index, while there is none: to import it takes a third of a
    second, and no command meets an array of it."""
    if "dask" in sys.modules:
        return
    sys.modules["dask"] = None  # type: ignore[assignment]  # as Python has what is not there
    try:
        import xarray as xr

        xr.Variable("x", [0.0]).to_index_variable()
    finally:
        del sys.modules["dask"]


def _plain_letters(error: UnicodeError) -> tuple[str, int]:
    """What stands for letters that a screen does not have."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(plain, error.object[error.start : error.end])), error.end


def plain(letter: str) -> str:
    """A letter in ASCII.

    >>> "".join(map(plain, "5 µm × ω₁², é, 車"))
    '5 um x omega12, e, ?'
    """
    if letter.isascii():
        return letter
    parts = unicodedata.normalize("NFKD", letter)
    return _LETTERS.get(letter) or "".join(part for part in parts if part.isascii()) or "?"
