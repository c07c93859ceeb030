"""Gantries on two runway beams, and the trolleys that cross on them."""

from typing import Any

from engine.scene.study import Study
from tests.engine.build import Table, beam, fixed, mass, shuttle, study, swing

TRACKS = {"left": beam(modes=5, damping_ratio=0.02), "right": beam(modes=4, youngs_modulus=0.7, length=0.9)}
# a beam across, which rises, falls and rolls on pairs of wheels
GIRDER = beam(supports="free-free", length=0.8, modes=5, youngs_modulus=3.0, damping_ratio=0.01)
_WHEEL = {"stiffness": 400.0, "damping": 0.3}
PAIRS: Table = {
    "left_rear": _WHEEL | {"at": 0.1, "offset": -0.15},
    "left_front": _WHEEL | {"at": 0.1, "offset": 0.15},
    "right_rear": {"at": 0.7, "offset": -0.15, "stiffness": 300.0, "on": "right"},
    "right_front": {"at": 0.7, "offset": 0.15, "stiffness": 250.0, "damping": 0.2, "on": "right"},
}
_SECTION = {
    "area": 1.0,
    "second_moment": 1.0,
    "second_moment_lateral": 1.0,
    "torsion_constant": 1.0,
    "youngs_modulus": 50.0,
    "shear_modulus": 20.0,
    "density": 1.0,
}
_NODES: dict[str, list[float]] = {
    "p": [0.0, 0.0, 0.0],
    "a": [0.0, 0.1, 0.0],
    "b": [0.0, 0.7, 0.0],
    "q": [0.0, 0.8, 0.0],
}
_CORNERS = {f"{end}{side}": [x, _NODES[end][1], 0.0] for end in "ab" for side, x in (("r", -0.15), ("f", 0.15))}
_MEMBERS = [("p", "a"), ("a", "b"), ("b", "q"), ("ar", "a"), ("a", "af"), ("br", "b"), ("b", "bf")]
# a girder across on two end carriages, which pitch too
FRAME: Table = {
    "kind": "frame",
    "modes": 12,
    "damping_ratio": 0.01,
    "node": _NODES | _CORNERS,
    "section": {"all": _SECTION},
    "member": {f"{a}{b}": {"nodes": [a, b], "section": "all", "elements": 2} for a, b in _MEMBERS},
    "point": {corner: {"node": corner} for corner in _CORNERS},
    "track": {"members": ["pa", "ab", "bq"]},
}
CORNERS: Table = {
    name: {k: v for k, v in wheel.items() if k != "at"} | {"point": corner}
    for (name, wheel), corner in zip(PAIRS.items(), _CORNERS, strict=True)
}
CROSSING = swing(0.4, 0.1, 0.7, 1)
TROLLEY = mass(0.3, CROSSING, on="gantry")


def gantry(trolley: Table = TROLLEY, wheels: Table = PAIRS, body: Table = GIRDER, **changes: Any) -> Study:
    """A study of a gantry that runs along two beams, and of what crosses on it."""
    bodies = TRACKS | {"gantry": body} | changes.pop("more", {})
    crane = {"on": "left", "kind": "body", "body": "gantry", "contacts": wheels, "motion": changes.pop("motion", RUN)}
    sensors = {name: {"carriage": "crane", "contact": name, "quantity": "contact_force"} for name in wheels}
    sensors |= {"trolley_force": {"carriage": "trolley", "quantity": "contact_force"}}
    sensors |= {name: fixed(at, body=name) for name, at in (("left", 0.61), ("right", 0.4), ("gantry", 0.37))}
    carriages = {"crane": crane, "trolley": trolley}
    if changes.pop("trolley_first", False):
        carriages = {"trolley": trolley, "crane": crane}
    return study(beam(), carriages, **({"body": bodies, "sensor": sensors, "solver": {"steps": 150}} | changes))


RUN = shuttle(0.3, 0.7, 0.9, 0.2, 1)
