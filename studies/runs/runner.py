"""From a study to its archive: lock, parts, assembly, one file written whole.

Killed at any moment it leaves finished parts behind, and goes on from them when it is started again.
"""

import os
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial, singledispatch
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr

from engine.kernels.compiling import told_of_compiling
from engine.model.distinct_models import base_scene
from engine.scene.study import Study
from engine.study_file.changes import Change, changes
from results_schema.errors import ArchiveBusy, ArchiveError, BadInput, OutputFailed, shortened
from results_schema.store import files
from results_schema.store.archive import (
    OutputState,
    changed_files,
    open_archive,
    output_state,
    study_text,
    write_archive,
)
from results_schema.store.parts import Origin, PartStore, bytes_so_far
from studies.protocol.listener import NOBODY, Listener
from studies.protocol.options import RunOptions
from studies.protocol.parts import Pieces, Variants, Work
from studies.protocol.stopping import Stop
from studies.protocol.study import compared, kind_of
from studies.results.cells import counts_of
from studies.results.results import Results
from studies.runs import unreduced
from studies.runs.archived import with_first_frequency
from studies.runs.audit import GROUP, audit_group, audit_group_of_pieces, used_of
from studies.runs.identity import check_unchanged, files_of, run_key
from studies.runs.not_audited import why_none, why_none_of_pieces
from studies.runs.provenance import attributes

CHANGES_SHOWN = 3  # of the keys by which an archive's study differs
AUDITING = "audit: some variants once more with more of everything"
UNREDUCED = "some variants once more by the unreduced finite-element model"


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a run.

    results: the archive's root. resumed: variants (of a study that measures: pieces) that an earlier start had
    finished. was_finished: there was nothing to do. seconds: of this run. remarks: what is worth knowing about a study
    that was run. audit, unreduced: the archive's groups, where variants were audited and computed unreduced.
    """

    archive: Path
    results: xr.Dataset
    resumed: int
    was_finished: bool
    seconds: float
    remarks: tuple[str, ...] = ()
    audit: xr.Dataset | None = None
    unreduced: xr.Dataset | None = None


def run_to_archive(
    study: Study,
    archive: Path,
    options: RunOptions,
    *,
    listener: Listener = NOBODY,
    stop: Stop | None = None,
) -> Outcome:
    """Run a study and write its archive, or find it finished there.

    Raises BadInput, and OutputFailed where nothing can be written or the disk is too small, before anything is
    computed or written; later Interrupted, OutputFailed and ArchiveBusy with finished work kept; ArchiveError when
    this study's archive is there and damaged.
    """
    started, stop = time.perf_counter(), stop or Stop()
    kind = kind_of(study)
    run = _Run(study, archive, options, stop, started)
    if os.path.isfile(archive) and _look(run) == "same study, finished":  # which takes no place to write
        return _found_finished(run)
    files.check_output_place(archive)
    _look(run)
    parts = kind.parts(study)
    files.check_free(archive.parent, parts.disk_bytes - bytes_so_far(archive), parts.words)
    listener.remark(parts.remarks)
    key = run_key(study, parts.names)
    origin = Origin(study.source.name, study.source.text, partial(_changed_parts, study))
    with PartStore(archive, key, partial(_look, run), study=origin, discard=options.overwrite) as store:
        if _look(run) == "same study, finished":  # somebody else has finished it since the run began
            store.remove()
            return _found_finished(run)
        with parts.place(options.where) as here, told_of_compiling(listener.stage):
            work = Work(None, stop, listener, place=here)
            resumed = parts.compute(store, work)
            work.check()
            root = _as_declared(parts.gather(store), study)
            groups = groups_beside(parts, root, work)
        seconds = _write(run, root, store, groups)
    return Outcome(
        archive, root, resumed, False, seconds, tuple(parts.remarks), groups.get(GROUP), groups.get(unreduced.GROUP)
    )


class _Run(NamedTuple):
    """What a run is asked; started: clock at its start."""

    study: Study
    archive: Path
    options: RunOptions
    stop: Stop
    started: float


@singledispatch
def groups_beside(parts: Any, root: xr.Dataset, work: Work) -> Mapping[str, xr.Dataset]:
    """What an archive holds beside its root, by group. Raises Interrupted."""
    raise NotImplementedError


@groups_beside.register
def _of_variants(parts: Variants, root: xr.Dataset, work: Work) -> Mapping[str, xr.Dataset]:
    """The bodies, the audit, and the comparison with the unreduced model."""
    from engine.batch.dataset import model_groups

    plan = parts.plan
    work.listener.stage(AUDITING)
    compared = parts.to_audit(root)
    audit = audit_group(plan, compared, work)
    root.attrs.update({} if audit else why_none(plan, used_of(plan, compared)))
    models = model_groups(plan.base)
    if plan.study.output.keeps_variants:
        models = with_first_frequency(models, Results(root, plan.study))
    if plan.study.output.unreduced:
        work.listener.stage(UNREDUCED)
    return models | unreduced.unreduced_group(plan, root, work.check) | audit


@groups_beside.register
def _of_pieces(parts: Pieces, root: xr.Dataset, work: Work) -> Mapping[str, xr.Dataset]:
    """The bodies of the scene without its sweep, and the audit."""
    from engine.batch.dataset import model_groups

    count = parts.audited_of(root)
    if count:
        work.listener.stage(AUDITING)
    audit = audit_group_of_pieces(parts, root, count, work)
    root.attrs.update({} if audit else why_none_of_pieces(parts, count))
    return model_groups(base_scene(parts.study)) | audit


def _write(run: _Run, root: xr.Dataset, store: PartStore, groups: Mapping[str, xr.Dataset]) -> float:
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
    _remove_leftovers(run)
    found = open_archive(run.archive)
    seconds, finished = time.perf_counter() - run.started, sum(counts_of(found.root).values())
    beside = found.groups.get(GROUP), found.groups.get(unreduced.GROUP)
    return Outcome(run.archive, found.root, finished, True, seconds, (), *beside)


def _remove_leftovers(run: _Run) -> None:
    """Remove the parts and the lock of a run of this study that died behind its archive; those of others stay, and what
    cannot be removed harms nobody."""
    if os.path.isdir(f"{run.archive}.parts") or os.path.isfile(f"{run.archive}.lock"):
        with suppress(BadInput, ArchiveBusy, OutputFailed):
            key = run_key(run.study, kind_of(run.study).parts(run.study).names)
            with PartStore(run.archive, key) as store:
                store.remove()


def _look(run: _Run) -> OutputState:
    """What is at the output's place, as far as it matters; refuses what must not be replaced. Raises BadInput."""
    _check_target(run.study, run.archive)
    return _state(run.study, run.archive, run.options)


