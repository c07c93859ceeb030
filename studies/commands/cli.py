"""The command `wanderlast`: what it understands. What does the work is imported only when it is asked for."""

from __future__ import annotations

import gc
import sys
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from results_schema.errors import ArchiveError, BadInput
from studies.commands import error_exit as trouble
from studies.commands import process
from studies.protocol import stopping
from studies.results.formatting import counted

if TYPE_CHECKING:
    from studies.protocol.options import RunOptions
    from studies.runs.runner import Outcome

MAKES_DATASETS = ("check", "run", "report", "info", "compare", "export")

_FOLDER = click.Path(path_type=Path, file_okay=False)
_FILE = click.Path(path_type=Path)
_THREADS = click.option("--threads", type=click.IntRange(min=1), metavar="N", help="Threads; default: all cores.")
_JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of tables.")


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="wanderlast", message="wanderlast %(version)s")
def commands() -> None:
    """Batch studies of loads that move on structures that bend.

    STUDY is the path of a study file (TOML) or the name of a built-in study (see "wanderlast list").

    \b
    Exit codes: 0 fine; 2 bad input; 3 finished, but some variants carry a status other than ok,
    or an audit missed the tolerance; 4 damaged or foreign archive; 70 workers gave up;
    74 input/output failed (disk full, read-only); 75 another run holds the archive;
    130 and 143 interrupted, finished work is kept; 1 a bug of our own.
    """


@commands.command()
@click.argument("kind")
@click.argument("file", type=_FILE, required=False)
def init(kind: str, file: Path | None) -> None:
    """Write a commented study file of KIND to start from, or a copy of the built-in study KIND.

    FILE is KIND.toml unless given.
    """
    from results_schema.store import files
    from studies.commands import catalogue, console

    text, path = catalogue.start_text(kind), file or Path(f"{kind}.toml")
    files.check_new_place(path)
    files.write_text(path, catalogue.for_file(text, kind, path))
    console.say(f"wrote {path}; next: wanderlast check {path}")


@commands.command()
@click.argument("study")
def check(study: str) -> None:
    """Validate STUDY and explain what a run would do."""
    import engine
    from engine.kernels.compiling import told_of_compiling
    from results_schema.cores import cores
    from studies.commands import console, screens
    from studies.commands.preview import preview
    from studies.protocol.library import find_study
    from studies.protocol.study import kind_of

    path = find_study(study)
    loaded = engine.load(path)
    with told_of_compiling(partial(console.say_compiling, path.stem)) as compiled:
        seen = preview(kind_of(loaded).parts(loaded), cores(), compiled())
    screens.show_preview(seen)


@commands.command()
@click.argument("study")
@click.option("-o", "folder", type=_FOLDER, metavar="FOLDER", help="Where to write; default: <study>-drawing, here.")
def draw(study: str, folder: Path | None) -> None:
    """Draw the scene of STUDY to scale, and its mode shapes as they move.

    One self-contained HTML page, before anything is run: a wrong support, unit or node is seen at once.
    """
    import engine
    from studies.commands import console
    from studies.protocol.library import find_study
    from studies.reporting.drawing import write_drawing

    path = find_study(study)
    console.say(f"wrote {write_drawing(engine.load(path), folder or Path(f'{path.stem}-drawing'))}")


@commands.command()
@click.argument("study")
@click.option("-o", "archive", type=_FILE, metavar="ARCHIVE.nc", help="Where to write; default: <study>.nc, here.")
@click.option("--overwrite", is_flag=True, help="Replace another archive, and unfinished parts of another study.")
@click.option(
    "--workers", type=click.IntRange(min=0), default=0, metavar="N", help="Run in N processes of this machine."
)
@click.option(
    "--scheduler", metavar="ADDRESS", help="Run on the workers of this dask scheduler, tcp://... or tls://..."
)
@click.option("-v", "--verbose", is_flag=True, help="Tell also how it was computed.")
@_THREADS
@_JSON
def run(study: str, archive: Path | None, as_json: bool, verbose: bool, **how: Any) -> int:
    """Run STUDY and write its archive.

    With a progress bar, and the answer at the end. Started again after any interruption it goes on from what is
    finished.
    """
    from studies.commands import console, screens
    from studies.findings import numerics_used as choices
    from studies.protocol.options import RunOptions
    from studies.reporting import summary
    from studies.results.results import Results

    outcome = _run(study, archive, RunOptions(**how))
    code = summary.exit_code(outcome)
    if as_json:
        chosen = choices.as_json(Results.of(outcome.results))
        console.say_json(summary.as_json(outcome, code) | {"choice": chosen})
    else:
        (screens.show_details if verbose else screens.show_outcome)(outcome)
    return code


