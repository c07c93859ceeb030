"""What every variant was computed with and its errors: pictures and sentences, from numbers that are put in here."""

import warnings
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr

from results_schema.store.archive import SCHEMA_VERSION, write_archive
from results_schema.variables import axes as coordinates
from results_schema.variables import declarations
from studies.findings.numerics_used import told_choices
from studies.pictures.common import estimates, figures
from studies.pictures.common import numerics_used as choice
from studies.pictures.common.figures import BLUE, MUTED, Figure
from studies.reporting.report import write_report
from studies.results.results import Results
from tests.pictures.test_figures import sweeps
from tests.pictures.test_report import check_standing_alone, plain
from tests.studies import at_rest, scenes

SPEEDS = 'pace = { of = "carriage.table.motion.speed", values = [6, 2, 4] }'
MASSES = 'mass = { of = "carriage.table.mass", values = [10, 20] }'
DAMPING = 'zeta = { of = "body.bed.damping_ratio", values = [0.01, 0.05] }'
MODELS = [[0, 1], [3, 3], [0, 3]]  # over speeds 6, 2, 4 and masses 10, 20
MODES = [[0, 4], [8, 8], [0, 10]]
STEPS = [[0, 400], [800, 800], [0, 1600]]
WORK = [[0.0, 1600.0], [6400.0, 6400.0], [0.0, 16000.0]]
ERRORS = [[6e-4, 8e-4], [4e-4, np.nan], [2e-4, 5e-4]]
KNOWN = {"fidelity_used": MODELS, "modes_used": MODES, "steps_used": STEPS, "work": WORK, "error_estimate": ERRORS}


KEPT = ("modes_used", "steps_used", "error_estimate")  # which every march has


def put(dataset: xr.Dataset, **known: Any) -> xr.Dataset:
    """The dataset with these numbers of every variant, others of their kind taken out, and no errors of results."""
    status = dataset["status"]
    bare = dataset.drop_vars([name for name in KNOWN if name in dataset and name not in KEPT])
    mass = dataset["fidelity_used"].copy(data=np.full(status.shape, 3, dtype=np.int8))
    bare = bare.assign(fidelity_used=mass).drop_dims("result")
    whole = {name: np.asarray(values).astype(dataset[name].dtype) for name, values in known.items()}
    return bare.assign({name: dataset[name].copy(data=values) for name, values in whole.items()})


def put_errors(dataset: xr.Dataset, tolerances: dict[str, float], errors: Any) -> xr.Dataset:
    """The dataset with errors (..., R) of results, and their tolerances."""
    declared = {variable.name: variable.attributes() for variable in declarations("march")}
    result = "result", list(tolerances), coordinates()["result"].attributes()
    own = xr.Dataset(coords={"result": result})
    dims, values = (*dataset["status"].dims, "result"), np.asarray(errors, dtype=np.float32)
    own["estimated_error"] = dims, values, declared["estimated_error"]
    own["tolerance"] = "result", list(tolerances.values()), declared["tolerance"]
    return dataset.drop_dims("result", errors="ignore").assign(own)


def random(dataset: xr.Dataset, seed: int = 4) -> xr.Dataset:
    """The same with random numbers, some of them unknown."""
    draw, shape = np.random.default_rng(seed), dataset["status"].shape
    models = draw.choice([0, 2, 3], shape)
    modes, steps = (models > 0) * draw.integers(1, 20, shape), (models > 0) * draw.choice([200, 400, 800], shape)
    errors = np.where(draw.random((*shape, 3)) < 0.1, np.nan, 1e-3 * draw.random((*shape, 3)))
    found = put(dataset, fidelity_used=models, modes_used=modes, steps_used=steps, work=modes * steps)
    return put_errors(found, {"a": 1e-3, "b": 5e-4, "c": np.nan}, errors)


@pytest.fixture(scope="module")
def plane() -> xr.Dataset:
    """Three speeds, which do not ascend, and two masses."""
    return scenes.run("passage", f"{SPEEDS}\n{MASSES}")


def drawn(dataset: xr.Dataset) -> dict[str, Figure]:
    """The pictures of the choice by name."""
    results = Results.of(dataset)
    return {figure.name: figure for figure in (*choice.pictures(results), *estimates.pictures(results))}


def legend_of(axes: Any) -> dict[str, Any]:
    handles, labels = axes.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))


