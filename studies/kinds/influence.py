"""What do gravity and the weights do at rest, against the place of the carriage? Static readings, without a march."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.model.scene_model import SceneModel
from engine.model.station_path import Along, frozen
from engine.observation.contact_forces import contact_forces
from engine.observation.readings import Sensor
from engine.observation.signals import build_sensors
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.statics.static_response import contact_names, static_shapes, static_values
from results_schema.arrays import Array, Mask
from results_schema.quantities import QUANTITIES
from results_schema.status import Fidelity
from results_schema.variable import outputs
from results_schema.variables import declare
from studies.at_rest.at_rest import AtRestKind, check_held
from studies.at_rest.findings import READING_WANTED, ROUNDING, contacts_vary, enough_modes, reading_errors
from studies.at_rest.labelling import BODY_PLACES, COORDINATES
from studies.at_rest.positions import all_positions
from studies.results.findings_common import check_sensors, first_carriage, in_words, told_statuses
from studies.results.formatting import counted, percent, quantity
from studies.results.places import Index, both_ends
from studies.results.results import Results

MOST_SENSORS = 6
LIFTS = 1e-9  # of the weights: a smaller pull of a contact is rounding

RESULTS = outputs("""
    {sensor} | position | {sensor} | nan | static reading of {sensor}
        at rest under gravity and the carriages' weights and forces, own weight of bodies included where it acts; NaN
        where a contact, or a whole train, is off the body
    {sensor}_influence | position | {sensor} N-1 | nan | influence line of {sensor}
        static reading per newton of the first carriage's weight alone, spread over its contacts as at rest; NaN where
        it is off the body
    contact_force | position contact | N | nan | static force at every contact
        at rest under gravity and the carriages' weights and forces; NaN where a contact of the first carriage, or a
        train's axle, is off the body
    deflection | on_body position body_place | m | alone |
        static deflection along every body, of the scene without sweep
        at rest under gravity and the carriages' weights and forces, as displacement sensors count it
    {sensor}_by_mode_count | correction mode_count checked_position | {sensor} | optional alone nan |
        static reading of {sensor} with other numbers of modes of every body
        of the scene without sweep
    {sensor}_unreduced | unreduced_position | {sensor} | optional alone nan |
        static reading of {sensor} by the unreduced finite-element model
        of the scene without sweep
    {sensor}_difference | unreduced_position | | optional alone nan | difference of {sensor} from the unreduced model
        over the largest reading at these positions
    contact_force_unreduced | unreduced_position contact | N | optional alone nan |
        static force at every contact by the unreduced finite-element model
    contact_force_difference | unreduced_position contact | | optional alone nan |
        difference of contact forces from the unreduced model
        over the largest force at these positions
    contact | | | axis str | contact
        the carriage, or the carriage and its contact
