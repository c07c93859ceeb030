"""What the audit of a run found: whether tolerances were held, in numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.status import Fidelity, Status
from results_schema.variables import WHERE_OR_WHEN
from studies.at_rest.told_errors import told_errors
from studies.findings.numerics_used import ERROR, is_marched, known, of_variants
from studies.results.cells import words_of
from studies.results.formatting import counted, listed, percent, scientific, times
from studies.results.results import Results
from studies.runs.not_audited import told_none, told_none_briefly

FIXED = "errors by what a study fixes itself, as its model, modes, steps or elements, change no status"
ELEMENTS = "errors by the elements of frames change no status: more elements lessen them"
LARGE = 0.02  # an estimated error that people should know of where nothing holds it: what figures hardly show


def relative_errors(group: xr.Dataset, name: str = "observed_error") -> Array:
    """(n, R) errors over the tolerances of their results; NaN where these are only told."""
    tighter = np.asarray(group["tolerance_asked"].values)[:, None]  # `solver.tolerance` over the study's
    return np.asarray(group[name].values / (np.asarray(group["tolerance"].values) * tighter), dtype=np.float64)


@dataclass(frozen=True)
class Verdict:
    """What an audit found among the variants that the archive calls ok.

    worst: the largest observed error over its tolerance, NaN where none is known; place, result: its number in the
    group, and the result. missed: variants beyond a tolerance. unknown: those without a number. marked: variants to
    which the archive itself gives another status than ok, and so no promise; marked_worst: the largest among them.
    """

    count: int
    left_out: int
    worst: float
    place: int
    result: int
    missed: int
    unknown: int
    marked: int
    marked_worst: float

    @property
    def held(self) -> bool:
        """Whether every audited variant that the archive calls ok is known to be within its tolerance."""
        return not (self.missed or self.unknown)

    @classmethod
    def of(cls, group: xr.Dataset) -> Verdict:
        """The verdict of the archive's group."""
        errors = relative_errors(group)
        held = np.isfinite(group["tolerance"].values)
        over = np.max(np.where(held, errors, -1.0), axis=1, initial=-1.0)  # one that is not known makes it NaN
        ours = np.asarray(group["variant_status"].values) == int(Status.OK)
        known = ~np.isnan(over)
        place = int(np.argmax(np.where(known & ours, over, -1.0)))
        return cls(
            count=int(np.count_nonzero(ours)),
            left_out=int(group["left_out"]),
            worst=float(over[place]) if ours[place] else np.nan,
            place=place,
            result=int(np.nanargmax(np.where(np.isnan(errors[place]), -1.0, errors[place]))),
            missed=int(np.count_nonzero(over[known & ours] > 1.0)),
            unknown=int(np.count_nonzero(~known & ours)),
            marked=int(np.count_nonzero(~ours)),
            marked_worst=float(over[known & ~ours].max()) if (known & ~ours).any() else np.nan,
        )


def told_accuracy(group: xr.Dataset | None, results: Results) -> str:
    """What was asked, estimated and observed, and what is far from exact as nothing holds it; "" where no estimates
    are."""
    fewer = [] if group is None else [f"{text[0].upper()}{text[1:]}." for text in _fewer(Verdict.of(group), results)]
    more = "" if group is None else _beyond_estimates(group)
    said = (_held_accuracy(group, results), *fewer, told_errors(results), _not_held(results), more)
    return " ".join(text for text in said if text)


def _not_held(results: Results) -> str:
    """The extremes without a tolerance whose estimated errors are large, with the largest."""
    if "estimated_error" not in results.dataset:
        return ""
    fine = results.dataset["status"].values == int(Status.OK)
    read = {f"{sensor}{end}" for sensor in results.sensors for end in ("", "_max", "_min", "_residual")}
    told = []
    for name, asked in zip(results.dataset["result"].values, results.dataset["tolerance"].values, strict=True):
        if np.isnan(asked) and str(name) in read:  # one after another: there may be very many variants
            largest = float(np.fmax.reduce(results.estimated_error(str(name))[fine], initial=0.0))
            what = f"the history of {name}" if str(name) in results.sensors else name
            told += [f"{what} up to {percent(largest)}"] if largest > LARGE else []
    return f"Estimated, but held to no tolerance: {listed(told)}." if told else ""


