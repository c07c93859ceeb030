"""The work of a study, cut into parts: chunks of variants of a march, or pieces by name. Parts are kept as they finish,
so a killed run goes on from there, and put together at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.jobs import Job
from engine.march.stepper import Halted
from results_schema.arrays import Counts
from results_schema.cores import cores
from results_schema.errors import Interrupted, WorkersGaveUp
from results_schema.lazy_imports import xr
from results_schema.store.rows import Chunk, Collector, Gatherer, Rows, RowsOnDisk, joined
from results_schema.store.tables import from_dataset, to_dataset
from results_schema.variables import declarations
from studies.protocol.kept_pilots import NAME as PILOTS
from studies.protocol.kept_pilots import KeptPilots
from studies.protocol.listener import NOBODY, Listener
from studies.protocol.stopping import AskedElsewhere, Stop
from studies.protocol.store import Store
from studies.protocol.streamed import streamed, summarised, with_coordinates
from studies.results.formatting import counted
from studies.results.results import Results

if TYPE_CHECKING:
    from engine.batch.executors import Place, Where
    from engine.scene.study import Study
    from studies.protocol.study import Kind, PiecedKind

MOST_TIMES, PATIENCE = 2.0, 10.0  # of the time of a run, and s, beyond which one audited variant is too dear
PIECES_BYTES = 64 * 2**20  # more than what studies that measure leave on the disk
GRACE_SECONDS = 1.0  # for a piece to end by itself when it is to stop
USED = "_used"  # the end of the names of what a variant was computed with


class Work:
    """How parts are computed: where, who listens, and whether somebody asked to stop.

    threads: of this process, where no place is given. chunk: variants of a task where that is fixed, as of
    `engine.run`.
    """

    def __init__(
        self,
        threads: int | None = None,
        stop: Stop | None = None,
        listener: Listener = NOBODY,
        chunk: int | None = None,
        place: Place | None = None,
    ) -> None:
        from engine.batch.executors import Threads

        self.place: Place = place or Threads(threads or cores())
        self.stop = stop or Stop()
        self.listener = listener
        self.chunk = chunk

    @property
    def threads(self) -> int:
        """Threads that a piece may use."""
        return self.place.threads

    def halted(self) -> bool:
        """Whether somebody has asked to stop; as the `halted` of `engine.march.march.march`."""
        return self.stop.asked

    def check(self) -> None:
        """Raise Interrupted if somebody has asked to stop."""
        self.stop.check()


class Parts(Protocol):
    """The work of one study.

    noun: what is counted. names: of the parts, where they are known beforehand. words, disk_bytes: what it leaves on
    the disk, at most. remarks: what is worth knowing about the study.
    """

    noun: str
    names: Sequence[str]
    words: str
    disk_bytes: int
    remarks: Sequence[str]

    def check_memory(self) -> None:
        """Raise BadInput where the results are more than memory holds, for whom keeps them there."""

    def place(self, where: Where) -> AbstractContextManager[Place]:
        """Where they are best computed, but for what somebody says. Raises BadInput and WorkersGaveUp."""

    def compute(self, store: Store, work: Work) -> int:
        """Compute what the store does not hold yet; the number of those that it held. Raises Interrupted."""

    def gather(self, store: Store) -> xr.Dataset:
        """The study's dataset from its finished parts. Raises ArchiveError where one is damaged."""


