"""Bodies that ride on contacts, and studies of one of them on a bed."""

from typing import Any

from engine.scene.study import Study
from tests.engine.build import Table, beam, fixed, shuttle, study, under

RIGID: Table = {"kind": "rigid", "length": 0.4, "mass": 0.5, "inertia": 0.01}
UNEVEN: Table = RIGID | {"centre": 0.13}
FLEXIBLE = beam(supports="free-free", length=0.5, modes=5, youngs_modulus=3.0, damping_ratio=0.01)
FRAME: Table = {
    "kind": "frame",
    "plane": "xz",
    "modes": 6,
    "damping_ratio": 0.01,
    "node": {"rear": [0.0, 0.0], "nose": [0.4, 0.0], "foot": [0.0, -0.1], "toe": [0.4, -0.1]},
    "section": {"all": {"area": 1.0, "second_moment": 1.0, "youngs_modulus": 50.0, "density": 1.0}},
    "member": {
        "top": {"nodes": ["rear", "nose"], "section": "all", "elements": 4},
        "back": {"nodes": ["foot", "rear"], "section": "all", "elements": 2, "up": [1, 0, 0]},
        "front": {"nodes": ["toe", "nose"], "section": "all", "elements": 2, "up": [1, 0, 0]},
    },
    "point": {"rear_shoe": {"node": "foot"}, "front_shoe": {"node": "toe"}},
    "track": {"members": ["top"]},
}
TWO = {
    "rear": {"at": 0.05, "stiffness": 400.0, "damping": 0.3},
    "front": {"at": 0.35, "stiffness": 500.0, "damping": 0.2},
}
THREE = {"a": {"at": 0.05, "stiffness": 400.0, "damping": 0.3}, "b": {"at": 0.2, "stiffness": 300.0}, "c": TWO["front"]}
SHOES = {
    "rear": {"point": "rear_shoe", "offset": -0.2, "stiffness": 400.0, "damping": 0.3},
    "front": {"point": "front_shoe", "offset": 0.2, "stiffness": 500.0},
}


def riding(motion: Table, contacts: Any = TWO, table: Table = RIGID, bed: Table | None = None, **changes: Any) -> Study:
    """A study of one body that rides on the bed, read wherever it can be read."""
    base = beam(damping_ratio=0.02, modes=5) if bed is None else bed
    car = {"on": "bed", "kind": "body", "body": "table", "contacts": contacts, "motion": motion}
    sensors = {name: {"carriage": "car", "contact": name, "quantity": "contact_force"} for name in contacts}
    sensors |= {
        "total": {"carriage": "car", "quantity": "contact_force"},
        "tip": fixed(0.1, body="table"),
        "tip_rate": fixed(0.1, "velocity", body="table"),
        "tip_acceleration": fixed(0.1, "acceleration", body="table"),
        "place": fixed(0.61),
        "below": under("car"),
    }
    tables = {"body": {"bed": base, "table": table}, "sensor": sensors, "solver": {"steps": 200}}
    return study(base, {"car": car}, **(tables | changes))


def quiet(**changes: Any) -> Study:
    """A very slow shuttle, nearly static."""
    return riding(shuttle(0.3, 0.7, 1e-4, 0.5, 1), **({"contacts": THREE, "table": FLEXIBLE} | changes))
