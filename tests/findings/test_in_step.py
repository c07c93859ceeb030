"""Speeds at which axles push in step: where their distances say, as strongly as what rings on after the train."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import engine
import studies
from engine.batch.dataset import model_groups
from engine.model.distinct_models import base_scene
from engine.scene.study import Study
from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from studies.findings.in_step import InStep, speeds_in_step
from studies.kinds.passage import KIND
from studies.results.results import Results
from tests.engine.build import Table, beam, cruise, fixed, force, mass, study

REGULAR = {"axles": 5, "spacing": 3.0}
ELASTIC = [{"at": 0.0, "stiffness": 1.5e9}, {"at": 20.0, "stiffness": 1e12}, {"at": 40.0, "stiffness": 1.5e9}]
BRIDGE: Table = {
    **{"kind": "beam", "length": 40.0, "area": 1.0, "second_moment": 1.0, "youngs_modulus": 3.2e10, "density": 9000.0},
    **{"supports": ELASTIC, "damping_ratio": 0.01},
}
ARTICULATED = [3.0, 11.0, 3.0, 3.525, 3.0, *([18.0, 3.0] * 12)]


def hauled(bed: Table, **own: Any) -> Study:
    """A train over a body, whose middle is read; sensor: of it."""
    sensor = {"middle": fixed(0.5 * bed["length"], "acceleration") | own.pop("sensor", {})}
    table = force(2.0, cruise(0.0, bed["length"], 1.0)) | own
    return study(bed, {}, train={"tram": table}, sensor=sensor)


def bodies(given: Study) -> xr.Dataset:
    """The body as its archive tells it."""
    return model_groups(base_scene(given))["/model/bed"]


def found(given: Study, low: float, high: float) -> list[InStep]:
    return speeds_in_step(given, "tram", bodies(given), (low, high), given.sensor.values())


def with_frequencies(*hertz: float) -> tuple[Study, xr.Dataset]:
    """A train over a body with some frequencies and the shapes of a pinned beam."""
    given = hauled(beam(modes=len(hertz)), **REGULAR)
    return given, bodies(given).assign(frequency=("body_mode", list(hertz)))


def test_axles_at_equal_distances_push_in_step_where_they_come_once_in_some_periods() -> None:
    """At f d/k, by all of their load, where they are many; they have no other maxima above 0.3 but near 0.22."""
    given = hauled(beam(modes=1), **(REGULAR | {"axles": 20}))
    body = bodies(given).assign(frequency=("body_mode", [2.0]))
    speeds = speeds_in_step(given, "tram", body, (1.4, 7.0), ())
    assert [one.speed for one in speeds] == pytest.approx([6.0, 3.0, 2.0, 1.5], rel=1e-3)
    half = np.array([np.pi * 3.0 * 2.0 / one.speed for one in speeds])
    parts = np.abs(np.sin(20.0 * half) / (20.0 * np.sin(half)))
    assert [one.part for one in speeds] == pytest.approx(parts.tolist(), abs=1e-9) and parts.min() > 0.99


def test_the_spectrum_of_axles_at_equal_distances_is_largest_where_they_come_once_in_some_periods() -> None:
    """At f d/k, by all of their load; five of them have no other maxima above 0.3 but near 0.25."""
    speeds = np.geomspace(1.4, 7.0, 4096)
    share = with_frequencies(2.0)[0].train["tram"].in_step(speeds / 2.0)
    at = 1 + np.flatnonzero((share[1:-1] > share[:-2]) & (share[1:-1] >= share[2:]) & (share[1:-1] >= 0.3))
    assert speeds[at][::-1].tolist() == pytest.approx([6.0, 3.0, 2.0, 1.5], rel=1e-3)
    assert share[at].tolist() == pytest.approx([1.0] * 4, abs=1e-3)


def test_two_axles_are_no_train() -> None:
    """Two pushes leave no resonance."""
    assert found(hauled(beam(), axles=3, spacing=0.3), 0.2, 1.0)
    assert not found(hauled(beam(), axles=2, spacing=0.3), 0.2, 1.0)


def test_of_many_the_strongest_are_told() -> None:
    """Eight at most, the highest speed first, of four frequencies."""
    given, body = with_frequencies(2.0, 5.0, 9.0, 30.0, 50.0)
    body["mode_shape"] *= np.array([1.0, 1.0, 1.0, 3.0, 9.0])[:, None]
    every = [
        one
        for mode in range(4)
        for low in np.geomspace(1.4, 40.0, 13)[:-1]
        for one in speeds_in_step(given, "tram", body.isel(body_mode=[mode]), (low, low * 1.324), given.sensor.values())
    ]
    told = speeds_in_step(given, "tram", body, (1.4, 40.0), given.sensor.values())
    assert len(every) > 8 == len(told) and {one.frequency for one in told} <= {2.0, 5.0, 9.0, 30.0}
    least = min(one.swing for one in told)
    assert sum(one.swing > 1.01 * least for one in every) <= 8
    assert told == sorted(told, reverse=True)


def swing_of(given: Study, one: InStep, mode: int, places: Array) -> float:
    """That of a mode of the bridge at some places, each of its parts by itself: the sum of F exp(-i w t) over axles,
    |integral phi exp(i w x/v) dx| along what is crossed, and the mean that damping leaves while the axles come."""
    modal, train = base_scene(given).bodies[0].modal, given.train["tram"]
    omega, time, pushed = float(modal.omega[mode]), 0.0, 0j
    for axle, way in enumerate((0.0, *ARTICULATED)):
        time += way / one.speed
        pushed += train.own("force")[axle] * np.exp(-1j * omega * time)
    assert one.part == pytest.approx(abs(pushed) / train.load, rel=1e-9)

    def along(kind: str) -> float:
        shape, wave = (lambda x: float(modal.shape([x])[0, mode])), omega / one.speed
        return float(quad(shape, *sorted((train.motion.start, train.motion.end)), weight=kind, wvar=wave, limit=200)[0])

    left = quad(lambda t: np.exp(-0.01 * omega * t) / time, 0.0, time)[0]
    moved = float(np.abs(modal.shape(places)[:, mode]).max())
    return float(abs(pushed) * np.hypot(along("cos"), along("sin")) * omega / one.speed * moved * left)


@pytest.mark.parametrize("quantity", ["acceleration", "displacement"])
@pytest.mark.parametrize("ends", [(0.0, 40.0), (33.0, 7.0)])
def test_swings_are_sums_over_axles_and_along_the_track(ends: tuple[float, float], quantity: str) -> None:
    given = hauled(
        BRIDGE,
        spacing=ARTICULATED,
        force=[19e4, *([17e4] * 29)],
        motion=cruise(*ends, 50.0),
        sensor={"quantity": quantity, "at": 33.0},
    )
    told, omega = found(given, 28.0, 97.0), base_scene(given).bodies[0].modal.omega
    assert len(told) > 5
    for one in told:
        mode = int(np.argmin(np.abs(omega / (2.0 * np.pi) - one.frequency)))
        order = {"acceleration": 1.0, "displacement": float(omega[mode]) ** 2}[quantity]
        assert one.swing == pytest.approx(swing_of(given, one, mode, np.array([33.0])) / order, rel=2e-3)


def test_what_rings_on_after_a_train_is_as_large() -> None:
    """On an undamped beam of one mode, which is read where that moves most, by the march itself."""
    bed = beam(modes=1, damping_ratio=0.0)
    train = {"spacing": [0.4, 0.7, 0.4], "force": [1.0, 2.0, 2.0, 1.0]}
    told = found(hauled(bed, **train), 0.3, 1.5)
    assert len(told) > 1
    for one in told:
        motion = cruise(0.0, 1.0, one.speed, after=3.0)
        changes: Any = {"output": {"residual": True, "histories": "none"}, "solver": {"steps": 4000, "tolerance": 0.5}}
        given = hauled(bed, **train, motion=motion).with_values(changes)
        assert float(engine.run(given)["middle_residual"]) == pytest.approx(one.swing, rel=1e-3)


def test_weights_of_masses_push_and_slow_the_body_down() -> None:
    """As forces do, by gravity, on a beam that is as much heavier as masses are on it on average."""
    masses = study(beam(), {}, train={"tram": mass(2.0 / 9.81, cruise(0.0, 1.0, 1.0)) | REGULAR})
    per_metre = 2.0 / 9.81 / 3.0
    as_force = found(hauled(beam(density=1.0 + per_metre), **REGULAR, sensor={"quantity": "displacement"}), 0.2, 1.0)
    told = found(masses, 0.2, 1.0)
    assert np.array(told)[:, :4].astype(float) == pytest.approx(np.array(as_force)[:, :4].astype(float), rel=2e-3)
    assert len(told) > 3


@pytest.mark.parametrize("axles, spacing, kilograms", [(11, 1.1, 0.23), (8, 0.3, 0.12), (5, 0.2, 0.05)])
def test_masses_swing_a_bridge_most_where_they_are_in_step_with_it_and_them(
    axles: int, spacing: float, kilograms: float
) -> None:
    """By marches of many speeds; the bridge alone is 5 to 20 % quicker."""
    train = mass(kilograms, cruise(0.0, 1.0, 1.0)) | {"axles": axles, "spacing": spacing}
    tables: Table = {"train": {"tram": train}, "sensor": {"middle": fixed(0.5)}}
    own, bed = spacing * np.pi / 2.0, beam(damping_ratio=0.01)
    strongest = max(found(study(bed, {}, **tables), 0.3 * own, 1.3 * own), key=lambda one: one.swing)
    speeds = np.linspace(0.8, 1.25, 91) * strongest.speed
    sweep = {"speed": {"of": "train.tram.motion.speed", "values": speeds.tolist()}}
    given = study(bed, {}, **tables, sweep=sweep, solver={"tolerance": 1e-2})
    swings = np.abs(engine.run(given)["middle_max"].values)
    assert speeds[np.argmax(swings)] == pytest.approx(strongest.speed, rel=0.04)


def test_the_worst_speeds_of_a_railway_bridge_are_told() -> None:
    """At which the march finds the largest accelerations of modes up to 30 Hz: 285, 250 and 220 km/h."""
    given = hauled(BRIDGE, spacing=ARTICULATED, force=19e4, sensor={"frequency_limit": 30.0, "at": 4.0})
    told = found(given, 100.0 / 3.6, 350.0 / 3.6)
    by_strength = sorted(told, key=lambda one: -one.swing)
    assert [3.6 * one.speed for one in by_strength[:3]] == pytest.approx([284.0, 248.0, 221.0], abs=1.0)
    assert max(one.frequency for one in told) < 30.0
    every = found(hauled(BRIDGE, spacing=ARTICULATED, sensor={"at": 4.0}), 28.0, 97.0)
    assert max(one.frequency for one in every) > 30.0


def test_a_quarter_of_a_long_train_in_step_with_a_third_mode_is_told() -> None:
    """A march of 40 axles over a bridge on elastic bearings finds 7.4 m/s2 at 327 km/h, by its third mode, more than by
    all of what comes in step with the first one."""
    soft = [{"at": at, "stiffness": 2e8} for at in (0.0, 35.0)]
    bridge = BRIDGE | {"length": 35.0, "youngs_modulus": 8e10, "supports": soft}
    coaches = [*([2.5, 14.875, 2.5, 4.9] * 10)][:-1]
    told = found(hauled(bridge, spacing=coaches, force=17e4, sensor={"frequency_limit": 30.0}), 70.0, 111.0)
    strongest, *_ = sorted(told, key=lambda one: -one.swing)
    assert 3.6 * strongest.speed == pytest.approx(326.0, abs=2.0) and 0.2 < strongest.part < 0.3
    assert strongest.frequency == pytest.approx(14.6, rel=0.01)
    assert min(one.frequency for one in told) == pytest.approx(3.24, rel=0.01)


@pytest.mark.parametrize("axles", [20, 40, 80])
def test_what_stands_beside_a_resonance_is_none(axles: int) -> None:
    """Of axles in one distance a fifth comes in step beside every resonance, as many as there are."""
    given = hauled(beam(modes=1), **(REGULAR | {"axles": axles}))
    body = bodies(given).assign(frequency=("body_mode", [2.0]))
    assert [one.speed for one in speeds_in_step(given, "tram", body, (1.4, 7.0), ())] == pytest.approx(
        [6.0, 3.0, 2.0, 1.5], rel=1e-3
    )


def test_what_builds_up_to_next_to_nothing_is_not_told() -> None:
    """Of pushes 2/3 and 2/9 of the length apart, which cancel each other along the half-wave of the first mode, of the
    second one, which is still in the middle, and of higher ones, which hardly swing. What a crossing cancels swings
    most a little faster and slower: an eight-axled tram on two spans of 28 m by 0.94 and 1.19 m/s2 at 79 and 91 km/h,
    and in step, at 85.5 km/h, by 0.34."""
    spread = hauled(beam(), axles=5, spacing=2.0 / 3.0, sensor={"quantity": "displacement"})
    first = float(base_scene(spread).bodies[0].modal.omega[0]) / (2.0 * np.pi)
    told = found(spread, 0.2 * first, 0.9 * first)
    assert [one.frequency for one in told] == pytest.approx([first] * len(told))

    def swing(way: Array) -> Array:
        """|sum of exp(i k x_j)| times |integral of sin(pi x) exp(i k x)| k, k = 2 pi/way, without damping."""
        k = 2.0 * np.pi / way
        pushed = np.abs(np.exp(1j * k * 2.0 / 3.0 * np.arange(5)[:, None]).sum(axis=0))
        return np.asarray(pushed * np.abs((1.0 + np.exp(1j * k)) * np.pi / (np.pi**2 - k**2)) * k)

    ways = np.array([one.way for one in told])
    assert np.abs(ways - 2.0 / 3.0).min() > 0.05 and np.abs(ways - 2.0 / 9.0).min() > 0.006
    for off in (0.99, 1.01):
        assert (swing(off * ways) < swing(ways)).all()


def sentence(**own: Any) -> str:
    """What the answer says of speeds in step, of five forces or masses on a bridge of 1.5708 Hz."""
    own = {"sensor": {"middle": fixed(0.5)}, "solver": {"tolerance": 1e-2}} | own
    results = Results.of(studies.run(study(beam(damping_ratio=0.02), {}, **own)))
    return next((part for part in " ".join(KIND.findings(results)).split(". ") if part.startswith("Axles")), "")


def speeds_of_tram(low: float, high: float, **others: Any) -> Table:
    return {"speed": {"of": "train.tram.motion.speed", "from": low, "to": high, "count": 41}} | others


FORCES = force(2.0, cruise(0.0, 1.0, 1.0)) | {"axles": 9, "spacing": 0.3}
MASSES = mass(0.12, cruise(0.0, 1.0, 1.0)) | {"axles": 9, "spacing": 0.3}


def test_the_answer_tells_the_strongest_within_the_sweep() -> None:
    told = sentence(train={"tram": FORCES}, sweep=speeds_of_tram(0.3, 0.6))
    assert told.startswith("Axles of tram push in step with a frequency of bed (1.57 Hz) most strongly at 0.488")
    assert "beyond" not in told


@pytest.mark.parametrize("train, speed", [(FORCES, "0.488"), (MASSES, "0.41")])
def test_the_answer_tells_what_a_sweep_climbs_to(train: Table, speed: str) -> None:
    """A sweep that ends below, with its largest value at that end."""
    told = sentence(train={"tram": train}, sweep=speeds_of_tram(0.3, 0.38))
    assert f"most strongly at {speed}" in told and ", beyond the sweep" in told
    assert (" of bed with them on it (" in told) == (train is MASSES)


def test_distances_and_bodies_are_those_of_the_largest_value() -> None:
    """Of two lengths of wagons and two bridges those with the largest deflection, whichever way the lists go."""
    for order in (1, -1):
        others = {
            "apart": {"of": "train.tram.spacing_scale", "values": [1.0, 3.0][::order]},
            "stiffness": {"of": "body.bed.youngs_modulus", "values": [0.64, 1.0][::order]},
            "damping": {"of": "body.bed.damping_ratio", "values": [0.01, 0.02]},
        }
        told = sentence(train={"tram": FORCES}, sweep=speeds_of_tram(0.3, 0.6, **others))
        assert told.startswith("Axles of tram push in step with a frequency of bed (1.26 Hz) most strongly at 0.39")


def test_masses_that_only_press_do_not_slow_the_body_down() -> None:
    """Where the study computes them as forces."""
    as_forces = sentence(
        train={"tram": MASSES}, sweep=speeds_of_tram(0.3, 0.6), solver={"tolerance": 1e-2, "fidelity": "force"}
    )
    assert "frequency of bed (1.57 Hz) most strongly at 0.488" in as_forces


def test_what_hardly_swings_the_bridge_is_not_told() -> None:
    """The third mode, whose swing is a hundredth of what wagons so close deflect the bridge."""
    assert not sentence(train={"tram": FORCES | {"spacing": 0.15}}, sweep=speeds_of_tram(0.3, 0.6))
