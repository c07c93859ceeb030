"""Does the response differ forward and backward? Indices of an out-and-back cycle at equal positions."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from engine.observation.cycle_reduction import Compared, Cycle
from engine.scene.study import Study
from engine.scene.sweep import expand
from results_schema.arrays import Array, Mask
from results_schema.quantities import QUANTITIES
from results_schema.status import Fidelity
from results_schema.variable import outputs
from results_schema.variables import MARCH, declare
from studies.findings import indices, theory
from studies.findings.absolute_errors import absolute_errors, told_error, uncertainty
from studies.findings.settled import (
    Asked,
    odd_parts,
    remainder_of_start,
    shown_sensors,
    thresholds,
    told_growing,
    where_late,
)
from studies.protocol.study import Kind
from studies.results.axes import VARIANT
from studies.results.findings_common import exceeds, first_carriage, in_words, told_statuses
from studies.results.formatting import counted, listed, percent, quantity, spanned
from studies.results.places import Index, extreme
from studies.results.results import Results

LEAST_CRUISE = 0.5  # of the stroke: comparing less says nothing of the stroke

NOTICEABLE = 0.01  # of the static range: what counts as a difference in the answer
CLOSE = 0.05

RESULTS = outputs("""
    lag | sensor | m | nan | lag of the response
        <odd, dw_s/ds> over <dw_s/ds, dw_s/ds> on the cruise part of the last cycle, derivatives along forward; negative
        when the response trails; NaN where the static response does not vary
    loop_area | sensor | | nan | area between forward and backward
        signed integral of forward minus backward over the cruise part's length times the static range R, the largest
        minus the smallest static value of the sensor while the carriage is on the cruise part
    odd_rms | sensor | | nan | odd part of the response
        rms of half the difference of forward and backward over the static range R, as in `loop_area`
    even_excess | sensor | | nan | dynamic part common to both ways
        rms of the mean of forward and backward minus the static response over the static range R, as in `loop_area`
