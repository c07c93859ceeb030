"""Questions that engineers ask of the engine: one file per kind of question, run, summarised, drawn and reported.

>>> import studies
>>> "asymmetry" in studies.kind_names()
True
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from results_schema.errors import BadInput, Remark
    from studies.protocol.study import Kind, kind_named, kind_names, run
    from studies.reporting.answers import answer, figures
    from studies.reporting.comparison import compare
    from studies.reporting.estimated_errors import errors
    from studies.reporting.report import report
    from studies.reporting.tabulated import export
    from studies.runs.datasets import write

_HOMES = {
    "Kind": "studies.protocol.study",
    "kind_named": "studies.protocol.study",
    "kind_names": "studies.protocol.study",
    "run": "studies.protocol.study",
    "answer": "studies.reporting.answers",
    "figures": "studies.reporting.answers",
    "errors": "studies.reporting.estimated_errors",
    "compare": "studies.reporting.comparison",
    "export": "studies.reporting.tabulated",
    "write": "studies.runs.datasets",
    "report": "studies.reporting.report",
    "BadInput": "results_schema.errors",
    "Remark": "results_schema.errors",
}
__all__ = [
    "BadInput",
    "Kind",
    "Remark",
    "answer",
    "compare",
    "errors",
    "export",
    "figures",
    "kind_named",
    "kind_names",
    "report",
    "run",
    "write",
]


def __getattr__(name: str) -> Any:
    """Names are imported when they are first used."""
    if name in _HOMES:
        found = getattr(import_module(_HOMES[name]), name)
        globals()[name] = found
        return found
    raise AttributeError(f"module 'studies' has no attribute {name!r}")


def __dir__() -> list[str]:
    """What completion offers: the public names, imported or not, and none of their helpers."""
    return sorted([*__all__, *(name for name in globals() if name.startswith("__"))])
