"""Numbers with units: exact, of the right dimension, or refused."""

import math
import subprocess
import sys
from typing import Any

import pytest
from pydantic import Field, ValidationError
from pydantic_core import PydanticCustomError

from engine.study_file import units
from engine.study_file.spec import Spec
from engine.study_file.units import (
    KNOWN,
    Acceleration,
    Angle,
    AngularRate,
    Area,
    Damping,
    Density,
    Dimensionless,
    Force,
    Frequency,
    Length,
    Mass,
    Pressure,
    RotationalStiffness,
    SecondMoment,
    Speed,
    Stiffness,
    Time,
    unit_of,
)


class Thing(Spec):
    length: Length = Field(gt=0)


@pytest.mark.parametrize(
    ("unit", "text", "value"),
    [
        (Length, "15 m", 15.0),
        (Length, "15m", 15.0),
        (Length, " 1.5e1  m ", 15.0),
        (Length, "-3 mm", -0.003),
        (Length, "480 in", 480 * 0.0254),
        (Area, "100 cm^2", 0.01),
        (Area, "100 cm2", 0.01),
        (SecondMoment, "833 cm⁴", 8.33e-6),
        (SecondMoment, "833 cm**4", 8.33e-6),
        (Pressure, "210 GPa", 210e9),
        (Pressure, "0.1 N/mm^2", 1e5),
        (Density, "7.85 t/m^3", 7850.0),
        (Mass, "0.1 t", 100.0),
        (Force, "1 kg m/s^2", 1.0),
        (Speed, "200 km/h", 200 / 3.6),
        (Acceleration, "981 cm/s/s", 9.81),
        (Stiffness, "200 kN/mm", 2e8),
        (RotationalStiffness, "2 kN m/rad", 2000.0),
        (RotationalStiffness, "1 N m/deg", 180.0 / math.pi),
        (Angle, "90 deg", math.pi / 2.0),
        (Angle, "-30 °", -0.5235987755982989),
        (Angle, "1 mrad", 1e-3),
        (AngularRate, "6 rad/s", 6.0),
        (AngularRate, "30 rpm", math.pi),
        (AngularRate, "180 deg/s", math.pi),
        (RotationalStiffness, "2 kN m", 2000.0),
        (RotationalStiffness, "1 N·m/deg", 180 / math.pi),
        (Damping, "3 kN s/m", 3000.0),
        (Time, "100 ms", 0.1),
        (Frequency, "2 kHz", 2000.0),
        (Frequency, "60 rpm", 1.0),
        (Frequency, "1 rad/s", 1 / (2 * math.pi)),
        (Frequency, "3 1/s", 3.0),
        (Dimensionless, "5 %", 0.05),
        (Dimensionless, "2 percent", 0.02),
    ],
)
def test_values_are_rounded_once(unit: Any, text: str, value: float) -> None:
    assert unit_of(unit).si(text) == value


@pytest.mark.parametrize(
    ("unit", "text", "words"),
    [
        (Length, "15 kg", ["a mass (kg)", "a length (m)"]),
        (Mass, "15 N", ["a force (N)", "a mass (kg)"]),
        (Length, "15 s^3", ["s3", "a length (m)"]),
        (Length, "15 rad", ["an angle (rad)", "a length"]),
        (Dimensionless, "3 deg", ["plain number"]),
        (Length, "15", ["no unit"]),
        (Length, "", ["not a length"]),
        (Length, "m", ["not a length"]),
        (Length, "nan m", ["not a length"]),
        (Length, "1e999 m", ["1e-50 to 1e+30"]),
        (Length, "1e-999 m", ["1e-50 to 1e+30"]),
        (Length, "1 furlongg", ["no such unit"]),
        (Length, "1 m/", ["breaks off"]),
        (Length, "2**9 m", ["no such unit"]),
        (Length, "9**9**9**9 m", ["no such unit"]),
        (Length, "1 m*__import__('os')", ["no such unit"]),
        (Length, "1 " + "m*" * 60 + "m", ["not a length"]),
        (Mass, "20 degC", ["not a mechanical unit"]),
        (Mass, "10 tons", ["several sizes", "1,000 kg"]),
        (Dimensionless, "3 dB", ["no such unit"]),
    ],
)
def test_refusals(unit: Any, text: str, words: list[str]) -> None:
    with pytest.raises(ValueError) as error:
        unit_of(unit).si(text)
    message = f"{error.value} {error.value.context}"  # type: ignore[attr-defined]
    assert all(word in message for word in words), message


