"""Studies without a march's plan, computed piece by piece: those that measure methods instead of answering about one
scene, which take no sweep, and those that compute a scene and its sweep in another way.

Each finished piece is stored beside the archive, so a killed run goes on from there. What a method does wrong, such as
blowing up, is the answer of such a study and no failure of the run.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

from results_schema.errors import BadInput, Interrupted

if TYPE_CHECKING:
    import xarray as xr

    from engine.scene.study import Study
    from engine.study_file.spec import Spec
    from results_schema.variables import Variable
    from studies.pictures.common.figures import Figure
    from studies.protocol.stopping import Stop
    from studies.results.results import Results

    AnySpec = TypeVar("AnySpec", bound=Spec)
else:
    AnySpec = TypeVar("AnySpec")

WAIT_SECONDS = 0.05  # between looks at the request to stop
PIECES_BYTES = 64 * 2**20  # more than what studies that measure leave on the disk
GRACE_SECONDS = 1.0  # for a piece to end by itself after it


class Work:
    """How pieces are computed: on how many threads, and whether somebody has asked to stop."""

    def __init__(self, threads: int | None = None, stop: Stop | None = None) -> None:
        import os

        from studies.protocol.stopping import Stop

        self.threads = threads or os.cpu_count() or 1
        self.stop = stop or Stop()

    def halted(self) -> bool:
        """Whether somebody has asked to stop; as the `halted` of `engine.march.march.march`."""
        return self.stop.event.is_set()

    def check(self) -> None:
        """Raise Interrupted if somebody has asked to stop."""
        self.stop.check()


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a study's work, about 1 to 20 s of it, which depends on no other piece.

    name: small letters, digits and dashes, unique in its study. words: what it does. seconds: expected on two cores.
    size: bytes on the disk, where they are many.
    """

    name: str
    words: str
    compute: Callable[[Work], xr.Dataset]
    seconds: float = field(default=1.0)
    size: int = 0


