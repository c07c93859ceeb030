"""What every variant took, cost and left out: pictures and sentences, from numbers that are put into datasets here."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_hex
from matplotlib.legend import Legend

from results_schema.archive import SCHEMA_VERSION, write_archive
from results_schema.status import Fidelity
from studies import figures
from studies.choices import ERROR, NAMES, PARTS, told_choices
from studies.console import show_outcome
from studies.figures import BLUE, Figure
from studies.pictures import choice, estimates
from studies.report import write_report
from studies.results import Results
from studies.runner import Outcome
from tests.studies import at_rest, scenes
from tests.studies.test_figures import sweeps
from tests.studies.test_report import check_standing_alone

SPEEDS = 'pace = { of = "carriage.table.motion.speed", values = [6, 2, 4] }'
MASSES = 'mass = { of = "carriage.table.mass", values = [10, 20] }'
DAMPING = 'zeta = { of = "body.bed.damping_ratio", values = [0.01, 0.05] }'
MODELS = [[0, 1], [3, 3], [0, 3]]  # over speeds 6, 2, 4 and masses 10, 20
MODES = [[0, 4], [8, 8], [0, 10]]
STEPS = [[0, 400], [800, 800], [0, 1600]]
COST = [[0.0, 0.05], [0.1, 0.3], [0.0, 0.15]]
STEP_PARTS = [[0.0, 1e-4], [3e-4, np.nan], [0.0, 4e-4]]
MODE_PARTS = [[0.0, 2e-4], [1e-4, 1e-4], [0.0, 1e-4]]
MODEL_PARTS = [[6e-4, 5e-4], [0.0, 0.0], [2e-4, 0.0]]
KNOWN = {
    "fidelity_used": MODELS,
    "modes_used": MODES,
    "steps_used": STEPS,
    "relative_cost": COST,
    "error_steps": STEP_PARTS,
    "error_modes": MODE_PARTS,
    "error_fidelity": MODEL_PARTS,
    "error_estimate": (np.array(STEP_PARTS) + MODE_PARTS + MODEL_PARTS).tolist(),
}


def put(dataset: xr.Dataset, **known: Any) -> xr.Dataset:
    """The dataset with these numbers of every variant, others of their kind taken out."""
    status = dataset["status"]
    known = {name: np.asarray(values) for name, values in known.items()}
    bare = dataset.drop_vars([name for name in KNOWN if name in dataset and name not in ("modes_used", "steps_used")])
    return bare.assign({"fidelity_used": status.copy(data=np.full(status.shape, 3))}).assign(
        {name: status.copy(data=values) for name, values in known.items()}
    )


def random(dataset: xr.Dataset, seed: int = 4) -> xr.Dataset:
    """The same with random numbers, some of them unknown."""
    draw, shape = np.random.default_rng(seed), dataset["status"].shape
    models = draw.choice([0, 2, 3], shape)
    parts = {name: np.where(draw.random(shape) < 0.1, np.nan, 1e-3 * draw.random(shape)) for name in PARTS}
    marched = models > 0
    return put(
        dataset,
        fidelity_used=models,
        modes_used=marched * draw.integers(1, 20, shape),
        steps_used=marched * draw.choice([200, 400, 800], shape),
        relative_cost=marched * draw.random(shape),
        error_estimate=sum(parts.values()),
        **parts,
    )


@pytest.fixture(scope="module")
def plane() -> xr.Dataset:
    """Three speeds, which do not ascend, and two masses."""
    return scenes.run("passage", f"{SPEEDS}\n{MASSES}")


def drawn(dataset: xr.Dataset) -> dict[str, Figure]:
    """The pictures of the choice by name."""
    results = Results.of(dataset)
    return {figure.name: figure for figure in (*choice.pictures(results), *estimates.pictures(results))}


def cells(axes: Any) -> dict[str, list[tuple[float, float]]]:
    """Middles of a map's coloured cells by their colour."""
    found: dict[str, list[tuple[float, float]]] = {}
    for mesh in (collection for collection in axes.collections if hasattr(collection, "get_coordinates")):
        corners = mesh.get_coordinates()
        middles = 0.25 * (corners[1:, 1:] + corners[:-1, 1:] + corners[1:, :-1] + corners[:-1, :-1])
        values = np.ma.masked_invalid(mesh.get_array())
        colours = mesh.to_rgba(values).reshape(*values.shape, 4)
        for place in np.argwhere(~np.ma.getmaskarray(values)):
            x, y = middles[tuple(place)]
            found.setdefault(to_hex(colours[tuple(place)]), []).append((round(float(x), 6), round(float(y), 6)))
    return {colour: sorted(places) for colour, places in found.items()}