def test_numbers_are_si_already() -> None:
    assert Thing(length=15).length == 15.0
    assert isinstance(Thing(length=15).length, float)


@pytest.mark.parametrize("value", [True, None, "12", [1.0], {}, float("nan"), float("inf"), 0, "0 m", "-1 m", 10**400])
def test_strict(value: object) -> None:
    with pytest.raises(ValidationError):
        Thing(length=value)


def test_every_dimension_reads_its_own_symbol() -> None:
    for unit in KNOWN:
        if unit.symbol:
            assert unit.si(f"3 {unit.symbol.replace(' ', '*')}") == 3.0, unit


def test_pint_says_the_same_of_common_units() -> None:
    assert {name: units._named_by_pint(name) for name in units._COMMON} == units._COMMON


def test_pint_is_imported_only_for_uncommon_units() -> None:
    code = (
        "import sys; from engine.scene.study import Study; "
        "Study(kind='passage', gravity='9.81 m/s^2'); assert 'pint' not in sys.modules; "
        "assert not {'scipy', 'xarray', 'dask', 'numba', 'matplotlib'} & set(sys.modules); "
        "Study(kind='passage', gravity='32.17 ft/s^2'); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# dimension, text -> what the refusal says, its remedy
E_TIMES_I = (
    "a bending stiffness (N m2) where a pressure (Pa) is wanted",
    'N m2 is E I, of which each has a key; a beam may have second_moment = "1 m4" with all of it in Pa',
)
CONFUSED = {
    (Density, "9 t/m"): (
        "a quantity in kg/m where a density (kg/m3) is wanted",
        'divide it by the area; a beam may have area = "1 m2" with density = "9000 kg/m3"',
    ),
    (Acceleration, "0.35 g"): (
        "a mass (kg) where an acceleration (m/s2) is wanted",
        'g is gram; 0.35 g of gravity is "3.43 m/s2"',
    ),
    (Pressure, "8e10 Nm2"): E_TIMES_I,
    (Pressure, "8e10 N m^2"): E_TIMES_I,
    (Force, "190 kn"): ("a speed (m/s) where a force (N) is wanted", 'did you mean "190 kN"?'),
    (Stiffness, "190 kn/m"): ("a frequency (Hz) where a stiffness (N/m) is wanted", 'did you mean "190 kN/m"?'),
    (Mass, "3 m"): ("a length (m) where a mass (kg) is wanted", ""),
    (Stiffness, "rigid"): (
        "this text is not a stiffness (N/m)",
        'a number large against what it supports, such as "1e12 N/m", or a frame with a held node',
    ),
    (Force, "rigid"): ("this text is not a force (N)", ""),
}


@pytest.mark.parametrize(("unit", "text"), CONFUSED)
def test_other_quantities_are_refused_in_units_as_people_type_them(unit: Any, text: str) -> None:
    with pytest.raises(PydanticCustomError) as refused:
        unit_of(unit).si(text)
    said = refused.value.context
    assert said is not None
    assert (said["what"], said["remedy"]) == CONFUSED[unit, text]


@pytest.mark.parametrize(
    "unit", [unit for unit in KNOWN if unit.symbol and not unit.per_turn], ids=lambda one: one.noun
)
def test_units_are_told_as_they_can_be_typed(unit: units.Unit) -> None:
    assert "-" not in unit.typed
    assert unit.si(f"3 {unit.typed}") == 3.0
