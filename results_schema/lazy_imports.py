"""Packages that take long to import, as names that everybody may have: each is imported when something of it is first
asked for."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__all__ = ["interpolate", "linalg", "sparse", "xr"]


class _Late:
    """A package that is imported with the first of its attributes."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, key: str) -> Any:
        return getattr(import_module(self._name), key)


if TYPE_CHECKING:
    import xarray as xr
    from scipy import interpolate, linalg, sparse
else:
    xr = _Late("xarray")
    interpolate, linalg, sparse = map(_Late, ("scipy.interpolate", "scipy.linalg", "scipy.sparse"))
