"""Loads that come onto a body, or leave it, at an instant and where it gives way, which strikes every mode."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.model.ties import Attachment


class Strikes(NamedTuple):
    """How a scene's loads strike its bodies. arrive: whether one comes at once where a body gives way; leave: whether
    one goes so while something is still marched; unsprung: whether a mass touches a body without a spring."""

    arrive: bool = False
    leave: bool = False
    unsprung: bool = False

    @property
    def masses_arrive(self) -> bool:
        """Whether contact forces tend to nothing by m_N/(m + m_N), m_N the mass of N modes where a mass m comes."""
        return self.arrive and self.unsprung


def strikes_of_all(models: Iterable[SceneModel]) -> Strikes:
    """How loads strike bodies in any of some scenes, as one says what the errors of all are told by."""
    return Strikes(*(any(told) for told in zip(*map(strikes_of, models), strict=True)))


def strikes_of(model: SceneModel) -> Strikes:
    """How the loads of a scene strike its bodies."""
    loads = [load for carriage in model.carriages for load in carriage.attachments if load.rider is not None]
    unsprung = any(carriage.inertia != "force" for carriage in model.carriages)
    return Strikes(any(_arrives(model, one) for one in loads), any(_leaves(model, one) for one in loads), unsprung)


def _arrives(model: SceneModel, load: Attachment) -> bool:
    assert load.rider is not None
    stands = model.study.start == "equilibrium" and model.riders[load.rider].stays
    return not stands and _gives_way(model, load, 0.0)


def _leaves(model: SceneModel, load: Attachment) -> bool:
    assert load.rider is not None
    motion = model.riders[load.rider].motion
    goes_on = motion.free_vibration > 0.0 or len(model.carriages) > 1
    return motion.passes and goes_on and _gives_way(model, load, motion.duration)


def _gives_way(model: SceneModel, load: Attachment, tau: float) -> bool:
    """Whether its place at a motion's own time is no end of the track that is held."""
    assert load.rider is not None
    rider, modal = model.riders[load.rider], model.bodies[load.body].modal
    place = float(rider.motion.path(np.full(1, tau)).S[0]) + rider.offset
    ends = (place <= 0.0, modal.held_ends[0]), (place >= rider.length, modal.held_ends[1])
    return not any(at and held for at, held in ends)
