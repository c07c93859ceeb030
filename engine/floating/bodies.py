"""Which bodies there are in frames that move."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from engine.bodies.beam.beam import Beam
from engine.bodies.frame.frame import Frame as FrameBody
from engine.bodies.imported.imported import Ansys, Matrices, Nastran
from engine.bodies.rigid.rigid import Rigid
from engine.floating.elastic_beam import elastic_beam, rigid_body
from engine.floating.elastic_frame import elastic_frame
from engine.floating.elastic_imported import elastic_imported
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.description import Body
    from engine.floating.elastic import ElasticBody
    from engine.scene.frames import Frame

BUILDERS: dict[type[Body], Callable[[Any, Frame, int | None, str], ElasticBody]] = {
    Beam: elastic_beam,
    Rigid: rigid_body,
    FrameBody: elastic_frame,
    Matrices: elastic_imported,
    Ansys: elastic_imported,
    Nastran: elastic_imported,
}


def elastic_body(body: Body, frame: Frame, modes: int | None, where: str) -> ElasticBody:
    """A body in its floating frame; modes: of bending, where the study leaves that open. Raises BadInput."""
    build = BUILDERS.get(type(body))
    if build is None:
        raise BadInput(
            "bodies of this kind in a frame that moves are not built yet",
            where=f"{where}.kind",
            expected="beam, frame, rigid, matrices, ansys or nastran",
            received=body.kind,
        )
    return build(body, frame, modes, where)
