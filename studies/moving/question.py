"""What studies of bodies in moving frames are asked: the table [question]."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from engine.scene.study import Study
from engine.study_file.spec import Spec
from engine.study_file.units import Angle, Force, Length, Time, Torque
from studies.findings.beyond import Limits


class AfterStop(Spec):
    """Limits of readings from then on where what moves a place has come to its end."""

    position_error: Annotated[Length, Field(gt=0)] | None = None


class Question(Limits):
    """The table [question]. duration: s, of the march. The limits: of absolute values, of which is told for every
    sensor of that quantity from which swept value on they are exceeded; residual: of those after the stop;
    settling_time: of how long position errors take to settle."""

    duration: Time = Field(gt=0)
    position_error: Annotated[Length, Field(gt=0)] | None = None
    drive_torque: Annotated[Torque, Field(gt=0)] | None = None
    drive_force: Annotated[Force, Field(gt=0)] | None = None
    joint_angle: Annotated[Angle, Field(gt=0)] | None = None
    joint_displacement: Annotated[Length, Field(gt=0)] | None = None
    residual: AfterStop = AfterStop()
    settling_time: Annotated[Time, Field(gt=0)] | None = None


def check_residual(study: Study, asked: Question) -> None:
    """Refuse limits of what nothing reads. Raises BadInput."""
    if asked.settling_time is not None and all(one.settling_band is None for one in study.sensor.values()):
        what = "a limit of settling times, of which no sensor has one"
        raise study.source.fault("question.settling_time", what, expected="a settling_band of a sensor")
    if asked.residual.position_error is not None and not any(one.reads.of_arm for one in study.sensor.values()):
        raise study.source.fault(
            "question.residual.position_error",
            "a limit of position errors, which no sensor reads",
            expected='a sensor with quantity = "position_error"',
        )