""")
declare("asymmetry", *MARCH, *RESULTS)


@dataclass(frozen=True)
class AsymmetryReduction:
    """lag, loop_area, odd_rms, even_excess of every sensor from the last cycle."""

    stations: int = 1600
    compared: tuple[str, ...] = ("lag", "loop_area", "odd_rms", "even_excess")
    least_fidelity: Fidelity = Fidelity.FORCE  # statics lag nowhere

    def outputs(self, study: Study) -> Mapping[str, tuple[str, ...]]:
        return {variable.name: variable.dims for variable in RESULTS}

    def sizes(self, study: Study) -> Mapping[str, int]:
        return {"sensor": len(study.sensor)}

    def __call__(self, cycle: Cycle) -> dict[str, Array]:
        """The indices, each (V, J)."""
        way = cycle.motion.legs
        assert way is not None
        fields = (indices.evenly(cycle.phase, field) for field in (cycle.history, cycle.static, cycle.static_slope))
        legs = indices.folded(way.cruise, *fields)
        found = indices.asymmetry(legs, 1.0 if way.end > way.start else -1.0)
        return {name: value.T for name, value in found._asdict().items()}

    def differences(self, compared: Compared) -> dict[str, Array]:
        """Lag over the length of the cruise; odd and even parts, which are parts of the static range."""
        way = next(iter(compared.values.study.carriage.values())).motion.legs
        assert way is not None
        lag = compared.gap("lag") / (abs(way.end - way.start) * (1.0 - 2.0 * way.turn))
        least = compared.of_readings(np.zeros_like(compared.scale))
        rms = {name: np.maximum(compared.gap(name), least) for name in ("odd_rms", "even_excess")}
        return {"lag": lag, "loop_area": compared.gap("loop_area")} | rms


class Asymmetry(Kind):
    """The kind "asymmetry"."""

    name = "asymmetry"
    summary = "forward against backward at equal positions: lag, loop area, odd and even parts of the last cycle"
    question = "Does the response differ when the carriage comes back?"
    settings = Asked
    drawn_by = "studies.pictures.asymmetry"

    def check_tables(self, study: Study) -> None:
        """That its first carriage comes back, before what the question asks of that."""
        _check_comes_back(study)
        super().check_tables(study)

    def check(self, study: Study) -> None:
        """First carriage out and back, cruising over at least half of its stroke; sensors with a static response."""
        name, _ = first_carriage(study)
        _check_cruise(study, name)
        if not study.sensor:
            raise study.source.fault("sensor", "nothing is measured", expected="at least one sensor")
        for sensor, place in study.sensor.items():
            if QUANTITIES[place.quantity].rate:
                raise study.source.fault(
                    f"sensor.{sensor}.quantity",
                    "an asymmetry compares with the static response, which this quantity does not have",
                    expected=" | ".join(name for name, quantity in QUANTITIES.items() if not quantity.rate),
                    received=f'"{place.quantity}"',
                )

    def reduction(self, study: Study) -> AsymmetryReduction:
        return AsymmetryReduction()

    def findings(self, results: Results) -> list[str]:
        left = remainder_of_start(results)
        settled = ~(left > thresholds(results)[0])
        answer = _answer(results, settled)
        start = [*told_growing(results), _start(results, np.where(np.isinf(left), 1.0, left))]
        said = [answer, *start] if settled.any() else [*start, answer]
        for sensor in shown_sensors(results):
            said += [_lag(results, sensor), _first_beyond(results, sensor, settled)]
        return [*said, *_mass(results), *told_statuses(results)]

    def named(self, results: Results) -> list[Index]:
        """For every sensor the variant with the largest odd part."""
        places = map(extreme, np.moveaxis(odd_parts(results), -1, 0))
        return [place for place in places if place is not None]


KIND = Asymmetry()


def _check_comes_back(study: Study) -> None:
    """Refuse a first carriage that does not come back at constant speed. Raises BadInput."""
    name, carriage = first_carriage(study)
    if carriage.motion.legs is None:
        here, direction = f"carriage.{name}.motion.kind", f"carriage.{name}.motion.direction"
        what = "forward and backward are compared between the turns, on a way that comes back at constant speed"
        remedy = "two passages, one with the way the other way round, and compare of their archives"
        if direction in study.numbers():
            remedy = (
                f'kind = "passage" with way = {{ of = "{direction}", values = ["forward", "backward"] }} in [sweep]'
            )
        if carriage.motion.period is not None:
            remedy = 'kind = "double-peak" asks what a cycle of it does'
        received = f'"{study.value(here)}"'
        raise study.source.fault(here, what, expected='"out-and-back"', received=received, remedy=remedy)


def _check_cruise(study: Study, carriage: str) -> None:
    """Every variant cruises over half of its stroke or more; a turn blends its part of the stroke at either end."""
    key = f"carriage.{carriage}.motion.turn"
    swept = [axis.values for axis in expand(study).axes if key in axis.paths]
    largest = float(max(swept[0])) if swept else float(study.value(key))
    if 1.0 - 2.0 * largest < LEAST_CRUISE:
        what = "the carriage cruises over less than half of its stroke, too little to compare forward and backward"
        raise study.source.fault(key, what, expected=f"at most {0.5 * (1.0 - LEAST_CRUISE):g}", received=f"{largest:g}")


def _start(results: Results, left: Array) -> str:
    """How many variants still carry the vibration of the start in their last cycle, and where.

    left: what is left of it, in the sweep's shape, NaN where that is not known.
    """
    known, most = np.isfinite(left), thresholds(results)[0]
    late = left > most
    if not known.any():
        return "How much of the start's vibration is left in the last cycle is not known, with these dampers."
    unknown = f" In {counted(int((~known).sum()), 'variant')} with dampers it is not known." * (not known.all())
    if not late.any():
        told = f"at most {percent(float(left[known].max()))} of the start's vibration is left"
        who = "every variant" if known.all() else "every other variant"
        return f"In the last cycle {told}: {who} has settled.{unknown}"
    where = where_late(results, late)
    told = f"more than {percent(most)} of the start's vibration is left in the last cycle{where}"
    if late.all():
        return f"No variant has settled: {told}. What follows holds the start too; run more cycles or with damping."
    count = f"In {int(late.sum()):,} of {counted(results.size, 'variant')}"
    advice = "they have not settled, and the first sentence leaves them out; run more cycles or with damping"
    return f"{count} {told}: {advice}.{unknown}"


def _answer(results: Results, fine: Mask) -> str:
    """Yes or no, by the largest odd part of all sensors in the variants that have settled, or in all if none has."""
    if extreme(results.dataset["odd_rms"]) is None:
        return "No variant has values, so the question stays open."
    odd = odd_parts(results)
    place = extreme(odd)
    if place is None:
        return "No variant that has settled has values, so the question stays open."
    largest, sensor = float(odd[place]), list(results.sensors)[place[-1]]
    who = f", of the {counted(int(fine.sum()), 'variant')} that settled" if fine.any() and not fine.all() else ""
    at = f"{uncertainty(results, f'odd_rms {sensor}', place[:-1])}{in_words(results, place[:-1])}{who}"
    if largest < NOTICEABLE:
        return (
            f"Hardly: at {sensor}, where they differ most, forward and backward differ by {percent(largest)} of "
            f"the static range (rms of the odd part){at}."
        )
    return (
        f"Yes: at {sensor} forward and backward differ by up to {percent(largest)} of the static range "
        f"(rms of the odd part){at}."
    )


def _lag(results: Results, sensor: str) -> str:
    """How far the response trails where damping alone decides, up to where that is, and what comes beyond."""
    lag = results.numbers("lag", sensor)
    expected = results.everywhere(theory.lag(results, sensor))
    if not np.isfinite(lag).any():
        return f"{sensor}: no lag is defined, as its static response does not vary or no variant has values."
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.where(expected != 0.0, np.abs(lag / expected - 1.0), np.nan)  # nothing is expected: NaN
    known, formula = np.isfinite(apart), theory.lag_formula(results, sensor)
    axis = results.axis(".motion.speed")
    if axis is None or not known.any():
        return f"{sensor}: {_largest_lag(results, sensor, lag, expected)}."
    limit = results.holds_up_to(axis, apart <= CLOSE, known)
    if limit is None:
        slowest = apart[known & (results.everywhere(results.dataset[axis.name]) == axis.values.min())]
        off = f"up to {percent(float(slowest.max()))} away from {formula}" if slowest.size else "not known"
        return f"{sensor}: {_largest_lag(results, sensor, lag, expected)}; at the lowest speed it is {off}."
    slow = results.everywhere(results.dataset[axis.name]) <= limit
    calm = _largest_lag(results, sensor, np.where(slow, lag, np.nan), expected)
    beyond = lag[~slow & np.isfinite(lag)]
    if not beyond.size:
        which = "every variant" if known.all() else "every variant with values"
        return f"{sensor}: {calm}, within {percent(CLOSE)} of {formula} in {which}."
    span = spanned(beyond.tolist(), partial(quantity, units="m"))
    return (
        f"{sensor}: up to {axis.in_words(limit)} every variant lags within {percent(CLOSE)} of {formula}: {calm}. "
        f"Beyond, vibration left over from the turns (or the start) takes over, and the lag is {span}."
    )


def _largest_lag(results: Results, sensor: str, lag: Array, expected: Array) -> str:
    """The largest lag of some variants in words, what it may be off where that is much of it, and the theory's."""
    place = extreme(np.abs(lag))
    assert place is not None
    size, off = abs(float(lag[place])), float(absolute_errors(results, "lag", sensor)[place])
    way = "trails" if lag[place] < 0.0 else "runs ahead"
    said = f"the response {way} by {quantity(size, 'm')}{told_error(off, size, 'm')}{in_words(results, place)}"
    if off > size:
        said = f"a lag of {quantity(size, 'm')} is less than what it may be off, {quantity(off, 'm', 2)}"
    known = abs(float(np.nan_to_num(expected[place])))
    return f"{said} (theory: {quantity(known, 'm')})" if known else said


