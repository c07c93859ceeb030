"""Robots out of URDF files: the chain of links from the root to a tool, as a table [arm.NAME] of study files.

Links that are fixed to each other become one. Every link gets axes along the principal axes of its inertia, since
tables of links tell three moments alone. URDF: https://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from engine.study_file.spec import nearest
from results_schema.arrays import Array
from results_schema.errors import BadInput

MOST_BYTES = 2**22
MOVABLE = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
ROUND = 1e-12  # of the largest: products of inertia, and parts of vectors, that are rounding
DIGITS = 12  # of printed numbers: torques of drives change by 6e-12 of the largest, in the tests' robot
#: Of the largest moment: by how much it may exceed the sum of the others. Files with three digits are up to 0.6 % off.
FEW_DIGITS = 0.01
#: Within which s drives reach their full speed, and their full acceleration: a guess, which the table's comment tells.
UP_TIME, JERK_TIME = 0.5, 0.1
PLAIN_SPEED = 1.0  # m/s or rad/s, where the file has no limit: likewise


class Pose(NamedTuple):
    """Axes (3, 3) and place (3,), m, in other axes."""

    turn: Array
    place: Array

    def after(self, outer: Pose) -> Pose:
        """The same in the axes that ``outer`` is given in."""
        return Pose(outer.turn @ self.turn, outer.place + outer.turn @ self.place)


@dataclass
class Solid:
    """Links that are fixed to each other: mass, its product with the centre, inertia about the axes' origin, all in
    the axes of the first link."""

    mass: float = 0.0
    moment: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def add(self, mass: float, pose: Pose, inertia: Array) -> None:
        """Add a link by its inertia about its centre, which is at ``pose``."""
        c = pose.place
        self.mass += mass
        self.moment = self.moment + mass * c
        self.inertia = self.inertia + pose.turn @ inertia @ pose.turn.T + mass * (c @ c * np.eye(3) - np.outer(c, c))

    @property
    def centre(self) -> Array:
        """(3,) m; the origin where nothing has mass."""
        return self.moment / self.mass if self.mass > 0.0 else self.moment

    @property
    def about_centre(self) -> Array:
        """(3, 3) kg m2."""
        c = self.centre
        return np.asarray(self.inertia - self.mass * (c @ c * np.eye(3) - np.outer(c, c)))


class Joint(NamedTuple):
    """A joint of the file: what it joins, where it is in the axes of its parent, its axis, its speed or 0, and between
    which values it goes, where the file tells."""

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose
    axis: Array
    speed: float
    ends: tuple[float, float] | None


class Chain(NamedTuple):
    """From the root to the tool: the names of the root and of the tool, the joints that move, the solids, one more, and
    where each joint is on its solid, and the tool's origin on the last one."""

    root: str
    tool: str
    joints: list[Joint]
    solids: list[Solid]
    poses: list[Pose]
    tip: Array


def table_of(file: Path, tool: str | None, name: str, turned: Array) -> str:
    """The text of [arm.NAME] for the robot of a URDF file, whose root is turned on the carriage by a rotation vector
    (3,) in rad. tool: the link whose origin is the tool centre point; not needed where there is one end alone. Raises
    BadInput."""
    from scipy.spatial.transform import Rotation

    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise BadInput("no name of a table", where="name", expected="letters, digits, _ and -", received=name)
    try:
        chain = _chain(_parsed(file), tool)
    except BadInput as error:
        raise error.moved(str(file)) from None
    return "\n".join(_lines(chain, name, Rotation.from_rotvec(turned).as_matrix(), file.name)) + "\n"


