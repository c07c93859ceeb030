"""Bits that do not depend on chunks, threads, order or neighbours; statuses; stopping, resuming, and where the sink
is called."""

import hashlib
import math
import subprocess
import sys
import threading
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr

import engine.march.march
from engine.accuracy.ladder import ladder_of
from engine.batch.dataset import build
from engine.batch.execution import execute, run
from engine.batch.executors import Threads
from engine.batch.plan import EVERY_MARCH, Plan, make_plan
from engine.model.lane_table import LaneTable, to_blocks
from engine.model.scene_model import SceneModel
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.errors import BadInput, Interrupted
from results_schema.store.rows import Chunk, Collector
from studies.protocol.study import kind_of
from tests.engine.build import beam, cruise, fixed, force, mass, study, swing, under
from tests.reference import closed_forms, values
from tests.studies import scenes


def mixed() -> Study:
    """150 variants: several step counts, two scenes, statuses ok and separated, histories of all."""
    springs = [{"at": 0.0, "stiffness": 300.0}, {"at": 1.0, "stiffness": 300.0, "damping": 0.5}]
    carriages = {"car": mass(0.5, cruise(-0.1, 1.1, 1.0, after=0.3)), "next": force(2.0, cruise(0.0, 1.0, 1.0))}
    sensors = {"midspan": fixed(0.5), "below": under("car", "acceleration"), "moment": fixed(0.3, "bending_moment")}
    sweep = {
        "speed": {"of": ["carriage.car.motion.speed", "carriage.next.motion.speed"], "values": [0.2, 0.5, 1.0, 2.5, 4]},
        "weight": {"of": "carriage.car.mass", "from": 0.05, "to": 2.0, "count": 5},
        "zeta": {"of": "body.bed.damping_ratio", "values": [0.0, 0.01, 0.05]},
        "stiffness": {"of": "body.bed.supports.0.stiffness", "values": [100.0, 300.0]},
    }
    bed = beam(supports=springs)
    solver = {"tolerance": 0.1}  # accuracy is not the question
    return study(bed, carriages, sensor=sensors, sweep=sweep, output={"histories": "auto"}, solver=solver)


def quick() -> Plan:
    """150 variants whose numerics are fixed."""
    sweep = {"weight": {"of": "carriage.car.mass", "from": 0.05, "to": 2.0, "count": 150}}
    solver = {"steps": 100, "fidelity": "full", "scheme": "average-acceleration", "tolerance": 0.5}
    return make_plan(study(beam(modes=3), mass(0.5, cruise(0.0, 1.0, 1.0)), sweep=sweep, solver=solver))


@cache
def of_mixed() -> tuple[Plan, Collector]:
    """Its plan, and its results in chunks that fit nothing."""
    plan = make_plan(mixed())
    collector = Collector(plan.size)
    execute(plan, collector.add, chunk=37)
    return plan, collector


def dataset_of_mixed() -> xr.Dataset:
    plan, collector = of_mixed()
    return build(plan, collector.arrays, collector.selected)


def digest(plan: Plan, chunk: int | None, threads: int) -> str:
    """SHA-256 over every number of the results and histories."""
    collector = Collector(plan.size)
    execute(plan, collector.add, Threads(threads), chunk=chunk)
    return digest_of(collector)


def digest_of(collector: Collector) -> str:
    """The same of results that are there."""
    found = hashlib.sha256()
    for name in sorted(collector.arrays):
        found.update(name.encode() + collector.arrays[name].tobytes())
    selected = collector.selected
    assert selected is not None
    assert selected.variants.size == 64
    for name in sorted(selected.arrays):
        found.update(name.encode() + np.ascontiguousarray(selected.arrays[name]).tobytes())
    return found.hexdigest()


@pytest.mark.fault(20)
def test_same_bits_for_any_chunks_and_threads() -> None:
    plan, collector = of_mixed()
    assert {digest(plan, chunk, threads) for chunk, threads in ((64, 1), (None, 2))} == {digest_of(collector)}


@pytest.mark.fault(20)
def test_same_bits_one_by_one() -> None:
    plan, whole = of_mixed()
    picked = np.arange(0, 150, 29)
    found = Collector(plan.size)
    execute(plan, found.add, Threads(2), chunk=1, done=np.setdiff1d(np.arange(150), picked))
    for name, array in whole.arrays.items():
        assert found.arrays[name][picked].tobytes() == array[picked].tobytes(), name


