"""Which variants of a sweep are pilots, by whose measured errors all are chosen for, and where variants stand in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from engine.scene.variants import TOLERANCE, axes_of_scene
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.scene.sweep import Axis, Cases

SEED = 20261122  # of the pilots; audits have another
PILOTS = 256  # 64 needed 2.7 times the least work for 208 passages at 1e-3, 256 took 2.0 times
#: Variants for each pilot, and the fewest pilots: by 128 pilots 2,000 variants took 1.25 times the work that they took
#: by 256, the pilots half the time; by 96 one of 20 missed its tolerance. One in 16 missed resonances of `double-peak`.
SHARE_OF_PILOTS, FEWEST_PILOTS = 12, 128
#: Pilots, at least, for each corner of a sweep, and variants that are looked at for what stands there. Without corners
#: 1.7 % of the errors of 90 random sweeps at 1e-2 were told too small, 1.3 with them, by as much work or less.
CORNERS, NEAR_CORNERS = 8, 65536
LEAST_IN_SCENE = 8  # pilots of a scene, where there are so many: about as many as the neighbours that are asked
#: Scenes that pilots are drawn from, as each climbs the ladder by tables of its own, about a second; and where they
#: have a few variants each, as of swept motions. By 32 of 512 such scenes of a beam and of a portal, three swept
#: numbers, at 1e-2 and 1e-3, none of 40 variants missed, 0 to 1.8 % of errors were told too small; by 24 at random 2.6.
MOST_SCENES, MOST_SMALL_SCENES, IN_SMALL_SCENES = 24, 64, 16


def coordinates(cases: Cases, variants: Counts) -> Array:
    """(V, D) places of variants along the axes of the sweep, from 0 to 1: by logarithms where one goes by ratios, as
    errors go by powers (of 90 random sweeps 1.7 % of errors were told too small, by cube roots 1.9, by the same work);
    else by cube roots, which part what is undamped from what is damped (by values 34 took 1.4 times the work)."""
    positions = cases.positions(variants)
    columns = []
    for axis in varied(cases):
        scaled = np.log if axis.goes_by_ratios else np.cbrt
        low, high = scaled(axis.ends)
        own = np.asarray(axis.values[positions[axis.dim]], dtype=np.float64)
        columns.append((scaled(own) - low) / (high - low))
    return np.stack(columns, axis=1) if columns else np.zeros((variants.size, 1))


def varied(cases: Cases) -> list[Axis]:
    """The axes along which places of variants differ."""
    return [axis for axis in axes_of_scene(cases) if axis.ends[0] < axis.ends[1]]


def usual_pilots(size: int) -> int:
    """How many pilots are worth it for so many variants.

    >>> usual_pilots(500), usual_pilots(2400), usual_pilots(1_000_000)
    (128, 200, 256)
    """
    return min(PILOTS, max(FEWEST_PILOTS, size // SHARE_OF_PILOTS))


def scenes_of_pilots(scenes: int, size: int, count: int) -> int:
    """Of how many of the scenes of a sweep of so many variants so many pilots are drawn.

    >>> scenes_of_pilots(1, 500, 128), scenes_of_pilots(25, 2400, 200), scenes_of_pilots(100, 10_000, 256)
    (1, 24, 24)
    >>> scenes_of_pilots(200, 200, 128), scenes_of_pilots(900, 900, 128), scenes_of_pilots(900, 2700, 225)
    (24, 56, 56)
    """
    own = min(LEAST_IN_SCENE, max(1, size // scenes))
    small = min(MOST_SMALL_SCENES, max(MOST_SCENES, scenes // IN_SMALL_SCENES))
    return min(scenes, MOST_SCENES if own == LEAST_IN_SCENE else small, max(1, count // own))


def pilots_of(cases: Cases, members: Sequence[Counts], most: int = PILOTS) -> Counts:
    """Flat numbers of pilots, as many as are worth it and at most so many, drawn at random beside those in the corners:
    of a few scenes where there are many. Scenes of few variants are drawn far from each other, so that few others lie
    beyond them all."""
    if TOLERANCE in cases.paths:
        members = [_distinct(cases, own) for own in members]
    size = sum(own.size for own in members)
    count = min(most, usual_pilots(size))
    random, scenes = np.random.default_rng(SEED), scenes_of_pilots(len(members), size, count)
    if LEAST_IN_SCENE * len(members) <= size:
        chosen = random.permutation(len(members))[:scenes]
    else:
        chosen = far_apart(coordinates(cases, np.array([own[0] for own in members])), scenes)
    pool = np.concatenate([members[number] for number in np.sort(chosen)])
    mixed = random.permutation(pool)
    corners = _in_corners(coordinates(cases, mixed[:NEAR_CORNERS]), count // CORNERS)
    return np.sort(np.concatenate([mixed[corners], np.delete(mixed, corners)])[:count])


def _in_corners(places: Array, most: int) -> Counts:
    """Numbers of those of some places (V, D) that are nearest to the corners of the sweep; of no more corners than so
    many, else none."""
    if 2 ** places.shape[1] > most:
        return np.zeros(0, dtype=np.int64)
    corners = (np.arange(2 ** places.shape[1])[:, None] >> np.arange(places.shape[1])) & 1
    return np.unique([np.argmin(np.sum((places - corner) ** 2, axis=1)) for corner in corners])


def _distinct(cases: Cases, variants: Counts) -> Counts:
    """One of those variants that differ in the tolerance alone, which are one pilot."""
    return variants[np.unique(coordinates(cases, variants), axis=0, return_index=True)[1]]


def far_apart(places: Array, count: int) -> Counts:
    """Numbers of so many of some places (S, D), each as far as can be from those before (Gonzalez 1985).

    >>> far_apart(np.array([[0.0], [0.4], [0.5], [1.0]]), 3).tolist()
    [3, 0, 2]
    """
    found = [int(np.argmax(np.sum((places - places.mean(axis=0)) ** 2, axis=1)))]
    apart = np.full(len(places), np.inf)
    for _ in range(1, count):
        apart = np.minimum(apart, np.sum((places - places[found[-1]]) ** 2, axis=1))
        found.append(int(np.argmax(apart)))
    return np.array(found, dtype=np.int64)
