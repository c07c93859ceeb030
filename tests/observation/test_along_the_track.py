"""What a carriage's place does along its track and across it: against points beside the axis, the unreduced model, and
bodies out of files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import engine
from engine.bodies.imported import imported
from engine.model.distinct_models import base_scene
from engine.observation.signals import build_sensors
from engine.scene.study import Study
from engine.unreduced.march import march_unreduced
from engine.unreduced.scene import unreduced_model
from engine.unreduced.statics import unreduced_statics
from results_schema.errors import BadInput
from results_schema.status import Status
from tests.bodies.models import Files, in_process
from tests.engine.build import beam, course_of, cruise, mass, oscillator, swing
from tests.march.along.test_inertia_across import car, oblique
from tests.march.along.test_inertia_along import BRAKES, in_space
from tests.observation.test_off_track import GRAVITY, MIDDLE, PLACES, SPAN, WEIGHT, one_span, statics, study
from tests.unreduced.test_unreduced import apart

BESIDE = [0.0, 0.3, 0.4]
ALONG: dict[str, Any] = {"under": "car", "direction": "along"}
ACROSS: dict[str, Any] = {"under": "car", "direction": "across"}
SIDES = {"along": ALONG, "across": ACROSS}


def tool(weighs: bool, direction: list[float]) -> dict[str, Any]:
    """The portal in space, askew, whose track runs beside its axis, and a point beside node m as far from it."""
    bed = oblique() | {"track": in_space(BESIDE)["track"], "own_weight": weighs}
    return bed | {"point": {"tool": {"node": "m", "offset": BESIDE, "direction": direction}}}


@pytest.mark.parametrize("weighs", [False, True])
@pytest.mark.parametrize(("side", "way"), [("along", [1.0, 0.0, 0.0]), ("across", [0.0, -1.0, 0.0])])
def test_it_reads_what_a_point_there_does(side: str, way: list[float], weighs: bool) -> None:
    """Loads act down, -z, and the track goes along x: across both is their cross product. At rest, and where a carriage
    that pushes has stopped."""
    read = {"under": SIDES[side], "tool": {"point": "tool"}}
    under, point = statics(study(read, tool(weighs, way)), [MIDDLE])[0]
    assert abs(point) > 1e-5
    assert under == pytest.approx(point, rel=1e-9)
    stops = {"kind": "point-to-point", "start": 0.5, "end": MIDDLE, "speed": 2.0, "acceleration": 5.0, "dwell": 0.3}
    more = {"solver": {"steps": 2000, "tolerance": 0.5}, "output": {"histories": "all"}}
    dataset = engine.run(study(read, tool(weighs, way), carriage={"car": car(stops)}, **more))
    stopped = dataset.car_position.values.ravel() == MIDDLE
    under, point = (dataset[name].values.ravel()[stopped] for name in read)
    assert stopped.sum() > 100 and np.ptp(point) > 1e-5
    np.testing.assert_allclose(under, point, rtol=0.0, atol=1e-6 * np.abs(point).max())


@pytest.mark.parametrize("weighs", [False, True])
def test_the_unreduced_model_reads_the_same_at_rest(weighs: bool) -> None:
    given = study(SIDES, tool(weighs, [1.0, 0.0, 0.0]))
    found, _ = unreduced_statics(unreduced_model(given), PLACES)
    assert (np.abs(found).max(axis=0) > 1e-5).all()
    np.testing.assert_allclose(found, statics(given), rtol=1e-9, atol=1e-9 * np.abs(found).max())


def marched(bed: dict[str, Any], carriage: dict[str, Any], steps: int = 3000) -> Study:
    more = {"solver": {"steps": steps, "tolerance": 0.5}, "output": {"histories": "all"}}
    return study(SIDES, bed | {"modes": 28}, carriage={"car": carriage}, **more)


def test_both_marches_agree() -> None:
    """Where masses push on the axis."""
    found = apart(marched(oblique(), car(BRAKES)))
    assert max(found.values()) < 2e-4, found


BESIDE_IT = oblique() | {"track": in_space(BESIDE)["track"]}


def test_both_marches_agree_on_what_turns_the_track() -> None:
    """Beside the axis a sprung mass is marched by both."""
    found = apart(marched(BESIDE_IT, oscillator(WEIGHT / GRAVITY, 3e5, BRAKES, on="portal", damping=1e3)))
    assert max(found.values()) < 2e-3, found


@pytest.mark.parametrize("offset", [[0.0, 0.3, 0.0], [0.0, 0.0, 0.4]])
def test_the_unreduced_model_does_not_march_masses_beside_the_axis(offset: list[float]) -> None:
    """Its elements turn linearly between their ends, so that it would miss the curvature of that; a stiff spring holds
    on without derivatives along the track, and agrees."""
    bed = oblique() | {"track": in_space(offset)["track"]}
    with pytest.raises(BadInput, match=r"body\.portal\.track\.offset: the unreduced model does not march masses"):
        apart(marched(bed, car(BRAKES)))


def test_a_mass_beside_the_axis_moves_as_one_on_a_stiff_spring() -> None:
    """Which the unreduced model marches."""
    stiff = 1e8
    kilograms, damping = WEIGHT / GRAVITY, 0.1 * np.sqrt(stiff * WEIGHT / GRAVITY)
    held = engine.run(marched(BESIDE_IT, mass(kilograms, BRAKES, on="portal")))
    given = marched(BESIDE_IT, oscillator(kilograms, stiff, BRAKES, on="portal", damping=damping), 12_000)
    model = unreduced_model(given)
    whole = march_unreduced(model, course_of(model, 12_000), np.arange(0, 12_001, 4)).sensors.T
    for name, values in zip(SIDES, whole, strict=True):
        assert np.abs(held[name].values.ravel() - values).max() < 2e-3 * np.ptp(values), name


def test_rates_are_those_of_the_displacement() -> None:
    """What a place of the track does there while it moves on: by differences of second order, beside a parabola, whose
    terms of place count for a third of it and more."""
    quantities = ("displacement", "velocity", "acceleration")
    read = {f"{side}_{quantity}": SIDES[side] | {"quantity": quantity} for side in SIDES for quantity in quantities}
    solver = {"static_correction": False, "tolerance": 0.5, "scheme": "average-acceleration"}
    bed = oblique() | {"track": in_space(BESIDE)["track"], "modes": 4}

    def off(side: str, steps: int) -> list[float]:
        moves = {"car": mass(WEIGHT / GRAVITY, swing(2.0, 1.2, 0.5, 1), on="portal")}
        given = study(read, bed, carriage=moves, solver=solver | {"steps": steps}, output={"histories": "all"})
        dataset = engine.run(given)
        step = float(np.diff(dataset.elapsed.values.ravel())[0])
        x, v, a = (dataset[f"{side}_{quantity}"].values.ravel() for quantity in quantities)
        rates = (x[2:] - x[:-2]) / (2.0 * step), (x[2:] - 2.0 * x[1:-1] + x[:-2]) / step**2
        return [float(np.abs(one - told[1:-1]).max() / np.ptp(told)) for one, told in zip(rates, (v, a), strict=True)]

    for side in SIDES:
        coarse, fine = off(side, 1000), off(side, 2000)
        assert max(fine) < 1e-2, (side, fine)
        assert min(c / f for c, f in zip(coarse, fine, strict=True)) > 3.5, (side, coarse, fine)


def test_bodies_out_of_files_read_it_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At places where the model has nodes, the interpolation between them is exact; with their weight too."""
    monkeypatch.setattr(imported, "read_files", in_process)
    portal = Files(tmp_path, one_span()).table(modes=12, damping_ratio=0.01)
    places = np.linspace(0.0, SPAN, 9)
    for weighs in (False, True):
        beds = (bed | {"own_weight": weighs} for bed in (one_span(), portal))
        own, read = (statics(study({"along": ALONG}, bed), places) for bed in beds)
        np.testing.assert_allclose(read, own, rtol=0.0, atol=1e-9 * np.abs(own).max())


