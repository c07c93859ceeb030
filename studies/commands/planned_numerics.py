"""What variants of a plan are computed with, as rows for people, from what was measured before a run."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from engine.accuracy.groups import Found, MarchGroup
from engine.accuracy.results import Result, results_of, tolerances
from engine.batch.plan import Plan
from engine.march.outcome import Flat, used
from results_schema.arrays import Array, Mask
from results_schema.status import Fidelity, SchemeUsed, label
from studies.findings.numerics_used import NAMES
from studies.results.findings_common import tolerance_for
from studies.results.formatting import counted, scientific, spanned
from studies.results.places import spread

HEADINGS = ("variants", "model", "modes", "scheme", "steps", "estimated error", "asked")
MOST_LOOKED_AT = 4096  # variants of a group whose errors are looked at


class Part(NamedTuple):
    """Some variants that are computed alike: so many, what with (by the names of the archive). Of those looked at the
    errors (R, V) of the results that are held, NaN where nothing is known, and their tolerances (R, V); held (V,): the
    largest of those over these, less what the study fixes."""

    size: int
    used: Flat
    error: Array
    asked: Array
    held: Array


class Worst(NamedTuple):
    """The held result that is furthest beyond its tolerance in some variants, its error there and the tolerance."""

    result: Result
    error: float
    asked: float


def chosen(plan: Plan) -> list[Part]:
    """What was chosen for all variants of a plan, each group as a part."""
    return [_chosen(plan, group) for group in plan.groups if isinstance(group, MarchGroup)]


def _chosen(plan: Plan, group: MarchGroup) -> Part:
    assert plan.choice is not None
    some = group.variants[spread(group.variants.size, MOST_LOOKED_AT)]
    rung, tighter, around = plan.choice.rung[some], plan.cases_tolerance[some], plan.choice.around(some)
    error, held = around.errors(rung)[_is_held(plan)], around.held(rung, tighter)
    return Part(group.variants.size, used(group.tables, 1), error, _asked(plan, tighter), held)


def converged(plan: Plan, found: Found, tighter: Array) -> Iterator[Part]:
    """What some variants converged with, each variant as a part. tighter (V,): their `solver.tolerance` over the
    study's."""
    error, asked = found.error[_is_held(plan)], _asked(plan, tighter)
    for lane in range(found.held.size):
        own = {name: column[lane : lane + 1] for name, column in found.used.items()}
        yield Part(1, own, *(part[..., lane : lane + 1] for part in (error, asked, found.held)))


def held_results(plan: Plan) -> tuple[Result, ...]:
    """The results that are held to a tolerance."""
    return tuple(result for result in results_of(plan.asked) if np.isfinite(result.tolerance))


def _is_held(plan: Plan) -> Mask:
    return np.isfinite(tolerances(results_of(plan.asked)))


def _asked(plan: Plan, tighter: Array) -> Array:
    """(R, V) tolerances of what is held."""
    found = [result.tolerance * (tighter**result.follows) for result in held_results(plan)]
    return np.reshape(found, (-1, tighter.size))


def rows(plan: Plan, parts: Sequence[Part]) -> list[tuple[str, ...]]:
    """One row per model, number of modes and scheme, cheapest first: variants, steps over one passage or cycle, and the
    estimated error of what is held that is largest over its tolerance."""
    kinds: dict[tuple[int, int, int], list[Part]] = {}
    for part in parts:
        kind = tuple(int(part.used[f"{name}_used"][0]) for name in ("fidelity", "modes", "scheme"))
        kinds.setdefault(kind, []).append(part)  # type: ignore[arg-type]
    return [_row(plan, Fidelity(kind[0]), kind[1], kind[2], kinds[kind]) for kind in sorted(kinds)]


def _row(plan: Plan, model: Fidelity, modes: int, scheme: int, parts: Sequence[Part]) -> tuple[str, ...]:
    marched = model is not Fidelity.STATIC
    return (
        f"{sum(part.size for part in parts):,}",
        NAMES[model],
        str(modes) if marched else "none",
        label(SchemeUsed(scheme)) if marched else "",
        spanned([part.used["steps_used"][0] for part in parts], "{:,.0f}".format) if marched else "none",
        *_errors(plan, parts),
    )


def _errors(plan: Plan, parts: Sequence[Part]) -> tuple[str, str]:
    """The error that is largest over its tolerance, with how many nothing is known of, and that tolerance."""
    unknown = sum(int((~np.isfinite(part.error)).any(axis=0).sum()) for part in parts)
    found = worst(plan, parts)
    if found is None:
        return ("unknown", "") if held_results(plan) else ("only estimated", "nothing")
    more = f", {unknown:,} unknown" if unknown else ""
    return scientific(found.error) + more, scientific(found.asked)


def worst(plan: Plan, parts: Sequence[Part]) -> Worst | None:
    """What is furthest beyond its tolerance, or nearest to it; None where nothing is known."""
    error, asked = (np.concatenate([getattr(part, name) for part in parts], axis=1) for name in ("error", "asked"))
    over = np.where(np.isfinite(error), error / asked, -np.inf)
    if not np.isfinite(over).any():
        return None
    result, lane = np.unravel_index(int(over.argmax()), over.shape)
    return Worst(held_results(plan)[result], float(error[result, lane]), float(asked[result, lane]))


def told_missed(plan: Plan, parts: Sequence[Part]) -> str:
    """How many of the variants that were looked at miss their tolerance, by how much and what helps; "" where none, or
    no pilot does, as planes through few of them rise too far beyond."""
    if plan.choice is not None and np.all(plan.choice.measured.held.min(axis=(0, 1)) <= 1.0):
        return ""
    looked_at, missed = sum(part.held.size for part in parts), sum(int((part.held > 1.0).sum()) for part in parts)
    found = worst(plan, parts) if missed else None
    if found is None or found.error <= found.asked:  # those beyond have no estimate, as the table says
        return ""
    who = f"{missed:,} of {counted(looked_at, 'variant')} looked at"
    is_sensor = found.result.of in plan.study.sensor
    of = f"the history of {found.result.of}" if found.result.name in plan.study.sensor else found.result.name
    how_far = f"{scientific(found.error)} where {scientific(found.asked)} is asked, for {of}"
    own = f", or tolerance = {tolerance_for(found.error)} on sensor {found.result.of}" if is_sensor else ""
    return f"{who} would miss their tolerance whatever is tried ({how_far}); remedy: a larger one{own}"
