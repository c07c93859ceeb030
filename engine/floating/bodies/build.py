"""Which bodies there are in frames that move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from engine.bodies.beam.beam import Beam
from engine.bodies.frame.frame import Frame as FrameBody
from engine.bodies.imported.kinds import Ansys, Matrices, Nastran
from engine.bodies.modal.description import MAX_MODES
from engine.bodies.rigid.rigid import Rigid
from engine.floating.bodies.beam import elastic_beam, rigid_body
from engine.floating.bodies.fields import Y, Z
from engine.floating.bodies.frame import elastic_frame
from engine.floating.bodies.imported import elastic_imported
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.description import Body
    from engine.floating.bodies.elastic import ElasticBody
    from engine.scene.frames import Frame

PROBED = 65  # places along a track at which it is looked for what a mode moves
UNFELT = 1e-6  # of the largest: a mode that moves its track less along an axis does not bend it that way

BUILDERS: dict[type[Body], Callable[[Any, Frame, int | None, str, Sequence[float]], ElasticBody]] = {
    Beam: elastic_beam,
    Rigid: rigid_body,
    FrameBody: elastic_frame,
    Matrices: elastic_imported,
    Ansys: elastic_imported,
    Nastran: elastic_imported,
}
COUNTED = (FrameBody, Matrices, Ansys, Nastran)  # whose modes count where they bend the track


def elastic_body(body: Body, frame: Frame, modes: int | None, where: str, hung: Sequence[float] = ()) -> ElasticBody:
    """A body in its floating frame; modes: of bending along y and along z, as far as there are such, where the study
    leaves that open; hung: places of its track (m) at which something hangs. Raises BadInput."""
    build = BUILDERS.get(type(body))
    if build is None:
        raise BadInput(
            "bodies of this kind in a frame that moves are not built yet",
            where=f"{where}.kind",
            expected="beam, frame, rigid, matrices, ansys or nastran",
            received=body.kind,
        )
    for key, _, coefficient in body.dampers():
        if coefficient > 0.0:
            raise BadInput(
                "dampers of a body in a frame that moves are not built yet",
                where=f"{where}.{key}",
                expected="0, and a damping_ratio of the body, or a table [spring] with damping",
                received=f"{coefficient:g}",
            )
    if modes is not None and body.modes == "auto" and type(body) in COUNTED:
        modes = enough_modes(_whole(_Content(body.model_dump_json() + body.content, body, frame, where)), modes)
    return build(body, frame, modes, where, hung)


@dataclass(frozen=True)
class _Content:
    """A body by what its modes depend on."""

    text: str
    body: Body = field(compare=False)
    frame: Frame = field(compare=False)
    where: str = field(compare=False)


@lru_cache(maxsize=8)
def _whole(content: _Content) -> ElasticBody:
    """A body with all the modes that may count."""
    return BUILDERS[type(content.body)](content.body, content.frame, MAX_MODES, content.where, ())


def enough_modes(body: ElasticBody, bending: int) -> int:
    """How many of its modes hold so many that bend its track along y, and as many along z, as far as there are such:
    others twist, or bend what carries the track, and a level of more modes might bring none that counts."""
    shapes = np.abs(body.fields(np.linspace(0.0, body.length, PROBED), (0,))[0]).max(axis=0)
    most = shapes[: Z + 1].max()
    bent = [np.flatnonzero(shapes[axis] > UNFELT * most) + 1 for axis in (Y, Z)]
    return int(max([bending, *(modes[:bending][-1] for modes in bent if modes.size)]))
