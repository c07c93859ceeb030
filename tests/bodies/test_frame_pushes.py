"""Influence lines of forces along the track of a frame: closed forms, modes of a whole model, and the same in files."""

from __future__ import annotations

import pickle
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.bodies.imported import imported
from engine.bodies.modal.modal_body import Direction, Gauge, ModalBody
from engine.scene.study import Study
from results_schema.arrays import Array
from tests.bodies.frames import AREA, CLAMPED_FREE, MODULUS, RAIL, SECOND_MOMENT, body, straight
from tests.bodies.models import Files, in_process
from tests.engine.build import mass, shuttle
from tests.march.along.test_inertia_along import in_space
from tests.observation.test_off_track import PORTAL, SPAN, one_span

X, S = np.array([0.4, 3.1, 7.5, 12.9])[:, None], np.array([0.4, 2.2, 8.4, 12.9])


def all_modes(**more: Any) -> ModalBody:
    """The portal with every mode that its elements have."""
    return body(PORTAL | {"modes": 64} | more)


def sums(modal: ModalBody, left: Array, s: Array, direction: Direction = "along") -> Array:
    """(X, S) what all modes carry of the static readings ``left`` (X, N) per unit force in a direction at s."""
    return np.asarray((left * modal.modal_flexibility) @ modal.sides[direction].derivatives(s, (0,))[0].T)


@pytest.mark.parametrize("lever", [0.0, 0.25])
def test_a_cantilever_that_is_pushed_is_the_closed_form(lever: float) -> None:
    """Stretched as far as the force stands, and bent by force times lever as far as that; on and between its nodes."""
    modal = body(straight(CLAMPED_FREE, track_offset=[0.0, 0.0, -lever]))
    assert modal.sections is not None
    near, stiffness = np.minimum(X, S), MODULUS * SECOND_MOMENT
    bent = lever * (near * X - 0.5 * near**2) / stiffness
    found = modal.sides["along"].influence_at("load", X, S)
    np.testing.assert_allclose(np.abs(found), bent, atol=1e-9 * max(bent.max(), 1e-12))
    slope = modal.sides["along"].influence_at("load", X, S, 1)
    np.testing.assert_allclose(np.abs(slope), lever * near / stiffness, atol=1e-9 * max(lever, 1e-12))
    own = near / (MODULUS * AREA) + lever**2 * near / stiffness
    np.testing.assert_allclose(modal.sides["along"].influence_at("along", X, S), own, rtol=1e-9)
    moment, normal = (modal.sides["along"].section_at(quantity, X, S) for quantity in ("bending_moment", "axial_force"))
    np.testing.assert_allclose(np.abs(moment), lever * (X < S), atol=1e-9)
    np.testing.assert_allclose(normal, 1.0 * (X < S), atol=1e-9)
    np.testing.assert_allclose(-stiffness * modal.sides["along"].influence_at("load", X, S, 2), moment, atol=1e-9)


@pytest.mark.parametrize("offset", [[0.0, 0.0, 0.0], [0.0, 0.0, 0.4]])
def test_a_portal_that_is_pushed_is_the_sum_of_all_its_modes(offset: list[float]) -> None:
    """At the nodes, where finite elements hold all that there is; and both ways round, everywhere."""
    modal = all_modes(track=PORTAL["track"] | {"offset": offset})
    assert modal.points is not None and modal.omega.size < 64
    nodes = np.array([0.0, 1.1, 2.2, 3.1, SPAN])
    along = modal.sides["along"].derivatives(nodes, (0,))[0]
    for found, left in (
        (modal.sides["along"].influence_at("along", nodes[:, None], nodes), along),
        (modal.sides["along"].influence_at("load", nodes[:, None], nodes), modal.shape(nodes)),
        (modal.sides["along"].of_point("point.knee", nodes)[None], modal.points.row("point.knee")[None]),
    ):
        np.testing.assert_allclose(found, sums(modal, left, nodes), atol=1e-6 * np.abs(found).max())
    place, load = np.array([0.3, 1.45, 2.0, 3.7]), np.array([1.2, 2.9, 3.7, 0.3])
    own = modal.sides["along"].influence_at("along", place, load)
    np.testing.assert_allclose(own, modal.sides["along"].influence_at("along", load, place), rtol=1e-9)
    between = modal.flexibility_between(place, load, ("load", "along"))
    np.testing.assert_array_equal(between, modal.flexibility_between(load, place, ("along", "load")))
    np.testing.assert_allclose(
        between, modal.sides["along"].influence_at("load", place[:, None], load).diagonal(), rtol=1e-12
    )


def test_a_cantilever_that_is_pushed_across_is_the_closed_form() -> None:
    """Bent on its side, and twisted as far as the force stands beside its axis; on and between its nodes."""
    modal, lever = body(straight(CLAMPED_FREE, track_offset=[0.0, 0.0, -0.25])), 0.25
    near, far = np.minimum(X, S), np.maximum(X, S)
    shear = MODULUS / (2.0 * (1.0 + RAIL["poissons_ratio"]))
    bent = near**2 * (3.0 * far - near) / (6.0 * MODULUS * RAIL["second_moment_lateral"])
    twisted = lever**2 * near / (shear * RAIL["torsion_constant"])
    across = modal.sides["across"]
    np.testing.assert_allclose(across.influence_at("across", X, S), bent + twisted, rtol=1e-8)
    torque, moment = (across.section_at(quantity, X, S) for quantity in ("torque", "bending_moment"))
    np.testing.assert_allclose(np.abs(torque), lever * (X < S), atol=1e-9)
    np.testing.assert_allclose(moment, 0.0, atol=1e-9)


