import subprocess
import sys

import numpy as np
import pytest

from results_schema import variables
from results_schema.errors import ArchiveError, BadInput
from results_schema.gravest_status import gravest, lost
from results_schema.status import GRAVEST, Fidelity, Status, flag_meanings, flag_values, label
from results_schema.validate import findings_of, validate
from results_schema.variables import RESERVED, Variable, axes, declarations, declare, expand, registered, sensor_unit
from studies.protocol.study import KINDS
from tests.readme import reference_table
from tests.schema.samples import CARRIAGES, SENSORS, groups, march, with_histories


def test_status_and_fidelity_are_the_contract():
    assert [(int(s), label(s)) for s in Status] == [
        (0, "ok"),
        (1, "separated"),
        (2, "unresolved"),
        (3, "tolerance-missed"),
        (4, "not-converged"),
        (5, "diverged"),
        (6, "crashed"),
        (7, "beyond-theory"),
        (8, "falls-over"),
    ]
    assert [s for s in Status if s.values_kept] == [*list(Status)[:4], Status.BEYOND_THEORY]
    models = ["static", "force", "mass-without-convective", "mass", "tied", "frame", "given-frame"]
    assert [label(f) for f in Fidelity] == models
    assert len({s.message for s in Status}) == len(Status)


def test_of_several_statuses_the_most_serious_counts():
    """In the contract's order: what is beyond the theory comes last."""
    of_values = ["tolerance-missed", "unresolved", "separated", "beyond-theory", "ok"]
    assert [label(status) for status in GRAVEST] == ["crashed", "diverged", "falls-over", "not-converged", *of_values]
    for place, status in enumerate(GRAVEST):
        for other in GRAVEST[place:]:
            assert gravest(np.array([status]), np.array([other])) == gravest(np.array([other]), status) == status
    assert lost(np.array(Status)).tolist() == [not status.values_kept for status in Status]


def test_flags_are_cf():
    assert flag_values(Status) == list(range(9))
    assert flag_meanings(Status).split()[3] == "tolerance_missed"
    assert len(flag_meanings(Fidelity).split()) == len(flag_values(Fidelity))


def test_expand_fills_names_units_and_texts():
    found = expand("march", {"midspan": "m", "root": "N m"}, ["table", "robot_arm"])
    assert found["root_max"].units == "N m"
    assert found["root_max_position"].units == "m"
    assert found["robot_arm_contact_force_min"].units == "N"
    assert found["midspan"].lead == "history"
    assert "status" in found and "{" not in "".join(v.name + v.long_name + v.meaning for v in found.values())


def test_attributes_are_cf():
    found = expand("march", {"midspan": "m"}, ["table"])
    assert found["status"].attributes()["flag_values"] == [0, 1, 2, 3, 4, 5, 6, 7, 8]
    assert "units" not in found["status"].attributes()
    assert found["error_estimate"].attributes()["units"] == "1"


def test_a_variable_over_sensors_of_different_units_has_none():
    declare("test-units", Variable("amount", ("sensor",), units="{sensor}", long_name="amount"))
    try:
        assert expand("test-units", {"a": "m", "b": "m"}, [])["amount"].units == "m"
        assert expand("test-units", {"a": "m", "b": "N"}, [])["amount"].units is None
        with pytest.raises(ValueError, match="declared twice"):
            declare("test-units", Variable("amount", long_name="other"))
    finally:
        variables.REGISTRY.pop("test-units")


@pytest.mark.parametrize(
    ("sensors", "carriages", "named"),
    [
        ({"status": "m"}, [], "status"),
        ({"a": "m", "a_max": "m"}, [], "a_max"),
        ({"table_contact_force_min": "m"}, ["table"], "table_contact_force_min"),
        ({}, ["position"], "position"),
        ({}, ["harmonic"], "harmonic"),
    ],
)
def test_names_that_clash_are_refused(sensors, carriages, named):
    with pytest.raises(BadInput, match=named):
        expand("march", sensors, carriages)


def test_all_fixed_names_of_the_ground_floor_are_reserved():
    fixed = {v.name for kind, vs in registered().items() if not kind.startswith("/") for v in vs if "{" not in v.name}
    assert {v.name for v in declarations("*")} | set(axes()) <= RESERVED
    assert fixed & {"speed", "mass", "damping_ratio"} == set()
    assert {"lag", "peak_phase", "critical_step", "variant", "tool_centre_point_error"} <= RESERVED


def test_groups_do_not_inherit_the_outputs_of_every_kind():
    names = ["frequency", "damping_ratio", "mode_shape", "length", "mass", "first_frequency"]
    assert [v.name for v in declarations("/model/bed")] == names
    assert "status" in [v.name for v in declarations("march")]


def test_every_declaration_has_a_text_and_a_row_in_the_table():
    table = reference_table()
    rows = table.splitlines()[2:]
    shared = registered()["march"]
    declared = [(kind, v) for kind, vs in registered().items() for v in vs if kind == "march" or v not in shared]
    assert len(rows) == len(declared) > 30
    for row, (_, variable) in zip(rows, declared, strict=True):
        assert variable.long_name
        assert row.startswith(f"| `{variable.name}` |")
        assert row.count("|") == 7


