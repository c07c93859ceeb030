"""What bodies in frames that move do not know, refused before anything is computed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from engine.floating.bodies.fields import ABOUT_X, Z
from engine.scene.frames import GROUND, Frame, Free
from engine.scene.motions.along_bodies import MOTIONS

if TYPE_CHECKING:
    from engine.floating.model import FloatingModel
    from engine.scene.carriages import Carriage
    from engine.scene.sensors import Sensor
    from engine.scene.study import Study

HELD = 1e-9  # of the largest: a shape below is zero
#: What the archive has of every carriage, by what sensors would read of it, and of its body where it stands.
OF_CARRIAGE, UNDER_CARRIAGE = {"contact_force": "contact_force"}, {"acceleration": "acceleration_z"}
MOST_CYCLES = 1000  # of a carriage that goes out and back: a variant holds all its pieces


def refuse_scene(study: Study) -> None:
    """Raise BadInput for what a study has that frames that move do not know."""
    fault = study.source.fault
    if study.initial == "equilibrium":
        _check_rests(study)
    for name, body in study.body.items():
        if not body.own_weight and "own_weight" in body.model_fields_set and study.gravity > 0.0:
            what = "bodies in frames that move carry their own weight"
            raise fault(f"body.{name}.own_weight", what, expected="true, or the key left out")
    for name, carriage in study.carriage.items():
        _check_carriage(study, name, carriage)
    for name, sensor in study.sensor.items():
        _check_sensor(study, name, sensor)


def _check_rests(study: Study) -> None:
    """Refuse what does not stay where it starts, or starts elsewhere than in equilibrium."""
    fault = study.source.fault
    for name, frame in study.frame.items():
        for k, joint in enumerate(frame.joints):
            here = f"frame.{name}.joints.{k}"
            if not joint.is_held:
                what = "no equilibrium is known where nothing holds this joint"
                expected = 'a motion or a stiffness of it, or initial = "rest"'
                raise fault(here, what, expected=expected, received=joint.kind)
            if joint.told_start:
                what = "a joint that starts in equilibrium is told no other start"
                raise fault(f"{here}.{joint.told_start}", what, expected='no such key, or initial = "rest"')
    for name, carriage in study.carriage.items():
        if carriage.motion.slides:
            what = "no equilibrium is known of a carriage that slides freely"
            raise fault(f"carriage.{name}.motion.kind", what, expected='another motion, or initial = "rest"')


def _check_carriage(study: Study, name: str, carriage: Carriage) -> None:
    """Refuse a carriage of another kind, with another motion, or that starts later."""
    fault, here, motion = study.source.fault, f"carriage.{name}", carriage.motion
    if carriage.kind not in ("mass", "oscillator"):
        what = "carriages of this kind on bodies in frames that move are not built yet"
        raise fault(f"{here}.kind", what, expected="mass or oscillator", received=carriage.kind)
    if not motion.slides and not motion.in_pieces:
        what = "this motion on bodies in frames that move is not built yet"
        known = ", ".join(kind for kind, one in MOTIONS.own.items() if one.slides or one.in_pieces)
        raise fault(f"{here}.motion.kind", what, expected=known, received=motion.kind)
    if motion.legs is not None and motion.duration > MOST_CYCLES:
        what, received = "too many cycles on a body in a frame that moves", f"{motion.duration:.0f}"
        raise fault(f"{here}.motion.cycles", what, expected=f"at most {MOST_CYCLES}", received=received)
    if carriage.start_time > 0.0:
        raise fault(f"{here}.delay", "carriages here set off at time 0", expected="0")


def _check_sensor(study: Study, name: str, sensor: Sensor) -> None:
    """Refuse a sensor of another place or quantity."""
    fault, here = study.source.fault, f"sensor.{name}"
    if sensor.reads.of_support:
        raise fault(f"{here}.quantity", "supports of bodies in frames that move are not read", expected="displacement")
    if sensor.carriage is not None:
        _refuse_of_carriage(study, here, sensor.quantity, sensor.carriage, OF_CARRIAGE)
    if sensor.spot is not None:
        raise fault(here, "this place is not read in frames that move", expected="at, or under")
    if sensor.frequency_limit is not None:
        raise fault(f"{here}.frequency_limit", "sensors in frames that move read all modes", expected="no such key")
    if sensor.is_dynamic_part:
        what = "in frames that move the whole is read, not its dynamic part"
        raise fault(f"{here}.part", what, expected="no such key")
    if sensor.side is not None:
        what = f"in frames that move nothing is read {sensor.side} a track"
        expected, remedy = "no such key", 'quantity = "position_error" at a place of the track takes a direction'
        raise fault(f"{here}.direction", what, expected=expected, remedy=remedy)
    if sensor.reads.at_joint:
        _check_joint(study, name, sensor)
    if sensor.under is not None and sensor.quantity != "displacement":
        _refuse_of_carriage(study, here, sensor.quantity, sensor.under, UNDER_CARRIAGE)


#: What is read of joints, of which, what is said of none, and the quantities of those that turn and that slide.
OF_DRIVES = "drive", "with a motion", "none has one", "drive_torque", "drive_force"
OF_JOINTS = "angle", "about or along an axis that no drive holds", "none is", "joint_angle", "joint_displacement"


def _check_joint(study: Study, name: str, sensor: Sensor) -> None:
    """Refuse what is read of a joint that is not there, or moves otherwise."""
    fault, on = study.source.fault, str(sensor.body)
    frame = study.frame.get(on) or Frame()
    whose, such, none, turning, sliding = OF_DRIVES if sensor.reads.of_drive else OF_JOINTS
    pick = frame.driven if sensor.reads.of_drive else frame.left_to_move
    found = pick(sensor.joint)
    if len(found) != 1:
        number = "" if sensor.joint is None else f" {sensor.joint}"
        what = f"the joint{number} of {on} whose {whose} this reads is not one {such}"
        known = ", ".join(map(str, pick(None)))
        expected = f"joint: of frame.{on}.joints, counted from 0, one {such}: {known or none}"
        received = f"{len(found)} such" if sensor.joint is None else f"joint = {sensor.joint}"
        raise fault(f"sensor.{name}.joint", what, expected=expected, received=received)
    turns = study.frame[on].joints[found[0]].turns
    wanted = turning if turns else sliding
    if sensor.quantity != wanted:
        what = f"frame.{on}.joints.{found[0]} {'turns' if turns else 'slides'}"
        raise fault(f"sensor.{name}.quantity", what, expected=wanted, received=sensor.quantity)


def _refuse_of_carriage(study: Study, here: str, quantity: str, carriage: str, known: Mapping[str, str]) -> None:
    """What a sensor does not read of a carriage: either the archive has it of every carriage, or nobody tells it."""
    what = "of a carriage in frames that move only the displacement under it is read here"
    expected, remedy = f'quantity = "displacement" and under = "{carriage}"', "other quantities at a place of its track"
    if quantity in known:
        found = f"{carriage}_{known[quantity]}"
        what = (
            f"in frames that move the archive has the {quantity.replace('_', ' ')} of every carriage without a sensor"
        )
        expected, remedy = "no such sensor", f"{found}_max, {found}_min and the history {found} in the archive"
    raise study.source.fault(f"{here}.quantity", what, expected=expected, received=quantity, remedy=remedy)


def refuse_model(model: FloatingModel) -> None:
    """Raise BadInput for a body that its joints cannot hold, or on which nothing can turn, and for a sensor of an arm
    without a rigid one to compare it with."""
    _check_held(model)
    _check_rolling(model)
    _check_arms(model)


def _check_held(model: FloatingModel) -> None:
    """A frame sits where the shapes of its body vanish, unless that moves freely or has supports elsewhere, and a joint
    that is driven or controlled about an axis holds the track's direction; what is pinned there alone turns freely."""
    for name, body in model.bodies.items():
        joints = model.frame(name).joints
        if not body.omega.size or not body.slender or any(isinstance(joint, Free) for joint in joints):
            continue
        at = body.fields(np.zeros(1), (0,))[0, 0]
        far = np.abs(body.fields(np.linspace(0.0, body.length, 9), (0,))[0, :, : Z + 1]).max()
        fault, here = model.study.source.fault, f"body.{name}.supports"
        if np.abs(at[: Z + 1]).max() > HELD * far:
            what = "the track begins where its joint holds it: its shapes must vanish there"
            raise fault(here, what, expected="pinned or clamped at its beginning")
        innermost = next((joint for joint in reversed(joints) if joint.turns), None)
        axis = None if innermost is None else innermost.turned_about
        if axis is not None and np.abs(axis @ at[ABOUT_X:]).max() > HELD * far * np.linalg.norm(axis) / body.length:
            what = "a joint that is driven or controlled holds the track's direction: shapes must not turn there"
            remedy = "a rigid body on the joint that carries this one, for a beam in a cradle"
            raise fault(here, what, expected="clamped at its beginning", remedy=remedy)
        pinned = (
            body.modal is not None and body.modal.rigid_modes and np.abs(at[ABOUT_X:]).max() * body.length > HELD * far
        )
        if pinned and not any(joint.turns_freely for joint in joints):
            what = "it turns about its pin, and no joint lets it turn without a motion, a spring or a damper"
            raise fault(here, what, expected="clamped at its beginning, or a joint that turns freely")


