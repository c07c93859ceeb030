"""Which variants that go to and fro have settled, and how far forward and backward differ in these."""

from typing import Annotated

import numpy as np
from pydantic import Field, Strict

from engine.study_file.spec import Spec
from engine.study_file.units import Dimensionless
from results_schema.arrays import Array, Mask
from results_schema.status import Fidelity
from studies.findings import theory
from studies.protocol.study import question_of
from studies.results.formatting import counted, percent
from studies.results.results import Results

LEFT_OVER = 0.05  # of the start's vibration in the last cycle: more, and the variant has not settled
REMAINDER = "by the damping of the first mode"
#: Of keys of swept numbers, with the end of their range at which a variant settles last.
ENDS = (
    (".motion.speed", np.min, "from {} on"),
    (".motion.frequency", np.min, "from {} on"),
    (".damping_ratio", np.max, "up to {}"),
)


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


def where_late(results: Results, late: Mask) -> str:
    """From which speed on and up to which damping ratio variants have not settled."""
    said = ""
    for ending, pick, words in ENDS:
        axis = results.axis(ending)
        if axis is not None:
            value = float(pick(results.everywhere(results.dataset[axis.name])[late]))
            said += f", {words.format(f'{axis.noun} {axis.in_words(value)}')}"
    return said


def told_unsettled(results: Results) -> list[str]:
    """How many marched variants still carry more of the vibration of the start in their last cycle than the study's
    tolerance, and with how many cycles they would not; nothing where none is known to."""
    left, held = theory.remainder_of_start(results), results.study.solver.tolerance
    late = (left > held) & (results.dataset["fidelity_used"].values != int(Fidelity.STATIC))
    if not late.any():
        return []
    most, cycles = float(left[late].max()), float(theory.cycles(results).max())
    enough = 1.0 + (cycles - 1.0) * np.log(held) / np.log(most) if cycles > 1.0 and most < 1.0 else np.inf
    known = np.isfinite(enough)
    advice = f"{np.ceil(enough):,.0f} cycles would be enough" if known else "more cycles, or damping, help"
    told = f"of the start is left in the last cycle, {REMAINDER}{where_late(results, late)}"
    return [
        f"In {int(late.sum()):,} of {counted(results.size, 'variant')} more than {percent(held)} {told}: what is told "
        f"holds the start too, at most {percent(most)} of it; {advice}."
    ]
