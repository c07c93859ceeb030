"""Rotations: the slope of a track, beside a closed form, displacements side by side, and a frame."""

import numpy as np
import pytest

import studies
from engine.scene.study import Study
from results_schema.errors import BadInput
from studies.kinds.passage import KIND
from studies.results.formatting import scale_for
from studies.results.results import Results

LENGTH, STIFFNESS, FORCE = 20.0, 2.1e8, 1e4
BEAM = {
    **{"kind": "beam", "length": LENGTH, "area": 0.05, "second_moment": 1e-3, "youngs_modulus": 2.1e11},
    **{"density": 7850.0, "supports": "pinned-pinned", "damping_ratio": 0.02},
}
FRAME = {
    **{"kind": "frame", "plane": "xz", "node": {"a": [0, 0], "b": [LENGTH, 0]}, "damping_ratio": 0.02},
    "section": {"s": {"area": 0.05, "second_moment": 1e-3, "youngs_modulus": 2.1e11, "density": 7850.0}},
    **{"member": {"m": {"nodes": ["a", "b"], "section": "s", "elements": 16}}, "track": {"members": ["m"]}},
    "supports": {"a": "pinned", "b": ["z"]},
}
APART = 1e-3


def crossing(body: dict[str, object], sensors: dict[str, object], **more: object) -> Study:
    motion = {"kind": "cruise", "start": 0.0, "end": LENGTH, "speed": 30.0}
    load = {"kind": "force", "on": "bed", "force": FORCE, "motion": motion}
    tables: dict[str, object] = {"body": {"bed": body}, "carriage": {"load": load}, "sensor": sensors}
    return Study(kind="passage", **(tables | more))


def at(place: float, quantity: str = "rotation") -> dict[str, object]:
    return {"body": "bed", "at": place, "quantity": quantity}


def test_the_static_rotation_of_an_end_is_the_closed_form() -> None:
    """P a b (L + b)/(6 L E I) at its largest, a = (1 - 1/sqrt 3) L; of the other end with the other sign."""
    found = studies.run(
        crossing(BEAM, {"near": at(0.0), "far": at(LENGTH)}, solver={"fidelity": "static", "tolerance": 1e-6})
    )
    a = (1.0 - 1.0 / np.sqrt(3.0)) * LENGTH
    wanted = FORCE * a * (LENGTH - a) * (2.0 * LENGTH - a) / (6.0 * LENGTH * STIFFNESS)
    assert float(found["near_max"]) == pytest.approx(wanted, rel=1e-5)
    assert float(found["far_min"]) == pytest.approx(-wanted, rel=1e-5)
    assert found["near_max"].units == "rad"


@pytest.mark.parametrize("body", [BEAM, FRAME], ids=["beam", "frame"])
def test_it_is_the_difference_of_displacements_side_by_side(body: dict[str, object]) -> None:
    place = 0.3 * LENGTH
    beside = {"before": at(place - APART, "displacement"), "behind": at(place + APART, "displacement")}
    found = studies.run(crossing(body, {"turn": at(place)} | beside, output={"histories": "all"}))
    slope = (found["behind"] - found["before"]) / (2.0 * APART)
    assert float(abs(found["turn"] - slope).max()) < 1e-5 * float(abs(slope).max())
    assert float(abs(slope).max()) > 1e-5


def test_a_frame_of_one_beam_turns_as_the_beam_does() -> None:
    ends = [float(studies.run(crossing(body, {"near": at(0.0)}))["near_max"]) for body in (BEAM, FRAME)]
    assert ends[0] == pytest.approx(ends[1], rel=3e-3)


def test_a_limit_of_rotations_is_told_in_milliradians() -> None:
    given = crossing(BEAM, {"near": at(0.0)}, question={"rotation": "0.1 mrad"})
    found = studies.run(given)
    said = " ".join(KIND.findings(Results.of(found)))
    largest, limit = float(found["near_max"]), 1e-4
    assert "the largest rotation at 0 m of bed" in said and largest > limit and "rad" in said
    assert scale_for(2e-3, "rad").unit == "mrad" and scale_for(0.5, "rad").unit == "rad"


def test_nodes_do_not_tell_it() -> None:
    with pytest.raises(BadInput, match="only a track has rotation"):
        crossing(FRAME, {"turn": {"body": "bed", "node": "a", "quantity": "rotation"}})
