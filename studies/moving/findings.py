"""What studies of bodies in moving frames answer, in sentences."""

from collections.abc import Iterator

import numpy as np

from engine.march.settling import names_of_times
from engine.scene.frames import GROUND
from results_schema.arrays import Mask
from results_schema.quantities import AFTER_STOP
from studies.findings.absolute_errors import errors_of_size, uncertainty
from studies.findings.amplification import sizes
from studies.findings.beyond import limits_of, ranked, told_limit
from studies.findings.effects import by_effect, told_effects
from studies.findings.residual import settling_of, told_settling, until_settled
from studies.moving.question import Question
from studies.protocol.study import question_of
from studies.results.findings_common import in_words, over_all, told_statuses, while_held
from studies.results.formatting import ROUNDING, counted, quantity
from studies.results.places import extreme
from studies.results.results import Results

MOST_SENSORS = 4
FIRST = 2  # sentences on sensors, behind which comes what is beyond the theory: a screen shows five
EARLIER = 1.0 - 1e-9  # times a duration: more is rounding


def answer(results: Results, seconds: float) -> list[str]:
    """Carriages that slide, sensors, ends of tracks, statuses; seconds: that a march takes."""
    return [*sliding(results), *others(results, seconds)]


def others(results: Results, seconds: float) -> Iterator[str]:
    """All but carriages that slide."""
    yield from _ended(results, seconds)
    read = list(_sensors(results))
    yield from (*read[:FIRST], *_beyond_theory(results), *read[FIRST:])
    yield from _driven(results)
    yield from _ends(results)
    yield from _energy(results)
    yield from _momentum(results)
    yield from told_statuses(results)


def _span(low: np.ndarray, high: np.ndarray, units: str) -> str:
    ends = float(np.nanmin(low)), float(np.nanmax(high))
    return " to ".join(quantity(end, units, beside=max(map(abs, ends))) for end in ends)


def sliding(results: Results) -> Iterator[str]:
    """Where carriages slide, how fast they swing, and how hard they press."""
    dataset = results.dataset
    for name, carriage in results.study.carriage.items():
        if not carriage.motion.slides or np.isnan(dataset[f"{name}_position_max"].values).all():
            continue
        way = _span(dataset[f"{name}_position_min"].values, dataset[f"{name}_position_max"].values, "m")
        swings = dataset[f"{name}_period"].values
        said = f"{name} slides from {way}{over_all(results)}"
        if np.isfinite(swings).any():
            many = results.size > 1
            said += f", with a period of {_span(swings, swings, 's') if many else quantity(float(swings), 's', 4)}"
        yield f"{said}."
        ends = (dataset[f"{name}_contact_force_{end}"] for end in ("min", "max"))
        low, force = (one.where(results.with_values) for one in ends)
        index = extreme(force)
        if index is not None:
            its = f"{while_held(results)}its contact force goes from {_span(low.values, force.values, 'N')}"
            yield f"{its[0].upper()}{its[1:]}, the largest{in_words(results, index)}."


def _ended(results: Results, seconds: float) -> Iterator[str]:
    """Marches that end before their time, as nothing else ends them that has values."""
    duration = results.dataset["duration"]
    early = duration.where(duration < EARLIER * seconds)
    place = extreme(early, np.nanargmin)
    if place is not None:
        of = f" in {counted(int(early.count()), 'variant')} of {results.size:,}" if results.size > 1 else ""
        first = f"{quantity(float(early.values[place]), 's')}{in_words(results, place)}"
        yield f"A carriage goes over an end of its track{of}, soonest after {first}: there the march ends."


