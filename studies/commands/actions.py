"""What each command does; everything heavy is imported here, when it is needed."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from results_schema.errors import ArchiveError, BadInput
from studies.commands import catalogue, console
from studies.results.formatting import counted

if TYPE_CHECKING:
    from studies.commands.bench import Scene, Throughput
    from studies.protocol.options import RunOptions
    from studies.runs.runner import Outcome

SOME_NOT_OK = 3


def init(kind: str, file: Path | None) -> None:
    """Write a study file to start from. Raises BadInput where there is a file already."""
    from results_schema.store import files

    text, path = catalogue.start_text(kind), file or Path(f"{kind}.toml")
    files.check_output_place(path)
    if path.exists():
        raise BadInput("there is a file already", where=str(path), remedy="choose another name or remove it")
    files.write_text(path, text)
    console.say(f"wrote {path}; next: wanderlast check {path}")


def check(study: str) -> None:
    """Validate a study and print what a run would do."""
    import engine
    from studies.commands.preview import preview
    from studies.protocol.study import kind_of

    loaded = engine.load(catalogue.find_study(study))
    console.show_preview(preview(kind_of(loaded).parts(loaded), len(os.sched_getaffinity(0))))


def run(study: str, archive: Path | None, options: RunOptions) -> Outcome:
    """Run a study to its archive, with a progress bar; signals stop it with finished work kept."""
    from studies.protocol.stopping import stop_on_signals

    with stop_on_signals() as stop:
        import engine
        from studies.runs.runner import run_to_archive

        path = catalogue.find_study(study)
        loaded = engine.load(path)
        with console.progress_bar(path.stem) as progress:
            return run_to_archive(loaded, archive or Path(f"{path.stem}.nc"), options, progress=progress, stop=stop)


def exit_code(outcome: Outcome) -> int:
    """Exit code of a finished run: 3 where some variants are not ok, or an audit found the tolerance missed.

    A study that measures asks where methods fail: a method that diverges is its answer, and nothing that a script has
    to look after. So it ends with 0.
    """
    from studies.reporting.summary import all_ok, is_measured
    from studies.runs.audit import Verdict

    if outcome.audit is not None and not Verdict.of(outcome.audit).held:
        return SOME_NOT_OK
    return 0 if is_measured(outcome.results) or all_ok(outcome.results) else SOME_NOT_OK


def list_studies() -> None:
    """Print the built-in studies and the kinds of study."""
    from studies.protocol.study import kind_named, kind_names

    console.show_studies(catalogue.entries(), [(kind, kind_named(kind).summary) for kind in kind_names()])


def report(archive: Path, folder: Path | None) -> None:
    """Write the report of an archive."""
    _refuse_unfinished(archive)
    from studies.reporting.report import write_report

    page = write_report(archive, folder or Path(f"{archive.name.removesuffix('.nc')}-report"))
    console.say(f"wrote {page}")


def info(archive: Path) -> None:
    """Print what is inside an archive. Raises ArchiveError, after that, where it is not whole."""
    _refuse_unfinished(archive)
    from results_schema.store.archive import describe

    summary = describe(archive)
    console.show_archive(summary)
    if not summary.whole:
        raise ArchiveError(summary.damage)


def _refuse_unfinished(archive: Path) -> None:
    """Tell of an unfinished run where its archive is not there yet. Raises BadInput."""
    from results_schema.store.parts import finished_so_far

    if archive.exists() or (parts := finished_so_far(archive)) is None:
        return
    variants = {int(number) for part in parts for number in part}
    pieces = sum(part.size == 0 for part in parts)
    raise BadInput(
        "not there yet; an unfinished run of it is",
        where=str(archive),
        expected="a finished archive",
        received=counted(pieces, "finished piece")
        if pieces
        else f"parts with {counted(len(variants), 'finished variant')}",
        remedy=f"wait for the run if one is at work, or go on from there: wanderlast run STUDY -o {archive}",
    )


def bench(scene: Scene, threads: int | None) -> Throughput:
    """Measure the throughput of the march."""
    from studies.commands.bench import measure

    return measure(scene, threads)
