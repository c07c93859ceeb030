"""Axes of a sweep, their cases, and faults 9, 10, 14 and 15."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.scene.study import Study, load
from engine.scene.sweep import Cases, expand
from results_schema.errors import BadInput
from tests.scene.sample import MINIMAL, SAMPLE

SPEED, MASS, RATIO = "carriage.table.motion.speed", "carriage.table.mass", "body.bed.damping_ratio"
HEAD, TAIL = SAMPLE.split("[sweep]")
BASE = f"{HEAD}\n[solver]{TAIL.split('[solver]')[1]}"


def sweep(text: str, base: str = BASE) -> Cases:
    return expand(load(f"{base}\n[sweep]\n{text}"))


def refused(text: str, base: str = BASE) -> str:
    with pytest.raises(BadInput) as error:
        sweep(text, base)
    return str(error.value)


def axis(name: str, path: str, rest: str) -> str:
    return f'{name} = {{ of = "{path}", {rest} }}'


def test_grid() -> None:
    axes = [
        axis("a", SPEED, 'values = [1, "7.2 km/h"]'),
        axis("b", MASS, "from = 1, to = 5, count = 3"),
        axis("c", RATIO, "values = [0, 0.5]"),
    ]
    study = load("\n".join([BASE, "[sweep]", *axes]))
    cases = expand(study)
    expected = list(product([1.0, 2.0], [1.0, 3.0, 5.0], [0.0, 0.5]))
    assert (cases.dims, cases.shape, cases.size) == (("a", "b", "c"), (2, 3, 2), 12)
    assert [axis.units for axis in cases.axes] == ["m s-1", "kg", ""]
    columns = cases.columns_of(np.arange(12))
    np.testing.assert_array_equal(np.array([columns[p] for p in (SPEED, MASS, RATIO)]).T, expected)
    for path in cases.paths:
        np.testing.assert_array_equal(cases.column(path), columns[path])
    for index, values in enumerate(expected):
        variant = cases.study_of(study, index)
        assert tuple(variant.value(path) for path in (SPEED, MASS, RATIO)) == values
        assert not variant.sweep.axes


def test_equal_spacing_meets_the_numbers_that_people_type() -> None:
    """So that they find them in a dataset; what has no few digits, ends and proportional spacing stay as they are."""
    found = sweep(
        "\n".join(
            [axis("a", SPEED, "from = 0.3, to = 1.5, count = 13"), axis("b", MASS, "from = 1, to = 2, count = 4")]
        )
    )
    speeds, masses = (found.axes[place].values for place in (0, 1))
    assert speeds.tolist() == [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5]
    assert masses.tolist() == np.linspace(1.0, 2.0, 4).tolist()
    far = sweep(axis("a", SPEED, 'from = 1e-3, to = 10, count = 7, spacing = "log"')).axes[0].values
    assert far.tolist() == np.geomspace(1e-3, 10.0, 7).tolist()


def test_no_sweep() -> None:
    cases = expand(load(MINIMAL))
    assert (cases.dims, cases.shape, cases.size, cases.paths) == ((), (), 1, ())
    assert cases.columns_of([0]) == {} and cases.values_of(0) == {}


@pytest.mark.fault(14)
def test_a_million_cases() -> None:
    paths = {"a": SPEED, "b": MASS, "c": RATIO}
    cases = sweep("\n".join(axis(name, path, "from = 0.01, to = 0.1, count = 100") for name, path in paths.items()))
    assert cases.size == 10**6
    assert cases.columns_of([999_999])[RATIO] == 0.1


def test_several_keys_on_one_axis() -> None:
    cases = sweep(f'a = {{ of = ["{MASS}", "carriage.gripper.mass"], values = [3, 4] }}')
    columns = cases.columns_of([0, 1])
    np.testing.assert_array_equal(columns[MASS], [3, 4])
    np.testing.assert_array_equal(columns["carriage.gripper.mass"], [3, 4])


def test_every_number_can_be_swept() -> None:
    study = load(SAMPLE)
    for path, value in study.numbers().items():
        cases = sweep(f'a = {{ of = "{path}", values = [{value!r}] }}')
        assert cases.columns_of([0])[path] == value
        assert type(cases.values_of(0)[path]) is type(value)
        assert cases.study_of(study, 0).value(path) == value


def test_optional_numbers_can_be_swept() -> None:
    for path, value in [("gravity", "1 m/s^2"), ("solver.steps", 100), ("body.bed.modes", 3), (RATIO, 0.1)]:
        assert sweep(f'a = {{ of = "{path}", values = [{value!r}] }}', MINIMAL).paths == (path,)


def test_spacing() -> None:
    log = sweep(f'a = {{ of = "{SPEED}", from = 0.5, to = 10, count = 9, spacing = "log" }}').axes[0].values
    np.testing.assert_allclose(log[1:] / log[:-1], 20 ** (1 / 8), rtol=1e-13)
    assert (log[0], log[-1]) == (0.5, 10.0)
    down = sweep(f'a = {{ of = "{SPEED}", from = 3, to = 1, count = 3 }}').axes[0].values
    np.testing.assert_array_equal(down, [3.0, 2.0, 1.0])
    whole = sweep('a = { of = "body.bed.modes", from = 2, to = 10, count = 5 }').axes[0].values
    assert whole.dtype == np.int64
    np.testing.assert_array_equal(whole, [2, 4, 6, 8, 10])


def test_zip() -> None:
    cases = sweep(
        f'zip = true\na = {{ of = "{SPEED}", values = [1, 1, 3] }}\nb = {{ of = "{MASS}", values = [4, 5, 6] }}'
    )
    assert (cases.dims, cases.shape) == (("variant",), (3,))
    assert cases.values_of(2) == {SPEED: 3.0, MASS: 6.0}
    assert {axis.name for axis in cases.axes} == {"a", "b"}


def test_some_axes_are_paired_and_the_others_cross_them() -> None:
    """Own draws at every speed; of the place of an axis in the file only its dimension's place is a consequence."""
    cases = sweep(
        f'zip = ["a", "c"]\na = {{ of = "{LENGTH}", values = [15, 16, 17] }}\n'
        f'b = {{ of = "{SPEED}", values = [1, 2] }}\nc = {{ of = "{MASS}", values = [4, 5, 6] }}'
    )
    assert (cases.dims, cases.shape) == (("variant", "b"), (3, 2))
    assert [cases.values_of(n) for n in (0, 1, 4)] == [
        {LENGTH: 15, SPEED: 1, MASS: 4},
        {LENGTH: 15, SPEED: 2, MASS: 4},
        {LENGTH: 17, SPEED: 1, MASS: 6},
    ]
    lone = sweep(f'zip = ["a"]\na = {{ of = "{MASS}", values = [4, 5] }}\nb = {{ of = "{SPEED}", values = [1] }}')
    assert (lone.dims, lone.shape) == (("variant", "b"), (2, 1))


