"""How often does the response peak in a cycle? Peaks and harmonics of the last cycle of a periodic motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.observation.cycle_reduction import Compared, Cycle
from engine.scene.study import Study
from results_schema.arrays import Array, Mask
from results_schema.lazy_imports import xr
from results_schema.status import Fidelity
from results_schema.variable import outputs
from results_schema.variables import AXES, MARCH, axes, declare
from studies.findings import indices, theory
from studies.findings.absolute_errors import uncertainty
from studies.findings.amplification import DYNAMIC_AMPLIFICATION, with_amplification, with_own_weight
from studies.findings.effects import hardly_changed
from studies.findings.peaks import PEAKS, peaks
from studies.findings.settled import told_growing, told_unsettled
from studies.findings.two_peaks import EXPECTED, first_break, pattern, peaks_in_words, slowest
from studies.protocol.study import Kind
from studies.results.axes import PACES
from studies.results.findings_common import check_sensors, first_carriage, in_words, told_statuses, while_held
from studies.results.formatting import MINUS, ROUNDING, counted, listed, number, percent, times
from studies.results.places import Index, chosen, extreme
from studies.results.results import Results

MOST_SENSORS = 3
STATIONS = 8192  # of a cycle: all steps of nearly every march, so that whatever rings in it is seen as it was marched
SAME_PEAK = 0.05  # of a cycle: maxima further apart are two peaks
MOST_GROUPS = 4
NEAR = 0.15  # how close a harmonic must be to be named as the cause
SLOW = 0.1  # frequency ratio up to which the rule of thumb holds
SYMMETRIC = 0.05  # odd over even harmonics below which the two halves of a cycle are alike
UNLIKE = 0.1  # odd over even harmonics from which the two halves of a cycle look different

RESULTS = outputs("""
    peaks_per_cycle | sensor | | | number of peaks in the last cycle
        maxima with a prominence above 2 % of the cycle's range
    peak_value | sensor peak | {sensor} | nan | value of the peak
        refined by a parabola, at a kink by lines; the 8 highest peaks in the order of their phase, NaN beyond their
        number; in the unit of the sensor
    peak_phase | sensor peak | | nan | phase of the peak in the cycle
        0 to 1, 0 where the motion's formula starts; NaN beyond the number of peaks
    odd_even_ratio | sensor | | nan | odd over even harmonics
        rms of the odd over rms of the even harmonics (k = 1 to 16) of the last cycle
    harmonic | sensor harmonic_number | {sensor} | nan | amplitude of the harmonic
        2 abs(c_k), c_k the mean of w exp(-2 pi i k phase), so twice the mean's size for k = 0; NaN where the cycle has
        too few steps; in the unit of the sensor
