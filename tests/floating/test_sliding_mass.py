"""A mass that slides freely on a bending beam (section 2.3 of Hartweg and Heckmann 2012)."""

from dataclasses import replace

import numpy as np
import pytest

from engine.floating.converge import converge, levels
from engine.floating.march import Marched, march
from engine.floating.model import build
from engine.floating.model_choice import choose
from engine.floating.results import differences, outcome, results_of
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from tests.floating.scenes import ARM, AVERAGE_ACCELERATION, FOX_GOODWIN, history, sliding_mass, steps

PERIOD = 2.0 * np.pi / 6.5480886  # of the beam, s
CROSSINGS = (4.2128, 13.5532, 23.0755, 32.6171, 42.1598, 51.7024)  # s, from an ODE solver of other equations


def passes(times: np.ndarray, places: np.ndarray, middle: float) -> np.ndarray:
    gap = places - middle
    before = np.flatnonzero(gap[:-1] * gap[1:] < 0.0)
    part = gap[before] / (gap[before] - gap[before + 1])
    return times[before] + part * (times[before + 1] - times[before])


def test_the_paper_s_motion() -> None:
    """Passes of midspan, the way and the peaks as an independent solution of the consistent equations has them."""
    count = int(60.0 / PERIOD * 350)
    model, marched = steps(sliding_mass(), 60.0, count)
    place, a_x, a_z = (history(model, marched, "carriages", k)[:, 0] for k in (0, 3, 5))
    assert passes(marched.times[0], place, 7.5) == pytest.approx(CROSSINGS, abs=1.5e-4)
    assert (place.min(), place.max()) == pytest.approx((1.528204, 13.471477), rel=1e-4)
    assert (a_x.min(), a_x.max()) == pytest.approx((-0.992761, 1.658281), rel=1e-4)
    assert np.abs(a_z - 9.81).max() == pytest.approx(16.750715, rel=1e-4)


@pytest.mark.parametrize("modes", [1, 3, 5])
def test_energy_is_kept_without_damping(modes: int) -> None:
    """To 1e-4 over 60 s with 350 steps per first period, of order 2."""
    drifts = []
    for per_period in (350, 700, 1400)[: 3 if modes == 1 else 1]:
        count = int(60.0 / PERIOD * per_period)
        model, marched = steps(sliding_mass(modes=modes, damping_ratio=0.0), 60.0, count, 7)
        kinetic, potential = history(model, marched, "whole", 0, 2).T
        drifts.append(np.ptp(kinetic + potential) / kinetic.max())
    assert drifts[0] < 1e-4
    if modes == 1:
        orders = np.log2(np.array(drifts[:-1]) / drifts[1:])
        assert orders == pytest.approx(2.0, abs=0.1)
        assert drifts[-1] < 3e-6


