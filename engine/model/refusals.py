"""What scenes whose bodies stand refuse of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.scene.study import Study


FRAMES = ("moving-frames", "sliding-mass")  # kinds of study in which bodies move


def check_stands(study: Study) -> None:
    """Refuse what belongs to bodies whose frames move, and carriages that slide or turn by themselves. Raises
    BadInput."""
    movers = [f"frame.{name}" for name in study.frame]
    movers += [f"{table}.{name}" for table in ("load", "spring") for name in getattr(study, table)]
    movers += [f"carriage.{name}.motion" for name, carriage in study.carriage.items() if carriage.motion.slides]
    if movers and study.kind in FRAMES:
        what = "this march is that of bodies that stand, and here they move"
        raise study.source.fault(movers[0], what, expected="studies.run, which knows this kind of study")
    if movers:
        what = f"in studies of the kind {study.kind} bodies stand, and carriages go where they are told"
        raise study.source.fault(movers[0], what, expected=f'kind = "{FRAMES[0]}"')
    swept = {key for axis in study.sweep.axes.values() for key in axis.of}
    for name, carriage in study.carriage.items():
        own = (
            key for key in carriage.in_frames_that_move if getattr(carriage, key) or f"carriage.{name}.{key}" in swept
        )
        for key in own:
            what = f"in studies of the kind {study.kind} a mass does not turn with its track"
            remedy = f'a body on contacts has an inertia; kind = "{FRAMES[0]}"'
            raise study.source.fault(f"carriage.{name}.{key}", what, expected="left out", remedy=remedy)
    for name, sensor in study.sensor.items():
        if sensor.reads.of_tree:
            what = f"in studies of the kind {study.kind} bodies stand: no joints carry an arm"
            expected = f'kind = "{FRAMES[0]}", or quantity = "displacement"'
            raise study.source.fault(f"sensor.{name}.quantity", what, expected=expected, received=sensor.quantity)


def check_moves(study: Study) -> None:
    """Refuse a study without a carriage, or in which bodies do not stand. Raises BadInput."""
    check_stands(study)
    if not study.carriage:
        raise study.source.fault("carriage", "nothing moves", expected="at least one table [carriage.name]")


def check_rigid_modes(model: SceneModel) -> None:
    """A body that nothing holds has no static equilibrium and no sag, and needs a mode that bends."""
    riding = {carriage.rides for carriage in model.carriages}
    for number, part in enumerate(model.bodies):
        if part.name in model.study.frame:  # its frame moves, or holds it
            continue
        where = model.study.source.where(f"body.{part.name}.supports")
        if part.modal.rigid_modes and part.own_weight:
            raise BadInput(
                "nothing holds this body fully, so its own weight has no static state",
                where=where,
                remedy='supports that hold every direction, such as supports.NODE = ["x"] of a frame that may slide; '
                "bodies that ride take own_weight = false",
            )
        if part.own_weight and part.modal.unknown_weight:
            raise model.study.source.fault(
                f"body.{part.name}.own_weight",
                part.modal.unknown_weight,
                expected="own_weight = false, or a model whose nodes on springs are kept when it is reduced",
            )
        if number in riding:
            continue
        if part.modal.rigid_modes == len(part.modal.omega):
            what, expected = "only rigid-body modes are kept", f"more than {part.modal.rigid_modes} modes"
            raise model.study.source.fault(f"body.{part.name}.modes", what, expected=expected)
        if part.modal.rigid_modes and model.study.start == "equilibrium":
            free = f"{part.modal.rigid_modes} rigid motion{'s' if part.modal.rigid_modes > 1 else ''}"
            what = f"nothing holds this body against {free}, so it has no static equilibrium to start from"
            remedy = 'hold it, a frame that may slide by supports.NODE = ["x"], or set initial = "rest"'
            raise BadInput(what, where=where, expected="supports that hold it in every direction", remedy=remedy)
