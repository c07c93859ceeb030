"""The built-in studies, whose files come with the program."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

LIBRARY = Path(__file__).parents[1] / "library"

T = TypeVar("T")


def built_in() -> Mapping[str, Path]:
    """Files of the built-in studies by name."""
    return studies_in(LIBRARY)


def studies_in(folder: Path) -> Mapping[str, Path]:
    """The study files of a folder by name."""
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def by_name(study: T) -> T | Path:
    """The file of the built-in study of this name; all else as it is.

    >>> by_name("asymmetry").name, by_name("my.toml")
    ('asymmetry.toml', 'my.toml')
    """
    return built_in().get(study, study) if isinstance(study, str) else study