def test_its_errors_are_told_and_held() -> None:
    """Beside 28 modes and many steps."""
    stops = {"kind": "point-to-point", "start": 0.5, "end": 3.2, "speed": 2.0, "acceleration": 5.0, "dwell": 0.3}
    given = study(SIDES, oblique(), carriage={"car": car(stops)})
    found = engine.run(given)
    assert int(found.status) == Status.OK
    solver = {"steps": 20_000, "scheme": "average-acceleration", "tolerance": 0.5}
    truth = engine.run(study(SIDES, oblique() | {"modes": 28}, carriage={"car": car(stops)}, solver=solver))
    for name in SIDES:
        scale = max(abs(float(truth[f"{name}_max"])), abs(float(truth[f"{name}_min"])))
        for end in ("max", "min", "rms"):
            off = abs(float(found[f"{name}_{end}"]) - float(truth[f"{name}_{end}"])) / scale
            told = float(found.estimated_error.sel(result=f"{name}_{end}"))
            assert off < 1e-3 and off < 1.5 * told + 2e-5, (name, end, off, told)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "an axis": (ALONG | {"direction": "x"}, r"sensor\.read: what moves with a carriage is read along its track"),
    "a place": ({"at": 1.0, "direction": "along"}, r'only what moves with a carriage is read "along" a track'),
    "a node": ({"node": "b", "direction": "across"}, r'only what moves with a carriage is read "across" a track'),
    "a moment": (ALONG | {"quantity": "bending_moment"}, "a bending_moment has no direction.*velocity"),
    "in a plane": (ACROSS, r"sensor\.read\.direction: body portal does not move across its own track.*in space"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_name_the_place(name: str) -> None:
    sensor, words = REFUSED[name]
    with pytest.raises(BadInput, match=words):
        study({"read": sensor})


def test_beams_do_not_move_so() -> None:
    rides = {"car": mass(10.0, cruise(0.0, SPAN, 2.0), on="portal")}
    with pytest.raises(
        BadInput, match=r"sensor\.read\.direction: body portal does not move along its own track.*a frame"
    ):
        study({"read": ALONG}, beam(length=SPAN), carriage=rides)


def test_what_inertia_alone_moves_across_the_track_has_not_diverged() -> None:
    """At rest no load in the plane of a portal moves it across. A mass beside that plane does so while it swings; of a
    body out of files, whose flexibility is 0 there but for 1e-24, that was said to have left the finite numbers."""
    given = study({"sway": ACROSS}, in_space(), carriage={"car": mass(4.0, cruise(0.0, SPAN, 6.0)) | {"on": "portal"}})
    model, places = base_scene(given), np.linspace(0.2, SPAN, 9)
    modal, sway = model.bodies[0].modal, build_sensors(model)[0]
    own = modal.sides["across"].influence_at("across", places, places).max()
    assert np.abs(modal.sides["across"].influence_at("load", places, places)).max() < 1e-9 * own
    assert sway.largest_influence(model, places) == pytest.approx(own, rel=1e-9)