def _check_vacant(run: _Run) -> None:
    """Refuse to replace what has come to the output's place since the run began. Raises BadInput."""
    _check_target(run.study, run.archive)
    if run.archive.exists() and not run.options.overwrite:
        what = "something else has come there while the study ran"
        remedy = "choose another place with -o, or replace it with --overwrite; finished work is kept"
        raise BadInput(what, where=str(run.archive), expected="no file", remedy=remedy)


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
        what, received = _something_else(study, archive)
        raise BadInput(
            what,
            where=str(archive),
            expected="no file, or the archive of this very study",
            received=received,
            remedy="choose another place with -o, or replace it with --overwrite",
        )
    return state


def _something_else(study: Study, archive: Path) -> tuple[str, str]:
    """What the file at the output's place is, and by which keys its study differs."""
    try:
        found = changes(study_text(archive), study.source.text)
    except ValueError:  # no archive, or one whose text is no study
        return "there is something else already", ""
    same = not {"kind", "title"} & {change.key for change in found}
    return (
        f"the archive there is of {'another state of this' if same else 'another'} study",
        _in_words(found) or "the same keys and values, with other comments or in another order",
    )


def _changed_parts(study: Study, other: str) -> str:
    """By which keys the study of unfinished parts differs; "" where its text was not kept or cannot be read."""
    try:
        found = changes(other, study.source.text) if other else []
    except ValueError:
        return ""
    otherwise = "by another version of wanderlast or with other contents of its files"
    same = otherwise if other == study.source.text else "with other comments or in another order"
    return _in_words(found) or (f"the same keys and values, {same}" if other else "")


def _in_words(found: Sequence[Change]) -> str:
    """The first changes of a study, and how many more there are."""
    shown = [f"{key}: {_written(old)}, now {_written(new)}" for key, old, new in found[:CHANGES_SHOWN]]
    more = [f"{len(found) - CHANGES_SHOWN} more"] if len(found) > CHANGES_SHOWN else []
    return "; ".join([*shown, *more])


def _written(value: Any) -> str:
    return "left out" if value is None else shortened(value)


def _as_declared(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """That it is as declared is our affair, not the user's."""
    try:
        return compared(dataset, study)
    except ArchiveError as error:
        raise AssertionError(str(error)) from error
