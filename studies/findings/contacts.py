"""Whether carriages keep their contact, and whether supports lift, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from engine.scene.sensors import Sensor
from engine.scene.study import Study
from results_schema.arrays import Array, Mask
from studies.findings.absolute_errors import absolute_errors, told_error, weight
from studies.findings.amplification import sizes
from studies.findings.beyond import MOST_TOLD, where
from studies.findings.effects import unchanged
from studies.results.axes import PACES, VARIANT, Axis
from studies.results.findings_common import in_words
from studies.results.formatting import ALIKE, ROUNDING, counted, listed, number, quantity
from studies.results.places import Index, chosen, extreme
from studies.results.results import Results

MOST_GROUPS = 5
BEYOND = "The equations assume contact: beyond, they say no more."
PRESSED = (
    "What moves with a body on contacts as its wheels do ({}) is pressed down by these too, which is not counted: "
    "bilateral = true holds it."
)
LEVEL = (
    "may only seem to: contacts at one place of a track that lies across stay level, as nothing there turns, and bear "
    "what the track under them bends by; a frame with a point at each of them pitches."
)
#: Sensors read contact forces to the very end; smallest ones are of that span where they converge with the modes.
ASIDE = ", the last 2 % before a held end aside"


def told_contacts(results: Results) -> tuple[list[str], list[str]]:
    """Sentences on carriages that would lift off, and on those that keep their contact or are held by guides."""
    opened, known = _opened(results), results.study.carriage
    kept = {name: force for name, force in _contact_forces(results) if name not in opened and known[name].may_lift}
    guided = [_guided(results, *one) for one in _contact_forces(results) if not known[one[0]].may_lift]
    return [_lifted(results, opened)] if opened else [], [*_kept(results, kept), *guided[:MOST_TOLD]]


def told_low_contacts(results: Results, least: float | None) -> list[str]:
    """Where the contact force of the carriage that presses least falls below a part of its weight, and which others'
    do; nothing where no part is given."""
    if least is None:
        return []
    every = {name: _part_of_weight(results, name) for name, _ in _contact_forces(results)}
    parts = {name: part for name, part in every.items() if np.isfinite(part).any()}
    if not parts:
        return []
    below = {name: np.nan_to_num(part, nan=np.inf) < least for name, part in parts.items()}
    lowest = min(parts, key=lambda name: float(np.nanmin(parts[name])))
    place = extreme(-parts[lowest])
    assert place is not None
    others = [name for name in parts if name != lowest and below[name].any()]
    also = f" So {'do those' if len(others) > 1 else 'does that'} of {listed(others[:MOST_TOLD])}" if others else ""
    also += f" and {len(others) - MOST_TOLD} more." if len(others) > MOST_TOLD else "." * bool(also)
    at = where(results, below[lowest], results.axis(*PACES))
    said = f"falls below {number(least)} of {_share(results, lowest)}its weight {at}"
    smallest = f"at its smallest it is {number(float(parts[lowest][place]))} of it{in_words(results, place)}"
    return [f"The contact force of {lowest} {said}; {smallest}{ASIDE if _is_read(results) else ''}.{also}"]


def _share(results: Results, carriage: str) -> str:
    """Words before the weight where each of several contacts is compared with its part of it; "" else."""
    return "an equal share of " if len(results.study.carriage[carriage].riding_contacts) > 1 else ""


def _part_of_weight(results: Results, carriage: str) -> Array:
    """Smallest contact forces over the weight, or over the share of it that each of several contacts has, in the
    sweep's shape; NaN where there is none."""
    force, own = results.everywhere(results.dataset[f"{carriage}_contact_force_min"]), weight(results, carriage)
    weights = results.everywhere(own) / max(1, len(results.study.carriage[carriage].riding_contacts))
    return np.asarray(np.divide(force, weights, out=np.full(results.shape, np.nan), where=weights > 0.0))


def told_uplift(results: Results, sensor: str, of: Sequence[str]) -> str:
    """That a support would be lifted off, and where most; with the first of some sensors that reads one, that others
    would which are none of these, or that none lifts where own weight counts. "" for what reads something else."""
    least = {name: float(np.nanmin(_least(results, name))) for name in results.sensors if _of_support(results, name)}
    if sensor not in least:
        return ""
    weight = "" if results.study.body[results.study.body_of(sensor)].own_weight else ", own weight not counted"
    said = f" It pulls by up to {_pull(results, sensor)}{weight}." if _pulls(results, sensor) else ""
    if sensor != next(name for name in of if name in least):
        return said
    most = min(least, key=lambda one: least[one])  # told at once, though it may have a sentence of its own further on
    others = [one for one in least if _pulls(results, one) and one != sensor and (one not in of or one == most)]
    others.sort(key=lambda one: least[one])
    if others:
        first, *rest = [f"by up to {_pull(results, one)}" for one in others[:MOST_TOLD]]
        words = [f"{others[0]} pulls {first}", *(f"{one} {by}" for one, by in zip(others[1:], rest, strict=False))]
        words += [f"{len(others) - MOST_TOLD} more by less"] * (len(others) > MOST_TOLD)
        return f"{said} Of the other supports {listed(words)}{'' if said else weight}."
    if any(_pulls(results, one) for one in least) or not results.study.body[results.study.body_of(sensor)].own_weight:
        return said
    lowest = min(least, key=lambda one: least[one])
    place = extreme(-_least(results, lowest))
    assert place is not None
    at = "" if lowest == sensor else f" of {lowest}"
    return f" No support lifts: the smallest reaction{at} is {quantity(least[lowest], 'N')}{in_words(results, place)}."


