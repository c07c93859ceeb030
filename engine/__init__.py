"""wanderlast's engine: loads that move on structures that bend, thousands of variants at once.

>>> import engine
>>> study = engine.Study(kind="passage", title="nothing yet")
>>> study.gravity
9.80665
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from engine.batch.execution import run
    from engine.batch.plan import Plan, make_plan
    from engine.scene.study import Study, load
    from results_schema.errors import BadInput, Remark

_HOMES = {
    "Study": "engine.scene.study",
    "load": "engine.scene.study",
    "run": "engine.batch.execution",
    "Plan": "engine.batch.plan",
    "make_plan": "engine.batch.plan",
    "BadInput": "results_schema.errors",
    "Remark": "results_schema.errors",
}
__all__ = ["BadInput", "Plan", "Remark", "Study", "load", "make_plan", "run"]


def __getattr__(name: str) -> Any:
    """Names are imported when they are first used, so that importing the engine costs nothing."""
    if name in _HOMES:
        found = getattr(import_module(_HOMES[name]), name)
        globals()[name] = found
        return found
    raise AttributeError(f"module 'engine' has no attribute {name!r}")


def __dir__() -> list[str]:
    """What completion offers: the public names, imported or not, and none of their helpers."""
    return sorted([*__all__, *(name for name in globals() if name.startswith("__"))])