""")
declare("double-peak", *MARCH, *RESULTS, DYNAMIC_AMPLIFICATION)
declare(
    AXES,
    *outputs("""
        harmonic_number | | | axis int64 | number of the harmonic
        frequency_ratio | | | optional | frequency ratio
            cycles per second over the first natural frequency of the first carriage's body
    """),
)


@dataclass(frozen=True)
class DoublePeakReduction:
    """Peaks and harmonics of every sensor from the last cycle."""

    stations: int = STATIONS
    compared: tuple[str, ...] = ("peak_value", "harmonic")
    least_fidelity: Fidelity = Fidelity.STATIC

    def outputs(self, study: Study) -> Mapping[str, tuple[str, ...]]:
        return {variable.name: variable.dims for variable in RESULTS}

    def sizes(self, study: Study) -> Mapping[str, int]:
        return {"sensor": len(study.sensor), "peak": PEAKS, "harmonic_number": indices.HARMONICS + 1}

    def __call__(self, cycle: Cycle) -> dict[str, Array]:
        """The results, (V, J) and (V, J, K)."""
        found = peaks(cycle.phase, cycle.history)
        amplitudes = indices.harmonics(indices.evenly(cycle.phase, cycle.history))
        return {
            "peaks_per_cycle": found.number.T,
            "peak_value": found.value.T,
            "peak_phase": found.phase.T,
            "odd_even_ratio": indices.odd_even_ratio(amplitudes).T,
            "harmonic": amplitudes.T,
        }

    def differences(self, compared: Compared) -> dict[str, Array]:
        """Harmonics, and the values of peaks that are the same in both. A bump near the least prominence is a peak in
        one and none in the other without being an error; the harmonics see what matters of it."""
        gaps = compared.gap("harmonic")
        known = ~np.isnan(gaps).all(axis=2)  # few steps tell few harmonics
        harmonics = np.where(known, np.max(np.where(np.isnan(gaps), -np.inf, gaps), axis=2), np.nan)
        return {"peak_value": compared.of_readings(_peak_gap(compared)), "harmonic": compared.relative(harmonics)}


class DoublePeak(Kind):
    """The kind "double-peak"."""

    name = "double-peak"
    summary = "peaks and harmonics of the last cycle of a carriage that goes to and fro"
    question = "How often does the response peak while the carriage goes to and fro once?"
    drawn_by = "studies.pictures.double_peak"

    def check(self, study: Study) -> None:
        """First carriage with a motion that repeats, and sensors."""
        name, carriage = first_carriage(study)
        if carriage.motion.period is None:
            raise study.source.fault(
                f"carriage.{name}.motion.kind",
                "peaks per cycle need a motion that repeats",
                expected='"sinusoidal" or "out-and-back"',
                received=f'"{study.value(f"carriage.{name}.motion.kind")}"',
            )
        check_sensors(study)

    def reduction(self, study: Study) -> DoublePeakReduction:
        return DoublePeakReduction()

    def summarise(self, dataset: xr.Dataset, study: Study) -> xr.Dataset:
        """With amplification, and with the numbers of peaks and harmonics as coordinates."""
        found = {
            "peak": ("peak", np.arange(1, PEAKS + 1, dtype=np.int64), _axis("peak")),
            "harmonic_number": (
                "harmonic_number",
                np.arange(indices.HARMONICS + 1, dtype=np.int64),
                _axis("harmonic_number"),
            ),
        }
        found = {name: value for name, value in found.items() if name not in study.sweep.axes}
        return with_amplification(dataset, study).assign_coords(found)

    def along(self, results: Results) -> Mapping[str, tuple[Sequence[str], NDArray[Any], Mapping[str, Any]]]:
        """The frequency ratio."""
        ratio = xr.DataArray(theory.frequency_ratio(results))
        return {"frequency_ratio": (tuple(map(str, ratio.dims)), ratio.values, _axis("frequency_ratio"))}

    def findings(self, results: Results) -> list[str]:
        said = []
        for sensor in chosen(list(results.sensors), MOST_SENSORS):
            said += [_answer(results, sensor), *_breaks(results, sensor), *_amplified(results, sensor)]
            said += [*_halves(results, sensor), *_end_springs(results, sensor)]
        unsettled = [*told_growing(results), *told_unsettled(results)]
        return [*said[:1], *unsettled, *said[1:], *told_statuses(results)]

    def named(self, results: Results) -> list[Index]:
        """For every sensor of the answer the variant where two peaks end and that with the largest amplification."""
        sensors = list(chosen(list(results.sensors), MOST_SENSORS))
        places = [first_break(results, sensor) for sensor in sensors]
        places += [extreme(results.counting("dynamic_amplification", sensor)) for sensor in sensors]
        return [place for place in places if place is not None]


KIND = DoublePeak()


def _peak_gap(compared: Compared) -> Array:
    """(V, J) the largest difference of peaks that are the same in both: their phases, round the cycle, are closer than
    `SAME_PEAK` and than half of what separates either from the next peak. Others are not compared: one is a bump near
    the least prominence, or it has moved, and harmonics tell what matters of that."""
    (value, phase), (values, phases) = (
        (np.asarray(part["peak_value"], dtype=np.float64), np.asarray(part["peak_phase"], dtype=np.float64))
        for part in (compared.one, compared.other)
    )
    near, others_near = (np.fmin(SAME_PEAK, 0.5 * _spacing(part)) for part in (phase, phases))
    found = np.zeros(value.shape[:-1])
    for k in range(value.shape[-1]):
        other = np.roll(np.arange(value.shape[-1]), k)
        same = _apart(phase, phases[..., other]) <= np.minimum(near, others_near[..., other])
        gap = np.where(same, np.abs(value - values[..., other]), 0.0)
        found = np.maximum(found, gap.max(axis=-1))
    return found


def _spacing(phase: Array) -> Array:
    """(..., K) how far the next peak is from each, round the cycle; NaN where there is no other."""
    found = np.full(phase.shape, np.nan)
    for k in range(1, phase.shape[-1]):
        found = np.fmin(found, _apart(phase, np.roll(phase, k, axis=-1)))
    return found


def _apart(phase: Array, other: Array) -> Array:
    """Distance of phases, round the cycle."""
    return np.asarray(np.abs(np.mod(phase - other + 0.5, 1.0) - 0.5))


def _axis(name: str) -> dict[str, object]:
    return axes()[name].attributes()


def _answer(results: Results, sensor: str) -> str:
    """How often the response peaks, up to where, and how many variants have how many peaks."""
    counts, ratio = results.numbers("peaks_per_cycle", sensor), results.everywhere(theory.frequency_ratio(results))
    known = np.isfinite(counts)
    if not known.any():
        return f"{sensor}: no variant has values, so the question stays open."
    values, variants = np.unique(counts[known], return_counts=True)
    if len(values) == 1:
        every = f" in every one of {counted(int(known.sum()), 'variant')}" if known.sum() > 1 else ""
        return f"{sensor}: {counted(int(values[0]), 'peak')} per cycle{every}."
    ranked = sorted(zip(variants, values, strict=True), reverse=True)
    share = listed([f"{counted(int(value), 'peak')} in {percent(count / known.sum())}" for count, value in ranked])
    place = first_break(results, sensor)
    if place is None:
        return f"{sensor}: {share} of the variants; not all peak twice even at the lowest frequency."
    usual = peaks_in_words(pattern(results, sensor))
    below = f"{usual} per cycle below {_pace_and_ratio(results, float(ratio[place]))}"
    else_varied = ", whatever else is varied" if len(_varied(results)) > 1 else ""
    return (
        f"{sensor}: {below}{else_varied}; there "
        f"the pattern breaks first, with {counted(int(counts[place]), 'peak')}{in_words(results, place)}. In all: "
        f"{share} of the variants."
    )


def _varied(results: Results) -> list[str]:
    """Names of the swept numbers that have several values."""
    return [axis.name for axis in results.axes if len(axis.values) > 1]


def _pace(results: Results, ratio: float, times: float = 1.0) -> str:
    """A frequency of the cycle, so many times that of a ratio to the first natural one, in words: as swept, where one
    value has it, else that ratio."""
    axis = results.axis(*PACES)
    same = results.everywhere(theory.frequency_ratio(results)) == ratio
    values = np.unique(results.everywhere(results.dataset[axis.name])[same]) if axis is not None else np.zeros(0)
    if axis is None or values.size != 1:
        return f"{number(times * ratio)} of the first natural frequency"
    return axis.in_words(float(values[0]) * times)


def _pace_and_ratio(results: Results, ratio: float) -> str:
    """The same, with the ratio beside it."""
    said, part = _pace(results, ratio), f"{number(ratio)} of the first natural frequency"
    return said if said == part else f"{said} ({part})"


def _breaks(results: Results, sensor: str) -> list[str]:
    """Up to which frequency ratio there are as many peaks as of the slowest, for each mass, and which harmonic breaks
    the pattern."""
    counts, ratio = results.numbers("peaks_per_cycle", sensor), results.everywhere(theory.frequency_ratio(results))
    known = np.isfinite(counts)
    usual = pattern(results, sensor)
    if np.unique(ratio[known]).size < 2 or set(counts[known].tolist()) == {usual} or usual not in counts[known]:
        return []
    group = results.deciding_axis("peaks_per_cycle", sensor)
    if group is None:
        place = first_break(results, sensor)
        if place is None:
            return [f"{sensor}: {_break(results, usual, counts, known)}."]
        met = _harmonic(results, place, float(ratio[place]))
        return [f"{sensor}: {met}."] if met else []
    along = results.everywhere(results.dataset[group.name])
    said = []
    for value in chosen(sorted(set(group.values.tolist())), MOST_GROUPS):
        label = group.at(group.values.tolist().index(value))
        said.append(f"{label}: {_break(results, usual, counts, known & (along == value))}")
    return [f"{sensor}: " + "; ".join(said) + "."]


def _break(results: Results, usual: int, counts: Array, among: Mask) -> str:
    """Where among some variants the usual number of peaks breaks, beside the nearest harmonic of the cycle."""
    ratio, other = results.everywhere(theory.frequency_ratio(results)), among & (counts != usual)
    if not other.any():
        return f"{peaks_in_words(usual)} throughout, up to {_pace(results, float(ratio[among].max()))}"
    first = float(ratio[other].min())
    fine = among & (ratio < first)
    place = tuple(np.argwhere(other & (ratio == first))[0])
    text = f"{counted(int(counts[place]), 'peak')} at {_pace(results, first)}"
    if not fine.any():
        return f"{counted(int(counts[place]), 'peak')} already at the lowest, {_pace(results, first)}"
    text = f"{peaks_in_words(usual)} up to {_pace(results, float(ratio[fine].max()))}, {text}"
    met = _harmonic(results, place, first)
    return f"{text} ({met})" if met else text


def _harmonic(results: Results, place: Index, first: float) -> str:
    """Which harmonic of the cycle meets the natural frequency of the loaded body near a frequency ratio, and where; ""
    where none does."""
    mass = results.dataset.coords.get("mass_ratio")
    if mass is None:
        return ""
    own = np.array([float(results.everywhere(mass)[place])])
    lines = {order: float(theory.breakdown(results, own, order)[0]) for order in theory.ORDERS}
    near = min(lines, key=lambda order: abs(np.log(lines[order] / first)))
    if abs(lines[near] / first - 1.0) > NEAR:
        return ""
    where = _pace(results, first, lines[near] / first)
    return f"harmonic {near} of the cycle meets the natural frequency with the mass at {where}"


def _end_springs(results: Results, sensor: str) -> list[str]:
    """From which difference of the end springs on a slow shuttle gives one peak, beside the rule 1/8."""
    softness = theory.end_spring_difference(results, sensor)
    if softness is None:
        return []
    counts = results.numbers("peaks_per_cycle", sensor)
    slow = slowest(results, results.everywhere(theory.frequency_ratio(results)))
    one, two = (softness[slow & (counts == count)] for count in (1, EXPECTED))
    if not (one.size and two.size and two.max() < one.min()):
        return []
    return [
        f"{sensor}: at the lowest frequency there are two peaks up to (E I/L³)|1/k_a {MINUS} 1/k_b| = "
        f"{number(float(two.max()))} of the end springs and one from {number(float(one.min()))} on; the rule says "
        f"{number(theory.ONE_PEAK)}."
    ]


def _amplified(results: Results, sensor: str) -> list[str]:
    """The largest amplification, and at low frequency beside the rule of thumb of a pinned beam."""
    gain = results.counting("dynamic_amplification", sensor)
    ratio = results.everywhere(theory.frequency_ratio(results))
    top, slow = extreme(gain), extreme(np.where(ratio <= SLOW, gain, np.nan))
    if top is None:
        return []
    result = f"dynamic_amplification {sensor}"
    loosely = with_own_weight(results.study, sensor) + uncertainty(results, result, top)
    where = "" if hardly_changed(results, gain, partial(number, digits=4)) else in_words(results, top)
    said = f"{sensor}: {while_held(results)}at most {times(float(gain[top]), 'the static value', 4)}{loosely}{where}"
    if slow is None or slow == top:
        return [f"{said}{_rule(results, sensor, top)}."]
    below = f"below {number(SLOW)} of the first natural frequency at most {times(float(gain[slow]), digits=4)}"
    below += uncertainty(results, result, slow)
    return [f"{said}; {below}{in_words(results, slow)}{_rule(results, sensor, slow)}."]


def _rule(results: Results, sensor: str, place: Index) -> str:
    """The rule of thumb 1 + (2.5 + 8.1 mu) (Omega/omega_1)^2 for midspan and a slow shuttle about the middle of a
    pinned beam, where it applies."""
    expected = theory.shuttle_amplification(results, sensor)
    if expected is None or float(results.everywhere(theory.frequency_ratio(results))[place]) > SLOW:
        return ""
    return f" (rule of thumb: {number(float(expected[place]), 4)})"


def _halves(results: Results, sensor: str) -> list[str]:
    """Whether the two halves of a cycle are alike."""
    ratio, held = results.counting("odd_even_ratio", sensor), while_held(results)
    place = extreme(ratio)
    if place is None:
        return []
    largest = float(ratio[place])
    if largest < SYMMETRIC:
        alike = f"; odd harmonics are at most {percent(largest)} of the even" if largest > ROUNDING else ""
        return [f"{sensor}: {held}the two halves of a cycle are alike{alike}."]
    start = _from_where(results, ratio)
    return [
        f"{sensor}: {held}the two halves of a cycle differ{start}; odd harmonics reach {number(largest)} times the even"
        f"{in_words(results, place)}."
    ]


def _from_where(results: Results, odd: Array) -> str:
    """From which frequency ratio on the halves of a cycle are visibly unlike, if not from the lowest on; where first if
    they are not so in every variant beyond."""
    ratio = results.everywhere(theory.frequency_ratio(results))
    unlike, known = odd > UNLIKE, np.isfinite(odd)
    if not unlike.any() or not (known & (ratio < ratio[unlike].min())).any():
        return ""
    lowest = float(ratio[unlike].min())
    first, stays = _pace_and_ratio(results, lowest), unlike[known & (ratio >= lowest)].all()
    where = f"from {first} on" if stays else f"first at {first}"
    return f" by more than {percent(UNLIKE)} of the even harmonics {where}"