@pytest.mark.fault(20)
def test_same_bits_for_any_order_and_company() -> None:
    """A variant alone, and the sweep in another order."""
    whole = dataset_of_mixed()
    data = mixed().data
    turned = data["sweep"] | {"zeta": data["sweep"]["zeta"] | {"values": [0.05, 0.0]}}
    other = run(Study(**(data | {"sweep": turned})))
    compared = 0
    for name in ("midspan_max", "below_min", "moment_rms", "car_contact_force_min", "car_separation_position"):
        if name not in whole:
            continue
        one, two = whole[name].sel(zeta=[0.05, 0.0]).values, other[name].transpose(*whole[name].dims).values
        assert one.tobytes() == two.tobytes()
        compared += one.size
    assert compared >= 400


@pytest.mark.parametrize("riding", [{}, {"next": force(2.0, cruise(1.0, 0.0, 0.9))}], ids=["alone", "two"])
def test_a_sensor_has_the_same_bits_in_any_company(riding: dict[str, Any]) -> None:
    """One and two displacements are summed in the pass over the modes, more, and others, after it."""
    sensors = {"place": fixed(0.37), "below": under("car"), "moment": fixed(0.3, "bending_moment")}
    sensors |= {"rate": fixed(0.4, "velocity")}
    carriages = {"car": mass(0.5, cruise(-0.1, 1.1, 1.0, after=0.3)), **riding}
    results = []
    for names in (["place"], ["place", "below"], ["place", "moment", "below"], ["place", "rate"]):
        chosen = {name: sensors[name] for name in names}
        given = study(beam(modes=5), carriages, sensor=chosen, output={"histories": "all"}, solver={"steps": 300})
        results.append(run(given)[["place", "place_max", "place_min", "place_rms", "car_contact_force_min"]])
    assert all(one.identical(results[0]) for one in results[1:])


POISON = {"mass": math.nan, "weight": math.inf, "rates": -200.0}  # what a lane has in place of a sound number


@pytest.mark.fault(19)
@pytest.mark.parametrize("name", POISON)
@pytest.mark.parametrize("carriages", ["one", "two"])
def test_one_bad_lane_leaves_its_neighbours_alone(name: str, carriages: str, monkeypatch: pytest.MonkeyPatch) -> None:
    riding = {"car": mass(0.5, cruise(0.0, 1.0, 1.0)), "next": mass(0.2, cruise(0.0, 1.0, 1.0), headway=0.3)}
    riding = riding if carriages == "two" else {"car": riding["car"]}
    sweep = {"weight": {"of": "carriage.car.mass", "from": 0.1, "to": 1.0, "count": 37}}
    given = study(beam(), riding, sweep=sweep, output={"histories": "all"}, solver={"steps": 300})
    clean = run(given)
    table = engine.march.march.lane_table

    def poisoned(model: SceneModel, lane_values: VariantValues) -> LaneTable:
        lanes = table(model, lane_values)
        bad = to_blocks(np.isclose(lane_values.own_mass("car"), clean.weight.values[20]))
        return replace(lanes, **{name: np.where(bad[:, None], POISON[name], getattr(lanes, name))})

    monkeypatch.setattr(engine.march.march, "lane_table", poisoned)
    found = run(given, threads=2)
    compared = 0
    for name, variable in clean.data_vars.items():
        if "weight" not in variable.dims:
            continue
        rest, bad = (found[name].drop_isel(weight=20), found[name].isel(weight=20))
        assert rest.values.tobytes() == variable.drop_isel(weight=20).values.tobytes(), name
        compared += rest.size
        if variable.dtype == np.float64 and not str(name).endswith("_position"):
            assert np.isnan(bad.values).all(), name
    assert compared > 36 * 300
    assert int(found.status[20]) == 5
    assert 0 <= int(found.diverged_step[20]) <= 300
    assert np.all(np.delete(found.diverged_step.values, 20) == -1)