def _of_support(results: Results, sensor: str) -> bool:
    """Whether it reads a support's force, where any variant has a value."""
    return reads_support_force(results.study.sensor[sensor]) and bool(np.isfinite(_least(results, sensor)).any())


def reads_support_force(sensor: Sensor) -> bool:
    """Whether a sensor reads the whole force of a support, which pulls where it is negative."""
    return sensor.reads.of_support and not sensor.reads.turns and not sensor.is_dynamic_part


def _least(results: Results, sensor: str) -> Array:
    """The smallest values of a sensor, in the sweep's shape; NaN where a variant does not count."""
    return np.where(results.with_values, results.everywhere(results.dataset[f"{sensor}_min"]), np.nan)


def _pulls(results: Results, sensor: str) -> bool:
    """Whether a support pulls anywhere, by more than rounding."""
    return bool(np.nanmin(_least(results, sensor)) < -ROUNDING * float(np.nanmax(sizes(results, sensor))))


def _pull(results: Results, sensor: str) -> str:
    """By how much a support pulls at most, and where."""
    least = _least(results, sensor)
    place = extreme(-least)
    assert place is not None
    where = "" if unchanged(results, least) else in_words(results, place)
    return f"{quantity(-float(least[place]), 'N')}{where}"


def _contact_forces(results: Results) -> Iterator[tuple[str, Array]]:
    """Carriages with their smallest contact forces, where these are known and depend on how bodies move."""
    for carriage, spec in results.study.carriage.items():
        if f"{carriage}_contact_force_min" in results.dataset and spec.inertial:
            force = np.asarray(results.dataset[f"{carriage}_contact_force_min"].values, dtype=np.float64)
            if np.isfinite(force).any():
                yield carriage, force


def _opened(results: Results) -> dict[str, tuple[Mask, Mask]]:
    """Where contact forces turn negative and where they are known, by carriage: most variants first."""
    lifting = [one for one in _contact_forces(results) if results.study.carriage[one[0]].may_lift]
    masks = {name: (np.isfinite(force) & (force < 0.0), np.isfinite(force)) for name, force in lifting}
    found = [(name, both) for name, both in masks.items() if both[0].any()]
    return dict(sorted(found, key=lambda one: -np.count_nonzero(one[1][0])))


def _guided(results: Results, carriage: str, force: Array) -> str:
    """How much a guide that holds from both sides pulls."""
    place = extreme(-force)
    assert place is not None
    least, where_ = float(force[place]), in_words(results, place)
    off = told_error(float(absolute_errors(results, f"{carriage}_contact_force_min")[place]), least, "N")
    if least < 0.0:
        return f"The guide of {carriage} holds it down with up to {quantity(-least, 'N')}{off}{where_}."
    return f"The guide of {carriage} pulls nowhere: the smallest contact force is {quantity(least, 'N')}{off}{where_}."


def _lifted(results: Results, opened: dict[str, tuple[Mask, Mask]]) -> str:
    """Which carriages would lift off, and where the first of them begins to."""
    (first, masks), *others = opened.items()
    more = [f"{name} in {int(np.count_nonzero(mask)):,}" for name, (mask, _) in others[:MOST_TOLD]]
    if left := others[MOST_TOLD:]:
        more.append(f"{len(left)} more")
    also = f" So would {listed(more)}." if more else ""
    level = [name for name in opened if results.study.carriage[name].level_contacts]
    why = f" {listed(level[:MOST_TOLD])} {LEVEL}" if level else ""
    wheels = [name for name in opened if _keeps_pace(results.study, name)]
    why += f" {PRESSED.format(listed(wheels[:MOST_TOLD]))}" if wheels else ""
    return f"{_onset(results, first, *masks)}{also} {BEYOND}{why}"


def _keeps_pace(study: Study, carriage: str) -> bool:
    """Whether a body on contacts moves as a carriage without any does, behind it or ahead, as a coach with its
    wheels."""
    own = study.carriage[carriage]
    if own.riding_contacts:
        return False
    motion, ends = own.motion.model_dump(), {"start", "end"}
    for other in study.carriage.values():
        theirs = other.motion.model_dump()
        if other.riding_contacts and own.on in other.ridden and motion.keys() == theirs.keys():
            apart = {round(motion[key] - theirs[key], 6) for key in ends & motion.keys()}
            if len(apart) <= 1 and all(motion[key] == theirs[key] for key in motion.keys() - ends - {"after"}):
                return True
    return False


