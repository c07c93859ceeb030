"""What a study of work and precision refuses in its tables [question] and [solver]."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from results_schema.errors import BadInput
from studies.precision.variables import MARCHED

if TYPE_CHECKING:
    from engine.scene.study import Study
    from studies.kinds.work_precision import Question

VARIED = ("scheme", "beta", "gamma", "alpha", "rho_inf", "steps")  # keys of [solver] that this study is about
REMEDIES = {
    "scheme": "name schemes in question.schemes; each has the parameters that docs/study-file.md gives",
    "steps": "give numbers of steps in question.step_counts",
}
NAMED = ("body", "train", "carriage", "sensor")


def slug_of(name: str) -> str:
    """A scene's name as part of the name of a piece."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def check_slugs(study: Study, asked: Question) -> None:
    """Names of scenes that differ as names of pieces too."""
    slugs = [slug_of(name) for name in asked.scenes]
    for name, slug in zip(asked.scenes, slugs, strict=True):
        if not slug or slugs.count(slug) > 1 or len(name) > 60:
            expected = "up to 60 characters whose letters and digits differ from those of other names"
            raise study.source.fault(f"question.scenes.{name}", "not a usable name of a scene", expected=expected)


def check_ladder(study: Study, asked: Question) -> None:
    """At least one scheme that a study could take, and a reference of more modes than are compared."""
    if not set(asked.schemes) & set(MARCHED):
        where = study.source.where("question.schemes")
        expected = f"at least one scheme of the march: {', '.join(MARCHED)}"
        raise BadInput("these schemes are for comparison only", where=where, expected=expected)
    if asked.mode_counts[-1] >= asked.reference_modes:
        raise study.source.fault(
            "question.reference_modes",
            "the reference has no more modes than what is compared with it",
            expected=f"more than {asked.mode_counts[-1]}",
            received=str(asked.reference_modes),
        )


def check_wholes(study: Study) -> None:
    """No dynamic parts, which the references do not know. Raises BadInput."""
    for name, sensor in study.sensor.items():
        if sensor.is_dynamic_part:
            what = "a study of work and precision reads the whole"
            raise study.source.fault(f"sensor.{name}.part", what, expected="no such key")


def check_solver(study: Study) -> None:
    """Nothing in [solver] that the study varies itself, other than what stands there by default. Raises BadInput."""
    from engine.scene.settings import Solver

    for key in VARIED:
        value = getattr(study.solver, key)
        if value != getattr(Solver(), key):
            what, remedy = "a study of work and precision varies this itself", REMEDIES.get(key, REMEDIES["scheme"])
            raise study.source.fault(f"solver.{key}", what, expected="no such key", received=repr(value), remedy=remedy)


def check_overrides(study: Study, name: str, overrides: Mapping[str, Any]) -> None:
    """Dotted keys of things that the scene has, and of nothing that the study varies. Raises BadInput."""
    from engine.study_file.spec import nearest

    for key in overrides:
        where = study.source.where(f"question.scenes.{name}.{key}")
        table, _, rest = key.partition(".")
        if table == "solver" and rest in VARIED:
            remedy = REMEDIES.get(rest, REMEDIES["scheme"])
            raise BadInput("a study of work and precision varies this itself", where=where, remedy=remedy)
        own, dot, _ = rest.partition(".")
        if table in NAMED and dot and own not in (known := list(study.tables.get(table, {}))):
            expected = f"one of {', '.join(known)}" if known else "none"
            remedy = nearest(own, known)
            raise BadInput(f"no such {table}", where=where, expected=expected, received=repr(own), remedy=remedy)
