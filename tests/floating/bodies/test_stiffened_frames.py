"""Frames of beams that stiffen as they bend: beside exact kinematics, buckling loads, a beam, and a bent arm that
turns."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from engine.bodies.frame.elements import deflection_shapes
from engine.floating.bodies.elastic import ElasticBody
from engine.floating.bodies.fields import Z
from engine.floating.bodies.frame_line import corners
from engine.floating.bodies.frame_shortening import FrameShortening
from engine.floating.model import build
from engine.floating.theory import lacking
from tests.floating.bodies.test_frames_of_beams import BOX, PORTAL, STEEL, arm, study
from tests.floating.scenes import ARM, FOX_GOODWIN, history, steps

#: A cantilever with two bends, whose members have rigid arms at their ends, and an eccentric mass.
BENT = {
    "kind": "frame",
    "node": {"root": [0, 0, 0], "corner": [2, 0.3, 0.1], "up": [2.2, 1.0, 1.2], "tip": [2.2, 2.2, 1.2]},
    "section": {"box": BOX},
    "member": {
        "near": {"nodes": ["root", "corner"], "section": "box", "offsets": [[0, 0, 0], [0.1, 0.05, 0.2]]},
        "middle": {"nodes": ["corner", "up"], "section": "box", "up": [1, 0, 0], "elements": 6},
        "far": {"nodes": ["tip", "up"], "section": "box", "offsets": [[0.0, 0.1, 0.1], [0, 0, 0.1]]},
    },
    "point_mass": {"tool": {"node": "tip", "mass": 30.0, "inertia": [0.5, 0.8, 0.9], "offset": [0.1, 0.3, -0.2]}},
    "supports": {"root": "clamped"},
    "track": {"members": ["far"], "offset": [0.2, 0.0, 0.1]},
    "modes": 6,
    "own_weight": True,
}
PIECES = 30
SIMPSON = np.array([1.0, *([4.0, 2.0] * 15)[:-1], 1.0]) / (3.0 * PIECES)
SPIN_UP = {"kind": "spin-up", "rate": 2.5, "time": 5.0}
TURNS = {"joints": [{"kind": "revolute", "axis": [0, 0, 1]}]}


def stiffened(body: dict, **more: object) -> ElasticBody:
    return build(study(body, {"stiffening": True} | TURNS, **more)).bodies["portal"]


class Sections(NamedTuple):
    """Sections of the bent arm from its root on, and its tip at last: numbers of elements, places (S, 3), rotations,
    and parts of an element's length that are theirs (Simpson)."""

    elements: np.ndarray
    places: np.ndarray
    turned: Rotation
    parts: np.ndarray


def walk(own: FrameShortening, q: np.ndarray) -> Sections:
    """It moved by its modes, exactly: curvatures and extensions of sections are those of first order; `PIECES` of every
    element, each by an exponential."""
    mesh, frame = own.assembly.mesh, own.body
    ends = mesh.turns @ (own.nodal @ q)[mesh.freedoms][:, :, None]
    R, node, found = Rotation.identity(), np.array(frame.place("root")), []
    for name, backward in (("near", False), ("middle", False), ("far", True)):
        offsets, chain = [np.array(one) for one in frame.member[name].offsets], mesh.chains[name]
        r = node + R.apply(offsets[1] if backward else offsets[0])
        for e in chain[::-1] if backward else chain:
            L, axes, end = mesh.beams.length[e], mesh.axes[e], ends[e, :, 0]
            h = (-1.0 if backward else 1.0) * L / PIECES
            found.append((e, r, R, SIMPSON[0]))
            for k in range(PIECES):
                z = np.array([(L if backward else 0.0) + (k + 0.5) * h])
                curve = deflection_shapes(z, np.array([L]), np.zeros(1), 2)[:, 0]
                of_z, of_y = curve @ (end[[2, 4, 8, 10]] * [1, -1, 1, -1]), curve @ end[[1, 5, 7, 11]]
                strain, twist = (end[6] - end[0]) / L, (end[9] - end[3]) / L
                half = Rotation.from_rotvec(0.5 * h * (axes.T @ np.array([twist, -of_z, of_y])))
                r = r + (R * half).apply(h * (1.0 + strain) * axes[0])
                R = R * half * half
                found.append((e, r, R, SIMPSON[k + 1]))
        node = r - R.apply(offsets[0] if backward else offsets[1])
    found.append((-1, node, R, 0.0))
    elements, places, turned, parts = zip(*found, strict=True)
    return Sections(np.array(elements), np.array(places), Rotation.concatenate(turned), np.array(parts))