def _kept(results: Results, forces: dict[str, Array]) -> list[str]:
    """The smallest of contact forces that are all positive, and of which carriages that is not certain."""
    least = {name: float(np.nanmin(force)) for name, force in forces.items()}
    off = {
        name: float(absolute_errors(results, f"{name}_contact_force_min")[extreme(-forces[name])]) for name in forces
    }
    certain = [name for name in forces if not off[name] > least[name]]
    found = [_doubtful(results, name, forces[name], off[name]) for name in forces if name not in certain]
    if not certain:
        return found
    lowest = min(certain, key=lambda name: least[name])
    who = listed(certain) if len(certain) <= MOST_TOLD else f"{len(certain)} carriages"
    keeps, of = ("keep their", f", that of {lowest},") if len(certain) > 1 else ("keeps its", "")
    place = extreme(-forces[lowest])
    assert place is not None
    force = f"{quantity(least[lowest], 'N')}{told_error(off[lowest], least[lowest], 'N')}"
    smallest = f"the smallest contact force{of} is {force}{in_words(results, place)}"
    all_over = f"everywhere{ASIDE if _is_read(results) else ''}"
    return [*found, f"{who} {keeps} contact {all_over}; {smallest}{_nearest_to_lifting(results, lowest, place)}."]


def _is_read(results: Results) -> bool:
    """Whether a sensor reads a contact force."""
    read = [sensor.reads for sensor in results.study.sensor.values()]
    return any(one.of_contact and not one.of_suspension for one in read)


def _nearest_to_lifting(results: Results, carriage: str, place: Index) -> str:
    """Where a contact force is the smallest part of a weight that differs over the sweep; "" where that is the place
    where it is smallest."""
    part = _part_of_weight(results, carriage)
    least = extreme(-part)
    if least is None or float(part[least]) >= (1.0 - ALIKE) * float(part[place]):
        return ""
    over = f"; over {_share(results, carriage)}the weight"
    return f"{over} it is smallest{in_words(results, least)}: {number(float(part[least]))}"


def _doubtful(results: Results, carriage: str, force: Array, off: float) -> str:
    """That a contact force may be negative."""
    place = extreme(-force)
    assert place is not None
    smallest = f"the smallest contact force is {quantity(float(force[place]), 'N')}"
    known = f"with an estimated error of {quantity(off, 'N')}"
    return f"Whether {carriage} keeps its contact is not certain: {smallest}, {known}{in_words(results, place)}."


def _onset(results: Results, carriage: str, opened: Mask, known: Mask) -> str:
    """From which speed on the contact opens, for up to five masses."""
    shown = f"{carriage} would lift off in {int(opened.sum()):,} of {counted(int(known.sum()), 'variant')}"
    speed, group = results.axis(".motion.speed", ".motion.frequency"), results.axis(".mass")
    if speed is None:
        return f"{shown}."
    if VARIANT in (speed.dim, speed.dim if group is None else group.dim):
        return f"{shown}; {_worst(results, carriage, opened)}."
    if group is None:
        return f"{shown}, {_first_speed(results, speed, opened)}."
    along = results.everywhere(results.dataset[group.name])
    opening = sorted(set(along[opened].tolist()))
    told = [
        f"at {group.in_words(value)} {_first_speed(results, speed, opened & (along == value))}"
        for value in chosen(opening, MOST_GROUPS)
    ]
    calm = group.values[group.values < opening[0]]
    below = f"; up to {group.in_words(float(calm.max()))} never" if calm.size else ""
    return f"{shown}: {', '.join(told)}{below}."


def _worst(results: Results, carriage: str, opened: Mask) -> str:
    """The variant whose smallest force is the most negative part of its weight: what points off a grid can tell."""
    ratio = results.everywhere(results.dataset[f"{carriage}_contact_force_min"] / weight(results, carriage))
    place = extreme(-np.where(opened, ratio, np.nan))
    assert place is not None
    return f"worst is {number(float(ratio[place]))} times the weight{in_words(results, place)}"


def _first_speed(results: Results, speed: Axis, opened: Mask) -> str:
    """The lowest speed at which the contact opens, with its ratio to the critical speed where that says something."""
    along = results.everywhere(results.dataset[speed.name])
    first = float(along[opened].min())
    text = f"first at {speed.in_words(first)}"
    if "speed_ratio" not in results.dataset.coords or not results.study.has_critical_speed:
        return text
    ratio = results.everywhere(results.dataset["speed_ratio"])
    return f"{text} ({number(float(ratio[opened & (along == first)].min()), 2)} of the critical speed)"
