"""Stiffnesses of contacts as lanes: where weights alone say what contacts carry at rest, variants share a scene."""

from collections.abc import Callable

import numpy as np
import pytest

import engine
import studies
from engine.batch.plan import make_plan
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.engine.bodies_on_contacts import FLEXIBLE, FRAME, SHOES, THREE, TWO, UNEVEN, riding
from tests.engine.build import Table, beam, cruise, fixed, mass, shuttle, under
from tests.engine.gantries import gantry

FRONT, REAR = ("carriage.car.contacts.front.stiffness", "carriage.car.contacts.rear.stiffness")
STIFFNESSES = {FRONT: [150.0, 500.0, 2000.0], REAR: [90.0, 700.0]}
SWEPT: Table = {name: {"of": key, "values": STIFFNESSES[key]} for name, key in (("k_front", FRONT), ("k_rear", REAR))}
THERE_AND_BACK = shuttle(0.3, 0.7, 0.8, 0.1, 1)
WAY = cruise(0.3, 0.6, 0.8)
TROLLEY = mass(0.2, cruise(0.02, 0.38, 0.4)) | {"on": "table"}
CARRYING = {"car": {"on": "bed", "kind": "body", "body": "table", "contacts": TWO, "motion": WAY}, "trolley": TROLLEY}
HEAVY = beam(own_weight=True, modes=5)
SCENES: dict[str, Callable[[Table], Study]] = {
    "in equilibrium at first": lambda sweep: riding(THERE_AND_BACK, initial="equilibrium", sweep=sweep),
    "uneven, over both ends": lambda sweep: riding(cruise(-0.4, 1.4, 0.8), table=UNEVEN, sweep=sweep),
    "flexible, on a bed that sags": lambda sweep: riding(THERE_AND_BACK, TWO, FLEXIBLE, HEAVY, sweep=sweep),
    "frame on points": lambda sweep: riding(THERE_AND_BACK, SHOES, FRAME, sweep=sweep),
    "with a trolley on it": lambda sweep: riding(WAY, carriage=CARRYING, initial="equilibrium", sweep=sweep),
}


@pytest.mark.parametrize("name", SCENES)
def test_contacts_of_other_stiffnesses_share_a_scene(name: str) -> None:
    """Each lane is what it is by itself. What rides counts from where its own weight presses it; that of a trolley on
    it sinks in as far as contacts yield."""
    case = SCENES[name](SWEPT)
    assert len(make_plan(case).grids) == 1
    found = engine.run(case)
    statics = []
    for place in np.ndindex(3, 2):
        own = {key: STIFFNESSES[key][number] for key, number in zip((FRONT, REAR), place, strict=True)}
        alone = engine.run(case.without_sweep().with_values(own))
        for result in (
            "tip_max",
            "tip_min",
            "tip_acceleration_min",
            "place_rms",
            "rear_max",
            "total_min",
            "tip_static",
        ):
            known = float(alone[result])
            assert float(found[result][place]) == pytest.approx(known, rel=1e-9), (result, place)
        statics.append(float(alone["tip_static"]))
    assert (max(statics) > 1.05 * min(statics)) == ("trolley" in name)


def test_dynamic_parts_know_how_far_a_lane_yields_at_rest() -> None:
    sensor = {"tip": {"at": 0.1, "body": "table", "quantity": "displacement", "part": "dynamic"}}
    case = riding(WAY, carriage=CARRYING, sensor=sensor, initial="equilibrium", sweep=SWEPT)
    found = engine.run(case).sel(k_front=150.0, k_rear=90.0)
    alone = engine.run(case.without_sweep().with_values({FRONT: 150.0, REAR: 90.0}))
    for result in ("tip_max", "tip_min"):
        assert float(found[result]) == pytest.approx(float(alone[result]), rel=1e-9)


CARTS = CARRYING | {"trolley": CARRYING["trolley"] | {"motion": shuttle(0.05, 0.35, 0.8, 0.1, 1)}}
READ: dict[str, Table] = {
    "influence": {"carriage": CARRYING, "question": {"positions": 5, "unreduced": 0}},
    "asymmetry": {"carriage": {"trolley": CARTS["trolley"], "car": CARTS["car"] | {"motion": THERE_AND_BACK}}},
    "trajectory": {"carriage": CARRYING | {"car": CARRYING["car"] | {"motion": WAY | {"after": 2.0}}}},
}


@pytest.mark.parametrize("kind", READ)
def test_studies_that_read_statics_know_it(kind: str) -> None:
    """Influence lines of the table, the slope that lags are counted by, and where it comes to rest."""
    sensor = {"tip": fixed(0.1, body="table"), "below": under("car")}
    changes = {"kind": kind, "sensor": sensor, "solver": {"steps": 400, "audit": 0}, "output": {}} | READ[kind]
    case = riding(WAY, sweep=SWEPT, **changes)
    found = studies.run(case).sel(k_front=150.0, k_rear=90.0)
    alone = studies.run(case.without_sweep().with_values({FRONT: 150.0, REAR: 90.0}))
    told = [name for name in alone.data_vars if str(name).startswith(("tip", "lag", "odd", "loop"))]
    assert len(told) > (kind == "trajectory")
    for name in told:
        one, other = (np.asarray(of[name], dtype=float) for of in (found, alone))
        size = np.max(np.abs(np.nan_to_num(other)))
        assert one == pytest.approx(other, rel=1e-7, abs=1e-12 * size, nan_ok=True), name


HELD: Table = FRAME | {"supports": {"rear": ["x"]}}
NEAR = {"rear": TWO["rear"] | {"at": 0.2}, "front": TWO["front"] | {"at": 0.2 + 1e-12}}
SHARED: dict[str, Callable[[Table], Study]] = {
    "three contacts": lambda sweep: riding(
        WAY, {"rear": THREE["a"], "b": THREE["b"], "front": THREE["c"]}, sweep=sweep
    ),
    "one mode": lambda sweep: riding(WAY, table=FLEXIBLE | {"modes": 1}, sweep=sweep),
    "at next to one place": lambda sweep: riding(WAY, NEAR, sweep=sweep),
    "a body that something holds": lambda sweep: riding(WAY, SHOES, HELD, sweep=sweep),
}


@pytest.mark.parametrize("name", SHARED)
def test_contacts_that_share_weights_by_their_stiffnesses_make_scenes(name: str) -> None:
    swept: Table = {"k_front": {"of": FRONT, "values": [150.0, 500.0]}}
    assert len(make_plan(SHARED[name](swept)).grids) == 2


def test_contacts_that_a_body_cannot_tell_apart_are_refused() -> None:
    """At two points of one place: which of them carries how much follows from their stiffnesses."""
    ends = {"rear_shoe": ("foot", 0.2), "front_shoe": ("toe", -0.2)}
    one = {"point": {name: {"node": node, "offset": [ahead, 0.0, 0.0]} for name, (node, ahead) in ends.items()}}
    with pytest.raises(BadInput, match="share what they carry"):
        make_plan(riding(WAY, SHOES, FRAME | one, sweep=SWEPT))
    make_plan(riding(WAY, SHOES, FRAME | one))


def test_four_wheels_of_a_gantry_make_scenes() -> None:
    case = gantry()
    (key, *_) = (key for key in case.numbers() if key.endswith(".stiffness") and ".contacts." in key)
    swept = case.with_values({"sweep": {"wheel": {"of": key, "values": [250.0, 600.0]}}})
    assert len(make_plan(swept).grids) == 2
