"""Parts of sentences that several kinds of study use, and checks that they share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine.scene.carriages import Carriage
from engine.scene.study import Study
from results_schema.arrays import Array
from results_schema.quantities import AFTER_STOP
from results_schema.status import Status, label
from studies.results.formatting import counted, listed, number, percent, quantity, scientific
from studies.results.places import Index, extreme
from studies.results.results import Results, statuses

MOST_MISSED = 3  # sensors that are named where tolerances are missed
LOOSE = 0.05  # estimated errors above this stand beside the values that they belong to
REACHED = 0.1  # an estimated error: smaller ones are a tolerance that is worth asking for, with so much room
ROOM = 1.25


def first_carriage(study: Study) -> tuple[str, Carriage]:
    """Name and carriage that come first. Raises BadInput where nothing moves."""
    if not study.carriage:
        raise study.source.fault("carriage", "nothing moves", expected="at least one table [carriage.name]")
    return next(iter(study.carriage.items()))


def check_sensors(study: Study) -> None:
    """Refuse a study that measures nothing. Raises BadInput."""
    if not study.sensor:
        raise study.source.fault("sensor", "nothing is measured", expected="at least one table [sensor.name]")


def told_trains(study: Study) -> list[tuple[str, str]]:
    """Every train with how many axles it has, how long and how heavy it is: a list of spacings tells none of these."""
    return [
        (
            f"train {name}",
            f"{counted(train.count, 'axle')}, {quantity(train.length, 'm', 4)} from first to last, "
            f"{quantity(train.load, train.units, 4)}",
        )
        for name, train in study.train.items()
    ]


def has_dampers(study: Study, body: str) -> bool:
    """Whether damping ratios of a body's modes leave some of its damping out."""
    return any(coefficient > 0.0 for _, _, coefficient in study.dampers(body))


def told_hanging(results: Results, sensors: Sequence[str]) -> str:
    """Of which sensors of a figure displacements point down, as a sentence; "" where none does."""
    down = [name for name in sensors if results.hangs(name)]
    sideways = [name for name in sensors if results.sensors[name] == "m" and name not in down]
    told = hanging(down, sideways)
    return told if float(results.study.gravity) > 0.0 else told.replace(", as the body hangs", "")


def hanging(down: Sequence[str], sideways: Sequence[str]) -> str:
    """The same of names whose displacements count along gravity, and of others.

    >>> hanging(["bed", "table"], ["sway"])
    'Displacements point down for bed and table, as the body hangs; others count along directions of their own.'
    >>> hanging(["bed", "table"], []), hanging([], ["sway"])
    ('Displacements point down, as the body hangs.', '')
    """
    if not down or not sideways:
        return "Displacements point down, as the body hangs." if down else ""
    names = listed([name.replace("_", " ") for name in down])
    return f"Displacements point down for {names}, as the body hangs; others count along directions of their own."


def in_words(results: Results, index: Index) -> str:
    """Where in the sweep, as the end of a sentence; "" without a sweep."""
    at = results.at(index)
    return f" at {at}" if at else ""


def over_all(results: Results) -> str:
    """That a range is of all variants, or of all of those with values; "" where there is one."""
    known = int(results.kept.values.sum())
    if results.size == 1:
        return ""
    return " over all variants" if known == results.size else f" over {counted(known, 'variant')} with values"


def while_held(results: Results) -> str:
    """That what follows is of the variants whose contact holds, or that none does; "" where all do."""
    if results.held[results.kept.values].all():
        return ""
    return "while the contact holds, " if results.held.any() else "with a contact that opens in every variant, "


def exceeds(results: Results, values: Array, threshold: float) -> str:
    """Where values (in the sweep's shape) first exceed a threshold, along the speed where it is swept."""
    beyond = np.isfinite(values) & (values > threshold)
    if not beyond.any():
        return f"stays below {percent(threshold)}"
    axis = results.axis(".motion.speed", ".motion.frequency")
    if axis is None:
        return f"exceeds {percent(threshold)} in {counted(int(beyond.sum()), 'variant')} of {results.size:,}"
    along = results.everywhere(results.dataset[axis.name])
    lowest = float(along[beyond].min())
    if lowest == axis.values.min():
        return f"exceeds {percent(threshold)} already at {axis.in_words(lowest)}"
    return f"first exceeds {percent(threshold)} at {axis.in_words(lowest)}"


def missed_most(results: Results) -> str:
    """Which result misses its tolerance by most among the variants that say so, as the end of a sentence."""
    for name, (error, asked) in _missed(results).items():
        what = f"the history of {name}" if name in results.sensors else name
        return f" (most of all for {what}: {scientific(error)} where {scientific(asked)} was asked)"
    return ""


