"""One variant of a study by both models: the march of modes, and the unreduced model along the same way.

Both are read at the same stations, each with its own static response there, so that the dynamic part, the history less
the static response at the same places, can be compared too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.accuracy.groups import marches_again
from engine.batch.plan import Plan
from engine.kernels.layout import LANES
from engine.march.outcome import Flat
from engine.march.tables import SceneTables
from engine.model.lane_table import static_loads
from engine.model.scene_model import build_model
from engine.model.timeline import refined
from engine.observation.histories import counts_shown
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.unreduced.march import Course, check_march, march_unreduced
from engine.unreduced.rows import Along
from engine.unreduced.scene import contacts_of, unreduced_model
from engine.unreduced.statics import statics_at
from results_schema.arrays import Array, Counts

FINER = 8  # steps of the unreduced model for each of the march, so that its many modes do not ring by their steps
MOST_STEPS = 120_000  # of the unreduced model, unless the march itself takes more


@dataclass(frozen=True, eq=False)
class Compared:
    """Histories of J sensors at H stations by both models, and their static responses there, all (J, H); NaN where a
    sensor reads nothing.

    quantities: by name, of the study's sensors and of the contact forces that it does not read. elapsed (H,): s.
    position (H,): of the first carriage, m. steps: of the unreduced model over the whole way.
    """

    quantities: Mapping[str, str]
    elapsed: Array
    position: Array
    marched: Array
    marched_static: Array
    unreduced: Array
    unreduced_static: Array
    degrees_of_freedom: int
    steps: int


def compare_variant(plan: Plan, variant: int, spent: Flat, check: Callable[[], None] = lambda: None) -> Compared:
    """Both models of one variant over the recorded part; spent: what it was computed with, as (1,). Raises BadInput as
    `unreduced_model`, and what `check` raises, which is called now and then."""
    from engine.march.richardson import march_scheme  # here, as the check of a study marches nothing

    number = next(number for number, members in enumerate(plan.members) if variant in members)
    study = reading_contacts(plan.cases.study_of(plan.study, variant))
    [(own, _)] = marches_again(plan.grids[number], spent)
    tables = _tables(own, study)
    values = VariantValues(study, {}, LANES)
    wanted = plan.study.output.histories
    counts = counts_shown(tables.timeline, plan.asked.window, "auto" if wanted == "none" else wanted)
    marched = march_scheme(tables, values, counts, 1)
    whole = unreduced_model(study, *plan.grids[number].scene.timing)
    by = int(np.clip(MOST_STEPS // tables.timeline.steps, 1, FINER))
    course = Course(
        refined(tables.timeline, by),
        float(values.time_scale(next(iter(study.carriage)))[0]),
        2.0 * np.pi / tables.model.first_omega,
    )
    found = march_unreduced(whole, course, by * counts, check)
    seen = np.isfinite(found.sensors)
    places = np.stack([tables.timeline.positions(r, counts) for r in range(len(whole.riders))], axis=1)
    resting = statics_at(whole, Along.at_rest(places, np.isfinite(places), whole.riders)).sensors
    left_out = np.where([sensor.is_dynamic_part for sensor in study.sensor.values()], resting, 0.0)
    return Compared(
        quantities={name: sensor.quantity for name, sensor in study.sensor.items()},
        elapsed=course.elapsed(by * counts),
        position=tables.timeline.positions(0, counts),
        marched=marched.history[:, :, 0].T,
        marched_static=np.where(np.isfinite(marched.history[:, :, 0]), _static(tables, values, counts), np.nan).T,
        unreduced=(found.sensors - left_out).T,
        unreduced_static=np.where(seen, resting - left_out, np.nan).T,
        degrees_of_freedom=whole.size,
        steps=course.timeline.steps,
    )


def check_unreduced(study: Study) -> None:
    """Refuse a study that asks for the unreduced model and has none, by its scene without sweep. Raises BadInput."""
    if study.output.unreduced and study.carriage:
        for name, carriage in study.carriage.items():
            if carriage.pulsates:
                what, expected = "the unreduced model has no force that pulsates", "no such key, or unreduced = 0"
                raise study.source.fault(f"carriage.{name}.pulsation", what, expected=expected)
        check_march(unreduced_model(study.without_sweep()))


def reading_contacts(study: Study) -> Study:
    """The study with sensors of all contact forces that it does not read itself."""
    of_contact = [s for s in study.sensor.values() if s.reads.of_contact and not s.reads.of_suspension]
    read = {(s.carriage, s.contact) for s in of_contact}
    more: dict[str, Any] = {}
    for name in study.carriage:
        own: list[str | None] = [word for owner, word, _ in contacts_of(study) if owner == name]
        for contact in own or [None]:
            here = f"contact_{name}" if contact is None else f"contact_{name}_{contact}"
            if (name, contact) not in read and here not in study.sensor:
                at = {} if contact is None else {"contact": contact}
                more[here] = {"carriage": name, "quantity": "contact_force"} | at
    return study.with_values({"sensor": dict(study.data.get("sensor", {})) | more})


def _tables(own: SceneTables, study: Study) -> SceneTables:
    """The march's scene with the variant's own numbers and sensors."""
    model = build_model(study, *own.model.timing, (), own.model.numerics)
    found = SceneTables(model, own.steps, own.window, refinement=own.refinement)
    found.timeline = own.timeline
    return found


def _static(tables: SceneTables, values: VariantValues, counts: Counts) -> Array:
    """(H, J) static readings of the march's own model."""
    return np.asarray(tables.statics.at(counts) @ static_loads(tables.model, values)[:, 0])
