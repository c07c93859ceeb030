"""Envelopes from the study file to the archive and its report, for every kind of study that marches."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import engine
from results_schema.errors import ArchiveError, BadInput
from results_schema.validate import validate
from results_schema.variables import expand
from studies.pictures.common import envelopes, estimates
from studies.pictures.common import numerics_used as choice
from studies.protocol.study import kind_of
from studies.reporting import answers
from studies.reporting.report import write_report
from studies.results.results import Results
from tests.pictures.test_passages import limits
from tests.pictures.test_report import archive, check_standing_alone
from tests.studies import scenes

EXTRA = """\
[envelope.shape]
body = "bed"
places = 11

[envelope.moments]
body = "bed"
quantity = "bending_moment"
places = 7
from = 1.0
to = 9.0
"""
MASSES = 'mass = { of = "carriage.table.mass", values = [1, 20, 50] }'


@pytest.mark.parametrize("kind", ["passage", "asymmetry", "double-peak", "trajectory"])
def test_every_kind_that_marches(kind: str) -> None:
    dataset = scenes.run(kind, MASSES, extra=EXTRA)
    assert dataset.shape_envelope_max.dims == ("mass", "shape_place")
    assert dataset.moments_envelope_min.attrs["units"] == "N m"
    assert dataset.moments_place.attrs["units"] == "m" and "place" in dataset.moments_place.attrs["long_name"]
    np.testing.assert_allclose(dataset.moments_place.values, np.linspace(1.0, 9.0, 7), rtol=1e-14, atol=0)
    middle = dataset.isel(shape_place=5)  # over the same instants as the sensor there
    np.testing.assert_allclose(middle.shape_envelope_max, dataset.midspan_max, rtol=1e-10, atol=0, equal_nan=False)
    names = [figure.name for figure in answers.figures(dataset)]
    told = {figure.name for part in (choice, estimates) for figure in part.pictures(Results.of(dataset))}
    assert [name for name in names if name not in told][-1] == "envelopes"
    assert any("the largest bending moment along bed is" in text for text in answers.answer(dataset))


def test_the_report_has_them(tmp_path: Path) -> None:
    dataset = scenes.run("passage", MASSES, extra=EXTRA)
    page = write_report(archive(tmp_path, dataset), tmp_path / "out").read_text(encoding="utf-8")
    reader = check_standing_alone(page)
    (drawn,) = envelopes.pictures(Results.of(dataset))
    assert drawn.caption in reader.text
    assert "moments_envelope_max" in reader.text and "the largest bending moment along bed is" in reader.text
    assert "envelope moments" in reader.text


def test_the_sentence_names_value_place_and_variant() -> None:
    dataset = scenes.run("passage", MASSES, extra=EXTRA)
    said = next(text for text in answers.answer(dataset) if text.startswith("shape: "))
    values = dataset.shape_envelope_max.values
    which, place = np.unravel_index(np.argmax(values), values.shape)
    assert f"{1000.0 * values.max():.3g} mm" in said
    assert f"at {dataset.shape_place.values[place]:g} m of its track" in said
    assert said.endswith(f"(mass {dataset.mass.values[which]:g} kg).")
    alone = answers.answer(scenes.run("passage", extra=EXTRA))
    assert any(re.search(r"^shape: .* m of its track\.$", text) for text in alone)


def test_the_figure_draws_the_envelope_over_all_variants() -> None:
    dataset = scenes.run("passage", MASSES, extra=EXTRA)
    (figure,) = envelopes.pictures(Results.of(dataset))
    shape, moments = figure.drawing.axes
    assert shape.yaxis_inverted() and not moments.yaxis_inverted()
    top, bottom = (line.get_ydata() for line in shape.get_lines()[:2])
    np.testing.assert_allclose(top, 1000.0 * dataset.shape_envelope_max.max("mass"), rtol=1e-12, atol=0)
    np.testing.assert_allclose(bottom, 1000.0 * dataset.shape_envelope_min.min("mass"), rtol=1e-12, atol=1e-12)
    assert "3 variants" in figure.caption
    assert envelopes.pictures(Results.of(scenes.run("passage", MASSES))) == []


SHAKEN = """\
[envelope.shaking]
body = "bed"
quantity = "acceleration"
places = 11

[sensor.shaken]
body = "bed"
at = 5.0
quantity = "acceleration"

