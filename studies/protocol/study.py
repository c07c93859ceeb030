"""What a kind of study is, where the kinds are found, and how a study is run."""

from __future__ import annotations

import pkgutil
import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from results_schema.errors import BadInput, Remark, did_you_mean
from results_schema.lazy_imports import xr
from results_schema.registry import ABSENT, Pieces, by_other_names, lacks, no_row_of
from results_schema.validate import validate
from studies.protocol.checksum import VALUES, checksum_of_values
from studies.protocol.library import find_study
from studies.protocol.listener import NOBODY, Listener
from studies.protocol.parts import Foreseen, TextTable, Took, Variants, Work
from studies.protocol.store import Memory

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from engine.observation.cycle_reduction import Reduction
    from engine.scene.study import Study
    from engine.study_file.spec import Spec
    from results_schema.arrays import Array, Counts
    from studies.pictures.common.figures import Figure
    from studies.protocol.parts import Parts, Piece
    from studies.results.places import Index
    from studies.results.results import Results

    AnySpec = TypeVar("AnySpec", bound=Spec)
else:
    AnySpec = TypeVar("AnySpec")

KINDS_FOLDER = Path(__file__).parents[1] / "kinds"


class Kind:
    """One kind of question about a scene and its sweep: how its work is cut into parts, what they become together, and
    the answer in sentences and figures. What a kind leaves out is as here: all variants are marched. A module in
    `studies/kinds` has one as its attribute KIND, and declares its results; another package names its own by an entry
    point.

    name: as in the study file. summary: one line. question: what its report says was asked, one sentence. settings: the
    class of its table [question], None where it has none. names_limits: whether that has limits of what sensors read.
    sweeps: whether it takes a [sweep], whose grid is then that of its results; else it measures, and a method that
    fails, by blowing up say, is an answer and no failure of the run. moves_frames: whether frames of bodies may move,
    and carriages slide by themselves. moves_robots: whether robots move. drawn_by: the module whose `pictures` makes
    its figures of the results. start: a study file to start from, of a kind of another package.
    """

    name: str
    summary: str
    question: str
    settings: type[Spec] | None = None
    names_limits = False
    sweeps = True
    drawn_by = ""
    moves_frames = False
    moves_robots = False
    start: str

    def check(self, study: Study) -> None:
        """Refuse a scene that does not suit the kind. Raises BadInput; nothing large is computed."""

    def check_tables(self, study: Study) -> None:
        """Refuse a table [question], or options in it, that the kind does not know, and names that results of the kind
        have. Raises BadInput."""
        if self.settings is not None:
            question_of(study, self.settings)
        elif study.question:
            what, received = f"studies of the kind {self.name} have no options", f"the keys {', '.join(study.question)}"
            raise study.source.fault("question", what, expected="no table [question]", received=received)
        study.results(study.kind)

    def parts(self, study: Study) -> Parts:
        """The work. Raises BadInput where it cannot be done."""
        if not study.output.keeps_variants:
            from studies.protocol.cells import ReducedVariants

            return ReducedVariants(self, study)
        return Variants(self, study)

    def reduction(self, study: Study) -> Reduction | None:
        """What to compute from the histories of each chunk of variants; None where extremes are enough."""
        return None

    def summarise(self, dataset: xr.Dataset, study: Study) -> xr.Dataset:
        """The march's dataset, of all variants or of some along `variant`, with the study's own results of each."""
        return dataset

    def along(self, results: Results) -> Mapping[str, tuple[Sequence[str], NDArray[Any], Mapping[str, Any]]]:
        """Coordinates over axes of the sweep: dimensions, values and attributes by name."""
        return {}

    def coordinates(self, study: Study) -> Mapping[str, NDArray[Any]]:
        """The coordinates that follow from the table [question]."""
        return {}

    def findings(self, results: Results) -> list[str]:
        """The answer in sentences, the most important first; every number comes from the data."""
        return []

    def missed(self, results: Results) -> list[str]:
        """Which of its findings say what missed its tolerance, so that no line on that status does."""
        return []

    def named(self, results: Results) -> Sequence[Index]:
        """The variants that the answer names: their histories are kept whichever others are."""
        return []

    def figures(self, results: Results) -> list[Figure]:
        """The figures of the report, the most important first."""
        return import_module(self.drawn_by).pictures(results) if self.drawn_by else []


