"""Variants that differ in the units of time and force share a scene, and are what each is by itself."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
import xarray as xr

import studies
from engine.batch.plan import make_plan
from engine.bodies.frame.frame import MATERIAL
from engine.scene.study import Study, load
from studies.protocol.library import find_study
from tests.engine.build import aboard, cruise, fixed, force, mass, oscillator, shuttle, steel, study, under

GROWN = {
    "body.bed.youngs_modulus": 1.6e11,
    "body.bed.second_moment": 1.1e-5,
    "body.bed.area": 0.013,
    "body.bed.density": 5000.0,
}
AXES = {path.split(".")[-1][:4]: path for path in GROWN}
BED = steel(10.0, modes=4, damping_ratio=0.02, fibre_distance=0.05)
MOVE = {"kind": "point-to-point", "start": 1.0, "end": 8.0, "speed": 6.0, "acceleration": 20.0, "jerk": 400.0}
READ = {
    "mid": fixed(4.0),
    "dynamic": fixed(4.0) | {"part": "dynamic"},
    "velocity": fixed(4.0, "velocity"),
    "acceleration": under("car", "acceleration"),
    "moment": under("car", "bending_moment"),
    "reaction": fixed(0.0, "support_reaction"),
}
LEFT_OUT = {"estimated_error", "error_estimate", "tolerance"}  # differences of what is nearly equal


def swept(one: Study, *paths: str) -> Study:
    """The study and each of these numbers another time, in all combinations."""
    axes = {
        name: {"of": path, "values": [one.value(path), GROWN[path]]} for name, path in AXES.items() if path in paths
    }
    return one.with_values({"sweep": axes})


SCENES: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any]]] = {
    "a train of a mass and a force": (
        BED | {"own_weight": True},
        {
            "car": mass(30.0, cruise(-1.0, 12.0, 8.0, after=2.0)),
            "next": force(500.0, cruise(0.0, 10.0, 8.0), delay=0.4),
        },
        {"initial": "equilibrium"},
    ),
    "a damped sprung mass on its wheel": (
        BED | {"supports": "clamped-free"},
        {"car": oscillator(40.0, 2e4, cruise(0.0, 10.0, 8.0, after=1.0), wheel_mass=5.0, damping=300.0)},
        {"sensor": {name: one for name, one in READ.items() if name != "dynamic"} | {"body": aboard("car")}},
    ),
    "a move in its own time": (
        BED | {"damping_ratio": {"rayleigh": [0.5, 1e-4]}},
        {"car": mass(30.0, MOVE | {"dwell": 0.4})},
        {
            "output": {"residual": True},
            "sensor": READ | {"mid": fixed(4.0) | {"settling_band": 1e-3}},
            "envelope": {"along": {"body": "bed", "quantity": "shear_force", "places": 5}},
        },
    ),
    "cycles": (
        BED,
        {"car": mass(30.0, shuttle(1.0, 8.0, 6.0, 0.1, 2))},
        {"kind": "asymmetry", "sensor": {"mid": fixed(4.0), "moment": under("car", "bending_moment")}},
    ),
    "peaks": (
        BED,
        {"car": mass(30.0, shuttle(1.0, 8.0, 6.0, 0.1, 2))},
        {"kind": "double-peak", "sensor": {"moment": fixed(4.0, "bending_moment"), "mid": fixed(5.0)}},
    ),
}
MARCHED = {"steps": 800, "scheme": "average-acceleration", "audit": 0, "tolerance": 0.5}


def described(name: str) -> Study:
    """One of the scenes."""
    bed, carriages, changes = SCENES[name]
    return study(bed, carriages, **{"sensor": READ, "output": {}, "solver": MARCHED} | changes)


def compare(found: xr.Dataset, alone: xr.Dataset) -> int:
    """How many results that are numbers are those of a variant by itself alone."""
    numbers = [name for name, one in alone.variables.items() if one.dtype.kind == "f" and name not in LEFT_OUT]
    for name in numbers:
        own = alone[name].values
        most = np.max(np.abs(own), where=np.isfinite(own), initial=0.0)
        np.testing.assert_allclose(found[name].values, own, rtol=0.0, atol=1e-9 * most, err_msg=str(name))
    return sum(bool(np.isfinite(alone[name]).any()) for name in numbers)


@pytest.mark.parametrize("name", SCENES)
def test_each_variant_is_what_it_is_by_itself(name: str) -> None:
    """Every number, of every dimension, with one scene for all."""
    one = described(name)
    everything = swept(one, *GROWN)
    assert len(make_plan(everything).grids) == 1
    found = studies.run(everything)
    for place in ((1, 0, 1, 0), (1, 1, 1, 1), (0, 1, 0, 1)):
        own = {path: GROWN[path] for path, other in zip(GROWN, place, strict=True) if other}
        alone = studies.run(one.with_values(own))
        assert compare(found.isel(dict(zip(AXES, place, strict=True))), alone) > 8


@pytest.mark.parametrize("kind", ["eigenfrequencies", "influence"])
def test_what_stands_still_is_counted_alike(kind: str) -> None:
    one = study(BED | {"own_weight": True}, {"car": oscillator(40.0, 2e4, cruise(0.0, 10.0, 8.0), wheel_mass=5.0)})
    one = one.with_values({"kind": kind, "question": {"positions": 5}, "sensor": {"moment": READ["moment"]}})
    paths = ("body.bed.youngs_modulus", "body.bed.density")
    found = studies.run(swept(one, *paths))
    for place in product((0, 1), repeat=2):
        own = {path: GROWN[path] for path, other in zip(paths, place, strict=True) if other}
        alone = studies.run(one.with_values(own))
        part = found.isel(youn=place[0], dens=place[1])
        for name, array in alone.data_vars.items():
            if "youn" in found[name].dims and array.dtype.kind == "f" and name not in LEFT_OUT:
                np.testing.assert_allclose(part[name].values, array.values, rtol=1e-10, equal_nan=True)


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"body.bed.supports": [{"at": 0.0, "stiffness": 1e7}, {"at": 10.0, "stiffness": 1e7}]}, "youngs_modulus"),
        ({"sensor.stress": fixed(4.0, "stress")}, "second_moment"),
        ({"body.other": BED}, "area"),
    ],
    ids=["springs", "stress by a fibre", "two bodies"],
)
def test_what_has_numbers_of_its_own_has_scenes_of_its_own(changes: dict[str, Any], path: str) -> None:
    one = study(BED, mass(30.0, cruise(0.0, 10.0, 8.0)), solver=MARCHED)
    assert len(make_plan(swept(one, f"body.bed.{path}")).grids) == 1
    assert len(make_plan(swept(one.with_values(changes), f"body.bed.{path}")).grids) == 2


def test_a_frame_of_one_material_is_counted_too() -> None:
    """Pushed along and across by a head that brakes beside its axis; one modulus of two sections is one of one."""
    one = load(find_study("machine-tool")).without_sweep()
    one = one.with_values({f"solver.{key}": value for key, value in MARCHED.items()} | {"body.portal.modes": 6})
    keys = {key: [f"body.portal.section.{name}.{key}" for name in ("beam", "column")] for key in MATERIAL}
    values = {"youngs_modulus": [2.1e11, 7e10], "density": [7850.0, 2700.0]}
    axes = {key: {"of": keys[key], "values": values[key]} for key in MATERIAL}
    everything = one.with_values({"sweep": axes})
    assert len(make_plan(everything).grids) == 1
    found = studies.run(everything)
    own = {path: values[key][1] for key in MATERIAL for path in keys[key]}
    assert compare(found.isel(dict.fromkeys(MATERIAL, 1)), studies.run(one.with_values(own))) > 8
    half = axes | {"youngs_modulus": axes["youngs_modulus"] | {"of": keys["youngs_modulus"][:1]}}
    assert len(make_plan(one.with_values({"sweep": half})).grids) == 2
    for key in (
        {"body.portal.point_mass.foot": {"node": "left", "mass": 5.0}},
        {"body.portal.section.beam.density": 1.0},
    ):
        assert len(make_plan(one.with_values(key).with_values({"sweep": {"density": axes["density"]}})).grids) == 2


def test_variants_that_read_as_many_modes_share_a_scene() -> None:
    """Up to a frequency limit, which counts the modes of each variant itself."""
    low = {"low": fixed(4.0, "acceleration") | {"frequency_limit": 8.0}}
    one = study(BED, mass(30.0, cruise(0.0, 10.0, 8.0)), solver=MARCHED, sensor=low)
    moduli = [5e9, 2e10, 1.2e11, 1.8e11, 2e11]
    everything = one.with_values({"sweep": {"modulus": {"of": "body.bed.youngs_modulus", "values": moduli}}})
    plan, found = make_plan(everything), studies.run(everything)
    within = [np.count_nonzero(plan.base.bodies[0].modal.omega * np.sqrt(E / 2.1e11) <= 16.0 * np.pi) for E in moduli]
    assert [own.tolist() for own in sorted(plan.members, key=lambda own: int(own[0]))] == [[0], [1], [2], [3, 4]]
    assert within == [4, 3, 2, 1, 1]
    for place, modulus in enumerate(moduli):
        assert (
            compare(found.isel(modulus=place), studies.run(one.with_values({"body.bed.youngs_modulus": modulus}))) > 5
        )


def test_a_stress_of_a_stiffer_beam_is_counted_too() -> None:
    """With E, not with I, by which the distance of its fibre does not change."""
    one = study(BED, mass(30.0, cruise(0.0, 10.0, 8.0)), solver=MARCHED, sensor={"stress": fixed(4.0, "stress")})
    everything = swept(one, "body.bed.youngs_modulus", "body.bed.second_moment")
    assert len(make_plan(everything).grids) == 2
    found = studies.run(everything)
    alone = studies.run(one.with_values({path: GROWN[path] for path in list(GROWN)[:2]}))
    np.testing.assert_allclose(found["stress_max"].values[1, 1], alone["stress_max"].values, rtol=1e-9)


def test_a_thousand_beams_share_their_pilots() -> None:
    """Of random stiffness and mass each is within what is told of it, beside marches of its own."""
    draw = {"sobol": 1000, "from": 0.7, "to": 1.4}
    one = study(steel(10.0, damping_ratio=0.02), mass(30.0, cruise(0.0, 10.0, 8.0)))
    axes = {
        name: draw | {"of": path, "from": 0.7 * one.value(path), "to": 1.4 * one.value(path)}
        for name, path in (("E", "body.bed.youngs_modulus"), ("rho", "body.bed.density"))
    }
    axes["speed"] = draw | {"of": "carriage.car.motion.speed", "from": 5.0, "to": 25.0}
    everything = one.with_values({"sweep": axes, "solver.tolerance": 1e-3})
    plan, found = make_plan(everything), studies.run(everything)
    assert not plan.converges and len(plan.grids) == 1
    for variant in (3, 500, 901):
        own = studies.run(plan.cases.study_of(everything, variant).with_values({"solver.tolerance": 1e-6}))
        static = float(own["midspan_max"] / own["dynamic_amplification"].sel(sensor="midspan"))
        off = abs(float(found["midspan_max"][variant]) - float(own["midspan_max"])) / static
        assert off <= 1.1 * float(found["estimated_error"].sel(result="midspan_max")[variant]) + 1e-6 <= 1.2e-3