def _chain(root: ElementTree.Element, tool: str | None) -> Chain:
    for kind in ("link", "joint"):
        _check_names(kind, [str(one.get("name")) for one in root.findall(kind)])
    links = {str(link.get("name")): link for link in root.findall("link")}
    joints = [_joint(joint, links) for joint in root.findall("joint")]
    held = {joint.child: joint for joint in joints}
    if len(held) < len(joints):
        raise _fault("a link hangs on two joints", "a tree of links, without closed loops")
    first = [name for name in links if name not in held]
    if len(first) != 1:
        raise _fault("there is not one root", "one link that hangs on no joint", ", ".join(first[:5]) or "none")
    tip = tool or _only_end(links, joints)
    if tip not in links:
        raise _no_link("no such link", links, tip)
    way, name = list[Joint](), tip
    while name in held and len(way) <= len(joints):
        way.insert(0, held[name])
        name = held[name].parent
    if name != first[0]:
        raise _fault("links hang on each other in a circle", "a tree of links", tip)
    moving = [joint for joint in way if joint.kind in MOVABLE]
    if not moving:
        raise _fault("no joint between root and tool moves", f"one of the kinds {', '.join(MOVABLE)}")
    solids, places = _solids(links, joints, moving)
    poses = [joint.pose.after(places[joint.parent][1]) for joint in moving]
    return Chain(first[0], tip, moving, solids, poses, places[tip][1].place)


def _check_names(kind: str, names: list[str]) -> None:
    """Names are told in comments, each on one line, and tell what is meant."""
    for place, name in enumerate(names):
        if not name.isprintable():
            raise _fault(f"a {kind} has a name with line breaks or the like", "printable letters", repr(name)[:40])
        if name in names[:place]:
            raise _fault(f"two {kind}s have the same name", "a name of its own for each", name)


def _solids(
    links: Mapping[str, ElementTree.Element], joints: list[Joint], moving: list[Joint]
) -> tuple[list[Solid], dict[str, tuple[int, Pose]]]:
    """What moves as one, and for every link the number of its solid and where it is in the axes of that."""
    origin = Pose(np.eye(3), np.zeros(3))
    children: dict[str, list[Joint]] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint)
    (root,) = set(links) - {joint.child for joint in joints}
    numbers = {joint.name: number for number, joint in enumerate(moving, start=1)}
    solids, places, open_ = [Solid() for _ in range(len(moving) + 1)], {root: (0, origin)}, [root]
    while open_:
        name = open_.pop()
        number, pose = places[name]
        _weigh(links[name], solids[number], pose)
        for joint in children.get(name, []):
            if joint.name in numbers:
                places[joint.child] = numbers[joint.name], origin
            elif joint.kind == "fixed":
                places[joint.child] = number, joint.pose.after(pose)
            else:
                expected = "fixed joints beside the way from the root to the tool"
                raise _fault(f"joint {joint.name} moves what is not on the way to the tool", expected, joint.kind)
            open_.append(joint.child)
    return solids, places


