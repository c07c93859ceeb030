"""Richardson pairs: of fourth order against DOP853, with estimates of the finer march's error that can be believed."""

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest

from engine.batch.execution import run
from engine.batch.plan import make_plan
from engine.kernels.layout import LANES, SMALLEST
from engine.march.richardson import march_pair
from engine.march.tables import SceneTables
from engine.model.lane_table import padded
from engine.model.scene_model import build_model
from engine.model.timeline import Window
from engine.observation.histories import counts_reduced
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from results_schema.status import Status
from tests.engine.build import beam, cruise, fixed, mass, shuttle, study, swing, under
from tests.engine.kept_cycles import Kept
from tests.engine.reading import Reading
from tests.engine.twin import solve_twin
from tests.march.test_twin import DAMPED, SPRINGS

SENSORS = {
    "place": fixed(0.61),
    "rate": fixed(0.61, "velocity"),
    "jerked": fixed(0.61, "acceleration"),
    "moment": fixed(0.37, "bending_moment"),
    "below": under("car"),
    "below_acceleration": under("car", "acceleration"),
}
PAIR = {"scheme": "richardson"}
WINDOWS: tuple[Window, ...] = ("whole", "last-cycle")
TWO = {"car": mass(0.4, cruise(-0.25, 1.25, 1.0, after=0.4)), "next": mass(0.3, cruise(1.0, 0.0, 1.0), delay=0.25)}


def case(bed: dict[str, Any], carriages: dict[str, Any], **changes: Any) -> Study:
    return study(bed, carriages, **({"sensor": SENSORS, "output": {"histories": "all"}} | changes))


SCENES: dict[str, Callable[[], Study]] = {
    "cruise of a mass": lambda: case(beam(modes=3), mass(0.5, cruise(0.0, 1.0, 0.9))),
    "sinusoidal shuttle": lambda: case(beam(modes=2, damping_ratio=0.01), mass(0.5, swing(0.5, 0.4, 0.3, 2))),
    "smooth turns": lambda: case(beam(modes=3, damping_ratio=0.03), mass(0.5, shuttle(0.1, 0.8, 1.0, 0.3, 1))),
    "instant turn": lambda: case(beam(modes=3, damping_ratio=0.03), mass(0.5, shuttle(0.1, 0.8, 1.0, 0.0, 1))),
    "two masses that arrive on springs": lambda: case(beam(modes=2, supports=SPRINGS, damping_ratio=0.02), TWO),
    "dampers": lambda: case(beam(modes=3, supports=DAMPED), mass(0.5, cruise(0.0, 1.0, 1.2))),
}
SMOOTH = ("cruise of a mass", "sinusoidal shuttle")


def with_solver(given: Study, **solver: Any) -> Study:
    return Study(**(dict(given.data) | {"solver": solver}))


def readings(given: Study, t: Array) -> dict[str, Array]:
    """What all sensors read by DOP853 at instants t."""
    twin = solve_twin(given, "bed", t)
    return {name: Reading(given, twin, sensor).values for name, sensor in given.sensor.items()}


@cache
def exact(name: str, t: tuple[float, ...]) -> Mapping[str, Array]:
    """The readings of a scene."""
    return readings(SCENES[name](), np.array(t))


@cache
def errors(name: str, scheme: str, steps: int) -> Mapping[str, float]:
    """Largest error of every sensor's history over its largest value, at some 25 instants."""
    ds = run(with_solver(SCENES[name](), scheme=scheme, steps=steps))
    stride = 36 * steps // 900
    t = np.round(ds.elapsed.values[::stride], 11)
    found = {}
    for sensor, values in exact(name, tuple(t.tolist())).items():
        seen = np.isfinite(values) & np.isfinite(ds[sensor].values[::stride])
        assert seen.sum() > 10
        found[sensor] = float(np.abs(ds[sensor].values[::stride] - values)[seen].max() / np.abs(values[seen]).max())
    return found