def test_displacements_of_second_order_are_those_of_exact_kinematics() -> None:
    """Along the track, and over all mass, of a random motion by all modes: of exact motions to and fro all that is of
    first order cancels."""
    body = stiffened(BENT)
    own = body.shortening
    assert isinstance(own, FrameShortening)
    q = np.random.default_rng(3).normal(size=6) / body.omega
    q *= 0.002 / np.abs(body.fields(np.array([0.0]), (0,))[0, 0] @ q).max()
    there, here, back = (walk(own, sign * q) for sign in (-1.0, 0.0, 1.0))

    def exact(at: np.ndarray, arms: np.ndarray) -> np.ndarray:
        """Of ends of arms from sections."""
        r = [state.places[at] + state.turned[at].apply(arms) for state in (there, here, back)]
        return 2.0 * r[1] - r[0] - r[2]

    mesh, frame = own.assembly.mesh, own.track.axes
    x = own.track.beams.places
    far = np.flatnonzero(np.isin(here.elements, mesh.chains["far"]))
    at = np.append(far[:: PIECES + 1], far[-1])[::-1]  # from the tip on, where the track begins
    wanted = exact(at, np.tile(BENT["track"]["offset"], (at.size, 1))) @ frame.T
    found = np.einsum("saij,i,j->sa", own.along(x)[0], q, q)
    assert found == pytest.approx(wanted, abs=1e-5 * np.abs(wanted).max())

    tool = own.body.point_mass["tool"]
    arms = np.array(tool.offset) + corners(tool)
    tip = np.full(6, here.elements.size - 1)
    parts = [(here.places[tip] + arms, np.full(6, tool.mass / 6.0), exact(tip, arms))]
    at = np.arange(tip[0])
    e = here.elements[at]
    masses = here.parts[at] * (mesh.beams.mass * mesh.beams.length)[e]
    axis, radii = mesh.axes[e, 0], [BOX["second_moment_lateral"], BOX["second_moment"]]
    one, other = there.turned[at].as_rotvec(), back.turned[at].as_rotvec()
    twist, second = np.sum(axis * (other - one), axis=1) / 2.0, -np.sum(axis * (other + one), axis=1)
    for across in (1, 2):
        for sense in (1.0, -1.0):
            arm = sense * np.sqrt(2.0 * radii[across - 1] / BOX["area"]) * mesh.axes[e, across]
            G = exact(at, 0.0 * arm) + np.cross(axis, arm) * second[:, None] + arm * twist[:, None] ** 2
            parts.append((here.places[at] + arm, 0.25 * masses, G))
    places, masses, G = (np.concatenate(part) for part in zip(*parts, strict=True))
    c, G = places @ frame.T - own.origin, G @ frame.T
    whole, moments = (np.einsum("...ij,i,j->...", part, q, q) for part in own.integrals)
    assert whole == pytest.approx(masses @ G, abs=1e-5 * np.abs(masses @ G).max())
    wanted = np.einsum("g,ga,gb->ab", masses, G, c)
    assert moments == pytest.approx(wanted, abs=1e-5 * np.abs(wanted).max())


def test_a_force_buckles_a_cantilever_sideways() -> None:
    """4.013 sqrt(E I_z G J)/l^2 at the end of a beam that is stiff in the plane of the force (Prandtl 1899)."""
    blade = BOX | {"second_moment": 1e-4, "second_moment_lateral": 2e-7, "torsion_constant": 3e-7}
    body = stiffened(arm(24) | {"section": {"all": blade}}, sensor={"end": {"body": "portal", "at": 10.0}})
    assert isinstance(body.shortening, FrameShortening)
    G = body.shortening.along(np.array([10.0]))[0, 0, Z]
    # K - P G is singular; K is diagonal
    loads = 1.0 / np.linalg.eigvalsh(G / np.multiply.outer(body.omega, body.omega))
    wanted = 4.0126 * np.sqrt(STEEL["youngs_modulus"] * 2e-7 * STEEL["shear_modulus"] * 3e-7) / 100.0
    assert loads[loads > 0.0].min() == pytest.approx(wanted, rel=2e-3)
    assert -loads[loads < 0.0].max() == pytest.approx(wanted, rel=2e-3)