def legend_of(axes: Any) -> dict[str, Any]:
    handles, labels = axes.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))


def test_sentences_count_models_with_what_they_took(plane: xr.Dataset) -> None:
    assert told_choices(Results.of(put(plane, **KNOWN))) == [
        "2 of 6 variants: statics, estimated error at most 6e-4; 1: moving force, 4 modes, 400 steps, estimated error "
        "at most 8e-4; 3: moving mass, 8 to 10 modes, 800 to 1,600 steps, estimated error at most 5e-4, 1 without an "
        "estimate.",
        "On average a variant took 10 % of the full model's modes × steps, checks included; half of them took 7.5 % "
        "or less.",
    ]
    cheap = put(plane, relative_cost=[[0, 0], [0, 0], [0.3, 0.3]])
    assert told_choices(Results.of(cheap))[1].endswith("; half of them marched nothing.")


def test_sentences_of_older_archives_and_single_scenes(plane: xr.Dataset) -> None:
    older = put(plane, modes_used=np.full((3, 2), 12), steps_used=[[400, 800]] * 3)
    assert told_choices(Results.of(older)) == ["All 6 variants: moving mass, 12 modes, 400 to 800 steps."]
    failed = scenes.with_failures(older, 2)
    assert told_choices(Results.of(failed)) == ["All 3 variants with values: moving mass, 12 modes, 800 steps."]
    assert told_choices(Results.of(scenes.with_failures(older, 1))) == []
    some = told_choices(Results.of(scenes.with_failures(put(plane, **KNOWN), 2)))[0]
    assert some.startswith("1 of 3 variants with values: moving force, 4 modes, 400 steps, ")
    one = put(scenes.run("passage"), fidelity_used=0, relative_cost=0.02, error_estimate=4e-4)
    assert told_choices(Results.of(one)) == [
        "Computed as statics, estimated error at most 4e-4.",
        "It took 2 % of the full model's modes × steps, checks included.",
    ]
    assert drawn(one) == {}


def test_every_model_has_a_name_and_a_colour() -> None:
    assert set(NAMES) == set(choice.COLOURS) == set(Fidelity)
    assert len(set(NAMES.values())) == len(set(choice.COLOURS.values())) == len(Fidelity)


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
    assert list(found) == ([] if shape in ("none", "one value") else ["choice", "saved", "estimates"])
    for text in texts:
        assert "nan" not in ElementTree.tostring(ElementTree.fromstring(text), "unicode")


def test_models_are_cells_in_their_colours(plane: xr.Dataset) -> None:
    figure = drawn(put(plane, **KNOWN))["choice"]
    model, modes, steps, *_ = figure.drawing.axes
    grey = to_hex(choice.NOTHING)
    static = [(4.0, 10.0), (6.0, 10.0)]
    assert cells(model) == {
        grey: static,
        to_hex(choice.COLOURS[Fidelity.FORCE]): [(6.0, 20.0)],
        to_hex(choice.COLOURS[Fidelity.MASS]): [(2.0, 10.0), (2.0, 20.0), (4.0, 20.0)],
    }
    marched = [[(2.0, 10.0), (2.0, 20.0)], [(4.0, 20.0)], [(6.0, 20.0)]]
    for axes in (modes, steps):
        found = cells(axes)
        assert found.pop(grey) == static and sorted(found.values()) == marched
    (legend,) = figure.drawing.legends
    assert [text.get_text() for text in legend.get_texts()] == ["statics", "moving force", "moving mass"]
    bars = {axes.get_xlabel(): [t.get_text() for t in axes.get_xticklabels()] for axes in figure.drawing.axes[3:]}
    assert bars == {"modes": ["4", "8", "10"], "steps": ["400", "800", "1600"]}


