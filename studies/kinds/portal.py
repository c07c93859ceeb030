"""How far are robots off their plan that move on rails which bend? Section 3 of Hartweg and Heckmann (2012)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from results_schema.variables import declare
from studies.protocol.study import PiecedKind, question_of
from studies.robots import findings
from studies.robots.question import Question
from studies.robots.tolerance_missed import told_missed
from studies.robots.variables import RESULTS

if TYPE_CHECKING:
    import xarray as xr

    from engine.scene.study import Study
    from results_schema.arrays import Array, Counts
    from studies.protocol.parts import Foreseen, Piece, TextTable, Work
    from studies.results.results import Results

declare("portal", *RESULTS)


class Portal(PiecedKind):
    """The kind "portal"."""

    name = "portal"
    summary = "robots on rails that bend: errors of their tools, cycle time against accuracy"
    question = "How far are the tools off their plan, and what does accuracy cost in cycle time?"
    settings = Question
    sweeps = True
    moves_robots = True
    audit_seconds = 1.8  # one march of 48 steps a period and 64 modes after those of 12, 24 and 24
    drawn_by = "studies.pictures.portal"

    def check(self, study: Study) -> None:
        if not study.robot:
            raise study.source.fault("robot", "there is no robot", expected="a table [robot.NAME]")
        for table, given in (("carriage", tuple(study.carriage)), ("sensor", tuple(study.sensor))):
            if given:
                what = f"in studies of the kind {self.name} robots ride, and their tools are read"
                raise study.source.fault(table, what, expected=f"no table [{table}.NAME]", received=", ".join(given))
        if study.solver.fidelity not in ("auto", "full"):
            raise study.source.fault("solver.fidelity", "robots on rails have one model", expected='"auto"')
        if study.output.histories not in ("auto", "all", "none"):
            what = "histories of robots are kept at some 800 times"
            raise study.source.fault("output.histories", what, expected='"auto", "all" variants or "none"')

    def pieces(self, study: Study) -> Sequence[Piece]:
        from studies.robots.parts import pieces

        return pieces(study, question_of(study, Question))

    def again(self, study: Study, variants: Counts, work: Work) -> Mapping[int, tuple[Array, Array] | None]:
        from studies.robots.parts import again

        return again(study, question_of(study, Question), variants, work)

    def remarks(self, study: Study) -> Sequence[str]:
        from studies.robots.remarks import remarks

        return remarks(study)

    def tables(self, study: Study) -> Iterable[TextTable]:
        from studies.robots.preview import tables

        return tables(study)

    def foreseen(self, study: Study, threads: int, audited: int) -> Foreseen:
        from studies.robots.preview import foreseen

        return foreseen(study, question_of(study, Question), threads, audited)

    def gather(self, pieces: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
        from studies.robots.parts import gather

        return gather(pieces, study, question_of(study, Question), self.name)

    def findings(self, results: Results) -> list[str]:
        return findings.answer(results)

    def missed(self, results: Results) -> list[str]:
        return list(told_missed(results))


KIND = Portal()
