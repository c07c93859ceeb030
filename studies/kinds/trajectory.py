"""What happens when? Histories of every sensor and of the carriages' own motion."""

from functools import partial

import numpy as np

from engine.scene.study import Study
from results_schema.variable import outputs
from results_schema.variables import MARCH, declare
from studies.findings.absolute_errors import uncertainty
from studies.findings.beyond import AskedOfRest, of_every_quantity
from studies.findings.residual import check_residual, most_ringing, residuals
from studies.protocol.study import Kind, question_of
from studies.results.findings_common import check_sensors, first_carriage, over_all, told_statuses
from studies.results.formatting import counted, quantity, spanned
from studies.results.places import Index
from studies.results.results import Results

MOST_SENSORS = 4


RESULTS = outputs("""
    * | | | optional history nan |
    {carriage}_speed | position/phase/station | m s-1 | | speed along the track of {carriage}
        NaN where it is off the body
    {carriage}_acceleration_along | position/phase/station | m s-2 | | acceleration along the track of {carriage}
        NaN where it is off the body
    {carriage}_acceleration_across | position/phase/station | m s-2 | |
        acceleration across the track of {carriage}
        in the direction of the deflection; NaN where it is off the body
""")
declare("trajectory", *MARCH, *RESULTS)


class Trajectory(Kind):
    """The kind "trajectory"."""

    name = "trajectory"
    summary = "histories of every sensor and of the carriages' motion"
    question = "What do the sensors and the carriages do over time?"
    settings = AskedOfRest
    drawn_by = "studies.pictures.trajectory"

    def check(self, study: Study) -> None:
        """Something moves, something is measured, and histories are kept."""
        first_carriage(study)
        check_sensors(study)
        check_residual(study, question_of(study, AskedOfRest))
        if study.output.histories == "none":
            raise study.source.fault(
                "output.histories",
                "a trajectory is its histories",
                expected='"auto", "all" or { every = n }',
                received='"none"',
            )

    def named(self, results: Results) -> list[Index]:
        """The variants that swing on most."""
        return most_ringing(results)

    def findings(self, results: Results) -> list[str]:
        traced = results.traced()
        said = residuals(results, question_of(results.study, AskedOfRest))
        said += [_span(results, sensor) for sensor in of_every_quantity(results, MOST_SENSORS)]
        return [*said, _kept(results) if traced else "No history was kept.", *told_statuses(results)]


KIND = Trajectory()


def _kept(results: Results) -> str:
    """How many histories there are, how long and how fine."""
    traced = results.traced()
    traces = [results.trace(next(iter(results.sensors)), index) for index in traced]
    points = [int(np.isfinite(trace.values).sum()) for trace in traces]
    spans = spanned((trace.end for trace in traces), partial(quantity, units="s"))
    fewest = "" if min(points) == max(points) else f"{min(points):,} to "
    return (
        f"Histories of {counted(len(traced), 'variant')} out of {results.size:,}, each over {spans} "
        f"on {fewest}{counted(max(points), 'station')}."
    )


def _span(results: Results, sensor: str) -> str:
    """Between which values a sensor moves."""
    units = results.sensors[sensor]
    low, high = (results.dataset[f"{sensor}_{side}"].values for side in ("min", "max"))
    if np.isnan(low).all():
        return f"{sensor}: no variant has values."
    ends = float(np.nanmin(low)), float(np.nanmax(high))
    span = " to ".join(quantity(end, units, beside=max(map(abs, ends))) for end in ends)
    places = (results.index_of(int(flat)) for flat in (np.nanargmin(low), np.nanargmax(high)))
    named = zip((f"{sensor}_min", f"{sensor}_max"), places, strict=True)
    looser = max(named, key=lambda end: np.nan_to_num(results.error_at(*end)))
    what = f"{results.noun(sensor)} {results.place(sensor)}"
    loosely = uncertainty(results, *looser, max(map(abs, ends)))
    return f"{sensor}: the {what} goes from {span}{over_all(results)}{loosely}."
