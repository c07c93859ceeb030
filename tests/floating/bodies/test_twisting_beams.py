"""Beams that twist, in floating frames: beside closed forms and the frame of one member that they are."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from engine.bodies.beam.beam import Beam
from engine.floating.bodies.build import elastic_body
from engine.floating.bodies.fields import ABOUT_X, Y, Z
from engine.floating.model import build
from engine.scene.frames import Frame
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.floating.scenes import FOX_GOODWIN, history, steps

MATERIAL = {"area": 4e-3, "second_moment": 9e-6, "youngs_modulus": 2.1e11, "density": 7850.0}
TWIST = {"lateral_second_moment": 5e-6, "torsion_constant": 2e-6, "shear_modulus": 8.1e10}
POLAR = 7850.0 * (9e-6 + 5e-6)  # kg m
BEAM = Beam(kind="beam", length=3.0, supports="clamped-free", modes=2, **MATERIAL)


def test_modes_have_unit_mass_and_the_frequencies_of_a_bar() -> None:
    """sin((n - 1/2) pi x/L) about the track, of particles that have the section's second moments."""
    frame = Frame(torsion_modes=3, lateral_modes=1, **TWIST)
    body = elastic_body(BEAM, frame, None, "body.arm")
    mass = np.einsum("g,gai,gaj->ij", body.weights, body.shapes, body.shapes)
    assert mass == pytest.approx(np.eye(6), abs=1e-12)
    wanted = (np.arange(3) + 0.5) * np.pi / 3.0 * np.sqrt(8.1e10 * 2e-6 / POLAR)
    assert body.omega[3:] == pytest.approx(wanted, rel=1e-12)
    turned = body.fields(np.array([0.0, 1.2]), (0,))[0, :, ABOUT_X]
    assert turned[0] == pytest.approx(np.zeros(6), abs=1e-15)
    assert turned[1, 3:] == pytest.approx(np.sqrt(2.0 / (3.0 * POLAR)) * np.sin((np.arange(3) + 0.5) * 0.4 * np.pi))
    second = np.einsum("g,ga,gb->ab", body.weights, body.places, body.places)
    assert second[Y, Y] == pytest.approx(7850.0 * 3.0 * 5e-6) and second[Z, Z] == pytest.approx(7850.0 * 3.0 * 9e-6)


@pytest.mark.parametrize(("modes", "hung", "bound"), [(2, [3.0], 1e-3), (3, [3.0], 1e-4), (24, [], 2e-2)])
def test_frequencies_with_an_inertia_at_its_end(modes: int, hung: list[float], bound: float) -> None:
    """kL tan kL = inertia of the bar over that of what hangs there: with its static twist few modes are enough."""
    inertia = 2.0
    body = elastic_body(BEAM, Frame(torsion_modes=modes, **TWIST), None, "body.arm", hung)
    turned = body.fields(np.array([3.0]), (0,))[0, 0, ABOUT_X]
    own = np.flatnonzero(turned != 0.0)
    M = np.eye(own.size) + inertia * np.outer(turned[own], turned[own])
    found = np.sqrt(eigh(np.diag(body.omega[own] ** 2), M, eigvals_only=True))[:2]
    ratio = 3.0 * POLAR / inertia
    roots = [brentq(lambda x: x * np.sin(x) - ratio * np.cos(x), a, b) for a, b in ((0.0, 1.6), (1.6, 4.7))]
    wanted = np.array(roots) / 3.0 * np.sqrt(8.1e10 * 2e-6 / POLAR)
    assert found == pytest.approx(wanted, rel=bound)


def arm(body: dict, frame: dict) -> Study:
    """What holds a bracket across its end, at whose end a mass hangs, and swings."""
    swing = {"kind": "revolute", "axis": [0, 0, 1], "motion": {"kind": "swing", "amplitude": 0.1, "frequency": 1.0}}
    bracket = {"kind": "rigid", "length": 0.8, "mass": 25.0, "inertia": 1.5, "centre": 0.7, "own_weight": True}
    return Study(
        kind="moving-frames",
        gravity=9.81,
        body={"arm": body | {"own_weight": True, "damping_ratio": 0.01}, "bracket": bracket},
        frame={"arm": {"joints": [swing]} | frame, "bracket": {"on": "arm", "turned": [0, 0, np.pi / 2]}},
        question={"duration": 0.4},
    )


def test_a_beam_is_the_frame_of_one_member() -> None:
    """A mass beside its axis twists it as it swings; without torsion modes that is missed by far. Across its loads it
    bends by as many modes as along them."""
    section = MATERIAL | TWIST | {"second_moment_lateral": TWIST["lateral_second_moment"]}
    del section["lateral_second_moment"]
    member = {"nodes": ["root", "tip"], "section": "all", "elements": 24}
    frame = {
        "kind": "frame",
        "node": {"root": [0, 0, 0], "tip": [3, 0, 0]},
        "section": {"all": section},
        "member": {"all": member},
        "supports": {"root": "clamped"},
        "track": {"members": ["all"]},
        "modes": 24,
    }
    beam = BEAM.model_dump(exclude_none=True, include={"kind", "length", "supports", *MATERIAL}) | {"modes": 4}
    ways = []
    for body, own in (
        (frame, {}),
        (beam, TWIST | {"axial_modes": 2, "torsion_modes": 3}),
        (beam, TWIST | {"lateral_modes": 4, "axial_modes": 2}),
    ):
        model, marched = steps(arm(body, own), 0.4, 4000, 40, FOX_GOODWIN)
        ways.append(history(model, marched, "ends", 3, 3))
    largest = np.abs(ways[0][:, Z] - ways[0][0, Z]).max()
    assert ways[1] == pytest.approx(ways[0], abs=2e-3 * largest)
    assert np.abs(ways[2] - ways[0]).max() > 0.2 * largest


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        ({"torsion_modes": 2}, "expected torsion_constant and shear_modulus"),
        (TWIST | {"torsion_modes": 2, "stiffening": True}, "with one member has both"),
    ],
)
def test_what_is_not_built_is_refused(frame: dict, said: str) -> None:
    beam = BEAM.model_dump(exclude_none=True) | {"own_weight": True}
    with pytest.raises(BadInput, match=said):
        build(Study(kind="moving-frames", body={"arm": beam}, frame={"arm": frame}))
