"""Studies of a scene with its carriages at rest: the first one at one position after another, every other one where it
starts. Nothing is marched; a kind says what it computes of a scene, and this cuts the work into pieces.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.model.distinct_models import base_scene, scenes, structure
from engine.model.scene_model import SceneModel
from engine.model.station_path import Along, frozen
from engine.scene.carriages import MAX_CONTACTS
from engine.scene.study import Study
from engine.scene.sweep import expand
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts, Mask
from results_schema.errors import BadInput
from results_schema.lazy_imports import xr
from results_schema.status import Fidelity, Status
from studies.at_rest.errors import PART, error_of, finer
from studies.at_rest.labelling import Gathering, asked_coordinates
from studies.at_rest.positions import CORRECTED, Asked, Positions, check_mode_counts, positions_of, with_modes
from studies.protocol.parts import Piece, Work, unlabelled
from studies.protocol.study import PiecedKind, question_of
from studies.results.findings_common import first_carriage
from studies.results.formatting import listed

Named = Mapping[str, NDArray[Any]]

AT_ONCE = 40_000  # variants times positions of one piece
STATION_SECONDS = 1.5e-4  # of one variant at one position, about
UNREDUCED_SECONDS = 0.5  # of one position, about
START_SECONDS, SHAPES_SECONDS = 0.5, 3.0


class AtRestKind(PiecedKind):
    """What a kind computes of a scene at rest: arrays by the names of results. Its pieces are shapes of the base scene,
    all variants, and what is compared."""

    settings: type[Asked] = Asked
    sweeps = True

    @abstractmethod
    def variants(self, model: SceneModel, values: VariantValues, along: Along) -> Named:
        """Results (V, S, ...) of some variants with the riders at `along`; "opened" (V, S) where a contact opens."""

    @abstractmethod
    def shapes(self, model: SceneModel, along: Along) -> Named:
        """Results (B, S, ...) along all bodies, of the scene without sweep."""

    @abstractmethod
    def unreduced(self, study: Study, model: SceneModel, positions: Array) -> Named:
        """Results (S, ...) of the unreduced model, by the names of `variants`."""

    def check_model(self, model: SceneModel) -> None:
        """Refuse a scene that has no answer. Raises BadInput."""

    def measured(self, count: int) -> Counts:
        """At which of so many positions errors are measured."""
        return np.arange(count)

    def fidelity(self, model: SceneModel) -> Fidelity:
        """Which model computes it."""
        return model.fidelity

    @abstractmethod
    def inner(self, model: SceneModel) -> Mapping[str, tuple[str, NDArray[Any]]]:
        """Dimensions of results beyond variant and position: result -> dimension and its coordinate."""

    def check(self, study: Study) -> None:
        """Positions exist, and numbers of modes that every body takes."""
        asked = question_of(study, self.settings)
        positions_of(study, asked)
        check_mode_counts(study, asked)

    def remarks(self, study: Study) -> Sequence[str]:
        name, _ = first_carriage(study)
        train, stays = study.axles.get(name), list[str]()
        for other, carriage in study.carriage.items():
            low, high = carriage.motion.range()
            if other != name and low < high and (train is None or study.axles.get(other) != train):
                stays.append(other)
        if not stays:
            return ()
        alone = f"the first carriage alone, {name}, " if train is None else f"the first train alone, that of {name}, "
        return (f"{alone}is put from place to place; {listed(stays)} {'stay' if stays[1:] else 'stays'} at the start",)

    def coordinates(self, study: Study) -> Mapping[str, NDArray[Any]]:
        asked = question_of(study, self.settings)
        return asked_coordinates(positions_of(study, asked), asked)

    def gather(self, pieces: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
        return Gathering(self, pieces, study).dataset()

    def pieces(self, study: Study) -> list[Piece]:
        from engine.batch.plan import check_memory
        from engine.unreduced.scene import unreduced_model

        model, asked = base_scene(study), question_of(study, self.settings)
        self.check_model(model)
        places, cases = positions_of(study, asked), expand(study)
        if places.unreduced.size:
            check_held(model)
            unreduced_model(study.without_sweep())  # refuses bodies that have none
        count = places.all.size
        check_memory(study, cases.size, 8 * cases.size * _numbers(study, asked, count))
        seconds = SHAPES_SECONDS + count * STATION_SECONDS
        shapes = partial(_shapes, self, study, places)
        found = [Piece("shapes", "shapes of all bodies in the base scene", shapes, seconds)]
        step = max(1, AT_ONCE // count)
        for number, first in enumerate(range(0, cases.size, step)):
            size = min(step, cases.size - first)
            words = f"{size:,} variants at {count} positions" if cases.size > 1 else f"{count} positions"
            compute = partial(_variants, self, study, places, slice(first, first + size))
            seconds, large = START_SECONDS + size * count * STATION_SECONDS, size * _numbers(study, asked, count) * 8
            found.append(Piece(f"variants-{number:04d}", words, compute, seconds, large))
        for modes in asked.mode_counts:
            words = f"{modes} modes of every body at {places.checked.size} positions"
            compute = partial(_with_modes, self, study, places, modes)
            found.append(Piece(f"modes-{modes}", words, compute, START_SECONDS))
        if places.unreduced.size:
            words = f"the unreduced model at {places.unreduced.size} positions"
            seconds = START_SECONDS + UNREDUCED_SECONDS * places.unreduced.size
            found.append(Piece("unreduced", words, partial(_unreduced, self, study, places), seconds))
        return found


def check_held(model: SceneModel) -> None:
    """Refuse a body that nothing holds: it has no static state. Raises BadInput."""
    riding = {carriage.rides for carriage in model.carriages}
    for number, part in enumerate(model.bodies):
        if part.modal.rigid_modes and number not in riding:
            what = "nothing holds this body, so it has no static state"
            raise model.study.source.fault(f"body.{part.name}.supports", what, expected="supports that hold it")


def _numbers(study: Study, asked: Asked, positions: int) -> int:
    """Numbers that are kept of one variant, at most."""
    return 8 + positions * (asked.frequencies or 2 * len(study.sensor) + MAX_CONTACTS * len(study.carriage))


def _shapes(kind: AtRestKind, study: Study, places: Positions, work: Work) -> xr.Dataset:
    """Shapes along all bodies, of the scene without sweep."""
    model = base_scene(study)
    return unlabelled(kind.shapes(model, frozen(model, places.all)))


def _variants(kind: AtRestKind, study: Study, places: Positions, part: slice, work: Work) -> xr.Dataset:
    """Some variants, in the order of the scenes that they share."""
    cases = expand(study)
    everything = np.arange(cases.size, dtype=np.int64)
    chosen = everything[np.argsort(structure(study, cases, everything), kind="stable")][part]
    numbers, found = [], []
    for model, variants in scenes(study, cases, chosen):
        work.check()
        values = VariantValues.of(model.study, cases, variants)
        numbers.append(variants)
        found.append(_evaluated(kind, model, values, places))
    joined = {name: np.concatenate([one[name] for one in found]) for name in found[0]}
    return unlabelled({"number": np.concatenate(numbers), **joined})


def _evaluated(
    kind: AtRestKind, model: SceneModel, values: VariantValues, places: Positions
) -> dict[str, NDArray[Any]]:
    """Results of some variants of a scene, with NaN where a contact is off the body, or all axles of a train are."""
    along = frozen(model, places.all)
    found = dict(kind.variants(model, values, along))
    gone = _gone(model, along)
    opened = found.pop("opened", np.zeros((values.size, places.all.size), dtype=np.bool_)) & ~gone
    for array in found.values():
        array[:, gone] = np.nan
    errors, declared = _errors(kind, model, values, places.all, found), model.study.results(kind.name)
    found = {name: values.in_si(declared[name].units or "1", array) for name, array in found.items()}
    found |= errors
    found["status"] = np.where(opened.any(axis=1), Status.SEPARATED, Status.OK)
    found["fidelity"] = np.full(values.size, int(kind.fidelity(model)))
    found["modes"] = np.full(values.size, model.body_modes)
    return found


def _gone(model: SceneModel, along: Along) -> Mask:
    """(S,) where the first carriage is off its body with any contact, or its whole train is."""
    train = model.study.axles.get(model.carriages[0].name)
    own = {0, *(load.rider for load in model.carriages[0].loads)}
    axles = {number for number, one in enumerate(model.carriages) if model.study.axles.get(one.name) == train}
    on = np.stack([here for rider in (own if train is None else axles) if (here := along[rider].here) is not None])
    return np.asarray(~(on.all(axis=0) if train is None else on.any(axis=0)))


def _errors(kind: AtRestKind, model: SceneModel, values: VariantValues, positions: Array, found: Named) -> Named:
    """Errors of the results of some variants of a scene; NaN where it has no finer one."""
    here = kind.measured(positions.size)
    own = {name: array[:, here] for name, array in found.items()}
    try:
        closer = finer(model)
    except BadInput:
        return {f"{PART}{name}": np.full((values.size, *array.shape[2:]), np.nan) for name, array in own.items()}
    other = kind.variants(closer, values, frozen(closer, positions[here]))
    return {f"{PART}{name}": error_of(name, array, other[name]) for name, array in own.items()}


def _with_modes(kind: AtRestKind, study: Study, places: Positions, modes: int, work: Work) -> xr.Dataset:
    """Results with another number of modes of every body, with and without static correction."""
    found = []
    for correction in CORRECTED:
        model = base_scene(with_modes(study, modes, correction))
        along = frozen(model, places.all[places.checked])
        found.append(
            {name: one[0] for name, one in kind.variants(model, VariantValues(model.study, {}, 1), along).items()}
        )
    names = [name for name in found[0] if name != "opened"]
    return unlabelled({name: np.stack([one[name] for one in found]) for name in names})


def _unreduced(kind: AtRestKind, study: Study, places: Positions, work: Work) -> xr.Dataset:
    """Results of the unreduced model, and those of the modes at the same positions."""
    model, positions = base_scene(study), places.all[places.unreduced]
    reduced = kind.variants(model, VariantValues(model.study, {}, 1), frozen(model, positions))
    full = kind.unreduced(study.without_sweep(), model, positions)
    return unlabelled({**full, **{f"{name}_reduced": reduced[name][0] for name in full}})
