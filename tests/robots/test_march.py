"""The march of robots on rails against particles over the ground, a whole frame, energy and momentum."""

from functools import cache

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from engine.bodies.frame.assembly import assemble
from engine.bodies.frame.frame import Frame
from engine.kernels.robots.layout import SEEN_ACTUAL, Record
from engine.robots.march import rest, stretches
from engine.robots.model import RobotModel, build
from engine.scene.study import Study
from tests.naive.robots_as_particles import SECOND, STEP, Scene, driven_by, virtual_work
from tests.robots.scenes import AVERAGE_ACCELERATION, FOX_GOODWIN, drive, errors, marched, scene

STIFF = 100.0  # times the stiffness of the rails: their rotations, small in the theory, are 1e-6 then


@cache
def fine(stiffer: float = STIFF) -> tuple[RobotModel, Record]:
    return marched(scene({"stiffer": stiffer}, solver={"tolerance": 1e-6}), 0.002, every=25)


def some(record: Record, count: int = 7) -> list[int]:
    """Stations spread over the run, away from events."""
    return [int(n) for n in np.linspace(8, len(record.coordinates) - 8, count)]


@pytest.mark.parametrize(("stiffer", "off"), [(STIFF, 2e-7), (1.0, 2e-7)], ids=["stiff", "soft"])
def test_particles_of_all_links_obey_newton_at_every_station(stiffer: float, off: float) -> None:
    """Inertia along every mode and joint is what rails and drives do there, but for rotations that are small."""
    model, record = fine(stiffer)
    for station in some(record):
        state = record.coordinates[station]
        twin = Scene(model, state[0, 3])
        values, rates, pushes = twin.coordinates(state[:, :3])
        work = virtual_work(twin.at, values, rates, pushes, 9.81)
        modes = model.modes
        springs = model.system.springs[:modes]
        own = pushes[:modes] + springs[:, 1] * rates[:modes] + springs[:, 0] * values[:modes]
        np.testing.assert_allclose((own + work[:modes]).astype(float), 0.0, atol=off * np.abs(work[:modes]).max())
        drives = [record.drive[station, r, : len(arm.drives)] for r, arm in enumerate(twin.arms)]
        exerted = work[modes:].astype(float)
        np.testing.assert_allclose(np.concatenate(drives), exerted, atol=off * np.abs(exerted).max())


def test_a_load_far_below_a_girder_stays_in_its_plane() -> None:
    """Nothing drives a trolley on the axis of a girder that is soft in torsion aside, but rounding: with matrices that
    were kept while it went by 0.1 m, corrections of the twist grew, and the load was off by a quarter of a metre."""
    girder = {
        "kind": "frame",
        "node": {"west": [0, 0, 0], "east": [18, 0, 0]},
        "section": {
            "hea": {
                "area": 0.0318,
                "second_moment": 9.014e-4,
                "second_moment_lateral": 1.712e-4,
                "torsion_constant": 3.78e-6,
                "youngs_modulus": 2.1e11,
                "poissons_ratio": 0.3,
                "density": 7850,
            }
        },
        "member": {"beam": {"nodes": ["west", "east"], "section": "hea", "elements": 18}},
        "supports": {"west": ["x", "y", "z", "rx"], "east": ["y", "z", "rx"]},
        "track": {"members": ["beam"]},
        "damping_ratio": 0.01,
        "modes": 48,
    }
    rope = {"kind": "revolute", "axis": [0, 1, 0], "mass": 8e3, "centre": [0, 0, -6], "inertia": [1, 1, 1]}
    hoist = {
        "mass": 1500,
        "inertia": [500, 500, 500],
        "tool": [0, 0, -6],
        "rail": {"speed": 1.67, "acceleration": 0.8, "jerk": 100},
        "links": [{**rope, "speed": 1, "acceleration": 1, "jerk": 10, "stiffness": 1}],
    }
    moves = {"arm": "hoist", "rails": ["girder"], "start": [3, 0], "feedforward": "gravity", "moves": [{"to": [9, 0]}]}
    study = Study(
        kind="portal",
        gravity=9.81,
        question={"duration": 4.0},
        body={"girder": girder},
        arm={"hoist": hoist},
        robot={"trolley": moves},
    )
    off = np.abs(errors(marched(study, 0.01, 4.0)[1])).reshape(-1, 3).max(axis=0)
    assert off[0] > 0.1
    assert off[1] < 1e-9


