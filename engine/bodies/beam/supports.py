"""What a support of a uniform beam carries: of every mode, of a load on the track, and of own weight."""

from __future__ import annotations

from functools import partial

import numpy as np

from engine.bodies.beam.statics import Restraint, beam_statics
from engine.bodies.modal.modal_body import SAME_PLACE, Array, Gauge, ModalBody

END_SIGN = {0.0: -1.0, 1.0: 1.0}  # of E I times the third derivative: the shear force that an end carries


def support_gauge(
    modal: ModalBody, restraints: tuple[Restraint, ...], dampers: tuple[tuple[float, float], ...], at: float
) -> Gauge:
    """The support of a beam at a place, m, positive where it is pressed along gravity. Raises BadInput where there is
    none."""
    length, stiffness = modal.length, modal.bending_stiffness
    statics = beam_statics(length, stiffness, modal.mass / length, restraints)
    support = statics.support_at(at)
    return Gauge(
        row=_row(modal, statics.restraints[support]),
        along=partial(statics.reaction_at, support),
        points={},
        rigid=len(statics.rigid),
        weight=np.nan if len(statics.rigid) else statics.reaction_of_own_weight(support),
        dampers={place: 1.0 for place, _ in dampers if abs(place - at) <= SAME_PLACE * length},
    )


def _row(modal: ModalBody, support: Restraint) -> Array:
    """(N,) what it carries of every mode: of a spring k w, of a rigid end the shear force in it."""
    if support.compliance > 0.0:
        spring = modal.bending_stiffness / (support.compliance * modal.length**3)
        return np.asarray(spring * modal.shape_at(support.at * modal.length)[0])
    sign = END_SIGN[support.at]
    return np.asarray(sign * modal.bending_stiffness * modal.shape_at(support.at * modal.length, 3)[0])
