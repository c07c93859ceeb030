"""Estimated errors against the truth: the same march with many times the steps, and with many more modes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

import engine.checking as checking
import engine.estimates as estimates
import engine.omitted as omitted
from engine.execution import run
from engine.lanes import LaneValues
from engine.moving_load import Load, noticed
from engine.omitted import MODES_LOOKED_AT, Omitted
from engine.route import routes
from engine.scene import Study
from engine.scenes import base_scene
from results_schema.status import Fidelity, Status
from tests.engine.build import (
    Table,
    aboard,
    beam,
    cruise,
    fixed,
    force,
    mass,
    oscillator,
    shuttle,
    study,
    swing,
    under,
)

Array = NDArray[np.float64]

CROSSING = cruise(0.0, 1.0, 0.5)
DAMPED = beam(damping_ratio=0.01)
PILES = [{"at": 0.1, "stiffness": 300.0}, {"at": 0.9, "stiffness": 200.0}]
MOMENT = {"moment": fixed(0.4, "bending_moment")}


@pytest.fixture(autouse=True)
def whole_histories(monkeypatch: pytest.MonkeyPatch) -> None:
    """The truth is here the largest error over time, of which a study's extremes are a part."""
    monkeypatch.setattr(estimates, "HISTORY_PART", 1.0)


def number(dataset: Any, name: str) -> float:
    """The only value of a variable."""
    return float(np.asarray(dataset[name].values).reshape(-1)[0])


def full(bed: Table, carriage: Any, steps: int | str = 1600, **changes: Any) -> Study:
    """A study by its carriages' own model with fixed steps; `solver` adds keys."""
    solver = {"fidelity": "full", "steps": steps} | changes.pop("solver", {})
    return study(bed, carriage, solver=solver, **changes)


class Marched(NamedTuple):
    """Histories (J, H) at common stations, and the largest static values (J, 1)."""

    history: Array
    static: Array

    def apart(self, other: Marched) -> float:
        """The largest difference of histories over their sensor's largest static value."""
        assert self.history.shape == other.history.shape
        found = float(np.max(np.abs(self.history - other.history) / self.static))
        assert np.isfinite(found)
        return found


