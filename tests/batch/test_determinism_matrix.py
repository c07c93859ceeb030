"""One hash over chunks, threads and workers, for every scheme and every sort of scene."""

import hashlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import cache, partial

import numpy as np
import pytest
import xarray as xr

from engine.batch.execution import execute
from engine.batch.executors import Place, Threads
from engine.batch.plan import make_plan
from engine.batch.workers import on_this_machine
from engine.kernels.schemes import SCHEMES
from engine.scene.study import Study, load
from results_schema.store.rows import Collector
from studies.protocol.parts import Work
from studies.protocol.store import Memory
from studies.protocol.study import kind_of
from tests.accuracy.chosen import sweep
from tests.engine.bodies_on_contacts import riding
from tests.engine.build import Table, aboard, beam, cruise, mass, oscillator, shuttle, study, under
from tests.engine.gantries import gantry
from tests.floating.scenes import given_arm
from tests.kinds import test_stability
from tests.studies.every_way import TEXTS

CHUNKS = (1, 7, 64, None)
FEWER_CHUNKS = (7, None)  # where every run of a study chooses anew
PLACES: dict[str, Callable[[], AbstractContextManager[Place]]] = {
    "two threads": partial(nullcontext, Threads(2)),
    "one worker": partial(on_this_machine, 1, 1),
    "one worker of two threads": partial(on_this_machine, 1, 2),
    "two workers": partial(on_this_machine, 2, 1),
    "two workers of two threads": partial(on_this_machine, 2, 2),
}
PARAMETERS = {
    "newmark": {"beta": 0.3025, "gamma": 0.6},
    "hht-alpha": {"alpha": -0.05},
    "generalized-alpha": {"rho_inf": 0.8},
}
CHOSEN = "numerics that pilots choose"
WAY = cruise(-0.1, 1.1, 1.0, after=0.3)


def swept(key: str, low: float, high: float) -> Table:
    """70 variants, whose histories are kept."""
    return {"sweep": {"varied": {"of": key, "from": low, "to": high, "count": 70}}, "output": {"histories": "all"}}


def by_scheme(name: str) -> Study:
    """A mass crosses, marched by a scheme."""
    solver = {"scheme": name, "steps": 600 if name == "central-difference" else 100} | PARAMETERS.get(name, {})
    sensors = {"below": under("car", "acceleration")}
    given = mass(0.2, WAY)
    return study(beam(modes=3), given, solver=solver, sensor=sensors, **swept("carriage.car.mass", 0.05, 0.3))


STUDIES: dict[str, Callable[[], Study]] = {name: partial(by_scheme, name) for name in SCHEMES} | {
    "an oscillator": lambda: study(
        beam(modes=3),
        oscillator(0.2, 30.0, WAY),
        sensor={"car": aboard("car")},
        solver={"steps": 100},
        **swept("carriage.car.stiffness", 10.0, 50.0),
    ),
    "a body on contacts": lambda: riding(shuttle(0.3, 0.7, 0.5, 0.5, 1), **swept("body.table.mass", 0.2, 1.0)),
    "a gantry": lambda: gantry(**swept("carriage.trolley.mass", 0.1, 0.5)),
    CHOSEN: sweep,
    "each until it converges": lambda: sweep(sweep=swept("carriage.car.mass", 0.05, 0.25)["sweep"]),
}


def sliding_by_scheme(name: str) -> Study:
    """A mass that slides by itself, marched by a scheme."""
    given = load(TEXTS["frames that move"])
    return Study(**(given.data | {"solver": {"steps": 100, "scheme": name} | PARAMETERS.get(name, {})}))


def driven_arm(fidelity: str) -> Study:
    """An arm on driven joints with a mass and an oscillator: a given frame, or "full", one that floats."""
    sweep = {"load": {"of": "carriage.load.mass", "values": [1.0, 2.0]}}
    given = given_arm().data | {"question": {"duration": 0.5}, "sweep": sweep}
    return Study(**given, solver={"steps": 100, "fidelity": fidelity})


OF_FRAMES = [name for name, scheme in SCHEMES.items() if scheme(PARAMETERS.get(name, {})).stride == 1]
PIECES: dict[str, Callable[[], Study]] = {
    "at rest": lambda: load(TEXTS["at rest"]),
    **{f"a mass that slides, {name}": partial(sliding_by_scheme, name) for name in OF_FRAMES},
    "a given frame": partial(driven_arm, "auto"),
    "a floating frame": partial(driven_arm, "full"),
    "robots": lambda: load(TEXTS["robots"]),
    "schemes for comparison": partial(test_stability.study, {"maps": ["schemes", "lagged-inertia"]}),
}


def found(given: Study, here: Place, chunk: int | None) -> Collector:
    """What a march finds there, one by one of every sixth variant alone."""
    plan = make_plan(given)
    collector, every = Collector(plan.size), np.arange(plan.size)
    execute(plan, collector.add, here, chunk=chunk, done=every[every % 6 != 0] if chunk == 1 else None)
    return collector


def digest(collector: Collector, chunk: int | None) -> str:
    """SHA-256 over every number of the results and histories of such variants."""
    step, digested = 6 if chunk == 1 else 1, hashlib.sha256()
    assert collector.finished[::step].all() and np.isfinite(collector.arrays["work"][::step]).all()
    arrays = {name: array[::step] for name, array in collector.arrays.items()}
    if (shown := collector.selected) is not None:
        arrays |= {f"{name} of some": array[shown.variants % step == 0] for name, array in shown.arrays.items()}
    for name, array in sorted(arrays.items()):
        digested.update(name.encode() + np.ascontiguousarray(array).tobytes())
    return digested.hexdigest()


@cache
def alone(name: str) -> Collector:
    """On one thread, in chunks as they come."""
    return found(STUDIES[name](), Threads(1), None)


def in_pieces(given: Study, here: Place) -> xr.Dataset:
    """The dataset of a study that is computed in pieces."""
    parts, store = kind_of(given).parts(given), Memory()
    parts.compute(store, Work(place=here))
    return parts.gather(store)


@cache
def pieces_alone(name: str) -> xr.Dataset:
    """On one thread."""
    return in_pieces(PIECES[name](), Threads(1))


@pytest.fixture(scope="module", params=PLACES)
def here(request: pytest.FixtureRequest) -> Iterator[Place]:
    with PLACES[request.param]() as found:
        yield found


@pytest.mark.slow
@pytest.mark.fault(20)
@pytest.mark.parametrize("name", STUDIES)
def test_one_hash(name: str, here: Place) -> None:
    chunks = FEWER_CHUNKS if name == CHOSEN else CHUNKS
    for chunk in chunks:
        assert digest(found(STUDIES[name](), here, chunk), chunk) == digest(alone(name), chunk), chunk


@pytest.mark.slow
@pytest.mark.fault(20)
@pytest.mark.parametrize("name", PIECES)
def test_one_hash_of_pieces(name: str, here: Place) -> None:
    there, expected = in_pieces(PIECES[name](), here), pieces_alone(name)
    assert there.identical(expected)
    numbers = [key for key, array in expected.data_vars.items() if array.dtype.kind == "f"]
    assert len(numbers) > 3
    assert all(there[key].values.tobytes() == expected[key].values.tobytes() for key in numbers)
