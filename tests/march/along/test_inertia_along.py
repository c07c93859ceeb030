"""Masses that push along their track when they speed up and brake: against a dense twin, the unreduced model, momentum
that is kept, and what the motion of the track along itself is made of."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import engine
from engine.bodies.imported import imported
from engine.bodies.modal.modal_body import Direction, ModalBody
from engine.bodies.reduced.body import save_body
from engine.model.distinct_models import base_scene
from engine.model.station_path import frozen
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.statics.coupled_modes import coupled_frequencies
from engine.unreduced.scene import unreduced_model
from engine.unreduced.statics import unreduced_frequencies
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.status import Status
from tests.bodies.frames import body
from tests.bodies.models import Files, in_process
from tests.engine.build import beam, cruise, mass, oscillator, shuttle, swing
from tests.naive import motions
from tests.naive.scene import Phase
from tests.observation.test_off_track import PORTAL, SECTION, SENSORS, SPAN, one_span, study
from tests.unreduced.test_unreduced import apart

KILOGRAMS, GRAVITY, RATIO = 250.0, 9.81, 0.01
BRAKES = shuttle(0.8, 3.1, 2.0, 0.3, 1)
READ = {"sway": SENSORS["sway"], "deflection": {"at": 1.45}, "rate": SENSORS["sway"] | {"quantity": "velocity"}}


def pushing(motion: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A carriage that pushes along the portal."""
    return {"car": mass(KILOGRAMS, motion, on="portal", inertia_along=True) | more}


def in_space(offset: Sequence[float] = (0.0, 0.0, 0.0)) -> dict[str, Any]:
    """The portal in space, clamped at both feet, with its track from b to c beside its axis."""
    rail = SECTION | {"second_moment_lateral": 3e-6, "torsion_constant": 5e-6, "poissons_ratio": 0.3}
    found = {key: part for key, part in PORTAL.items() if key not in ("plane", "node", "track", "point")}
    found |= {"node": {name: [x, 0.0, z] for name, (x, z) in PORTAL["node"].items()}, "section": {"all": rail}}
    found |= {"supports": {"a": "clamped", "d": "clamped"}}
    found["member"] = {name: part | {"up": [0.0, 1.0, 0.0]} for name, part in PORTAL["member"].items()}
    members = {"first": {"nodes": ["b", "m"]}, "second": {"nodes": ["m", "c"]}}
    found["member"] |= {name: found["member"][name] | part for name, part in members.items()}
    return found | {"track": {"members": ["first", "second"], "offset": list(offset)}}


def marched(motion: dict[str, Any], bed: dict[str, Any] | None = None, steps: int = 400, **more: Any) -> Study:
    """A study with all histories, of the kept modes alone."""
    tables = {"carriage": pushing(motion), "output": {"histories": "all"}}
    solver = {"steps": steps, "static_correction": False, "tolerance": 0.5}
    return study(READ, bed, **(tables | {"solver": solver} | more))


def dense(
    modal: ModalBody,
    phases: tuple[Phase, ...],
    times: Array,
    rows: list[Array],
    directions: Sequence[Direction] = ("load", "along"),
) -> Array:
    """(3, S) displacement of two rows and rate of the third, by average acceleration with full matrices: the mass feels
    D2 w as its load acts, s'' + D2 u along its track and D2 v across both, and gives all back."""
    kept, damping = np.diag(modal.omega**2), np.diag(2.0 * RATIO * modal.omega)

    def equations(t: float) -> tuple[Array, Array, Array, Array]:
        phase = next(phase for phase in phases if t <= phase.end + 1e-12)
        s, ds, dds = phase.s(t), phase.ds(t), phase.dds(t)
        inertia, drag, stiffness, force = np.eye(len(kept)), damping.copy(), kept.copy(), np.zeros(len(kept))
        given = {"load": GRAVITY, "along": -dds, "across": 0.0}
        for direction in directions:
            shape, slope, bend = modal.shapes_in(direction).derivatives([s], (0, 1, 2))[:, 0]
            inertia += KILOGRAMS * np.outer(shape, shape)
            drag += KILOGRAMS * np.outer(shape, 2.0 * ds * slope)
            stiffness += KILOGRAMS * np.outer(shape, ds**2 * bend + dds * slope)
            force += KILOGRAMS * given[direction] * shape
        return inertia, drag, stiffness, force

    first = equations(0.0)
    u = KILOGRAMS * GRAVITY * modal.shape([phases[0].s(0.0)])[0] / modal.omega**2
    v = np.zeros_like(u)
    a = np.linalg.solve(first[0], first[3] - first[2] @ u)
    found = [(u, v)]
    for before, now in pairwise(times):
        h = now - before
        inertia, drag, stiffness, force = equations(now)
        u, v = u + h * v + 0.25 * h**2 * a, v + 0.5 * h * a
        a = np.linalg.solve(inertia + 0.5 * h * drag + 0.25 * h**2 * stiffness, force - drag @ v - stiffness @ u)
        u, v = u + 0.25 * h**2 * a, v + 0.5 * h * a
        found.append((u, v))
    return np.array([[rows[0] @ u, rows[1] @ u, rows[2] @ v] for u, v in found]).T


