"""Growth from cycle to cycle: beside marches of one cycle more, the map of a swinging mass, and what says so."""

from typing import Any

import numpy as np
import pytest

import studies
from engine.methods.cycle_growth import GROWS, growth_per_cycle
from engine.scene.study import Study
from studies.reporting import answers
from studies.stability_maps import shuttle
from studies.stability_maps.map_scene import Ground
from tests.engine.build import beam, cruise, fixed, force, mass, study, swing
from tests.engine.build import shuttle as to_and_fro

BAR: dict[str, Any] = {"damping_ratio": 0.02}
FIRST = np.pi / 2.0  # Hz: of a beam of length, stiffness and mass 1


def shaken(frequency: float, kilograms: float = 0.5, cycles: int = 10, **more: Any) -> Study:
    """A mass that swings over nearly the whole beam, at parts of its first natural frequency."""
    motion = swing(0.5, 0.4999, frequency * FIRST, cycles)
    carriage = mass(kilograms, motion) | {"bilateral": True}
    return study(beam(**BAR), carriage, **({"kind": "double-peak", "sensor": {"midspan": fixed(0.5)}} | more))


def test_it_is_what_one_cycle_more_brings() -> None:
    """Largest readings of the 12th and the 13th cycle, and by the map's own scene."""
    told = float(growth_per_cycle(shaken(0.75), np.array([0]))[0])
    sizes = [float(studies.run(shaken(0.75, cycles=cycles)).midspan_max) for cycles in (12, 13)]
    assert told > 1.4 and sizes[1] / sizes[0] == pytest.approx(told, rel=1e-2)
    scene = Ground(study(beam(**BAR), mass(0.5, cruise(0.0, 1.0, 1.0)), kind="stability")).shuttle(12)
    assert shuttle.multipliers(scene, 0.5, np.array([0.75]), 0.02)[0] == pytest.approx(told, rel=1e-3)
    assert float(growth_per_cycle(shaken(0.4), np.array([0]))[0]) < 1.0


def test_swept_variants_have_their_own() -> None:
    sweep = {
        "pace": {"of": "carriage.car.motion.frequency", "values": [0.4 * FIRST, 0.75 * FIRST]},
        "cycles": {"of": "carriage.car.motion.cycles", "values": [2, 5]},
    }
    found = growth_per_cycle(shaken(0.75, sweep=sweep), np.array([3, 0, 2]))
    told = [float(growth_per_cycle(shaken(part), np.array([0]))[0]) for part in (0.75, 0.4, 0.75)]
    assert found == pytest.approx(told, rel=1e-6)


@pytest.mark.parametrize("carriage", [force(1.0, swing(0.5, 0.4, 1.0, 2)), mass(0.1, cruise(0.0, 1.0, 1.0))])
def test_what_cannot_grow_is_not_known(carriage: dict[str, Any]) -> None:
    assert np.isnan(growth_per_cycle(study(beam(), carriage), np.array([0]))).all()


def said(case: Study) -> str:
    return "\n".join(answers.answer(studies.run(case)))


def test_answers_say_so_and_tell_no_number_of_cycles() -> None:
    text = said(shaken(0.75))
    factor = growth_per_cycle(shaken(0.75), np.array([0]))[0]
    assert f"In 1 of 1 variant the vibration grows: after each cycle it is up to {factor:.4g} times what it was" in text
    assert "times as large as the longest body: no structure bends so far" in text
    assert "would be enough" not in text and "of the start's vibration is left" not in text
    assert "the vibration grows" not in said(shaken(0.4))
    moving_force = said(shaken(0.75, solver={"fidelity": "force"}))
    assert "the vibration grows" not in moving_force


@pytest.mark.parametrize("frequency", [0.003, 0.01])
def test_slow_cycles_of_an_undamped_body_do_not_grow_by_their_steps(frequency: float) -> None:
    """By 1,200 steps a cycle the multiplier was 1.0137, and the answer said that the mass shakes its body."""
    found = growth_per_cycle(shaken(frequency, body={"bed": beam(damping_ratio=0.0)}), np.array([0]))
    assert not found[0] > GROWS


def test_what_grows_has_not_settled() -> None:
    """With damping that would have let the start die out."""
    fast, slow = 3.72, 0.3
    sweep = {"speed": {"of": "carriage.car.motion.speed", "values": [slow, fast]}}
    back = mass(1.0, to_and_fro(0.0005, 0.9995, fast, 0.1, 40)) | {"bilateral": True}
    case = study(beam(**BAR), back, kind="asymmetry", sensor={"midspan": fixed(0.5)}, sweep=sweep)
    grows = growth_per_cycle(case, np.arange(2)) > GROWS
    assert grows.tolist() == [False, True]
    text = said(case)
    assert "In 1 of 2 variants the vibration grows" in text
    assert ", of the 1 variant that settled." in text
