"""What simpler models would leave out of a planned study, and what they would cost, as rows for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from engine.ladder import Rung, ladder
from engine.lanes import LaneValues
from engine.model import SceneModel
from engine.plan import Plan
from engine.scenes import scenes
from results_schema.status import Fidelity
from studies.choices import NAMES
from studies.words import number

Array = NDArray[np.float64]

MOST_SCENES = 12  # that are looked at, spread over all
MOST_VARIANTS = 10_000  # likewise
BEYOND = 1.0  # errors above say only that the model is useless

HEADINGS = ("model", "estimated error", "variants within tolerance", "cost over the full model's")


def simpler_models(plan: Plan) -> list[tuple[str, ...]]:
    """One row per model below the carriages' own: the smallest and the largest error that it would leave, the share of
    variants within `solver.tolerance`, and its modes x steps over the full model's. Nothing where the study chooses a
    model of its own that knows no springs."""
    if plan.study.solver.fidelity not in ("auto", "static"):
        return []
    found: dict[Fidelity, list[Rung]] = {}
    full: list[Array] = []
    tolerance = []
    for scene, values in _looked_at(plan):
        *below, whole = ladder(scene, values)
        full.append(whole.cost)
        tolerance.append(values.of("solver.tolerance"))
        for rung in below:
            found.setdefault(rung.fidelity, []).append(rung)
    return [_row(rungs, np.concatenate(tolerance), np.concatenate(full)) for rungs in found.values()]


def _looked_at(plan: Plan) -> Iterator[tuple[SceneModel, LaneValues]]:
    """Some scenes as the study has them, before anything is chosen, and some variants of each."""
    found = list(scenes(plan.study, plan.cases, np.arange(plan.size, dtype=np.int64)))
    chosen = [found[place] for place in _spread(len(found), MOST_SCENES)]
    for scene, own in chosen:
        variants = own[_spread(own.size, MOST_VARIANTS // len(chosen))]
        yield scene, LaneValues(scene.study, plan.cases.columns_of(variants), variants.size)


def _spread(size: int, most: int) -> NDArray[np.int64]:
    """At most so many numbers below size, evenly spread.

    >>> _spread(5, 3)
    array([0, 2, 4])
    """
    return np.unique(np.rint(np.linspace(0, size - 1, min(size, most))).astype(np.int64))


def _row(rungs: Sequence[Rung], tolerance: Array, full: Array) -> tuple[str, ...]:
    error, cost = (np.concatenate(parts) for parts in zip(*((r.error, r.cost) for r in rungs), strict=True))
    known = error[~np.isnan(error)]
    span = [_size(value) for value in (known.min(), known.max())] if known.size else ["none"]
    shown = span[0] if span[0] == span[-1] else " to ".join(span)
    share = number(100.0 * float(np.mean(error <= tolerance)))
    return NAMES[rungs[0].fidelity], shown, f"{share} %", number(float(cost.sum() / full.sum()), 2)


def _size(error: float) -> str:
    """An error as people say it.

    >>> _size(0.00123), _size(7.0)
    ('0.0012', 'more than 1')
    """
    return number(float(error), 2) if error <= BEYOND else "more than 1"