@pytest.mark.parametrize("feedforward", ["plan", "gravity"])
def test_drives_are_told_the_plan_and_steer_towards_it(feedforward: str) -> None:
    study = scene({"stiffer": STIFF}).with_values(
        {f"robot.{name}.feedforward": feedforward for name in ("portal", "hanging")}
    )
    model, record = marched(study, 0.004, every=50)
    for station in some(record, 4):
        state = record.coordinates[station]
        twin = Scene(model, state[0, 3])
        for r, arm in enumerate(twin.arms):
            plan = np.array(twin.plans[r], dtype=np.longdouble)
            if feedforward == "gravity":
                plan[1:] = 0.0
            told = driven_by(arm, *plan, 9.81, twin.payloads[r]).astype(float)
            for j, own in enumerate(arm.drives):
                k = model.system.coordinate[r, j]
                if k >= 0:
                    steered = told[j] - own.stiffness * state[k, 0] - own.damping * state[k, 1]
                    assert record.drive[station, r, j] == pytest.approx(steered, abs=1e-6)


def test_rails_carry_weight_and_inertia_and_nothing_else() -> None:
    """Force and moment of all contacts of a gantry, and the sum over its rails, against its particles."""
    model, record = fine()
    for station in some(record):
        state = record.coordinates[station]
        twin = Scene(model, state[0, 3])
        path = twin.coordinates(state[:, :3])
        times = STEP * np.arange(-3, 4)
        for r, robot in enumerate(twin.study.robot.values()):
            masses, _, _ = twin.robot(r, path[0])
            moved = np.array([twin.robot(r, path[0] + t * path[1] + t * t / 2 * path[2])[1] for t in times])
            force = (np.tensordot(SECOND, moved, axes=1) / STEP**2 + np.array([0, 0, 9.81])) * masses[:, None]
            total = force.sum(axis=0).astype(float)
            weight = 9.81 * float(masses.sum())
            np.testing.assert_allclose(record.robots[station, r, 6:9], total, atol=1e-7 * weight)
            grips = record.grips[station, r, :, :6]
            assert grips[:, 2].sum() == pytest.approx(record.robots[station, r, 8], abs=1e-8 * weight)
            np.testing.assert_allclose(grips[:, :3].sum(axis=0), record.robots[station, r, 6:9], atol=1e-8 * weight)
            rails = [twin.model.rails[name].start for name in robot.rails]
            base = np.mean(rails, axis=0) + np.array(robot.offset)
            base[0] = rails[0][0] + robot.offset[0]
            wrench = record.robots[station, r, 6:12]
            about = sum(np.cross(start, grip[:3]) + grip[3:] for start, grip in zip(rails, grips, strict=False))
            np.testing.assert_allclose(about, np.cross(base, wrench[:3]) + wrench[3:], atol=1e-8 * weight)


def test_errors_fall_with_the_square_of_the_step() -> None:
    study = scene()
    runs = [errors(marched(study, 0.008 / 2**k, every=2**k)[1]) for k in range(5)]
    apart = [float(np.abs(one - runs[-1]).max()) for one in runs[:-1]]
    order = np.polyfit(np.log([4.0, 2.0, 1.0]), np.log(apart[:3]), 1)[0]
    assert 1.7 < order < 2.4, apart


def test_fox_goodwin_goes_beyond_its_limit_and_is_the_more_accurate() -> None:
    """With modes that are twice too fast for the step, against a sixteenth of that by the other scheme."""
    study = scene()
    fine = errors(marched(study, 0.00125, every=16)[1])
    swift, usual = (
        np.abs(errors(marched(study, 0.02, scheme=scheme)[1]) - fine).max()
        for scheme in (FOX_GOODWIN, AVERAGE_ACCELERATION)
    )
    omega = np.sqrt(build(study).system.springs[: build(study).modes, 0].max())
    assert 0.02 * omega > 2 * 2.449
    assert swift < 0.3 * usual


