"""What variants of a plan are computed with, as rows for people, from what was measured before a run."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from engine.accuracy.groups import Found, MarchGroup
from engine.accuracy.results import results_of, tolerances
from engine.batch.plan import Plan
from engine.march.outcome import Flat, used
from results_schema.arrays import Array
from results_schema.status import Fidelity, SchemeUsed, label
from studies.findings.numerics_used import NAMES
from studies.results.formatting import number, scientific, spanned
from studies.results.places import spread

HEADINGS = ("variants", "model", "modes", "scheme", "steps", "estimated error", "of tolerance")
MOST_LOOKED_AT = 4096  # variants of a group whose errors are looked at


class Part(NamedTuple):
    """Some variants that are computed alike: so many, what with (by the names of the archive), their largest errors of
    held results (V,) with NaN where none is known, and those over their tolerances (V,)."""

    size: int
    used: Flat
    error: Array
    held: Array


def chosen(plan: Plan) -> list[Part]:
    """What was chosen for all variants of a plan, each group as a part."""
    return [_chosen(plan, group) for group in plan.groups if isinstance(group, MarchGroup)]


def _chosen(plan: Plan, group: MarchGroup) -> Part:
    assert plan.choice is not None
    some = group.variants[spread(group.variants.size, MOST_LOOKED_AT)]
    rung = plan.choice.rung[some]
    held = plan.choice.held(some, rung, plan.cases_tolerance[some])
    return Part(group.variants.size, used(group.tables, 1), _largest(plan, plan.choice.errors(some, rung)), held)


def converged(plan: Plan, found: Found) -> Iterator[Part]:
    """What some variants converged with, each variant as a part."""
    error = _largest(plan, found.error)
    for lane in range(found.held.size):
        own = {name: column[lane : lane + 1] for name, column in found.used.items()}
        yield Part(1, own, error[lane : lane + 1], found.held[lane : lane + 1])


def _largest(plan: Plan, error: Array) -> Array:
    """(V,) the largest of errors (R, V) of what is held."""
    held = np.isfinite(tolerances(results_of(plan.asked)))
    return np.max(error[held], axis=0) if held.any() else np.full(error.shape[1], np.nan)


def rows(parts: Sequence[Part]) -> list[tuple[str, ...]]:
    """One row per model, number of modes and scheme, cheapest first: variants, steps over one passage
    or cycle, the largest error that is estimated for what is held, and over its tolerance."""
    kinds: dict[tuple[int, int, int], list[Part]] = {}
    for part in parts:
        kind = tuple(int(part.used[f"{name}_used"][0]) for name in ("fidelity", "modes", "scheme"))
        kinds.setdefault(kind, []).append(part)  # type: ignore[arg-type]
    return [_row(Fidelity(model), modes, scheme, kinds[model, modes, scheme]) for model, modes, scheme in sorted(kinds)]


def _row(model: Fidelity, modes: int, scheme: int, parts: Sequence[Part]) -> tuple[str, ...]:
    size = sum(part.size for part in parts)
    held = np.concatenate([part.held for part in parts])
    of_tolerance = number(float(held.max()), 2) if np.isfinite(held).all() else ""
    marched = model is not Fidelity.STATIC
    return (
        f"{size:,}",
        NAMES[model],
        str(modes) if marched else "none",
        label(SchemeUsed(scheme)) if marched else "",
        spanned([part.used["steps_used"][0] for part in parts], "{:,.0f}".format) if marched else "none",
        _error(np.concatenate([part.error for part in parts])),
        of_tolerance,
    )


def _error(errors: Array) -> str:
    """The largest of some errors, and of how many nothing is known.

    >>> _error(np.array([1e-4, 4e-4])), _error(np.array([1e-4, np.nan])), _error(np.array([np.nan]))
    ('4e-4', '1e-4, 1 unknown', 'unknown')
    """
    known = errors[np.isfinite(errors)]
    if not known.size:
        return "unknown"
    unknown = errors.size - known.size
    return scientific(float(known.max())) + (f", {unknown:,} unknown" if unknown else "")
