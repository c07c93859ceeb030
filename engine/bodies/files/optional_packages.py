"""Packages of the extras: imported where a file needs them, and their failures told as faults of the file."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from results_schema.errors import BadInput


def extra(module: str, name: str) -> Any:
    """A module of an extra. Raises BadInput with the remedy where it is not installed.

    What such modules set in numpy when they are imported (printing, warnings) is set back.
    """
    try:
        with warnings.catch_warnings(), np.printoptions(), np.errstate():
            warnings.simplefilter("ignore")
            return import_module(module)
    except ImportError as error:
        package = (error.name or module).partition(".")[0]
        what, remedy = f"reading this file needs the package {package}", f"pip install 'wanderlast[{name}]'"
        raise BadInput(what, expected=f"the extra {name}", received=str(error)[:200], remedy=remedy) from None


def foreign(path: str, read: Callable[[], Any]) -> Any:
    """What another package reads from a file. Raises BadInput for whatever it stumbles over, but for lack of memory."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read()
    except (BadInput, MemoryError):
        raise
    except Exception as error:
        received = f"{type(error).__name__}: {error}"[:200]
        what = "the file cannot be read: damaged, truncated or of another kind"
        raise BadInput(what, where=path, received=received) from None
