"""Bodies of studies in modal coordinates, each built once."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import replace

from engine.bodies.modal.description import Body, Spots
from engine.bodies.modal.modal_body import ModalBody, gauge_at

MOST_KEPT = 64  # bodies that are not built again
_BUILT: OrderedDict[str, ModalBody] = OrderedDict()
_BUILDING = threading.Lock()


def build_body(body: Body, spots: Spots = ()) -> ModalBody:
    """A body of a study in modal coordinates, read at some spots, the same object for the same body: scenes of a sweep
    share it. Raises BadInput, with the key within the body as its place."""
    key = f"{type(body).__name__} {body.content} {body.model_dump_json()} {spots}"
    with _BUILDING:
        built = _BUILT.pop(key, None) or _read_at(body, spots)
        _BUILT[key] = built
        if len(_BUILT) > MOST_KEPT:
            _BUILT.popitem(last=False)
    return built


def _read_at(body: Body, spots: Spots) -> ModalBody:
    """The body with what sensors read off its track."""
    found = body.read_at(tuple((name, spot) for name, spot in spots if spot.point is None))
    if found.points is None:
        return found
    at_points = {name: gauge_at(found, f"point.{spot.point}") for name, spot in spots if spot.point is not None}
    return replace(found, gauges={**found.gauges, **at_points}) if at_points else found