@runtime_checkable
class MeasuringKind(Protocol):
    """A kind of study that is computed in pieces. settings: the class of its table [question].

    name, summary, question: as of every kind (see `studies.protocol.study.Kind`). sweeps: whether it takes a [sweep],
    whose grid is then that of its results; else it measures, and a method that fails is an answer.
    """

    name: str
    summary: str
    question: str
    settings: type[Spec]
    sweeps: bool

    def check(self, study: Study) -> None:
        """Refuse a scene that does not suit the kind; [question] and [sweep] are checked before. Raises BadInput."""

    def pieces(self, study: Study) -> Sequence[Piece]:
        """The work, always the same for the same study; nothing large is computed."""

    def gather(self, pieces: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
        """The study's dataset from the datasets of all pieces by name."""

    def findings(self, results: Results) -> list[str]:
        """The answer in sentences, the most important first; every number comes from the data."""

    def figures(self, results: Results) -> list[Figure]:
        """The figures of the report, the most important first."""


def question_of(study: Study, settings: type[AnySpec]) -> AnySpec:
    """The table [question] of a study, validated. Raises BadInput with the dotted key.

    >>> import engine
    >>> from engine.study_file.spec import Spec
    >>> class Counts(Spec):
    ...     modes: int = 3
    >>> question_of(engine.Study(kind="passage", question={"modes": 5}), Counts).modes
    5
    """
    from pydantic import ValidationError, create_model

    from engine.study_file.spec import Spec, refuse

    data = {"question": study.question}
    whole = create_model("Whole", __base__=Spec, question=(settings, ...))
    try:
        return whole.model_validate(data).question  # type: ignore[attr-defined, no-any-return]
    except ValidationError as error:
        refuse(error, whole, data, study.source)


def check_measurable(study: Study, kind: MeasuringKind) -> None:
    """Refuse a sweep where there can be none, envelopes, names that the results have, and a table [question] that the
    kind does not understand. Raises BadInput."""
    if study.sweep.axes and not kind.sweeps:
        raise BadInput(
            f"a study of the kind {kind.name} takes no sweep: it varies methods, not the scene",
            where=study.source.where("sweep"),
            expected="no table [sweep]",
            received=f"the axes {', '.join(study.sweep.axes)}",
            remedy="what it varies stands in the table [question]",
        )
    if study.envelope:
        raise BadInput(
            f"studies of the kind {kind.name} have no envelopes",
            where=study.source.where("envelope"),
            expected="no table [envelope]",
            received=", ".join(study.envelope),
        )
    question_of(study, kind.settings)
    if kind.sweeps:
        _check_names(study, kind)


def _check_names(study: Study, kind: MeasuringKind) -> None:
    """Refuse names of sensors, carriages and axes that the kind's own results have."""
    from results_schema.variables import expand, sensor_unit

    units = {name: sensor_unit(sensor.quantity) for name, sensor in study.sensor.items()}
    try:
        declared = expand(kind.name, units, tuple(study.carriage))
    except BadInput as error:
        raise BadInput(error.what, where=study.source.where(error.where), remedy=error.remedy) from None
    for name in study.sweep.axes:
        if name in declared:
            where = study.source.where(f"sweep.{name}")
            raise BadInput("a result has this name", where=where, remedy="choose another name for the axis")


def disk_bytes(pieces: Sequence[Piece]) -> int:
    """Upper bound of what pieces and their archive take on the disk."""
    return PIECES_BYTES + 2 * sum(piece.size for piece in pieces)


def measure(
    pieces: Sequence[Piece],
    work: Work,
    *,
    done: Mapping[str, xr.Dataset] | None = None,
    keep: Callable[[str, xr.Dataset], object] = lambda name, found: None,
    progress: Callable[[int, int], object] = lambda finished, total: None,
) -> dict[str, xr.Dataset]:
    """Compute all pieces that are not done, one after another, and hand each finished one to `keep`.

    Raises Interrupted where somebody asks to stop, and what a piece or `keep` raises.
    """
    found = {piece.name: (done or {})[piece.name] for piece in pieces if piece.name in (done or {})}
    progress(len(found), len(pieces))
    for piece in pieces:
        if piece.name in found:
            continue
        found[piece.name] = _apart(piece, work)
        keep(piece.name, found[piece.name])
        progress(len(found), len(pieces))
    return {piece.name: found[piece.name] for piece in pieces}


def _apart(piece: Piece, work: Work) -> xr.Dataset:
    """Compute a piece on a thread of its own, so that a request to stop is heard while the piece is in a kernel."""
    outcome: list[Any] = []

    def compute() -> None:
        try:
            outcome.append(piece.compute(work))
        except BaseException as error:
            outcome.append(error)

    work.check()
    worker = threading.Thread(target=compute, daemon=True)
    worker.start()
    while worker.is_alive() and not work.halted():
        worker.join(WAIT_SECONDS)
    if work.halted():
        worker.join(GRACE_SECONDS)
        work.check()
    (found,) = outcome
    if isinstance(found, Interrupted):
        work.check()
    if isinstance(found, BaseException):
        raise found
    return found  # type: ignore[no-any-return]


def described(variable: Variable, dims: Sequence[str], values: Any) -> tuple[tuple[str, ...], Any, dict[str, Any]]:
    """Dimensions, values in the declared type, and attributes of one declared variable, as a dataset takes them."""
    import numpy as np

    array = np.asarray(values)
    return tuple(dims), array if variable.dtype == "str" else array.astype(variable.dtype), variable.attributes()


def usual(dims: Sequence[str], **values: Any) -> dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]]:
    """What every kind has, over the kind's own grid: status, fidelity, modes and steps, all four of the same shape."""
    from results_schema.variables import declarations

    names = {"status": "status", "fidelity": "fidelity_used", "modes": "modes_used", "steps": "steps_used"}
    declared = {variable.name: variable for variable in declarations("*")}
    return {names[key]: described(declared[names[key]], dims, value) for key, value in values.items()}