def _sensors(results: Results) -> Iterator[str]:
    limits = limits_of(results.study)
    told = ranked(results, limits)[:MOST_SENSORS]
    yield from until_settled(results, told)
    for sensor in told:
        low, high = (results.dataset[f"{sensor}_{end}"].where(results.with_values) for end in ("min", "max"))
        if np.isnan(low.values).all():
            yield f"{sensor}: no variant has values."
            continue
        largest = np.maximum(np.abs(low), np.abs(high))
        limit, beyond = limits.of(results.study.sensor[sensor]), ""
        if limit is not None:
            axis = next(iter(by_effect(results, largest)), None)
            error = errors_of_size(results, sensor)
            beyond = told_limit(results, sizes(results, sensor), limit, results.sensors[sensor], axis, error)
        effects = _effects(results, sensor) if sensor == told[0] else ""
        if results.study.sensor[sensor].reads.of_arm:
            yield from _position_error(results, sensor, beyond + effects)
            continue
        index = extreme(largest)
        assert index is not None
        span = _span(low.values[index], high.values[index], results.sensors[sensor])
        what = f"{while_held(results)}the {results.noun(sensor)}"
        yield f"{sensor}: {what} goes from {span}{in_words(results, index)}.{beyond}{effects}"


def _effects(results: Results, sensor: str) -> str:
    """What every swept number does to the largest value of a sensor, behind another sentence; "" where one is swept."""
    said = told_effects(
        results, sizes(results, sensor), f"the largest {results.noun(sensor)}", errors_of_size(results, sensor)
    )
    return f" {said}" if said else ""


def _position_error(results: Results, sensor: str, beyond: str) -> Iterator[str]:
    """How far a tip is from where the rigid arm would have it, in the whole time and after the stop; beyond: what is
    said of a limit."""
    after = _most_and_least(results, f"{sensor}{AFTER_STOP}")
    where, most = results.place(sensor), _most_and_least(results, sensor)
    what = f"{while_held(results)}the largest position error {where}"
    yield f"{sensor}: {what}, from where the rigid arm would have it, is {most}.{beyond}"
    if after:
        settles = _settles(results, sensor)
        sag = ", with what it sags by weight at rest" if settles and np.any(results.parameter("gravity")) else ""
        yield f"After the stop it is still up to {after}{sag}.{_beyond_after(results, sensor)}{settles}"


def _settles(results: Results, sensor: str) -> str:
    """How long a position error takes to settle, behind another sentence; "" where that is not asked."""
    if results.study.sensor[sensor].settling_band is None:
        return ""
    times = settling_of(results, names_of_times(sensor)[0])
    axis = next(iter(by_effect(results, times)), None) if np.isfinite(times).any() else None
    said = told_settling(results, sensor, question_of(results.study, Question).settling_time, axis)
    return f" {sensor}: {'; '.join(said)}."


def _beyond_after(results: Results, sensor: str) -> str:
    """Where a position error after the stop is beyond its limit, behind another sentence; "" without one."""
    limit, stop = question_of(results.study, Question).residual.position_error, f"{sensor}{AFTER_STOP}"
    if limit is None:
        return ""
    values = sizes(results, stop)
    axis = next(iter(by_effect(results, values)), None)
    return told_limit(results, values, limit, results.sensors[sensor], axis, errors_of_size(results, stop))


def along_way(results: Results, sensor: str) -> str:
    """In which direction a position error is read, in words; "" where it is its length."""
    direction = results.study.sensor[sensor].direction
    if direction is None:
        return ""
    return f" along {direction if isinstance(direction, str) else [float(f'{part:.4g}') for part in direction]}"


def _most_and_least(results: Results, name: str) -> str:
    """The largest and the smallest over the sweep of the largest absolute value of a result; "" where there is none."""
    found = np.where(results.with_values, sizes(results, name), np.nan)
    most, least = extreme(found), extreme(found, np.nanargmin)
    if most is None or least is None:
        return ""
    said = f"{quantity(float(found[most]), 'm')}{in_words(results, most)}"
    if found[least] < found[most]:
        said += f"; of all variants least, {quantity(float(found[least]), 'm')},{in_words(results, least)}"
    return said


def _driven(results: Results) -> Iterator[str]:
    """How hard carriages press that are driven along their tracks."""
    for name, carriage in results.study.carriage.items():
        if carriage.motion.slides:
            continue
        ends = (results.dataset[f"{name}_contact_force_{end}"] for end in ("min", "max"))
        low, high = (one.where(results.with_values) for one in ends)
        index = extreme(np.maximum(np.abs(low), np.abs(high)))
        if index is not None:
            span = _span(low.values[index], high.values[index], "N")
            loosely = uncertainty(results, f"{name}_contact_force_max", index, abs(float(low.values[index])))
            yield f"{name}: {while_held(results)}the contact force goes from {span}{loosely}{in_words(results, index)}."