def test_a_portal_that_is_pushed_across_is_the_sum_of_all_its_modes() -> None:
    """In all directions at its nodes, with a section that stands askew; and both ways round, everywhere."""
    table = in_space([0.0, 0.3, 0.4]) | {"modes": 64}
    table["point"] = {"knee": {"node": "c", "direction": [0.3, 1.0, 0.2]}}
    table["member"] = {name: part | {"up": [0.0, 1.0, 0.2]} for name, part in table["member"].items()}
    modal = body(table)
    assert modal.points is not None and modal.omega.size < 64
    nodes = np.array([0.0, 0.9, 1.8, 2.9, SPAN])
    directions: tuple[Direction, ...] = ("load", "along", "across")
    across = modal.sides["across"]
    for direction in directions:
        found, left = across.influence_at(direction, nodes[:, None], nodes), modal.shapes_in(direction)
        wanted = sums(modal, left.derivatives(nodes, (0,))[0], nodes, "across")
        np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(found).max())
    found = across.of_point("point.knee", nodes)
    np.testing.assert_allclose(found, sums(modal, modal.points.row("point.knee")[None], nodes, "across")[0], rtol=1e-6)
    place, load = np.array([0.3, 1.45, 2.0, 3.7]), np.array([1.2, 2.9, 3.7, 0.3])
    for one, other in product(directions, directions):
        both = modal.flexibility_between(place, load, (one, other))
        size = np.abs(modal.flexibility_between(place, load, (one, one))).max()
        np.testing.assert_allclose(both, modal.flexibility_between(load, place, (other, one)), atol=1e-9 * size)


def gauge(bed: dict[str, Any], node: str | int) -> tuple[ModalBody, Gauge]:
    """The body of a study in which a sensor reads the sway of a node."""
    car = mass(1.0, shuttle(0.8, 3.1, 2.0, 0.3, 1), on="portal", inertia_along=True)
    sensor = {"sway": {"body": "portal", "node": node, "direction": "x"}}
    study = Study(schema_version=1, kind="passage", body={"portal": bed}, carriage={"car": car}, sensor=sensor)
    modal = study.body["portal"].read_at(study.spots("portal"))
    return modal, modal.gauges["sway"]


def test_bodies_out_of_files_are_pushed_alike(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At their nodes to rounding; a smooth curve between them is not a line of straight bars."""
    monkeypatch.setattr(imported, "read_files", in_process)
    files = Files(tmp_path, one_span()).table(modes=12, point={"knee": {"node": 3, "direction": [1.0, 0.0, 0.0]}})
    (frame, sway), (found, same) = gauge(one_span(), "b"), gauge(files, 2)
    found, same = pickle.loads(pickle.dumps((found, same)))  # as from the process that built it
    nodes = np.linspace(0.0, SPAN, 9)
    asked: tuple[tuple[Direction, int], ...] = (("along", 0), ("load", 0), ("load", 1))
    for direction, derivative in asked:
        wanted, given = (
            one.sides["along"].influence_at(direction, nodes[:, None], nodes, derivative) for one in (frame, found)
        )
        np.testing.assert_allclose(given, wanted, atol=1e-8 * np.abs(wanted).max())
    for wanted, given in (
        (sway.influence(nodes, "along"), same.influence(nodes, "along")),
        (frame.sides["along"].of_point("point.knee", nodes), found.sides["along"].of_point("point.knee", nodes)),
    ):
        np.testing.assert_allclose(given, wanted, rtol=1e-8)


def test_a_node_and_a_place_of_a_member_read_what_the_track_does() -> None:
    """Sensors along the track at its first node, and between two of its nodes, beside the track's own motion."""
    table = {"sway": {"body": "portal", "member": "first", "at": 0.7, "direction": "x"}}
    car = mass(1.0, shuttle(0.8, 3.1, 2.0, 0.3, 1), on="portal", inertia_along=True)
    study = Study(schema_version=1, kind="passage", body={"portal": PORTAL}, carriage={"car": car}, sensor=table)
    modal = study.body["portal"].read_at(study.spots("portal"))
    s = np.array([0.2, 1.0, 1.5, 1.9, 3.3])
    place = SPAN - 1.8 - 0.7  # the member runs against the track, and x too
    wanted = -modal.sides["along"].influence_at("along", np.full_like(s, place), s)
    np.testing.assert_allclose(modal.gauges["sway"].influence(s, "along"), wanted, rtol=1e-9)


def test_supports_carry_what_pushes_along_the_track() -> None:
    """Both feet together the whole of it, against its direction, wherever it stands; and together no load upwards."""
    feet = {
        f"{foot}_{way}": {"body": "portal", "node": foot, "quantity": "support_reaction", "direction": way}
        for foot in "ad"
        for way in "xz"
    }
    car = mass(1.0, shuttle(0.8, 3.1, 2.0, 0.3, 1), on="portal", inertia_along=True)
    study = Study(schema_version=1, kind="passage", body={"portal": PORTAL}, carriage={"car": car}, sensor=feet)
    gauges, s = study.body["portal"].read_at(study.spots("portal")).gauges, np.array([0.2, 1.0, 1.9, 3.3])
    carried = {name: gauge.influence(s, "along") for name, gauge in gauges.items()}
    np.testing.assert_allclose(carried["a_x"] + carried["d_x"], -1.0, atol=1e-9)  # the track runs against x
    np.testing.assert_allclose(carried["a_z"] + carried["d_z"], 0.0, atol=1e-9)
