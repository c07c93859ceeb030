"""Bodies of studies in modal coordinates, each built once."""

from __future__ import annotations

import threading
from collections import OrderedDict

from engine.bodies.modal.description import Body
from engine.bodies.modal.modal_body import ModalBody

MOST_KEPT = 64  # bodies that are not built again
_BUILT: OrderedDict[str, ModalBody] = OrderedDict()
_BUILDING = threading.Lock()


def build_body(body: Body) -> ModalBody:
    """A body of a study in modal coordinates, the same object for the same body: scenes of a sweep share it. Raises
    BadInput, with the key within the body as its place."""
    key = f"{type(body).__name__} {body.content} {body.model_dump_json()}"
    with _BUILDING:
        built = _BUILT.pop(key, None) or body.build()
        _BUILT[key] = built
        if len(_BUILT) > MOST_KEPT:
            _BUILT.popitem(last=False)
    return built
