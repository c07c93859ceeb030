"""What do bodies do whose frames move, and carriages that slide on them by themselves?"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from engine.scene.study import Study
from results_schema.arrays import Array, Counts
from results_schema.lazy_imports import xr
from results_schema.variables import declare
from studies.moving import findings
from studies.moving.parts import AUDIT_SECONDS, gather
from studies.moving.question import Question, check_residual
from studies.moving.variables import RESULTS
from studies.protocol.parts import Foreseen, Piece, TextTable, Took, Work
from studies.protocol.study import PiecedKind, question_of
from studies.results.results import Results

declare("moving-frames", *RESULTS)


def _duration(study: Study) -> Callable[[Mapping[str, Array], int], Array]:
    """(V,) s of variants by their columns."""
    seconds = question_of(study, Question).duration
    return lambda columns, size: np.full(size, seconds)


class MovingFrames(PiecedKind):
    """The kind "moving-frames"."""

    name = "moving-frames"
    summary = "bodies on joints or free in space, and carriages that slide by themselves: motions, forces, energies"
    question = "How do the bodies and their carriages move, and what do they feel?"
    settings = Question
    names_limits = True
    sweeps = True
    audit_seconds = AUDIT_SECONDS
    instead: Mapping[str, str] = {
        "residual": 'quantity = "position_error" on a sensor, of which SENSOR_after_stop_max is told',
        "times": "leave it out: SENSOR_max_time and SENSOR_min_time are always told",
    }
    moves_frames = True
    drawn_by = "studies.pictures.moving_frames"

    def check(self, study: Study) -> None:
        fault = study.source.fault
        if not study.body:
            raise fault("body", "there is no body", expected="a table [body.NAME]")
        if study.solver.fidelity not in ("auto", "full"):
            raise fault("solver.fidelity", "frames that move have no such model", expected='"auto" or "full"')
        check_residual(study, question_of(study, Question))
        if study.output.histories not in ("auto", "all", "none"):
            what = "histories of frames that move are kept at some 800 times"
            raise fault("output.histories", what, expected='"auto", "all" variants or "none"')

    def tables(self, study: Study) -> Iterable[TextTable]:
        from studies.moving.preview import together

        return together(study)

    def pieces(self, study: Study) -> Sequence[Piece]:
        from studies.moving.parts import pieces

        return pieces(study, _duration(study))

    def again(self, study: Study, variants: Counts, work: Work) -> Mapping[int, tuple[Array, Array] | None]:
        from studies.moving.parts import again

        return again(study, _duration(study), variants, work)

    def took(self, dataset: xr.Dataset) -> Took:
        from studies.moving.parts import seconds_of_marches

        return seconds_of_marches(dataset["modes_used"].values, dataset["steps_used"].values)

    def foreseen(self, study: Study, threads: int, audited: int) -> Foreseen:
        from studies.moving.preview import foreseen

        return foreseen(study, _duration(study), threads, audited)

    def remarks(self, study: Study) -> Sequence[str]:
        from studies.moving.remarks import remarks

        return remarks(study, _duration(study))

    def gather(self, pieces: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
        return gather(pieces, study, self.name)

    def findings(self, results: Results) -> list[str]:
        return findings.answer(results, question_of(results.study, Question).duration)


KIND = MovingFrames()
