import numpy as np
import pytest

from results_schema.errors import ArchiveError
from results_schema.validate import findings_of, validate
from results_schema.variables import expand
from tests.schema.samples import CARRIAGES, SENSORS, groups, march, with_histories


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
