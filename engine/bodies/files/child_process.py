"""The process that reads the files of a model, so that damaged files harm no other: `python -m` this module.

The request (JSON) comes by standard input; the answer is a file of plain arrays, or a refusal as JSON beside it. Ends
with 0, 2 for bad input, or as it crashes.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from engine.bodies.files.ansys import read_ansys
from engine.bodies.files.matrices import read_matrices
from engine.bodies.files.model import FileModel, save_model
from engine.bodies.files.nastran import read_nastran
from results_schema.errors import BadInput

READERS: Mapping[str, Callable[[Mapping[str, str], Mapping[str, Any]], FileModel]] = {
    "matrices": read_matrices,
    "ansys": read_ansys,
    "nastran": read_nastran,
}
FAULT_KEYS = ("what", "where", "expected", "received", "remedy")


def main() -> int:
    """Read what standard input asks for."""
    request = json.load(sys.stdin)
    _limit(int(request["memory"]), int(request["seconds"]))
    try:
        model = READERS[request["kind"]](request["files"], request["options"])
        save_model(Path(request["answer"]), model)
    except (BadInput, MemoryError) as error:
        too_large = BadInput("the files need too much memory", expected=f"at most {request['memory'] / 2**30:.3g} GiB")
        fault = error if isinstance(error, BadInput) else too_large
        words = {key: str(getattr(fault, key)) for key in FAULT_KEYS}
        Path(request["refusal"]).write_text(json.dumps(words), encoding="utf-8")
        return BadInput.exit_code
    return 0


def _limit(memory: int, seconds: int) -> None:
    import resource

    for what, most in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds)):
        hard = resource.getrlimit(what)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (most, hard))


if __name__ == "__main__":
    sys.exit(main())
