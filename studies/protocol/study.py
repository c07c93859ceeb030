"""What a kind of study is, where the kinds are found, and how a study is run."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from results_schema.errors import BadInput
from results_schema.pieces import Pieces, lacks
from studies.protocol.measuring import MeasuringKind, Work, check_measurable, measure

if TYPE_CHECKING:
    import xarray as xr

    from engine.observation.cycle_reduction import Reduction
    from engine.scene.study import Study
    from studies.pictures.common.figures import Figure
    from studies.results.results import Results

KINDS_FOLDER = Path(__file__).parents[1] / "kinds"


class Kind(Protocol):
    """One kind of question about one scene and its sweep. A module in `studies/kinds` has one as its attribute KIND,
    and declares its results; or it has a `studies.protocol.measuring.MeasuringKind`. Another package names its own by
    an entry point, and has a study file to start from as its attribute ``start``.

    name: as in the study file. summary: one line. question: what its report says was asked, one sentence.
    """

    name: str
    summary: str
    question: str

    def check(self, study: Study) -> None:
        """Refuse a scene that does not suit the kind. Raises BadInput; nothing large is computed."""

    def reduction(self, study: Study) -> Reduction | None:
        """What to compute from the histories of each chunk of variants; None where extremes are enough."""

    def summarise(self, dataset: xr.Dataset, study: Study) -> xr.Dataset:
        """The engine's dataset with the study's own results."""

    def findings(self, results: Results) -> list[str]:
        """The answer in sentences, the most important first; every number comes from the data."""

    def figures(self, results: Results) -> list[Figure]:
        """The figures of the report, the most important first."""


AnyKind = Kind | MeasuringKind
KIND_HAS = ("name", "summary", "question", "check", "findings", "figures")


class _OwnKinds(Mapping[str, AnyKind]):
    """The kinds of the folder of kinds, each imported when it is asked for."""

    def __getitem__(self, name: str) -> AnyKind:
        if name not in self._names:
            raise KeyError(name)
        return cast(AnyKind, import_module(f"studies.kinds.{name.replace('-', '_')}").KIND)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @cached_property
    def _names(self) -> list[str]:
        return sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules([str(KINDS_FOLDER)]))


#: The kinds of study that there are; a new one is one new file in the folder of kinds, or an entry point.
KINDS: Pieces[AnyKind] = Pieces(
    group="wanderlast.kinds",
    noun="kind of study",
    own=_OwnKinds(),
    wanted=f"an object with {', '.join(KIND_HAS)} and start",
    missing=lacks(*KIND_HAS, "start"),
)


def kind_names() -> tuple[str, ...]:
    """The kinds of study that there are."""
    return tuple(sorted(KINDS))


def kind_named(name: str, where: str = "kind") -> AnyKind:
    """The kind of that name; its results are declared from then on. Raises BadInput for an unknown one."""
    if name not in KINDS:
        known = kind_names()
        near = get_close_matches(name, known, n=1)
        remedy = f'did you mean "{near[0]}"?' if near else ""
        expected = f"one of {', '.join(known)}"
        raise BadInput("unknown kind of study", where=where, expected=expected, received=repr(name), remedy=remedy)
    return KINDS[name]


def is_measuring(name: str) -> bool:
    """Whether the kind of that name is computed in pieces, and not by a march. Raises BadInput for an unknown one."""
    return isinstance(kind_named(name), MeasuringKind)


def kind_of(study: Study) -> AnyKind:
    """The kind of a study, after its check. Raises BadInput."""
    kind = kind_named(study.kind, study.source.where("kind"))
    if isinstance(kind, MeasuringKind):
        check_measurable(study, kind)
    elif study.question:
        raise BadInput(
            f"studies of the kind {kind.name} have no options",
            where=study.source.where("question"),
            expected="no table [question]",
            received=f"the keys {', '.join(study.question)}",
        )
    kind.check(study)
    return kind


def run(study: Study, **options: Any) -> xr.Dataset:
    """Run a study in memory: the dataset of its archive. Raises BadInput.

    options: as of `engine.run`; of a study that measures only `threads` and `progress`.
    """
    from engine.batch.execution import run as march

    kind = kind_of(study)
    if isinstance(kind, MeasuringKind):
        work = Work(options.pop("threads", None))
        return gathered(measure(kind.pieces(study), work, **options), study)
    return finish(march(study, reduction=kind.reduction(study), results=kind.name, **options), study)


def finish(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """The study's own results added to the engine's dataset, all compared with the declarations.

    Raises ArchiveError where the two differ.
    """
    from results_schema.variables import expand
    from studies.results.results import envelope_units, sensor_units

    kind = kind_named(study.kind)
    assert not isinstance(kind, MeasuringKind)
    finished = kind.summarise(dataset, study)
    declared = expand(kind.name, sensor_units(study), tuple(study.carriage), envelope_units(study))
    # The engine offers static values to every summary; they are results only where the kind says so.
    offered = [f"{sensor}_static" for sensor in study.sensor]
    return _compared(finished.drop_vars([n for n in offered if n not in declared], errors="ignore"), study)


def gathered(pieces: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
    """The dataset of a study that measures from its finished pieces, compared with the declarations.

    Raises ArchiveError where the two differ.
    """
    kind = kind_named(study.kind)
    assert isinstance(kind, MeasuringKind)
    return _compared(kind.gather(pieces, study), study)


def _compared(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """With units of sensors and the study's attributes, and as declared."""
    from results_schema.validate import validate
    from studies.results.results import envelope_units, sensor_units

    if "sensor" in dataset.dims:
        units = ("sensor", list(sensor_units(study).values()), {"long_name": "unit of the sensor"})
        dataset = dataset.assign_coords(sensor_unit=units)
    missing = {key: value for key, value in study_attributes(study).items() if key not in dataset.attrs}
    dataset = dataset.assign_attrs(missing)
    validate(dataset, study.kind, sensor_units(study), tuple(study.carriage), envelope_units(study))
    return dataset


def study_attributes(study: Study) -> Mapping[str, str]:
    """What a dataset says of the study it came from."""
    return {
        "title": study.title or study.kind,
        "study_kind": study.kind,
        "study": study.source.text,
        "study_sha256": study.source.sha256,
    }
