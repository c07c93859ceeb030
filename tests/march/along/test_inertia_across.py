"""Masses whose inertia acts across their track too: against a dense twin, the unreduced model, the common centre of
mass that stays, and frames that have the mass as one of their own."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import engine
from engine.bodies.imported import imported
from engine.bodies.modal.modal_body import Direction
from engine.model.distinct_models import base_scene
from engine.model.station_path import frozen
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.statics.coupled_modes import coupled_frequencies
from engine.statics.directions import left_out
from engine.unreduced.scene import unreduced_model
from engine.unreduced.statics import unreduced_frequencies
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.status import Status
from tests.bodies.frames import body
from tests.bodies.models import Files, in_process
from tests.engine.build import cruise, mass, oscillator
from tests.march.along.test_inertia_along import BRAKES, KILOGRAMS, WAYS, dense, in_space
from tests.observation.test_off_track import PORTAL, SECTION, SPAN, study
from tests.unreduced.test_unreduced import apart

BESIDE = [0.0, 0.3, 0.4]  # the track: its load twists the beam, which moves the mass across
READ = {"sway": {"node": "b", "direction": "y"}, "deflection": {"at": 1.45}}
RATE = {"rate": READ["sway"] | {"quantity": "velocity"}}
ALL: tuple[Direction, ...] = ("along", "across")


def car(motion: dict[str, Any], pushes: tuple[Direction, ...] = ALL, **more: Any) -> dict[str, Any]:
    """A mass whose inertia acts in some directions beside its load's."""
    return mass(KILOGRAMS, motion, on="portal", **{f"inertia_{direction}": True for direction in pushes}, **more)


def oblique() -> dict[str, Any]:
    """The portal in space whose beam bends across too under loads, as its section stands askew."""
    found = in_space()
    askew = {"up": [0.0, 0.5, 1.0], "elements": 8}
    span = {name: found["member"][name] | askew for name in ("first", "second")}
    return found | {"member": found["member"] | span}


def marched(motion: dict[str, Any], steps: int = 400, bed: dict[str, Any] | None = None, **more: Any) -> Study:
    """A study with all histories, of the kept modes alone."""
    tables = {"carriage": {"car": car(motion)}, "output": {"histories": "all"}}
    solver = {"steps": steps, "static_correction": False, "tolerance": 0.5}
    return study(READ | RATE, bed or in_space(BESIDE), **(tables | {"solver": solver} | more))


@pytest.mark.parametrize("pushes", [("across",), ALL], ids="-".join)
@pytest.mark.parametrize("way", WAYS)
def test_the_march_is_that_of_a_dense_twin(way: str, pushes: tuple[Direction, ...]) -> None:
    motion, phases = WAYS[way]
    given = marched(motion, carriage={"car": car(motion, pushes)})
    dataset, modal = engine.run(given), base_scene(given).bodies[0].modal
    rows = [modal.gauges["sway"].row, modal.shape([1.45])[0], modal.gauges["rate"].row]
    times = dataset.elapsed.values.ravel()
    expected = dense(modal, phases, times, rows, ("load", *pushes))
    without = dense(modal, phases, times, rows, ("load", *(push for push in pushes if push != "across")))
    for name, values, other in zip((*READ, *RATE), expected, without, strict=True):
        found = dataset[name].values.ravel()
        np.testing.assert_allclose(found, values, rtol=0.0, atol=1e-9 * np.abs(values).max())
        assert name != "rate" or np.abs(found - other).max() > 0.1 * np.abs(values).max()


def test_what_is_switched_off_is_as_if_it_were_not_there() -> None:
    """To the last bit."""
    off, plain = (
        engine.run(marched(BRAKES, carriage={"car": car(BRAKES, (), **more)}))
        for more in ({"inertia_along": False, "inertia_across": False}, {})
    )
    for name in READ:
        np.testing.assert_array_equal(off[name].values, plain[name].values)


@pytest.mark.parametrize("kind", [pytest.param("mass", marks=pytest.mark.slow), "sprung mass"])
def test_a_portal_that_may_slide_and_turn_keeps_the_common_centre_of_mass(kind: str) -> None:
    """Pushed along beside its middle a stiff one turns about the upright; nothing holds it across, where by
    M y'' = -m D2 v its own centre and that of what it carries stay, times their masses, on one line."""
    stiff = {"youngs_modulus": 1e6 * SECTION["youngs_modulus"], "torsion_constant": 5e-6, "poissons_ratio": 0.3}
    bed = in_space([0.0, 0.6, 0.0])
    bed |= {"supports": {foot: ["z", "rx"] for foot in "ad"}, "modes": 6}
    bed["section"] = {"all": bed["section"]["all"] | stiff}
    way = {"kind": "waypoints", "times": [0.0, 0.7, 1.5, 2.4], "positions": [0.5, 1.9, 1.3, 3.4]}
    carried = car(way)
    if kind == "sprung mass":
        carried = oscillator(0.8 * KILOGRAMS, 1e6, way, on="portal", wheel_mass=0.2 * KILOGRAMS)
        carried |= {"inertia_along": True, "inertia_across": True}
    ends = {foot: {"node": foot, "direction": "y"} for foot in "ad"}
    given = study(
        ends,
        bed,
        carriage={"car": carried},
        initial="rest",
        output={"histories": "all"},
        solver={"steps": 4000, "static_correction": False, "tolerance": 0.5},
    )
    dataset, whole = engine.run(given), base_scene(given).bodies[0].modal.mass
    left, right = (dataset[foot].values.ravel() for foot in "ad")
    here = left + (right - left) * dataset.car_position.values.ravel() / SPAN
    turned = np.abs(right - left).max()
    assert turned > 0.01
    np.testing.assert_allclose(whole * 0.5 * (left + right), -KILOGRAMS * here, atol=2e-5 * KILOGRAMS * turned)


