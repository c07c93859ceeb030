"""Envelopes along a body: against the naive twin, against sensors at the same places, against statics; the same bits
however the work is cut."""

import math
from typing import Any

import numpy as np
import pytest

from engine.batch.execution import execute, run
from engine.batch.executors import Threads
from engine.batch.plan import Plan, make_plan
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.store.rows import Collector
from tests.batch import test_determinism
from tests.bodies.frames import straight
from tests.engine.build import beam, cruise, fixed, force, mass, shuttle, study
from tests.engine.reading import Reading
from tests.engine.twin import march_twin
from tests.march.test_twin import assert_close

ALL = {"histories": "all"}
SPRINGS = [{"at": 0.0, "stiffness": 60.0, "damping": 2.0}, {"at": 1.0, "stiffness": 90.0}]
EVERY = ("displacement", "velocity", "acceleration", "bending_moment", "shear_force", "stress", "strain")
SMOOTH = ("displacement", "bending_moment", "stress")  # of these the twin knows both sides of an event


def along(quantity: str = "displacement", body: str = "bed", **changes: Any) -> dict[str, Any]:
    return {"body": body, "quantity": quantity} | changes


def one_of_each(places: int, quantities: tuple[str, ...] = EVERY, **changes: Any) -> dict[str, Any]:
    return {quantity: along(quantity, places=places, **changes) for quantity in quantities}


def with_sensors(given: Study) -> Study:
    """The same study with a sensor at every place of every envelope."""
    sensors = {
        f"{name}_{number}": fixed(float(at), envelope.quantity, envelope.body)
        for name, envelope in given.envelope.items()
        for number, at in enumerate(envelope.along(given.value(f"body.{envelope.body}.length")))
    }
    return Study(**(given.data | {"sensor": sensors, "output": ALL}))


TWINS = {
    "mass": lambda: (mass(0.5, cruise(0.0, 1.0, 0.8)), {}, EVERY[:5]),
    "no correction": lambda: (mass(0.5, cruise(0.0, 1.0, 0.8)), {"solver": {"static_correction": False}}, EVERY[:4]),
    "own weight, dampers, two": lambda: (
        {"car": mass(0.5, cruise(-0.2, 1.1, 0.8)), "next": force(6.0, cruise(0.0, 1.0, 0.9), headway=0.35)},
        {"bed": beam(own_weight=True, supports=SPRINGS, fibre_distance=0.2)},
        SMOOTH,
    ),
    "turning": lambda: (mass(0.5, shuttle(0.2, 0.9, 0.8, 0.0, 1)), {}, SMOOTH[:2]),
}


@pytest.mark.parametrize("name", TWINS)
def test_extremes_are_those_of_the_twin(name: str) -> None:
    carriages, changes, quantities = TWINS[name]()
    bed = changes.pop("bed", beam())
    solver = {"steps": 64} | changes.pop("solver", {})
    given = study(bed, carriages, envelope=one_of_each(6, quantities, to=0.93), solver=solver, output=ALL, **changes)
    dataset = run(given, threads=1)
    read = with_sensors(given)
    twin = march_twin(read, "bed", dataset.elapsed.values)
    compared = 0
    for quantity in quantities:
        readings = [Reading(read, twin, read.sensor[f"{quantity}_{number}"]) for number in range(6)]
        seen = [np.array([*reading.values, *reading.values_before]) for reading in readings]
        for end, pick in (("max", np.max), ("min", np.min)):
            expected = np.array([pick(values) for values in seen])
            scale = float(np.abs(seen).max())
            compared += assert_close(dataset[f"{quantity}_envelope_{end}"], expected, scale, 1e-9)
    assert compared == 12 * len(quantities)


@pytest.mark.parametrize("scheme", ["average-acceleration", "generalized-alpha", "richardson"])
def test_extremes_are_those_of_sensors_at_the_same_places(scheme: str) -> None:
    parameters = {"rho_inf": 0.6} if scheme == "generalized-alpha" else {}
    solver = {"scheme": scheme, "steps": 400} | parameters
    bed = beam(fibre_distance=0.1, damping_ratio=0.02)
    envelopes = one_of_each(5) | {"part": along("bending_moment", places=4, **{"from": 0.2, "to": 0.8})}
    sweep = {"speed": {"of": "carriage.car.motion.speed", "values": [0.5, 1.0]}}
    given = study(bed, mass(0.2, cruise(-0.1, 1.2, 0.5, after=0.5)), envelope=envelopes, sweep=sweep, solver=solver)
    found, sensors = run(given), run(with_sensors(given))
    np.testing.assert_allclose(found.part_place.values, [0.2, 0.4, 0.6, 0.8], rtol=1e-14, atol=0)
    for name in envelopes:
        for end in ("max", "min"):
            expected = np.stack([sensors[f"{name}_{j}_{end}"] for j in range(found.sizes[f"{name}_place"])], axis=-1)
            assert found[f"{name}_envelope_{end}"].dims == ("speed", f"{name}_place")
            scale = float(np.abs(expected).max())
            assert_close(found[f"{name}_envelope_{end}"], expected, scale, 1e-11)
        if scheme == "average-acceleration":
            history = sensors[f"{name}_2"].values
            assert_close(found[f"{name}_envelope_max"][:, 2], history.max(axis=-1), float(np.abs(history).max()), 1e-11)