def test_drives_do_the_work_that_becomes_energy_and_heat() -> None:
    """From the second move's beginning to its end, all joints with their springs: 1e-6 of the largest change."""
    model, record = marched(scene({"stiffer": STIFF}), 2.5e-4, duration=1.4)
    times = record.coordinates[:, 0, 3]
    here = np.flatnonzero((times > 0.45) & (times < 1.2))
    first, last = here[0], here[-1]
    energy = [_energy(model, record.coordinates[station]) for station in (first, last)]
    power = np.array([_power(model, record, station) for station in here])
    done = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(times[here]))
    assert energy[1] - energy[0] == pytest.approx(done, abs=2e-6 * np.abs(power).max())


def _energy(model: RobotModel, state: np.ndarray) -> float:
    """Kinetic energy and height of particles, and kinetic and elastic energy of rails."""
    twin = Scene(model, state[0, 3])
    values, rates, pushes = twin.coordinates(state[:, :3])
    times = STEP * np.arange(-3, 4)
    masses, places = twin.at(values)
    first = np.array([-1 / 60, 3 / 20, -3 / 4, 0, 3 / 4, -3 / 20, 1 / 60], dtype=np.longdouble)
    path = np.array([twin.at(values + t * rates + t * t / 2 * pushes)[1] for t in times])
    speed = np.tensordot(first, path, axes=1) / STEP
    modes, q, v = model.modes, state[: model.modes, 0], state[: model.modes, 1]
    rails = 0.5 * np.sum(v**2) + 0.5 * np.sum(model.system.springs[:modes, 0] * q**2)
    return float(0.5 * np.sum(masses[:, None] * speed**2) + 9.81 * np.sum(masses * places[:, 2])) + float(rails)


def _power(model: RobotModel, record: Record, station: int) -> float:
    state = record.coordinates[station]
    twin = Scene(model, state[0, 3])
    modes = model.modes
    rates = twin.coordinates(state[:, :3])[1][modes:].astype(float)
    drives = np.concatenate([record.drive[station, r, : len(arm.drives)] for r, arm in enumerate(twin.arms)])
    return float(drives @ rates - np.sum(model.system.springs[:modes, 1] * state[:modes, 1] ** 2))


def test_what_is_picked_up_slows_what_moves_and_what_is_put_down_does_not() -> None:
    """Momenta along all coordinates before and after both events, by particles."""
    model, record = marched(scene({"stiffer": STIFF}), 0.002)
    times = record.coordinates[:, 0, 3]
    events = np.flatnonzero(np.diff(times) == 0.0)
    jumps = []
    for station in events:
        before, after = record.coordinates[station], record.coordinates[station + 1]
        twin = Scene(model, times[station] + 1e-9)
        carried = twin.payloads, Scene(model, times[station] - 1e-9).payloads
        jumps.append(np.abs(after[:, 1] - before[:, 1]).max())
        if carried[0] == carried[1]:
            np.testing.assert_allclose(after[:, 1], before[:, 1], atol=1e-9)
        elif carried[0][0] > carried[1][0]:
            new, old = (_momenta(twin, load, state) for load, state in zip(carried, (after, before), strict=True))
            np.testing.assert_allclose(new, old, atol=1e-6 * np.abs(old).max())
        else:
            np.testing.assert_allclose(after[:, 1], before[:, 1], atol=1e-9)
    assert max(jumps) > 1e-7