""")
declare("influence", *RESULTS, *COORDINATES)


class Influence(AtRestKind):
    """The kind "influence"."""

    name = "influence"
    summary = "static readings, contact forces and deflected shapes under gravity against the carriage's position"
    question = "What do the weights do at rest, wherever the carriage stands?"
    drawn_by = "studies.pictures.influence"

    def check(self, study: Study) -> None:
        """Something stands on a body, something with a static reading is measured, and positions exist."""
        first_carriage(study)
        check_sensors(study)
        for name, sensor in study.sensor.items():
            if sensor.is_dynamic_part:
                what, expected = "at rest nothing has a dynamic part", "no such key"
                raise study.source.fault(f"sensor.{name}.part", what, expected=expected)
            if QUANTITIES[sensor.quantity].rate:
                what = "this quantity has no static reading"
                expected = "displacement, a section force, stress, contact_force or what supports carry"
                raise study.source.fault(f"sensor.{name}.quantity", what, expected=expected, received=sensor.quantity)
        super().check(study)

    def variants(self, model: SceneModel, values: VariantValues, along: Along) -> dict[str, NDArray[Any]]:
        named, sensors = dict[str, NDArray[Any]](), build_sensors(model)
        found, first = static_values(model, sensors, values, along), _on_bodies(along, [0])[:, 0]
        for j, sensor in enumerate(model.study.sensor):
            named[sensor] = np.where(_read(along, sensors[j], model), found.sensors[:, :, j], np.nan)
            named[f"{sensor}_influence"] = np.where(first, found.influence[:, :, j], np.nan)
        touching = contact_forces(model)
        may_lift = np.array([model.may_lift(contact.carriage) for contact in touching])
        contacts = np.where(_on_bodies(along, [contact.rides(model) for contact in touching]), found.contacts, np.nan)
        size = np.nanmax(np.abs(contacts), axis=(1, 2), keepdims=True, initial=0.0)
        named["opened"] = ((contacts < -LIFTS * size) & may_lift).any(axis=2)
        return {**named, "contact_force": contacts}

    def shapes(self, model: SceneModel, along: Along) -> dict[str, NDArray[Any]]:
        values = VariantValues(model.study, {}, 1)
        lines = [
            static_shapes(model, values, along, body, np.linspace(0.0, part.modal.length, BODY_PLACES))[0]
            for body, part in enumerate(model.bodies)
        ]
        return {"deflection": np.stack(lines)}

    def unreduced(self, study: Study, model: SceneModel, positions: Array) -> dict[str, NDArray[Any]]:
        from engine.unreduced.scene import unreduced_model
        from engine.unreduced.statics import unreduced_statics

        full = unreduced_model(study)
        sensors, forces = unreduced_statics(full, all_positions(model, positions))
        along, readers = frozen(model, positions), build_sensors(model)
        read = [np.where(_read(along, reader, model), sensors[:, j], np.nan) for j, reader in enumerate(readers)]
        found = dict(zip(study.sensor, read, strict=True))
        ties = [tie.name for tie in full.ties]
        contacts = [name.replace(".", "_") for name in contact_names(model)]
        parts = [sum(forces[:, r] for r, tie in enumerate(ties) if tie == name) for name in contacts]
        forces = np.stack([np.broadcast_to(part, positions.shape) for part in parts], axis=1)
        on = _on_bodies(along, [contact.rides(model) for contact in contact_forces(model)])
        return {**found, "contact_force": np.where(on, forces, np.nan)}

    def check_model(self, model: SceneModel) -> None:
        """Refuse a body that nothing holds. Raises BadInput."""
        check_held(model)

    def fidelity(self, model: SceneModel) -> Fidelity:
        return Fidelity.STATIC

    def inner(self, model: SceneModel) -> dict[str, tuple[str, NDArray[Any]]]:
        return {"contact_force": ("contact", np.array(contact_names(model)))}

    def findings(self, results: Results) -> list[str]:
        said = [_span(results, sensor) for sensor in list(results.sensors)[:MOST_SENSORS]]
        said += _contacts(results)
        return [*said, *_unreduced(results), *_mode_counts(results), *told_statuses(results)]


KIND = Influence()


def _read(along: Along, sensor: Sensor, model: SceneModel) -> Mask:
    """(S,) whether a sensor reads anything: one that rides does where its carriage stands on its body."""
    rider = sensor.rides(model)
    return np.ones(along[0].s.size, dtype=np.bool_) if rider is None else _on_bodies(along, [rider])[:, 0]


def _on_bodies(along: Along, riders: list[int]) -> Mask:
    """(S, K) whether riders stand on their bodies."""
    here = [along[rider].here for rider in riders]
    on = [np.ones(along[0].s.size, dtype=np.bool_) if one is None else one for one in here]
    return np.stack(on, axis=1) if on else np.zeros((along[0].s.size, 0), dtype=np.bool_)


def _span(results: Results, sensor: str) -> str:
    """Between which readings a sensor moves, and where."""
    found = np.asarray(results.dataset[sensor].values)
    ends = both_ends(found)
    if ends is None:
        return f"{sensor}: no variant has values."
    places, units = results.dataset["position"].values, results.sensors[sensor]
    largest = float(np.nanmax(np.abs(found)))
    if largest == 0.0 or float(np.nanmax(found) - np.nanmin(found)) <= ROUNDING * largest:
        at = quantity(float(found[ends[0]]), units, 4)
        return f"{sensor}: {at} wherever {results.carriage_name} stands."
    texts = [
        f"{quantity(float(found[end]), units, 4, beside=largest)}{in_words(results, end[:-1])} with "
        f"{results.carriage_name} at {quantity(float(places[end[-1]]), 'm')}"
        for end in ends
    ]
    low, high = float(np.nanmin(found)), float(np.nanmax(found))
    apart = f"; the difference is {percent((high - low) / largest)} of the largest size" if low * high >= 0.0 else ""
    return f"{sensor}: from {texts[0]} to {texts[1]}{_own_weight(results, sensor, ends[1])}{apart}."


def _own_weight(results: Results, sensor: str, place: Index) -> str:
    """Which part of a reading is there by the bodies' own weight; "" where that does not act, or others stand there."""
    study, found = results.study, results.dataset
    if len(study.carriage) > 1 or not any(body.own_weight for body in study.body.values()):
        return ""
    weight = float(np.nansum(found["contact_force"].values[place]))  # at rest all contacts together
    whole = float(found[sensor].values[place])
    part = 1.0 - weight * float(found[f"{sensor}_influence"].values[place]) / whole
    return f" ({percent(part)} of that by own weight)" if whole > 0.0 and ROUNDING < part <= 1.0 else ""


def _contacts(results: Results) -> list[str]:
    """The largest and smallest contact force, and where."""
    if not contacts_vary(results):
        return []
    found = results.dataset["contact_force"]
    values, places = np.asarray(found.values), results.dataset["position"].values
    ends = both_ends(values)
    if ends is None:
        return []
    texts = [
        f"{quantity(float(values[end]), 'N', 4)} ({found['contact'].values[end[-1]]}{in_words(results, end[:-2])}, at "
        f"{quantity(float(places[end[-2]]), 'm')})"
        for end in ends
    ]
    return [f"Contact forces lie between {' and '.join(texts)}."]


def _unreduced(results: Results) -> list[str]:
    """How far the readings are from those of the unreduced model."""
    found = {name: results.dataset.get(f"{name}_difference") for name in results.sensors}
    known = {name: float(np.nanmax(np.abs(one.values))) for name, one in found.items() if one is not None}
    if not known:
        return []
    worst = max(known, key=lambda name: known[name])
    moved = [name for name in known if results.sensors[name] == "m"]
    positions = results.dataset.sizes["unreduced_position"]
    said = (
        f"Against the unreduced finite-element model at {counted(positions, 'position')}, readings differ by "
        f"{_part(known[worst])} of the sensor's largest ({worst})"
    )
    if not moved or worst in moved:
        return [f"{said}."]
    return [f"{said}, displacements by {_part(max(known[name] for name in moved))}."]


def _part(error: float) -> str:
    """A largest part in percent, or that it is rounding."""
    return f"at most {percent(error)}" if error > ROUNDING else f"less than {percent(ROUNDING)}"


def _mode_counts(results: Results) -> list[str]:
    """From how many modes on the readings are right, with and without the static correction."""
    if "mode_count" not in results.dataset.dims:
        return []
    errors = [reading_errors(results, sensor) for sensor in results.sensors]
    worst = np.max([error for error, _ in errors], axis=0)
    return [enough_modes(results, worst, READING_WANTED, "all readings are", errors[0][1])]