def test_what_is_the_same_everywhere_is_told_and_not_drawn(plane: xr.Dataset) -> None:
    figure = drawn(put(plane, modes_used=np.full((3, 2), 12), steps_used=STEPS))["choice"]
    assert figure.caption == "Steps of every variant shown. All: moving mass and 12 modes."
    alike = put(plane, modes_used=np.full((3, 2), 12), steps_used=np.full((3, 2), 400), relative_cost=np.ones((3, 2)))
    assert drawn(alike) == {}


def test_variants_without_values_are_left_white(plane: xr.Dataset) -> None:
    figure = drawn(scenes.with_failures(put(plane, **KNOWN), 2))["choice"]
    shown = cells(figure.drawing.axes[0])
    assert sorted(place for places in shown.values() for place in places) == [(2.0, 20.0), (4.0, 20.0), (6.0, 20.0)]
    assert "3 diverged (left out)" in figure.caption


def test_the_axis_along_which_the_choice_changes_is_shown() -> None:
    dataset = scenes.run("passage", f"{MASSES}\n{DAMPING}\n{SPEEDS}")
    modes = np.broadcast_to(np.array([2, 4])[:, None, None], (2, 2, 3))
    for axis, varied in (("mass", modes), ("zeta", modes.swapaxes(0, 1))):
        seen = choice.chosen_view(Results.of(put(dataset, modes_used=varied, steps_used=np.full((2, 2, 3), 400))))
        assert seen.x is not None and seen.x.name == "pace"
        assert seen.y is not None and seen.y.name == axis


def test_one_axis_is_drawn_as_steps_in_order() -> None:
    dataset = put(
        scenes.run("passage", SPEEDS),
        fidelity_used=[3, 0, 1],
        modes_used=[8, 0, 4],
        steps_used=[800, 0, 800],
        relative_cost=[0.4, 0.0, 0.1],
    )
    found = drawn(dataset)
    model, modes, steps = found["choice"].drawing.axes
    assert [label.get_text() for label in model.get_yticklabels()] == ["statics", "moving force", "moving mass"]
    for axes, expected in ((model, [0, 1, 2]), (modes, [0, 4, 8]), (steps, [0, 800, 800])):
        (line,) = axes.get_lines()
        np.testing.assert_array_equal(line.get_xdata(), [2, 4, 6])
        np.testing.assert_array_equal(line.get_ydata(), expected)
    (line,) = found["saved"].drawing.axes[0].get_lines()
    np.testing.assert_array_equal(line.get_ydata(), [np.nan, 0.1, 0.4])


def test_costs_are_sorted_beside_the_full_model(plane: xr.Dataset) -> None:
    figure = drawn(put(plane, **KNOWN))["saved"]
    right = figure.drawing.axes[1]
    curve, *_ = right.get_lines()
    np.testing.assert_array_equal(curve.get_ydata(), [np.nan, np.nan, 0.05, 0.1, 0.15, 0.3])
    np.testing.assert_allclose(curve.get_xdata(), 100.0 * np.array([1, 3, 5, 7, 9, 11]) / 12.0)
    lines = legend_of(right)
    np.testing.assert_allclose(lines["full model"].get_ydata(), 1.0)
    np.testing.assert_allclose(lines["average"].get_ydata(), 0.1)
    np.testing.assert_allclose(lines["median"].get_ydata(), 0.075)
    assert "on average 10 %, median 7.5 %. 2 variants marched nothing" in figure.caption
    assert cells(figure.drawing.axes[0])[to_hex(choice.NOTHING)] == [(4.0, 10.0), (6.0, 10.0)]