def test_a_slow_force_on_a_pinned_beam() -> None:
    """The largest moment at x is P x (L - x)/L, with four modes only by the static correction."""
    load, length = 3.0, 2.0
    bed = beam(length=length, damping_ratio=0.05)
    slow = cruise(0.0, length, 0.005 * math.pi / length)  # of the critical speed
    given = study(bed, force(load, slow), envelope={"moments": along("bending_moment", places=21)})
    found = run(given)
    x = found.moments_place.values
    expected = load * x * (length - x) / length
    assert_close(found.moments_envelope_max, expected, expected.max(), 5e-3)
    assert np.all(found.moments_envelope_min.values > -5e-3 * expected.max())
    plain = run(Study(**(given.data | {"solver": {"static_correction": False}})))
    assert np.abs(plain.moments_envelope_max.values - expected).max() > 0.05 * expected.max()


def strut(**more: Any) -> dict[str, Any]:
    """A girder that climbs 3 m over 4 m, on a pin at its foot and a roller at its head."""
    nodes = {"a": [0.0, 0.0, 0.0], "b": [4.0, 0.0, 3.0]}
    supports = {"a": "pinned", "b": ["z"]}
    return straight(supports, elements=6, plane="xz", modes=6, damping_ratio=0.2, node=nodes, **more)


def climbing(load: float, speed: float, bed: dict[str, Any], **changes: Any) -> Study:
    """A force that acts straight down and climbs the strut."""
    tables = {"body": {"bed": bed}, "sensor": {"middle": fixed(2.0, "axial_force")}} | changes
    return study({"length": 5.0}, force(load, cruise(0.0, 5.0, speed)), **tables)


def test_axial_force_in_a_strut() -> None:
    """Below the load the foot's reaction pushes with its part along the strut, above it the head's pulls."""
    load, slope = 1000.0, 0.6
    envelopes = {"axial": along("axial_force", places=6), "moments": along("bending_moment", places=6)}
    found = run(climbing(load, 0.3, strut(), envelope=envelopes))
    x = found.axial_place.values / 5.0
    inner = slice(1, 5)  # at its ends the load comes and goes at once
    assert_close(found.axial_envelope_min[inner], (-load * slope * (1.0 - x))[inner], load, 5e-3)
    assert_close(found.axial_envelope_max[inner], (load * slope * x)[inner], load, 5e-3)
    assert_close(found.moments_envelope_max, load * 0.8 * 5.0 * x * (1.0 - x), load, 5e-3)
    pair = [float(found.middle_max), float(found.middle_min)]
    assert_close(pair, [load * slope * 0.4, -load * slope * 0.6], load, 5e-3)
    assert found.middle_max.attrs["units"] == "N"


def test_axial_force_by_own_weight() -> None:
    bed = strut(own_weight=True)
    found = run(climbing(1e-3, 1.0, bed, envelope={"axial": along("axial_force", places=5)}, initial="equilibrium"))
    weight = 9.81 * 7850.0 * 0.01
    x = found.axial_place.values
    expected = 0.6 * weight * (x - 2.5)
    for end in ("max", "min"):
        assert_close(found[f"axial_envelope_{end}"], expected, expected.max(), 1e-5)


def test_stress_of_a_strut_counts_the_axial_force() -> None:
    """Extreme fibre below: N/A + M c/I, wherever the load stands."""
    x, c, area, inertia = np.linspace(0.0, 5.0, 6)[1:5], 1e-3, 0.01, 8.33e-6
    bed = strut(section={"fibre_distance": c})
    found = run(climbing(1000.0, 0.3, bed, envelope={"stress": along("stress", places=6)}))
    s = np.linspace(0.0, 5.0, 5001)[:, None]
    axial = 600.0 * np.where(s > x, s / 5.0 - 1.0, s / 5.0)
    moment = 800.0 * np.where(s > x, x * (5.0 - s) / 5.0, s * (5.0 - x) / 5.0)
    expected = axial / area + moment * c / inertia
    assert_close(found.stress_envelope_max[1:5], expected.max(axis=0), expected.max(), 5e-3)


def digest(plan: Plan, chunk: int | None, threads: int) -> dict[str, bytes]:
    collector = Collector(plan.size)
    execute(plan, collector.add, Threads(threads), chunk=chunk)
    return {name: array.tobytes() for name, array in collector.arrays.items()}


def mixed() -> Study:
    """25 variants on springs, which all carry values."""
    data = dict(test_determinism.mixed().data)
    sweep = {name: axis for name, axis in data["sweep"].items() if name in ("speed", "weight")}
    envelopes = {"shape": along(places=9), "moments": along("bending_moment", places=5)}
    fixed_steps = {"steps": 200, "tolerance": 0.1}
    return Study(
        **(data | {"sweep": sweep, "envelope": envelopes, "output": {"histories": "none"}, "solver": fixed_steps})
    )


