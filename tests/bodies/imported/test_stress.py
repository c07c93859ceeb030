"""Stress of imported bodies by recovery matrices: a frame's own bending stress, and the element forces of a file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_matrix, save_npz

from engine.bodies.build import build_body
from engine.bodies.imported.kinds import Matrices, Nastran
from engine.bodies.modal.modal_body import ModalBody
from results_schema.errors import BadInput
from tests.bodies.frames import LENGTH, MODULUS, PINNED, RAIL, body, straight
from tests.bodies.models import Files, optional

ELEMENTS = 16


@pytest.fixture(scope="module")
def recovered(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A straight frame with rows for the stress -E c w'' at both ends of every element, w'' of its cubic."""
    files = Files(tmp_path_factory.mktemp("stress"), straight({}, elements=ELEMENTS))
    order = np.argsort(files.assembly.mesh.points[:, 0])
    length, factor = LENGTH / ELEMENTS, -MODULUS * RAIL["fibre_distance"]
    rows = np.zeros((2 * ELEMENTS, 6 * len(order)))
    for element in range(ELEMENTS):
        here, there = 6 * order[element], 6 * order[element + 1]
        for end, (turn, far) in enumerate(((-4.0, -2.0), (2.0, 4.0))):
            sign = -1.0 if end == 0 else 1.0
            row = rows[2 * element + end]  # w = -z, and its slope is the rotation about y
            row[here + 2], row[there + 2] = -sign * 6.0 / length**2, sign * 6.0 / length**2
            row[here + 4], row[there + 4] = turn / length, far / length
    save_npz(files.folder / "recovery.npz", csc_matrix(factor * rows[:, files.assembly.free]))
    listed = [[1], *([2 * e, 2 * e + 1] for e in range(1, ELEMENTS)), [2 * ELEMENTS]]
    supports = {"1": ["x", "y", "z", "rx"], "2": ["y", "z"]}
    return files.table(recovery=str(files.folder / "recovery.npz"), stress_rows=listed, supports=supports)


def modal(table: dict[str, Any]) -> ModalBody:
    return build_body(Matrices.model_validate(table))


def held_sag(length: float) -> float:
    """w'' at the ends of an element with held ends under the rail's own weight per unit gravity: q l^2/(12 E I)."""
    return float(RAIL["density"] * RAIL["area"] * length**2 / (12.0 * MODULUS * RAIL["second_moment"]))


def test_influence_and_own_weight(recovered: dict[str, Any]) -> None:
    found, frame = modal(recovered | {"point": {"middle": {"node": 10}}}), body(straight(PINNED, elements=ELEMENTS))
    assert found.sections is not None and frame.sections is not None and found.points is not None
    nodes = np.linspace(0.0, LENGTH, ELEMENTS + 1)
    for load in (nodes[3], nodes[10]):
        wanted = frame.sections.influence_at("stress", nodes, load)
        assert np.abs(found.sections.influence_at("stress", nodes, load) - wanted).max() < 1e-9 * np.abs(wanted).max()
    between = 0.4 * nodes[4] + 0.6 * nodes[5]
    wanted = frame.sections.influence_at("stress", nodes, between)
    far = np.abs(nodes - between) > LENGTH / ELEMENTS
    given = found.sections.influence_at("stress", nodes, between)
    assert np.abs(given - wanted)[far].max() < 1e-9 * np.abs(wanted).max()
    middle = 0.5 * (nodes[1:] + nodes[:-1])
    line = found.sections.influence_at("stress", middle, nodes[10])
    assert np.abs(line - frame.sections.influence_at("stress", middle, nodes[10])).max() < 1e-9 * np.abs(line).max()
    wanted = frame.sections.influence_at("stress", nodes, 7.5)  # where node 10 stands
    given = found.points.section_influence("stress", "point.middle", nodes)
    assert np.abs(given - wanted).max() < 1e-9 * np.abs(line).max()
    weighed = frame.sections.own_weight("stress", nodes[1:-1])
    spread = MODULUS * RAIL["fibre_distance"] * held_sag(LENGTH / ELEMENTS)  # what elements bend by between nodes
    assert np.abs(found.sections.own_weight("stress", nodes[1:-1]) - weighed - spread).max() < 1e-6 * weighed.max()
    with pytest.raises(BadInput, match="strain is not available"):
        found.sections.rows("strain", nodes)


def test_strain_beside_stress(recovered: dict[str, Any]) -> None:
    """The same rows as strain, by modes, loads, own weight and points, and alone: numbers without a unit, which stay
    where the files' unit of force makes stresses of theirs."""
    both = recovered | {"strain_rows": recovered["stress_rows"], "point": {"middle": {"node": 10}}}
    places, found = np.linspace(0.0, LENGTH, 37), modal(both)
    assert found.sections is not None and found.points is not None
    for told in (
        lambda quantity: found.sections.rows(quantity, places),
        lambda quantity: found.sections.influence_at(quantity, places, 0.3 * LENGTH),
        lambda quantity: found.sections.own_weight(quantity, places),
        lambda quantity: found.points.section_influence(quantity, "point.middle", places),
    ):
        scale = np.abs(told("stress")).max()
        assert scale > 0.0
        assert told("strain") == pytest.approx(told("stress"), abs=1e-9 * scale)
    only = {key: value for key, value in both.items() if key != "stress_rows"}
    alone = modal(only).sections
    assert alone is not None
    wanted = found.sections.rows("strain", places)
    assert alone.rows("strain", places) == pytest.approx(wanted, abs=1e-9 * np.abs(wanted).max())
    with pytest.raises(BadInput, match="stress is not available"):
        alone.rows("stress", places)
    in_kn = modal(both | {"force_unit": "1 kN"}).sections  # a thousand times the stiffness and the mass
    assert in_kn is not None
    for quantity, factor in (("strain", 1e-3), ("stress", 1.0)):
        wanted = factor * found.sections.influence_at(quantity, places, 0.3 * LENGTH)
        per_load = in_kn.influence_at(quantity, places, 0.3 * LENGTH)
        assert per_load == pytest.approx(wanted, abs=1e-9 * np.abs(wanted).max())


@pytest.mark.extras
def test_element_forces_of_a_file() -> None:
    """Second source: the file's own rows times the free vibration modes by scipy, in the file's own directions."""
    pyyeti = optional("pyyeti")
    op4 = optional("pyyeti.nastran.op4")
    folder = Path(pyyeti.__file__).parent / "tests" / "cla_test_data"
    whole = op4.read(str(folder / "outboard.op4"))
    rows = [13, 200]
    table = {
        "kind": "nastran",
        "matrices": str(folder / "outboard.op4"),
        "nodes": str(folder / "outboard.asm"),
        "track": {"nodes": [3, 11]},
        "recovery": "mef1",
        "stress_rows": [[rows[0]], rows],
        "modes": 12,
    }
    found = build_body(Nastran.model_validate(table))
    assert found.sections is not None
    _, shapes = eigh(whole["kxx"], whole["mxx"])
    wanted = whole["mef1"][np.array(rows) - 1] @ shapes[:, 6:12]
    given = found.sections.rows("stress", [0.0, found.length])[:, 6:]
    assert np.abs(np.abs(given[0]) - np.abs(wanted[0])).max() < 1e-5 * np.abs(wanted).max()
    assert np.abs(np.abs(given[1]) - np.abs(wanted.mean(axis=0))).max() < 1e-5 * np.abs(wanted).max()
