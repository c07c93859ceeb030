"""What all bodies share, as the user describes them: damping, number of modes, own weight."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field, PrivateAttr, Strict, Tag

from engine.bodies.modal.modal_body import Array, Direction, ModalBody
from engine.bodies.modal.outline import Outline, straight
from engine.bodies.modal.section_doubts import Doubt
from engine.study_file.checks import Check
from engine.study_file.document import Beside
from engine.study_file.spec import LIST, NUMBER, TABLE, Auto, Hint, Spec, SpecOfKind, by_amount_form, by_form, nearest
from engine.study_file.units import Dimensionless, Rate, Time
from results_schema.errors import BadInput, shortened

LEVEL = 1e-6  # cosine of the angle above which a vector has a part along the track
MAX_MODES = 64
AUTO_MODES = 12


class Rayleigh(Spec):
    """Damping a M + b K, a in 1/s and b in s: mode k has the ratio a/(2 omega_k) + b omega_k/2."""

    rayleigh: Annotated[tuple[Annotated[Rate, Field(ge=0)], Annotated[Time, Field(ge=0)]], Strict(False)]


Ratio = Annotated[Dimensionless, Field(ge=0, lt=1), Hint('a part of critical damping: 0.02 or "2 %"')]
Ratios = Annotated[tuple[Ratio, ...], Strict(False), Field(min_length=1, max_length=MAX_MODES)]
DampingRatio = Annotated[
    Annotated[Ratio, Tag(NUMBER)] | Annotated[Ratios, Tag(LIST)] | Annotated[Rayleigh, Tag(TABLE)], by_amount_form
]
Modes = Annotated[Auto | Annotated[int, Tag(NUMBER), Field(ge=1, le=MAX_MODES)], by_form]


@dataclass(frozen=True)
class Spot:
    """A place that a sensor reads off the track: a node (its name or number), a member with metres from its first node,
    or a point; and the direction that it reads, along gravity unless given. support: what the support at a node, or at
    metres along the track, carries is read there, not the motion; turns: its moment about the direction."""

    node: str | int | None = None
    member: str | None = None
    at: float = 0.0
    point: str | None = None
    direction: tuple[float, float, float] | None = None
    support: bool = False
    turns: bool = False

    @property
    def key(self) -> str:
        """The key of the sensor that names it."""
        return next((key for key in ("node", "member", "point") if getattr(self, key) is not None), "at")


Spots = tuple[tuple[str, Spot], ...]  # by the names of sensors


def check_square(direction: Direction, tangent: Array, load: Array, gravity: Array) -> None:
    """Raise BadInput for a track along, or across, which its loads or gravity act too; unit vectors (3,)."""
    if direction == "across":
        if abs(float(np.cross(load, tangent) @ gravity)) > LEVEL:
            expected = "a track whose loads act in the upright plane through it"
            raise BadInput("weights act across this track too", where="inertia_across", expected=expected)
        return
    for vector, what in ((gravity, "this track rises"), (load, "the loads of this track act along it too")):
        if abs(float(tangent @ vector)) > LEVEL:
            raise BadInput(what, where="inertia_along", expected="a level track with loads square to it")


def check_spot_name(key: str, name: object, names: Iterable[str]) -> None:
    """Raise BadInput where a sensor's key names a node, member or point that there is not."""
    known = list(names)
    if name is not None and name not in known:
        expected = f"one of {', '.join(known[:12])}" if known else "a body that has some"
        hint = nearest(name, known)
        raise BadInput(f"no such {key}", where=key, expected=expected, received=shortened(name), remedy=hint)


@dataclass(frozen=True)
class Recorded(Beside):
    """What an archive tells of a body that is made of files, so that they need not be read. length: of the track, m."""

    length: float


class Growing(NamedTuple):
    """Keys of numbers with which, set to one value, all stiffness of a body grows in proportion, and all its mass."""

    stiffness: tuple[tuple[str, ...], ...] = ()
    mass: tuple[tuple[str, ...], ...] = ()