def test_labels_of_axes_fit_one_line_and_those_of_histories_two():
    """xarray breaks what it writes beside an axis after 30 letters."""
    assert all(KINDS.values())  # imports every kind, which declares its results
    axes_of = {v.name: v for vs in registered().values() for v in vs if v.dims == (v.name,)}
    assert len(axes_of) > 40
    long = [name for name, v in axes_of.items() if len(f"{v.long_name} [{v.units or 1}]") > 30]
    assert long == []
    histories = [v for vs in registered().values() for v in vs if v.lead == "history"]
    assert max(len(f"{v.long_name} [{v.units}]") for v in histories) <= 60


def test_sensor_units():
    assert sensor_unit("acceleration") == "m s-2"
    with pytest.raises(BadInput, match="displacement"):
        sensor_unit("displacment")


def test_importing_the_package_is_cheap():
    modules = ("errors", "status", "variables", "validate")
    modules += tuple(f"store.{name}" for name in ("files", "parts", "archive"))
    code = f"import sys; {'; '.join(f'import results_schema.{m}' for m in modules)}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert not {"xarray", "netCDF4", "pandas", "engine", "studies"} & set(loaded)
    code = "import sys, results_schema.errors, results_schema.status, results_schema.variables; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert "numpy" not in loaded


# ---- what is compared with the declarations ----


def found(dataset, kind="march"):
    return "; ".join(findings_of(dataset, kind, expand(kind, SENSORS, CARRIAGES)))


@pytest.mark.parametrize("dataset", [march(), march(()), march((3,)), with_histories(march())])
def test_a_complete_dataset_passes(dataset):
    validate(dataset, "march", expand("march", SENSORS, CARRIAGES))


def test_groups_pass():
    validate(groups()["/audit"], "/audit", expand("/audit"))
    validate(groups()["/model/bed"], "/model/bed", expand("/model/bed"))


def test_missing_and_unknown_variables_are_named_together():
    dataset = march().rename(midspan_max="midspam_max")
    with pytest.raises(ArchiveError) as caught:
        validate(dataset, "march", expand("march", SENSORS, CARRIAGES))
    assert "midspan_max: expected in every march" in str(caught.value)
    assert "midspam_max: expected a declared name" in str(caught.value)


def test_dims_dtype_units_and_names_are_compared():
    assert "expected dimensions ('speed', 'mass'), received ('mass', 'speed')" in found(
        march().assign(midspan_max=march().midspan_max.T)
    )
    dataset = march()
    dataset["modes_used"] = dataset.modes_used.astype("int64").assign_attrs(dataset.modes_used.attrs)
    assert "modes_used: expected int32, received int64" in found(dataset)
    dataset = march()
    dataset.support_max.attrs["units"] = "N"
    assert "support_max: expected units = 'N m', received 'N'" in found(dataset)
    dataset = march()
    del dataset.support_max.attrs["long_name"]
    assert "support_max: expected the attribute long_name" in found(dataset)
    dataset = march()
    dataset.status.attrs["flag_values"] = np.arange(1, 8, dtype=np.int8)
    assert "status: expected flag_values" in found(dataset)


def test_flags_may_have_been_added_since():
    dataset = march()
    scheme = dataset.scheme_used.attrs
    words = scheme["flag_meanings"].split()[:-1]
    scheme |= {"flag_values": scheme["flag_values"][:-1], "flag_meanings": " ".join(words)}
    assert found(dataset) == ""
    scheme["flag_meanings"] = " ".join(reversed(words))
    assert "scheme_used: expected flag_meanings" in found(dataset)


def test_nan_needs_a_status_that_explains_it():
    dataset = march()
    dataset.midspan_rms[1, 2] = np.nan
    assert found(dataset) == "midspan_rms: expected numbers where the status keeps them, received NaN at (1, 2)"
    dataset.midspan_max_position[0, 0] = np.nan  # off the body: allowed
    for name, variable in dataset.data_vars.items():
        if variable.dtype.kind == "f":
            dataset[name][1, 2] = np.nan
    dataset.status[1, 2] = 3
    assert "(1, 2)" in found(dataset)
    dataset.status[1, 2] = 5
    assert found(dataset) == ""


def test_numbers_of_a_failed_variant_and_infinite_ones_are_found():
    dataset = march()
    dataset.status[0, 1] = 4
    assert "midspan_max: expected NaN where the status keeps no values, received numbers at (0, 1)" in found(dataset)
    dataset = march()
    dataset.support_min[0, 0] = np.inf
    assert "support_min: expected finite numbers or NaN, received 1 infinite" in found(dataset)


def test_the_status_of_a_history_is_that_of_its_variant():
    dataset = with_histories(march(), (0, 5))
    dataset.midspan[1, 3] = np.nan  # a gap, such as a sensor under a carriage has off the body
    assert "midspan:" not in found(dataset)
    dataset.midspan[1] = np.nan
    assert "midspan: expected numbers" in found(dataset)
    dataset.status[1, 2] = 5  # flat number 5 in a grid of 4 x 3
    dataset.midspan[1] = np.nan
    assert "midspan:" not in found(dataset)
    assert "support: expected NaN" in found(dataset)


def test_coordinates_are_complete_and_without_fill_value():
    dataset = march()
    dataset.speed.encoding["_FillValue"] = np.nan
    dataset.mass.attrs.clear()
    dataset.speed_ratio.attrs["units"] = "m"
    text = found(dataset)
    for finding in (
        "speed: expected a coordinate without _FillValue",
        "mass: expected the attribute units",
        "mass: expected the attribute long_name",
        "speed_ratio: expected units = '1', received 'm'",
    ):
        assert finding in text


def test_many_places_are_counted_not_listed():
    dataset = march()
    dataset.midspan_max[:] = np.nan
    assert "and 9 more" in found(dataset)
