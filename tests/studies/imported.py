"""Small studies of bodies out of files, in a folder of their own."""

from pathlib import Path
from typing import Any

from engine.study_file.document import write_document
from tests.bodies.frames import CLAMPED_FREE, LENGTH, PINNED, straight
from tests.bodies.models import Files, optional, write_cards

QUESTIONS: dict[str, dict[str, Any]] = {
    "influence": {"positions": 3},
    "eigenfrequencies": {"positions": 3},
    "stability": {"maps": ["overshoot"], "fineness": 0.2},
    "work-precision": {},
}


def matrices(folder: Path, **more: Any) -> dict[str, Any]:
    """The table of a pinned bed of plain files in a folder, its paths from there."""
    table = Files(folder, straight(PINNED, elements=6)).table(modes=4, damping_ratio=0.02, **more)
    names = {key: Path(path).name for key, path in table.items() if key in ("stiffness", "mass", "nodes", "freedoms")}
    return table | names


def nastran(folder: Path) -> dict[str, Any]:
    """The table of a clamped bed of cards, some of them in an included file; skips where nothing reads them."""
    optional("pyyeti.nastran.op4")
    write_cards(Files(folder, straight(CLAMPED_FREE, elements=6)))
    track = {"from": [0.0, 0.0, 0.0], "to": [LENGTH, 0.0, 0.0]}
    return {"kind": "nastran", "matrices": "matrices.pch", "nodes": "nodes.bdf", "track": track, "modes": 4}


def write(folder: Path, bed: dict[str, Any], kind: str = "passage", **more: Any) -> Path:
    """A study of a mass that crosses a bed."""
    motion = {"kind": "cruise", "start": 0.0, "end": LENGTH, "speed": 20.0}
    tables: dict[str, Any] = {
        "schema_version": 1,
        "kind": kind,
        "title": "out of files",
        "body": {"bed": bed},
        "carriage": {"car": {"on": "bed", "kind": "mass", "mass": 50.0, "motion": motion}},
        "sensor": {"middle": {"body": "bed", "at": 0.5 * LENGTH}},
    }
    if kind in QUESTIONS:
        tables["question"] = QUESTIONS[kind]
    path = folder / "bed.toml"
    path.write_text(write_document(tables | more), encoding="utf-8")
    return path
