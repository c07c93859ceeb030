"""Velocities and accelerations of the modes up to a frequency: closed form, fewer modes, and a sum by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.batch.plan import make_plan
from engine.model.distinct_models import base_scene
from engine.scene.study import Study
from engine.unreduced.scene import unreduced_model
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.commands.preview import _limits
from studies.results.results import Results
from tests.engine.build import beam, cruise, fixed, force, mass, shuttle, study
from tests.observation.test_off_track import PORTAL
from tests.observation.test_off_track import study as portal_study

FREQUENCIES = 0.5 * np.pi * np.arange(1, 65) ** 2  # Hz, of the pinned beam with L = E I = rho A = 1
THREE = float(np.sqrt(FREQUENCIES[2] * FREQUENCIES[3]))
MOTION = cruise(0.0, 1.0, 0.6)


def read(at: float = 0.37, quantity: str = "acceleration", limit: float | str = THREE) -> dict[str, Any]:
    return fixed(at, quantity) | {"frequency_limit": limit}


def marched(bed: dict[str, Any], carriage: dict[str, Any], sensors: dict[str, Any], **more: Any) -> Study:
    table = {"sensor": sensors, "solver": {"steps": 2000}, "output": {"histories": "all"}}
    return study(bed, carriage, **(table | more))


def test_a_moving_force_by_the_closed_form() -> None:
    """The first three modes of the pinned beam, undamped."""
    sensors = {"rate": read(quantity="velocity"), "bend": read(limit=f"{THREE} Hz")}
    dataset = engine.run(
        marched(beam(modes=10), force(3.0, MOTION), sensors, solver={"steps": 40000, "tolerance": 0.5})
    )
    t = dataset.elapsed.values.ravel()[:, None]
    k = np.arange(1, 4)
    own, pushed = (k * np.pi) ** 2, k * np.pi * 0.6
    scale = 6.0 * np.sin(0.37 * k * np.pi) / (own**2 - pushed**2)
    rate = scale * pushed * (np.cos(pushed * t) - np.cos(own * t))
    bend = scale * pushed * (own * np.sin(own * t) - pushed * np.sin(pushed * t))
    for name, expected in (("rate", rate.sum(axis=1)), ("bend", bend.sum(axis=1))):
        np.testing.assert_allclose(dataset[name].values.ravel(), expected, rtol=0.0, atol=2e-5 * np.abs(expected).max())


def test_of_a_force_other_modes_change_nothing() -> None:
    """As if the body had no more modes; with all of them there is more to read."""
    few, many = (
        engine.run(marched(beam(modes=modes, damping_ratio=0.02), force(3.0, MOTION), {"a": sensor}))
        for modes, sensor in ((3, fixed(0.37, "acceleration")), (12, read()))
    )
    np.testing.assert_array_equal(many.a.values, few.a.values)
    every = {"a": fixed(0.37, "acceleration")}
    whole = engine.run(marched(beam(modes=12, damping_ratio=0.02), force(3.0, MOTION), every))
    assert float(whole.a_max) > 1.05 * float(many.a_max)


def test_of_a_mass_other_modes_move_it_too() -> None:
    """The sum by hand of three of the modes that six sensors tell, as the mass couples all six."""
    places = (np.arange(6) + 0.5) / 6.0
    sensors = {f"a{k}": fixed(float(x), "acceleration") for k, x in enumerate(places)} | {"low": read()}
    given = marched(beam(modes=6, damping_ratio=0.02), mass(0.3, MOTION), sensors)
    dataset, modal = engine.run(given), base_scene(given).bodies[0].modal
    every = np.linalg.solve(modal.shape(places), np.stack([dataset[f"a{k}"].values.ravel() for k in range(6)]))
    low = modal.shape([0.37])[0, :3] @ every[:3]
    np.testing.assert_allclose(dataset.low.values.ravel(), low, rtol=0.0, atol=1e-10 * np.abs(low).max())
    alone = engine.run(marched(beam(modes=3, damping_ratio=0.02), mass(0.3, MOTION), {"low": read()}))
    assert abs(float(alone.low_max) - float(dataset.low_max)) > 1e-3 * float(dataset.low_max)


def test_envelopes_and_places_off_the_track() -> None:
    envelope = {"deck": {"body": "bed", "quantity": "acceleration", "frequency_limit": THREE, "places": 5}}
    sensors = {"quarter": read(0.25), "middle": read(0.5)}
    dataset = engine.run(marched(beam(modes=8), mass(0.2, MOTION), sensors, envelope=envelope))
    for number, name in ((1, "quarter"), (2, "middle")):
        assert float(dataset.deck_envelope_max[number]) == pytest.approx(float(dataset[f"{name}_max"]), rel=1e-12)
    node = {"node": "b", "direction": "x", "quantity": "acceleration"}
    frequencies = base_scene(portal_study({"all": node})).bodies[0].modal.omega / (2.0 * np.pi)
    read_ = {"all": node, "low": node | {"frequency_limit": float(frequencies[:2].mean())}}
    car = {"car": mass(200.0, shuttle(0.8, 3.1, 2.0, 0.3, 1), on="portal")}
    found = engine.run(portal_study(read_, PORTAL, carriage=car, solver={"steps": 400}, output={"histories": "all"}))
    modal = base_scene(portal_study({"all": node})).bodies[0].modal
    assert 0.0 < float(found.low_max) < float(found.all_max)
    assert modal.gauges["all"].row.size == 12


def test_with_a_limit_accelerations_converge() -> None:
    """Where a mass enters they go on changing with every mode; those up to a limit are held to a tolerance."""
    held = {"tolerance": 1e-2}
    sensors = {"low": read(0.5) | held, "whole": fixed(0.5, "acceleration")}
    given = study(beam(modes="auto", damping_ratio=0.01), mass(0.2, MOTION), sensor=sensors)
    dataset = engine.run(given)
    finer = engine.run(given.with_values({"sensor.low.tolerance": 1e-3}))
    assert int(dataset.status) == Status.OK
    told = dataset.estimated_error.sel(result=["low_max", "whole_max"]).values
    assert told[0] < 1e-2 < told[1]
    gap = abs(float(dataset.low_max) - float(finer.low_max)) / float(finer.low_max)
    assert gap < told[0] + 1e-3


def test_a_limit_below_the_first_mode_reads_nothing() -> None:
    given = study(beam(), force(3.0, MOTION), sensor={"none": read(limit="1 Hz"), "some": read(limit="2 Hz")})
    dataset = engine.run(given)
    assert float(dataset.none_max) == float(dataset.none_min) == 0.0 < float(dataset.some_max)
    assert int(dataset.status) == Status.OK
    table = {row[0]: row[1:] for row in _limits(make_plan(given).base).rows}
    assert table == {"none": ("1 Hz", "none: it reads 0"), "some": ("2 Hz", "1 of 4")}


@pytest.mark.parametrize("table", ["sensor", "envelope"])
def test_a_study_whose_limit_no_mode_reaches_is_refused(table: str) -> None:
    """Before anything is computed; where some variants read something the others are told of."""
    low = {"body": "bed", "quantity": "acceleration", "frequency_limit": "1 Hz"}
    tables = {"sensor": {"some": read(limit="2 Hz")}}
    tables.setdefault(table, {})["low"] = low | ({"at": 0.5} if table == "sensor" else {})
    with pytest.raises(BadInput, match=rf"{table}\.low\.frequency_limit: no mode of bed .* 1\.571 Hz, received 1 Hz"):
        studies.run(study(beam(), force(3.0, MOTION), **tables))
    stiff = {"stiff": {"of": "body.bed.youngs_modulus", "values": [0.25, 1.0]}}
    with pytest.warns(studies.Remark, match=f"{table} low reads 0 in some variants: the first frequency of bed, up to"):
        studies.run(study(beam(), force(3.0, MOTION), sweep=stiff, **tables))


def test_answers_name_the_limit_unless_it_is_swept() -> None:
    sensors = {"deck": read(0.5, limit="30 Hz")}
    given = study(beam(damping_ratio=0.01), force(3.0, MOTION), sensor=sensors)
    assert Results(studies.run(given), given).noun("deck") == "acceleration of modes up to 30 Hz"
    sweep = {"limit": {"of": "sensor.deck.frequency_limit", "values": ["2 Hz", "60 Hz"]}}
    swept = study(beam(damping_ratio=0.01), force(3.0, MOTION), sensor=sensors, sweep=sweep)
    dataset = studies.run(swept)
    assert Results(dataset, swept).noun("deck") == "acceleration"
    assert float(dataset.deck_max[0]) < float(dataset.deck_max[1])


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "displacement": (read(quantity="displacement"), "a frequency_limit of displacement is not told.*velocity, acceler"),
    "under a carriage": ({"under": "car", "quantity": "velocity", "frequency_limit": 3.0}, "at a fixed place"),
    "zero": (read(limit="0 Hz"), r"sensor\.read\.frequency_limit"),
    "a length": (read(limit="30 m"), r"sensor\.read\.frequency_limit.*frequency"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals(name: str) -> None:
    sensor, words = REFUSED[name]
    with pytest.raises(BadInput, match=words):
        study(beam(), force(1.0, MOTION), sensor={"read": sensor})


def test_other_refusals() -> None:
    envelope = {"all": {"body": "bed", "frequency_limit": 3.0}}
    with pytest.raises(BadInput, match="a frequency_limit of displacement"):
        study(beam(), force(1.0, MOTION), envelope=envelope)
    with pytest.raises(BadInput, match=r"sensor\.read\.frequency_limit: the unreduced model has no modes"):
        unreduced_model(study(beam(), force(1.0, MOTION), sensor={"read": read()}))