def marched(given: Study, modes: int, steps: int, stations: int = 200) -> Marched:
    """A study with so many modes and steps, at so many stations."""
    assert steps % stations == 0
    output = {"output.histories": {"every": steps // stations}}
    found = run(given.with_values({"body.bed.modes": modes, "solver.steps": steps} | output), threads=1)
    history = np.stack([found[name].values.reshape(-1) for name in given.sensor])
    return Marched(history, np.array([[number(found, f"{name}_static")] for name in given.sensor]))


class Compared(NamedTuple):
    """A study's estimates of its errors, and the errors."""

    steps: float
    true_steps: float
    modes: float
    true_modes: float


def compared(given: Study, stations: int = 200) -> Compared:
    """A study of fixed modes and steps against marches of many more."""
    found = run(given, threads=1)
    modes, steps = int(number(found, "modes_used")), int(number(found, "steps_used"))
    few, many = (marched(given, count, 16 * stations, stations) for count in (modes, 2 * modes + 8))
    return Compared(
        number(found, "error_steps"),
        marched(given, modes, steps, stations).apart(marched(given, modes, FINER * steps, stations)),
        number(found, "error_modes"),
        few.apart(many),
    )


def of_steps(given: Study) -> tuple[float, float]:
    """Estimate and truth of what the steps of a study miss."""
    found = run(given, threads=1)
    modes, steps = int(number(found, "modes_used")), int(number(found, "steps_used"))
    return number(found, "error_steps"), marched(given, modes, steps).apart(marched(given, modes, FINER * steps))


FINER = 8  # times the steps of the truth
HONEST = 0.9  # of the truth that an estimate must be at least

SCENES = {
    "one mode": full(beam(modes=1), mass(0.2, CROSSING)),
    "two modes": full(beam(modes=2, damping_ratio=0.01), mass(0.2, CROSSING)),
    "twice the steps": full(DAMPED, mass(0.2, CROSSING), 200),
    "no static correction": full(DAMPED, mass(0.2, CROSSING), solver={"static_correction": False}),
    "bending moment": full(DAMPED, mass(0.2, CROSSING), sensor=MOMENT),
    "shear force": full(DAMPED, force(2.0, CROSSING), sensor={"shear": fixed(0.3, "shear_force")}),
    "under the carriage": full(DAMPED, mass(0.2, CROSSING), sensor={"below": under("car")}),
    "aboard": full(DAMPED, oscillator(0.2, 30.0, CROSSING), sensor={"car": aboard("car")}),
    "soft spring": full(DAMPED, oscillator(0.2, 3.0, CROSSING)),
    "stiff spring": full(DAMPED, oscillator(0.2, 3000.0, CROSSING), 3200),
    "several carriages": full(DAMPED, {"a": mass(0.2, CROSSING), "b": mass(0.1, CROSSING, delay=0.3)}),
    "own weight": full(DAMPED | {"own_weight": True}, mass(0.2, CROSSING)),
    "free end": full(beam(supports="clamped-free", damping_ratio=0.02), mass(0.5, cruise(1.0, 0.0, 0.3)), 6400),
    "out and back": full(DAMPED, mass(0.2, shuttle(0.1, 0.9, 0.5, 0.1, 2)), 4000),
    "swing": full(DAMPED, mass(0.2, swing(0.5, 0.3, 0.5, 2)), 4000),
}
SCHEMES: dict[str, tuple[Table, int]] = {
    "linear-acceleration": ({}, 1600),
    "fox-goodwin": ({}, 1600),
    "central-difference": ({}, 1600),
    "hht-alpha": ({"alpha": -0.05}, 800),
    "hht-alpha most": ({"alpha": -0.3}, 1600),
    "generalized-alpha": ({"rho_inf": 0.8}, 800),
    "generalized-alpha most": ({"rho_inf": 0.0}, 3200),
    "richardson": ({}, 1600),
}


@pytest.mark.parametrize("name", SCENES)
def test_estimates_are_honest(name: str) -> None:
    """No less than the truth but for a little, and not without bounds above it."""
    found = compared(SCENES[name])
    assert HONEST * found.true_steps <= found.steps <= 6.0 * found.true_steps
    assert HONEST * found.true_modes <= found.modes <= 50.0 * found.true_modes


@pytest.mark.parametrize("name", SCHEMES)
def test_estimates_of_other_schemes(name: str) -> None:
    parameters, steps = SCHEMES[name]
    scheme = {"scheme": name.split(maxsplit=1)[0]} | parameters
    told, truth = of_steps(full(DAMPED, mass(0.2, CROSSING), steps, solver=scheme))
    assert HONEST * truth <= told <= 6.0 * truth


@pytest.mark.parametrize("gamma", [0.6, 0.9])
def test_newmark_of_first_order(gamma: float) -> None:
    """With gamma other than 1/2 half the steps double the error: all of the difference is missed, not a third."""
    solver = {"scheme": "newmark", "beta": 0.25 * (0.5 + gamma) ** 2, "gamma": gamma}
    told, truth = of_steps(full(DAMPED, mass(0.2, CROSSING), 800, solver=solver))
    assert HONEST * truth <= told <= 6.0 * truth


UNRESOLVED = full(
    beam(modes=12, supports=PILES), force(2.0, cruise(-0.2, 1.2, 0.1)), 4200
)  # rings undamped from its step onto the beam on; all segments have whole numbers of stations


def test_undamped_high_modes_that_are_not_resolved() -> None:
    """A third of the difference says nothing of a mode that has lost its phase: all of it counts."""
    found = compared(UNRESOLVED, stations=210)
    assert found.true_steps > 0.01
    assert HONEST * found.true_steps <= found.steps <= 6.0 * found.true_steps
    assert HONEST * found.true_modes <= found.modes <= 50.0 * found.true_modes


SWITCHES: dict[str, tuple[Any, str, float, Study, int]] = {
    "what few modes miss": (checking, "OF_MORE", 0.0, SCENES["one mode"], 200),
    "phase errors": (estimates, "RESOLVED", np.inf, UNRESOLVED, 210),
}


@pytest.mark.parametrize("name", SWITCHES)
def test_estimates_need_every_term(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a coefficient switched off an estimate falls below the truth."""
    home, coefficient, value, given, stations = SWITCHES[name]
    monkeypatch.setattr(home, coefficient, value)
    found = compared(given, stations)
    assert found.steps < HONEST * found.true_steps or found.modes < found.true_modes


def rate(quantity: str) -> Study:
    return full(DAMPED, mass(0.2, CROSSING), 6400, sensor={"rate": fixed(0.4, quantity)})


@pytest.mark.parametrize("quantity", ["velocity", "acceleration"])
def test_rates_are_compared_with_their_own_largest_value(quantity: str) -> None:
    found = run(rate(quantity), threads=1)
    own, fine = (marched(rate(quantity), 4, steps) for steps in (6400, 51200))
    scale = max(abs(number(found, f"rate_{end}")) for end in ("max", "min"))
    truth = float(np.max(np.abs(own.history - fine.history))) / scale
    assert HONEST * truth <= number(found, "error_steps") <= 20.0 * truth
    assert number(found, "error_modes") > 0.0


def test_sensors_at_supports_say_nothing() -> None:
    alone = run(full(DAMPED, mass(0.2, CROSSING)), threads=1)
    both = run(full(DAMPED, mass(0.2, CROSSING), sensor={"end": fixed(0.0), "midspan": fixed(0.5)}), threads=1)
    for part in ("error_steps", "error_modes", "error_estimate"):
        assert number(both, part) == pytest.approx(number(alone, part), rel=1e-9)


def test_free_vibration_counts() -> None:
    """The phase error of free vibration grows with time: what is left after twenty periods is seen."""
    given = full(beam(modes=2), mass(0.2, cruise(0.0, 1.0, 1.0, after=20.0)), 400)
    found = run(given, threads=1)
    without = run(full(beam(modes=2), mass(0.2, cruise(0.0, 1.0, 1.0)), 400), threads=1)
    assert number(found, "error_steps") > 2.0 * number(without, "error_steps")


def test_statics_take_no_steps() -> None:
    found = run(study(DAMPED | {"modes": "auto"}, mass(0.01, cruise(0.0, 1.0, 1e-4))), threads=1)
    assert number(found, "fidelity_used") == Fidelity.STATIC
    assert number(found, "steps_used") == number(found, "error_steps") == number(found, "relative_cost") == 0.0
    assert 0.0 < number(found, "error_estimate") <= 1e-3


def test_what_diverges_has_no_estimate() -> None:
    """Parametric resonance without damping grows until nothing is left; its neighbours keep values and estimates."""
    way = swing(0.5, 0.5, 0.608 * 0.5 * np.pi, 150)
    sweep = {"weight": {"of": "carriage.car.mass", "values": [0.001, 1.0, 0.002]}}
    found = run(full(beam(modes=3), mass(0.5, way), 200, sweep=sweep), threads=1)
    assert found.status.values.tolist()[1] == Status.DIVERGED and found.status.values.max() == Status.DIVERGED
    for name in ("midspan_max", "error_estimate", "error_steps", "error_modes"):
        assert np.isnan(found[name].values).tolist() == [False, True, False]


def parts_of(given: Study) -> list[Omitted]:
    """What the loads of a study leave out."""
    looked_at = given.with_values({"body.bed.modes": MODES_LOOKED_AT})
    along = routes(base_scene(looked_at), MODES_LOOKED_AT, "whole")
    assert along is not None
    loads = [Load(route, LaneValues(looked_at, {}, 1)) for route in along]
    return [Omitted(load, noticed(loads)) for load in loads]


def told_of_modes(given: Study, modes: int) -> float:
    return float(sum(part.modes(modes) for part in parts_of(given))[0])  # type: ignore[index]


def told_of_steps(given: Study, modes: int, steps: int) -> float:
    """What so many steps over a passage or cycle miss."""
    scheme = given.solver.integration
    return float(
        sum(part.stepped(modes, scheme).missed(part.load.time / steps) for part in parts_of(given))[0]  # type: ignore[index]
    )


class Beforehand(NamedTuple):
    """A scene of which something is told before it is marched, with few modes and steps."""

    study: Study
    modes: int
    steps: int

    def of_modes(self) -> tuple[float, float]:
        """What is told of modes, and the truth."""
        few, many = (marched(self.study, count, self.steps) for count in (self.modes, 24))
        return told_of_modes(self.study, self.modes), few.apart(many)

    def of_steps(self) -> tuple[float, float]:
        """What is told of steps, and the truth."""
        few, many = (marched(self.study, self.modes, count) for count in (self.steps, 16 * self.steps))
        return told_of_steps(self.study, self.modes, self.steps), few.apart(many)


def bare(bed: Table, carriage: Table, **changes: Any) -> Study:
    return full(bed, carriage, 200, **changes)


FREE_END = bare(beam(supports="clamped-free", damping_ratio=0.01), force(1.0, cruise(1.0, 0.0, 0.3)))
SWUNG = beam(damping_ratio=0.02)
STIFLED = beam(damping_ratio=0.3)
MODES = {
    "ringing": Beforehand(FREE_END, 2, 6400),
    "what follows the drive": Beforehand(bare(SWUNG, force(1.0, swing(0.5, 0.3, 1.0, 3))), 1, 1600),
    "statics": Beforehand(
        bare(SWUNG, force(1.0, cruise(0.0, 1.0, 0.02)), solver={"static_correction": False}), 3, 12800
    ),
    "a softer body": Beforehand(bare(SWUNG, mass(1.0, swing(0.5, 0.3, 0.3, 3))), 1, 6400),
}
STEPS = {
    "ringing": Beforehand(bare(beam(), force(1.0, cruise(0.0, 1.0, 0.1))), 4, 1600),
    "under a mass": Beforehand(bare(beam(), mass(0.5, cruise(0.0, 1.0, 0.3))), 4, 800),
    "what follows the drive": Beforehand(bare(SWUNG, force(1.0, swing(0.5, 0.3, 1.0, 3))), 4, 400),
}


@pytest.mark.parametrize("name", MODES)
def test_what_modes_leave_out_is_told_beforehand(name: str) -> None:
    told, truth = MODES[name].of_modes()
    assert 0.8 * truth <= told <= 5.0 * truth


@pytest.mark.parametrize("name", STEPS)
def test_what_steps_leave_out_is_told_beforehand(name: str) -> None:
    told, truth = STEPS[name].of_steps()
    assert 0.8 * truth <= told <= 5.0 * truth


def nothing(shape: Callable[[Omitted], Array]) -> property:
    return property(lambda self: np.zeros_like(shape(self)))


def angles(part: Omitted) -> Array:
    return part.load.angle


TERMS: dict[str, tuple[Any, str, object, Callable[[], tuple[float, float]]]] = {
    "ringing of omitted modes": (Omitted, "ringing", nothing(angles), MODES["ringing"].of_modes),
    "what omitted modes follow": (Omitted, "_moving", nothing(angles), MODES["what follows the drive"].of_modes),
    "statics of omitted modes": (
        Omitted,
        "_kept_only",
        nothing(lambda part: part.load.angle[:, :1]),
        MODES["statics"].of_modes,
    ),
    "SOFTENED": (omitted, "SOFTENED", 0.0, MODES["a softer body"].of_modes),
    "ringing of kept modes": (Omitted, "ringing", nothing(angles), STEPS["ringing"].of_steps),
    "phase that gathers": (Omitted, "_remembered", nothing(angles), STEPS["ringing"].of_steps),
}


@pytest.mark.parametrize("name", TERMS)
def test_every_term_is_needed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a term what is told falls below the truth."""
    home, attribute, value, ask = TERMS[name]
    monkeypatch.setattr(home, attribute, value)
    told, truth = ask()
    assert told < 0.8 * truth


def test_a_mass_presses_less_on_a_softer_body(monkeypatch: pytest.MonkeyPatch) -> None:
    """COUPLED times the inertia m v^2 c'' on what omitted modes leave soft, over the weight: by the contact force of
    marches with few and many modes, where damping leaves no ringing."""
    given = bare(STIFLED, mass(0.1, cruise(0.0, 1.0, 1.0)))
    for attribute in ("ringing", "_moving"):
        monkeypatch.setattr(Omitted, attribute, nothing(angles))
    least = []
    for modes in (3, 24):
        solved = run(given.with_values({"body.bed.modes": modes, "solver.steps": 6400}), threads=1)
        least.append((number(solved, "car_contact_force_max"), number(solved, "car_contact_force_min")))
    pressed = float(np.max(np.abs(np.subtract(*least)))) / (0.1 * 9.81)
    assert 0.2 * pressed < told_of_modes(given, 3) < 2.0 * pressed
    monkeypatch.setattr(omitted, "COUPLED", 0.0)
    assert told_of_modes(given, 3) == 0.0
