"""What a user should know before believing a study of bodies in moving frames: things that are allowed and yet often a
mistake, beside those that every kind of study has."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from results_schema.arrays import Array
from studies.moving.parts import scenes
from studies.moving.ways import driven, way_of
from studies.results.formatting import percent, quantity
from studies.results.places import spread

if TYPE_CHECKING:
    from engine.floating.bodies.elastic import ElasticBody
    from engine.floating.model import FloatingModel
    from engine.scene.study import Study
    from engine.scene.sweep import Cases
    from engine.scene.variants import VariantValues

LOOKED_AT = 32  # scenes, and variants of each
LONGER = 1.0 + 1e-9  # times a duration: less is rounding
PLACES = 17  # of a track, at which the largest of a reading is looked for
ROUNDING = 1e-9  # of that: less is rounding
Y, Z = 1, 2
ACROSS = 0.9  # of an axis: about which a track that bends downwards turns
TURN = np.pi  # rad: joints seldom turn further, and not by whole numbers of radians


class Sample(NamedTuple):
    """Some variants of a scene, and how long their marches take (V,) s."""

    model: FloatingModel
    values: VariantValues
    seconds: Array


@dataclass(frozen=True, eq=False)
class Looked:
    """A study, and some of its variants; duration: (V,) s of variants by columns."""

    study: Study
    duration: Callable[[Mapping[str, Array], int], Array]

    @cached_property
    def cases(self) -> Cases:
        """All of its variants."""
        from engine.scene.sweep import expand

        return expand(self.study)

    @cached_property
    def samples(self) -> list[Sample]:
        """Some of the variants of some scenes."""
        from engine.floating.model import build
        from engine.scene.variants import VariantValues

        found = []
        for scene in scenes(self.study, self.cases)[:LOOKED_AT]:
            own = scene.variants[spread(scene.variants.size, LOOKED_AT)]
            columns = self.cases.columns_of(own)
            values = VariantValues(scene.study, columns, own.size)
            found.append(Sample(build(scene.study, 2), values, self.duration(columns, own.size)))
        return found


def remarks(study: Study, duration: Callable[[Mapping[str, Array], int], Array]) -> tuple[str, ...]:
    """One sentence per remark, each once, in the order of `REMARKS`; none for an ordinary study."""
    looked = Looked(study, duration)
    return tuple(dict.fromkeys(sentence for remark in REMARKS for sentence in remark(looked)))


def _turned_fast(looked: Looked) -> Iterator[str]:
    """Bodies that given motions alone turn beyond the theory, with the largest rate."""
    from engine.floating.model_choice import may_stiffen
    from engine.floating.theory import MISSING, given_rates, lacking

    worst: dict[str, tuple[float, float]] = {}
    for model, values, seconds in looked.samples:
        rates = given_rates(model, values, float(seconds.max()))
        for name in model.bodies:
            rate = float(rates[name].max())
            worst[name] = max(worst.get(name, (0.0, 0.0)), (float(lacking(model, name).max()) * rate**2, rate))
    left_open = may_stiffen(looked.study)
    for name, (missing, rate) in worst.items():
        if missing > MISSING and name not in left_open:
            yield (
                f"{name} is turned with up to {quantity(rate, 'rad s-1')}, at which it lacks {percent(missing)} of its "
                f"stiffness, as frame.{name}.stiffening is off: such variants are beyond the theory, or diverge"
            )


def _over_an_end(looked: Looked) -> Iterator[str]:
    """Where all variants do so, the study is refused."""
    for name in driven(looked.study):
        ways = [way_of(*sample, name) for sample in looked.samples]
        if off := [way for way in ways if way.off.any()]:
            low, high = min(float(way.low.min()) for way in off), max(float(way.high.max()) for way in off)
            yield (
                f"{name} runs over an end of {looked.study.carriage[name].on} in some variants, from {low:.4g} to "
                f"{high:.4g} m of {off[0].length:.4g} m: there their march ends, and they are marked as separated"
            )


def _goes_on(looked: Looked) -> Iterator[str]:
    """Motions, and courses of loads, whose last piece begins after the end."""
    from engine.floating.theory import ends_of_motions

    longest: dict[str, tuple[float, float]] = {}
    for model, values, seconds in looked.samples:
        for key, ends in ends_of_motions(model, values).items():
            late = ends > LONGER * seconds
            if late.any():
                k = int(np.argmax(np.where(late, ends, 0.0)))
                longest[key] = max(longest.get(key, (0.0, 0.0)), (float(ends[k]), float(seconds[k])))
    for key, (end, second) in longest.items():
        yield (
            f"{looked.study.source.written(key)} goes on until {end:.4g} s, and the march ends at {second:.4g} s: is a "
            "longer question.duration meant?"
        )


def _stops_at_once(looked: Looked) -> Iterator[str]:
    """Carriages with a mass that a cruise carries until it ends on a body whose track moves along itself too, with the
    largest speed."""
    study, fastest = looked.study, dict[str, float]()
    for model, values, seconds in looked.samples:
        for name in driven(study):
            carriage, motion = study.carriage[name], study.carriage[name].motion
            end = motion.path(np.array([motion.duration]), "left")
            ends = motion.passes and motion.pace is not None  # a cruise, or what a package brings that is like one
            if ends and carriage.inertial and _moves_along(model.bodies[carriage.on], float(end.S[0])):
                key = f"carriage.{name}.motion.{motion.pace}"
                pace = values.column(key) / study.value(key) / motion.time_scale
                stops = carriage.start_time + motion.duration / pace < seconds
                speed = float(np.max(np.abs(end.dS) * pace, where=stops, initial=0.0))
                fastest[name] = max(fastest.get(name, 0.0), speed)
    for name, speed in fastest.items():
        if speed > 0.0:
            yield (
                f"{name} stops within no time at the end of its way, from up to {quantity(speed, 'm s-1')}, which "
                "strikes its track along itself by a force as large as steps are short: waypoints let it brake"
            )


def _moves_along(body: ElasticBody, x: float) -> bool:
    """Whether a place is on a body's track, which moves along itself there."""
    if not 0.0 <= x <= body.length:
        return False
    fields = np.abs(body.fields(np.array([x]), (0,))[0, 0])
    return bool(fields[0].max(initial=0.0) > ROUNDING * fields.max(initial=0.0))