def test_the_unreduced_model_pushes_too() -> None:
    """Of the range of what the sway across does, as far as both models go, much is by the inertia across."""
    more = {"solver": {"steps": 3000, "tolerance": 0.5}, "bed": oblique() | {"modes": 28}}
    found = apart(marched(BRAKES, **more))
    assert found["sway"] < 1.5e-3 and found["deflection"] < 1e-3, found
    alone, whole = (
        engine.run(marched(BRAKES, **more, carriage={"car": car(BRAKES, pushes)})) for pushes in (("along",), ALL)
    )
    assert np.abs(whole.sway - alone.sway).max() > 0.05 * np.ptp(whole.sway.values)


def test_one_that_arrives_or_turns_at_once_takes_up_the_motion_of_the_track() -> None:
    """Both models give it an impulse across the track, which by then is swaying."""
    turns = {"first": car(BRAKES | {"turn": 0.0}, ("across",))}
    turns["next"] = car(cruise(-1.0, SPAN, 3.0), ("across",), delay=0.1)
    given = marched(BRAKES, bed=oblique() | {"modes": 28}, carriage=turns, solver={"steps": 3000, "tolerance": 0.5})
    found = apart(given)
    assert found["sway"] < 2e-2, found


#: Of a milling gantry, a user's: its own lowest mode leaves its plane at 69.65 Hz.
BOX = {"youngs_modulus": 210e9, "shear_modulus": 81e9, "density": 7850.0}
COLUMN = {"area": 0.011424, "second_moment": 1.08124352e-4, "second_moment_lateral": 1.08124352e-4}
BEAM = {"area": 0.0156, "second_moment": 2.01645e-4, "second_moment_lateral": 1.51045e-4}
GANTRY: dict[str, Any] = {
    "kind": "frame",
    "node": {
        "a": [0.0, 0.0, 0.0],
        "b": [0.0, 0.0, 1.2],
        "m": [1.2, 0.0, 1.2],
        "c": [2.4, 0.0, 1.2],
        "d": [2.4, 0.0, 0.0],
    },
    "section": {
        "column": COLUMN | BOX | {"torsion_constant": 1.61775264e-4},
        "beam": BEAM | BOX | {"torsion_constant": 2.58787536e-4},
    },
    "member": {
        "left": {"nodes": ["a", "b"], "section": "column", "elements": 8, "up": [1.0, 0.0, 0.0]},
        "near": {"nodes": ["b", "m"], "section": "beam", "elements": 8},
        "far": {"nodes": ["m", "c"], "section": "beam", "elements": 8},
        "right": {"nodes": ["c", "d"], "section": "column", "elements": 8, "up": [1.0, 0.0, 0.0]},
    },
    "supports": {"a": "clamped", "d": "clamped"},
    "track": {"members": ["near", "far"]},
}


def frequencies(given: Study, places: Array, count: int) -> Array:
    """(P, count) Hz with the carriage at places."""
    model = base_scene(given)
    found = coupled_frequencies(model, VariantValues(model.study, {}, 1), frozen(model, places), count)
    return np.asarray(found[0] / (2.0 * np.pi))


def test_frequencies_are_those_of_a_frame_that_has_the_mass_as_its_own() -> None:
    """46.05 Hz with a head of 350 kg in the middle, by an assembly of a user's own too; without it across 69.65 Hz."""
    head = mass(350.0, BRAKES | {"end": 2.3}, on="portal", inertia_along=True, inertia_across=True)
    whole = body(GANTRY | {"point_mass": {"head": {"node": "m", "mass": 350.0}}, "modes": 5}).omega / (2.0 * np.pi)
    found = frequencies(study({}, GANTRY | {"modes": 64}, carriage={"car": head}), np.array([1.2]), 5)[0]
    np.testing.assert_allclose(found[:2], whole[:2], rtol=1e-6)
    np.testing.assert_allclose(found, whole, rtol=1e-4)
    assert found[0] == pytest.approx(46.055, abs=5e-4)
    few = frequencies(study({}, GANTRY | {"modes": 12}, carriage={"car": head}), np.array([1.2]), 1)[0]
    assert few[0] == pytest.approx(whole[0], rel=1e-5)
    plain = head | {"inertia_across": False}
    apart = frequencies(study({}, GANTRY | {"modes": 12}, carriage={"car": plain}), np.array([1.2]), 1)[0]
    assert apart[0] == pytest.approx(69.653, abs=5e-4)