@pytest.mark.parametrize("name", SCENES)
def test_order_is_four(name: str) -> None:
    """Halving the step divides the error of every history by about 16, that of one march by about 4."""
    steps = 900 if name in SMOOTH else 600
    one, two = errors(name, "richardson", steps), errors(name, "richardson", 2 * steps)
    for sensor in SENSORS:
        order = math.log2(one[sensor] / two[sensor])
        assert order == pytest.approx(4.0, abs=0.35 if name in SMOOTH else 0.6), (sensor, order, one[sensor])
    if name in SMOOTH:
        alone, again = errors(name, "average-acceleration", steps), errors(name, "average-acceleration", 2 * steps)
        assert all(math.log2(alone[s] / again[s]) == pytest.approx(2.0, abs=0.1) for s in SENSORS)
        assert all(two[sensor] < 0.2 * again[sensor] for sensor in SENSORS)


@pytest.mark.parametrize("name", SMOOTH)
def test_estimate_is_the_error_of_the_finer_march(name: str) -> None:
    """Against DOP853: what a pair tells of its finer march is what one march with as many steps is off."""
    given = SCENES[name]()
    place = Study(**(dict(given.data) | {"sensor": {"place": SENSORS["place"]}}))
    plan = make_plan(with_solver(place, scheme="richardson", steps=800))
    (group,) = plan.groups
    _, gap = march_pair(group.tables, plan.values(group, padded(group.variants)), np.zeros(0, dtype=np.int64), 1)
    alone = run(with_solver(place, scheme="average-acceleration", steps=800))
    t = alone.elapsed.values[::4]
    off = np.abs(alone.place.values[::4] - readings(place, t)["place"]).max()
    assert float(gap[0, 0]) == pytest.approx(off, rel=0.1)


def test_automatic_steps_hold_the_tolerance() -> None:
    """Against 51,200 steps of Fox-Goodwin with the same modes."""
    sweep = {
        "zeta": {"of": "body.bed.damping_ratio", "values": [0.0, 0.01, 0.1]},
        "speed": {"of": "carriage.car.motion.speed", "values": [0.3, 3.0]},
    }
    given = study(beam(modes=6), mass(0.2, cruise(0.0, 1.0, 1.0)), solver=PAIR, sweep=sweep)
    ds, exact = run(given), run(with_solver(given, scheme="fox-goodwin", steps=51200))
    assert set(np.unique(ds.status.values).tolist()) <= {Status.OK, Status.SEPARATED}
    for end in ("max", "min"):
        off = np.abs(ds[f"midspan_{end}"].values - exact[f"midspan_{end}"].values)
        assert np.all(off <= 1e-3 * 0.2 * 9.81 / 48.0)


def test_extremes_lie_between_stations() -> None:
    """Against a march of 32 times as many steps: values, places, rms, contact forces, separation."""
    bed, car = beam(modes=4, damping_ratio=0.01), mass(1.0, cruise(0.0, 1.0, 0.5 * math.pi))
    given = study(bed, car, sensor={"mid": fixed(0.5), "m": fixed(0.3)})
    exact = run(with_solver(given, scheme="fox-goodwin", steps=51200))
    ds = run(with_solver(given, scheme="richardson", steps=1600))
    alone = run(with_solver(given, scheme="average-acceleration", steps=1600))

    def off(found: Any, name: str) -> float:
        return abs(float(found[name]) - float(exact[name]))

    for name, tolerance in (("mid_max", 2e-7), ("mid_min", 2e-7), ("m_max", 2e-7), ("m_min", 2e-7)):
        assert off(ds, name) <= tolerance < max(off(alone, name), 1e-6)
    for name in ("car_contact_force_max", "car_contact_force_min"):
        assert off(ds, name) < 0.25 * off(alone, name)
        assert off(ds, name) < 3e-5 * 9.81
    for name in ("mid_max_position", "mid_min_position", "m_min_position", "car_separation_position"):
        assert off(ds, name) <= 3e-5 < off(alone, name)
    assert float(ds.mid_rms) == pytest.approx(float(exact.mid_rms), rel=1e-3)
    assert int(ds.status) == int(exact.status) == Status.SEPARATED


