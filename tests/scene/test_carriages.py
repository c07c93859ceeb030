"""A kind of carriage is one class: the march, the statics and the unreduced model ask nothing but it."""

from typing import ClassVar, Literal

import numpy as np
import pytest

import engine
from engine.scene.carriages import CARRIAGES, Carriage
from engine.study_file.units import Force, Mass
from engine.unreduced.scene import unreduced_model
from engine.unreduced.statics import unreduced_frequencies, unreduced_statics
from results_schema.errors import BadInput
from studies.protocol.study import kind_of
from tests.engine.build import beam, cruise, fixed, force, mass, study

WAY = cruise(0.0, 1.0, 0.5)
PLAIN = {"static_correction": False}  # which a mass feels of its own forces, not of others'


class PushedMass(Carriage):
    """A rigid mass that a force pushes down besides its weight."""

    masses: ClassVar[tuple[str, ...]] = ("mass",)
    touching: ClassVar[tuple[str, ...]] = ("mass",)
    forces: ClassVar[tuple[str, ...]] = ("push",)

    kind: Literal["pushed-mass"]
    mass: Mass
    push: Force


def test_a_kind_from_elsewhere_is_a_mass_and_a_force(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CARRIAGES.own, "pushed-mass", PushedMass)  # type: ignore[arg-type]
    pushed = {"on": "bed", "kind": "pushed-mass", "mass": 0.3, "push": 2.0, "motion": WAY}
    sensors = {"place": fixed(0.61), "moment": fixed(0.37, "bending_moment")}
    options = {"body": {"bed": beam(modes=6)}, "sensor": sensors, "solver": {"steps": 200} | PLAIN}
    one = study(beam(), {"car": pushed}, **options)
    two = study(beam(), {"car": mass(0.3, WAY), "push": force(2.0, WAY)}, **options)
    found, right = engine.run(one), engine.run(two)
    for name in ("place_max", "moment_max"):
        assert float(found[name]) == pytest.approx(float(right[name]), rel=1e-12)
    whole = unreduced_model(one)
    together = unreduced_statics(unreduced_model(two), [[0.4, 0.4]])[0]
    np.testing.assert_allclose(unreduced_statics(whole, [0.4])[0], together, rtol=1e-12)
    alone = unreduced_frequencies(unreduced_model(study(beam(), {"car": mass(0.3, WAY)}, **options)), [0.4], 3)
    np.testing.assert_allclose(unreduced_frequencies(whole, [0.4], 3), alone, rtol=1e-12)


@pytest.mark.parametrize("kind", ["passage", "eigenfrequencies", "trajectory"])
@pytest.mark.parametrize(
    ("key", "more"),
    [
        ("inertia", {"inertia": [1.0, 2.0, 3.0]}),
        ("height", {"height": 0.3}),
        ("height", {}),
    ],
)
def test_masses_turn_in_frames_that_move_alone(kind: str, key: str, more: dict[str, object]) -> None:
    """Where bodies stand both keys did nothing, without a word."""
    sweep = {} if more else {"sweep": {"low": {"of": "carriage.car.height", "values": [0.0, 0.3]}}}
    given = study(beam(), {"car": mass(0.3, WAY) | more}, kind=kind, sensor={"place": fixed(0.6)}, **sweep)
    with pytest.raises(BadInput, match=rf"carriage\.car\.{key}: in studies of the kind {kind} a mass does not turn"):
        kind_of(given).parts(given)
