"""From a study to its archive: lock, parts, march, assembly, one file written whole.

Killed at any moment it leaves finished parts behind, and goes on from them when it is started again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from engine.scene.study import Study
from results_schema.errors import ArchiveError, BadInput, Interrupted
from results_schema.store import files
from results_schema.store.archive import OutputState, changed_files, open_archive, output_state, write_archive
from results_schema.store.parts import PartStore
from results_schema.store.pieces import PieceStore
from results_schema.store.run_folder import RunFolder
from studies.protocol.measuring import MeasuringKind, Work, disk_bytes, measure
from studies.protocol.options import RunOptions
from studies.protocol.stopping import Stop
from studies.protocol.study import Kind, finish, gathered, kind_of
from studies.results.results import Results
from studies.runs.archived import with_first_frequency
from studies.runs.audit import GROUP, audit_group, refuse_audit
from studies.runs.identity import check_unchanged, files_of, run_key
from studies.runs.part_writer import Gatherer
from studies.runs.provenance import attributes
from studies.runs.unreduced import check_unreduced, refuse_unreduced, unreduced_group

if TYPE_CHECKING:
    import xarray as xr

    from engine.batch.plan import Plan

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a run.

    results: the archive's root. resumed: variants (of a study that measures: pieces) that an earlier start had
    finished. was_finished: there was nothing to do. seconds: of this run. remarks: what is worth knowing about a study
    that was run. audit: the archive's group, where variants were audited.
    """

    archive: Path
    results: xr.Dataset
    resumed: int
    was_finished: bool
    seconds: float
    remarks: tuple[str, ...] = ()
    audit: xr.Dataset | None = None


def run_to_archive(
    study: Study, archive: Path, options: RunOptions, *, progress: Progress | None = None, stop: Stop | None = None
) -> Outcome:
    """Run a study and write its archive, or find it finished there.

    Raises BadInput, and OutputFailed where nothing can be written or the disk is too small, before anything is
    computed or written; later Interrupted, OutputFailed and ArchiveBusy with finished work kept; ArchiveError when
    this study's archive is there and damaged.
    """
    started, stop = time.perf_counter(), stop or Stop()
    kind = kind_of(study)
    files.check_output_place(archive)
    run = _Run(study, archive, options, progress, stop, started)
    if _look(run) == "same study, finished":
        return _found_finished(run)
    return _measured(kind, run) if isinstance(kind, MeasuringKind) else _marched(kind, run)


class _Run(NamedTuple):
    """What a run is asked; started: clock at its start."""

    study: Study
    archive: Path
    options: RunOptions
    progress: Progress | None
    stop: Stop
    started: float


def _marched(kind: Kind, run: _Run) -> Outcome:
    """A study of one scene and its sweep: all variants of its plan, in parts."""
    from engine.batch.dataset import model_groups
    from engine.batch.plan import make_plan
    from engine.batch.plausibility import remarks

    check_unreduced(run.study)
    plan = make_plan(run.study, reduction=kind.reduction(run.study), results=kind.name)
    files.check_free(run.archive.parent, 2 * plan.disk_bytes, f"the parts and the archive of {plan.size} variants")
    worth_knowing, key = tuple(remarks(plan)), run_key(run.study)
    make_store = PartStore.discard_foreign if run.options.overwrite else PartStore
    with make_store(run.archive, key, partial(_look, run)) as store:
        if _look(run) == "same study, finished":
            return _given_up(store, run)
        done = store.finished()
        _march(plan, store, done, run)
        run.stop.check()
        root = _finished_dataset(plan, store)
        audit = audit_group(plan, root, Work(run.options.threads, run.stop))
        models = with_first_frequency(model_groups(plan.base), Results(root, run.study))
        groups = models | unreduced_group(plan, root, run.stop.check) | audit
        seconds = _write(run, root, store, groups)
    return Outcome(run.archive, root, int(done.size), False, seconds, worth_knowing, audit.get(GROUP))


def _measured(kind: MeasuringKind, run: _Run) -> Outcome:
    """A study in pieces, one after another."""
    refuse_unreduced(run.study)
    refuse_audit(run.study)
    pieces = kind.pieces(run.study)
    files.check_free(run.archive.parent, disk_bytes(pieces), "the pieces and the archive")
    key = run_key(run.study, [piece.name for piece in pieces])
    make_store = PieceStore.discard_foreign if run.options.overwrite else PieceStore
    with make_store(run.archive, key, partial(_look, run)) as store:
        if _look(run) == "same study, finished":
            return _given_up(store, run)
        names = {piece.name for piece in pieces}
        done = {name: found for name, found in store.finished().items() if name in names}
        work, progress = Work(run.options.threads, run.stop), run.progress or (lambda finished, total: None)
        found = measure(pieces, work, done=done, keep=store.write, progress=progress)
        run.stop.check()
        root = _as_declared(gathered, found, run.study)
        seconds = _write(run, root, store, _bodies(run.study))
    return Outcome(run.archive, root, len(done), False, seconds)