@commands.command()
@click.argument("archive", type=_FILE)
@click.option("-o", "folder", type=_FOLDER, metavar="FOLDER", help="Where to write; default: <archive>-report, here.")
def report(archive: Path, folder: Path | None) -> None:
    """Write a page with the figures of ARCHIVE.

    One self-contained HTML page, and the figures as SVG and PNG beside it.
    """
    _refuse_what_is_no_archive(archive)
    from studies.commands import console
    from studies.reporting.report import write_report

    page = write_report(archive, folder or Path(f"{archive.name.removesuffix('.nc')}-report"))
    console.say(f"wrote {page}")


@commands.command()
@click.argument("archive", type=_FILE)
@click.option("--all", "every", is_flag=True, help="Every attribute and variable.")
@click.option("--study", "text", is_flag=True, help="The study file's text and nothing else.")
def info(archive: Path, every: bool, text: bool) -> None:
    """Tell what is inside ARCHIVE and whether it is whole, on one screen.

    Where there is none yet, but an unfinished run of it (exit code 2): how far that has come, and how to go on.
    """
    _refuse_what_is_no_archive(archive)
    from results_schema.store.archive import describe, open_archive
    from studies.commands import console, screens
    from studies.findings.numerics_used import told_choices
    from studies.runs.archived import results_of

    found = describe(archive)
    if text:
        console.say(*str(found.attributes.get("study", "")).splitlines())
    elif every:
        screens.show_everything(found)
    else:
        screens.show_archive(found)
        if found.whole:
            console.paragraphs(*told_choices(results_of(open_archive(archive))))
    if not found.whole:
        raise ArchiveError(found.damage)


@commands.command()
@click.argument("first", type=_FILE)
@click.argument("second", type=_FILE)
def compare(first: Path, second: Path) -> int:
    """Tell what differs between the archives FIRST and SECOND: studies, statuses, results beyond their errors.

    Ends with 3 where variants of both differ by more than their errors explain, or in status.
    """
    from results_schema.store.archive import open_archive
    from studies.commands import screens
    from studies.reporting.comparison import compared
    from studies.runs.archived import results_of

    found = compared(results_of(open_archive(first)), results_of(open_archive(second)))
    screens.show_comparison(found)
    return 0 if found.agree else 3


@commands.command()
@click.argument("archive", type=_FILE)
@click.argument("file", type=_FILE)
@click.option("--results", "names", metavar="NAME,NAME", default="", help="These results alone; default: all.")
@click.option("--overwrite", is_flag=True, help="Replace another table.")
def export(archive: Path, file: Path, names: str, overwrite: bool) -> None:
    """Write ARCHIVE as a table, FILE.csv or FILE.parquet: one row per variant (and position).

    Swept numbers stand in the units of the study file, results in SI units.
    """
    from results_schema.store.archive import open_archive
    from studies.commands import console
    from studies.reporting.tabulated import write_table
    from studies.runs.archived import results_of

    chosen = [name.strip() for name in names.split(",") if name.strip()]
    left_out = write_table(results_of(open_archive(archive)), file, chosen, overwrite=overwrite)
    other = f"without what has other dimensions than its rows, in the archive: {', '.join(left_out)}"
    console.say(f"wrote {file}", *([other] if left_out else []))


@commands.command()
@click.argument("file", type=_FILE)
@click.argument("tool", required=False)
@click.option("--name", default="robot", show_default=True, help="NAME of the table.")
@click.option("--turned", nargs=3, type=float, default=(0.0, 0.0, 0.0), metavar="X Y Z", help="Of its root, rad.")
def arm(file: Path, tool: str | None, name: str, turned: tuple[float, float, float]) -> None:
    """Print the table [arm.NAME] of a study file for the robot of a URDF FILE.

    TOOL is the link whose origin is the tool centre point; the file may have one end alone without it.
    """
    import numpy as np

    from engine.robots.urdf import table_of
    from studies.commands import console

    console.say(*table_of(file, tool, name, np.array(turned)).splitlines())