RISING = {"node": in_space()["node"] | {"b": [0.0, 0.0, 3.5], "m": [1.8, 0.0, 3.275]}}


@pytest.mark.parametrize(
    ("bed", "pushes"), [(in_space(BESIDE), ALL), (in_space() | RISING, ("across",))], ids=["beside its beam", "rising"]
)
def test_the_unreduced_model_has_the_same_frequencies(bed: dict[str, Any], pushes: tuple[Direction, ...]) -> None:
    given = marched(BRAKES, bed=bed | {"modes": 28}, carriage={"car": car(BRAKES, pushes)}, solver={"steps": 400})
    places = np.array([0.0, 1.8, SPAN])
    expected = unreduced_frequencies(unreduced_model(given), places, 3)
    np.testing.assert_allclose(frequencies(given, places, 3), expected, rtol=1e-4)
    without = marched(BRAKES, bed=bed | {"modes": 28}, carriage={"car": car(BRAKES, ())}, solver={"steps": 400})
    assert np.any(frequencies(given, places, 3) < 0.99 * frequencies(without, places, 3))


def test_errors_are_told_of_the_sway_across_too() -> None:
    """With everything left open, a few variants converge, and a coarse march is told what it is off by."""
    axis = {"speed": {"of": "carriage.car.motion.speed", "values": [1.0, 2.0]}}
    bed = {key: part for key, part in oblique().items() if key != "modes"}
    others = {"carriage": {"car": car(BRAKES)}, "sweep": axis}
    found = engine.run(study(READ, bed, solver={"tolerance": 0.02}, **others))
    assert (found.status == Status.OK).all() and (found.error_estimate < 0.02).all()
    assert set(found.fidelity_used.values.tolist()) == {3}
    fine = engine.run(study(READ, bed | {"modes": 40}, solver={"steps": 20_000}, **others))
    coarse = engine.run(study(READ, bed | {"modes": 4}, solver={"steps": 400}, **others))
    scale = np.abs(fine.sway_max.values)
    for run in (found, coarse):
        told = run.estimated_error.sel(result="sway_max").values
        assert (np.abs(run.sway_max.values - fine.sway_max.values) <= told * scale * 1.3 + 1e-6 * scale).all()


def in_files(tmp_path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The portal in space with one member under its track, and the same out of files."""
    frame = in_space()
    members = {name: frame["member"][name] for name in ("left", "right")}
    span = {"nodes": ["b", "c"], "section": "all", "elements": 8, "up": [0.0, 1.0, 0.0]}
    nodes = {name: place for name, place in frame["node"].items() if name != "m"}
    frame |= {"node": nodes, "member": {"span": span} | members, "track": {"members": ["span"]}, "modes": 12}
    return frame, Files(tmp_path, frame).table(modes=12, damping_ratio=0.01)


def test_bodies_out_of_files_are_pushed_alike(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both slopes and both statics across are those of rotations."""
    monkeypatch.setattr(imported, "read_files", in_process)
    found = []
    for bed, node in zip(in_files(tmp_path), ("b", 2), strict=True):
        given = study({"sway": {"node": node, "direction": "y"}}, bed, carriage={"car": car(BRAKES)})
        found.append((frequencies(given, np.array([0.4, 1.8]), 3), base_scene(given).bodies[0].modal))
    (expected, frame), (other, files) = found
    np.testing.assert_allclose(other, expected, rtol=3e-5)
    nodes = np.linspace(0.0, SPAN, 9)
    for read in ("across", "along", "load"):
        wanted, given_too = (one.sides["across"].influence_at(read, nodes[:, None], nodes) for one in (frame, files))
        own = frame.sides["across"].influence_at("across", nodes[:, None], nodes)
        np.testing.assert_allclose(given_too, wanted, atol=1e-8 * np.abs(own).max())
    np.testing.assert_allclose(
        files.gauges["sway"].influence(nodes, "across"), frame.gauges["sway"].influence(nodes, "across"), rtol=1e-7
    )


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "in a plane": (PORTAL, r"carriage\.car\.inertia_across: this body does not move across its own track"),
    "weights act across": (
        in_space() | {"track": {"members": ["first", "second"], "direction": [0.0, 1.0, -1.0]}},
        r"carriage\.car\.inertia_across: weights act across this track too",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals(name: str) -> None:
    bed, words = REFUSED[name]
    with pytest.raises(BadInput, match=words):
        base_scene(study({}, bed, carriage={"car": car(BRAKES, ("across",))}))


def test_files_of_a_plane_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(imported, "read_files", in_process)
    _, files = in_files(tmp_path)
    flat = files | {"supports": {"all": ["y", "rx", "rz"]}}
    with pytest.raises(BadInput, match=r"carriage\.car\.inertia_across: this body does not move across"):
        study({}, flat, carriage={"car": car(BRAKES, ("across",))})
    assert left_out(study({}, flat, carriage={"car": car(BRAKES, ())})) == {"car": ("along",)}
