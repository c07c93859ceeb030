"""A mass on a spring at a node at which no member ends: a tuned mass damper."""

from typing import Any

import numpy as np
import pytest

import studies
from engine.scene.study import Study
from results_schema.errors import BadInput

MASS, STIFFNESS, DAMPING = 1500.0, 2.6e5, 1.6e3
DECK = {"area": 0.3, "second_moment": 0.05, "youngs_modulus": 210e9, "density": 7850.0}
TUNED = {"node": "hung", "to": "mid", "stiffness": [0.0, 0.0, STIFFNESS], "damping": [0.0, 0.0, DAMPING]}
LOAD = {
    "kind": "force",
    "on": "bridge",
    "force": 1e5,
    "motion": {"kind": "cruise", "start": 0.0, "end": 40.0, "speed": 30.0, "after": 10.0},
}


def bridge(**changes: Any) -> dict[str, Any]:
    """A deck of one span without damping of its own, and a node at its middle."""
    return {
        "kind": "frame",
        "plane": "xz",
        "supports": {"west": "pinned", "east": ["z"]},
        "node": {"west": [0, 0], "mid": [20, 0], "east": [40, 0]},
        "section": {"deck": DECK},
        "member": {
            "one": {"nodes": ["west", "mid"], "section": "deck"},
            "two": {"nodes": ["mid", "east"], "section": "deck"},
        },
        "track": {"members": ["one", "two"]},
        "modes": 12,
    } | changes


def tuned(spring: dict[str, Any] | None = None, mass: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    """The same with a mass that hangs at its middle."""
    own = bridge(**changes)
    own["node"] = own["node"] | {"hung": [20, -1.5]}
    hung = {"node": "hung", "mass": MASS} | (mass or {})
    return own | {"point_mass": {"hung": hung}, "spring": {"hung": TUNED | (spring or {})}}


def crossing(body: dict[str, Any], sensors: dict[str, Any], **tables: Any) -> Study:
    """A force that crosses the deck."""
    middle = {"mid": {"body": "bridge", "at": 20.0}}
    carriage = {"load": LOAD} | tables.pop("carriage", {})
    given = {"body": {"bridge": body}, "carriage": carriage, "sensor": middle | sensors, "gravity": 0.0}
    given |= {"output": {"histories": "all"}, "solver": {"steps": 16000, "scheme": "fox-goodwin"}}
    return Study(kind="trajectory", **(given | tables))


def test_it_is_an_oscillator_that_stands_at_its_node() -> None:
    """An oscillator whose way is a hundredth of a millimetre long is coupled by its tie in place of by modes."""
    way = {"kind": "waypoints", "times": [0.0, 5.0], "positions": [20.0, 20.00001]}
    standing = {"kind": "oscillator", "on": "bridge", "mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING}
    hung = {"hung": {"body": "bridge", "node": "hung", "direction": [0, 0, -1]}}
    mine = studies.run(crossing(tuned(), hung))
    beside = {"carriage": {"tuned": standing | {"motion": way}}}
    other = studies.run(crossing(bridge(), {"hung": {"carriage": "tuned"}}, **beside))
    alone = studies.run(crossing(bridge(), {}))
    time = np.linspace(0.2, 2.0, 200)
    for name, least in (("mid", 0.05), ("hung", 0.3)):
        one, two = (np.interp(time, one.elapsed.values.ravel(), one[name].values.ravel()) for one in (mine, other))
        size = np.abs(two).max()
        np.testing.assert_allclose(one, two, rtol=0.0, atol=2e-4 * size, err_msg=name)
        without = np.interp(time, alone.elapsed.values.ravel(), alone["mid"].values.ravel())
        assert np.abs(one - without).max() > least * size


def test_it_hangs_lower_by_its_weight_over_its_spring() -> None:
    """Wherever a carriage stands; of its mass, which the deck carries too."""
    hung = {"hung": {"body": "bridge", "node": "hung", "direction": "z"}}
    carriage = {"load": {"kind": "mass", "on": "bridge", "mass": 1e4, "motion": LOAD["motion"]}}
    tables = {"kind": "influence", "gravity": 9.81, "carriage": carriage, "solver": {}, "output": {}}
    sags = []
    for mass in (MASS, 2.0 * MASS):
        study = crossing(tuned(mass={"mass": mass}, own_weight=True), hung)
        found = studies.run(Study(**(study.data | tables)))
        np.testing.assert_allclose(-found.hung - found.mid, mass * 9.81 / STIFFNESS, rtol=1e-6)
        sags.append(found.mid.values)
    sag_of_weight = MASS * 9.81 * 40.0**3 / (48.0 * DECK["youngs_modulus"] * DECK["second_moment"])
    np.testing.assert_allclose(sags[1] - sags[0], sag_of_weight, rtol=1e-6)


def test_its_spring_and_damper_are_swept_like_others() -> None:
    """Every variant is the same study by itself."""
    sweep = {
        "stiffness": {"of": "body.bridge.spring.hung.stiffness.2", "values": [STIFFNESS / 4.0, STIFFNESS]},
        "damping": {"of": "body.bridge.spring.hung.damping.2", "values": [0.0, DAMPING]},
    }
    found = studies.run(Study(**(crossing(tuned(), {}).data | {"kind": "passage", "sweep": sweep})))
    for row, spring in enumerate((STIFFNESS / 4.0, STIFFNESS)):
        for column, damper in enumerate((0.0, DAMPING)):
            changed = {"stiffness": [0.0, 0.0, spring], "damping": [0.0, 0.0, damper]}
            alone = studies.run(Study(**(crossing(tuned(changed), {}).data | {"kind": "passage"})))
            assert float(found.mid_min[row, column]) == pytest.approx(float(alone.mid_min), rel=1e-9)


REFUSED: dict[str, tuple[dict[str, Any], list[str]]] = {
    "no mass": ({"point_mass": {}}, ["body.bridge.node.hung", "no member ends", "a point_mass and a spring"]),
    "no spring": ({"spring": {}}, ["body.bridge.node.hung", "no member ends", "a point_mass and a spring"]),
    "to the ground alone": (
        {"spring": {"hung": {key: value for key, value in TUNED.items() if key != "to"}}},
        ["node.hung", "nothing connects"],
    ),
    "a damper alone": (
        {"spring": {"hung": TUNED | {"damping": [1e3, 0.0, 1e3]}}},
        ["spring.hung.damping", "a damper without a spring", "a stiffness along x too"],
    ),
    "no inertia": (
        {"spring": {"hung": TUNED | {"rotational": [0.0, 1e3, 0.0]}}},
        ["node.hung", "no inertia about y", "of its point_mass"],
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_would_not_be_one_is_refused(name: str) -> None:
    changes, words = REFUSED[name]
    with pytest.raises(BadInput) as caught:
        crossing(tuned() | changes, {})
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_it_stands_still_where_no_spring_acts() -> None:
    """So that nothing is read there; with a spring along x it has another mode, of that spring alone."""
    with pytest.raises(BadInput, match=r"sensor\.hung\.direction: nothing moves here"):
        studies.run(crossing(tuned(), {"hung": {"body": "bridge", "node": "hung", "direction": "x"}}))
    sideways = TUNED | {"stiffness": [1e3, 0.0, STIFFNESS]}
    one, two = (
        Study(**(crossing(tuned(spring), {}).data)).body["bridge"].build().omega for spring in (TUNED, sideways)
    )
    assert two.size == one.size == 12 and two[0] == pytest.approx(np.sqrt(1e3 / MASS), rel=1e-3)
    np.testing.assert_allclose(two[1:6], one[:5], rtol=1e-6)