@commands.command()
def schema() -> None:
    """Print the JSON schema of study files, with which editors complete and check them."""
    from engine.scene.study import json_schema
    from studies.commands import console
    from studies.protocol.study import kind_names

    console.say_json(json_schema(kind_names()))


@commands.command(name="list")
def list_() -> None:
    """List the built-in studies and the kinds of study."""
    from studies.commands import catalogue, screens
    from studies.protocol.study import kind_named, kind_names

    screens.show_studies(
        catalogue.entries(), catalogue.measured(), [(kind, kind_named(kind).summary) for kind in kind_names()]
    )


@commands.command()
@click.option("--modes", type=click.IntRange(1, 64), default=10, show_default=True, help="Modes of the beam.")
@click.option("--steps", type=click.IntRange(1, 10**6), default=1000, show_default=True, help="Steps of a passage.")
@click.option("--variants", type=click.IntRange(1, 10**6), default=16384, show_default=True, help="Variants at once.")
@click.option("--scheme", default="average-acceleration", show_default=True, help="Time integration scheme.")
@click.option("--ties", type=click.IntRange(1, 12), default=1, show_default=True, help="Masses on the beam at once.")
@_THREADS
@_JSON
def bench(threads: int | None, as_json: bool, **scene: Any) -> None:
    """Measure the pace of the march on this machine."""
    from studies.commands import console, screens
    from studies.commands.bench import Scene, measure

    found = measure(Scene(**scene), threads)
    if as_json:
        console.say_json(asdict(found))
    else:
        screens.show_throughput(found)


def _run(study: str, archive: Path | None, options: RunOptions) -> Outcome:
    """Run a study to its archive, with a progress bar; signals stop it with finished work kept."""
    with stopping.stop_on_signals() as stop:
        import engine
        from studies.commands import catalogue, console, screens
        from studies.protocol.library import find_study
        from studies.protocol.listener import Listener
        from studies.runs.runner import run_to_archive

        path = find_study(study)
        catalogue.refuse_table(archive)
        loaded = engine.load(path)
        with console.progress_bar(path.stem) as bar:
            listener = Listener(bar.show, bar.say, bar.note, screens.warn_of)
            return run_to_archive(loaded, archive or Path(f"{path.stem}.nc"), options, listener=listener, stop=stop)


def _refuse_what_is_no_archive(archive: Path) -> None:
    """Tell of a study in its place, and of an unfinished run where it is not there yet. Raises BadInput."""
    from results_schema.store.parts import finished_so_far, unfinished_study
    from studies.commands import catalogue

    catalogue.refuse_study(archive)
    if archive.exists() or (parts := finished_so_far(archive)) is None:
        return
    variants = {int(number) for part in parts for number in part}
    pieces = sum(part.size == 0 for part in parts)
    so_far = counted(pieces, "finished piece") if pieces else f"parts with {counted(len(variants), 'finished variant')}"
    study = catalogue.as_typed(unfinished_study(archive))
    again = f"wanderlast run {study} -o {archive}" if study else "the same command that began it"
    what = "not there yet; an unfinished run of it is"
    remedy = f"wait for the run if one is at work, or go on from there: {again}"
    raise BadInput(what, where=str(archive), expected="a finished archive", received=so_far, remedy=remedy)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; every error ends as one message on standard error."""
    command = list(sys.argv[1:] if arguments is None else arguments)

    def invoke() -> int:
        if arguments is None:
            process.set_up()
            if command[:1] and command[0] in MAKES_DATASETS:
                process.leave_dask_out()
        code = commands.main(command, prog_name="wanderlast", standalone_mode=False)
        return code if isinstance(code, int) else 0

    code = trouble.exit_code_of(invoke)
    if arguments is None:
        stopping.end_undisturbed()
        gc.freeze()  # looking through what is left would take a third of a second
    return code


if __name__ == "__main__":
    sys.exit(main())