def _beyond_estimates(group: xr.Dataset) -> str:
    """Beside what is held: what is not, and differs, computed again, by much and by more than was estimated."""
    ours, names = np.asarray(group["variant_status"].values) == int(Status.OK), group["result"].values
    own = np.isnan(group["tolerance"].values) & _no_places(names)
    observed, told = (np.asarray(group[f"{name}_error"].values)[ours] for name in ("observed", "estimated"))
    beyond = np.where(own & (observed > np.maximum(told, LARGE)), observed, 0.0)
    if not beyond.any() or np.isnan(group["tolerance"].values).all():
        return ""
    worst = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    others = int(np.count_nonzero(beyond.any(axis=0))) - 1
    more = f", and {counted(others, 'other result')} by less" if others else ""
    found, estimated = percent(float(observed[worst])), percent(float(told[worst]))
    return f"{names[worst[1]]}, which nothing holds, differs by {found} where {estimated} was estimated{more}."


def _held_accuracy(group: xr.Dataset | None, results: Results) -> str:
    """In one sentence what was asked, estimated and observed of all that is held."""
    if not results.study.output.keeps_variants and group is not None:
        tolerances = known(group["tolerance"])
        return f"{_span(tolerances)} was asked; {_compared(group, results)}" if tolerances.size else ""
    if not is_marched(results.dataset) or "tolerance" not in results.dataset:
        return ""
    fine = results.dataset["status"].values == int(Status.OK)
    estimates, tolerances = known(of_variants(results, ERROR)[fine]), known(results.dataset["tolerance"])
    if not tolerances.size and group is not None and Verdict.of(group).count:
        return f"nothing is held to a tolerance; {_unheld(group, results)}."
    if not tolerances.size:
        return ""
    errors = "estimated errors" if fine.all() else "estimated errors of those that are ok"
    found = f"{errors} at most {scientific(float(estimates.max()))}" if estimates.size else "no status is ok"
    said = f"{found} where {_span(tolerances)} was asked"
    if estimates.size and tolerances.min() < tolerances.max() and results.each_within_tolerance(fine):
        said = f"{found}, each within its own tolerance ({_span(tolerances)})"
    elif estimates.size and estimates.max() > tolerances.max():
        said = f"{said} ({ELEMENTS if _fixes_elements_alone(results) else FIXED})"
    return f"{said}; {told_none_briefly(results) if group is None else _compared(group, results)}"


def _fixes_elements_alone(results: Results) -> bool:
    """Whether a study leaves all open but the elements of its bodies."""
    study, solver = results.study, results.study.solver
    bodies = study.body.values()
    numerics = solver.fidelity in ("auto", "full") and solver.scheme == "auto" and solver.static_correction
    steps = solver.steps == "auto" and not any(path == "solver.steps" for axis in results.axes for path in axis.paths)
    modes = all(body.modes == "auto" for body in bodies)
    return numerics and steps and modes and any(body.is_meshed for body in bodies)


def _fewer(verdict: Verdict, results: Results) -> list[str]:
    """Why fewer variants were audited than were picked, or than the study asks for, in sentences."""
    asked, drawn, told = results.study.solver.audit, verdict.count + verdict.marked + verdict.left_out, list[str]()
    if verdict.left_out:
        more = counted(verdict.left_out, "further variant")
        lost = any(not status.values_kept for status in results.status_counts)
        why = "without values, or nothing finer is left" if lost else "nothing finer is left"
        told.append(f"{more} picked for the audit could not be compared: {why}")
    if asked != "auto" and drawn < asked:
        others = "" if drawn == results.variants else " but for those by which models were chosen for others"
        told.append(f"audit = {asked} asks for more variants than there are{others}")
    return told


def _span(tolerances: Array) -> str:
    return " to ".join(scientific(float(end)) for end in sorted({tolerances.min(), tolerances.max()}))


def _compared(group: xr.Dataset, results: Results) -> str:
    """In words what the group says of variants that the archive calls ok."""
    verdict = Verdict.of(group)
    if not verdict.count:
        return f"{_of_marked(verdict, results)}."
    audit = f"{counted(verdict.count, 'variant')} computed again with {_more(results)}"
    if not verdict.held:
        beyond = counted(verdict.missed + verdict.unknown, "variant")
        _, error, name = _worst(group, verdict)
        worst = f": {name} is off by {scientific(error)}" * bool(verdict.missed)
        return f"but of {audit}, {beyond} did not hold it{worst}."
    differ = "differ" if verdict.count > 1 else "differs"
    return f"{audit} {differ} by at most {scientific(_worst(group, verdict)[1])}."


def _of_marked(verdict: Verdict, results: Results) -> str:
    """In words what the group says of variants that promise nothing, as their status is not ok."""
    audit = f"{counted(verdict.marked, 'variant')} whose status is not ok {'were' if verdict.marked > 1 else 'was'}"
    said = f"{audit} computed again with {_more(results)}"
    if not verdict.marked_worst >= 0.0:
        return f"{said}: no number could be compared"
    return f"{said}: the largest difference is {times(verdict.marked_worst, 'the tolerance', 2)}"