@pytest.mark.fault(20)
@pytest.mark.slow
def test_same_bits_for_any_chunks_and_threads() -> None:
    given = mixed()
    whole = digest(make_plan(given), None, 2)
    assert "shape_envelope_max" in whole
    assert digest(make_plan(given), 17, 1) == whole


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "unknown body": (along(body="bad"), r"envelope\.e\.body: no such body"),
    "unknown quantity": (along("moments"), r"envelope\.e\.quantity"),
    "one place": (along(places=1), r"envelope\.e\.places"),
    "too many places": (along(places=202), r"envelope\.e\.places"),
    "backward": (along(**{"from": 0.7, "to": 0.2}), r"envelope\.e.*goes forward"),
    "off the body": (along(to=1.2), r"envelope\.e\.to: an envelope off its body"),
    "starts off the body": (along(**{"from": 1.2}), r"envelope\.e\.from: an envelope off its body"),
    "unknown key": (along(at=0.3), r"envelope\.e\.at"),
    "axial force of a beam": (along("axial_force"), r"envelope\.e\.quantity: axial_force is not available on body bed"),
    "strain without a fibre": (along("strain"), r"body\.bed\.fibre_distance"),
    "stress without a fibre": (along("stress"), r"body\.bed\.fibre_distance"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_name_the_place(name: str) -> None:
    envelope, words = REFUSED[name]
    with pytest.raises(BadInput, match=words):
        study(beam(), mass(0.5, cruise(0.0, 1.0, 0.8)), envelope={"e": envelope})


@pytest.mark.parametrize("name", ["status", "midspan_x", "0a"])
def test_names_that_cannot_stand_in_an_archive(name: str) -> None:
    sensors = {"midspan_x_envelope": fixed(0.5)}  # its largest value would have the same name
    with pytest.raises(BadInput, match=name):
        study(beam(), mass(0.5, cruise(0.0, 1.0, 0.8)), envelope={name: along()}, sensor=sensors)


def test_a_coordinate_is_no_axis() -> None:
    sweep = {"e_place": {"of": "carriage.car.mass", "values": [0.1, 0.2]}}
    with pytest.raises(BadInput, match=r"sweep\.e_place"):
        study(beam(), mass(0.5, cruise(0.0, 1.0, 0.8)), envelope={"e": along()}, sweep=sweep)


def test_sweeps_that_would_move_the_places() -> None:
    lengths = {"length": {"of": "body.bed.length", "values": [1.0, 1.5]}}
    bed, car = beam(), mass(0.5, cruise(0.0, 1.0, 0.8))
    with pytest.raises(BadInput, match=r"envelope\.e: the places of an envelope must be the same"):
        run(study(bed, car, envelope={"e": along()}, sweep=lengths))
    found = run(study(bed, car, envelope={"e": along(places=3, to=0.9)}, sweep=lengths))
    assert found.e_place.values.tolist() == [0.0, 0.45, 0.9]
    places = {"places": {"of": "envelope.e.places", "values": [5, 6]}}
    with pytest.raises(BadInput, match=r"envelope\.e\.places"):
        run(study(bed, car, envelope={"e": along()}, sweep=places))


def test_a_body_that_rides() -> None:
    """A flexible table on two shoes: envelopes along it and along its bed are what sensors read there."""
    shoe = {"stiffness": 500.0, "damping": 0.1}
    car = {
        "on": "bed",
        "kind": "body",
        "body": "table",
        "reference": 0.25,
        "motion": cruise(0.3, 0.7, 0.8),
        "contacts": {"front": shoe | {"at": 0.4}, "rear": shoe | {"at": 0.1}},
    }
    bed, table = beam(), beam(length=0.5, supports="free-free", modes=5, density=0.5, damping_ratio=0.02)
    envelopes = {
        f"{body}_{quantity}": along(quantity, body, places=4, **{"from": 0.03, "to": 0.47})
        for body in ("bed", "table")
        for quantity in ("displacement", "bending_moment", "velocity")
    }
    tables = {"body": {"bed": bed, "table": table}, "initial": "equilibrium", "solver": {"steps": 500}}
    given = study(bed, {"car": car}, envelope=envelopes, **tables)
    found, sensors = run(given), run(with_sensors(given))
    for name in envelopes:
        for end in ("max", "min"):
            expected = np.array([float(sensors[f"{name}_{number}_{end}"]) for number in range(4)])
            assert_close(found[f"{name}_envelope_{end}"], expected, np.abs(expected).max(), 1e-11)


def test_a_rigid_body_has_no_section_forces() -> None:
    rigid = {"kind": "rigid", "length": 1.0, "mass": 1.0, "inertia": 0.1}
    given = {"body": {"bed": beam(), "table": rigid}, "envelope": {"e": along("bending_moment", "table")}}
    with pytest.raises(BadInput, match=r"envelope\.e\.quantity: bending_moment is not available on body table"):
        study(beam(), mass(0.5, cruise(0.0, 1.0, 0.8)), **given)
