"""What a dataset that a user gives must be, so that a study's own sentences, errors and figures can be made of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from results_schema.errors import BadInput, shortened
from results_schema.lazy_imports import xr

if TYPE_CHECKING:
    from engine.scene.study import Study
    from studies.results.results import Results

ENDS = ("_max", "_min")  # of results that are variables by their own names
WHOLE = "give the whole dataset and select from what comes of it, or run a study of these variants alone"


def taken(dataset: xr.Dataset) -> xr.Dataset:
    """A dataset that a user gives, without the fill values that xarray puts on coordinates when it writes files. Raises
    BadInput for what is no dataset of a study."""
    known = isinstance(dataset, xr.Dataset)
    if known and "study" in dataset.attrs and "status" not in dataset:
        what, remedy = "this dataset has lost the status of its variants", "drop no variable that sentences need"
        raise BadInput(what, where="status", expected="the dataset as studies.run gives it", remedy=remedy)
    if not known or "study" not in dataset.attrs:
        raise BadInput(
            "this does not hold the results of a study",
            where="dataset",
            expected="a dataset of studies.run, with its attributes",
            received=f"a dataset of {shortened(list(dataset.variables))}" if known else f"a {type(dataset).__name__}",
            remedy="studies.run(study) in place of engine.run(study), whose dataset is of the march alone"
            if known
            else "xarray.open_dataset(...) of an archive, or what studies.run gives",
        )
    found = dataset.copy()
    for name in found.coords:
        for place in (found.variables[name].attrs, found.variables[name].encoding):
            place.pop("_FillValue", None)
    return found


def check_whole(dataset: xr.Dataset, study: Study) -> None:
    """Raise BadInput for some of a study's variants, sensors or errors, or what was made of them: what is said is of
    all."""
    swept = study.sweep.axes if study.output.keeps_variants else {}
    if dataset["status"].dtype.kind != "i":
        raise _part("status")
    if swept and (renamed := [name for name in swept if name not in dataset.variables]):
        raise BadInput(
            "this dataset has lost a swept number of its study, or its name",
            where=renamed[0],
            expected=f"the coordinates {', '.join(swept)}",
            remedy="rename and drop only in what you draw or write yourself",
        )
    known = {str(dim) for name in swept for dim in dataset[name].dims}
    beside = set(dataset["status"].dims) - known if known else set()
    beside |= set(dataset["tolerance"].dims) - {"result"} if "tolerance" in dataset else set()
    if joined := sorted(map(str, beside)):
        raise BadInput(
            "this dataset joins the results of several studies, and a study's own sentences and figures are of one",
            where=joined[0],
            expected=f"the dimensions {', '.join(sorted(known))}" if known else "no such dimension",
            remedy="ask each of them, or sweep that number in one study",
        )
    for cut in _cut(dataset, study):
        raise _part(cut)


def check_named(results: Results) -> Results:
    """The results of one variant a number, as they are. Raises BadInput where one of which there are errors is gone, as
    by another name: sentences and figures are of all."""
    dataset = results.dataset
    told = map(str, dataset["result"].values) if "result" in dataset.coords else ()
    lost = [name for name in told if name.endswith(ENDS) and name not in dataset]
    if lost and results.study.output.keeps_variants:
        raise BadInput(
            "this dataset has lost a result of its study, or its name",
            where=lost[0],
            expected="all results that it has errors of",
            remedy="rename and drop only in what you draw or write yourself",
        )
    return results


def _part(cut: str) -> BadInput:
    what = "this dataset holds a part of its study's results, or what was computed from them"
    return BadInput(what, where=cut, expected="the dataset of a whole study", remedy=WHOLE)


def _cut(dataset: xr.Dataset, study: Study) -> Iterator[str]:
    """What a selection has left a part of: swept numbers, sensors, or results that have errors."""
    for name, axis in (study.sweep.axes if study.output.keeps_variants else {}).items():
        if axis.size != dataset[name].size or not dataset[name].ndim:
            yield name
    for name in ("sensor", "result"):
        if name in dataset.coords and not dataset[name].ndim:
            yield name
    if "sensor_unit" in dataset and dataset["sensor"].ndim:
        left = set(map(str, dataset["sensor"].values))
        if left & set(study.sensor) and set(study.sensor) - left:
            yield "sensor"
