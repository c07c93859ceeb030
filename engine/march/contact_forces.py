"""What a march observed of contact forces: their extremes, and where a carriage would lift off."""

import numpy as np

from engine.kernels import layout
from engine.march.march import Marched
from engine.march.tables import SceneTables
from engine.model.lane_table import weight
from engine.model.scene_model import SceneModel
from engine.observation.contact_forces import contacts_that_react, first_place_counted
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
    """The same of a plain force, which presses as it is written from where it first counts."""
    name, first = tables.model.carriages[carriage].name, first_place_counted(tables.model, tables.timeline, carriage)
    force = np.where(np.isnan(first), np.nan, weight(tables.model, values, carriage))
    return {
        f"{name}_contact_force_max": force,
        f"{name}_contact_force_min": force.copy(),
        f"{name}_contact_force_min_position": np.full(values.size, first),
        f"{name}_separation_position": np.full(values.size, np.nan),
    }


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