@pytest.mark.parametrize("steps", [700, 18_000])
def test_extremes_are_those_of_the_history(steps: int) -> None:
    """Parabolas over the kept history, here by numpy; with segments that are cut where a table is full."""
    motion = swing(0.45, 0.4, 0.7, 3)
    given = study(beam(modes=2), mass(0.3, motion), solver=PAIR | {"steps": steps}, output={"histories": "all"})
    ds = run(given)
    x = ds.midspan.values
    assert x.size == 3 * steps + 1
    before, here, after = x[:-2], x[1:-1], x[2:]
    slope, bend = 0.5 * (after - before), after - 2.0 * here + before
    peak = (here > before) & (here > after)
    expected = max(x.max(), (here - 0.5 * slope**2 / bend)[peak].max())
    assert float(ds.midspan_max) == pytest.approx(expected, rel=1e-13)
    assert expected > x.max()
    weights = np.tile([4.0, 2.0], 3 * steps // 2)[:-1] / 3.0
    squares = x[0] ** 2 / 3.0 + np.sum(weights * x[1:-1] ** 2) + x[-1] ** 2 / 3.0
    assert float(ds.midspan_rms) == pytest.approx(math.sqrt(squares / (3 * steps)), rel=1e-9)


def test_reduction_gets_the_extrapolated_cycle() -> None:
    """The last of three cycles, the contact force judged in those before too."""
    given = study(beam(modes=3, damping_ratio=0.05), mass(0.5, swing(0.5, 0.3, 0.4, 3)), solver=PAIR | {"steps": 400})
    kept = Kept(100)
    reduced = run(given, reduction=kept)
    whole = run(Study(**(dict(given.data) | {"output": {"histories": "all"}})))
    plan = make_plan(given, reduction=kept)
    counts = counts_reduced(plan.groups[0].tables.timeline, 100)
    np.testing.assert_array_equal(kept.cycles[0].history[:, 0, 0], whole.midspan.values[counts])
    last = whole.midspan.values[800:]
    assert float(reduced.midspan_max) == pytest.approx(last.max(), rel=1e-4)
    assert float(reduced.midspan_max) >= last.max()
    told = [ds.estimated_error.sel(result="midspan_max").item() for ds in (reduced, whole)]
    assert told[0] <= told[1]


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_contact_that_opens_before_the_last_cycle_is_seen(turn: float) -> None:
    """Cycles that are not recorded are observed from station to station all the same, across their slices too."""
    motion = shuttle(0.1, 0.9, 1.0, turn, 2)
    given = study(beam(modes=4, damping_ratio=0.3), mass(3.0, motion), solver=PAIR | {"steps": 2000}, initial="rest")
    reduced = run(given, reduction=Kept(100))
    whole = run(given)
    alone = run(with_solver(given, scheme="average-acceleration", steps=2000), reduction=Kept(100))
    assert float(alone.car_separation_position) == pytest.approx(float(whole.car_separation_position), abs=2e-3)
    assert float(reduced.car_separation_position) == float(whole.car_separation_position)
    assert int(reduced.status) == Status.SEPARATED


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_what_is_not_recorded_is_observed_alike(turn: float) -> None:
    """The smallest contact force of both parts of a shuttle is that of the whole, whatever is recorded of it."""
    given = study(beam(damping_ratio=0.05), mass(0.3, shuttle(0.1, 0.9, 1.0, turn, 3)), solver=PAIR | {"steps": 5000})
    model, values = build_model(given, {}, {}), VariantValues(given, {}, LANES)
    found = {
        window: march_pair(SceneTables(model, 5000, window, refinement=2), values, np.zeros(0, np.int64), 1)[0]
        for window in WINDOWS
    }
    smallest = [part[-1, SMALLEST, 0] for part in (found["last-cycle"].unrecorded, found["last-cycle"].statistics)]
    assert np.isfinite(smallest).all()
    assert min(smallest) == found["whole"].statistics[-1, SMALLEST, 0]
