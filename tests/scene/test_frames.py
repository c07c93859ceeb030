"""Bodies without a mass: what is no payload, in frames that move."""

from typing import Any

import numpy as np
import pytest

import studies
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.floating.scenes import ARM

SWING = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "waypoints", "times": [0, 1], "values": [0, 0.3]}}
PAYLOAD = {"kind": "rigid", "length": 0.2, "mass": 2.0, "inertia": 0.01}
NONE = {"mass": 0.0, "inertia": 0.0}


def swinging(payload: dict[str, Any] | None, joints: Any = (), **more: Any) -> Study:
    """An arm that is turned, with a payload at its end, or nothing."""
    bodies, frames = {"arm": ARM | {"modes": 2}}, {"arm": {"joints": [SWING]}}
    if payload is not None:
        bodies, frames = bodies | {"payload": payload}, frames | {"payload": {"on": "arm", "joints": joints}}
    return Study(
        **{
            "kind": "moving-frames",
            "gravity": 0.0,
            "body": bodies,
            "frame": frames,
            "sensor": {"tip": {"body": "arm", "at": 10.0}},
            "question": {"duration": 2.0},
            "solver": {"steps": 2000, "static_correction": False},
        }
        | more
    )


def test_a_payload_of_no_mass_is_none() -> None:
    swept = {"mass": {"of": "body.payload.mass", "values": [0.0, 1.0, 2.0]}}
    found = studies.run(swinging(PAYLOAD | {"inertia": 0.0}, sweep=swept))["tip_max"].values
    alone = studies.run(swinging(None))["tip_max"].values
    np.testing.assert_allclose(found[0], alone, rtol=1e-6)
    assert np.ptp(found) > 0.1 * found[0]


@pytest.mark.parametrize(
    ("joint", "nothing", "key", "words"),
    [
        ("prismatic", {"mass": 0.0}, "mass", "this joint moves nothing that has a mass"),
        ("free", {"mass": 0.0}, "mass", "this joint moves nothing that has a mass"),
        ("revolute", {"inertia": 0.0}, "inertia", "this joint turns freely what has no inertia"),
        ("spherical", NONE, "inertia", "this joint turns freely what has no inertia"),
    ],
)
def test_what_moves_freely_has_inertia(joint: str, nothing: dict[str, float], key: str, words: str) -> None:
    along = {"axis": [0, 0, 1]} if joint in ("prismatic", "revolute") else {}
    joints = [{"kind": joint, **along}]
    pattern = rf"body\.payload\.{key}: {words}; expected > 0, or a joint with a motion, or none"
    with pytest.raises(BadInput, match=pattern):
        swinging(PAYLOAD | nothing, joints)
    assert swinging(PAYLOAD, joints).body["payload"].modal_masses == ("mass", "inertia")
    driven = [
        {"kind": "prismatic", "axis": [0, 0, 1], "motion": {"kind": "waypoints", "times": [0, 1], "values": [0, 1]}}
    ]
    swinging(PAYLOAD | NONE, driven)


def test_a_carrier_of_no_mass_moves_freely_with_what_hangs_on_it() -> None:
    carrier = {"body": {"sled": PAYLOAD | {"mass": 0.0}, "arm": ARM}}
    frames = {"sled": {"joints": [{"kind": "prismatic", "axis": [1, 0, 0]}]}, "arm": {"on": "sled"}}
    given = swinging(None, **carrier, frame=frames)
    assert given.value("body.sled.mass") == 0.0 and given.frame["arm"].on == "sled"


def test_rigid_bodies_on_contacts_have_a_mass() -> None:
    with pytest.raises(BadInput, match=r"body\.arm\.mass: a body without a frame .* 0 stands for nothing where"):
        swinging(None, body={"arm": PAYLOAD | {"mass": 0.0}}, frame={}, sensor={})