def _weigh(link: ElementTree.Element, solid: Solid, pose: Pose) -> None:
    """Add what a link weighs to its solid."""
    inertial = link.find("inertial")
    if inertial is None:
        return
    where = f"link {link.get('name')}"
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    if mass is None or tensor is None:
        raise _fault(f"{where} has an inertial without mass or inertia", "both")
    value = _number(where, mass.get("value"))
    xx, xy, xz, yy, yz, zz = (
        _number(where, tensor.get(key, "0")) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments = np.linalg.eigvalsh(inertia)
    if value < 0.0 or moments.min() < -ROUND * np.abs(inertia).max():
        raise _fault(f"{where} has a negative mass or inertia", "none", f"{value:g} kg")
    if moments[2] > moments[0] + moments[1] + FEW_DIGITS * moments[2]:
        expected = "no principal moment above the sum of the other two"
        received = f"{', '.join(f'{moment:.4g}' for moment in moments)} kg m2"
        raise _fault(f"{where} has an inertia that no body can have", expected, received)
    solid.add(value, _pose(where, inertial.find("origin")).after(pose), inertia)


def _only_end(links: Mapping[str, ElementTree.Element], joints: list[Joint]) -> str:
    ends = [name for name in links if name not in {joint.parent for joint in joints}]
    if len(ends) != 1:
        raise _fault("it has several ends; name the link that is the tool", f"one of {', '.join(ends[:20])}")
    return ends[0]


def _parsed(file: Path) -> ElementTree.Element:
    try:
        with file.open("rb") as stream:
            text = stream.read(MOST_BYTES + 1)
    except FileNotFoundError:
        raise _fault("no such file", "a URDF file") from None
    except OSError as error:
        raise _fault("cannot be read", "a file", error.strerror or "") from None
    if len(text) > MOST_BYTES:
        raise _fault("too large for a URDF file", f"{MOST_BYTES // 2**20} MB at most")
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise _fault("it declares entities, which no URDF file needs", "plain XML")
    try:
        found = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise _fault("no XML", "a URDF file", str(error)) from None
    if found.tag != "robot" or "xacro" in "".join(part.tag for part in found.iter()):
        raise _fault("no URDF file", "<robot> with links and joints; of a xacro what it expands to", f"<{found.tag}>")
    return found


def _joint(joint: ElementTree.Element, links: Mapping[str, ElementTree.Element]) -> Joint:
    name, kind = str(joint.get("name")), str(joint.get("type"))
    where = f"joint {name}"
    parent, child = (_of(joint, end, "link") for end in ("parent", "child"))
    for end in (parent, child):
        if end not in links:
            raise _no_link(f"{where} joins a link that is not there", links, end)
    if kind not in (*MOVABLE, "fixed"):
        raise _fault(f"{where} is of a kind that drives do not move", f"{', '.join(MOVABLE)} or fixed", kind)
    if joint.find("mimic") is not None:
        raise _fault(f"{where} mimics another one", "joints with drives of their own")
    axis = _vector(where, _of(joint, "axis", "xyz") or "1 0 0")
    if not axis.any():
        raise _fault(f"{where} has an axis without direction", "three numbers, not all zero", "0 0 0")
    speed = _number(where, _of(joint, "limit", "velocity") or "0")
    if speed < 0.0:
        raise _fault(f"{where} has a negative velocity", "a limit above 0", f"{speed:g}")
    return Joint(name, kind, parent, child, _pose(where, joint.find("origin")), axis, speed, _ends(where, joint))


def _ends(where: str, joint: ElementTree.Element) -> tuple[float, float] | None:
    """Between which values (rad or m) a joint goes; None where the file does not tell."""
    lower, upper = (_of(joint, "limit", key) for key in ("lower", "upper"))
    if joint.get("type") == "continuous" or not lower + upper:
        return None
    return _number(where, lower or "0"), _number(where, upper or "0")


def _of(element: ElementTree.Element, tag: str, key: str) -> str:
    """An attribute of an element inside another one; empty where it is not there."""
    found = element.find(tag)
    return "" if found is None else found.get(key, "")


def _pose(where: str, origin: ElementTree.Element | None) -> Pose:
    from scipy.spatial.transform import Rotation

    if origin is None:
        return Pose(np.eye(3), np.zeros(3))
    place, angles = (_vector(where, origin.get(key, "0 0 0")) for key in ("xyz", "rpy"))
    return Pose(Rotation.from_euler("xyz", angles).as_matrix(), place)  # about fixed axes, x first


def _vector(where: str, text: str) -> Array:
    parts = text.split()
    if len(parts) != 3:
        raise _fault(f"{where} has no vector", "three numbers", text[:40])
    return np.array([_number(where, part) for part in parts])


def _number(where: str, text: str | None) -> float:
    try:
        found = float(text or "")
    except ValueError:
        found = np.nan
    if not np.isfinite(found):
        raise _fault(f"{where} has no number", "a finite number", str(text)[:40])
    return found


def _fault(what: str, expected: str, received: str = "") -> BadInput:
    return BadInput(what, expected=expected, received=received)


def _no_link(what: str, links: Mapping[str, ElementTree.Element], name: str) -> BadInput:
    expected = f"one of {', '.join(links)}"
    return BadInput(what, expected=expected, received=name, remedy=nearest(name, list(links)))


def _lines(chain: Chain, name: str, turn: Array, source: str) -> Iterator[str]:
    """The lines of the table. turn: of the root on the carriage, whose axes are those of the rails."""
    carriage, *links = chain.solids
    yield f"# The chain from {chain.root} to {chain.tool} of {source}."
    yield "# No URDF file tells the drive along the rails, nor accelerations and jerks: with those below full speed and"
    yield f"# full acceleration are reached within {UP_TIME:g} and {JERK_TIME:g} s. Joints follow their plans rigidly"
    yield "# unless `stiffness` and `damping` stand beside these."
    yield f"[arm.{name}]"
    if carriage.mass == 0.0:
        yield "# the file tells no mass of its root: replace this one by that of the carriage"
    else:
        yield f"# of {chain.root} alone: add the carriage that rides on the rails, here and in centre and inertia"
    yield f"mass = {_plain(carriage.mass or 1.0)}"
    yield f"centre = {_row(turn @ carriage.centre)}"
    tensor = turn @ carriage.about_centre @ turn.T
    products = tensor[np.triu_indices(3, 1)]
    if np.abs(products).max() > ROUND * max(float(np.abs(tensor).max()), ROUND):
        yield f"# without the products of inertia of {chain.root}, xy, xz, yz: {_row(products)}"
    yield f"inertia = {_row(np.diag(tensor))}"
    yield f"rail = {{ {_drive(PLAIN_SPEED)} }}"
    axes = [turn.T, *(_principal(link.about_centre) for link in links)]
    yield f"tool = {_row(axes[-1].T @ chain.tip)}"
    for joint, solid, pose, before, own in zip(chain.joints, links, chain.poses, axes[:-1], axes[1:], strict=True):
        yield ""
        yield f"[[arm.{name}.links]] # {joint.child}, by {joint.name}"
        yield from _remarks(joint, solid)
        yield f'kind = "{MOVABLE[joint.kind]}"'
        yield f"axis = {_row(own.T @ joint.axis)}"
        yield f"place = {_row(before.T @ pose.place)}"
        yield f"turned = {_row(_rotation_vector(before.T @ pose.turn @ own))}"
        yield f"mass = {_plain(solid.mass)}"
        yield f"centre = {_row(own.T @ solid.centre)}"
        yield f"inertia = {_row(np.maximum(np.diag(own.T @ solid.about_centre @ own), 0.0))}"
        if joint.ends is not None and joint.ends[0] < joint.ends[1]:
            yield f"limits = [{', '.join(map(_plain, joint.ends))}]"
        yield _drive(joint.speed or PLAIN_SPEED).replace(", ", "\n")


def _remarks(joint: Joint, solid: Solid) -> Iterator[str]:
    """Comments on what the file does not tell of a link."""
    if solid.mass == 0.0:
        yield "# the file tells no mass of it"
    if joint.speed == 0.0:
        yield f"# the file tells no speed of {joint.name}: the one here is a guess"


def _drive(speed: float) -> str:
    acceleration = speed / UP_TIME
    numbers = {"speed": speed, "acceleration": acceleration, "jerk": acceleration / JERK_TIME}
    return ", ".join(f"{key} = {_plain(value)}" for key, value in numbers.items())


def _principal(inertia: Array) -> Array:
    """(3, 3) principal axes as columns, those nearest to the axes of an inertia; these themselves where they are."""
    products = np.abs(inertia[np.triu_indices(3, 1)])
    if products.max() <= ROUND * np.abs(inertia).max():
        return np.eye(3)
    found = np.linalg.eigh(inertia)[1]
    found = found[:, max(permutations(range(3)), key=lambda order: np.abs(np.diag(found[:, order])).sum())]
    found = found * np.where(np.diag(found) < 0.0, -1.0, 1.0)
    return np.asarray(found * np.array([1.0, 1.0, np.sign(np.linalg.det(found))]))


def _rotation_vector(turn: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(turn).as_rotvec())


def _row(vector: Array) -> str:
    size = float(np.abs(vector).max())
    return f"[{', '.join(_plain(float(part)) if abs(part) > ROUND * size else '0' for part in vector)}]"


def _plain(number: float) -> str:
    return f"{number:.{DIGITS}g}"
