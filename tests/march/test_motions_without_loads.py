"""What loads cannot feel stays out of the results: motions that do not move the track, rounding, ends that are held."""

from typing import Any

import numpy as np
import pytest

import engine
from engine.bodies.files.track import line_between
from engine.model.scene_model import build_model
from engine.observation.contact_forces import span_counted
from results_schema.errors import BadInput
from tests.bodies.frames import LENGTH, straight
from tests.engine.build import Table, beam, cruise, fixed, mass, study

SLIDING = {"own": {"node": "a", "stiffness": [1e3, 0.0, 0.0]}}


def bridge(**changes: Any) -> Table:
    """A plane frame that slides along its own axis on a soft spring, far below its first bending mode."""
    return straight({"a": ["z"], "b": ["z"]}, plane="xz", spring=SLIDING) | changes


def crossing(bed: Table, **changes: Any) -> Any:
    at = 0.5 * LENGTH if bed["kind"] == "frame" else 0.5
    tables = {"body": {"bed": bed}, "sensor": {"mid": fixed(at)}} | changes
    return study(
        {"length": 2.0 * at} | bed if bed["kind"] == "beam" else bed | {"length": 2.0 * at}, ride(at), **tables
    )


def ride(half: float) -> Table:
    return mass(1.0, cruise(0.0, 2.0 * half, half))


def test_the_first_frequency_is_one_that_moves_the_track() -> None:
    model = build_model(crossing(bridge()), {}, {})
    omega = model.bodies[0].modal.omega
    assert model.first_omega == omega[1] > 3.0 * omega[0]


def test_a_frame_without_axial_load_reads_none() -> None:
    sensors = {"mid": fixed(0.5 * LENGTH), "axial": fixed(0.3 * LENGTH, "axial_force")}
    found = engine.run(crossing(bridge(), sensor=sensors))
    assert float(found.axial_max) == 0.0 == float(found.axial_min)
    assert float(found.mid_max) > 0.0


@pytest.mark.parametrize(
    ("supports", "span"),
    [("pinned-pinned", (0.0, 0.98)), ("pinned-free", (0.0, 1.0)), ("clamped-clamped", (0.0, 0.98))],
)
def test_the_end_of_the_way_is_left_out_where_it_is_held(supports: str, span: tuple[float, float]) -> None:
    model = build_model(crossing(beam(supports=supports)), {}, {})
    assert span_counted(model, model.riders[0], 0) == pytest.approx(span)


def test_ends_of_frames_are_looked_at_too() -> None:
    for supports, high in (({"a": "pinned", "b": ["z"]}, 0.98), ({"a": "clamped"}, 1.0)):
        model = build_model(crossing(straight(supports, plane="xz")), {}, {})
        assert span_counted(model, model.riders[0], 0)[1] == pytest.approx(high * LENGTH)


def test_a_track_that_ends_short_of_its_line_is_refused() -> None:
    places = np.array([[x, 0.0, 0.0] for x in range(11)], dtype=np.float64)
    numbers = np.arange(1, 12)
    found = line_between(numbers, places, (places[0], places[-1]), None)
    assert found.length == 10.0 and len(found.nodes) == 11
    with pytest.raises(BadInput, match=r"to: no node of this line is near its end: it would be 6"):
        line_between(numbers, places, (places[0], np.array([10.0, 0.025, 0.0])), None)
