"""The audit of a run: what some variants report against the same variants computed again with more of everything."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.jobs import Crashed, Job
from engine.march.stepper import Halted
from results_schema.arrays import Array, Counts
from results_schema.gravest_status import lost
from results_schema.lazy_imports import xr
from results_schema.variables import axes, declarations
from studies.findings.amplification import derived_from
from studies.protocol.parts import Work
from studies.protocol.stopping import AskedElsewhere

if TYPE_CHECKING:
    from engine.batch.audit import Audit
    from engine.batch.plan import Plan
    from engine.scene.sweep import Cases
    from studies.protocol.parts import Pieces


GROUP = "/audit"
Errors = tuple[Array, Array]  # observed and told (R,)


def audit_group(plan: Plan, dataset: xr.Dataset, work: Work) -> dict[str, xr.Dataset]:
    """The group of an archive by its path; {} where nothing is audited, or no audited variant has values.

    dataset: the study's own. Raises Interrupted.
    """
    from engine.batch.audit import may_go_further, sampled
    from engine.batch.execution import choose

    choose(plan, work.place, work.stop.event)
    used = used_of(plan, dataset)
    variants = sampled(plan, used)
    kept = ~lost(_flat(plan.cases, dataset["status"])[variants])
    if used is not None:
        kept &= may_go_further(plan, variants, {name: own[variants] for name, own in used.items()})
    found = _shared_out(plan, variants[kept], work)
    work.check()
    if not found.variants.size:
        return {}
    left_out = int(np.count_nonzero(~kept)) + found.left_out
    return {GROUP: _group(plan.cases, dataset, found.variants, _of_plan(plan, dataset, found), left_out)}


def used_of(plan: Plan, dataset: xr.Dataset) -> dict[str, NDArray[Any]] | None:
    """What every variant was computed with, by its flat number, where the archive keeps variants."""
    from engine.march.outcome import USED

    return {name: _flat(plan.cases, dataset[name]) for name in USED} if plan.study.output.keeps_variants else None


def audit_group_of_pieces(parts: Pieces, dataset: xr.Dataset, count: int, work: Work) -> dict[str, xr.Dataset]:
    """The same of a study whose kind computes it in pieces, of so many of its variants."""
    from engine.batch.audit import Audit, drawn
    from engine.scene.sweep import expand
    from engine.scene.variants import VariantValues

    if not count:
        return {}
    cases = expand(parts.study)
    variants = drawn(cases.size, count)
    kept = ~lost(_flat(cases, dataset["status"])[variants])
    each, place = dict[int, Errors | None](), work.place.apart
    own = np.array_split(variants[kept], min(place.slots, max(1, int(kept.sum()))))
    jobs = [Job(partial(_again, threads=work.threads), part) for part in own if part.size]
    try:
        for crashed in place.share_out(parts, jobs, each.update, work.halted):
            each.update(dict.fromkeys(crashed.tolist()))
    except Halted:
        work.check()
        raise
    found = Audit.of_each(each)
    if not found.variants.size:
        return {}
    values = VariantValues(parts.study, cases.columns_of(found.variants), found.variants.size)
    errors = _Errors(found.observed.T, found.told.T, np.broadcast_to(values.tighter, found.variants.shape))
    left_out = int(np.count_nonzero(~kept)) + found.left_out
    return {GROUP: _group(cases, dataset, found.variants, errors, left_out)}


def _again(parts: Pieces, variants: Counts, asked: Callable[[], bool], threads: int) -> Mapping[int, Errors | None]:
    """Some variants computed again, as a job."""
    return parts.kind.again(parts.study, variants, Work(threads, AskedElsewhere(asked)))


def _shared_out(plan: Plan, variants: Counts, work: Work) -> Audit:
    """The audit; variants that end every process that computes them so closely are left out."""
    from engine.batch.audit import audit
    from engine.batch.executors import Shared

    kept = variants
    while True:
        try:
            found = audit(plan, kept, Shared(work.place, work.halted))
            return found._replace(left_out=found.left_out + variants.size - kept.size)
        except Crashed as crashed:
            kept = np.setdiff1d(kept, crashed.lanes)
        except Halted:
            work.check()
            raise


def _flat(cases: Cases, array: xr.DataArray) -> NDArray[Any]:
    """(V,) a result of every variant by its flat number."""
    return np.asarray(array.transpose(*cases.dims).values).reshape(cases.size)


class _Errors(NamedTuple):
    """Of n audited variants: observed and told (n, R), and solver.tolerance over that of the study (n,)."""

    observed: Array
    told: Array
    tighter: Array


def _of_plan(plan: Plan, dataset: xr.Dataset, found: Audit) -> _Errors:
    from engine.accuracy.results import results_of

    names, derived = [result.name for result in results_of(plan.asked)], derived_from(plan.study)
    whole = [str(name) for name in dataset["result"].values]
    rows = [[names.index(own) for own in ([name] if name in names else derived[name])] for name in whole]
    observed = np.where(np.isfinite(found.observed), found.observed, np.nan)
    seen, told = (np.stack([errors[own].max(axis=0) for own in rows], axis=1) for errors in (observed, found.told))
    return _Errors(seen, told, plan.cases_tolerance[found.variants])


def _group(cases: Cases, dataset: xr.Dataset, variants: Counts, errors: _Errors, left_out: int) -> xr.Dataset:
    """The group with its axes."""
    arrays: dict[str, NDArray[Any]] = {
        "observed_error": errors.observed,
        "estimated_error": errors.told,
        "tolerance": np.asarray(dataset["tolerance"].values),
        "tolerance_asked": errors.tighter,
        "variant_status": _flat(cases, dataset["status"])[variants],
        "left_out": np.array(left_out),
    }
    declared = {variable.name: variable for variable in declarations(GROUP)}
    positions = cases.positions(variants)
    own = {axis.name: ("sample", axis.values[positions[axis.dim]], dataset[axis.name].attrs) for axis in cases.axes}
    coordinates = {
        "sample": ("sample", variants, axes()["sample"].attributes()),
        "result": ("result", dataset["result"].values, axes()["result"].attributes()),
    }
    return xr.Dataset(
        {name: declared[name].holding(array) for name, array in arrays.items()},
        coords=coordinates | own,
    )
