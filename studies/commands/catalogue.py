"""The study files that come with the program: built-in studies, and commented files to start from."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from results_schema.errors import BadInput, did_you_mean
from studies.protocol.library import LIBRARY, built_in, studies_in
from studies.protocol.study import KINDS

STARTS = Path(__file__).parents[1] / "study_templates"
MEASURED = LIBRARY / "measured.json"  # what `python -m tests.gallery` found of every built-in study
COMMAND = "#     wanderlast "  # how a line with an example command begins
EVERY_STUDY = STARTS / "every-study.part"


@dataclass(frozen=True)
class Entry:
    """A built-in study: its name, its kind, and its title."""

    name: str
    kind: str
    title: str


def starts() -> Mapping[str, Path]:
    """Files to start from by kind of study."""
    return studies_in(STARTS)


def entries() -> Iterator[Entry]:
    """The built-in studies by name."""
    for name, path in built_in().items():
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        yield Entry(name, data["kind"], data["title"])


def measured() -> Mapping[str, Mapping[str, Any]]:
    """Seconds on two cores, exit code and answer of built-in studies by name, as the gallery found them."""
    found: dict[str, dict[str, Any]] = json.loads(MEASURED.read_text(encoding="utf-8"))
    return found


def refuse_study(path: Path) -> None:
    """Tell what to do where a study stands in place of an archive. Raises BadInput."""
    is_built_in = str(path) in built_in() and not path.exists()
    if is_built_in or (path.suffix == ".toml" and path.is_file()):
        what = f"this is a {'built-in study' if is_built_in else 'study file'}, not an archive of results"
        remedy = f"first wanderlast run {path}, then the same with {path.stem}.nc"
        raise BadInput(what, where=str(path), expected="an archive (.nc)", remedy=remedy)


def refuse_table(archive: Path | None) -> None:
    """Refuse the name of a table as that of an archive. Raises BadInput."""
    from studies.reporting.tabulated import WRITERS

    if archive is not None and archive.suffix in WRITERS:
        own = archive.with_suffix(".nc")
        remedy = f"-o {own}, then wanderlast export {own} {archive}"
        raise BadInput("run writes archives, and this is the name of a table", where=str(archive), remedy=remedy)


def as_typed(study: str) -> str:
    """What to type for a study whose file has this name.

    >>> as_typed(str(built_in()["asymmetry"]))
    'asymmetry'
    """
    return next((name for name, path in built_in().items() if str(path) == study), study)


def start_text(kind: str) -> str:
    """A study file to start from: what is special about the kind, then every key that the kinds share whose bodies
    stand; or a built-in study, by its name where no kind has it.

    Raises BadInput for an unknown name.
    """
    known, shared = starts(), EVERY_STUDY.read_text(encoding="utf-8")
    if kind in known:
        own = known[kind].read_text(encoding="utf-8")
        return own if any(f"[{table}." in own for table in ("frame", "robot")) else own + shared
    if kind in built_in():
        return built_in()[kind].read_text(encoding="utf-8")
    if kind not in KINDS.foreign:
        what, names = "no such kind of study, or none with a file to start from", [*known, *KINDS.foreign]
        remedy = did_you_mean(kind, list(known))
        raise BadInput(what, where=kind, expected=f"one of {', '.join(names)}", remedy=remedy)
    return str(cast(Any, KINDS[kind]).start) + shared


def for_file(text: str, kind: str, path: Path) -> str:
    """The text of a study file to start from, with the name of the file at `path` in its example commands.

    >>> print(for_file("#     wanderlast run bed     the archive bed.nc\\n# bed", "bed", Path("slide.toml")))
    #     wanderlast run slide.toml     the archive slide.nc
    # bed
    """
    own = re.compile(rf"(?<![\w-]){re.escape(kind)}(\.toml|\.nc)?(?![\w-])")

    def named(found: re.Match[str]) -> str:
        return f"{path.stem}.nc" if found[1] == ".nc" else path.name

    lines = text.split("\n")
    return "\n".join(own.sub(named, line) if line.startswith(COMMAND) else line for line in lines)
