"""What became of a variant, which model computed it, and by which scheme it was marched."""

from enum import IntEnum

_MESSAGES = (
    "fine",
    "a contact force is negative before the last 2 % of the way, where the carriage would lift off, or a carriage in a "
    "frame that moves went over an end of its track; values kept",
    "the error could not be estimated; values kept",
    "the estimated error is larger than the tolerance; values kept",
    "an eigenvalue, tie or Newton solution did not converge; no values",
    "what swings grew beyond all numbers, by itself or by steps that are too long; no values",
    "the worker died in this variant; no values",
    "a body turns too fast without stiffening by its rotation, buckles under its weight, or bends too far for small "
    "deflections; values kept",
    "a joint of a robot is softer than the weight that it has to hold up, and falls over; no values",
)


class Status(IntEnum):
    """Result code of one variant; where several apply, the one that comes first in `GRAVEST`.

    >>> Status.TOLERANCE_MISSED.values_kept, Status.DIVERGED.values_kept
    (True, False)
    """

    OK = 0
    SEPARATED = 1
    UNRESOLVED = 2
    TOLERANCE_MISSED = 3
    NOT_CONVERGED = 4
    DIVERGED = 5
    CRASHED = 6
    BEYOND_THEORY = 7
    FALLS_OVER = 8

    @property
    def message(self) -> str:
        """One sentence for people."""
        return _MESSAGES[self]

    @property
    def values_kept(self) -> bool:
        """Whether the variant's results are numbers; otherwise they are NaN."""
        return self not in LOST


#: All statuses, the most serious first.
GRAVEST = (
    Status.CRASHED,
    Status.DIVERGED,
    Status.FALLS_OVER,
    Status.NOT_CONVERGED,
    Status.TOLERANCE_MISSED,
    Status.UNRESOLVED,
    Status.SEPARATED,
    Status.BEYOND_THEORY,
    Status.OK,
)
#: Those of variants whose results are NaN.
LOST = GRAVEST[:4]


class Fidelity(IntEnum):
    """The model a variant was computed with; of bodies that stand cheapest first. Numbers are those of archives that
    were written before, so that further ones come last."""

    STATIC = 0
    FORCE = 1
    MASS_WITHOUT_CONVECTIVE = 2
    MASS = 3
    TIED = 4
    FRAME = 5
    GIVEN_FRAME = 6


class SchemeUsed(IntEnum):
    """The time integration scheme a variant was marched with, or would have been.

    >>> label(SchemeUsed.FOX_GOODWIN)
    'fox-goodwin'
    """

    AVERAGE_ACCELERATION = 0
    FOX_GOODWIN = 1
    LINEAR_ACCELERATION = 2
    CENTRAL_DIFFERENCE = 3
    NEWMARK = 4
    HHT_ALPHA = 5
    GENERALIZED_ALPHA = 6
    RICHARDSON = 7
    OTHER = 8  # of another package
    SCALED_FOX_GOODWIN = 9


def flag_values(flags: type[IntEnum]) -> list[int]:
    """The numbers of a CF flag variable, ascending (write them in the variable's own dtype)."""
    return sorted(int(flag) for flag in flags)


def flag_meanings(flags: type[IntEnum]) -> str:
    """The CF attribute `flag_meanings`: one word each, in the order of `flag_values`.

    >>> flag_meanings(Fidelity)
    'static force mass_without_convective mass tied frame given_frame'
    """
    return " ".join(flags(value).name.lower() for value in flag_values(flags))


def label(flag: IntEnum) -> str:
    """A flag as people write it.

    >>> label(Status.TOLERANCE_MISSED)
    'tolerance-missed'
    """
    return flag.name.lower().replace("_", "-")
