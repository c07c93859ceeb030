"""Frames for tests, small and of round numbers."""

from typing import Any

import numpy as np

from engine.bodies.beam.modes import uniform_beam
from engine.bodies.frame.body import frame_body
from engine.bodies.frame.frame import Frame
from engine.bodies.modal.modal_body import ModalBody
from tests.bodies.beams import uniform

LENGTH, AREA, SECOND_MOMENT, MODULUS, DENSITY = 15.0, 0.01, 8.33e-6, 2.1e11, 7850.0
RAIL: dict[str, Any] = {
    "area": AREA,
    "second_moment": SECOND_MOMENT,
    "second_moment_lateral": 3.0e-6,
    "torsion_constant": 5.0e-6,
    "youngs_modulus": MODULUS,
    "poissons_ratio": 0.3,
    "density": DENSITY,
    "shear_area": 0.006,
    "shear_area_lateral": 0.005,
    "fibre_distance": 0.1,
    "fibre_distance_lateral": 0.05,
}
PINNED = {"a": ["x", "y", "z", "rx"], "b": ["y", "z"]}
CLAMPED_FREE = {"a": "clamped"}


def straight(supports: dict[str, Any], elements: int = 8, **more: Any) -> dict[str, Any]:
    """The table of a straight horizontal frame from a to b; keys in `more` replace others, member's with `member_`."""
    member = {"nodes": ["a", "b"], "section": "rail", "elements": elements}
    member |= {key.removeprefix("member_"): more.pop(key) for key in list(more) if key.startswith("member_")}
    track: dict[str, Any] = {"members": ["span"]}
    track |= {key.removeprefix("track_"): more.pop(key) for key in list(more) if key.startswith("track_")}
    section = RAIL | more.pop("section", {})
    return {
        "kind": "frame",
        "node": {"a": [0.0, 0.0, 0.0], "b": [LENGTH, 0.0, 0.0]},
        "section": {"rail": section},
        "member": {"span": member},
        "supports": supports,
        "track": track,
    } | more


def body(table: dict[str, Any]) -> ModalBody:
    """The modal body of a frame's table."""
    return frame_body(Frame.model_validate(table))


def beam(ends: tuple[str, str], modes: int) -> ModalBody:
    """The same rail as the engine's uniform beam."""
    return uniform_beam(uniform(LENGTH, AREA, SECOND_MOMENT, MODULUS, DENSITY, ends=ends), modes)


def turned(table: dict[str, Any], matrix: np.ndarray) -> dict[str, Any]:
    """The frame turned in space: nodes and all directions; supports must not depend on directions."""

    def turn(vector: Any) -> list[float]:
        return [float(part) for part in matrix @ np.array(vector, dtype=float)]

    found = dict(table)
    found["node"] = {name: turn(place) for name, place in table["node"].items()}
    found["gravity_direction"] = turn(table.get("gravity_direction", [0.0, 0.0, -1.0]))
    found["member"] = {
        name: member | {key: turn(member[key]) for key in ("up",) if key in member}
        for name, member in table["member"].items()
    }
    track = table["track"]
    found["track"] = track | {key: turn(track[key]) for key in ("offset", "direction") if key in track}
    return found