def test_sentences_count_models_with_what_they_took(plane: xr.Dataset) -> None:
    dataset = put_errors(put(plane, **KNOWN), {"midspan_max": 1e-3}, np.zeros((3, 2, 1)))
    assert told_choices(Results.of(dataset)) == [
        "2 of 6 variants: statics, estimated error at most 6e-4; 1: moving force, 4 modes, 400 steps, estimated error "
        "at most 8e-4; 3: moving mass, 8 to 10 modes, 800 to 1,600 steps, estimated error at most 5e-4, 1 without an "
        "estimate.",
        "On average a variant took 5,067 modes × steps over a passage or cycle; half of them 4,000 or fewer.",
    ]
    told_only = put_errors(dataset, {"table_contact_force_max": np.nan}, np.zeros((3, 2, 1)))
    assert "without" not in told_choices(Results.of(told_only))[0]
    cheap = put(plane, work=[[0, 0], [0, 0], [3000, 3000]])
    assert told_choices(Results.of(cheap))[1].endswith("; half of them marched nothing.")


@pytest.mark.parametrize("kind", at_rest.KINDS)
def test_kinds_that_do_not_march_say_nothing_of_it(kind: str) -> None:
    dataset = at_rest.run(kind)
    assert told_choices(Results.of(dataset)) == [] and drawn(dataset) == {}