def _stands(looked: Looked) -> Iterator[str]:
    """Bodies that nothing moves and that carry nothing; where there is no joint at all, all of them."""
    study = looked.study
    moves = any(frame.joints for frame in study.frame.values())
    if not moves and not any(carriage.motion.slides for carriage in study.carriage.values()):
        yield "no body has a joint, so that all frames stand still: are tables [[frame.NAME.joints]] missing?"
        return
    for name in study.body:
        frame = study.frame.get(name)
        if (frame is None or frame.stands) and not _carries(study, name):
            yield (
                f"nothing moves {name}, which stands on the ground without a joint, and nothing rides or hangs on it: "
                f"is a table [[frame.{name}.joints]] missing?"
            )


def _carries(study: Study, name: str) -> bool:
    """Whether anything rides, hangs or acts on a body."""
    users = [frame.on for frame in study.frame.values()]
    users += [carriage.on for carriage in study.carriage.values()]
    users += [load.on for load in study.load.values()]
    users += [end.on for spring in study.spring.values() for end in spring.ends if end.on]
    return name in users


def _degrees(looked: Looked) -> Iterator[str]:
    """Angles of frames that are whole numbers of radians beyond half a turn, and written without a unit."""
    from engine.batch.remarks_of_carriages import has_unit

    study = looked.study
    swept = {path: axis.values for axis in looked.cases.axes for path in axis.paths}
    for key, number in study.numbers().items():
        unit = study.unit(key)
        if not key.startswith("frame.") or unit is None or unit.symbol != "rad":
            continue
        values = np.asarray(swept.get(key, [number]), dtype=np.float64)
        odd = values[(np.abs(values) > TURN) & (values == np.round(values))]
        if odd.size and not has_unit(study, key):
            most = float(odd[np.abs(odd).argmax()])
            yield f'{key} = {most:g} rad is {abs(most) / (2.0 * np.pi):.3g} turns: is "{most:g} deg" meant?'


def _reads_nothing(looked: Looked) -> Iterator[str]:
    """Of the first scene: sensors at places of bodies that do not bend, or not there."""
    model = looked.samples[0].model
    for name, sensor in model.study.sensor.items():
        if sensor.under is not None or sensor.reads.of_tree or sensor.at is None:
            continue
        body = model.bodies[str(sensor.body)]
        rows = [body.reading(sensor.reads, x) for x in (sensor.at, *np.linspace(0.0, body.length, PLACES))]
        here, *along = (np.abs(row).max(initial=0.0) for row in rows)
        if here <= ROUNDING * max(along):
            why = "there, as at a support, a free end or by symmetry" if body.omega.size else "as it does not bend"
            yield (
                f"sensor {name} reads 0: its body has no {sensor.quantity.replace('_', ' ')} {why}; in frames that "
                'move quantity = "position_error" reads how far a place is from where the rigid arm would have it'
            )


def _clamped_at_a_hinge(looked: Looked) -> Iterator[str]:
    """Beams whose shapes do not turn where a hinge lets them, which takes many of them."""
    study = looked.study
    for name, frame in study.frame.items():
        hinge, told = frame.joints[-1:], str(study.data["body"][name].get("supports"))
        here = f"frame.{name}.joints.{len(frame.joints) - 1}"
        if not (hinge and hinge[0].freedoms == 1 and hinge[0].turns_freely and told.startswith("clamped-")):
            continue
        about = np.abs(np.asarray(study.value(f"{here}.axis")))
        if about[Y] > ACROSS * np.linalg.norm(about):
            yield (
                f"{name} is clamped where {here} turns freely: no moment acts there, and clamped shapes need many "
                f"modes to say so, by which a march may fail that stiffens {name}; body.{name}.supports = "
                f'"pinned-{told.partition("-")[2]}" takes a few, and tells deflections and joint_angle from its mean '
                "axis"
            )


