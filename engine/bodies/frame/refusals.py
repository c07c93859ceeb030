"""What must hold between the parts of a frame; every refusal names the dotted key within the body."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from pydantic import ValidationError
from pydantic_core import InitErrorDetails

from engine.bodies.frame.geometry import DIRECTIONS, SAME_PLACE, TrackLine, member_ends, parallel, unit, up_of
from engine.bodies.modal.description import Spot, check_spot_name
from engine.study_file.spec import nearest
from engine.study_file.units import fault
from results_schema.errors import BadInput, shortened

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame

MAX_TOTAL_ELEMENTS = 20_000
MAX_TRACK_ELEMENTS = 1000  # the flexibility between all their ends is kept

Key = tuple[str | int, ...]


def refuse(key: Key, what: str, *, expected: str = "", received: str = "", remedy: str = "") -> NoReturn:
    """Raise pydantic's error for a key of the body, which becomes a BadInput that names it."""
    problem = fault(what, expected=expected, received=received, remedy=remedy)
    raise ValidationError.from_exception_data("frame", [InitErrorDetails(type=problem, loc=key, input=received)])


def check_frame(frame: Frame) -> None:
    """Every rule in the order in which they make sense. Raises pydantic's errors."""
    _check_nodes(frame)
    _check_names(frame)
    for name in frame.member:
        _check_member(frame, name)
    _check_connected(frame)
    _check_springs(frame)
    _check_plane(frame)
    _check_track(frame)
    _check_modes(frame)


def _check_nodes(frame: Frame) -> None:
    for name, given in frame.node.items():
        if not name.isidentifier():
            refuse(("node", name), "not a usable name", expected="letters, digits and _, a letter first")
        if len(given) == 2 and frame.plane is None:
            refuse(("node", name), "two coordinates", expected="three, or a plane frame", remedy='plane = "xz"')
    if frame.plane is not None:
        across = "xyz".index(frame.still[0])
        places = {name: frame.place(name)[across] for name in frame.node}
        first = next(iter(places.values()))
        for name, place in places.items():
            if place != first:
                axis = "xyz"[across]
                refuse(("node", name), "off the plane", expected=f"{axis} = {first:g} m", received=f"{place:g} m")


def _check_names(frame: Frame) -> None:
    for key, name, names, noun in _mentioned(frame):
        if name not in names:
            expected = f"one of {', '.join(list(names)[:12])}"
            hint = nearest(name, list(names))
            refuse(key, f"no such {noun}", expected=expected, received=shortened(name), remedy=hint)


def _mentioned(frame: Frame) -> Iterator[tuple[Key, str, Collection[str], str]]:
    """Every name that is mentioned: where, the name, the names there are, what it names."""
    for name, member in frame.member.items():
        for end in range(2):
            yield ("member", name, "nodes", end), member.nodes[end], frame.node, "node"
        yield ("member", name, "section"), member.section, frame.section, "section"
    for name, body in frame.point_mass.items():
        yield ("point_mass", name, "node"), body.node, frame.node, "node"
    for name, spring in frame.spring.items():
        yield ("spring", name, "node"), spring.node, frame.node, "node"
        if spring.to is not None:
            yield ("spring", name, "to"), spring.to, frame.node, "node"
    for name, point in frame.point.items():
        yield ("point", name, "node"), point.node, frame.node, "node"
    for name in frame.supports:
        yield ("supports", name), name, frame.node, "node"
    for index, name in enumerate(frame.interface):
        yield ("interface", index), name, frame.node, "node"
    for index, name in enumerate(frame.track.members):
        yield ("track", "members", index), name, frame.member, "member"


def _check_member(frame: Frame, name: str) -> None:
    here: Key = ("member", name)
    ends, member = member_ends(frame, name), frame.member[name]
    extent = float(np.abs(ends).max())
    if np.linalg.norm(ends[1] - ends[0]) <= SAME_PLACE * max(extent, 1e-3):
        refuse((*here, "nodes"), "this member has no length", received=shortened(list(member.nodes)))
    up = up_of(frame, name)
    if up is None or parallel(ends[1] - ends[0], up):
        what = "the direction of the section is not defined: the member runs along `up`, or along gravity without one"
        refuse((*here, "up"), what, expected="a direction across the member", remedy="up = [1, 0, 0]")
    section = frame.section[member.section]
    needed: dict[str, float | None] = {}
    if frame.plane is None or member.theory == "timoshenko":
        needed["shear_modulus"] = section.shear_stiffness
    if frame.plane is None:
        needed |= {key: getattr(section, key) for key in ("second_moment_lateral", "torsion_constant")}
    if member.theory == "timoshenko":
        needed["shear_area"] = section.shear_area
        needed |= {} if frame.plane else {"shear_area_lateral": section.shear_area_lateral}
    for word, value in needed.items():
        if value is None:
            what = "this key is missing"
            refuse(("section", member.section, word), what, expected=f"a number > 0 (for the member {name})")


