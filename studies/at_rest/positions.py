"""Where the first carriage stands in studies at rest, what they are asked, and scenes with other numbers of modes."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import AfterValidator, Field, Strict, Tag

from engine.model.scene_model import SceneModel
from engine.model.station_path import in_row
from engine.scene.study import Study
from engine.study_file.spec import LIST, NUMBER, Spec, ascending, by_form
from engine.study_file.units import Length
from results_schema.arrays import Array, Counts
from results_schema.errors import BadInput
from studies.results.findings_common import first_carriage
from studies.results.places import spread

CORRECTED: Sequence[Mapping[str, Any]] = ({"solver.static_correction": True}, {"solver.static_correction": False})


_Number = Annotated[int, Field(ge=2, le=2001)]
_Listed = Annotated[tuple[Length, ...], Strict(False), Field(min_length=1, max_length=2001), AfterValidator(ascending)]
_Modes = Annotated[int, Field(ge=1, le=64)]


class Asked(Spec):
    """The table [question] of a study at rest.

    positions: of the first carriage, how many along its way, or places in m. mode_counts: numbers of modes of every
    body that are compared at the middle and the last position. unreduced: at how many positions the unreduced
    finite-element model is computed too.
    """

    positions: Annotated[Annotated[_Number, Tag(NUMBER)] | Annotated[_Listed, Tag(LIST)], by_form] = 41
    mode_counts: Annotated[tuple[_Modes, ...], Strict(False), AfterValidator(ascending)] = ()
    unreduced: int = Field(default=0, ge=0, le=101)

    @property
    def frequencies(self) -> int:
        """How many natural frequencies are wanted at every position."""
        return 0


class Positions(NamedTuple):
    """Where the first carriage stands, m (P,), and places among these: of the comparison of numbers of modes, and of
    the unreduced model."""

    all: Array
    checked: Counts
    unreduced: Counts


def positions_of(study: Study, asked: Asked) -> Positions:
    """The positions of a study. Raises BadInput where there are none, or one is off the body."""
    low, high = _way_of_train(study)
    if isinstance(asked.positions, int):
        found = np.linspace(low, high, asked.positions)
    else:
        found = np.array(asked.positions)
        slack = 1e-9 * (high - low)
        if found[0] < low - slack or found[-1] > high + slack:
            raise study.source.fault(
                "question.positions",
                "a position where the carriage is off its body",
                expected=f"places within {low:.6g} to {high:.6g} m",
                received=f"{found[0]:.6g} to {found[-1]:.6g} m",
            )
    last, middle = found.size - 1, found.size // 2
    ends = {0: [], 1: [middle], 2: sorted({middle, last})}
    compared = ends[asked.unreduced] if asked.unreduced in ends else spread(found.size, asked.unreduced)
    return Positions(found, np.array(sorted({middle, last})), np.array(compared, dtype=np.int64))


def _way_of_train(study: Study) -> tuple[float, float]:
    """The same of a first axle, on beyond its body until the last axle of its train has left; else `way_of`."""
    (low, high), (name, carriage) = way_of(study), first_carriage(study)
    own = [axle for axle, train in study.axles.items() if train == study.axles.get(name)]
    behind = max((study.carriage[axle].headway or 0.0 for axle in own), default=0.0)
    start, end = (float(carriage.motion.path(tau).S) for tau in (0.0, carriage.motion.duration))
    return (low, high + behind) if end > start else (low - behind, high)


def way_of(study: Study) -> tuple[float, float]:
    """Ends of the first carriage's way, as far as it stands on its body with all its contacts, m. For a list of
    positions that is all that its body allows. Raises BadInput where there is no such part."""
    name, carriage = first_carriage(study)
    rides, lengths = carriage.riding_body, [float(study.value(f"body.{body}.length")) for body in carriage.ridden]
    ahead = carriage.contact_offsets(0.0 if rides is None else float(study.value(f"body.{rides}.length")))
    low, high = 0.0 - min(ahead), min(length - offset for length, offset in zip(lengths, ahead, strict=True))
    free = f"{low:.6g} to {high:.6g} m"
    if not isinstance(study.question.get("positions"), list | tuple):
        first, last = carriage.motion.range()
        low, high = max(low, first), min(high, last)
    if not low < high:
        what = "the carriage never stands on its body with all its contacts"
        raise study.source.fault(f"carriage.{name}.motion", what, expected=f"a way with a part within {free}")
    return low, high


def check_mode_counts(study: Study, asked: Asked) -> None:
    """Refuse numbers of modes that a body does not take. Raises BadInput."""
    for count in asked.mode_counts:
        try:
            with_modes(study, count, CORRECTED[0])
        except BadInput as error:
            what = f"with {count} modes: {error.what}"
            raise study.source.fault("question.mode_counts", what, expected=error.expected) from None


def with_modes(study: Study, count: int, others: Mapping[str, Any]) -> Study:
    """The scene without sweep with so many modes of every body, and other values at dotted keys."""
    return study.without_sweep().with_values({**{f"body.{name}.modes": count for name in study.body}, **others})


def all_positions(model: SceneModel, positions: Array) -> Array:
    """(S, C) places of all carriages in m, the first one at `positions`, the other axles of its train behind it, the
    others where they start."""
    return np.stack([in_row(model, carriage.name, positions) for carriage in model.carriages], axis=1)