class Variants:
    """All variants of a march's plan, in chunks. Raises BadInput where there can be no plan."""

    noun = "variant"
    names: Sequence[str] = ()
    remarks: Sequence[str]

    def __init__(self, kind: Kind, study: Study) -> None:
        from engine.batch.plan import make_plan
        from engine.batch.plausibility import check_limits, remarks

        if study.output.unreduced:
            from engine.unreduced.comparison import check_unreduced

            check_unreduced(study)
        self.kind = kind
        self.plan = make_plan(study, reduction=kind.reduction(study), results=kind.name)
        check_limits(self.plan)
        self.words = f"the parts and the archive of {counted(self.plan.size, 'variant')}"
        # The parts, the archive, and results on their way from these to that where they do not fit into memory.
        self.disk_bytes = 2 * self.plan.disk_bytes + (self.plan.disk_bytes - self.plan.gathered_bytes)
        self.remarks = tuple(remarks(self.plan))

    def check_memory(self) -> None:
        """Raise BadInput where the results are more than memory holds."""
        from engine.batch.plan import check_memory

        check_memory(self.plan.study, self.plan.size, self.plan.disk_bytes)

    def place(self, where: Where) -> AbstractContextManager[Place]:
        """Processes where there are many scenes, else threads."""
        from engine.batch.executors import in_processes, place

        return in_processes(where) if self.plan.many_scenes else place(**where)

    def compute(self, store: Store, work: Work) -> int:
        """March what the store does not hold yet."""
        from engine.batch.execution import choose, execute

        done = np.unique(np.concatenate([np.empty(0, np.int64), *store.finished().values()]))
        work.listener.progress(int(done.size), self.plan.size)
        work.listener.stage("measuring what each variant needs, then marching")
        try:
            choose(
                self.plan, work.place, work.stop.event, KeptPilots(store), partial(_told_of_pilots, work)
            )  # audits ask for it, too
            work.listener.note("")
            if done.size < self.plan.size:
                with Gatherer(partial(self._keep, store)) as parts:
                    how: dict[str, Any] = {"chunk": work.chunk, "stop": work.stop.event}
                    execute(self.plan, parts.add, work.place, progress=work.listener.progress, done=done, **how)
        except Interrupted:
            work.check()
            raise
        return int(done.size)

    def _keep(self, store: Store, chunk: Chunk) -> None:
        """Write chunks, joined, as one part: what is kept of one chunk may be more than what is kept of several."""
        kept = self.plan.reduce(self.plan, chunk)
        store.write(kept.name, kept.tables)

    def to_audit(self, root: xr.Dataset) -> xr.Dataset:
        """The study's dataset as audits ask for it: with the status of every variant."""
        return root

    def gather(self, store: Store) -> xr.Dataset:
        """The march's dataset with the study's own results."""
        rows = store.rows(self.plan.size, self.plan.numbers_bytes)
        return self._collected(store) if rows is None else self._streamed(store, rows)

    def _streamed(self, store: Store, rows: RowsOnDisk) -> xr.Dataset:
        """The same without the results of all variants in memory."""
        from engine.batch.dataset import with_histories, with_ratios

        parts = (Chunk.of(store.read(name)) for name in store.finished() if name != PILOTS)
        dataset, histories = streamed(self.kind, self.plan, parts, rows)
        whole = with_coordinates(self.kind, with_ratios(self.plan, dataset), self.plan.study)
        named = self._named(whole)
        if named.size:
            used = {name: whole[name].values.reshape(-1) for name in map(str, whole.data_vars) if name.endswith(USED)}
            more = self._histories(named, used)
            histories = joined([own for own in (histories, more) if own is not None])
        return whole if histories is None else with_histories(self.plan, whole, histories)

    def _collected(self, store: Store) -> xr.Dataset:
        found = Collector(self.plan.size)
        for name in store.finished():
            if name != PILOTS:
                found.add(Chunk.of(store.read(name)))
        assert found.finished.all(), "variants are missing"
        dataset = self._summarised(found)
        named = self._named(dataset)
        if not named.size:
            return dataset
        used = {name: column for name, column in found.arrays.items() if name.endswith(USED)}
        found.select(self._histories(named, used))
        return self._summarised(found)

    def _named(self, dataset: xr.Dataset) -> Counts:
        """The variants that the answer names, of which no history is kept yet although those of others are."""
        from engine.batch.plan import NAMED

        if self.plan.study.output.histories != "auto":
            return np.empty(0, np.int64)
        indices = self.kind.named(Results(dataset, self.plan.study))[:NAMED]
        named = [int(np.ravel_multi_index(index, self.plan.cases.shape)) if index else 0 for index in indices]
        return np.setdiff1d(np.array(named, dtype=np.int64), self.plan.shown)

    def _histories(self, variants: Counts, used: Mapping[str, NDArray[Any]]) -> Rows | None:
        """The histories of some variants from what all were computed with."""
        from engine.batch.chunk import histories_of

        return histories_of(self.plan, variants, {name: column[variants] for name, column in used.items()})

    def _summarised(self, found: Collector) -> xr.Dataset:
        from engine.batch.dataset import build

        dataset = summarised(self.kind, build(self.plan, found.arrays, found.selected), self.plan.study)
        return with_coordinates(self.kind, dataset, self.plan.study)


def _told_of_pilots(work: Work, done: int, total: int) -> None:
    """Variants are marched when all pilots are measured: until then none is finished."""
    work.listener.note(f"pilots of {done} of {counted(total, 'scene')} measured")


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a study's work, about 1 to 20 s of it, which depends on no other piece.

    name: small letters, digits and dashes, unique in its study. words: what it does. seconds: expected on two cores.
    size: bytes on the disk, where they are many.
    """

    name: str
    words: str
    compute: Callable[[Work], xr.Dataset]
    seconds: float = 1.0
    size: int = 0


class TextTable(NamedTuple):
    """A table for people: title, headings, rows of text."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


class Foreseen(NamedTuple):
    """What a run in pieces will take. study: with what it leaves open as it was found; table: what some variants were
    computed with; seconds: of all pieces and the audit, of so many variants; bytes: of the archive. remark: what is not
    known, or ""."""

    study: Study
    table: TextTable
    seconds: float
    bytes: int
    audited: int
    remark: str = ""


