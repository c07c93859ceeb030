"""What a finished study says, from its dataset alone: in sentences and in figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from results_schema.lazy_imports import xr
from studies.findings.cells import findings_of_cells
from studies.findings.envelopes import beyond_sensors, told_envelopes
from studies.findings.numerics_used import is_marched, told_choices
from studies.protocol.study import kind_named
from studies.results.checks import check_named
from studies.results.findings_common import told_far, told_statuses
from studies.results.results import Results

if TYPE_CHECKING:
    from studies.pictures.common.figures import Figure


MOST_SAID = 4  # of the sentences at the end of a run, which are to stay on the screen; the report has all


def answer(dataset: xr.Dataset) -> list[str]:
    """The answer in sentences, the most important first."""
    return findings_of(check_named(Results.of(dataset)))


def figures(dataset: xr.Dataset) -> list[Figure]:
    """The figures of the report, the most important first."""
    return figures_of(check_named(Results.of(dataset)))


class ShortAnswer(NamedTuple):
    """The answer in two to five sentences, and how many further ones there are, with those on envelopes."""

    said: list[str]
    left: int


def answer_of(results: Results) -> list[str]:
    """The answer in two to five sentences: what the kind of study says first."""
    return short_answer_of(results).said


def short_answer_of(results: Results) -> ShortAnswer:
    """The same, and what is left out of it."""
    found, statuses = _findings(results), told_statuses(results)
    own = [text for text in found if text not in statuses]
    return ShortAnswer(own[:MOST_SAID], len(own[MOST_SAID:]) + len(_of_envelopes_besides(results, found)))


def findings_of(results: Results) -> list[str]:
    """What the kind of study finds, then what the envelopes say, then what every variant took."""
    return [*found_of(results), *told_choices(results)]


def found_of(results: Results) -> list[str]:
    """What the kind of study finds, then what those envelopes say of which it says nothing."""
    found = _findings(results)
    return [*found, *_of_envelopes_besides(results, found)]


def _of_envelopes_besides(results: Results, found: list[str]) -> list[str]:
    """What those envelopes say of which the findings say nothing."""
    return [text for text in told_envelopes(results) if not any(one.startswith(text) for one in found)]


def _findings(results: Results) -> list[str]:
    """What the kind of study finds, or what is known of cells of variants."""
    if not results.study.output.keeps_variants:
        return findings_of_cells(results)
    kind = kind_named(results.study.kind)
    said = kind.findings(results)
    far = told_far(results) if is_marched(results.dataset) and not kind.moves_frames else []
    return [*said[:1], *far, *said[1:]]


def figures_of(results: Results) -> list[Figure]:
    """The figures of the question, the most important first, then those on methods."""
    from studies.pictures.common import cells, envelopes, estimates
    from studies.pictures.common import numerics_used as choice

    if not results.study.output.keeps_variants:
        return cells.pictures(results)
    found = kind_named(results.study.kind).figures(results)
    along = envelopes.pictures(results)
    found = [*along, *found] if beyond_sensors(results) else [*found, *along]
    found.sort(key=lambda figure: figure.on_method)
    return [*found, *choice.pictures(results), *estimates.pictures(results)]
