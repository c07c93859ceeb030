"""Carriages whose given motions lead over an end of the body on which they run: there their track ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.study_file.checks import on_body
from results_schema.arrays import Array, Counts, Mask

if TYPE_CHECKING:
    from engine.floating.model import FloatingModel
    from engine.scene.study import Study
    from engine.scene.sweep import Cases
    from engine.scene.variants import VariantValues
    from studies.moving.parts import Scene

AT_ONCE = 32  # variants
NEAR = 1e-9  # of a length: less over an end is rounding, as in a march
REMEDY = "an end on the body (a spline may pass beyond its waypoints), a lower speed or a shorter duration"


class Way(NamedTuple):
    """Of some variants (V,) of a scene: the least and the largest place (m) of a carriage while a march lasts, and
    whether it goes over an end; length: of its track, m; seconds (V,): of the march."""

    low: Array
    high: Array
    off: Mask
    length: float
    seconds: Array


def refuse_ways(
    study: Study, cases: Cases, scenes: Sequence[Scene], duration: Callable[[Mapping[str, Array], int], Array]
) -> None:
    """Raise BadInput for a carriage that does not start on its body, in whatever variant, as of one that slides by
    itself, and for one that goes over an end in all of them; the march of others ends there, as of one that slides."""
    from engine.floating.model import build
    from engine.scene.variants import VariantValues

    def ways(name: str) -> Iterator[Way]:
        for scene in scenes:
            model = build(scene.study, 2)
            for start in range(0, scene.variants.size, AT_ONCE):
                own: Counts = scene.variants[start : start + AT_ONCE]
                columns = cases.columns_of(own)
                values = VariantValues(scene.study, columns, own.size)
                yield way_of(model, values, duration(columns, own.size), name)

    for name in driven(study):
        _refuse_start(study, cases, name)
        worst = None
        for way in ways(name):
            if not way.off.all():
                break
            worst = worst or way
        else:
            assert worst is not None
            raise _refusal(study, name, worst)


def _refusal(study: Study, name: str, way: Way) -> Exception:
    on, every = study.carriage[name].on, " in every variant" if study.sweep.axes else ""
    return study.source.fault(
        f"carriage.{name}.motion",
        f"this motion leads over an end of {on}{every}, where its track ends",
        expected=f"a way within 0 to {way.length:.6g} m as long as the march lasts, {way.seconds[0]:.6g} s",
        received=f"{way.low[0]:.6g} to {way.high[0]:.6g} m",
        remedy=REMEDY,
    )


def _refuse_start(study: Study, cases: Cases, name: str) -> None:
    from engine.scene.sweep import broken

    here, numbers = f"carriage.{name}.motion", study.numbers()
    for key in (f"{here}.start", f"{here}.positions.0"):
        if key in numbers:
            length = f"body.{study.carriage[name].on}.length"
            check = on_body(key, (key, length), "on a body in a frame that moves a carriage starts on its track")
            if unmet := broken(study, cases, check):
                remedy = "a start on the body; of a body that stands loads come onto it in a passage"
                raise replace(check, remedy=remedy).fault(unmet[0], study.source)


def driven(study: Study) -> Iterator[str]:
    """Carriages with a given motion that nothing else keeps on their bodies."""
    for name, carriage in study.carriage.items():
        if not (carriage.motion.slides or carriage.motion.ends or carriage.motion.is_harmonic):
            yield name


def way_of(model: FloatingModel, values: VariantValues, seconds: Array, name: str) -> Way:
    """The way of a carriage in some variants of a scene, whose marches take so many seconds."""
    from engine.floating.theory import given_way

    length = model.bodies[model.study.carriage[name].on].length
    low, high = given_way(model, values, seconds, name)
    return Way(low, high, (low < -NEAR * length) | (high > (1.0 + NEAR) * length), length, np.asarray(seconds))
