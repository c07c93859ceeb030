"""fidelity = "static": influence lines in place of a march, against closed forms and slow marches."""

from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.batch.plan import make_plan
from results_schema.errors import BadInput
from results_schema.status import Fidelity
from tests.engine.build import Table, aboard, beam, cruise, fixed, force, mass, oscillator, shuttle, study, swing, under

STATIC: Table = {"solver": {"fidelity": "static"}}


def test_a_force_on_a_pinned_beam() -> None:
    """P L^3/48 in the middle, P L/4, and P (L - x)(...)/6 L E I elsewhere; the beam's E I, L and weight are 1."""
    sensors = {"midspan": fixed(0.5), "moment": fixed(0.3, "bending_moment"), "below": under("car")}
    found = engine.run(study(beam(modes=2), force(48.0, cruise(-0.2, 1.3, 7.0)), sensor=sensors, **STATIC))
    assert float(found.midspan_max) == pytest.approx(1.0, rel=1e-12)
    assert float(found.midspan_max_position) == pytest.approx(0.5, abs=1e-12)
    assert float(found.moment_max) == pytest.approx(48.0 * 0.3 * 0.7, rel=1e-12)
    assert float(found.moment_max_position) == pytest.approx(0.3, abs=1e-12)
    assert float(found.below_max) == pytest.approx(1.0, rel=1e-5)
    assert float(found.midspan_min) == 0.0 and int(found.status) == 0
    assert int(found.fidelity_used) == Fidelity.STATIC and int(found.steps_used) == 0
    square = np.mean([_midspan(s) ** 2 for s in (np.arange(20000) + 0.5) / 20000]) / 1.5
    assert float(found.midspan_rms) == pytest.approx(np.sqrt(square), rel=1e-3)


@pytest.mark.fault
@pytest.mark.parametrize("after", [0.0, 0.7])
def test_histories_end_where_those_of_marches_do(after: float) -> None:
    """That of what leaves: one number more, and no error of the history could be told."""
    sensors = {"below": under("car"), "aboard": aboard("car")}
    car = oscillator(0.5, 40.0, cruise(0.1, 0.9, 0.8, after=after))
    found = studies.run(study(beam(modes=2), car, sensor=sensors, output={"histories": "all"}, **STATIC))
    for name in sensors:
        assert np.isfinite(float(found.estimated_error.sel(result=name))), name
        assert np.isnan(found[name].values).any() == (after > 0.0)


def _midspan(s: float) -> float:
    """Deflection of the middle of a unit pinned beam under 48 N at s."""
    near = min(s, 1.0 - s)
    return near * (3.0 - 4.0 * near**2)


SLOW = shuttle(0.3, 0.7, 2e-3, 0.5, 1)
SCENES: dict[str, Any] = {
    "mass": lambda more: study(beam(damping_ratio=0.05), mass(0.5, SLOW), **more),
    "two masses, own weight": lambda more: study(
        beam(own_weight=True), {"car": mass(0.5, SLOW), "next": mass(0.3, cruise(0.0, 1.0, 2e-3))}, **more
    ),
    "oscillator": lambda more: study(beam(), oscillator(0.5, 40.0, SLOW, damping=2.0), **more),
}


@pytest.mark.parametrize("name", SCENES)
def test_it_is_what_a_slow_march_tends_to(name: str) -> None:
    sensors: Table = {"sensor": {"place": fixed(0.61), "moment": fixed(0.4, "bending_moment"), "below": under("car")}}
    start: Table = {"initial": "equilibrium"}
    slow = engine.run(SCENES[name](sensors | start))
    rest = engine.run(SCENES[name](sensors | start | STATIC))
    for sensor in sensors["sensor"]:
        scale = max(abs(float(slow[f"{sensor}_max"])), abs(float(slow[f"{sensor}_min"])))
        for end in ("max", "min", "rms"):
            gap = abs(float(slow[f"{sensor}_{end}"]) - float(rest[f"{sensor}_{end}"]))
            assert gap < 2e-3 * scale, (sensor, end)
    for end in ("max", "min"):
        assert float(rest[f"car_contact_force_{end}"]) == pytest.approx(
            float(slow[f"car_contact_force_{end}"]), rel=2e-3
        )


def test_kinds_of_study_at_rest() -> None:
    """No lag, no odd part, two equal peaks, an amplification of one; envelopes and histories too."""
    there = study(beam(), mass(0.5, shuttle(0.5, 0.9, 0.4, 0.1, 2)), kind="asymmetry", **STATIC)
    found = studies.run(there)
    assert float(np.abs(found.lag).max()) < 1e-12 and float(found.odd_rms.max()) < 1e-12
    twice = studies.run(study(beam(), mass(0.5, swing(0.5, 0.4, 0.5, 2)), kind="double-peak", **STATIC))
    assert float(twice.peaks_per_cycle.max()) == 2 and float(twice.dynamic_amplification.max()) == pytest.approx(1.0)
    moments: Table = {"envelope": {"moments": {"body": "bed", "quantity": "bending_moment", "places": 11}}}
    along = engine.run(study(beam(), force(48.0, cruise(0.0, 1.0, 1.0)), **moments, **STATIC))
    x = along.moments_place.values
    assert along.moments_envelope_max.values == pytest.approx(48.0 * x * (1.0 - x), abs=1e-3)


def test_rates_are_refused() -> None:
    sensors: Table = {"sensor": {"fast": fixed(0.5, "velocity")}}
    with pytest.raises(BadInput, match=r"sensor\.fast\.quantity: fidelity = \"static\" has no velocity"):
        make_plan(study(beam(), mass(0.5, cruise(0.0, 1.0, 1.0)), **sensors, **STATIC))