class PiecedKind(Kind, ABC):
    """A kind that is computed in pieces of its own instead of by a march of variants.

    audit_seconds: of an audited variant, over those of one in a run; 0 where none is audited.
    """

    sweeps = False
    audit_seconds = 0.0
    instead: Mapping[str, str] = {}  # of keys of [output] that it does not take: what it tells in their place

    def check_tables(self, study: Study) -> None:
        if study.sweep.axes and not self.sweeps:
            raise study.source.fault(
                "sweep",
                f"a study of the kind {self.name} takes no sweep: it varies methods, not the scene",
                expected="no table [sweep]",
                received=f"the axes {', '.join(study.sweep.axes)}",
                remedy="what it varies stands in the table [question]",
            )
        if not study.output.keeps_variants:
            what = f"studies of the kind {self.name} are not marched by variants that could be reduced"
            raise study.source.fault("output.keep", what, expected='"all"', received=study.output.keep)
        for key, of in (("residual", "residual vibration"), ("times", "times of extremes by this key")):
            if getattr(study.output, key):
                what, remedy = f"studies of the kind {self.name} tell no {of}", self.instead.get(key, "")
                raise study.source.fault(f"output.{key}", what, expected="false", received="true", remedy=remedy)
        if study.envelope:
            what, expected = f"studies of the kind {self.name} have no envelopes", "no table [envelope]"
            raise study.source.fault("envelope", what, expected=expected, received=", ".join(study.envelope))
        super().check_tables(study)

    def parts(self, study: Study) -> Parts:
        from studies.protocol import parts

        return parts.Pieces(self, study)

    def remarks(self, study: Study) -> Sequence[str]:
        """What a user should know before believing the study."""
        return ()

    def tables(self, study: Study) -> Iterable[TextTable]:
        """What `check` shows of the scene beside its bodies and its sweep."""
        return ()

    def foreseen(self, study: Study, threads: int, audited: int) -> Foreseen | None:
        """What a run on so many threads will take, with an audit of some variants, as some seconds of it show; None
        where its pieces tell that."""
        return None

    def took(self, dataset: xr.Dataset) -> Took | None:
        """What results took and what an audit would, by what variants were computed with; None where that is known
        beforehand."""
        return None

    def again(self, study: Study, variants: Counts, work: Work) -> Mapping[int, tuple[Array, Array] | None]:
        """Some variants computed again, with more of what the study leaves open: the error observed and that told of
        every result (R,), of each; None where there is nothing to compare. Raises Halted."""
        return {}

    @abstractmethod
    def pieces(self, study: Study) -> Sequence[Piece]:
        """The work, always the same for the same study; nothing large is computed."""

    @abstractmethod
    def gather(self, pieces: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
        """The study's dataset from the datasets of all pieces by name."""


def question_of(study: Study, settings: type[AnySpec]) -> AnySpec:
    """The table [question] of a study, validated. Raises BadInput with the dotted key.

    >>> import engine
    >>> from engine.study_file.spec import Spec
    >>> class Counts(Spec):
    ...     modes: int = 3
    >>> question_of(engine.Study(kind="passage", question={"modes": 5}), Counts).modes
    5
    """
    from pydantic import ValidationError

    from engine.study_file.refusals import refuse

    data, whole = {"question": study.question}, _with_question(settings)
    try:
        return whole.model_validate(data).question  # type: ignore[attr-defined, no-any-return]
    except ValidationError as error:
        refuse(error, whole, data, study.source)


@cache
def _with_question(settings: type[Spec]) -> type[Spec]:
    """What has a table [question] of such settings alone, as its faults are told with their dotted keys."""
    from pydantic import create_model

    from engine.study_file.spec import Spec

    return create_model("Whole", __base__=Spec, question=(settings, ...))


KIND_HAS = ("name", "summary", "question", "start")  # those of another package


class _OwnKinds(Mapping[str, Kind]):
    """The kinds of the folder of kinds, each imported when it is asked for."""

    def __getitem__(self, name: str) -> Kind:
        if name not in self._names:
            raise KeyError(name)
        kind: Kind = import_module(f"studies.kinds.{name.replace('-', '_')}").KIND
        return kind

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
KINDS: Pieces[Kind] = Pieces(
    group="wanderlast.kinds",
    noun="kind of study",
    own=_OwnKinds(),
    wanted=f"an object of a class made of studies.protocol.study.Kind with {', '.join(KIND_HAS)}",
    missing=lambda kind: no_row_of(Kind)(kind) or lacks(*KIND_HAS)(kind),
)

#: What others call a kind of study.
MEANT = by_other_names(
    ("passage", "moving-load moving-loads moving-mass crossing"),
    ("eigenfrequencies", "modal modes eigen frequencies"),
    ("trajectory", "transient dynamic time-history"),
    ("influence", "static statics"),
)


def kind_names() -> tuple[str, ...]:
    """The kinds of study that there are."""
    return tuple(sorted(KINDS))


def kind_named(name: str, where: str = "kind") -> Kind:
    """The kind of that name; its results are declared from then on. Raises BadInput for an unknown one."""
    if name not in KINDS:
        known = kind_names()
        remedy = did_you_mean(MEANT.get(name, name), known) or ABSENT
        expected = f"one of {', '.join(known)}"
        raise BadInput("unknown kind of study", where=where, expected=expected, received=repr(name), remedy=remedy)
    return KINDS[name]


def kind_of(study: Study) -> Kind:
    """The kind of a study, after its check. Raises BadInput."""
    from engine.model.refusals import check_stands

    kind = kind_named(study.kind, study.source.where("kind"))
    if not kind.moves_frames:
        check_stands(study)
    if study.robot and not kind.moves_robots:
        what = f"no robots move in studies of the kind {study.kind}"
        raise study.source.fault("robot", what, expected='kind = "portal"')
    kind.check_tables(study)
    kind.check(study)
    return kind


def run(study: Study | str | Path, **options: Any) -> xr.Dataset:
    """Run a study, that of a file, or the built-in one of a name, in memory: the dataset of its archive. Raises
    BadInput; what is allowed and yet often a mistake is a warning, a `Remark`; that kernels are compiled is logged to
    "wanderlast".

    options: progress and chunk, and where to run, as of `engine.run`. Meanwhile numpy's linear algebra keeps to one
    thread in the whole process.
    """
    from engine.batch.executors import Where, check_chunk, check_options
    from engine.kernels.compiling import told_of_compiling
    from engine.scene.study import study_of

    started = time.perf_counter()
    check_options(options, "progress", "chunk")
    check_chunk(options.get("chunk"))
    study = study_of(find_study(study) if isinstance(study, str) and "\n" not in study else study)
    parts, store = kind_of(study).parts(study), Memory()
    parts.check_memory()
    for remark in parts.remarks:
        warnings.warn(remark, Remark, stacklevel=2)
    where: Any = {key: options.pop(key) for key in Where.__annotations__ if key in options}
    with told_of_compiling(), parts.place(where) as here:
        progress = options.get("progress")
        listener = NOBODY if progress is None else Listener(progress)
        parts.compute(store, Work(place=here, listener=listener, chunk=options.get("chunk")))
    found = compared(parts.gather(store), study)
    seconds = round(time.perf_counter() - started, 3)
    return found.assign_attrs({"run_seconds": seconds, VALUES: checksum_of_values(found)})


def compared(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """A study's results with units of sensors and the study's attributes, compared with the declarations.

    Raises ArchiveError where the two differ.
    """
    if "sensor" in dataset.dims:
        units = ("sensor", list(study.sensor_units.values()), {"long_name": "unit of the sensor"})
        dataset = dataset.assign_coords(sensor_unit=units)
    missing = {key: value for key, value in study_attributes(study).items() if key not in dataset.attrs}
    dataset = dataset.assign_attrs(missing)
    validate(dataset, study.kind, study.results(study.results_kind))
    return dataset


def study_attributes(study: Study) -> Mapping[str, str]:
    """What a dataset says of the study it came from."""
    return {
        "title": study.title or study.kind,
        "study_kind": study.kind,
        "study": study.source.text,
        "study_sha256": study.source.sha256,
    }
