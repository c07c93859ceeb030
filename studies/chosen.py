"""What a plan chose for its variants, as rows for people: model, modes, scheme and steps, why, what they leave out and
cost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engine.bucket import Bucket
from engine.choice import scheme_used
from engine.plan import Plan
from results_schema.status import Fidelity, SchemeUsed, label
from studies.choices import NAMES
from studies.words import percent, scientific

Array = NDArray[np.float64]

HEADINGS = ("variants", "share", "model", "modes", "scheme", "steps", "expected error", "steps decided by", "cost")


def choices(plan: Plan) -> list[tuple[str, ...]]:
    """One row per model, number of modes and scheme, cheapest first: variants and their share, steps over one passage
    or cycle, the largest error that is expected, the rule that decides the steps of most of them, and modes x steps,
    with the marches they are compared with, over those of the full model."""
    groups: dict[tuple[Fidelity, int, SchemeUsed], list[Bucket]] = {}
    for bucket in plan.buckets:
        kind = bucket.scene.fidelity, _modes(bucket), scheme_used(bucket.scene.study)
        groups.setdefault(kind, []).append(bucket)
    return [_row(plan, *group, groups[group]) for group in sorted(groups)]


def _modes(bucket: Bucket) -> int:
    """Modes of all bodies; 0 where none is marched."""
    return 0 if bucket.scene.fidelity is Fidelity.STATIC else bucket.scene.body_modes


def _row(plan: Plan, model: Fidelity, modes: int, scheme: SchemeUsed, buckets: Sequence[Bucket]) -> tuple[str, ...]:
    sizes = [bucket.variants.size for bucket in buckets]
    cost = sum(bucket.cost * size for bucket, size in zip(buckets, sizes, strict=True))
    full = sum(float(bucket.full_cost.sum()) for bucket in buckets)
    marched = model is not Fidelity.STATIC
    return (
        f"{sum(sizes):,}",
        percent(sum(sizes) / plan.size),
        NAMES[model],
        str(modes) if marched else "none",
        label(scheme) if marched else "",
        _span([bucket.steps for bucket in buckets]) if marched else "none",
        _error(np.concatenate([_expected(bucket) for bucket in buckets])),
        _reason(buckets) if marched else "",
        percent(cost / full),
    )


def _expected(bucket: Bucket) -> Array:
    """(V,) the error that is expected of a bucket's variants; NaN where nobody can tell."""
    return bucket.told.error_fidelity + bucket.told.error_modes + bucket.told.error_steps


def _error(expected: Array) -> str:
    """The largest of some errors, and of how many nothing is known.

    >>> _error(np.array([1e-4, 4e-4])), _error(np.array([1e-4, np.nan])), _error(np.array([np.nan]))
    ('4e-4', '1e-4, 1 unknown', 'unknown')
    """
    known = expected[np.isfinite(expected)]
    if not known.size:
        return "unknown"
    unknown = expected.size - known.size
    return scientific(float(known.max())) + (f", {unknown:,} unknown" if unknown else "")


def _span(steps: Sequence[int]) -> str:
    low, high = min(steps), max(steps)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"


def _reason(buckets: Sequence[Bucket]) -> str:
    """The rule that decides for most variants, and whether there are others."""
    found: Counter[str] = Counter()
    for bucket in buckets:
        found[bucket.reason] += bucket.variants.size
    (first, _), *others = found.most_common()
    return f"{first} (mostly)" if others else first