@pytest.mark.fault(17)
def test_a_diverging_variant_among_others() -> None:
    """Parametric resonance without damping grows until nothing is left; light carriages beside it do not."""
    way = swing(0.5, 0.5, 0.608 * 0.5 * math.pi, 200)
    sweep = {"weight": {"of": "carriage.car.mass", "values": [0.001, 1.0, 0.002]}}
    solver, shape = {"steps": 4800, "tolerance": 0.1}, {"body": "bed", "quantity": "displacement", "places": 5}
    ds = run(study(beam(modes=3), mass(0.5, way), sweep=sweep, solver=solver, envelope={"shape": shape}))
    assert ds.status.values.tolist() == [0, 5, 0]
    assert ds.diverged_step.values[0] == ds.diverged_step.values[2] == -1
    assert 400 < ds.diverged_step.values[1] < 200 * int(ds.steps_used[1])
    assert np.isnan(ds.midspan_max.values[1])
    assert np.isfinite(ds.midspan_max.values[[0, 2]]).all()
    for end in ("max", "min"):
        assert np.isnan(ds[f"shape_envelope_{end}"].values).tolist() == [[False] * 5, [True] * 5, [False] * 5]


@pytest.mark.fault(16)
def test_resonance_without_damping_is_no_alarm() -> None:
    """A force at alpha = 1, whose every mode but the first is quiet, and 20 forces in step with mode 1."""
    model = closed_forms.PinnedBeam(5)
    given = study(
        beam(modes=5),
        force(values.WEIGHT, cruise(0.0, 1.0, math.pi)),
        solver={"scheme": "fox-goodwin", "steps": 4000, "static_correction": False},
        output={"histories": "all"},
    )
    ds = run(given)
    expected = closed_forms.moving_force(model, values.WEIGHT, math.pi, 0.5, ds.elapsed.values)
    np.testing.assert_allclose(ds.midspan.values, expected, rtol=0, atol=1e-6, equal_nan=False)
    assert int(ds.status) == 0
    speed = 0.3 * math.pi
    way = cruise(0.0, 1.0, speed)
    many = {f"axle{n}": force(1.0, way, headway=n * 2.0 * speed / math.pi) for n in range(20)}
    train = run(study(beam(modes=1), many, sensor={"rate": fixed(0.5, "velocity")}, solver={"steps": 400}))
    one = run(study(beam(modes=1), many["axle0"], sensor={"rate": fixed(0.5, "velocity")}, solver={"steps": 400}))
    assert int(train.status) == 0
    assert float(train.rate_max) > 10.0 * float(one.rate_max)


SEPARATION = {0.1: 1.275, 0.25: 0.47, 0.5: 0.325, 1.0: 0.245, 2.0: 0.175}


@pytest.mark.parametrize("mu", SEPARATION)
def test_separation(mu: float) -> None:
    """The contact opens first at the speed of mechanics 7.6, near the exit; values stay."""
    speeds = [math.pi * SEPARATION[mu] * factor for factor in (0.9, 0.97, 1.02, 1.05)]
    sweep = {"speed": {"of": "carriage.car.motion.speed", "values": speeds}}
    plan = make_plan(study(beam(modes=20), mass(mu, cruise(0.0, 1.0, 1.0)), gravity=values.WEIGHT / mu, sweep=sweep))
    collector = Collector(plan.size)
    execute(plan, collector.add)
    arrays = collector.arrays
    assert arrays["status"].tolist() == [0, 0, 1, 1]
    places = arrays["car_separation_position"]
    assert np.isnan(places[:2]).all()
    assert np.all((places[2:] > 0.85) & (places[2:] <= 0.98))
    assert np.all(arrays["car_contact_force_min"][2:] < 0.0)
    assert np.all(arrays["car_contact_force_min"][:2] > 0.0)
    assert np.isfinite(arrays["midspan_max"]).all()


class Recorder:
    """A sink that remembers."""

    def __init__(self) -> None:
        self.variants: list[int] = []
        self.threads: set[int] = set()

    def __call__(self, chunk: Chunk) -> None:
        self.variants += chunk.rows.variants.tolist()
        self.threads.add(threading.get_ident())


def test_sink_and_progress_are_called_on_the_calling_thread() -> None:
    plan, sink, progress = quick(), Recorder(), []

    def count(finished: int, total: int) -> None:
        assert threading.get_ident() in sink.threads
        progress.append((finished, total))

    execute(plan, sink, Threads(2), chunk=10, progress=count)
    assert sink.threads == {threading.get_ident()}
    assert sorted(sink.variants) == list(range(150))
    assert progress[-1] == (150, 150)
    assert [finished for finished, _ in progress] == sorted({finished for finished, _ in progress})


