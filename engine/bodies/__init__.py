"""Kinds of bodies, each a class that is read from a study file; a new kind is one new entry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from engine.bodies.beam import Beam
from engine.bodies.body import Body
from engine.bodies.frame import Frame
from engine.bodies.imported import Ansys, Matrices, Nastran
from engine.bodies.reduced import Reduced
from engine.bodies.rigid import Rigid
from engine.spec import KindOf, Spec

BODIES: Mapping[str, type[Spec]] = {
    "beam": Beam,
    "frame": Frame,
    "reduced": Reduced,
    "rigid": Rigid,
    "matrices": Matrices,
    "ansys": Ansys,
    "nastran": Nastran,
}
AnyBody = Annotated[Body, KindOf("body", BODIES)]

__all__ = ["BODIES", "Ansys", "AnyBody", "Beam", "Body", "Frame", "Matrices", "Nastran", "Reduced", "Rigid"]
