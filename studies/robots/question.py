"""What is asked of robots on rails: the table [question]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, Strict

from engine.study_file.spec import Spec, ascending
from engine.study_file.units import Length, Time

_Modes = Annotated[int, Field(ge=1, le=64)]
Limit = Annotated[Length, Field(gt=0)]
LIMITED = tuple(f"{what}_{doing}" for what in ("error", "beyond_rest") for doing in ("moving", "working", "holding"))


class Question(Spec):
    """duration: s, of the march; until all robots have done what they are told, and some time after, if not given.
    zero: what errors count from: "start", what they are at time 0, or "unloaded" rails. one_at_a_time: how large errors
    are while each robot in turn stands still, of the scene without sweep. mode_counts: numbers of modes of every rail
    of which is told what they change, of the same scene. The others: limits of the results of the same
    name, of which is told where all tools stay within."""

    duration: Time | None = Field(default=None, gt=0)
    after: Time = Field(default=1.0, ge=0)
    zero: Literal["start", "unloaded"] = "start"
    one_at_a_time: bool = False
    mode_counts: Annotated[tuple[_Modes, ...], Strict(False), AfterValidator(ascending)] = ()
    error_moving: Limit | None = None
    error_working: Limit | None = None
    error_holding: Limit | None = None
    beyond_rest_moving: Limit | None = None
    beyond_rest_working: Limit | None = None
    beyond_rest_holding: Limit | None = None