class Body(SpecOfKind):
    """Base of all bodies: a track of some length along which loads ride.

    damping_ratio: of every mode, or one per mode, of which the last goes on, or Rayleigh's two numbers. modes: how many
    are kept. own_weight: gravity acts on the body too, and deflections count from the unstressed state. names_files:
    whether it is made of files.
    """

    names_files: ClassVar[bool] = False
    _recorded: Recorded | None = PrivateAttr(default=None)
    if TYPE_CHECKING:

        @property
        def length(self) -> float:
            """Of its track, m."""

    damping_ratio: DampingRatio = 0.0
    modes: Modes = "auto"
    own_weight: bool = False

    @property
    def grows_with(self) -> Growing:
        """The numbers that change no more of it than the units of time and force."""
        return Growing()

    @property
    def modal_masses(self) -> tuple[str, ...]:
        """Keys of its mass and its inertia, where each of its modes moves one of them alone and has a shape that is
        of neither; they may be 0 in a frame that moves."""
        return ()

    @property
    def is_free(self) -> bool:
        """Whether it is known that nothing holds it."""
        return False

    @property
    def recorded(self) -> Recorded | None:
        """What an archive tells of it, where it comes from one: then there are no files to read."""
        return self._recorded

    def take(self, context: object) -> bool:
        """Take what stands beside the table, where it comes from an archive; whether there was something."""
        self._recorded = context if isinstance(context, Recorded) else None
        return self._recorded is not None

    @abstractmethod
    def build(self) -> ModalBody:
        """The body in modal coordinates. Raises BadInput, with the key within the body as its place."""

    def read_at(self, spots: Spots) -> ModalBody:
        """The same with gauges at nodes and places of members, where it has such."""
        return self.build()

    def outline(self, modal: ModalBody) -> Outline:
        """What it looks like; modal: the body with its modes."""
        return straight(modal)

    @property
    def track_ends(self) -> tuple[str, ...]:
        """The names of the nodes where its track begins and ends, in this order, if they have names."""
        return ()

    def spot_place(self, spot: Spot) -> Array | None:
        """(3,) where a sensor reads off its track, m, in the coordinates of its outline; None where that is unknown."""
        return None

    @property
    def whole(self) -> Body | None:
        """The beam, frame or rigid body whose finite elements are its unreduced model; None where there is none."""
        return None

    @property
    def rayleigh(self) -> Rayleigh | None:
        """Its damping where that is Rayleigh's."""
        return self.damping_ratio if isinstance(self.damping_ratio, Rayleigh) else None

    @property
    def modal_ratios(self) -> tuple[float, ...]:
        """Its damping ratios where they are given mode by mode: the last one goes on for the modes beyond."""
        return self.damping_ratio if isinstance(self.damping_ratio, tuple) else ()

    def checks(self, here: str) -> list[Check]:
        """Conditions between the numbers of this body at the dotted key `here`."""
        return []

    def doubts(self, here: str) -> list[Doubt]:
        """Its numbers at the dotted key `here` that are likely only within limits."""
        return []

    def spot_checks(self, spot: Spot, sensor: str, here: str) -> list[Check]:
        """Conditions between the numbers of the sensor at the dotted key `sensor` and those of this body at `here`."""
        return []

    def check_spot(self, spot: Spot) -> None:
        """Raise BadInput, with the key within the sensor as its place, for a place that cannot be read."""
        if spot.support:
            what, expected = "this body does not tell what its supports carry", "a uniform beam, or a frame"
            raise BadInput(what, where="quantity", expected=expected, remedy="section forces beside it")
        what, remedy = f"this body has no {spot.key} to read", "at = metres along its track"
        raise BadInput(what, where=spot.key, expected="a place on its track", remedy=remedy)

    @property
    def is_simply_supported(self) -> bool:
        """Whether it is a uniform beam pinned at both ends."""
        return False

    @property
    def is_one_span(self) -> bool:
        """Whether nothing is known to support it between the ends of its track, where omega_1 L/pi says nothing."""
        return True

    @property
    def springs(self) -> tuple[Any, ...]:
        """The springs on which a uniform beam stands instead, each with `at`, `stiffness` and `rotational`."""
        return ()

    def moves(self, direction: Direction) -> bool:
        """Whether its track moves in a direction beside that of its loads."""
        return False

    def check_inertia(self, direction: Direction) -> None:
        """Raise BadInput where the inertia of what rides cannot act in a direction."""
        if self.moves(direction):
            return
        where = f"inertia_{direction}"
        what = f"this body does not move {direction} its own track, so its deflection does not depend on this key"
        expected = "a frame, or a body out of finite-element files" + " in space" * (direction == "across")
        along = (
            "; the drive still pushes the body along by -m s'', straight into its supports. For a body that sways"
            ' take kind = "frame", with springs or legs that give way along the track'
        )
        remedy = f"{where} = false{along * (direction == 'along')}"
        raise BadInput(what, where=where, expected=expected, remedy=remedy)

    @property
    def lever(self) -> float:
        """How far beside its axis its track lies, m."""
        return 0.0

    def deflects_down(self, point: str | None = None) -> bool:
        """Whether displacements of its track, or of a named point of it, count along gravity."""
        return True

    @property
    def lacks_for_stress(self) -> str:
        """The key within the body that stress and strain need and that is not given, or ""."""
        return ""

    @property
    def tells_supports(self) -> bool:
        """Whether it tells what its supports carry."""
        return False

    @property
    def untold(self) -> tuple[str, ...]:
        """Quantities that no sensor can read on this body."""
        return ()

    @property
    def content(self) -> str:
        """What tells apart the contents of a file that the body names; "" where it names none."""
        return ""

    @property
    def is_meshed(self) -> bool:
        """Whether the study says into how many elements it is cut."""
        return False

    def with_more_elements(self, times: int) -> Self:
        """The same body cut into so many times its elements, where the study says into how many."""
        return self

    @property
    def modes_are_open(self) -> bool:
        """Whether the number of its modes is chosen by the tolerance."""
        return False

    @property
    def modes_within(self) -> str:
        """The key of a number that all its modes lie within, as of a reduction; "" where they are the body's own."""
        return ""

    def with_modes(self, count: int) -> Self:
        """The same body with so many modes."""
        return self.model_copy(update={"modes": min(count, MAX_MODES)})

    def with_more_modes(self, times: int) -> Self:
        """The same body with so many times its modes, as far as it has them."""
        return self.with_modes(times * (AUTO_MODES if self.modes == "auto" else int(self.modes)))

    def finer(self) -> Self:
        """The same body closer to what it stands for, as far as it can be: with twice the modes, more than a study may
        ask for."""
        return self.model_copy(update={"modes": 2 * (AUTO_MODES if self.modes == "auto" else int(self.modes))})

    @property
    def hashes(self) -> tuple[tuple[str, str], ...]:
        """Path and SHA-256 of every file that the body is made of."""
        return ()

    def dampers(self) -> list[tuple[str, float | str, float]]:
        """Discrete dampers: key within the body, place on the track (m) or a point's name, coefficient (N s/m)."""
        return []
