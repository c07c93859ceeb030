"""Static deflections under what hangs on frames of beams and solid models, and under what pulls at rods, as shapes
beside their modes: beside whole finite elements and closed forms."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from engine.bodies.beam.beam import Beam
from engine.bodies.frame.assembly import assemble, cross_matrix
from engine.bodies.frame.frame import Frame as FrameBody
from engine.floating.bodies.build import elastic_body
from engine.floating.bodies.elastic import ElasticBody
from engine.floating.bodies.fields import X
from engine.scene.frames import Frame
from results_schema.quantities import QUANTITIES
from tests.floating.bodies.test_frames_of_beams import PORTAL, STEEL

TUBE = STEEL | {"area": 4e-3, "second_moment": 9e-6, "second_moment_lateral": 5e-6, "torsion_constant": 8e-6}
ARM = {
    "kind": "frame",
    "node": {"root": [1, 2, 5], "tip": [4, 2, 5]},
    "section": {"all": TUBE},
    "member": {"all": {"nodes": ["root", "tip"], "section": "all", "elements": 12}},
    "supports": {"root": "clamped"},
    "track": {"members": ["all"]},
    "modes": 4,
    "own_weight": True,
}
#: So slender that it does not matter that particles around its axis have inertia of rotation across it.
WIRE = ARM | {
    "section": {"all": TUBE | {"second_moment": 9e-9, "second_moment_lateral": 5e-9, "torsion_constant": 8e-9}},
    "supports": {},
}
FREE = Frame.model_validate({"joints": [{"kind": "free"}]})


class Payload(NamedTuple):
    """A rigid body: mass, moments of inertia about axes of the floating frame, and how far off its centre is."""

    mass: float
    inertia: tuple[float, float, float]
    out: tuple[float, float, float]

    def matrix(self) -> np.ndarray:
        """(6, 6) mass where it hangs."""
        reach = np.eye(6)
        reach[:3, 3:] = -cross_matrix(self.out)
        return reach.T @ np.diag([self.mass] * 3 + list(self.inertia)) @ reach


HEAVY = Payload(150.0, (8.0, 12.0, 9.0), (0.3, 0.05, -0.2))


def frequencies(body: ElasticBody, place: float, payload: Payload, flies: bool) -> np.ndarray:
    """Of a body with another one on its track, in a frame that stands, or that moves freely."""
    whole, here = np.zeros((len(body.weights), 3, 0)), np.zeros((6, 0))
    if flies:
        whole = np.concatenate([np.tile(np.eye(3), (len(body.places), 1, 1)), -cross_matrix(body.places)], axis=2)
        here = np.eye(6)
        here[:3, 3:] = -cross_matrix([place, 0.0, 0.0])
    moved = np.concatenate([whole, body.shapes], axis=2)
    there = np.concatenate([here, body.fields(np.array([place]), (0,))[0, 0]], axis=1)
    M = np.einsum("g,gai,gaj->ij", body.weights, moved, moved) + there.T @ payload.matrix() @ there
    K = np.diag(np.concatenate([np.zeros(here.shape[1]), body.omega**2]))
    return np.sqrt(eigh(K, M, eigvals_only=True)[here.shape[1] :])


def of_all_elements(table: dict, node: str, axes: np.ndarray, payload: Payload) -> np.ndarray:
    """The same by all degrees of freedom of a frame."""
    frame = FrameBody.model_validate(table)
    found, both = assemble(frame), np.kron(np.eye(2), axes)
    mass, at = found.all_mass.toarray(), 6 * list(frame.node).index(node) + np.arange(6)
    mass[np.ix_(at, at)] += both.T @ payload.matrix() @ both
    M = mass[np.ix_(found.free, found.free)]
    values = eigh(found.stiffness.toarray(), M, eigvals_only=True)
    return np.sqrt(values[found.rigid.shape[1] :])


def along(table: dict) -> np.ndarray:
    """Axes of the floating frame of a frame whose loads point down."""
    line = FrameBody.model_validate(table).line
    return np.stack([line.tangent, np.cross([0.0, 0.0, -1.0], line.tangent), [0.0, 0.0, -1.0]])


@pytest.mark.parametrize(
    ("table", "node", "place", "frame"),
    [
        (ARM | {"modes": 6}, "tip", 3.0, Frame()),
        (PORTAL | {"modes": 6}, "right", np.hypot(4.0, 0.5), Frame()),
        (WIRE | {"modes": 12}, "tip", 3.0, FREE),
    ],
    ids=["cantilever", "portal", "flying"],
)
def test_frequencies_of_frames_that_carry_a_heavy_body(table: dict, node: str, place: float, frame: Frame) -> None:
    """The first three of few modes, beside all degrees of freedom; modes alone miss."""
    wanted = of_all_elements(table, node, along(table), HEAVY)[:3]
    body = FrameBody.model_validate(table)
    found, alone = (
        frequencies(elastic_body(body, frame, None, "body.b", hung), place, HEAVY, frame is FREE)[:3]
        for hung in ([place], [])
    )
    assert found == pytest.approx(wanted, rel=1e-5)
    assert np.abs(alone / wanted - 1.0).max() > 1e-3


def test_nothing_is_added_to_modes_that_hold_the_place() -> None:
    """All modes of a Craig-Bampton reduction, of whose interface the place is a node: its shapes under unit motions
    there are the deflections under loads."""
    reduced = ARM | {"interface": ["tip"], "fixed_interface_modes": 6, "modes": 12}
    body = FrameBody.model_validate(reduced)
    assert elastic_body(body, Frame(), None, "body.b", [3.0]).omega.size == 12
    assert elastic_body(body, Frame(), None, "body.b", [1.5]).omega.size > 12


def test_bending_moment_under_a_torque_at_the_end_of_a_frame() -> None:
    """The bending moment is the same all along the arm; of modes alone it is off by a third."""
    body = FrameBody.model_validate(ARM)

    def told(hung: list[float], about: int, quantity: str) -> np.ndarray:
        found = elastic_body(body, Frame(), None, "body.b", hung)
        q = found.fields(np.array([3.0]), (0,))[0, 0, about] / found.omega**2
        return np.array([found.reading(QUANTITIES[quantity], x) @ q for x in (0.1, 1.3, 2.9)])

    assert np.abs(told([3.0], 4, "bending_moment")) == pytest.approx(1.0, abs=1e-8)
    assert np.abs(np.abs(told([], 4, "bending_moment")) - 1.0).max() > 0.3


@pytest.mark.parametrize(("ends", "modes"), [("clamped-free", 1), ("clamped-free", 2), ("free-free", 3)])
def test_a_rod_that_pulls_a_mass(ends: str, modes: int) -> None:
    """Twice as heavy as itself at its end: k tan k = 1/2 of one that is held, tan k = -2 k of one that flies."""
    ratio = 2.0
    numbers = dict.fromkeys(("length", "area", "second_moment", "youngs_modulus", "density"), 1.0)
    beam = Beam(kind="beam", supports=ends, modes=1, **numbers)
    frame = FREE if ends == "free-free" else Frame()

    def found(hung: list[float], modes: int) -> float:
        body = elastic_body(beam, frame.model_copy(update={"axial_modes": modes}), None, "body.b", hung)
        own = np.flatnonzero(body.fields(np.array([0.9]), (0,))[0, 0, X])
        end = body.fields(np.ones(1), (0,))[0, 0, X, own]
        momentum = body.weights @ body.shapes[:, X, own]
        if frame is FREE:  # the frame's motion along x
            end, momentum = np.append(end, 1.0), np.append(momentum, 1.0)
        M = np.eye(end.size) + ratio * np.outer(end, end)
        if frame is FREE:
            M[-1, :-1] += momentum[:-1]
            M[:-1, -1] += momentum[:-1]
        K = np.diag(np.append(body.omega[own] ** 2, np.zeros(end.size - own.size)))
        return float(np.sqrt(eigh(K, M, eigvals_only=True)[end.size - own.size]))

    held, flying = (lambda k: k * np.tan(k) - 1.0 / ratio, 0.1, 1.5), (lambda k: np.tan(k) + ratio * k, 1.6, 3.1)
    wanted = brentq(*(flying if frame is FREE else held), xtol=1e-14)
    assert found([1.0], modes) == pytest.approx(wanted, rel={1: 1e-4}.get(modes, 1e-5))
    assert abs(found([], 8) / wanted - 1.0) > 1e-3
