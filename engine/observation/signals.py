"""What is observed of a scene, and its tables along a segment: sensors, accelerations across, contact forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.kernels.layout import Observation
from engine.observation.contact_forces import ContactForce, ContactSensor, SuspensionSensor
from engine.observation.dynamic_part import DynamicPart
from engine.observation.readings import Sensor, SideSensor, SpotSensor, SprungSensor
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.model.station_path import Along
    from engine.model.ties import CarriageTie


Signal = Sensor | ContactForce


def build_sensors(model: SceneModel, accelerated: tuple[CarriageTie, ...] = ()) -> tuple[Sensor, ...]:
    """The sensors in the study's order, then the acceleration across of some carriages."""
    names = [carriage.name for carriage in model.carriages]
    sensors = [_part(model, name, _sensor(model, name, names)) for name in model.study.sensor]
    for carriage in accelerated:
        name, under = f"{carriage.name}_acceleration_across", names.index(carriage.name)
        if carriage.rides is None:
            sensors.append(Sensor(name, "acceleration", carriage.body, 0.0, under))
        else:
            sensors.append(Sensor(name, "acceleration", carriage.rides, carriage.reference, None))
    return tuple(sensors)


def _part(model: SceneModel, name: str, whole: Sensor) -> Sensor:
    """What a sensor of the study reads of what there is."""
    return DynamicPart.of(whole) if model.study.sensor[name].is_dynamic_part else whole


def _sensor(model: SceneModel, name: str, carriages: list[str]) -> Sensor:
    """A sensor of the study."""
    spec, study = model.study.sensor[name], model.study
    under = None if spec.rides is None else carriages.index(spec.rides)
    body = [part.name for part in model.bodies].index(study.body_of(name))
    if spec.spot is not None:
        return SpotSensor(name, spec.quantity, body, np.nan, None, limit=spec.frequency_limit)
    at = 0.0 if spec.at is None else spec.at
    if under is not None and spec.side is not None:
        return SideSensor(name, spec.quantity, body, at, under, direction=spec.side)
    if spec.carriage is None or under is None:
        return Sensor(name, spec.quantity, body, at, under, limit=spec.frequency_limit)
    springs = model.springs_of(under)
    if spec.reads.of_suspension:
        return SuspensionSensor(name, spec.quantity, body, at, under, under, None)
    if spec.reads.of_contact:
        chosen = [rider for rider, contact in model.contact_names(under).items() if contact == spec.contact]
        return ContactSensor(name, spec.quantity, body, at, under, under, chosen[0] if chosen else None)
    mode = next((spring.mode for spring in springs.values()), None)
    if mode is None:
        return Sensor(name, spec.quantity, body, at, under)
    return SprungSensor(name, spec.quantity, body, at, under, mode)


def tabulate_missed(model: SceneModel, signals: tuple[Signal, ...], along: Along, ties: Counts) -> Array:
    """(stations, signals, ties) static responses per unit force of some ties that the kept modes miss."""
    return np.ascontiguousarray(np.stack([s.missed(model, along)[:, ties] for s in signals], axis=1))


def tabulate_watch(
    model: SceneModel,
    signals: tuple[Signal, ...],
    along: Along,
    missed: Array | None = None,
    left_out: Array | None = None,
) -> Observation:
    """Rows of every signal along a segment. missed: of `tabulate_missed`, where it is known; else of all ties. left_out
    (stations, signals, C + 1): of dynamic parts, per unit weight of each carriage, and last per unit gravity."""
    channels = [(number, channel) for number, signal in enumerate(signals) for channel in signal.channels(model, along)]
    ordered = [(number, channel) for of in "qva" for number, channel in channels if channel.of == of]
    rows = {of: [channel.rows for _, channel in ordered if channel.of == of] for of in "qva"}
    modes = 4 * -(-model.omega.size // 4)
    counted = np.ascontiguousarray(np.stack([s.counted(model, along) for s in signals], axis=1))
    offset = np.stack([s.offset(model, along) for s in signals], axis=1)
    static = tabulate_missed(model, signals, along, np.arange(model.ties)) if missed is None else missed
    if left_out is not None:
        offset = offset - left_out[:, :, -1]
        static = np.concatenate([static, -left_out[:, :, :-1]], axis=2)
    return Observation(
        on_q=_stacked(rows["q"], modes),
        on_v=_stacked(rows["v"], modes),
        on_a=_stacked(rows["a"], modes),
        signal=np.array([number for number, _ in ordered], dtype=np.int64),
        order=np.array([channel.order for _, channel in ordered], dtype=np.int64),
        static=static,
        offset=np.ascontiguousarray(offset),
        offset_order=np.array([s.offset_order for s in signals], dtype=np.int64),
        counted=counted,
        summed=_summed(signals, counted),
    )


def _summed(signals: tuple[Signal, ...], counted: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(signals,) of which squares are summed: sensors that read something at every station."""
    return np.array([s.is_summed for s in signals], dtype=np.bool_) & counted.all(axis=0)


def along_part(watch: Observation, signals: tuple[Signal, ...], part: slice, ties: Counts, count: int) -> Observation:
    """The same along some of the stations, as a segment of their own, with some of the ``count`` ties that it has, by
    place."""
    columns = np.append(ties, np.arange(count, watch.static.shape[2]))
    counted = watch.counted[part]
    on_q, on_v, on_a = (rows[part] if len(rows) > 1 else rows for rows in (watch.on_q, watch.on_v, watch.on_a))
    return watch._replace(
        on_q=on_q,
        on_v=on_v,
        on_a=on_a,
        static=watch.static[part].take(columns, 2),
        offset=watch.offset[part],
        counted=counted,
        summed=_summed(signals, counted),
    )


def held(watch: Observation, stations: int) -> Observation:
    """Those of one station at so many."""
    own = {name: np.repeat(getattr(watch, name), stations, axis=0) for name in ("static", "offset", "counted")}
    return watch._replace(**own)


def last_signals(watch: Observation, count: int) -> Observation:
    """The last so many signals of a watch, which have no channels, such as contact forces."""
    part = slice(watch.counted.shape[1] - count, None)
    return Observation(
        on_q=_stacked([], watch.on_q.shape[2]),
        on_v=_stacked([], watch.on_v.shape[2]),
        on_a=_stacked([], watch.on_a.shape[2]),
        signal=watch.signal[:0],
        order=watch.order[:0],
        static=np.ascontiguousarray(watch.static[:, part]),
        offset=np.ascontiguousarray(watch.offset[:, part]),
        offset_order=watch.offset_order[part],
        counted=np.ascontiguousarray(watch.counted[:, part]),
        summed=watch.summed[part],
    )


def _stacked(rows: list[Array], modes: int) -> Array:
    """(1 or stations, channels, modes), the modes filled up with zeros to whole fours."""
    stations = max((row.shape[0] for row in rows), default=1)
    found = np.zeros((stations, len(rows), modes))
    for channel, row in enumerate(rows):
        found[:, channel, : row.shape[1]] = row
    return found