def _check_rolling(model: FloatingModel) -> None:
    """Nothing turns with a track whose rotation about itself no row of its model tells."""
    fault = model.study.source.fault
    for name, carriage in model.study.carriage.items():
        is_mass = carriage.suspension is None  # what is sprung has neither key
        turns = is_mass and any(model.study.value(f"carriage.{name}.{key}") for key in ("inertia", "height"))
        if turns and not model.bodies[carriage.on].rolls:
            what = "a solid model's rotation about its track is not known: nothing turns with it"
            raise fault(f"carriage.{name}", what, expected="no inertia and no height")
    for name in model.bodies:
        on = model.frame(name).on
        if on != GROUND and not model.bodies[on].rolls:
            what = "a solid model's rotation about its track is not known: nothing hangs on it"
            expected = "a beam, a frame of beams, or a rigid body"
            raise fault(f"frame.{name}.on", what, expected=expected, received=on)


def _check_arms(model: FloatingModel) -> None:
    """The rigid arm is known where motions tell all joints that carry a tip."""
    for sensor, spec in model.tips.items():
        carriers = {name: model.frame(name).joints for name in model.carriers(str(spec.body))}
        untold = [(name, k) for name, own in carriers.items() for k, joint in enumerate(own) if not joint.is_told]
        for name, number in untold[:1]:
            what = f"no motion tells frame.{name}.joints.{number}, and so not where the rigid arm would be"
            expected = f"a motion of every joint that carries {spec.body}, which drives or steers it"
            remedy = 'a motion of this joint, or quantity = "displacement", which counts from the frame of its body'
            here = f"sensor.{sensor}.quantity"
            raise model.study.source.fault(here, what, expected=expected, received=spec.quantity, remedy=remedy)