def test_loads_on_its_corners_buckle_a_portal() -> None:
    """Held at both feet it resists its own shortening: it sways in its plane at k h/tan k h = -6 (I/l)/(I/h) of girder
    and columns, P = k^2 E I, and out of it as two cantilevers."""
    h, span = 3.0, 4.0
    nodes = {"foot": [0, 0, 0], "left": [0, 0, h], "right": [span, 0, h], "end": [span, 0, 0]}
    body = stiffened(PORTAL | {"node": nodes, "point_mass": {}, "modes": 16})
    assert isinstance(body.shortening, FrameShortening)
    G = body.shortening.along(np.array([0.0, span]))[0, :, Z].sum(axis=0)
    loads = 1.0 / np.linalg.eigvalsh(G / np.multiply.outer(body.omega, body.omega))
    EI, across = (STEEL["youngs_modulus"] * BOX[key] for key in ("second_moment", "second_moment_lateral"))
    k = brentq(lambda kh: kh / np.tan(kh) + 6.0 * h / span, 1.6, 3.1) / h
    for wanted in (k**2 * EI, np.pi**2 / 4.0 * across / h**2):  # z points down: they push up
        assert np.abs(loads + wanted).min() < 2e-3 * wanted


def test_one_member_is_a_stiffened_beam() -> None:
    """It turns up with a mass that runs along it, as the beam it is made of."""
    turns = {"joints": [{"kind": "revolute", "axis": [0, 1, 0], "motion": SPIN_UP}], "stiffening": True}
    load = {"kind": "mass", "on": "portal", "mass": 1.0}
    load["motion"] = {"kind": "cruise", "start": 0.0, "end": 9.0, "speed": 1.8}
    found = []
    for body in (arm(3), ARM | {"modes": 3, "own_weight": True}):
        tip = {"tip": {"body": "portal", "at": 10.0}}
        scene = study(body, turns, gravity=0.0, carriage={"load": load}, sensor=tip)
        model, marched = steps(scene, 6.0, 4000, 40, FOX_GOODWIN)
        found.append(history(model, marched, "sensors", 0, 1))
    assert found[0] == pytest.approx(found[1], abs=1e-6 * np.abs(found[1]).max())


def test_it_lacks_the_stiffness_of_a_beam() -> None:
    """Of one member that is not stiffened, and of the beam it is made of, as both turn about any axis."""
    beam = ARM | {"modes": 3, "own_weight": True}
    one, other = (lacking(build(study(body, TURNS)), "portal") for body in (arm(3), beam))
    assert one == pytest.approx(other, rel=1e-5, abs=1e-9)
    assert other[2] > 0.05


def test_it_buckles_under_the_weight_that_makes_a_beam_buckle() -> None:
    """Upright; leaning halfway over, by what its weight has along it."""
    found = []
    for body in (arm(3), ARM | {"modes": 3, "own_weight": True}):
        for turned in ("90 deg", "30 deg"):
            scene = study(body, {"turned": [0, turned, 0]}, gravity=9.81)
            found.append(steps(scene, 1.0, 10, 10, FOX_GOODWIN)[1].buckling_ratio[0, 0])
    assert found[:2] == pytest.approx(found[2:], rel=1e-5)
    assert found[1] == pytest.approx(0.5 * found[0], rel=1e-9)


@pytest.mark.parametrize("kind", ["beam", "frame"])
def test_ends_and_position_errors_come_nearer(kind: str) -> None:
    """By half of int w'^2 of what the arm bends by, along a track that rests, as its weight sets it swinging."""
    body = {"beam": ARM | {"modes": 2, "own_weight": True}, "frame": arm(2)}[kind]
    sensor = {"tip": {"body": "portal", "at": 10.0}}
    sensor["off"] = {"body": "portal", "at": 10.0, "quantity": "position_error", "direction": "x"}
    found = {}
    for on in (False, True):
        model, marched = steps(study(body, {"stiffening": on}, sensor=sensor, gravity=0.5), 2.0, 4000, 40, FOX_GOODWIN)
        ends, read = history(model, marched, "ends", 0, 3), history(model, marched, "sensors", 0, 2)
        found[on] = ends[:, 0], read[:, 1], read[:, 0]
    end, error, tip = found[True]
    assert found[False][1] == pytest.approx(np.zeros(101), abs=1e-12)
    assert end - end[0] == pytest.approx(error, abs=1e-12)
    # its first mode alone, nearly: by 1.16 w^2/(2 L)
    assert error == pytest.approx(-0.581 * tip**2 / 10.0, abs=2e-2 * np.abs(error).max())
