"""From a study to its archive: lock, parts, march, assembly, one file written whole.

Killed at any moment it leaves finished parts behind, and goes on from them when it is started again.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from engine.scene import Study
from results_schema import files
from results_schema.archive import OutputState, open_archive, output_state, write_archive
from results_schema.errors import ArchiveError, BadInput, Interrupted
from results_schema.parts import PartStore
from studies.gathering import Gatherer
from studies.options import RunOptions
from studies.provenance import attributes
from studies.stopping import Stop
from studies.study import finish, kind_of

if TYPE_CHECKING:
    import xarray as xr

    from engine.plan import Plan

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a run.

    results: the archive's root. resumed: variants that an earlier start had finished. was_finished: there was
    nothing to do. seconds: of this run. remarks: what is worth knowing about a study that was run.
    """

    archive: Path
    results: xr.Dataset
    resumed: int
    was_finished: bool
    seconds: float
    remarks: tuple[str, ...] = ()


def run_to_archive(
    study: Study, archive: Path, options: RunOptions, *, progress: Progress | None = None, stop: Stop | None = None
) -> Outcome:
    """Run a study and write its archive, or find it finished there.

    Raises BadInput, and OutputFailed where nothing can be written or the disk is too small, before anything is
    computed or written; later Interrupted, OutputFailed and ArchiveBusy with finished work kept; ArchiveError when
    this study's archive is there and damaged.
    """
    from engine.plan import make_plan
    from engine.remarks import remarks

    started, stop = time.perf_counter(), stop or Stop()
    kind = kind_of(study)
    files.check_output_place(archive)
    _check_target(study, archive)
    if _state(study, archive, options) == "same study, finished":
        root = open_archive(archive).root
        return Outcome(archive, root, int(root["status"].size), True, time.perf_counter() - started)
    plan = make_plan(study, reduction=kind.reduction(study))
    files.check_free(archive.parent, 2 * plan.disk_bytes, f"the parts and the archive of {plan.size} variants")
    worth_knowing = tuple(remarks(plan))
    with _store(plan, archive, options) as store:
        done = store.finished()
        _march(plan, store, done, options, progress, stop)
        stop.check()
        root = _finished_dataset(plan, store)
        seconds = time.perf_counter() - started
        root = root.assign_attrs(attributes(study, plan.key, seconds))
        stop.check()
        write_archive(archive, root, _groups(plan))
        store.remove()
    return Outcome(archive, root, int(done.size), False, seconds, worth_knowing)


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
    state = output_state(archive, study.source.sha256)
    if state == "another study":
        raise BadInput(
            "there is something else already",
            where=str(archive),
            expected="no file, or the archive of this very study",
            remedy="choose another place with -o, or replace it with --overwrite",
        )
    return state


def _store(plan: Plan, archive: Path, options: RunOptions) -> PartStore:
    return (PartStore.discard_foreign if options.overwrite else PartStore)(archive, plan.key)


def _march(
    plan: Plan, store: PartStore, done: np.ndarray, options: RunOptions, progress: Progress | None, stop: Stop
) -> None:
    from engine.execution import execute

    if progress is not None:
        progress(int(done.size), plan.size)
    if done.size == plan.size:
        return
    try:
        with Gatherer(store.write) as parts:
            execute(plan, parts.add, threads=options.threads, progress=progress, stop=stop.event, done=done)
    except Interrupted:
        stop.check()
        raise


def _finished_dataset(plan: Plan, store: PartStore) -> xr.Dataset:
    """The study's dataset from all parts. That it is as declared is our affair, not the user's."""
    from engine.dataset import build

    arrays, selected = store.assemble(plan.size), store.assemble_selected()
    dataset = build(plan, arrays, selected if selected.variants.size else None)
    try:
        return finish(dataset, plan.study)
    except ArchiveError as error:
        raise AssertionError(str(error)) from error


def _groups(plan: Plan) -> dict[str, xr.Dataset]:
    from engine.dataset import model_groups

    return dict(model_groups(plan))
