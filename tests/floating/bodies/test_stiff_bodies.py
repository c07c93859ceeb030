"""Bodies in frames that move which marches can hardly follow."""

import numpy as np
import pytest

import studies
from engine.scene.study import Study, load
from results_schema.errors import BadInput

BEAD = """
schema_version = 1
kind = "moving-frames"
gravity = 9.81
[body.beam]
kind = "beam"
length = "3 m"
area = 1e-3
second_moment = 1e-7
youngs_modulus = "210 GPa"
density = 7850.0
supports = "clamped-free"
damping_ratio = 0.02
modes = 8
own_weight = true
[frame.beam]
turned = [0, "-20 deg", 0]
[carriage.bead]
on = "beam"
kind = "mass"
mass = "1 kg"
motion = { kind = "free", start = "0.2 m", coulomb = 0.0 }
[sensor.mid]
body = "beam"
at = "1.5 m"
[question]
duration = "1.2 s"
"""


def test_bodies_too_stiff_for_any_march_are_refused() -> None:
    """A second moment in mm4 typed as m4: it was a bug of our own."""
    given = load(BEAD).with_values({"body.beam.second_moment": 218700.0})
    with pytest.raises(
        BadInput, match=r"more steps than any may.*first frequency of .* Hz over 1.2 s.*look at the units"
    ):
        studies.run(given)


def test_where_finer_models_give_up_no_estimate_exists() -> None:
    """Of eight modes that are fixed, beside more of them: infinite errors ended the run, and its results were lost."""
    found = studies.run(load(BEAD).with_values({"frame.beam.stiffening": False}))
    assert not np.isinf(found["estimated_error"]).any() and not np.isinf(found["error_estimate"])
    assert float(found["bead_contact_force_max"]) == pytest.approx(14.93, rel=2e-3)


def test_what_a_beam_that_hangs_weighs_stiffens_it_where_that_is_left_open() -> None:
    """By 0.5 % here, as where the study says so."""
    one, other = (studies.run(load(BEAD).with_values(more)) for more in ({}, {"frame.beam.stiffening": True}))
    assert not np.isinf(one["estimated_error"]).any()
    assert float(one["bead_contact_force_max"]) == float(other["bead_contact_force_max"]) < 14.91


def test_a_first_march_that_failed_tells_no_error() -> None:
    """On a soft joint modes are faster than those of the beam alone: Fox-Goodwin's first steps are beyond its limit,
    and the contact force, right to 1e-4, was told to be off by 20 times itself."""
    tables = load(BEAD).data
    beam = tables["body"]["beam"] | {"length": 10.0, "area": 4e-3, "second_moment": 2e-6, "youngs_modulus": "70 GPa"}
    joint = {"kind": "revolute", "axis": [0, 1, 0], "stiffness": 1e6, "damping": 1e3}
    way = {"kind": "waypoints", "times": [0, 1, 2.5], "positions": [0, 4, 8]}
    given = Study(
        **tables
        | {
            "body": {"beam": beam | {"density": 3000.0, "modes": 4}},
            "frame": {"beam": {"joints": [joint]}},
            "carriage": {"bead": {"on": "beam", "kind": "mass", "mass": 20.0, "motion": way}},
            "sensor": {},
            "question": {"duration": 3.0},
        }
    )
    found, finer = studies.run(given), studies.run(given.with_values({"solver.steps": 12800}))
    force = "bead_contact_force_max"
    told = float(found["estimated_error"].sel(result=force))
    assert float(found[force]) == pytest.approx(float(finer[force]), rel=1e-3)
    assert told < 0.5  # by four modes, of the whole history
