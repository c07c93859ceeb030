"""Kinds of bodies, each a class that is read from a study file; a new kind is one new entry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from engine.bodies.beam import Beam, Body
from engine.spec import KindOf, Spec

BODIES: Mapping[str, type[Spec]] = {"beam": Beam}
AnyBody = Annotated[Body, KindOf("body", BODIES, planned=("frame", "nastran", "ansys"))]

__all__ = ["BODIES", "AnyBody", "Beam", "Body"]