[question]
acceleration = 2.0
"""


def shaken(size: float, at_sensor: float = 1.0) -> xr.Dataset:
    """A passage at four speeds whose bed is shaken so far 3 m from its end at the two in the middle."""
    dataset = scenes.run("passage", scenes.pace("passage"), extra=f"{EXTRA}\n{SHAKEN}")
    for name in ("shaking_envelope_max", "shaking_envelope_min", "shaken_max", "shaken_min"):
        dataset[name].values[...] = 0.0
    dataset["shaking_envelope_min"].values[1:3, 3] = [0.99 * -size, -size]
    dataset["shaken_max"].values[0] = at_sensor
    dataset["estimated_error"].values[...] = 1e-4
    return dataset


def test_an_envelope_with_a_limit_is_judged_before_sensors_that_say_less() -> None:
    said = answers.answer(shaken(3.0))
    pace = scenes.run("passage", scenes.pace("passage")).pace.values
    beyond = f"exceeds 2 m/s² at {pace[1]:.3g} to {pace[2]:.3g} m/s."
    where = f"along bed is -3 m/s², at 3 m of its track (pace {pace[2]:.3g} m/s)"
    assert said[0] == f"shaking: the largest acceleration {where}. Its absolute value {beyond}"
    subjects = [text.partition(":")[0] for text in said]
    assert subjects.count("shaking") == 1  # and each quantity before a sensor of this one
    assert subjects.index("midspan") < subjects.index("moment") < subjects.index("shaken") < subjects.index("shape")
    found = {figure.name: figure for figure in answers.figures(shaken(3.0))}
    assert next(iter(found)) == "envelopes"
    assert found["envelopes"].title == f"The largest acceleration {where}, beyond the limit of 2 m/s²"
    assert "Orange: limits that the study names." in found["envelopes"].caption


def test_what_sensors_say_as_well_stays_with_the_envelopes() -> None:
    """Its limit is told there; without a limit an envelope tells none."""
    said = answers.answer(shaken(1.0))
    assert said[0].startswith("shaken: the largest acceleration at 5 m of bed is 1 m/s²")
    (last,) = (text for text in said if text.startswith("shaking: "))
    assert said.index(last) > said.index(next(text for text in said if text.startswith("shape: ")))
    assert "Its absolute value exceeds 2 m/s² nowhere from 1 to 8 m/s." in last
    assert not any("exceeds" in text for text in said if text.startswith(("shape: ", "moments: ")))


@pytest.mark.parametrize(("size", "lines"), [(3.0, [-2.0]), (1.5, [-2.0]), (0.9, [])])
def test_a_limit_is_a_line_in_the_figure_where_it_is_near(size: float, lines: list[float]) -> None:
    (figure,) = envelopes.pictures(Results.of(shaken(size)))
    first, *others = figure.drawing.axes[:3]
    assert first.get_ylabel().startswith("shaking")
    assert limits(first) == lines and not any(map(limits, others))
    assert ("limit 2 m/s², beyond this panel" in first.get_title("right")) == (not lines)
    assert (", within the limit of 2 m/s²" in figure.title) == (size < 2.0)


def test_the_variant_of_an_envelope_that_the_answer_begins_with_keeps_its_history() -> None:
    dataset = shaken(3.0)
    results = Results.of(dataset)
    assert kind_of(results.study).named(results)[0] == (2,)


@pytest.mark.fault(18)
def test_failed_variants_are_left_out() -> None:
    dataset = scenes.with_failures(scenes.run("passage", scenes.pace("passage"), extra=EXTRA), 2)
    (figure,) = envelopes.pictures(Results.of(dataset))
    assert all(np.isfinite(line.get_ydata()).all() for line in figure.drawing.axes[0].get_lines())
    nothing = scenes.with_failures(scenes.run("passage", MASSES, extra=EXTRA), 1)
    assert envelopes.pictures(Results.of(nothing)) == []
    assert "shape: no variant has values." in answers.answer(nothing)


def test_what_is_not_as_declared_is_found() -> None:
    dataset = scenes.run("passage", MASSES, extra=EXTRA)
    given = expand("passage", {"midspan": "m", "moment": "N m"}, ["table"], {"shape": "m", "moments": "N m"})
    validate(dataset, "passage", given)
    with pytest.raises(ArchiveError, match="moments_envelope_max: expected in every passage"):
        validate(dataset.drop_vars("moments_envelope_max"), "passage", given)
    with pytest.raises(ArchiveError, match="shape_envelope_min: expected dimensions"):
        turned = dataset.assign(shape_envelope_min=dataset.shape_envelope_min.transpose())
        validate(turned, "passage", given)
    with pytest.raises(ArchiveError, match="shape_envelope_min: expected a declared name"):
        del given["shape_envelope_min"]
        validate(dataset, "passage", given)


@pytest.mark.parametrize("kind", ["work-precision", "stability"])
def test_studies_that_measure_have_none(kind: str) -> None:
    text = scenes.text_of("passage", extra=EXTRA).replace('kind = "passage"', f'kind = "{kind}"')
    with pytest.raises(BadInput, match=r"envelope: studies of the kind"):
        kind_of(engine.load(text))