WAYS: dict[str, tuple[dict[str, Any], tuple[Phase, ...]]] = {
    "out and back": (BRAKES, motions.out_and_back(0.8, 3.1, 2.0, 0.3, 1)),
    "swing": (swing(2.0, 1.2, 0.6, 1), motions.sinusoidal(2.0, 1.2, 1.2 * np.pi, 1.0)),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("bed", ["frame", "beside its axis"])
def test_the_march_is_that_of_a_dense_twin(way: str, bed: str) -> None:
    motion, phases = WAYS[way]
    table = PORTAL if bed == "frame" else PORTAL | {"track": PORTAL["track"] | {"offset": [0.0, 0.0, 0.4]}}
    given = marched(motion, table)
    dataset, modal = engine.run(given), base_scene(given).bodies[0].modal
    rows = [modal.gauges["sway"].row, modal.shape([1.45])[0], modal.gauges["rate"].row]
    expected = dense(modal, phases, dataset.elapsed.values.ravel(), rows)
    without = dense(modal, phases, dataset.elapsed.values.ravel(), rows, ("load",))
    for name, values, other in zip(READ, expected, without, strict=True):
        found = dataset[name].values.ravel()
        np.testing.assert_allclose(found, values, rtol=0.0, atol=1e-9 * np.abs(values).max())
        assert np.abs(found - other).max() > 0.1 * np.abs(values).max(), name


def test_what_is_switched_off_is_as_if_it_were_not_there() -> None:
    """To the last bit; and the sway of braking is not that of the weight."""
    off, plain, on = (
        engine.run(marched(BRAKES, carriage={"car": mass(KILOGRAMS, BRAKES, on="portal", **more)}))
        for more in ({"inertia_along": False}, {}, {"inertia_along": True})
    )
    for name in READ:
        np.testing.assert_array_equal(off[name].values, plain[name].values)
    assert float(on.sway_max) > 5.0 * float(off.sway_max)
    force = engine.run(marched(BRAKES, solver={"steps": 400, "fidelity": "force", "tolerance": 0.5}))
    assert float(force.sway_max) < 0.2 * float(on.sway_max)


@pytest.mark.parametrize("kind", [pytest.param("mass", marks=pytest.mark.slow), "sprung mass"])
def test_a_portal_that_may_slide_keeps_the_common_centre_of_mass(kind: str) -> None:
    """Nothing holds it along: a stiff one moves back by m/(M + m) of the way of what it carries, sprung or not."""
    stiff = {name: SECTION[name] * factor for name, factor in (("area", 1.0), ("youngs_modulus", 1e6))}
    slides = {"supports": {"a": ["z"], "d": ["z"]}, "section": {"all": SECTION | stiff}, "modes": 4}
    way = {"kind": "waypoints", "times": [0.0, 0.7, 1.5, 2.4], "positions": [0.5, 1.9, 1.3, 3.4]}
    car = mass(KILOGRAMS, way, on="portal", inertia_along=True)
    if kind == "sprung mass":
        car = oscillator(0.8 * KILOGRAMS, 1e6, way, on="portal", wheel_mass=0.2 * KILOGRAMS, inertia_along=True)
    given = marched(way, PORTAL | slides, steps=4000, carriage={"car": car}, initial="rest")
    dataset, whole = engine.run(given), base_scene(given).bodies[0].modal.mass
    way_gone = dataset.car_position.values.ravel() - 0.5
    expected = KILOGRAMS / (whole + KILOGRAMS) * way_gone  # the track runs against x
    np.testing.assert_allclose(dataset.sway.values.ravel(), expected, atol=2e-6 * np.abs(expected).max())


def test_the_unreduced_model_pushes_too() -> None:
    found = apart(marched(BRAKES, steps=2000, carriage=pushing(BRAKES)))
    assert found["sway"] < 1e-3 and found["deflection"] < 1e-2, found


def test_one_that_arrives_takes_up_the_motion_of_the_track() -> None:
    """Both models give it an impulse along the track, which by then is swaying."""
    second = mass(KILOGRAMS, cruise(-1.0, SPAN, 3.0), on="portal", inertia_along=True, delay=0.1)
    cars = pushing(BRAKES) | {"next": second}
    found = apart(marched(BRAKES, PORTAL | {"modes": 28}, steps=2000, carriage=cars))
    assert found["sway"] < 5e-3, found
    alone = apart(marched(BRAKES, PORTAL | {"modes": 28}, steps=2000))
    assert found["sway"] < 50.0 * max(alone["sway"], 1e-5), (found, alone)


def test_masses_that_ride_lower_the_frequency_of_sway() -> None:
    given = marched(BRAKES, PORTAL | {"modes": 28}, solver={"steps": 400, "tolerance": 0.5})
    model = base_scene(given)
    places = np.array([0.4, 1.8, 3.0])
    values = VariantValues(model.study, {}, 1)
    found = coupled_frequencies(model, values, frozen(model, places), 1)[0] / (2.0 * np.pi)
    expected = unreduced_frequencies(unreduced_model(given), places, 1)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    off = given.with_values({"carriage.car.inertia_along": False})
    plain = coupled_frequencies(base_scene(off), values, frozen(model, places), 1)[0] / (2.0 * np.pi)
    assert (plain[:, 0] > 1.1 * found[:, 0]).all()


@pytest.mark.parametrize("offset", [[0.0, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, -0.2, 0.5]])
def test_the_motion_along_is_that_of_nodes_beside_the_track(offset: list[float]) -> None:
    """At the ends of the track that of points on rigid arms, also across it; in between, derivatives by differences."""
    ways: dict[Direction, list[float]] = {"along": [1.0, 0.0, 0.0], "across": [0.0, -1.0, 0.0]}
    points = {
        f"{direction}_{end}": {"node": end, "offset": offset, "direction": way}
        for direction, way in ways.items()
        for end in "bc"
    }
    modal = body(in_space(offset) | {"point": points})
    assert modal.points is not None
    for direction in ways:
        side = modal.sides[direction]
        found = side.derivatives([0.0, SPAN], (0,))[0]
        expected = np.array([modal.points.row(f"point.{direction}_{end}") for end in "bc"])
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
        s, h = np.array([0.31, 1.13, 2.57, 3.3]), 1e-4
        for order in (0, 1):
            before, after = (side.derivatives(s + k * h, (order,))[0] for k in (-1, 1))
            slope = side.derivatives(s, (order + 1,))[0]
            np.testing.assert_allclose((after - before) / (2.0 * h), slope, atol=1e-5 * np.abs(slope).max())


def test_bodies_out_of_files_are_pushed_alike(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(imported, "read_files", in_process)
    files = Files(tmp_path, one_span()).table(modes=12, damping_ratio=RATIO)
    found = []
    for bed, node in ((one_span(), "b"), (files, 2)):
        read = {"sway": {"node": node, "direction": "x"}}
        found.append(engine.run(study(read, bed, carriage=pushing(BRAKES), solver={"steps": 800, "tolerance": 0.5})))
    assert float(found[1].sway_max) == pytest.approx(float(found[0].sway_max), rel=1e-4)


def test_errors_are_told_of_the_sway_too() -> None:
    """With everything left open, a few variants converge, and a coarse march is told what it is off by."""
    axis = {"speed": {"of": "carriage.car.motion.speed", "values": [1.0, 2.0]}}
    open_modes = {key: part for key, part in PORTAL.items() if key != "modes"}
    sensors = {"sway": SENSORS["sway"]}
    found = engine.run(study(sensors, open_modes, carriage=pushing(BRAKES), sweep=axis))
    assert (found.status == Status.OK).all() and (found.error_estimate < 1e-3).all()
    assert set(found.fidelity_used.values.tolist()) == {3}
    others = {"carriage": pushing(BRAKES), "sweep": axis}
    fine = engine.run(study(sensors, PORTAL | {"modes": 28}, solver={"steps": 20_000}, **others))
    coarse = engine.run(study(sensors, PORTAL | {"modes": 3}, solver={"steps": 120}, **others))
    scale = np.abs(fine.sway_max.values)
    for run in (found, coarse):
        told = run.estimated_error.sel(result="sway_max").values
        assert (np.abs(run.sway_max.values - fine.sway_max.values) <= told * scale * 1.3 + 1e-6 * scale).all()


RISING = {"node": PORTAL["node"] | {"b": [0.0, 3.5], "m": [1.8, 3.275]}}
REFUSED: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "beam": (beam(length=SPAN), {}, r"carriage\.car\.inertia_along: this body does not move along its own track"),
    "rising": (PORTAL | RISING, {}, r"carriage\.car\.inertia_along: this track rises"),
    "oblique": (
        PORTAL | {"track": PORTAL["track"] | {"direction": [0.1, 0.0, -1.0]}},
        {},
        "the loads of this track act along it too",
    ),
    "instant turns": (PORTAL, {"motion": BRAKES | {"turn": 0.0}}, r"carriage\.car\.motion: .*turn > 0"),
    "sets off at full speed": (PORTAL, {"motion": swing(2.0, 1.2, 0.6, 1), "delay": 0.5}, "changes its speed at an"),
    "force": (PORTAL, {"kind": "force", "force": 1.0}, r"carriage\.car\.inertia_along"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals(name: str) -> None:
    bed, changes, words = REFUSED[name]
    car = pushing(BRAKES)["car"] | changes
    if "kind" in changes:
        del car["mass"]
    with pytest.raises(BadInput, match=words):
        base_scene(study({"middle": {"at": 2.0}}, bed, carriage={"car": car}))


def test_beams_say_what_their_drive_does_all_the_same() -> None:
    """They refuse the key, as it would change nothing; where the push goes, and how a bed sways, is said."""
    with pytest.raises(BadInput) as refused:
        base_scene(study({"middle": {"at": 2.0}}, beam(length=SPAN), carriage=pushing(BRAKES)))
    assert "its deflection does not depend on this key" in str(refused.value)
    assert "remedy: inertia_along = false; the drive still pushes the body along by -m s''" in str(refused.value)
    assert 'take kind = "frame"' in str(refused.value)


def test_saved_and_riding_bodies_are_refused(tmp_path: Path) -> None:
    save_body(body(PORTAL), tmp_path / "body.nc")
    reduced = {"kind": "reduced", "file": str(tmp_path / "body.nc")}
    with pytest.raises(BadInput, match="does not move along its own track"):
        study({}, reduced, carriage=pushing(BRAKES))
    free = {"kind": "rigid", "length": 1.0, "mass": 50.0, "inertia": 4.0}
    shoe = {"stiffness": 1e6}
    table = {"on": "portal", "kind": "body", "body": "table", "motion": BRAKES}
    table["contacts"] = {"front": shoe | {"at": 0.8}, "rear": shoe | {"at": 0.2}}
    rider = mass(1.0, shuttle(0.3, 0.7, 1.0, 0.3, 1), on="table", inertia_along=True)
    with pytest.raises(BadInput, match=r"carriage\.rider\.inertia_along: the body below rides too"):
        study({}, body={"portal": PORTAL, "table": free}, carriage={"table": table, "rider": rider})
