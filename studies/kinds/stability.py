"""Where do methods fail? Maps of stability, computed by running the march itself, with the theory beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from results_schema.lazy_imports import xr
from results_schema.status import Fidelity, Status
from results_schema.variables import declare
from studies.protocol.parts import Piece, usual
from studies.protocol.study import PiecedKind, question_of
from studies.stability_maps.map_scene import Ground
from studies.stability_maps.mapping import Asked
from studies.stability_maps.table import MAPS

if TYPE_CHECKING:
    from engine.scene.carriages import Carriage
    from engine.scene.study import Study
    from studies.pictures.common.figures import Figure
    from studies.results.results import Results

for _map in MAPS.values():
    declare("stability", *_map.outputs)


class Stability(PiecedKind):
    """The kind "stability"."""

    name = "stability"
    summary = "where schemes and couplings grow without reason: limits, thresholds and maps, with the theory beside"
    question = "With which step, mass and speed does a method of time integration stop telling the truth?"
    settings = Asked

    def check(self, study: Study) -> None:
        """One mass that crosses one held body, and maps that exist."""
        _check_scene(study)
        for name in question_of(study, Asked).maps:
            if name not in MAPS:
                expected = f"some of {', '.join(MAPS)}"
                raise study.source.fault("question.maps", "no such map", expected=expected, received=repr(name))

    def pieces(self, study: Study) -> Sequence[Piece]:
        asked, ground = question_of(study, Asked), Ground(study)
        chosen = [one for name, one in MAPS.items() if name in asked.maps]
        return [Piece(one.name, one.words, partial(one.compute, ground, asked), one.seconds(asked)) for one in chosen]

    def gather(self, pieces: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
        modes, steps = (
            max(int(np.max(piece.attrs[name])) for piece in pieces.values()) for name in ("most_modes", "most_steps")
        )
        plain = [piece.drop_attrs(deep=False) for piece in pieces.values()]
        whole = xr.merge(plain, combine_attrs="override", join="exact", compat="equals")
        return whole.assign(usual((), status=int(Status.OK), fidelity=int(Fidelity.MASS), modes=modes, steps=steps))

    def findings(self, results: Results) -> list[str]:
        return [text for one in _present(results) for text in MAPS[one].sentences(results.dataset)]

    def figures(self, results: Results) -> list[Figure]:
        from studies.pictures import stability

        return stability.pictures(results.dataset, _present(results))


def _present(results: Results) -> list[str]:
    """Names of the maps that the archive holds, in their order."""
    asked = question_of(results.study, Asked).maps
    return [name for name in MAPS if name in asked]


def _check_scene(study: Study) -> None:
    """Refuse what the maps cannot stand on. Raises BadInput."""
    if len(study.carriage) != 1:
        what, expected = "the maps vary one carriage", "exactly one table [carriage.name]"
        raise study.source.fault("carriage", what, expected=expected, received=f"{len(study.carriage)} of them")
    ((name, carriage),) = study.carriage.items()
    _check_carriage(study, name, carriage)
    body, here = study.body[carriage.on], f"body.{carriage.on}"
    if body.own_weight:
        what = "the maps leave the body's own weight out"
        raise study.source.fault(f"{here}.own_weight", what, expected="own_weight = false")
    if any(coefficient > 0.0 for _, _, coefficient in body.dampers()):
        what = "the maps know damping of the modes only"
        raise study.source.fault(f"{here}.supports", what, expected="supports without damping")
    if not isinstance(body.damping_ratio, float):
        what = "the maps vary the number of modes"
        raise study.source.fault(f"{here}.damping_ratio", what, expected="one damping ratio for all modes")
    if Ground(study).is_loose:
        raise study.source.fault(f"{here}.supports", "nothing holds this body", expected="supports that hold it")


def _check_carriage(study: Study, name: str, carriage: Carriage) -> None:
    """A mass that crosses, with its inertia. Raises BadInput."""
    if study.solver.fidelity in ("force", "static"):
        received = f'"{study.solver.fidelity}"'
        what = "a force has no inertia that could fail"
        raise study.source.fault("solver.fidelity", what, expected='"auto"', received=received)
    if not carriage.inertial:
        raise study.source.fault(f"carriage.{name}.kind", "a force has no inertia that could fail", expected='"mass"')
    if carriage.masses != ("mass",):
        raise study.source.fault(f"carriage.{name}.kind", "the maps know rigid masses only", expected='"mass"')
    for direction in carriage.pushes:
        what = "the maps know inertia across the track only"
        where = f"inertia_{direction}"
        raise study.source.fault(f"carriage.{name}.{where}", what, expected=f"{where} = false")
    if not carriage.motion.passes:
        raise study.source.fault(f"carriage.{name}.motion.kind", "the maps start from a passage", expected='"cruise"')


KIND = Stability()
