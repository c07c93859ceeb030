"""From what users write to modal bodies, one function per kind; a new kind is one new entry."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.bodies.beam.beam import Beam
from engine.bodies.beam.modes import BeamProperties, Spring, uniform_beam
from engine.bodies.frame.body import frame_body
from engine.bodies.frame.frame import Frame
from engine.bodies.imported.body import imported_body
from engine.bodies.imported.imported import Ansys, Imported, Matrices, Nastran
from engine.bodies.modal.description import AUTO_MODES, Body
from engine.bodies.modal.modal_body import ModalBody
from engine.bodies.reduced.body import load_body
from engine.bodies.reduced.reduced import Reduced
from engine.bodies.rigid.body import rigid_body
from engine.bodies.rigid.rigid import Rigid

MOST_KEPT = 64  # bodies that are not built again
_BUILT: OrderedDict[str, Built] = OrderedDict()
_BUILDING = threading.Lock()


@dataclass(frozen=True, eq=False)
class Built:
    """A modal body, with the second moment (m4) and fibre distance (m) of a uniform beam; NaN where there is none."""

    modal: ModalBody
    second_moment: float = np.nan
    fibre_distance: float = np.nan


def build_body(body: Body) -> Built:
    """A body of a study in modal coordinates, the same object for the same body: scenes of a sweep share it. Raises
    BadInput, with the key within the body as its place."""
    key = f"{type(body).__name__} {body.content} {body.model_dump_json()}"
    with _BUILDING:
        built = _BUILT.pop(key, None) or BUILDERS[type(body)](body)
        _BUILT[key] = built
        if len(_BUILT) > MOST_KEPT:
            _BUILT.popitem(last=False)
    return built


def _beam(body: Beam) -> Built:
    springs = tuple(Spring(s.at, s.stiffness, s.rotational, s.damping) for s in body.springs)
    properties = BeamProperties(
        length=body.length,
        area=body.area,
        second_moment=body.second_moment,
        youngs_modulus=body.youngs_modulus,
        density=body.density,
        ends=body.ends,
        supports=springs,
    )
    fibre = np.nan if body.fibre_distance is None else body.fibre_distance
    modes = AUTO_MODES if body.modes == "auto" else int(body.modes)
    return Built(uniform_beam(properties, modes), body.second_moment, fibre)


def _frame(body: Frame) -> Built:
    return Built(frame_body(body))


def _reduced(body: Reduced) -> Built:
    return Built(load_body(body.file, body.modes))


def _rigid(body: Rigid) -> Built:
    return Built(rigid_body(body))


def _imported(body: Imported) -> Built:
    return Built(imported_body(body))


BUILDERS: Mapping[type[Body], Callable[[Any], Built]] = {
    Beam: _beam,
    Frame: _frame,
    Reduced: _reduced,
    Rigid: _rigid,
    Matrices: _imported,
    Ansys: _imported,
    Nastran: _imported,
}