def _momenta(twin: Scene, carried: tuple[float, ...], state: np.ndarray) -> np.ndarray:
    """M y' along modes and joints with a coordinate, y' without what is planned."""
    twin.payloads = carried
    values, rates, _ = twin.coordinates(state[:, :3])
    soft = np.concatenate(
        [
            np.ones(twin.model.modes, dtype=bool),
            *(twin.model.system.coordinate[r, : len(a.drives)] >= 0 for r, a in enumerate(twin.arms)),
        ]
    )
    planned = np.concatenate([np.zeros(twin.model.modes), *(plan[1] for plan in twin.plans)])
    own = rates - planned
    masses, _ = twin.at(values)
    h = np.longdouble(1e-4)

    def along(direction: np.ndarray) -> np.ndarray:
        return (twin.at(values + h * direction)[1] - twin.at(values - h * direction)[1]) / (2 * h)

    speed, found = along(own), np.zeros(len(values))
    for k in np.flatnonzero(soft):
        found[k] = float(np.sum(masses[:, None] * speed * along(np.eye(len(values))[k])))
    found[: twin.model.modes] += own[: twin.model.modes].astype(float)
    return found[soft]


@pytest.mark.parametrize(("modes", "corrected"), [(6, True), (4, True), (6, False)])
def test_frozen_robots_sink_as_on_the_whole_frame(modes: int, corrected: bool) -> None:
    """By the frame's own stiffness under what the robots weigh, at nodes; what modes miss is part of it."""
    study = scene({"modes": modes, "elements": 24}, solver={"static_correction": corrected})
    model = build(study)
    record, _ = rest(model, stretches(model, 0.1, 0.1, 1))
    stands = [
        (name, model.system.stays[r, 0, 0], record.grips[0, r, g])
        for r, robot in enumerate(study.robot.values())
        for g, name in enumerate(robot.rails)
    ]
    for name, place, grip in stands:
        whole = _sunk_on_whole(study, name, [(s, own[:6]) for body, s, own in stands if body == name], place)
        assert (grip[6] == pytest.approx(whole, rel=1e-3)) == corrected
        assert grip[6] == pytest.approx(whole, rel=0.3)


def _sunk_on_whole(study: Study, name: str, loads: list[tuple[float, np.ndarray]], at: float) -> float:
    """m; places are nodes."""
    frame = study.body[name]
    assert isinstance(frame, Frame)
    assembly = assemble(frame)
    nodes = {float(x): node for node, x in enumerate(np.round(assembly.mesh.points[:, 0], 9))}
    force = np.zeros(6 * len(assembly.mesh.points))
    for place, grip in loads:
        force[6 * nodes[place] : 6 * nodes[place] + 6] -= grip
    moved = assembly.whole(spsolve(assembly.stiffness, force[assembly.free]))
    return -float(moved[6 * nodes[at] + 2])


def test_few_modes_do_what_all_of_them_do() -> None:
    """Errors of tools over a run: six modes per rail with what they miss at rest against all of the frame's."""
    few, whole = (errors(marched(scene({"modes": modes}), 0.004, every=5)[1]) for modes in (6, 40))
    few, whole = (one - one[0] for one in (few, whole))
    assert np.abs(few - whole).max() < 1e-2 * np.abs(whole).max()


def test_an_arm_without_links_is_one_whose_link_stands_still() -> None:
    """A carriage of 300 kg, or one of 200 kg with a slide of 100 kg that does not move."""
    still, solid = {"kind": "prismatic", "axis": [0, 1, 0], "mass": 100, **drive()}, {"rail": drive()}
    arms = {"bare": solid | {"mass": 300}, "slides": solid | {"mass": 200, "links": [still]}}
    found = []
    for name, more in (("bare", []), ("slides", [0.0])):
        robot = {"arm": name, "rails": ["right"], "start": [3.0, *more], "moves": [{"to": [6.0, *more]}]}
        model, record = marched(scene(arm={name: arms[name]}, robot={"r": robot}), 0.004, every=25)
        found.append((record.coordinates[:, : model.modes, 0], record.robots[..., SEEN_ACTUAL : SEEN_ACTUAL + 3]))
    for bare, slides in zip(*found, strict=True):
        assert np.abs(bare - slides).max() <= 1e-9 * np.abs(bare).max() > 0.0
