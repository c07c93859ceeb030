"""The built-in studies, whose files come with the program."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from results_schema.errors import BadInput, did_you_mean
from results_schema.store.files import is_hdf5

LIBRARY = Path(__file__).parents[1] / "library"


def built_in() -> Mapping[str, Path]:
    """Files of the built-in studies by name."""
    return studies_in(LIBRARY)


def studies_in(folder: Path) -> Mapping[str, Path]:
    """The study files of a folder by name."""
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def find_study(study: str | Path) -> Path:
    """The file of a study: that of the built-in study of this name, else the path itself. Raises BadInput.

    >>> find_study("asymmetry").name
    'asymmetry.toml'
    """
    known, path, study = built_in(), Path(study), str(study)
    if study in known:
        return known[study]
    if is_hdf5(path):
        expected, remedy = "a study file (TOML)", f"wanderlast report {study}, or wanderlast info {study}"
        raise BadInput("this is an archive of results, not a study", where=study, expected=expected, remedy=remedy)
    if path.is_file():
        return path
    alike = {file.stem: str(file) for file in sorted(path.parent.glob("*.toml"))}  # all have the same ending
    near = did_you_mean(path.stem, {name: name for name in known} | alike)
    if path.is_dir():
        raise BadInput("this is a folder", where=study, expected="a study file (TOML)", remedy=near)
    if path.suffix or len(path.parts) > 1:
        raise BadInput("the study file cannot be read: no such file", where=study, remedy=near)
    what = "no such file, and no built-in study of that name"
    raise BadInput(what, where=study, expected=f"a path, or one of {', '.join(known)}", remedy=near)
