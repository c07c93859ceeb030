"""Captions say what figures show: which way displacements count, which limits are drawn, and what is not drawn as it is
the same all over."""

from __future__ import annotations

from functools import cache

import pytest
import xarray as xr

import studies
from studies.findings.settled import settled
from studies.pictures.common.figures import Figure
from studies.reporting import answers
from studies.results.formatting import percent
from studies.results.results import Results
from tests.engine.build import beam, cruise, fixed, force, study
from tests.pictures.test_passages import MASS, limits, panels
from tests.studies import scenes

BED = """\
schema_version = 1
kind = "passage"

[body.bed]
kind = "frame"
plane = "xz"
damping_ratio = 0.03
modes = 4
node = { left = [0, 0], mount_1 = [0.3, 0], mount_2 = [2.7, 0], right = [3, 0] }
section.box = { area = 0.035, second_moment = 6.4e-4, youngs_modulus = "110 GPa", density = 7200 }
member.one = { nodes = ["left", "mount_1"], section = "box", elements = 2 }
member.two = { nodes = ["mount_1", "mount_2"], section = "box" }
member.three = { nodes = ["mount_2", "right"], section = "box", elements = 2 }
spring.mount_1 = { node = "mount_1", stiffness = [1e7, 0, 1e8] }
spring.mount_2 = { node = "mount_2", stiffness = [1e7, 0, 1e8] }
track.members = ["one", "two", "three"]

[carriage.slide]
on = "bed"
kind = "mass"
mass = 400
inertia_along = true
motion = { kind = "point-to-point", start = 0.6, end = 2.4, speed = 1, acceleration = 6, jerk = 200, dwell = 0.1 }

[sensor.middle]
body = "bed"
at = 1.5

[sensor.sway]
body = "bed"
node = "mount_1"
direction = "x"

[envelope.bed]
body = "bed"
places = 5

[solver]
steps = 400
audit = 0

[sweep]
acceleration = { of = "carriage.slide.motion.acceleration", values = [2, 4, 6] }
mass = { of = "carriage.slide.mass", values = [200, 400] }
"""


@cache
def found_once() -> xr.Dataset:
    return studies.run(BED)


def swayed(question: str = "") -> xr.Dataset:
    """With a question that changes no number."""
    return found_once().assign_attrs(study=f"{BED}\n{question}")


def drawn(dataset: xr.Dataset) -> dict[str, Figure]:
    return {figure.name: figure for figure in answers.figures(dataset)}


def test_displacements_are_said_to_point_down_where_they_do() -> None:
    found = drawn(swayed())
    own = "Displacements point down for middle, as the body hangs; others count along directions of their own."
    assert own in found["response"].caption
    for sensor, axes in panels(found["response"]).items():
        assert axes.yaxis_inverted() == (sensor == "middle")
    assert "Displacements point down, as the body hangs." in found["envelopes"].caption
    assert "point down" not in found["largest-displacement"].caption  # that of the middle is told in words


def test_a_track_whose_loads_act_sideways_does_not_hang() -> None:
    """Its loads act askew, and so its deflection is no sag."""
    askew = BED.replace("inertia_along = true\n", "").replace(
        "track.members", "track.direction = [1, 0, 1]\ntrack.members"
    )
    found = drawn(studies.run(askew))
    assert not any("point down" in figure.caption for figure in found.values())
    assert not panels(found["response"])["middle"].yaxis_inverted()


def test_red_is_explained_where_a_limit_is_drawn() -> None:
    for limit, is_drawn in (("0.1 mm", True), ("2 m", False)):
        found = drawn(swayed(f'[question]\ndisplacement = "{limit}"'))
        for name in ("largest-displacement", "response", "envelopes"):
            lines = [line for axes in found[name].drawing.axes for line in limits(axes)]
            assert bool(lines) == ("Orange: limits that the study names." in found[name].caption)
            assert bool(lines) == is_drawn or name == "envelopes"


def test_what_hardly_changes_along_the_axis_is_told_and_not_drawn() -> None:
    figure = drawn(swayed())["largest-displacement"]
    assert list(panels(figure)) == ["sway"]
    assert "Not drawn: middle, 17.8 µm to 35.7 µm, the same within 1 % for acceleration" in figure.caption


def test_an_amplification_that_is_the_same_all_over_is_a_sentence() -> None:
    resting = drawn(scenes.run("passage", MASS, extra="[solver]\nfidelity = 'static'"))["largest-displacement"]
    assert "Dynamic amplification of midspan: 1 throughout." in resting.caption
    assert len(resting.drawing.axes) == 1 and "right:" not in resting.caption


def test_small_dynamic_parts_are_no_line_at_one_height() -> None:
    """0.0004 to 0.0014 of the static value were told as "0.00136 throughout"."""
    speeds = {"speed": {"of": "carriage.car.motion.speed", "values": [0.005, 0.01, 0.02, 0.03]}}
    swing = {"swing": fixed(0.5) | {"part": "dynamic"}}
    found = studies.run(study(beam(damping_ratio=0.02), force(1.0, cruise(0.0, 1.0, 0.01)), sensor=swing, sweep=speeds))
    parts = found["swing_max"].values / (1.0 / 48.0)
    assert 1.5 * parts.min() < parts.max() < 0.01
    assert not any("throughout" in figure.caption for figure in drawn(found).values())


