"""Which variants of an asymmetry have settled, and how far forward and backward differ in these."""

from typing import Annotated

import numpy as np
from pydantic import Field, Strict

from engine.study_file.spec import Spec
from engine.study_file.units import Dimensionless
from results_schema.arrays import Array, Mask
from studies.findings import theory
from studies.protocol.study import question_of
from studies.results.results import Results

LEFT_OVER = 0.05  # of the start's vibration in the last cycle: more, and the variant has not settled


class Asked(Spec):
    """The table [question]. odd_rms: parts of the static range, of which is told where the odd part exceeds them."""

    odd_rms: Annotated[tuple[Annotated[Dimensionless, Field(gt=0)], ...], Strict(False), Field(min_length=1)] = (
        0.01,
        0.05,
    )


def thresholds(results: Results) -> tuple[float, ...]:
    """What the question names of the odd part, ascending."""
    return tuple(sorted(question_of(results.study, Asked).odd_rms))


def settled(results: Results) -> Mask:
    """The variants, in the sweep's shape, whose start has died out by the last cycle, or of which that is not known."""
    return np.asarray(~(theory.remainder_of_start(results) > LEFT_OVER))


def odd_parts(results: Results) -> Array:
    """(..., sensor) the odd part where a variant has settled, or everywhere if none has; NaN elsewhere."""
    odd = np.asarray(results.dataset["odd_rms"].transpose(*results.dims, "sensor").values, dtype=np.float64)
    fine = settled(results)
    return np.where(fine[..., None], odd, np.nan) if fine.any() else odd
