"""Schemes that march frames that move."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from engine.kernels.floating.layout import Weights
from engine.kernels.schemes import SCHEMES, AlphaScheme, NewmarkScheme

if TYPE_CHECKING:
    from engine.scene.study import Study

#: Where the study names none: Fox-Goodwin, whose phase is of fourth order, with a larger beta of each coordinate that
#: is too fast for it.
USUAL = cast(NewmarkScheme, SCHEMES["fox-goodwin"]({}))


def scheme_of(study: Study) -> NewmarkScheme | AlphaScheme:
    """The scheme that a study asks for, or the usual one. Raises BadInput for one that does not march frames."""
    if study.solver.scheme == "auto":
        return USUAL
    scheme = study.solver.integration
    if isinstance(scheme, NewmarkScheme | AlphaScheme) and scheme.stride == 1:
        return scheme
    what = "this scheme does not march frames that move"
    expected = "auto, average-acceleration, fox-goodwin, newmark, hht-alpha or generalized-alpha"
    raise study.source.fault("solver.scheme", what, expected=expected, received=study.solver.scheme)


def weights_of(scheme: NewmarkScheme | AlphaScheme) -> Weights:
    """A scheme as kernels take it."""
    if isinstance(scheme, AlphaScheme):
        return Weights(scheme.beta, scheme.gamma, scheme.m, scheme.f)
    return Weights(scheme.beta, scheme.gamma, 0.0, 0.0, scheme is USUAL)