@pytest.mark.parametrize(("key", "is_map"), [("force", False), ("mass", True)])
@pytest.mark.parametrize(("kind", "name"), [("passage", "amplification-map"), ("asymmetry", "odd-map")])
def test_a_map_is_drawn_where_both_axes_tell(kind: str, name: str, key: str, is_map: bool) -> None:
    """A force multiplies all that it does, so that ratios are those of the speed alone."""
    load = f"[carriage.table]\non = 'bed'\nkind = '{key}'\n{key} = 100.0"
    text = scenes.text_of(kind).replace('[carriage.table]\non = "bed"\nkind = "mass"\nmass = 100.0', load)
    other = f'other = {{ of = "carriage.table.{key}", from = 100, to = 800, count = 7 }}'
    found = drawn(studies.run(f"{text}\n[sweep]\n{scenes.pace(kind, 1.0, 12.0)}\n{other}"))
    assert (name in found) == is_map


def test_contact_forces_that_a_swept_number_hardly_changes_are_curves() -> None:
    damping = 'zeta = { of = "body.bed.damping_ratio", values = [0.01, 0.012] }'
    text = scenes.text_of("passage").replace("mass = 100.0", "mass = 600.0")
    found = drawn(studies.run(f"{text}\n[sweep]\n{scenes.pace('passage', 1.0, 12.0)}\n{damping}"))["contact-table"]
    assert "Nearly the same for zeta 0.01 to 0.012." in found.caption
    assert found.drawing.axes[0].get_lines() and not found.drawing.axes[0].collections


def test_grey_is_explained_where_something_has_left() -> None:
    text = scenes.text_of("passage", scenes.pace("passage")).replace("speed = 8.0", "speed = 8.0\nafter = 1.0")
    leaves, stays = drawn(studies.run(text))["response"], drawn(swayed())["response"]
    assert "Grey: table has left" in leaves.caption and "rey" not in stays.caption


def test_nothing_is_grey_where_variants_stop_at_different_places() -> None:
    """The trolley of the answer's variant stopped at 12 m, and 12 to 18 m were grey, as if it had left there."""
    move = {"kind": "point-to-point", "start": 0.2, "end": 0.8, "speed": 1.0, "acceleration": 4.0, "dwell": 1.0}
    ends = {"end": {"of": "carriage.car.motion.end", "values": [0.6, 0.9]}}
    found = studies.run(study(beam(damping_ratio=0.1), force(1.0, move), sweep=ends, output={"histories": "all"}))
    assert "Grey" not in drawn(found)["response"].caption


def test_odd_parts_of_variants_that_have_not_settled_are_dashed_and_not_in_the_title() -> None:
    damping = 'damping_ratio = { of = "body.bed.damping_ratio", values = [0.01, 0.05] }'
    dataset = scenes.run("asymmetry", f"{scenes.pace('asymmetry', 0.2, 2.0, 6)}\n{damping}")
    figure = drawn(dataset)["odd-and-even"]
    odd = dataset.odd_rms.sel(sensor="midspan")
    fine = settled(Results.of(dataset))
    assert float(odd.where(fine).max()) < float(odd.max())
    assert f"differ by up to {percent(float(odd.where(fine).max()))} of" in figure.title
    assert "Dashed: variants that have not settled" in figure.caption


def test_ways_that_are_one_line_are_a_sentence() -> None:
    dataset = scenes.run("asymmetry", scenes.pace("asymmetry", 0.2, 2.0, 6)).copy(deep=True)
    dataset.odd_rms.loc[{"sensor": "moment"}] = 1e-3
    found = drawn(dataset)
    assert "response-midspan" in found and "response-moment" not in found
    assert "Not drawn, as their two ways would be one line: moment by 0.1 %" in found["response-midspan"].caption


def shuttled() -> xr.Dataset:
    """A shuttle at four rates with two masses, whose results may be changed."""
    mass = 'mass = { of = "carriage.table.mass", values = [50, 100] }'
    return scenes.run("double-peak", f"{scenes.pace('double-peak', 0.1, 0.4)}\n{mass}").copy(deep=True)


def test_numbers_of_peaks_that_one_swept_number_does_not_change_are_steps_along_the_other() -> None:
    dataset = shuttled()
    dataset.peaks_per_cycle[:] = xr.where(dataset.mass > 60.0, 2, 1)
    figure = drawn(dataset)["peaks-midspan"]
    assert figure.title == "midspan has 1 peak per cycle up to 50 kg; beyond, 2"
    assert "The same for pace 0.005 to 0.02 Hz." in figure.caption and len(figure.drawing.axes) == 1


def test_odd_harmonics_are_drawn_where_they_are_largest() -> None:
    dataset = shuttled()
    dataset.odd_even_ratio[:] = 0.5
    dataset.odd_even_ratio.loc[{"mass": 50.0, "pace": dataset.pace[0], "sensor": "moment"}] = 3.25
    figure = drawn(dataset)["odd-even"]
    assert figure.title == "Odd harmonics of the bending moment under table are up to 3.25 times the even ones"
