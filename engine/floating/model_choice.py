"""Which model a scene with frames that move is marched by, as pilots find: with how many modes, where the study leaves
these open; and where nothing but modes and springs of carriages is left to move by itself, one whose steps are linear
equations, if it agrees with the floating frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.accuracy.few_pilots import FewPilots
from engine.accuracy.reference import LEFT_BY_ELEMENTS, left_over
from engine.bodies.modal.description import MAX_MODES
from engine.floating.converge import MORE_MODES, STATIONS, Level, levels, usual_steps, worst
from engine.floating.model import build
from engine.floating.results import Outcome, differences, results_of
from engine.floating.schemes import USUAL
from engine.floating.theory import softened_by_weight
from engine.scene.frames import GROUND
from results_schema.arrays import Array
from results_schema.status import Fidelity, Status

if TYPE_CHECKING:
    from engine.floating.model import FloatingModel
    from engine.scene.study import Study
    from engine.scene.variants import VariantValues

PILOTS = 16  # of a scene: by so many the errors that are told were measured (`tests.calibration.frames`)
NOTHING = 1e-4  # of its stiffness, by which weight softens a body that stands: less is not looked at
PART = 0.1  # of a tolerance that the cheaper model may take; the rest is for modes and steps
FINER = (1, 4, 16)  # times the coarsest steps, where pilots fail with these
FIRST_MODES, MOST_MODES = 2, 32  # of bending, of a beam


@dataclass(frozen=True, eq=False)
class Rung:
    """The model of a scene's variants; modes: of bending, where these are open; left_out (R,): largest error of every
    result, among pilots, by the model and these modes; by_fixed: of pilots by modes, elements and a lack of stiffening
    that the study fixes, which is told and not held; stiffened: bodies that it leaves open, and which are."""

    fidelity: Fidelity
    modes: int
    left_out: Array
    by_fixed: FewPilots
    stiffened: tuple[str, ...]

    def of(self, study: Study) -> Study:
        """The study with these bodies stiffened."""
        return _stiffened(study, self.stiffened)


class Pilots(NamedTuple):
    """Some variants of a scene, which take a duration (P,) s, at most the longest of all variants."""

    study: Study
    values: VariantValues
    duration: Array
    longest: float

    def stiffened(self, names: Iterable[str]) -> Pilots:
        """The same with some bodies stiffened."""
        return self._replace(study=_stiffened(self.study, names))

    def march(self, model: FloatingModel, steps: int) -> Outcome:
        """What they report by so many steps."""
        return Level(model, steps, steps // STATIONS, USUAL).march(self.values, self.duration)


def choose(study: Study, pilots: VariantValues, duration: Array, longest: float) -> Rung:
    """The model of a scene, by some of its variants that take a duration (P,) s, marched on the coarsest level;
    longest: of all variants (s)."""
    own = Pilots(study, pilots, duration, longest)
    modes, left_out = _enough_modes(own)
    refused = _by_lack_of_stiffening(own, modes, may_stiffen(study, said=False))
    fixed = np.where(np.isinf(refused), np.nan, refused)
    stiffened, by_lack = _those_that_stiffen(own, modes)
    study, own = _stiffened(study, stiffened), own.stiffened(stiffened)
    if stiffened:  # modes that were enough without
        again = _enough_modes(own, min(modes, MOST_MODES // MORE_MODES))
        modes, left_out = again if np.isfinite(again[1]).all() else (modes, left_out)
    left_out = left_out + by_lack
    level = next(iter(levels(study, longest, modes)))
    model, results = level.model, results_of(level.model)
    by_fixed = FewPilots(pilots.columns, fixed + _by_fixed_modes(own, modes) + _by_elements(own, modes))
    full = Rung(Fidelity.FRAME, modes, left_out, by_fixed, stiffened)
    if study.solver.fidelity == "full" or not is_given(model, pilots):
        return full
    cheap, dear = (level.march(pilots, duration, fidelity) for fidelity in (Fidelity.GIVEN_FRAME, Fidelity.FRAME))
    apart = differences(model, cheap, dear)
    known = ~np.isnan(apart).any(axis=0)  # what the floating frame itself has no values of tells nothing
    if not known.any() or (worst(apart, results, pilots)[known] > PART).any():
        return full
    return replace(full, fidelity=Fidelity.GIVEN_FRAME, left_out=left_out + apart[:, known].max(axis=1))


def may_stiffen(study: Study, *, said: bool | None = None) -> tuple[str, ...]:
    """Bodies that what pulls at them would stiffen as they move, or their weight as they stand, of which the study
    says nothing, or that they do not."""
    model = build(study, FIRST_MODES)
    bodies = model.bodies
    frames = {name: frame for name, frame in study.frame.items() if name in bodies and frame.stiffening is said}
    able = [name for name in frames if bodies[name].shortening is not None and bodies[name].omega.size]
    able = [name for name in able if not frames[name].torsion_modes]
    return tuple(name for name in able if not frames[name].stands or softened_by_weight(model, name) > NOTHING)


def _stiffened(study: Study, names: Iterable[str]) -> Study:
    """The study with some bodies stiffened by what pulls at them."""
    frames = {name: study.frame[name].model_copy(update={"stiffening": True}) for name in names}
    return study.model_copy(update={"frame": {**study.frame, **frames}}) if frames else study


def _those_that_stiffen(pilots: Pilots, modes: int) -> tuple[tuple[str, ...], Array]:
    """The bodies that are left open, if it changes what is held by more than a small part of the tolerance in any pilot
    that they stiffen, or no pilot tells, else none; and by how much it changes results (R,) then."""
    names, results = may_stiffen(pilots.study), results_of(build(pilots.study, modes))
    apart = _by_lack_of_stiffening(pilots, modes, names)
    known = ~np.isnan(apart).any(axis=0)
    if not known.any() or (worst(apart, results, pilots.values)[known] > PART).any():
        return names, np.zeros(len(results))
    return (), apart[:, known].max(axis=1)


def _by_lack_of_stiffening(pilots: Pilots, modes: int, names: tuple[str, ...]) -> Array:
    """(R, P) by how much it changes results of pilots that some bodies are stiffened; infinite where they have none
    without, NaN where they have none with it."""
    model = build(pilots.study, modes)
    found: Array = np.zeros((len(results_of(model)), pilots.values.size))
    if not names:
        return found
    stiff = pilots.stiffened(names)
    for factor in FINER:
        steps = usual_steps(model, pilots.longest) * factor
        plain, other = (one.march(build(one.study, modes), steps) for one in (pilots, stiff))
        found = differences(model, plain, other)
        if not np.isnan(found).all(axis=1).any():
            break
    return found


def _enough_modes(pilots: Pilots, first: int = FIRST_MODES) -> tuple[int, Array]:
    """The fewest modes, of so many at first, whose error is a small part of the tolerance, or the most, and that error
    (R,); those that any pilot can be marched with, where none can with more and the steps of the coarsest levels."""
    model = build(pilots.study, FIRST_MODES)
    nothing = np.zeros(len(results_of(model)))
    if not model.is_open:
        return FIRST_MODES, nothing
    found = MOST_MODES, nothing + np.inf
    for factor in FINER:
        all_marched, modes, left_out = _enough_by(pilots, first, usual_steps(model, pilots.longest) * factor)
        found = (modes, left_out) if all_marched or np.isfinite(left_out).all() else found
        if all_marched:
            break
    return found


def _enough_by(pilots: Pilots, modes: int, steps: int) -> tuple[bool, int, Array]:
    """The same by marches of so many steps, whose own error is in all of them; first whether some pilot gets through
    all of them. Else these are the last modes with which one does; their error is infinite where none tells it."""
    coarse, change, told = None, np.array(np.nan), np.full(len(results_of(build(pilots.study, modes))), np.inf)
    while True:
        model = build(pilots.study, modes)
        fine = pilots.march(model, steps)
        if coarse is not None:
            apart = differences(model, coarse, fine)
            left = left_over(apart, change)
            known = ~np.isnan(left).any(axis=0)
            if not known.any():
                return False, modes // MORE_MODES, told
            within = known & (fine.status != Status.BEYOND_THEORY)  # such as what nearly buckles, of many that do not
            known = within if within.any() else known
            before = worst(apart + left, results_of(model), pilots.values)
            if (before[known] <= PART).all():
                return True, modes // MORE_MODES, (apart + left)[:, known].max(axis=1)
            told, change = left[:, known].max(axis=1), apart
            if modes >= MOST_MODES:
                return True, modes, told
        modes, coarse = modes * MORE_MODES, fine


def _by_fixed_modes(pilots: Pilots, modes: int) -> Array:
    """(R, P) the errors of pilots by modes that the study fixes, from twice and four times as many; modes: of bodies
    that leave theirs open."""
    model = build(pilots.study, modes)
    found: Array = np.zeros((len(results_of(model)), pilots.values.size))
    more = _with_more_modes(pilots.study, 2)
    if (pilots.study.body, pilots.study.frame) == (more.body, more.frame):
        return found
    for factor in FINER:
        fixed, twice, four = with_more_modes(pilots, modes, factor)
        change = differences(model, fixed, twice)
        left = left_over(differences(model, twice, four), change)
        found = change + np.where(np.isnan(left), left_over(change, np.full_like(change, np.nan)), left)
        if not np.isnan(found).all(axis=1).any():
            break
    return found


def _by_elements(pilots: Pilots, modes: int) -> Array:
    """(R, P) the errors of pilots by the elements into which the study cuts bodies, from twice as many."""
    model = build(pilots.study, modes)
    found: Array = np.zeros((len(results_of(model)), pilots.values.size))
    bodies = {name: body.with_more_elements(2) for name, body in pilots.study.body.items()}
    if bodies == pilots.study.body:
        return found
    finer = build(pilots.study.model_copy(update={"body": bodies}), modes)
    for factor in FINER:
        steps = usual_steps(model, pilots.longest) * factor
        own, other = (pilots.march(one, steps) for one in (model, finer))
        found = LEFT_BY_ELEMENTS * differences(model, own, other)
        if not np.isnan(found).all(axis=1).any():
            break
    return np.where(np.isinf(found), np.nan, found)


def with_more_modes(pilots: Pilots, modes: int, factor: int) -> Iterator[Outcome]:
    """What pilots report with the modes that the study fixes, twice and four times as many; factor: times the usual
    steps."""
    steps = usual_steps(build(pilots.study, modes), pilots.longest) * factor
    for times in (1, 2, 4):
        study = _with_more_modes(pilots.study, times) if times > 1 else pilots.study
        yield pilots.march(build(study, modes), steps)


def _with_more_modes(study: Study, times: int) -> Study:
    """The study with so many times the modes that it fixes, as far as there may be so many."""
    bodies = {name: body if body.modes_are_open else body.with_more_modes(times) for name, body in study.body.items()}
    frames = {}
    for name, frame in study.frame.items():
        counts = {key: getattr(frame, key) for key in ("lateral_modes", "axial_modes", "torsion_modes")}
        more = {key: min(times * count, MAX_MODES) for key, count in counts.items() if count is not None}
        frames[name] = frame.model_copy(update=more)
    return study.model_copy(update={"body": bodies, "frame": frames})


def is_given(model: FloatingModel, values: VariantValues) -> bool:
    """Whether all frames and places of carriages are given in time: joints are driven, what bodies hang on does not
    bend, no carriage turns with its track, and no springs are between places."""
    hang_on = [model.frame(name).on for name in model.bodies]
    bends = any(on != GROUND and model.bodies[on].omega.size for on in hang_on)
    free = any(joint.coordinate >= 0 for joint in model.joints) or bool(model.places or model.links)
    return not (bends or free or any(_turns(model, values, name) for name in model.study.carriage))


def _turns(model: FloatingModel, values: VariantValues, name: str) -> bool:
    """Whether it matters in some variant how a carriage is turned."""
    if model.study.carriage[name].suspension is not None:
        return False
    keys = [f"carriage.{name}.height", *(f"carriage.{name}.inertia.{axis}" for axis in range(3))]
    has_inertia = model.study.value(f"carriage.{name}.inertia") is not None
    return has_inertia or any(key in values.columns for key in keys) or bool(model.study.value(keys[0]))