class Took(NamedTuple):
    """Seconds, about, of all marches of a study, and of one variant that is computed again."""

    whole: float
    again: float

    @property
    def too_dear(self) -> bool:
        """Whether no variant is computed again unless the study asks for it."""
        return self.again > max(MOST_TIMES * self.whole, PATIENCE)


class Pieces:
    """Pieces by name: one after another on the threads of this process, side by side on workers. Raises BadInput where
    the study asks for what only variants have."""

    noun, words = "piece", "the pieces and the archive"

    def __init__(self, kind: PiecedKind, study: Study) -> None:
        if study.output.unreduced:
            what = "a study that measures has no variants to compute again"
            raise study.source.fault("output.unreduced", what, expected="0")
        if study.solver.audit not in ("auto", 0) and not kind.audit_seconds:
            what = "a study of this kind marches no variants to audit"
            raise study.source.fault("solver.audit", what, expected='0 or "auto"')
        self.kind, self.study = kind, study
        self.pieces = kind.pieces(study)
        self.remarks = kind.remarks(study)
        self.names: Sequence[str] = [piece.name for piece in self.pieces]
        self.disk_bytes = PIECES_BYTES + 2 * sum(piece.size for piece in self.pieces)

    @property
    def audited(self) -> int:
        """How many variants are computed again."""
        from engine.batch.audit import enough
        from engine.scene.sweep import expand

        wanted, cases = self.study.solver.audit, expand(self.study)
        if wanted != "auto" or not self.kind.audit_seconds:
            return 0 if wanted == "auto" else min(int(wanted), cases.size)
        whole = sum(piece.seconds for piece in self.pieces)
        return enough(cases.size, whole, lambda count: count * self.kind.audit_seconds * whole / cases.size)

    def audited_of(self, dataset: xr.Dataset) -> int:
        """The same once it is known what variants were computed with: none where one alone would take much longer than
        all of them did."""
        took = self.kind.took(dataset) if self.study.solver.audit == "auto" else None
        return 0 if took is not None and took.too_dear else self.audited

    def place(self, where: Where) -> AbstractContextManager[Place]:
        """Threads."""
        from engine.batch.executors import place

        return place(**where)

    def check_memory(self) -> None:
        """Pieces are small, or refused where they are planned."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process makes them of the study."""
        return Pieces, (self.kind, self.study)

    def compute(self, store: Store, work: Work) -> int:
        """Compute the pieces that the store does not hold, beside this thread, so that a request to stop is heard while
        one is in a kernel."""
        held = store.finished()
        left = {piece.name: piece for piece in self.pieces if piece.name not in held}
        done = len(self.names) - len(left)
        work.listener.progress(done, len(self.names))

        def keep(found: tuple[str, xr.Dataset]) -> None:
            name, dataset = found
            store.write(name, {"/": from_dataset(dataset)})
            del left[name]
            work.listener.progress(len(self.names) - len(left), len(self.names))
            tell()

        def tell() -> None:
            if left:
                work.listener.stage(next(iter(left.values())).words)

        tell()
        nobody = np.zeros(1, dtype=np.int64)
        jobs = [Job(partial(_compute, name=name, threads=work.threads), nobody) for name in left]
        try:
            crashed = work.place.apart.share_out(self, jobs, keep, work.halted, grace=GRACE_SECONDS)
        except Halted:
            work.check()
            raise
        if crashed:
            raise WorkersGaveUp(f"what is left ends every process that computes it: {', '.join(left)}")
        return done

    def gather(self, store: Store) -> xr.Dataset:
        """The study's dataset from all pieces."""
        return self.kind.gather({name: to_dataset(store.read(name)["/"]) for name in self.names}, self.study)


def _compute(
    pieces: Pieces, nobody: Counts, halted: Callable[[], bool], name: str, threads: int
) -> tuple[str, xr.Dataset]:
    """One piece, as a job."""
    (piece,) = (piece for piece in pieces.pieces if piece.name == name)
    return name, piece.compute(Work(threads, AskedElsewhere(halted)))


def usual(dims: Sequence[str], **values: Any) -> dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]]:
    """What every kind has, over the kind's own grid: status, fidelity, modes and steps, all four of the same shape."""
    names = {"status": "status", "fidelity": "fidelity_used", "modes": "modes_used", "steps": "steps_used"}
    declared = {variable.name: variable for variable in declarations("*")}
    return {names[key]: declared[names[key]].holding(value, dims) for key, value in values.items()}


def unlabelled(arrays: Mapping[str, NDArray[Any]]) -> xr.Dataset:
    """Arrays with dimensions of no meaning, as pieces are stored."""
    return xr.Dataset({name: ([f"{name}_{axis}" for axis in range(part.ndim)], part) for name, part in arrays.items()})
