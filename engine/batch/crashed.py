"""What stands in an archive of variants that end every process that computes them: a status, and no values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from engine.accuracy.jobs import Job, Share
from engine.batch import chunk
from engine.batch.plan import NOBODY, Plan
from results_schema.arrays import Counts
from results_schema.errors import WorkersGaveUp
from results_schema.status import Status
from results_schema.store.rows import Arrays, Chunk, Rows

NUMBERS = {"status": np.int8(Status.CRASHED), "diverged_step": np.int64(-1)}  # other whole numbers are 0


def crashed_chunks(plan: Plan, crashed: Sequence[Counts], share: Share) -> Iterator[Chunk]:
    """The chunks of such variants: as of another variant, whose results say what there would be, emptied. Raises
    WorkersGaveUp where there is no other."""
    variants = np.unique(np.concatenate([NOBODY, *crashed]))
    if not variants.size:
        return
    others = np.setdiff1d(np.arange(plan.size), variants)
    if not others.size:
        raise WorkersGaveUp("every variant ends the process that computes it", remedy="try the study without workers")
    shown = np.isin(variants, plan.shown)
    of_shown = np.intersect1d(others, plan.shown)
    for own, like in ((variants[shown], of_shown if of_shown.size else others), (variants[~shown], others)):
        if own.size:
            (found,) = share(plan, [_alone(plan, int(like[0]))])
            yield Chunk(_emptied(found.rows, own), None if found.selected is None else _emptied(found.selected, own))


def _alone(plan: Plan, variant: int) -> Job[Chunk]:
    """The chunk of one variant."""
    (group,) = (number for number, group in enumerate(plan.groups) if variant in group.variants)
    return Job(partial(chunk.march_chunk, group=group, beside=len(plan.groups)), np.array([variant], dtype=np.int64))


def _emptied(rows: Rows, variants: Counts) -> Rows:
    """Rows of so many variants, of the same arrays without values."""
    found: Arrays = {}
    for name, array in rows.arrays.items():
        shape = (variants.size, *array.shape[1:])
        empty = np.nan if array.dtype.kind == "f" else NUMBERS.get(name, 0)
        found[name] = np.full(shape, empty, dtype=array.dtype)
    return Rows(variants, found)
