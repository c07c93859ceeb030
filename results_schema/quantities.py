"""What a sensor can read: one row for every quantity, from which everything else follows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from results_schema.registry import Pieces, no_row_of


class UniformSection(Protocol):
    """The section of a uniform beam; NaN where there is none."""

    @property
    def bending_stiffness(self) -> float:
        """E I, N m2."""

    @property
    def second_moment(self) -> float:
        """m4."""

    @property
    def fibre_distance(self) -> float:
        """m."""


@dataclass(frozen=True)
class Quantity:
    """A quantity that sensors read: a derivative of the deflection w by the place along the track, or by time.

    unit: CF. derivative: its order by the place; rate: by time, of the point that a sensor reads, wherever that moves.
    factor: what the derivative is multiplied by. of_section: a section force, stress or strain, which bodies other than
    a uniform beam tell by its name. needs_fibre: it needs the fibre distance. of_mass: a sprung mass has it as well.
    of_contact: no motion, but the force between a carriage and its body; of_suspension: the part of it that its spring
    and damper pass on, less what they carry at rest. of_support: no motion, but what a support
    carries; turns: its moment about a direction. of_arm: no deflection of its body, but how far a point is from where
    the rigid arm would have it, whose joints are where their motions say. of_drive: what the drive of a joint of its
    body exerts; of_joint: how far a joint of its body has turned or slid. told: its error makes no status, as forces
    that enter excite every mode. meant: other words for it.
    """

    name: str
    unit: str
    derivative: int = 0
    rate: int = 0
    factor: Callable[[UniformSection], float] = lambda section: 1.0
    of_section: bool = False
    needs_fibre: bool = False
    of_mass: bool = False
    of_contact: bool = False
    of_suspension: bool = False
    of_support: bool = False
    turns: bool = False
    of_arm: bool = False
    of_drive: bool = False
    of_joint: bool = False
    told: bool = False
    meant: tuple[str, ...] = ()

    @property
    def has_kinks(self) -> bool:
        """Whether its influence line has a kink or a jump where it is read."""
        return self.of_section or self.derivative > 1

    @property
    def at_joint(self) -> bool:
        """Whether it is that of a joint, and of no place of a track."""
        return self.of_drive or self.of_joint

    @property
    def of_tree(self) -> bool:
        """Whether bodies have it only where they hang on joints, as a tree."""
        return self.of_arm or self.at_joint

    @property
    def order(self) -> int:
        """Of the derivative by the place by which it converges with modes: what supports carry is as a shear force."""
        return 3 if self.of_support else self.derivative


def _bending(section: UniformSection) -> float:
    return -section.bending_stiffness  # M = -E I w'', V = dM/ds


def _stress(section: UniformSection) -> float:
    return -section.bending_stiffness * section.fibre_distance / section.second_moment


_ROWS = (
    Quantity("displacement", "m", of_mass=True, meant=("deflection",)),
    Quantity("position_error", "m", of_arm=True, meant=("tip-error", "path-error", "deviation", "tracking-error")),
    Quantity("drive_torque", "N m", of_drive=True, told=True, meant=("torque", "joint-torque", "motor-torque")),
    Quantity("drive_force", "N", of_drive=True, told=True, meant=("joint-force", "motor-force")),
    Quantity("joint_angle", "rad", of_joint=True, meant=("hinge-angle", "swing-angle")),
    Quantity("joint_displacement", "m", of_joint=True, meant=("joint-shift", "stroke", "extension")),
    Quantity("rotation", "rad", 1, meant=("end-rotation", "angle", "tilt")),
    Quantity("velocity", "m s-1", rate=1, of_mass=True, told=True),
    Quantity("acceleration", "m s-2", rate=2, of_mass=True, told=True),
    Quantity("bending_moment", "N m", 2, factor=_bending, of_section=True, meant=("moment",)),
    Quantity("shear_force", "N", 3, factor=_bending, of_section=True, meant=("shear",)),
    Quantity("axial_force", "N", 1, of_section=True, meant=("normal-force",)),
    Quantity("stress", "Pa", 2, factor=_stress, of_section=True, needs_fibre=True),
    Quantity("strain", "1", 2, factor=lambda section: -section.fibre_distance, of_section=True, needs_fibre=True),
    Quantity("contact_force", "N", of_contact=True, told=True),
    Quantity("suspension_force", "N", of_contact=True, of_suspension=True, told=True, meant=("spring-force",)),
    Quantity("support_reaction", "N", of_support=True, meant=("reaction", "support-force", "bearing-force")),
    Quantity("support_moment", "N m", of_support=True, turns=True, meant=("clamping-moment", "fixing-moment")),
)


def _missing(piece: Any) -> list[str]:
    """What bodies, carriages and arms tell by name is the program's own."""
    own = ("of_section", "of_contact", "of_suspension", "of_support", "of_arm", "of_drive", "of_joint")
    return no_row_of(Quantity)(piece) or [f"{key} = False" for key in own if getattr(piece, key)]


#: After the name of a sensor of an arm: what it reads from then on where the joints that carry it stand still.
AFTER_STOP = "_after_stop"
QUANTITIES = Pieces(
    group="wanderlast.quantities",
    noun="quantity",
    own={row.name: row for row in _ROWS},
    wanted="a Quantity of results_schema.quantities",
    missing=_missing,
)
OF_SECTION = tuple(row.name for row in _ROWS if row.of_section)
MEANT = {word: row.name for row in _ROWS for word in row.meant}