def _check_connected(frame: Frame) -> None:
    """Members and springs between nodes make one piece."""
    links = [member.nodes for member in frame.member.values()]
    links += [(spring.node, spring.to) for spring in frame.spring.values() if spring.to is not None]
    for name in frame.node:
        if not any(name in member.nodes for member in frame.member.values()):
            _check_tuned_mass(frame, name)
    reached, border = set(), {next(iter(frame.node))}
    while border:
        reached |= border
        border = {other for link in links if set(link) & border for other in link} - reached
    for name in frame.node:
        if name not in reached:
            what = f"nothing connects this node with {next(iter(frame.node))}"
            refuse(("node", name), what, expected="one frame", remedy="add a member or a spring")
    total = sum(member.elements for member in frame.member.values())
    if total > MAX_TOTAL_ELEMENTS:
        refuse(("member",), "too many elements", expected=f"at most {MAX_TOTAL_ELEMENTS}", received=str(total))


def _check_tuned_mass(frame: Frame, node: str) -> None:
    """A node at which no member ends has a mass on springs, in every direction in which anything acts on it."""
    masses = [body for body in frame.point_mass.values() if body.node == node]
    springs = {name: spring for name, spring in frame.spring.items() if node in (spring.node, spring.to)}
    if not (masses and springs):
        remedy = "leave it out, or add a member, or a point_mass and a spring to another node"
        refuse(("node", node), "no member ends at this node", remedy=remedy)
    stands = frame.stands(node)
    for name, spring in springs.items():
        for way, rate in zip(DIRECTIONS, (*spring.damping, *spring.rotational_damping), strict=True):
            if rate > 0.0 and way in stands and way not in (*frame.holds(node), *frame.still):
                key = ("spring", name, "damping" if way in DIRECTIONS[:3] else "rotational_damping")
                expected = f"a {'stiffness along' if len(way) == 1 else 'rotational stiffness about'} {way[-1]} too"
                refuse(key, f"a damper without a spring holds {node}, at which no member ends", expected=expected)
    for way in DIRECTIONS[3:]:
        inertias = [body.inertia[DIRECTIONS.index(way) - 3] for body in masses]
        if way not in (*stands, *frame.still) and not any(inertias):
            what = f"a spring turns {node}, which has no inertia about {way[1]}, and at which no member ends"
            refuse(("node", node), what, expected=f"an inertia about {way[1]} of its point_mass, or no such spring")


def _check_springs(frame: Frame) -> None:
    for name, spring in frame.spring.items():
        if not any((*spring.stiffness, *spring.rotational, *spring.damping, *spring.rotational_damping)):
            refuse(("spring", name), "a spring that holds nothing", expected="one of its numbers > 0")
        if spring.to == spring.node:
            refuse(("spring", name, "to"), "a spring between a node and itself", expected="another node")


def _check_plane(frame: Frame) -> None:
    """Nothing leaves the plane of a plane frame."""
    if frame.plane is None:
        return
    across = "xyz".index(frame.still[0])
    vectors: list[tuple[Key, tuple[float, ...] | None]] = [
        (("gravity_direction",), frame.gravity_direction),
        (("track", "direction"), frame.track.direction),
        (("track", "offset"), frame.track.offset),
    ]
    vectors += [(("point_mass", name, "offset"), body.offset) for name, body in frame.point_mass.items()]
    vectors += [(("point", name, "direction"), point.direction) for name, point in frame.point.items()]
    vectors += [(("point", name, "offset"), point.offset) for name, point in frame.point.items()]
    vectors += [(("member", n, "offsets", i), m.offsets[i]) for n, m in frame.member.items() for i in range(2)]
    for key, vector in vectors:
        if vector is not None and vector[across] != 0.0:
            axis = "xyz"[across]
            refuse(key, "off the plane", expected=f"{axis} = 0 in a frame of the plane {frame.plane}")
    for node in frame.supports:
        held = frame.holds(node)
        if not set(held) - set(frame.still):
            what = f"in a frame of the plane {frame.plane} no node moves so, and nothing is held"
            moves = ", ".join(direction for direction in DIRECTIONS if direction not in frame.still)
            refuse(("supports", node), what, expected=f"some of {moves}", received=", ".join(held))


def _check_track(frame: Frame) -> None:
    line = track_line(frame)
    count = sum(frame.member[name].elements for name in frame.track.members)
    if count > MAX_TRACK_ELEMENTS:
        expected = f"at most {MAX_TRACK_ELEMENTS}"
        refuse(("track", "members"), "too many elements under the track", expected=expected, received=str(count))
    across = np.linalg.norm(np.cross(line.tangent, line.direction))
    if across < 1e-3:
        refuse(("track", "direction"), "the load acts along the track", expected="a direction across the track")
    offset = np.array(frame.track.offset)
    if np.abs(offset @ line.tangent) > SAME_PLACE * line.length:
        refuse(("track", "offset"), "the offset is not square to the track", expected="a vector across the members")
    if offset.any() and abs(line.tangent @ line.direction) > PARALLEL_LOAD:
        what = "a load that is not square to the track stands beside it"
        refuse(("track", "direction"), what, expected="a direction square to the track, or no offset")


