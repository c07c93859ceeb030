"""Kinds of bodies, each a class that is read from a study file and makes its modes; a new kind is one new entry."""

from __future__ import annotations

from typing import Annotated

from engine.bodies.beam.beam import Beam
from engine.bodies.frame.frame import Frame
from engine.bodies.imported.kinds import Ansys, Matrices, Nastran
from engine.bodies.modal.description import Body
from engine.bodies.reduced.reduced import Reduced
from engine.bodies.rigid.rigid import Rigid
from engine.study_file.spec import KindOf, kinds

BODIES = kinds("body", "wanderlast.bodies", Body, Beam, Frame, Reduced, Rigid, Matrices, Ansys, Nastran)
AnyBody = Annotated[Body, KindOf("body", BODIES)]

__all__ = ["BODIES", "Ansys", "AnyBody", "Beam", "Body", "Frame", "Matrices", "Nastran", "Reduced", "Rigid"]
