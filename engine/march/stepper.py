"""What marches a scene in time: one protocol and one loop, whatever is marched and by whichever scheme.

A scene is a row of segments; events lie between them. The march, its Richardson pairs, the schemes for comparison and
the unreduced model are steppers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Codes = NDArray[np.int8]

Part_contra = TypeVar("Part_contra", contravariant=True)
Table = TypeVar("Table")
Observed = TypeVar("Observed")


class Halted(Exception):
    """The march was asked to stop between two segments."""


class Stepper(Protocol[Part_contra, Table, Observed]):
    """Variants of one scene under way: their state, and what is kept of them."""

    def tabulate(self, segment: Part_contra) -> Table:
        """What a segment's steps need that all variants share."""

    def observe(self, segment: Part_contra, table: Table) -> Observed:
        """What is observed along a segment, and where that is kept."""

    def start(self, segment: Part_contra, table: Table, observed: Observed, before: Part_contra | None) -> None:
        """The event at a segment's beginning: impulses, new accelerations, its first station observed unless it was
        the last one of the segment ``before``."""

    def step(self, segment: Part_contra, table: Table, observed: Observed) -> Codes:
        """All steps of a segment, observed; one of the codes of `engine.kernels.layout` for every lane."""


def go(
    stepper: Stepper[Part_contra, Table, Observed],
    segments: Iterable[Part_contra],
    halted: Callable[[], bool] = lambda: False,
) -> Codes:
    """All segments, once; the worst code of every lane. ``halted`` is asked after each; raises Halted when it says so.

    Raises ValueError where there are no segments.
    """
    before: Part_contra | None = None
    codes: list[Codes] = []
    for segment in segments:
        table = stepper.tabulate(segment)
        observed = stepper.observe(segment, table)
        stepper.start(segment, table, observed, before)
        codes.append(stepper.step(segment, table, observed))
        before = segment
        if halted():
            raise Halted
    return np.asarray(np.maximum.reduce(codes), dtype=np.int8)
