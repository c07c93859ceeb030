"""Questions that engineers ask of the engine: one file per kind of question, run, summarised, drawn and reported.

>>> import studies
>>> "asymmetry" in studies.kind_names()
True
"""

from __future__ import annotations

from studies.protocol.study import Kind, kind_named, kind_names, run

__all__ = ["Kind", "kind_named", "kind_names", "run"]