def _ends(results: Results) -> Iterator[str]:
    """How far the ends of tracks swing over the ground."""
    moves = [name for name, frame in results.study.frame.items() if frame.joints]
    for name in moves[:MOST_SENSORS]:
        spans = (results.dataset["end_max"] - results.dataset["end_min"]).sel(frame=name)
        if not np.isfinite(spans.values).any():
            continue
        wide = [float(np.nanmax(spans.sel(component=axis))) for axis in ("x", "y", "z")]
        widest = [quantity(one if one > ROUNDING * max(wide) else 0.0, "m") for one in wide]
        yield f"The far end of {name} moves over {widest[0]}, {widest[1]} and {widest[2]} along x, y and z."


def _energy(results: Results) -> Iterator[str]:
    """By how much the energy of everything changes."""
    change = results.dataset["energy_change"]
    index = extreme(change)
    if index is not None and float(change.values[index]) > 0.0:
        most = quantity(float(change.values[index]), "J")
        yield (
            f"The energy of everything (motion, bending, springs and height) changes by up to {most}"
            f"{in_words(results, index)}: by what is driven, by damping and friction, and else by the steps."
        )


def _momentum(results: Results) -> Iterator[str]:
    """How far the momentum of everything drifts where nothing outside acts on it, which by theory is not at all."""
    study = results.study
    roots = [frame for frame in study.frame.values() if frame.on == GROUND]
    held = not all(any(joint.floats for joint in frame.joints) for frame in roots) or set(study.body) > set(study.frame)
    held |= any(end.on == GROUND for spring in study.spring.values() for end in spring.ends)
    if held or study.load or study.gravity > 0.0 or not (traced := results.traced()):
        return
    told = []
    for name, units in (("momentum", "kg m/s"), ("angular_momentum", "kg m2/s")):
        over_time = [results.dataset[name].values[place] for place in traced]
        drift = max(float(np.nanmax(np.abs(values - values[0]))) for values in over_time)
        most = max(float(np.nanmax(np.abs(values))) for values in over_time)
        told.append(f"by up to {quantity(drift, units)} of {quantity(most, units)}")
    yield (
        f"Nothing outside acts on these bodies, so that their momentum is kept: by the steps it drifts {told[0]}, and "
        f"the angular momentum {told[1]}."
    )


def _beyond_theory(results: Results) -> Iterator[str]:
    """Bodies that turn fast without getting stiffer by it, that buckle, and that bend far: in how many variants, and
    where and when first."""
    for name in results.study.frame:
        reasons = {
            "unstiffened_time": "turns so fast that it lacks over 5 % of its stiffness, "
            f"as frame.{name}.stiffening is off",
            "bent_time": "bends by more than a tenth of its length, and deflections are taken to be small",
        }
        for variable, words in reasons.items():
            times = results.dataset[variable].sel(frame=name).values
            place = extreme(times, np.nanargmin)
            if place is not None:
                first = quantity(float(times[place]), "s")
                of = _in_variants(results, np.isfinite(times))
                yield f"{name} {words}{of}, from {first} on{in_words(results, place)}: beyond the theory."
        ratio = results.dataset["buckling_ratio"].sel(frame=name).values
        place = extreme(ratio, np.nanargmax)
        if place is not None and ratio[place] >= 1.0:
            of = _in_variants(results, ratio >= 1.0)
            yield (
                f"{name} buckles under the weight that stands on it at time 0{of}: it is up to {ratio[place]:.3g} "
                f"times what it can carry{in_words(results, place)}. What stands exactly upright stays so, as nothing "
                "disturbs it: beyond the theory."
            )


def _in_variants(results: Results, which: Mask) -> str:
    """In how many of them; "" of one alone."""
    many = counted(int(np.count_nonzero(which)), "variant")
    return f" in {many} of {results.size:,}" if results.size > 1 else ""
