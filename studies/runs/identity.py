"""What the results of a run belong to: the study, the contents of the files that it names, and the program."""

import hashlib
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from engine.bodies import BODIES
from engine.scene.carriages import CARRIAGES
from engine.scene.motions.along_bodies import MOTIONS
from engine.scene.settings import ALL_SCHEMES
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.quantities import QUANTITIES
from results_schema.registry import Pieces
from studies.protocol.study import KINDS

PROGRAM = Path(__file__).parents[2]
PACKAGES = ("engine", "results_schema", "studies")
TABLES = (BODIES, CARRIAGES, MOTIONS, QUANTITIES, ALL_SCHEMES, KINDS)
PIECES = "foreign_pieces"  # the attribute of an archive that names those of its study
SOURCES = "sources"  # the attribute that tells programs of one version apart
DRAWING = PROGRAM / "studies" / "pictures"  # of what is finished: no number depends on it
LIBRARIES = ("numpy", "scipy")  # numba and its compiler belong to the kernels' hash


def files_of(study: Study) -> dict[str, str]:
    """SHA-256 by path of every file that the bodies of a study are made of, included ones too."""
    return {path: digest for body in study.body.values() for path, digest in body.hashes}


def check_unchanged(study: Study) -> None:
    """Refuse a model whose files are no longer those that the study was read with. Raises BadInput."""
    for path, digest in files_of(study).items():
        file = Path(path)
        if not file.is_file() or hashlib.sha256(file.read_bytes()).hexdigest() != digest:
            what = "a file of the model has changed while the study ran"
            raise BadInput(what, where=path, expected="the file as it was when the study was read", remedy="run again")


def run_key(study: Study, names: Sequence[str] = ()) -> str:
    """What finished parts belong to: the study's text, the files of its bodies, the names of its pieces, and all that
    makes numbers: kernels, sources and libraries."""
    from engine.kernels.jit import kernel_hash

    texts = [study.source.sha256, *files_of(study).values(), *names, kernel_hash(), sources_hash(sources())]
    texts += [path.read_text(encoding="utf-8") for path in foreign_sources(study)]
    texts += [f"{library} {version(library)}" for library in LIBRARIES]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()


def sources() -> list[Path]:
    """Every source of ours that has a say in the numbers of parts."""
    found = [path for package in PACKAGES for path in (PROGRAM / package).rglob("*.py")]
    return sorted(path for path in found if not path.is_relative_to(DRAWING))


def foreign_sources(study: Study) -> list[Path]:
    """The files of all pieces of a study that other packages bring."""
    return sorted({path for table, name in ((KINDS, study.kind), *used(study)) for path in table.sources(name)})


def foreign_pieces(study: Study) -> str:
    """The pieces of a study that other packages bring, one a line: group of entry points, name, package, version."""
    pieces = [(table, name) for table, name in ((KINDS, study.kind), *used(study)) if name in table.foreign]
    packages = {(table.group, name): table.foreign[name].dist for table, name in pieces}
    named = [f"{' '.join(piece)} {own.name} {own.version}" for piece, own in packages.items() if own is not None]
    return "\n".join(named)


def missing_pieces(pieces: str) -> list[str]:
    """Which of such pieces are not installed, in words."""
    tables = {table.group: table for table in TABLES}
    found = [(*line.split(" ", 2), "")[:3] for line in pieces.splitlines()]
    gone = [(group, name, package) for group, name, package in found if name not in tables.get(group, ())]
    nouns = {group: table.noun for group, table in tables.items()}
    return [
        f'the {nouns.get(group, "piece")} "{name}" of the package {package} (entry point {name} of {group})'
        for group, name, package in gone
    ]


def sources_hash(paths: Sequence[Path]) -> str:
    """SHA-256 over names and texts of sources."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(str(path.relative_to(PROGRAM)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def used(study: Study) -> Iterator[tuple[Pieces[Any], str]]:
    """Every piece of a study's scene: its table and its name."""
    yield from ((BODIES, body.kind) for body in study.body.values())
    for carriage in study.carriage.values():
        yield from ((CARRIAGES, carriage.kind), (MOTIONS, carriage.motion.kind))
    yield from ((QUANTITIES, sensor.quantity) for sensor in study.sensor.values())
    yield from ((QUANTITIES, envelope.quantity) for envelope in study.envelope.values())
    yield ALL_SCHEMES, study.solver.scheme
