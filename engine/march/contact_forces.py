"""What a march observed of contact forces: their extremes, and where a carriage would lift off."""

import numpy as np

from engine.kernels import layout
from engine.march.march import Marched
from engine.march.tables import SceneTables
from engine.model.lane_table import weight
from engine.model.scene_model import SceneModel
from engine.observation.contact_forces import Way, contacts_that_react, ways_counted
from engine.scene.variants import VariantValues
from results_schema.arrays import Array


def contact_forces(tables: SceneTables, values: VariantValues, marched: Marched) -> dict[str, Array]:
    """Extremes of every contact force, and where it first was negative."""
    found: dict[str, Array] = {}
    for c, carriage in enumerate(tables.model.carriages):
        if not tables.model.study.carriage[carriage.name].reacts:
            found |= _pressing(tables, values, c)
            continue
        statistics = marched.statistics[[len(tables.sensors) + k for k in _contacts_of(tables.model, c)]]
        seen = (statistics[:, layout.LARGEST_AT] >= 0.0).any(axis=0)
        # where a contact never counts, its smallest is infinite
        least = np.argmin(statistics[:, layout.SMALLEST], axis=0)[None]
        found[f"{carriage.name}_contact_force_max"] = np.where(seen, statistics[:, layout.LARGEST].max(axis=0), np.nan)
        found[f"{carriage.name}_contact_force_min"] = np.where(seen, statistics[:, layout.SMALLEST].min(axis=0), np.nan)
        place = tables.timeline.positions(c, np.take_along_axis(statistics[:, layout.SMALLEST_AT], least, axis=0)[0])
        found[f"{carriage.name}_contact_force_min_position"] = place
        opened = _opened_at(tables, marched, c)
        found[f"{carriage.name}_separation_position"] = tables.timeline.positions(c, opened)
    return found


def _pressing(tables: SceneTables, values: VariantValues, carriage: int) -> dict[str, Array]:
    """The same of a force, which presses as it is written from where it first counts: it swings between a largest and
    a smallest value, or all of it is constant."""
    name, constant = tables.model.carriages[carriage].name, weight(tables.model, values, carriage)
    pulsates = carriage in tables.model.pulsating
    amplitude, omega, phase = values.pulsation(name) if pulsates else np.zeros((3, values.size))
    largest, smallest, at = (np.full(values.size, np.nan) for _ in range(3))
    for way in ways_counted(tables.model, tables.timeline, carriage):
        begin, end = (omega * tau * values.scene_time_scale + phase for tau in (way.begin, way.end))
        high = constant + amplitude * np.sin(_largest_sine(begin, end))
        lowest = _largest_sine(begin + np.pi, end + np.pi) - np.pi
        low = constant + amplitude * np.sin(lowest)
        lower = ~(low >= smallest)
        largest, smallest = np.fmax(largest, high), np.where(lower, low, smallest)
        at = np.where(lower, _places(way, (lowest - begin) / np.maximum(end - begin, TINY)), at)
    return {
        f"{name}_contact_force_max": largest,
        f"{name}_contact_force_min": smallest,
        f"{name}_contact_force_min_position": at,
        f"{name}_separation_position": np.full(values.size, np.nan),
    }


TINY = np.finfo(np.float64).tiny  # of a force that is constant: it is smallest where it begins


def _places(way: Way, part: Array) -> Array:
    """Places (m) after a part of the time that a way takes."""
    return way.places(np.clip(way.begin + part * (way.end - way.begin), way.begin, way.end))


def _largest_sine(begin: Array, end: Array) -> Array:
    """(V,) the angle from ``begin`` to ``end`` at which the sine is largest, the first one."""
    peak = begin + (0.5 * np.pi - begin) % (2.0 * np.pi)
    ends = np.where(np.sin(begin) >= np.sin(end), begin, end)
    return np.where(peak <= end, peak, ends)


def _opened_at(tables: SceneTables, marched: Marched, carriage: int) -> Array:
    """(V,) count of the first station at which a carriage would lift off, or -1."""
    contacts = _contacts_of(tables.model, carriage)
    if not tables.model.may_lift(carriage):
        return np.full(marched.statistics.shape[-1], -1.0)
    after = [len(tables.sensors) + number for number in contacts]
    below = np.concatenate([marched.unrecorded[contacts, layout.BELOW_AT], marched.statistics[after, layout.BELOW_AT]])
    first = np.min(np.where(below >= 0.0, below, np.inf), axis=0)
    return np.asarray(np.where(np.isfinite(first), first, -1.0))


def _contacts_of(model: SceneModel, carriage: int) -> list[int]:
    """Numbers of the contact forces of a carriage among all contact forces."""
    return [number for number, force in enumerate(contacts_that_react(model)) if force.carriage == carriage]
