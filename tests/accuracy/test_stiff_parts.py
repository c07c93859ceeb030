"""Scenes with a part so stiff or so light that hardly any march is worth its work."""

from typing import Any

import numpy as np
import pytest

import studies
from engine.accuracy.grids import DAMPED, SCALED_FOX_GOODWIN
from engine.accuracy.reference import in_full
from engine.batch.plan import make_plan
from engine.march.step_rules import contact_omega
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.status import SchemeUsed, Status
from tests.accuracy.passages import only_grid
from tests.engine.bodies_on_contacts import riding as on_contacts
from tests.engine.build import beam, cruise, fixed, study

FORCE = {"force": {"carriage": "car", "contact": "front", "quantity": "contact_force"}}
FREE = beam(modes="auto", damping_ratio=0.02)


def riding(stub: float, sensors: dict[str, Any], bed: dict[str, Any] = FREE, **changes: Any) -> Study:
    """A table on two shoes with a piece of its length (m) behind its rear end."""
    section = {"area": 1.0, "second_moment": 1.0, "youngs_modulus": 1.0, "density": 1.0}
    table = {
        "kind": "frame",
        "plane": "xz",
        "node": {"rear": [0, 0], "front": [0.4, 0], "end": [-stub, 0]},
        "section": {"all": section},
        "member": {
            "table": {"nodes": ["rear", "front"], "section": "all", "elements": 4},
            "stub": {"nodes": ["end", "rear"], "section": "all", "elements": 2},
        },
        "supports": {},
        "track": {"members": ["table"]},
        "damping_ratio": 0.02,
    }
    shoe = {"stiffness": 200.0, "damping": 1.0}
    contacts = {"front": shoe | {"at": 0.35}, "rear": shoe | {"at": 0.1}}
    car = {"on": "bed", "kind": "body", "body": "table", "motion": cruise(0.2, 0.7, 0.5), "contacts": contacts}
    return study(bed, {"car": car}, body={"bed": bed, "table": table}, sensor=sensors, **changes)


def test_what_swings_a_hundred_times_as_fast_as_all_else_takes_mass() -> None:
    given = riding(0.01, {"place": fixed(0.5)} | FORCE)
    assert in_full(only_grid(given)).numerics[0].scheme == SCALED_FOX_GOODWIN
    found = studies.run(given)
    assert found.status == Status.OK and float(found.error_estimate) <= 1e-3
    more = {"steps": 20_000, "scheme": "average-acceleration"}
    closer = studies.run(riding(0.01, {"place": fixed(0.5)} | FORCE, FREE | {"modes": 40}, solver=more))
    for name in ("place_max", "force_max"):
        assert float(found[name]) == pytest.approx(float(closer[name]), rel=2e-3)


def test_what_nobody_could_estimate_is_unresolved_though_nothing_is_held() -> None:
    found = studies.run(riding(1e-4, FORCE))
    assert np.isnan(found.estimated_error).all() and np.isfinite(found.force_max)
    assert found.status == Status.UNRESOLVED
    assert any("1 unresolved" in text for text in studies.answer(found))


@pytest.mark.slow
def test_what_moves_slowly_on_stiff_contacts_needs_no_step_for_each_of_their_periods() -> None:
    """A table that ran slowly along a bed took 40 s, and was unresolved; one that is dropped swings on its contacts."""
    stiff = {name: {"at": at, "stiffness": 4e6, "damping": 50.0} for name, at in (("rear", 0.05), ("front", 0.35))}
    slow = on_contacts(cruise(0.2, 0.8, 0.004), stiff, initial="equilibrium", solver={"tolerance": 1e-3})
    found = studies.run(slow)
    assert in_full(only_grid(slow)).numerics[0].scheme == DAMPED
    assert found.status == Status.OK and found.scheme_used == SchemeUsed.HHT_ALPHA and found.steps_used < 40_000
    model = make_plan(slow).base
    (omega,) = contact_omega(model, VariantValues(slow, {}, 1))
    assert omega / (2.0 * np.pi) * 0.6 / 0.004 > 2.0 * int(found.steps_used)
    closer = studies.run(slow.with_values({"solver": {"steps": 250_000, "scheme": "average-acceleration"}}))
    for name in ("place_max", "below_max", "front_max", "front_min"):
        static = max(abs(float(closer[f"{name.partition('_')[0]}_{end}"])) for end in ("max", "min"))
        off = abs(float(found[name]) - float(closer[name])) / static
        assert off <= max(float(found.estimated_error.sel(result=name)), 1e-7), name
    dropped = in_full(only_grid(slow.with_values({"initial": "rest"})))
    assert dropped.numerics[0].scheme != DAMPED