def _first_beyond(results: Results, sensor: str, settled: Mask) -> str:
    """Where the odd part exceeds each threshold first, in the variants that have settled, or in all if none has."""
    odd = results.numbers("odd_rms", sensor)
    some = settled.any() and not settled.all()
    odd, of = (np.where(settled, odd, np.nan), " of those that have settled") if some else (odd, "")
    if not np.isfinite(odd).any():
        return f"{sensor}: no odd part is defined, as its static response does not vary."
    parts = thresholds(results)
    exceeded = sum(bool(np.nanmax(odd) > part) for part in parts)
    said = [exceeds(results, odd, part) for part in parts[: exceeded + 1]]
    return f"{sensor}: the odd part{of} {listed(said)}."


def _mass(results: Results) -> list[str]:
    """How much the mass changes the lag at the lowest speed."""
    mass = results.axis(".mass")
    if mass is None or mass.dim == VARIANT:
        return []
    lag = abs(results.dataset["lag"])
    speed = results.axis(".motion.speed")
    if speed is not None:
        lag = lag.isel({speed.dim: np.flatnonzero(speed.values == speed.values.min())})
    high, low = lag.max(mass.dim), lag.min(mass.dim)
    change = np.asarray(((high - low) / high).where(high > 0.0).values, dtype=np.float64)
    if not np.isfinite(change).any():
        return []
    at = f" at {speed.in_words(float(speed.values.min()))}" if speed is not None else ""
    worst = float(np.nanmax(change))
    verdict = "hardly feels" if worst < CLOSE else "depends on"
    return [f"The lag {verdict} the mass: from {mass.span} it changes by {percent(worst)} at most{at}."]