def test_estimates_are_the_largest_over_other_axes(plane: xr.Dataset) -> None:
    figure = drawn(put(plane, **KNOWN))["estimates"]
    lines = legend_of(figure.drawing.axes[0])
    expected = {
        "estimated error": [4e-4, 5e-4, 8e-4],
        "part of the steps": [3e-4, 4e-4, 1e-4],
        "part of the modes": [1e-4, 1e-4, 2e-4],
        "part of the model": [np.nan, 2e-4, 6e-4],
        "tolerance": [1e-3] * 3,
    }
    assert set(lines) == set(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(lines[name].get_xdata(), [2, 4, 6])
        np.testing.assert_allclose(lines[name].get_ydata(), values, rtol=1e-12)
    assert "largest over mass." in figure.caption and "What is zero, " in figure.caption
    assert figure.caption.endswith("Without an estimate: 1 variant of 6.")


def test_estimates_without_parts_and_swept_tolerances() -> None:
    asked = 'asked = { of = "solver.tolerance", values = [1e-2, 1e-3] }'
    dataset = scenes.run("passage", f"{SPEEDS}\n{asked}")
    (axes,) = drawn(put(dataset, error_estimate=np.full((3, 2), 5e-4)))["estimates"].drawing.axes
    assert set(legend_of(axes)) == {"estimated error", "tolerance"}
    dashed = [line.get_ydata() for line in axes.get_lines() if line.get_linestyle() == "--"]
    np.testing.assert_allclose(dashed, [[1e-3] * 3, [1e-2] * 3])
    assert "estimates" not in drawn(put(dataset, error_estimate=np.full((3, 2), np.nan)))
    assert "estimates" not in drawn(put(dataset, error_steps=np.full((3, 2), 1e-4)))


def test_sampled_variants_are_points_in_the_colour_of_their_largest_part() -> None:
    dataset = random(scenes.run("passage", sweeps("passage")["sampled"]))
    lines = legend_of(drawn(dataset)["estimates"].drawing.axes[0])
    parts = {name: dataset[name].values for name in PARTS}
    known = [place for place, error in enumerate(dataset[ERROR].values) if np.isfinite(error)]
    assert known
    for name, words in PARTS.items():
        own = [place for place in known if parts[name][place] == max(values[place] for values in parts.values())]
        points = lines.get(f"mostly of the {words}")
        np.testing.assert_array_equal([] if points is None else points.get_ydata(), dataset[ERROR].values[own])


def group(estimated: list[float], observed: list[float], worst: list[str] | None = None) -> xr.Dataset:
    """An audit of so many variants."""
    return xr.Dataset(
        {
            "estimated_error": ("sample", np.array(estimated)),
            "observed_error": ("sample", np.array(observed)),
            "tolerance_asked": ("sample", np.full(len(observed), 1e-3)),
            "worst_result": ("sample", np.array(worst or ["midspan_max"] * len(observed))),
            "left_out": ((), 0),
            "variant_status": ("sample", np.zeros(len(observed), dtype=np.int8)),
            "modes_used": ("sample", np.full(len(observed), 8)),
            "steps_used": ("sample", np.full(len(observed), 800)),
        },
        coords={"sample": np.arange(len(observed))},
    )


def test_estimated_against_observed_is_honest_about_what_has_no_place() -> None:
    nan = np.nan
    found = group([4e-4, 2e-4, 0.0, nan, 5e-4], [2e-4, 6e-4, 1e-4, 3e-4, nan], ["a", "b", "a", "b", "c"])
    (figure,) = estimates.compared(found)
    assert figure.caption == (
        "3 audited variants, coloured by the result that differed most. Above the diagonal the estimate was too "
        "small: 2 of them, at most 3 times. Drawn at the edge because zero or too small for the scale: 1. Triangles "
        "at the right edge: 1 without an estimate. Not drawn: 1 that could not be compared."
    )
    (axes,) = figure.drawing.axes
    low, high = axes.get_xlim()
    assert axes.get_ylim() == (low, high) and 0.0 < low < 1e-4 and high > 1e-3
    lines = legend_of(axes)
    assert set(lines) == {"as estimated", "tolerance", "a", "b"}
    np.testing.assert_allclose(lines["as estimated"].get_xdata(), lines["as estimated"].get_ydata())
    np.testing.assert_allclose(np.transpose(lines["a"].get_data()), [[4e-4, 2e-4], [low, 1e-4]])
    np.testing.assert_allclose(np.transpose(lines["b"].get_data()), [[2e-4, 6e-4]])
    triangles = [np.transpose(line.get_data()) for line in axes.get_lines() if line.get_marker() == ">"]
    np.testing.assert_allclose(np.concatenate(triangles), [[high, 3e-4]])


def test_estimated_against_observed_needs_two_of_both() -> None:
    assert estimates.compared(None) == []
    assert estimates.compared(group([1e-4, np.nan, 1e-4], [1e-4, 1e-4, np.nan])) == []
    (figure,) = estimates.compared(group([1e-4, 3e-4], [1e-4, 2e-4]))
    assert figure.caption.endswith("No estimate was smaller than what was observed.")
    assert estimates.compared(group([0.0, 0.0], [0.0, 0.0]))


def test_many_results_share_the_last_colour() -> None:
    worst = ["a"] * 5 + ["b"] * 4 + list("ccddefgh")
    errors = (1e-4 * np.arange(1, len(worst) + 1)).tolist()
    (figure,) = estimates.compared(group(errors, errors, worst))
    (legend,) = [found for found in figure.drawing.axes[0].get_children() if isinstance(found, Legend)]
    names = [text.get_text() for text in legend.get_texts()]
    assert names[2:] == ["a", "b", "c", "d", "e", "others"]
    lines = legend_of(figure.drawing.axes[0])
    assert lines["a"].get_color() == BLUE and len(lines["others"].get_xdata()) == 3
    assert len({lines[name].get_color() for name in names[2:]}) == 6


def test_the_report_has_them_all(plane: xr.Dataset, tmp_path: Path) -> None:
    attributes = {"Conventions": "CF-1.11", "history": "made by a test", "schema_version": SCHEMA_VERSION}
    dataset = put(plane, **KNOWN).assign_attrs(attributes)
    audit = group([6e-4, 8e-4, 5e-4], [5e-4, 9e-4, 1e-4]).assign_coords(
        {"pace": ("sample", [6.0, 6.0, 4.0]), "mass": ("sample", [10.0, 20.0, 20.0])}
    )
    write_archive(tmp_path / "study.nc", dataset, {"/audit": audit})
    page = write_report(tmp_path / "study.nc", tmp_path / "out")
    reader = check_standing_alone(page.read_text(encoding="utf-8"))
    for figure in (*drawn(dataset).values(), *estimates.compared(audit)):
        assert figure.title in reader.text and figure.caption in reader.text
        assert len(list(page.parent.glob(f"*-{figure.name}.png"))) == 1
    for sentence in told_choices(Results.of(dataset)):
        assert sentence in reader.text


def test_a_run_says_it(plane: xr.Dataset, capsys: pytest.CaptureFixture[str]) -> None:
    dataset = put(plane, **KNOWN)
    show_outcome(Outcome(Path("study.nc"), dataset, 0, False, 1.0))
    told = capsys.readouterr().out.splitlines()
    assert set(told_choices(Results.of(dataset))) < set(told)
