"""Forces in a row that pulsate, as persons one behind another do: every one is the carriage that could be written."""

from typing import Any

import numpy as np
import pytest

import studies
from engine.model.scene_model import build_model
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.protocol.study import kind_of
from studies.results.results import Results
from tests.engine.build import beam, cruise, fixed, force, mass, study

WAY = cruise(0.0, 1.0, 0.2)
AMPLITUDES, PHASES = [1.0, 0.5, 0.0], [0.0, 1.0, 2.0]
PULSATION = {"amplitude": AMPLITUDES, "frequency": 1.2, "phase": PHASES}
ROW = {"axles": 3, "spacing": 0.3}


def row(pulsation: dict[str, Any], **more: Any) -> Study:
    walkers = force(2.0, WAY, pulsation=pulsation) | ROW | more.pop("train", {})
    return study(beam(damping_ratio=0.02), {}, train={"group": walkers}, sensor={"midspan": fixed(0.5)}, **more)


def alone(scale: float = 1.0, **more: Any) -> Study:
    """The same as separate carriages."""
    walkers = {
        f"group_{n + 1}": force(
            scale * 2.0, WAY, pulsation={"amplitude": scale * amplitude, "frequency": 1.2, "phase": phase}
        )
        | ({"headway": 0.3 * n} if n else {})
        for n, (amplitude, phase) in enumerate(zip(AMPLITUDES, PHASES, strict=True))
    }
    return study(beam(damping_ratio=0.02), walkers, sensor={"midspan": fixed(0.5)}, **more)


def same(one: Study, other: Study) -> None:
    first, second = studies.run(one), studies.run(other)
    assert (first.status == Status.OK).all() and float(first["midspan_max"].max()) > 0.0
    assert first.drop_attrs().identical(second.drop_attrs())


def paces(*keys: str) -> dict[str, Any]:
    return {"sweep": {"pace": {"of": list(keys), "values": [0.9, 1.57]}}, "solver": {"audit": 0}}


def test_each_has_an_amplitude_and_a_phase_of_its_own_and_all_one_frequency() -> None:
    keys = [f"carriage.group_{n}.pulsation.frequency" for n in (1, 2, 3)]
    same(row(PULSATION, **paces("train.group.pulsation.frequency")), alone(**paces(*keys)))


IN_STEP = {"amplitude": AMPLITUDES, "frequency": 1.2, "phase": 0.7}


def coordinates(given: Study, *swept: str) -> int:
    """How many forces that pulsate swing by."""
    pulses = build_model(given, {}, {}, swept).pulses
    return pulses.stop - pulses.start


def test_those_that_swing_in_step_share_a_coordinate() -> None:
    """And each of them has the force of one alone."""
    audited = {"solver": {"audit": 0}, "output": {"histories": "all"}}
    apart = row(IN_STEP | {"phase": [0.7, 0.7 + 2.0 * np.pi, 0.7 - 2.0 * np.pi]}, **audited)
    assert [coordinates(one) for one in (row(IN_STEP), apart, row(PULSATION))] == [1, 3, 3]
    one, other = (studies.run(given)["midspan"] for given in (row(IN_STEP, **audited), apart))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-10 * float(np.abs(other).max()))


def test_a_carriage_of_the_name_of_a_train_swings_by_itself() -> None:
    own = force(1.0, WAY, pulsation={"amplitude": 1.0, "frequency": 0.5})
    walkers = force(2.0, WAY, pulsation=IN_STEP) | ROW
    given = study(beam(), {"group": own}, train={"group": walkers}, sensor={"midspan": fixed(0.5)})
    assert coordinates(given) == 2


@pytest.mark.parametrize("number", ["frequency", "amplitude", "amplitude.1"])
def test_what_is_swept_of_all_leaves_them_in_step(number: str) -> None:
    keys = list(row(IN_STEP).targets(f"train.group.pulsation.{number}"))
    assert coordinates(row(IN_STEP), *keys) == 1


def test_phases_that_are_swept_are_each_their_own() -> None:
    """Each alone, beside one that is written."""
    key = "carriage.group_2.pulsation.phase"
    assert coordinates(row(IN_STEP), key) == 3
    sweep = {"later": {"of": key, "values": [0.7, 2.0]}}
    found = studies.run(row(IN_STEP, sweep=sweep, solver={"audit": 0}))["midspan_max"]
    written = studies.run(row(IN_STEP | {"phase": [0.7, 2.0, 0.7]}, solver={"audit": 0}))["midspan_max"]
    assert float(found[1]) == pytest.approx(float(written), rel=2e-3) and abs(float(found[1] / found[0]) - 1.0) > 0.01


def test_no_force_of_a_row_pulsates_at_a_frequency_of_its_own() -> None:
    with pytest.raises(
        BadInput, match=r'pulsate at one frequency.*of = "train.group.pulsation.frequency" is that of all'
    ):
        studies.run(row(IN_STEP, sweep={"pace": {"of": "carriage.group_2.pulsation.frequency", "values": [1.0, 2.0]}}))


def test_the_scale_of_loads_multiplies_amplitudes_too() -> None:
    audited = {"solver": {"audit": 0}}
    same(row(PULSATION, train={"load_scale": 2.0}, **audited), alone(2.0, **audited))
    swept = {"sweep": {"load": {"of": "train.group.load_scale", "values": [0.5, 2.0]}}}
    found, once = (studies.run(row(PULSATION, **more, **audited)) for more in (swept, {}))
    np.testing.assert_allclose(found["midspan_max"], [0.5 * once["midspan_max"], 2.0 * once["midspan_max"]], rtol=1e-3)


def test_one_number_is_that_of_all() -> None:
    targets = row({"amplitude": 1.0, "frequency": 1.0}, train={"load_scale": 3.0}).targets
    assert targets("train.group.pulsation.amplitude") == {
        f"carriage.group_{n}.pulsation.amplitude": 3.0 for n in (1, 2, 3)
    }
    assert row(PULSATION).targets("train.group.pulsation.phase.1") == {"carriage.group_2.pulsation.phase": 1.0}


def test_a_list_has_a_number_for_each() -> None:
    with pytest.raises(BadInput, match=r"train.group.*pulsation.phase is one number for all axles, or a list with one"):
        row({"amplitude": 1.0, "frequency": 1.0, "phase": [0.0, 1.0]})


def test_the_answer_names_the_row() -> None:
    sweep = {"pace": {"of": "train.group.pulsation.frequency", "from": 1.2, "to": 2.0, "count": 9}}
    found = studies.run(row({"amplitude": 1.0, "frequency": 1.0}, sweep=sweep))
    told = " ".join(kind_of(row(PULSATION)).findings(Results.of(found)))
    assert "Where it is largest train group pulsates in step with the first frequency of bed (1.57 Hz)." in told


def test_wheels_in_a_row_may_be_held_from_both_sides() -> None:
    fast = cruise(0.0, 1.0, 1.5)
    found = [
        studies.run(study(beam(), {}, train={"tram": mass(0.5, fast, **more) | ROW}, sensor={"midspan": fixed(0.5)}))
        for more in ({}, {"bilateral": True})
    ]
    assert [int(one.status) for one in found] == [Status.SEPARATED, Status.OK]
    least = [[float(one[f"tram_{n}_contact_force_min"]) for n in (1, 2, 3)] for one in found]
    assert least[0] == least[1] and min(least[1]) < 0.0