def _bodies(study: Study) -> Mapping[str, xr.Dataset]:
    """The bodies of the scene without its sweep, by group."""
    from engine.batch.dataset import model_groups
    from engine.model.distinct_models import base_scene

    return model_groups(base_scene(study))


def _write(run: _Run, root: xr.Dataset, store: RunFolder, groups: Mapping[str, xr.Dataset]) -> float:
    """Write the archive and remove its parts; the seconds that the run has taken."""
    seconds = time.perf_counter() - run.started
    root = root.assign_attrs(attributes(run.study, store.key, seconds))
    run.stop.check()
    try:
        check_unchanged(run.study)
    except BadInput:
        store.remove()  # some may be of the files as they were, some as they are
        raise
    write_archive(run.archive, root, groups, partial(_check_vacant, run))
    store.remove()
    return seconds


def _found_finished(run: _Run) -> Outcome:
    """There was nothing to do."""
    found = open_archive(run.archive)
    seconds, audit = time.perf_counter() - run.started, found.groups.get(GROUP)
    return Outcome(run.archive, found.root, int(found.root["status"].size), True, seconds, audit=audit)


def _given_up(store: RunFolder, run: _Run) -> Outcome:
    """Somebody else has finished this very study since the run began."""
    store.remove()
    return _found_finished(run)


def _look(run: _Run) -> OutputState:
    """What is at the output's place, as far as it matters; refuses what must not be replaced. Raises BadInput."""
    _check_target(run.study, run.archive)
    return _state(run.study, run.archive, run.options)


def _check_vacant(run: _Run) -> None:
    """Refuse to replace what has come to the output's place since the run began. Raises BadInput."""
    _check_target(run.study, run.archive)
    if run.archive.exists() and not run.options.overwrite:
        raise BadInput(
            "something else has come there while the study ran",
            where=str(run.archive),
            expected="no file",
            remedy="choose another place with -o, or replace it with --overwrite; finished work is kept",
        )


def _check_target(study: Study, archive: Path) -> None:
    """Refuse to replace what is no archive, above all the study file, whatever the options. Raises BadInput."""
    name = study.source.name
    if name and archive.exists() and Path(name).exists() and archive.samefile(name):
        raise BadInput("the output is the study file itself", where=str(archive), remedy="choose another place with -o")
    files.check_replaceable(archive)


def _state(study: Study, archive: Path, options: RunOptions) -> OutputState:
    """What is at the output's place, as far as it matters; refuses another study's archive."""
    if options.overwrite:
        return "absent"
    hashes = files_of(study)
    state = output_state(archive, study.source.sha256, hashes)
    if state == "same study, other files":
        raise BadInput(
            "the archive there was computed with other contents of the study's files",
            where=str(archive),
            expected="the files as they were",
            received=f"changed: {', '.join(changed_files(archive, hashes)) or 'which files there are'}",
            remedy="choose another place with -o, or compute it again with --overwrite",
        )
    if state == "another study":
        raise BadInput(
            "there is something else already",
            where=str(archive),
            expected="no file, or the archive of this very study",
            remedy="choose another place with -o, or replace it with --overwrite",
        )
    return state


def _march(plan: Plan, store: PartStore, done: np.ndarray, run: _Run) -> None:
    from engine.batch.execution import execute

    if run.progress is not None:
        run.progress(int(done.size), plan.size)
    if done.size == plan.size:
        return
    threads, stop = run.options.threads, run.stop
    try:
        with Gatherer(store.write) as parts:
            execute(plan, parts.add, threads=threads, progress=run.progress, stop=stop.event, done=done)
    except Interrupted:
        stop.check()
        raise


def _finished_dataset(plan: Plan, store: PartStore) -> xr.Dataset:
    """The study's dataset from all parts. That it is as declared is our affair, not the user's."""
    from engine.batch.dataset import build

    arrays, selected = store.assemble(plan.size), store.assemble_selected()
    dataset = build(plan, arrays, selected if selected.variants.size else None)
    return _as_declared(finish, dataset, plan.study)


def _as_declared(make: Callable[[Any, Study], xr.Dataset], found: Any, study: Study) -> xr.Dataset:
    try:
        return make(found, study)
    except ArchiveError as error:
        raise AssertionError(str(error)) from error
