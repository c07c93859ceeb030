"""`bench` times the march that `run` uses, and that march computes the right numbers."""

import json

import numpy as np
import pytest

from engine.batch.execution import execute, march_seconds
from engine.batch.plan import Plan, make_plan
from engine.kernels.schemes import SCHEMES
from engine.march.step_rules import allow_any_steps
from results_schema.arrays import Array
from results_schema.store.rows import Chunk
from studies.commands import bench
from studies.commands.bench import Scene, Throughput
from studies.commands.cli import main
from tests.naive import motions, newmark, scene
from tests.reference.closed_forms import PinnedBeam


def largest_deflections(scene: Scene) -> Array:
    """(variants,) largest magnitude of the midspan deflection, m: what the march that `measure` times computes."""
    found = np.empty(scene.variants)

    def take(chunk: Chunk) -> None:
        variants, arrays = chunk.rows
        found[variants] = np.maximum(arrays[f"{bench.MIDSPAN}_max"], -arrays[f"{bench.MIDSPAN}_min"])

    execute(make_plan(scene.study(), check_steps=allow_any_steps), take)
    return found


@pytest.mark.parametrize(("modes", "ties"), [(1, 1), (10, 1), (4, 2), (5, 3)])
def test_its_numbers_are_those_of_the_naive_march(modes: int, ties: int) -> None:
    size = Scene(modes=modes, steps=300, variants=40, ties=ties)
    found = largest_deflections(size)
    random = np.random.default_rng(0)
    speed, mass = random.uniform(1.0, 20.0, 40), random.uniform(10.0, 500.0, 40)
    zeta = random.uniform(0.0, 0.05, 40)
    beam = PinnedBeam(modes, 15.0, 2.1e11 * 8.33e-6, 78.5)
    expected = []
    for variant in (0, 17, 39):
        apart = 15.0 / (ties + 1)
        ways = [motions.cruise(i * apart, (i + 2) * apart, speed[variant]) for i in range(ties)]
        loads = tuple(scene.moving_mass(mass[variant] / ties, 9.81, way) for way in ways)
        case = scene.Scene(beam.phi, beam.omega, np.full(modes, zeta[variant]), loads)
        times = newmark.grid(case, 0.0, loads[0].leave, size.steps)
        history = newmark.march(case, times, scene.rest(case))
        expected.append(np.abs(history.displacement(beam.phi(7.5, 0))).max())
    np.testing.assert_allclose(found[[0, 17, 39]], expected, rtol=1e-9)


def test_it_marches_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    marched = []

    def spy(plan: Plan, threads: int | None, repeats: int) -> float:
        assert repeats >= 1
        marched.append((plan.size, {group.steps for group in plan.groups}, plan.base.omega.size, threads))
        return march_seconds(plan, threads, repeats)

    monkeypatch.setattr("studies.commands.bench.march_seconds", spy)
    found = bench.measure(Scene(modes=4, steps=100, variants=64), threads=1, best_of=3)
    assert marched == [(64, {100}, 4, 1)] * 3
    assert found.seconds > 0
    assert found.variants_per_second == pytest.approx(64 / found.seconds)
    assert found.case_mode_steps_per_second == pytest.approx(64 * 4 * 100 / found.seconds)


def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--modes", "3", "--steps", "50", "--variants", "32", "--threads", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == set(Throughput.__dataclass_fields__)
    assert (found["modes"], found["steps"], found["variants"], found["threads"]) == (3, 50, 32, 1)
    assert found["ties"] == 1
    assert found["best_of"] >= 3 and found["case_mode_steps_per_second"] > 0
    assert main(["bench", "--modes", "3", "--steps", "50", "--variants", "32"]) == 0
    assert "per second" in capsys.readouterr().out
    assert main(["bench", "--modes", "3", "--steps", "50", "--variants", "32", "--ties", "2"]) == 0
    assert "2 ties" in capsys.readouterr().out
    assert main(["bench", "--ties", "0"]) == 2


def test_every_scheme_stays_finite(capsys: pytest.CaptureFixture[str]) -> None:
    compared = 0
    for name in SCHEMES:
        found = largest_deflections(Scene(modes=4, steps=200, variants=16, scheme=name))
        assert np.isfinite(found).all() and found.min() > 0.0
        compared += 1
    assert compared >= 8
    assert main(["bench", "--scheme", "hht"]) == 2
    assert "hht-alpha" in capsys.readouterr().err
    assert main(["bench", "--scheme", "fox-goodwin", "--modes", "60", "--steps", "10"]) == 2
    assert "more steps or fewer modes" in capsys.readouterr().err