@pytest.mark.parametrize(
    ("kind", "shape"),
    [*(("passage", shape) for shape in sweeps("passage")), *((kind, "two axes") for kind in scenes.MOTIONS)],
)
def test_any_sweep_can_be_drawn(kind: str, shape: str) -> None:
    dataset = random(scenes.run(kind, sweeps(kind)[shape]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = drawn(dataset)
        texts = [figures.svg(figure) for figure in found.values() if shape in ("sampled", "mixed")]
    assert list(found) == ([] if shape in ("none", "one value") else ["choice", "estimates"])
    for text in texts:
        assert "nan" not in ElementTree.tostring(ElementTree.fromstring(text), "unicode")


def test_what_is_the_same_everywhere_is_told_and_not_drawn(plane: xr.Dataset) -> None:
    figure = drawn(put(plane, modes_used=np.full((3, 2), 12), steps_used=STEPS))["choice"]
    assert figure.caption == "Steps of every variant shown. All: moving mass and 12 modes."
    alike = put(plane, modes_used=np.full((3, 2), 12), steps_used=np.full((3, 2), 400), work=np.full((3, 2), 4800))
    assert drawn(alike) == {}


def rows_of(figure: Figure) -> dict[str, tuple[str, list[float], float]]:
    """Colour, smallest, median and largest error, and tolerance of every result of the picture of errors."""
    (axes,) = figure.drawing.axes
    lines = iter(axes.get_lines())
    found = {}
    for label in axes.get_yticklabels():
        span, middle, tolerance = next(lines), next(lines), next(lines)
        sizes = [span.get_xdata()[0], middle.get_xdata()[0], span.get_xdata()[1]]
        found[label.get_text()] = span.get_color(), [float(size) for size in sizes], float(tolerance.get_xdata()[0])
    return found


def test_errors_stand_beside_their_tolerances_the_nearest_first(plane: xr.Dataset) -> None:
    errors = np.array([[1e-4, 3e-3, np.nan, 0.5], [2e-4, 4e-3, np.nan, 0.2], [9e-4, 1e-3, np.nan, 0.1]])
    tolerances = {"a": 1e-3, "b": 1e-2, "unknown": 1e-3, "told": np.nan}
    dataset = put_errors(plane, tolerances, np.stack([errors, errors], axis=1))
    figure = drawn(dataset)["estimates"]
    assert figure.title == "All estimated errors that have a tolerance are within it; a comes nearest, at 90 %"
    found = rows_of(figure)
    assert list(found) == ["a", "b", "told"]
    np.testing.assert_allclose(found["a"][1], [1e-4, 2e-4, 9e-4], rtol=1e-6)
    np.testing.assert_allclose(found["told"][1], [0.1, 0.2, 0.5], rtol=1e-6)
    assert [row[0] for row in found.values()] == [BLUE, BLUE, MUTED]
    assert [found["a"][2], found["b"][2]] == [1e-3, 1e-2] and np.isnan(found["told"][2])
    assert figure.caption.endswith("3 of 4 results. Without an estimate of some: 6 variants.")


def test_the_title_says_what_may_be_missed(plane: xr.Dataset) -> None:
    errors = np.full((3, 2, 1), 5e-4)
    errors[0, 0] = 2.5e-3
    title = drawn(put_errors(plane, {"a": 1e-3}, errors))["estimates"].title
    assert title == "a may miss its tolerance in 17 % of the variants, 2.5 times at most"
    told = drawn(put_errors(plane, {"a": np.nan}, errors))["estimates"]
    assert told.title == "No result is held to a tolerance"
    assert "estimates" not in drawn(put_errors(plane, {"a": 1e-3}, np.full((3, 2, 1), np.nan)))


def group(told: Any, observed: Any, tolerances: dict[str, float]) -> xr.Dataset:
    """An audit of some variants; told, observed (variants, results)."""
    count = len(told)
    values = {
        "estimated_error": np.array(told),
        "observed_error": np.array(observed),
        "tolerance": np.array(list(tolerances.values())),
        "tolerance_asked": np.ones(count),
        "left_out": np.array(0),
        "variant_status": np.zeros(count, dtype=np.int8),
    }
    declared = {variable.name: variable for variable in declarations("/audit")}
    names = {"sample": np.arange(count), "result": list(tolerances)}
    return xr.Dataset(
        {name: (declared[name].dims, data, declared[name].attributes()) for name, data in values.items()},
        coords={name: (name, data, coordinates()[name].attributes()) for name, data in names.items()},
    )


def test_told_against_observed_is_honest_about_what_has_no_place() -> None:
    nan = np.nan
    found = group(
        [[4e-4, 2e-4], [0.0, nan], [5e-4, 1e-2]], [[2e-4, 6e-4], [1e-4, 3e-4], [nan, 1e-3]], {"a": 1e-3, "b": nan}
    )
    (figure,) = estimates.compared(found)
    assert figure.title == "2 of 4 audited numbers are further off than estimated"
    assert figure.caption == (
        "3 variants, a dot for every reported number; below the line its estimate was large enough. Worst above it: "
        "a, 100 times its estimate. Not drawn: 2 numbers without one of both."
    )
    (axes,) = figure.drawing.axes
    assert axes.get_ylim() == axes.get_xlim() and axes.get_xlim()[0] < estimates.LEAST < axes.get_xlim()[1]
    lines = legend_of(axes)
    assert set(lines) == {"equal", "tolerance", "held to a tolerance", "not held"}
    np.testing.assert_allclose(lines["equal"].get_xdata(), lines["equal"].get_ydata())
    np.testing.assert_allclose(lines["held to a tolerance"].get_data(), [[4e-4, estimates.LEAST], [2e-4, 1e-4]])
    np.testing.assert_allclose(lines["not held"].get_data(), [[2e-4, 1e-2], [6e-4, 1e-3]])
    np.testing.assert_allclose(lines["tolerance"].get_ydata(), 1e-3)


def test_the_report_has_them_all(plane: xr.Dataset, tmp_path: Path) -> None:
    attributes = {"Conventions": "CF-1.11", "history": "made by a test", "schema_version": SCHEMA_VERSION}
    dataset = put(plane, **KNOWN).assign_attrs(attributes)
    dataset = put_errors(dataset, {"midspan_max": 1e-3, "moment_max": 1e-3}, np.full((3, 2, 2), 5e-4))
    told, observed = ([[first, 5e-4] for first in errors] for errors in ([6e-4, 8e-4, 5e-4], [5e-4, 9e-4, 1e-4]))
    audit = group(told, observed, {"midspan_max": 1e-3, "moment_max": 1e-3}).assign_coords(
        {
            "pace": ("sample", [6.0, 6.0, 4.0], dataset["pace"].attrs),
            "mass": ("sample", [10.0, 20.0, 20.0], dataset["mass"].attrs),
        }
    )
    write_archive(tmp_path / "study.nc", dataset, {"/audit": audit})
    page = write_report(tmp_path / "study.nc", tmp_path / "out")
    reader = check_standing_alone(page.read_text(encoding="utf-8"))
    for figure in (*drawn(dataset).values(), *estimates.compared(audit)):
        assert plain(figure.title) in plain(reader.text) and plain(figure.caption) in plain(reader.text)
        assert len(list(page.parent.glob(f"*-{figure.name}.png"))) == 1
    for sentence in told_choices(Results.of(dataset)):
        assert sentence in reader.text