def test_fox_goodwin_agrees_with_average_acceleration() -> None:
    count = int(20.0 / PERIOD * 5) * 20
    found = []
    for scheme_steps, scheme in ((4 * count, FOX_GOODWIN), (16 * count, None)):
        more = {} if scheme is None else {"scheme": scheme}
        model, marched = steps(sliding_mass(), 20.0, scheme_steps, scheme_steps // 20, **more)
        found.append(history(model, marched, "carriages")[:, 0])
    assert found[0] == pytest.approx(found[1], abs=3e-5)


def test_contact_force_carries_the_weight_at_rest() -> None:
    """A heavily damped beam with the mass at midspan ends at its static deflection, the contact force at the weight."""
    study = sliding_mass(damping_ratio=0.7).with_values({"carriage.load.motion.start": 7.5})
    model, marched = steps(study, 30.0, 6000, 6000)
    force = history(model, marched, "carriages", 6)[-1, 0]
    assert force == pytest.approx(981.0, rel=1e-9)
    assert history(model, marched, "carriages")[-1, 0] == pytest.approx(7.5, abs=1e-12)


def test_friction_takes_energy_and_a_drive_gives_it() -> None:
    for key, sign in (("friction", -1.0), ("coulomb", -1.0), ("drive", 1.0)):
        value = {"friction": 5.0, "coulomb": 0.01, "drive": 20.0}[key]
        study = sliding_mass(damping_ratio=0.0).with_values({f"carriage.load.motion.{key}": value})
        model, marched = steps(study, 6.0, 4000, 4)
        kinetic, potential = history(model, marched, "whole", 0, 2).T
        change = kinetic + potential - kinetic[0] - potential[0]
        place, speed, force = (history(model, marched, "carriages", k)[:, 0] for k in (0, 1, 6))
        work = np.trapezoid(
            {"friction": -5.0 * speed**2, "coulomb": -0.01 * np.abs(force * speed), "drive": 20.0 * speed}[key],
            marched.times[0],
        )
        assert sign * change[-1] > 0.0
        assert change[-1] == pytest.approx(work, rel=2e-2), key  # the work is along the bent track
        assert place.min() > 0.0


def test_a_carriage_that_slides_over_an_end_stops_its_variant() -> None:
    study = sliding_mass().with_values({"carriage.load.motion.speed": 4.0})
    model, marched = steps(study, 20.0, 4000, 4)
    from results_schema.status import Status

    assert marched.status[0] == Status.SEPARATED
    assert 0 < marched.last[0] < 4000
    assert history(model, marched, "carriages")[0, 0] == 2.0
    assert np.isnan(history(model, marched, "carriages")[-1, 0])


def test_when_something_slides_over_an_end_is_known_to_a_step() -> None:
    """What is told of the time at which a variant ended is no less than it is off: steps grew until two marches agreed
    by chance, and nothing was told of variants that were off by up to 2 %."""
    scene = sliding_mass(damping_ratio=0.06)
    starts, speeds = np.linspace(0.6, 1.0, 12), np.linspace(-1.3, -1.15, 12)
    columns = {"carriage.load.motion.start": starts, "carriage.load.motion.speed": speeds}
    values, duration = VariantValues(scene, columns, 12), np.full(12, 30.0)
    rung = choose(scene, values, duration, 30.0)
    found = converge(scene, values, duration, 30.0, rung)
    level = next(one for one in levels(scene, 30.0, rung.modes) if one.steps == found.steps.max())
    fine = replace(level, steps=8 * level.steps, every=8 * level.every)
    wanted = fine.march(values, duration).numbers["duration"]
    off = np.abs(found.outcome.numbers["duration"] / wanted - 1.0)
    assert (wanted < 29.0).all()
    assert off.max() > 1e-4
    assert (off <= (found.error - rung.by_fixed.told(columns, 12)).min(axis=0)).all()


def test_a_missing_part_of_a_history_is_a_difference() -> None:
    """A number that only one of two marches has counts, unless its variant had ended by then."""
    model, marched = steps(sliding_mass(), 1.0, 800, 8)
    whole = outcome(model, marched)
    holed = outcome(model, replace(marched, history=marched.history.copy()))
    assert not differences(model, whole, whole).any()
    holed.history[0, 5, model.signal_of("carriages")] = np.nan
    named = [result.name for result in results_of(model)]
    assert differences(model, holed, whole)[named.index("load_position_max"), 0] == np.inf


def same_alone(study: Study, columns: dict[str, np.ndarray], duration: float) -> None:
    """The march of variants side by side, and of each for itself: the same bits."""
    model, stations = build(study), np.arange(0, 2001, 50)
    count = len(next(iter(columns.values())))

    def own(part: slice) -> Marched:
        values = VariantValues(study, {key: column[part] for key, column in columns.items()}, len(range(count)[part]))
        return march(model, values, np.full(values.size, duration), 2000, stations, AVERAGE_ACCELERATION)

    together = own(slice(None))
    for k in range(count):
        alone = own(slice(k, k + 1))
        assert alone.history.tobytes() == together.history[k : k + 1].tobytes()
        assert alone.statistics.tobytes() == together.statistics[k : k + 1].tobytes()
        assert (alone.status, alone.last) == (together.status[k], together.last[k])


@pytest.mark.fault(19)
def test_lanes_do_not_depend_on_their_neighbours() -> None:
    """Variants that lift off, slide over an end, or stay."""
    masses, starts = np.linspace(20.0, 400.0, 21), np.linspace(0.01, 7.0, 21)
    same_alone(sliding_mass(), {"carriage.load.mass": masses, "carriage.load.motion.start": starts}, 20.0)


@pytest.mark.fault(19)
def test_events_of_lanes_do_not_depend_on_their_neighbours() -> None:
    """Arms whose given motion goes on as another piece at times of their own, while accelerations grow from nothing."""
    motion = {"kind": "spin-up", "rate": 1.0, "time": 2.0}
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"arm": ARM | {"modes": 3}},
        frame={"arm": {"joints": [{"kind": "revolute", "axis": [0, 1, 0], "motion": motion}]}},
        question={"duration": 5.0},
    )
    same_alone(study, {"frame.arm.joints.0.motion.time": np.linspace(0.1, 4.9, 18)}, 5.0)