PARALLEL_LOAD = 1e-6  # cosine of the angle above which a load acts along the track too


def track_line(frame: Frame) -> TrackLine:
    """The track's members in their order, end to end on one straight line. Raises pydantic's errors."""
    names = frame.track.members
    ends = [member_ends(frame, name) for name in names]
    nodes = [frame.member[name].nodes for name in names]
    backward = [len(names) > 1 and nodes[0][1] not in nodes[1] and nodes[0][0] in nodes[1]]
    for index in range(1, len(names)):
        before = nodes[index - 1][0 if backward[-1] else 1]
        if before not in nodes[index]:
            key, wanted = ("track", "members", index), f"a member that goes on at the node {before}"
            refuse(key, "the track is interrupted", expected=wanted, received=shortened(names[index]))
        backward.append(nodes[index][1] == before)
    points = [pair[::-1] if turned else pair for pair, turned in zip(ends, backward, strict=True)]
    lengths = np.array([np.linalg.norm(pair[1] - pair[0]) for pair in points])
    tangent = unit(points[0][1] - points[0][0])
    for index in range(1, len(names)):
        gap = np.linalg.norm(points[index][0] - points[index - 1][1])
        if gap > SAME_PLACE * lengths.sum() or np.linalg.norm(unit(np.diff(points[index], axis=0)[0]) - tangent) > 1e-6:
            key = ("track", "members", index)
            refuse(key, "the track is not straight here", expected="members end to end on one straight line")
    places = np.concatenate([[0.0], np.cumsum(lengths)])
    return TrackLine(tuple(zip(names, backward, strict=True)), tangent, places, unit(frame.direction))


def check_spot(frame: Frame, spot: Spot) -> None:
    """A sensor's place is there and not held in its direction. Raises BadInput with the key within the sensor."""
    check_spot_name("node", spot.node, frame.node)
    check_spot_name("member", spot.member, frame.member)
    check_spot_name("point", spot.point, frame.point)
    if spot.member is not None:
        ends = member_ends(frame, spot.member)
        length = float(np.linalg.norm(ends[1] - ends[0]))
        if spot.at > length:
            expected = f"0 to {length:.10g} m, from its first node"
            raise BadInput("a sensor off its member", where="at", expected=expected, received=f"{spot.at:.10g} m")
    if spot.support:
        _check_support(frame, spot)
        return
    held = frame.still if spot.node is None else (*frame.still, *frame.stands(str(spot.node)))
    way = unit(frame.gravity if spot.direction is None else spot.direction)
    if spot.point is None and not any(way[axis] for axis, word in enumerate("xyz") if word not in held):
        what = "nothing moves here in this direction"
        raise BadInput(what, where="direction", expected="a direction that is not held", remedy=f"{spot.key} elsewhere")


def _check_support(frame: Frame, spot: Spot) -> None:
    """Something holds the node in the direction that is read."""
    to_ground = {name: spring for name, spring in frame.spring.items() if spring.to is None}
    nodes = dict.fromkeys((*frame.supports, *(spring.node for spring in to_ground.values())))
    expected = f"one of {', '.join(nodes)}" if nodes else "a frame with supports"
    if spot.node not in nodes:
        remedy = "node = its name, of a support or of a spring to ground"
        raise BadInput("no support stands here", where=spot.key, expected=expected, remedy=remedy)
    way = unit(frame.gravity if spot.direction is None else spot.direction)
    springs = [spring for spring in to_ground.values() if spring.node == spot.node]
    rates, words = [spring.stiffness for spring in springs], DIRECTIONS[:3]
    if spot.turns:
        rates, words = [spring.rotational for spring in springs], DIRECTIONS[3:]
    held = frame.holds(str(spot.node))
    holds = [word in held or any(rate[axis] > 0.0 for rate in rates) for axis, word in enumerate(words)]
    if not any(way[axis] and holds[axis] for axis in range(3)):
        what = f"nothing holds node {spot.node} {'against turns about' if spot.turns else 'in'} this direction"
        raise BadInput(what, where="direction", expected="a direction that is held")


def _check_modes(frame: Frame) -> None:
    if isinstance(frame.modes, int):
        for index, number in enumerate(frame.leave_out):
            if number > frame.modes:
                expected = f"at most modes = {frame.modes}"
                refuse(("leave_out", index), "there is no such mode to leave out", expected=expected)