def _nothing_across(looked: Looked) -> Iterator[str]:
    """Position errors across the plane in which an arm bends and its joints move it."""
    model = looked.samples[0].model
    for name, sensor in model.tips.items():
        carriers = model.carriers(str(sensor.body))
        if abs(sensor.way[1]) > 1.0 - ROUNDING and all(_stays_in_plane(model, carrier) for carrier in carriers):
            bending = " or ".join(f"frame.{carrier}" for carrier in carriers if model.bodies[carrier].omega.size)
            remedy = f": a lateral_second_moment of {bending} brings that" if bending else ""
            yield f"sensor {name} reads 0: nothing that carries it moves or bends along y over the ground{remedy}"


def _stays_in_plane(model: FloatingModel, name: str) -> bool:
    """Whether a body keeps the y axis of what it hangs on, and does not bend along it, nor twist."""
    from engine.floating.bodies.fields import ABOUT_X, ABOUT_Z
    from engine.kernels.floating.layout import PRISMATIC, REVOLUTE

    turned = np.array(model.frame(name).turned)
    whole = {REVOLUTE: 1.0, PRISMATIC: 0.0}  # of an axis that is along y, of what turns and of what slides
    joints = (joint for joint in model.joints if joint.body == name)
    kept = all(abs(abs(joint.axis[Y]) - whole.get(joint.kind, np.inf)) < ROUNDING for joint in joints)
    return bool(kept and not _bends(model.bodies[name], Y, ABOUT_X, ABOUT_Z) and not np.delete(turned, Y).any())


def _moved_across(looked: Looked) -> Iterator[str]:
    """Joints that push a body across the plane in which alone it bends."""
    from engine.kernels.floating.layout import PRISMATIC, REVOLUTE

    model, across, count = looked.samples[0].model, {REVOLUTE: Z, PRISMATIC: Y}, dict[str, int]()
    for joint in model.joints:
        number = count[joint.body] = count.get(joint.body, -1) + 1
        body, axis = model.bodies[joint.body], across.get(joint.kind)
        if axis is None or not body.omega.size or abs(joint.axis[axis]) < 1.0 - ROUNDING or _bends(body, Y):
            continue
        how = "turns" if joint.kind == REVOLUTE else "pushes"
        yield (
            f"frame.{joint.body}.joints.{number} {how} {joint.body} across the plane in which it bends: a "
            f"lateral_second_moment of frame.{joint.body} lets it bend along y too"
        )


def _bends(body: ElasticBody, *axes: int) -> bool:
    """Whether its track moves along, or turns about, any of some axes as it bends."""
    shapes = np.abs(body.fields(np.linspace(0.0, body.length, PLACES), (0,))[0]).max(axis=(0, 2), initial=0.0)
    return bool((shapes[list(axes)] > ROUNDING * shapes.max()).any())


def _let_go(looked: Looked) -> Iterator[str]:
    """Bodies that lie across gravity and could rest on their joints."""
    study, model = looked.study, looked.samples[0].model
    joints = [joint for frame in study.frame.values() for joint in frame.joints]
    rests = all(joint.is_held and not joint.told_start for joint in joints)
    slides = any(carriage.motion.slides for carriage in study.carriage.values())
    if study.initial == "equilibrium" or not rests or slides:
        return
    across = []
    for name, E in _attitudes(model).items():
        bends = np.any(model.bodies[name].shapes != 0.0, axis=(0, 2)) & [False, True, True]
        if study.gravity and (np.abs(E[Z][bends]) > ROUNDING).any():
            across.append(name)
    if across:
        yield (
            f"{' and '.join(across)} {'starts' if len(across) == 1 else 'start'} undeformed, so that weight sets "
            f'{"it" if len(across) == 1 else "them"} swinging at time 0; initial = "equilibrium" starts from where '
            f"{'it rests' if len(across) == 1 else 'they rest'}"
        )


def _attitudes(model: FloatingModel) -> dict[str, Array]:
    """(3, 3) of every frame over the ground at time 0, as of bodies that do not bend."""
    from scipy.spatial.transform import Rotation

    found: dict[str, Array] = {}
    for name in model.bodies:
        frame = model.frame(name)
        turns = [frame.turned, *(joint.at_start[0] for joint in frame.joints)]
        own = found.get(frame.on, np.eye(3))
        for turn in turns:
            own = own @ Rotation.from_rotvec(turn).as_matrix()
        found[name] = own
    return found


def _doubtful(looked: Looked) -> Iterator[str]:
    from engine.batch.plausibility import doubtful, half_united

    yield from doubtful(looked.study, looked.cases)
    yield from half_united(looked.study)


REMARKS: tuple[Callable[[Looked], Iterator[str]], ...]
REMARKS = (
    _doubtful, _degrees, _turned_fast, _over_an_end, _goes_on, _stops_at_once, _stands, _reads_nothing, _nothing_across,
    _moved_across, _let_go, _clamped_at_a_hinge,
)  # fmt: skip