def _more(results: Results) -> str:
    """What audits have more of. Elements stay as the study says; where frames or robots move, so do modes that it
    fixes."""
    keeps = np.isin(results.dataset["fidelity_used"].values, [int(Fidelity.FRAME), int(Fidelity.GIVEN_FRAME)]).any()
    fixed = [name for name, body in results.study.body.items() if body.modes != "auto"]
    if not (keeps and fixed):
        meshed = any(body.is_meshed for body in results.study.body.values())
        return f"more of everything{' but elements' * meshed}"
    return f"more steps (modes of {listed(fixed[:3])} are fixed)"


def told_audit(group: xr.Dataset | None, results: Results) -> list[str]:
    """What the group says, in sentences; where there is none, why no variant was audited if the study asks for some."""
    if group is None:
        asked = results.study.solver.audit != 0 and is_marched(results.dataset) and bool(results.kept.any())
        return [told_none(results)] if asked else []
    verdict = Verdict.of(group)
    told = [_told(group, verdict, results)] if verdict.count else []
    if verdict.missed:
        told.append(f"the tolerance was not held: {verdict.missed} of {counted(verdict.count, 'variant')} missed it")
    if verdict.unknown:
        told.append(f"{counted(verdict.unknown, 'variant')} could not be compared, which counts as not held")
    if verdict.marked:
        told.append(_of_marked(verdict, results))
    return [*told, *_fewer(verdict, results)]


def _told(group: xr.Dataset, verdict: Verdict, results: Results) -> str:
    """The sentence on variants that the archive calls ok."""
    said = f"audit of {counted(verdict.count, 'variant')} found "
    if not np.isfinite(group["tolerance"].values).any():
        return f"{said}what is only estimated: {_unheld(group, results)}"
    if not np.isfinite(verdict.worst) or verdict.worst < 0.0:
        return f"{said}no number to compare"
    asked, observed, name = _worst(group, verdict)
    values = _at(group, verdict)
    words = words_of(
        results, {name: value for name, value in values.items() if results.study.sweep.axes[name].size > 1}
    )
    at = ", ".join(f"{name.replace('_', ' ')} {word}" for name, word in words.items())
    return f"asked {scientific(asked)}, {said}at most {scientific(observed)}, worst{f' at {at}' if at else ''} ({name})"


def _unheld(group: xr.Dataset, results: Results) -> str:
    """What the group says of variants that the archive calls ok where nothing is held: the largest observed error of
    what is no place, beside the estimated one."""
    ours = np.asarray(group["variant_status"].values) == int(Status.OK)
    own = _no_places(group["result"].values)
    observed, told = (group[f"{name}_error"].values[ours][:, own] for name in ("observed", "estimated"))
    said = f"{counted(int(ours.sum()), 'variant')} computed again with {_more(results)}"
    if not np.isfinite(observed).any():
        return f"{said} found no number to compare"
    place = np.unravel_index(int(np.nanargmax(observed)), observed.shape)
    name, differ = group["result"].values[own][place[1]], "differ" if ours.sum() > 1 else "differs"
    return f"{said} {differ} by at most {scientific(observed[place])} ({name}; {scientific(told[place])} was estimated)"


def _no_places(names: NDArray[Any]) -> NDArray[np.bool_]:
    """Which results are no places or times of extremes, which jump."""
    return np.array([not str(name).endswith(WHERE_OR_WHEN) for name in names])


def _worst(group: xr.Dataset, verdict: Verdict) -> tuple[float, float, str]:
    """The tolerance and the observed error of the worst result, and its name."""
    tighter = float(group["tolerance_asked"].values[verdict.place])
    asked = float(group["tolerance"].values[verdict.result]) * tighter
    return asked, verdict.worst * asked, str(group["result"].values[verdict.result])


def _at(group: xr.Dataset, verdict: Verdict) -> dict[str, float]:
    """The swept numbers of the worst variant, by the names of their axes."""
    return {
        str(name): float(array.values[verdict.place])
        for name, array in group.coords.items()
        if array.dims == ("sample",) and name != "sample"
    }


def as_json(group: xr.Dataset, results: Results) -> dict[str, Any]:
    """What `run --json` says of it."""
    verdict = Verdict.of(group)
    asked, observed, name = _worst(group, verdict)
    return {
        "variants": verdict.count,
        "marked": verdict.marked,
        "left_out": verdict.left_out,
        "not_compared": verdict.unknown,
        "tolerance": asked,
        "largest_observed_error": observed,
        "worst_result": name,
        "at": _at(group, verdict),
        "held": verdict.held,
    }