def test_directions_are_words_or_signs() -> None:
    for values in ('["forward", "backward"]', "[1, -1]"):
        (axis,) = sweep(f'way = {{ of = "carriage.table.motion.direction", values = {values} }}').axes
        assert axis.values.tolist() == [1, -1] and axis.values.dtype == np.int64


def test_sobol_is_joint_and_repeatable() -> None:
    text = "\n".join(f'{name} = {{ of = "{path}", from = 1, to = 9, sobol = 256{extra} }}'
                     for name, path, extra in [("a", SPEED, ""), ("b", MASS, ', spacing = "log"'),
                                               ("c", "body.bed.modes", "")])  # fmt: skip
    cases, again = sweep(text), sweep(text)
    assert cases.dims == ("variant",)
    a, b, c = (axis.values for axis in cases.axes)
    assert abs(np.corrcoef(a, np.log(b))[0, 1]) < 0.02
    assert np.bincount(((a - 1) // 2).astype(int), minlength=4).tolist() == [64, 64, 64, 64]
    assert abs(np.log(b).mean() - np.log(3)) < 0.01
    assert c.dtype == np.int64 and set(c) == set(range(1, 10))
    for one, two in zip(cases.axes, again.axes, strict=True):
        np.testing.assert_array_equal(one.values, two.values)
    longer = sweep(text.replace("256", "300")).axes[0].values
    np.testing.assert_array_equal(longer[:256], a)
    mixed = sweep(f'{text}\nd = {{ of = "gravity", values = [1, 2] }}')
    assert (mixed.dims, mixed.shape) == (("variant", "d"), (256, 2))


@pytest.mark.fault(9, 14, 15)
@pytest.mark.parametrize(
    ("text", "words"),
    [
        (axis("a", MASS, "values = [1, 2, -1]"), ["sweep.a.values.2", MASS, "> 0", "-1"]),
        (axis("a", MASS, 'values = [1, "2 m"]'), ["sweep.a.values.1", "a length (m)", "a mass (kg)"]),
        (axis("a", SPEED, "from = 0, to = 5, count = 3"), ["sweep.a.from", SPEED, "> 0"]),
        (axis("a", SPEED, "from = 0, to = 5, sobol = 3"), ["sweep.a.from", SPEED, "> 0"]),
        (axis("a", RATIO, "values = [0, -0.1]"), ["sweep.a.values.1", ">= 0"]),
        (axis("a", "body.bed.modes", "values = [1, 2.5]"), ["sweep.a.values.1", "integer"]),
        (axis("a", "body.bed.modes", "from = 1, to = 2, count = 3"), ["sweep.a.count", "fractions", "1.5"]),
        (axis("a", "body.bed.modes", "from = 1, to = 65, count = 65"), ["sweep.a.to", "<= 64"]),
        (axis("a", MASS, "values = []"), ["sweep.a.values", "at least 1"]),
        (axis("a", MASS, "values = [1, 2, 1.0]"), ["sweep.a", "entry 2 repeats entry 0"]),
        (axis("a", MASS, "from = 1, to = 1, count = 2"), ["sweep.a", "repeats"]),
        (axis("a", MASS, "from = 1, to = 2, count = 1"), ["sweep.a.count", "two ends"]),
        (axis("a", MASS, "from = 1, to = 2"), ["sweep.a", "exactly one way"]),
        (axis("a", MASS, "from = 1, count = 2"), ["sweep.a", "from and to"]),
        (axis("a", MASS, "values = [1], to = 2"), ["sweep.a", "from, to"]),
        (axis("a", "gravity", 'from = 0, to = 2, count = 3, spacing = "log"'), ["sweep.a.spacing", "positive"]),
        (axis("a", "carriage.table.mas", "values = [1]"), ["sweep.a.of", MASS]),
        (axis("a", "body.bed.own_weight", "values = [1]"), ["sweep.a.of", "no such number"]),
        (axis("a", "body.bed", "values = [1]"), ["sweep.a.of", "no such number"]),
        (axis("a", "nothing", "values = [1]"), ["sweep.a.of", "no such number"]),
        (axis("a", "frame.arm.turned.1", "values = [1]"), ["sweep.a.of", "no such number", "[frame.arm] missing?"]),
        (axis("a", "schema_version", "values = [1]"), ["sweep.a.of", "not part of the model"]),
        (axis("a", "sweep.a.values.0", "values = [1]"), ["sweep.a.of", "not part of the model"]),
        (f'a = {{ of = ["{MASS}", "gravity"], values = ["1 kg"] }}', ["sweep.a.values.0", "gravity", "a mass"]),
        (f'a = {{ of = ["{MASS}", "gravity"], values = [1] }}', ["sweep.a.of", "several dimensions", "gravity"]),
        ("\n".join([axis("a", MASS, "values = [1]"), axis("b", MASS, "values = [2]")]), ["sweep.b.of", "twice"]),
        (
            "\n".join(["zip = true", axis("a", MASS, "values = [1]"), axis("b", SPEED, "values = [1, 2]")]),
            ["sweep", "1 (a), 2 (b)"],
        ),
        (f'zip = ["b"]\n{axis("a", MASS, "values = [1]")}', ["sweep", "axes of this sweep: a", '"b"']),
        (
            "\n".join(['zip = ["a", "b"]', axis("a", MASS, "values = [1]"), axis("b", SPEED, "values = [1, 2]")]),
            ["sweep", "1 (a), 2 (b)"],
        ),
        (
            axis("a", "carriage.table.motion.direction", 'values = ["forwards"]'),
            ["sweep.a.values.0", '"forward" or "backward"', "forwards"],
        ),
        (axis("a", "carriage.table.motion.direction", "values = [2]"), ["sweep.a.values.0", "forward"]),
        (
            "\n".join(["zip = true", axis("a", MASS, "values = [1, 1]"), axis("b", SPEED, "values = [2, 2]")]),
            ["sweep", "repeat"],
        ),
        (
            "\n".join(
                [axis("a", MASS, "from = 1, to = 2, sobol = 8"), axis("b", SPEED, "from = 1, to = 2, sobol = 9")]
            ),
            ["sweep", "8 (a), 9 (b)"],
        ),
        (axis("status", MASS, "values = [1]"), ["sweep.status", "reserved"]),
        (axis("a", MASS, "from = 1, to = 2, count = 9000000000000000000"), ["sweep.a", "9000000000000000000"]),
        (
            "\n".join(
                [
                    axis("a", MASS, "from = 1, to = 2, count = 9000000"),
                    axis("b", SPEED, "from = 1, to = 2, count = 9000000"),
                ]
            ),
            ["9000000 (a) x 9000000 (b) = 81000000000000"],
        ),
    ],
)
def test_refusals(text: str, words: list[str]) -> None:
    message = refused(text)
    assert all(word in message for word in words), message


END, LENGTH = "carriage.table.motion.end", "body.bed.length"


@pytest.mark.fault(11)
def test_conditions_between_axes() -> None:
    base = BASE.replace("at = 14.9", "at = 8.0")
    ends = f'a = {{ of = "{END}", from = 10, to = 15, count = 6 }}'
    message = refused(f'{ends}\nb = {{ of = "{LENGTH}", values = [15, 14.5] }}', base)
    assert all(word in message for word in (END, "= 15", "= 14.5", "sweep.a entry 5", "sweep.b entry 1")), message
    assert sweep(
        f'zip = true\na = {{ of = "{END}", values = [14, 15] }}\nb = {{ of = "{LENGTH}", values = [15, 16] }}', base
    )
    same = refused('a = { of = "carriage.table.motion.start", from = 0, to = 14.7, count = 50 }')
    assert "same place" in same and "entry 49" in same
    assert "holds nothing" in refused('a = { of = "body.bed.supports.1.stiffness", values = [1, 0] }')
    times = 'a = { of = "carriage.gripper.motion.times.1", values = [1, 2, 3] }'
    assert "ascend" in refused(times)
    places = 'a = { of = "carriage.gripper.motion.positions.1", from = -20, to = 20, count = 500 }'
    assert sweep(places).size == 500
    away = BASE.replace("positions = [1.0, 7.0, 5.0]", "positions = [-5, 3, -7]")
    assert "never touches" in refused(places, away)


numbers = st.floats(-2.0, 18.0).map(lambda x: round(x, 1))


@given(st.lists(numbers, min_size=1, max_size=4, unique=True), st.lists(numbers, min_size=1, max_size=4, unique=True))
@settings(max_examples=50, deadline=None)
def test_a_grid_is_refused_exactly_if_one_variant_is(ends: list[float], lengths: list[float]) -> None:
    study = load(BASE.replace("at = 14.9", "at = 8.0"))
    data: dict[str, Any] = study.data | {
        "sweep": {"a": {"of": END, "values": ends}, "b": {"of": LENGTH, "values": lengths}}
    }

    def valid(end: float, length: float) -> bool:
        try:
            study.with_values({END: end, LENGTH: length})
        except BadInput:
            return False
        return True

    expected = all(valid(end, length) for end, length in product(ends, lengths))
    try:
        expand(Study(**data))
    except BadInput:
        assert not expected
    else:
        assert expected


def test_own_samples_are_read_again() -> None:
    """Of a Monte Carlo study from Python: its text of more than a megabyte goes through archives."""
    draw, size = np.random.default_rng(0), 20_000
    axes = {"a": (SPEED, 1.0, 10.0), "b": (MASS, 50.0, 200.0), "c": (RATIO, 0.01, 0.02)}
    swept = {name: {"of": path, "values": draw.uniform(low, high, size)} for name, (path, low, high) in axes.items()}
    study = Study(**load(BASE).data | {"sweep": {"zip": True} | swept})
    assert len(study.toml()) > 1_000_000
    again = load(study.toml())
    assert again == study and expand(again).size == size