def _missed(results: Results) -> dict[str, tuple[float, float]]:
    """Results that miss their tolerance among the variants that say so, by how much: their largest error, and that."""
    found = dict[str, tuple[float, float]]()
    if "tolerance" not in results.dataset or not results.study.output.keeps_variants:
        return found
    missed = results.dataset["status"].values == int(Status.TOLERANCE_MISSED)
    for name, asked in zip(results.dataset["result"].values, results.dataset["tolerance"].values, strict=True):
        if np.isfinite(asked):  # one result after another: there may be millions of variants
            error = float(np.fmax.reduce(results.estimated_error(str(name))[missed], initial=0.0))
            found |= {str(name): (error, float(asked))} if error > asked else {}
    return dict(sorted(found.items(), key=lambda one: -one[1][0] / one[1][1]))


def remedy(results: Results) -> str:
    """What helps variants that miss a tolerance, as a sentence behind another; "" where none does, or the study expects
    it."""
    if Status.TOLERANCE_MISSED not in results.status_counts or label(Status.TOLERANCE_MISSED) in results.study.expected:
        return ""
    missed = [(name.rpartition(" ")[2], error) for name, (error, _) in _missed(results).items()]
    ends = ("", "_max", "_min", "_residual", f"{AFTER_STOP}_max", f"{AFTER_STOP}_min")
    read = {f"{name}{end}": name for name in results.sensors for end in ends}
    sensors = list(dict.fromkeys(read[name] for name, _ in missed if name in read))
    if missed and not sensors:
        return " What helps: a larger `solver.tolerance`."
    more = [f"{len(sensors) - MOST_MISSED} more"] if len(sensors) > MOST_MISSED else []
    names = listed([*sensors[:MOST_MISSED], *more])
    where = f"the sensor{'s' if len(sensors) > 1 else ''} {names}" if sensors else "sensors"
    largest = max((error for name, error in missed if name in read), default=np.inf)
    why = "which holds" if largest < REACHED else "so that errors are estimated and not held"
    helps = f" What helps: `tolerance = {tolerance_for(largest)}` on {where}, {why}, or a larger tolerance"
    moving = results.study.carriage.items()
    jumps = [(name, one.motion.smoothed_by) for name, one in moving if "along" in one.pushes and one.motion.smoothed_by]
    smooth = listed([f"carriage.{name}.motion.{key}" for name, key in jumps])
    return f"{helps}; or {smooth}, as forces of inertia that jump strike every mode." if jumps else f"{helps}."


def tolerance_for(error: float) -> str:
    """A tolerance that what has this estimated error holds, as a study file writes it: the next larger one of 1, 2 or 5
    times a power of ten that leaves room, or none at all."""
    if not error < REACHED:
        return '"told"'
    decade = 10.0 ** np.floor(np.log10(error))
    return f"{next(part * decade for part in (1.0, 2.0, 5.0, 10.0, 20.0) if part * decade >= ROOM * error):g}"


def told_far(results: Results) -> list[str]:
    """In how many variants something deflects by more than the longest body is long; nothing where in none: what shakes
    its body more and more, or has a wrong unit, was told without a word on it."""
    length = max(body.length for body in results.study.body.values())
    part = np.zeros(results.shape)
    for name in (f"{name}_{end}" for name in results.sensors if _bends(results, name) for end in ("max", "min")):
        part = np.fmax(part, np.where(results.kept.values, np.abs(results.everywhere(results.dataset[name])), 0.0))
    place = extreme(part)
    if place is None or not part[place] > length:
        return []
    return [
        f"In {int(np.sum(part > length)):,} of {counted(results.size, 'variant')} deflections are up to "
        f"{number(float(part[place]) / length)} times as large as the longest body{in_words(results, place)}: no "
        "structure bends so far, and these equations hold for small deflections."
    ]


def _bends(results: Results, sensor: str) -> bool:
    """Whether a sensor reads how far a body bends that something holds, at a place of its own."""
    spec, body = results.study.sensor[sensor], results.study.body[results.study.body_of(sensor)]
    return results.sensors[sensor] == "m" and spec.carriage is None and not body.is_free


def told_statuses(results: Results) -> list[str]:
    """How many variants carry a status other than ok, as a sentence; none where all are fine."""
    others = sum(count for status, count in results.status_counts.items() if status != Status.OK)
    if not others:
        return []
    carried = f"{others:,} {'carry' if others > 1 else 'carries'} a status: {statuses(results.status_counts)}"
    return [f"Of {counted(results.variants, 'variant')}, {carried}.{remedy(results)}"]
