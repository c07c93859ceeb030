"""Studies that keep of their variants what cells of them have in common: extremes, counts by status, percentiles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.scene.study import CELLS
from engine.scene.sweep import VARIANT, cells_of
from results_schema.arrays import Array, Counts
from results_schema.gravest_status import gravest
from results_schema.lazy_imports import xr
from results_schema.status import Status, label
from results_schema.store.rows import Chunk, Rows, joined
from results_schema.variables import axes
from studies.protocol.kept_pilots import NAME as PILOTS
from studies.protocol.parts import Variants
from studies.protocol.store import Store
from studies.protocol.streamed import summarised
from studies.results.cells import single_numbers

if TYPE_CHECKING:
    from engine.batch.plan import Plan
    from engine.scene.study import Study
    from studies.protocol.study import Kind

USED = ("fidelity_used", "modes_used", "steps_used")
ERROR = "estimated_error"
ENDS = ("smallest", "largest")
AT_ONCE = 2**20  # variants whose statuses are counted
REDUCED_AT_ONCE = 2**14  # rows: reducing a few takes as long as reducing thousands


class Numbers(NamedTuple):
    """Results of n variants that are one number each: full names (K,), units (K,), values (n, K), and the errors
    estimated of these, NaN where no estimate exists."""

    names: list[str]
    units: list[str]
    values: Array
    errors: Array


def numbers_of(kind: Kind, plan: Plan, rows: Rows) -> Numbers:
    """The results of some variants, each of which is summarised by itself."""
    from engine.batch.dataset import results_over

    marched = results_over(plan, plan.cases.part(rows.variants), dict(rows.arrays))
    dataset = summarised(kind, marched, plan.study)
    found = list(single_numbers(dataset))
    units = [str(array.attrs.get("units") or plan.study.sensor_units.get(sensor, "1")) for _, sensor, array in found]
    names = [f"{name} {sensor}".strip() for name, sensor, _ in found]
    told = dict(zip(dataset["result"].values.tolist(), dataset[ERROR].values.T, strict=True))
    unknown = np.full(rows.variants.size, np.nan)
    errors = np.stack([told.get(name, unknown) for name in names], axis=1)
    return Numbers(names, units, np.stack([array.values for *_, array in found], axis=1), errors)


def ends_of(values: Array, cells: Counts, variants: Counts) -> tuple[Counts, Counts]:
    """Which of n values is the smallest and which the largest of each cell, cells ascending; of equal ones that of the
    first variant. Those that are no numbers are none."""
    known = np.flatnonzero(np.isfinite(values))
    if not known.size:
        return known, known
    known = known[np.argsort(cells[known], kind="stable")]
    starts = np.flatnonzero(np.diff(cells[known], prepend=-1))
    sizes, found = np.diff(starts, append=known.size), []
    for best in (np.minimum, np.maximum):
        equal = known[values[known] == np.repeat(best.reduceat(values[known], starts), sizes)]
        order = equal[np.lexsort((variants[equal], cells[equal]))]
        found.append(order[np.flatnonzero(np.diff(cells[order], prepend=-1))])
    return found[0], found[1]


def reduced(plan: Plan, chunk: Chunk, kind: Kind) -> Chunk:
    """What is kept of a chunk: of every variant its status and what it was computed with, and the rows of those that
    may be extremes of their cells, or of all where percentiles are asked for. It may be reduced again with others."""
    rows = chunk.rows if chunk.selected is None else chunk.selected
    if plan.study.output.keep == "extremes":
        rows = _candidates(plan, rows, kind)
    own = {name: chunk.rows.arrays[name] for name in ("status", *USED)}
    return Chunk(Rows(chunk.rows.variants, own), rows)


def _candidates(plan: Plan, rows: Rows, kind: Kind) -> Rows:
    """The rows of variants that have the smallest or largest of a result in their cell; one where there are none."""
    cells = plan.cases.numbers_in(cells_of(plan.study, plan.cases), rows.variants)
    values = numbers_of(kind, plan, rows).values
    ends = [end for column in values.T for end in ends_of(column, cells, rows.variants)]
    kept = np.unique(np.concatenate(ends)) if any(end.size for end in ends) else np.zeros(1, dtype=np.int64)
    return Rows(rows.variants[kept], {name: array[kept] for name, array in rows.arrays.items()})


def _check(study: Study) -> None:
    """Refuse what only variants have, where these are not kept. Raises BadInput."""
    keep, output = f'an archive with keep = "{study.output.keep}" has', study.output
    if study.envelope:
        raise study.source.fault("envelope", f"{keep} no envelopes", expected="no table [envelope]")
    if output.histories not in ("auto", "none"):
        raise study.source.fault("output.histories", f"{keep} no histories", expected='"none"')
    if output.unreduced:
        raise study.source.fault("output.unreduced", f"{keep} no variants to compute again", expected="0")


class ReducedVariants(Variants):
    """All variants of a march's plan, reduced where they are marched and again as parts are put together."""

    def __init__(self, kind: Kind, study: Study) -> None:
        _check(study)
        super().__init__(kind, study)
        self.cells = cells_of(study, self.plan.cases)
        self.plan.reduce = partial(reduced, kind=kind)
        self.statuses = np.full(self.plan.size, -1, dtype=np.int8)

    def gather(self, store: Store) -> xr.Dataset:
        """The dataset of the cells, part after part."""
        percent = self.plan.study.output.percentiles
        columns = _Columns(store) if percent else None
        used = np.zeros((len(USED), self.cells.size), dtype=np.int64)
        waiting: list[Rows] = []
        for name in [name for name in store.finished() if name != PILOTS]:
            rows, selected = Chunk.of(store.read(name))
            assert selected is not None and (self.statuses[rows.variants] == -1).all(), "a variant comes twice"
            cells = self.plan.cases.numbers_in(self.cells, rows.variants)
            self.statuses[rows.variants] = rows.arrays["status"]
            for most, array in zip(used, USED, strict=True):
                np.maximum.at(most, cells, rows.arrays[array])
            if columns is not None:
                columns.add(numbers_of(self.kind, self.plan, selected).values, cells)
            waiting.append(selected)
            if sum(rows.variants.size for rows in waiting) > REDUCED_AT_ONCE:
                waiting = [self._among(waiting)]
        assert (self.statuses >= 0).all(), "variants are missing"
        dataset = self._dataset(self._among(waiting), used)
        if columns is None:
            return dataset
        found = columns.percentiles(self.cells.size, percent)
        return self._with(dataset, "percentile", ("result", "percent"), found).assign_coords(
            percent=("percent", np.array(percent, dtype=np.float64), axes()["percent"].attributes())
        )

    def _among(self, parts: Sequence[Rows]) -> Rows:
        """Those of some rows that may be extremes of their cells."""
        both = joined(parts)
        assert both is not None
        return _candidates(self.plan, both, self.kind)

    def to_audit(self, root: xr.Dataset) -> xr.Dataset:
        from engine.batch.dataset import coordinates, results_over

        nobody = self.plan.cases.part(np.zeros(1, dtype=np.int64))
        tolerance = results_over(self.plan, nobody, {})[["tolerance"]]
        status = (self.plan.cases.dims, self.statuses.reshape(self.plan.cases.shape))
        swept = {name: values for name, values in coordinates(self.plan.cases).items() if name != VARIANT}
        return tolerance.assign_coords(swept).assign(status=status)

    def _dataset(self, candidates: Rows, used: Counts) -> xr.Dataset:
        """The dataset of the cells but for percentiles."""
        from engine.batch.dataset import coordinates

        own = self.plan.cases.part(candidates.variants)
        swept = np.stack([np.asarray(axis.values, dtype=np.float64) for axis in own.axes], axis=1)
        numbers = numbers_of(self.kind, self.plan, candidates)
        cells = self.plan.cases.numbers_in(self.cells, candidates.variants)
        names = {
            "result": numbers.names,
            "swept": [axis.name for axis in own.axes],
            "status_name": [label(status) for status in Status],
        }
        dataset = xr.Dataset(coords=coordinates(self.cells)).assign_coords(
            {name: (name, values, axes()[name].attributes()) for name, values in names.items()}
        )
        units = {"result_unit": ("result", numbers.units), "swept_unit": ("swept", [a.units or "1" for a in own.axes])}
        dataset = dataset.assign_coords({name: (*unit, axes()[name].attributes()) for name, unit in units.items()})
        counts = self._counts()
        worst = gravest(*(np.where(counts[:, status] > 0, np.int8(status), np.int8(0)) for status in Status))
        dataset = self._with(dataset, "status", (), worst)
        for name, most in zip(USED, used, strict=True):
            dataset = self._with(dataset, name, (), most)
        dataset = self._with(dataset, "status_count", ("status_name",), counts)
        shape = self.cells.size, len(numbers.names)
        for side, end in enumerate(ENDS):
            found, error, who = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, -1)
            at = np.full((*shape, swept.shape[1]), np.nan)
            for k, column in enumerate(numbers.values.T):
                rows = ends_of(column, cells, candidates.variants)[side]
                place = cells[rows], k
                found[place], who[place], at[place] = column[rows], candidates.variants[rows], swept[rows]
                error[place] = numbers.errors[rows, k]
            dataset = self._with(dataset, end, ("result",), found)
            dataset = self._with(dataset, f"{end}_error", ("result",), error)
            dataset = self._with(dataset, f"{end}_variant", ("result",), who)
            dataset = self._with(dataset, f"{end}_at", ("result", "swept"), at)
        return dataset.assign_attrs(study_kind=self.plan.study.kind, title=self.plan.study.title)

    def _counts(self) -> Counts:
        """(C, statuses) how many variants of each cell have which status."""
        counts = np.zeros((self.cells.size, len(Status)), dtype=np.int64)
        for first in range(0, self.plan.size, AT_ONCE):
            variants = np.arange(first, min(first + AT_ONCE, self.plan.size))
            np.add.at(counts, (self.plan.cases.numbers_in(self.cells, variants), self.statuses[variants]), 1)
        return counts

    def _with(self, dataset: xr.Dataset, name: str, dims: Sequence[str], values: NDArray[Any]) -> xr.Dataset:
        """The dataset with a variable over the cells, values (C, ...)."""
        variable = self.plan.study.results(CELLS)[name]
        array = np.asarray(values).reshape((*self.cells.shape, *np.shape(values)[1:]))
        return dataset.assign({name: variable.holding(array, (*self.cells.dims, *dims))})


class _Columns:
    """The results of all variants, one file each, out of which one at a time is read."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._cells: list[Counts] = []
        self._files: list[IO[bytes]] = []

    def add(self, values: Array, cells: Counts) -> None:
        """Take the results (n, K) of variants of some cells (n,)."""
        self._files = self._files or [self._store.scratch() for _ in range(values.shape[1])]
        self._cells.append(cells.astype(np.int32))
        for file, column in zip(self._files, values.T, strict=True):
            file.write(np.ascontiguousarray(column).tobytes())

    def percentiles(self, cells: int, percent: Sequence[float]) -> Array:
        """(C, K, n) percentiles of every result, over those of each cell that are numbers; NaN where none is."""
        numbers = np.concatenate(self._cells)
        order = np.argsort(numbers, kind="stable")
        bounds = np.searchsorted(numbers[order], np.arange(cells + 1))
        found = np.full((cells, len(self._files), len(percent)), np.nan)
        for k, file in enumerate(self._files):
            file.seek(0)
            column = np.fromfile(file, dtype=np.float64)[order]
            for cell in range(cells):
                own = column[bounds[cell] : bounds[cell + 1]]
                own = own[np.isfinite(own)]
                if own.size:
                    found[cell, k] = np.percentile(own, percent)
        return found
