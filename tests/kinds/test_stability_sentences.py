"""What the maps of stability say, from data made up for it."""

import math

import numpy as np
import xarray as xr

from studies.stability_maps import alias, frozen, rigid, separation, shuttle


def alias_said(*growth: tuple[float, float, float]) -> str:
    """What the map says of scenes, each with its growth at 0.5, 1.2 and 4 times the rule's steps, by both schemes."""
    values = np.broadcast_to(np.array(growth)[None, None, None], (2, 1, 1, len(growth), 3))
    along = {"step_multiple": [0.5, 1.2, 4.0]}
    return " ".join(alias.sentences(xr.Dataset({"growth": (alias.OUTPUTS[5].dims, values)}, along)))


def test_too_few_steps_count_as_growth_beyond_what_grows_in_truth() -> None:
    assert "blow up some vibration by 1.5 to 2 times per passage in each of 2 scenes" in alias_said(
        (1.5, 1.0, 1.0), (2.0, 1.0, 0.5)
    )
    left = alias_said((1.5, 1.0, 1.0), (3.0, 5.0, 5.0))
    assert "in each of 1 scene where" in left and "1 more are left out" in left and "0.6" not in left
    some = alias_said((0.547, 0.5, 0.4), (1.5, 1.05, 1.0))
    assert "by 1.5 times per passage in 1 of 2 scenes" in some and "0.547" not in some
    assert "blow up nothing by more than 1 times" in alias_said((0.6, 0.6, 0.5))
    assert "to beyond all numbers per passage" in alias_said((1.5, 1.0, 1.0), (np.nan, 1.0, 1.0))
    assert "all 2 scenes some vibration grows" in alias_said((9.0, 5.0, 5.0), (9.0, 5.0, 5.0))


def tie_said(**ringing: float) -> str:
    names = [rigid.INERTIAL, *(name.replace("_", "-") for name in ringing)]
    data = {
        "contact_ringing": ("tie", [0.0, *ringing.values()]),
        "contact_departure": ("tie", [0.0, *ringing.values()]),
    }
    return " ".join(rigid.sentences(xr.Dataset(data, {"tie": names})))


def test_what_is_said_of_rigid_ties_follows_from_their_ringing() -> None:
    quiet = tie_said(average_acceleration=1e-3, hht_alpha=1e-4)
    assert "calms" not in quiet and "no more than 10 % of the weight with any scheme" in quiet
    assert "The tie by hht-alpha departs least" in quiet
    lost = tie_said(average_acceleration=1e-3, linear_acceleration=math.nan)
    assert "calms" not in lost and "linear-acceleration blows up altogether" in lost
    rings = tie_said(average_acceleration=1e-3, linear_acceleration=9.0, hht_alpha=1e-4)
    assert "damping calms it (hht-alpha); average-acceleration does not ring either" in rings
    assert "Numerical damping" not in tie_said(average_acceleration=1e-3, hht_alpha=9.0)


def test_the_contact_opens_first_and_may_hold_again() -> None:
    data = {
        "smallest_contact_force": (
            ("separation_mass_ratio", "separation_speed_ratio"),
            [[0.5, -0.1, 0.2, -0.4], [0.5, 0.4, 0.3, 0.2]],
        ),
        "separation_onset": ("separation_mass_ratio", [0.15, np.nan]),
        "separation_place": ("separation_mass_ratio", [0.7, np.nan]),
    }
    along = {"separation_mass_ratio": [0.5, 0.1], "separation_speed_ratio": [0.1, 0.2, 0.3, 0.4]}
    (said,) = separation.sentences(xr.Dataset(data, along))
    assert "opens first at speed ratio 0.15 for mass ratio 0.5, at 70 % of the way" in said
    assert "At 1 of 3 faster passages it holds." in said
    assert said.endswith("The other masses hold up to speed ratio 0.4.")


def shuttle_map(free: list[float], damped: list[float], low: float) -> xr.Dataset:
    mass, frequency = "shuttle_mass_ratio", "shuttle_frequency_ratio"
    data = {
        "multiplier": (("shuttle_damping_ratio", mass, frequency), [[free], [damped]]),
        "multiplier_fewer_modes": (("shuttle_damping_ratio", mass, frequency), [[free[1:] + free[:1]], [damped]]),
        "tongue_low": (mass, [low]),
        "tongue_high": (mass, [low + 0.1]),
        "tongue_theory": (mass, [0.8]),
    }
    along = {"shuttle_damping_ratio": [0.0, 0.02], mass: [0.5], frequency: np.arange(len(free)) * 0.1}
    return xr.Dataset(data, along)


def shuttle_said(free: list[float], damped: list[float], low: float) -> str:
    return " ".join(shuttle.sentences(shuttle_map(free, damped, low)))


def test_archives_without_a_map_of_fewer_modes_are_told() -> None:
    written_before = shuttle_map([1.0, 2.0], [1.0, 1.5], 0.75).drop_vars("multiplier_fewer_modes")
    assert "How much of it fewer modes judge otherwise is not known." in " ".join(shuttle.sentences(written_before))


def test_the_swinging_mass_names_a_main_band_and_the_share_of_the_map() -> None:
    said = shuttle_said([1.0, 2.0, 1.5, 1.0], [1.0, 1.5, 1.0, 1.0], 0.75)
    assert "main band near the formula" in said and "0.75 to 0.85" in said
    assert "50 % is unstable without damping and 25 % with 2 %" in said and "2 times without" in said
    assert "a third fewer modes 50 % of the map is judged otherwise without damping, 0 % with 2 %." in said
    same = shuttle_said([1.0, 2.0, 1.5, 1.0], [1.0, 1.9, 1.4, 1.0], math.nan)
    assert "near the formula for one mode nothing grows; of the whole map" in same
    assert "50 % is unstable without damping and about as much with 2 %" in same and "shrinks" not in same
    assert "nothing grows; of the whole map" in shuttle_said([1.0, 1.0], [1.0, 1.0], math.nan)


def test_what_passages_do_beside_the_frozen_station_follows_from_them() -> None:
    assert "of 3 real passages where it grows, 2 do not grow at all" in frozen._passages(np.array([1.0, 1.0, 3.0]))
    all_grow = frozen._passages(np.array([1.5, 4.8]))
    assert "property of the frozen station" not in all_grow and "all do, 1.5 to 4.8 times" in all_grow
    assert "1.5 to beyond all numbers" in frozen._passages(np.array([1.5, np.inf]))
    assert frozen._passages(np.zeros(0)) == ""