def test_done_variants_are_left_out() -> None:
    """With what bits the others come: `tests.accuracy.test_groups`."""
    rest, nothing = Recorder(), Recorder()
    execute(quick(), rest, done=np.arange(0, 150, 3), chunk=11)
    assert sorted(rest.variants) == sorted(set(range(150)) - set(range(0, 150, 3)))
    execute(quick(), nothing, done=np.arange(150))
    assert nothing.variants == []


class Broken(Exception):
    """What a test raises."""


def test_what_the_sink_raises_reaches_the_caller() -> None:
    calls = []

    def sink(*found: Any) -> None:
        calls.append(found)
        if len(calls) == 3:
            raise Broken

    with pytest.raises(Broken):
        execute(quick(), sink, Threads(2), chunk=5)
    assert len(calls) == 3


def test_what_a_chunk_raises_reaches_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*anything: Any) -> None:
        raise Broken

    monkeypatch.setattr("engine.batch.chunk.run_chunk", broken)
    with pytest.raises(Broken):
        execute(quick(), Recorder(), Threads(2), chunk=5)


def test_a_stop_is_heard_between_chunks() -> None:
    """Only what is in flight is finished."""
    sweep = {"weight": {"of": "carriage.car.mass", "from": 0.1, "to": 1.0, "count": 10_000}}
    plan = make_plan(study(beam(modes=3), mass(0.5, cruise(0.0, 1.0, 1.0)), sweep=sweep, solver={"steps": 400}))
    stop, sink = threading.Event(), Recorder()
    with pytest.raises(Interrupted):
        execute(plan, lambda *found: (sink(*found), stop.set()), Threads(2), stop=stop, chunk=50)
    assert 50 <= len(sink.variants) <= 200


@pytest.mark.fault(25)
def test_a_stop_is_heard_within_a_variant() -> None:
    """Which alone would take minutes."""
    plan = make_plan(study(beam(modes=10), mass(0.5, cruise(0.0, 1.0, 1.0)), solver={"steps": 20_000_000}))
    stop, sink = threading.Event(), Recorder()
    timer = threading.Timer(0.5, stop.set)
    timer.start()
    with pytest.raises(Interrupted):
        execute(plan, sink, stop=stop)
    assert sink.variants == []


def test_stop_before_the_start() -> None:
    stop = threading.Event()
    stop.set()
    sink = Recorder()
    with pytest.raises(Interrupted):
        execute(quick(), sink, stop=stop)
    assert sink.variants == []


def test_no_threads_is_bad_input() -> None:
    with pytest.raises(BadInput, match="threads"):
        run(mixed(), threads=0)


# ---- what else was imported ----


SLOW = "[solver]\ntolerance = 1e-2\n"
RUN = """
import sys
{imports}
import engine
from hashlib import sha256
found = engine.run(engine.load(sys.argv[1]), threads=1)
text = [found.attrs, sorted((name, array.dims, array.values.tolist()) for name, array in found.variables.items())]
print(int(found.fidelity_used), sha256(repr(text).encode()).hexdigest())
"""
IMPORTS = ("", "import studies\nfor kind in studies.kind_names(): studies.kind_named(kind)")


def test_a_run_is_the_same_with_and_without_studies() -> None:
    """The choice of the model and what is kept, in fresh processes with different imports."""
    told = {
        subprocess.run(
            [sys.executable, "-c", RUN.format(imports=imports), scenes.text_of("trajectory", extra=SLOW)],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for imports in IMPORTS
    }
    assert len(told) == 1
    assert told.pop().startswith("3 ")  # so few that each converges with all terms


def test_a_study_says_whose_results_it_keeps() -> None:
    """Accelerations, which a trajectory keeps and statics have not, take more than statics."""
    study = scenes.study("trajectory").with_values({"body.bed.modes": "auto", "carriage.table.mass": 1.0})
    kind = kind_of(study)
    plans = {results: make_plan(study, results=results) for results in (EVERY_MARCH, kind.name)}
    lowest = {results: ladder_of(plan.asked, plan.grids[0]).columns[0].fidelity for results, plan in plans.items()}
    assert lowest == {EVERY_MARCH: "static", "trajectory": "force"}
    with pytest.raises(BadInput, match="no such kind of results"):
        make_plan(study, results="nonsense")
