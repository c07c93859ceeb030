"""How do the natural frequencies of the whole scene change with the place of the carriage? At rest, without a march."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from engine.model.distinct_models import base_scene
from engine.model.scene_model import SceneModel
from engine.model.station_path import Along
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.statics.coupled_modes import coupled_frequencies, coupled_modes
from engine.statics.directions import in_all_directions, told, told_of
from results_schema.arrays import Array, Counts
from results_schema.variable import outputs
from results_schema.variables import declare
from studies.at_rest.at_rest import AtRestKind
from studies.at_rest.findings import FREQUENCY_WANTED, enough_modes, frequency_errors, moves_no_track
from studies.at_rest.labelling import BODY_PLACES, COORDINATES
from studies.at_rest.positions import Asked, all_positions
from studies.protocol.study import question_of
from studies.results.findings_common import first_carriage, in_words
from studies.results.formatting import counted, listed, number, ordinal, percent, quantity
from studies.results.places import both_ends, extreme
from studies.results.results import Results

SHOWN = 3  # frequencies that a sentence lists
MEASURED = 6  # positions at which errors are measured, beside the ends
GOLDEN = 0.6180339887498949
_WHOLE = "base_frequency_all_directions"
STILL = 1e-3  # relative change along the way below which a frequency counts as constant


class Question(Asked):
    """The table [question]. modes: how many of the lowest frequencies."""

    modes: int = Field(default=8, ge=1, le=64)

    @property
    def frequencies(self) -> int:
        return self.modes


RESULTS = outputs("""
    frequency | position mode | Hz | nan | natural frequency
        of the coupled system: bodies and carriages together, undamped, the carriages at rest; motions that nothing
        resists are left out; NaN where there is none, or a contact is off the body
    base_frequency | position mode | Hz | alone nan |
        natural frequency of the coupled system, of the scene without sweep
    base_frequency_all_directions | position mode | Hz | optional alone nan |
        natural frequency if masses acted in all directions
        in which their tracks move; of the scene without sweep, where they do not
    mode_shape | on_body position mode body_place | kg-0.5 | alone nan |
        coupled mode shape along every body, of the scene without sweep
        unit modal mass of the whole system; of the kept modes
    frequency_by_mode_count | correction mode_count checked_position mode | Hz | optional alone nan |
        natural frequency with other numbers of modes of every body
        of the scene without sweep
    frequency_unreduced | unreduced_position mode | Hz | optional alone nan |
        natural frequency of the unreduced finite-element model
        of the scene without sweep
    frequency_difference | unreduced_position mode | | optional alone nan |
        relative difference of the natural frequency from that of the unreduced model
""")
declare("eigenfrequencies", *RESULTS, *COORDINATES)


class Eigenfrequencies(AtRestKind):
    """The kind "eigenfrequencies"."""

    name = "eigenfrequencies"
    summary = "natural frequencies and shapes of the coupled system against the carriage's position"
    question = "How do the natural frequencies change with the place of the carriage?"
    drawn_by = "studies.pictures.eigenfrequencies"
    settings = Question

    def check(self, study: Study) -> None:
        """Something moves that has inertia, and positions exist."""
        first_carriage(study)
        forced = study.solver.fidelity in ("force", "static")  # a load, whatever it weighs
        if forced or not any(c.inertial for c in study.carriage.values()):
            what = "forces have no inertia: frequencies do not depend on where they stand"
            expected = '"auto"' if forced else 'a carriage of the kind "mass", "oscillator" or "body"'
            raise study.source.fault("solver.fidelity" if forced else "carriage", what, expected=expected)
        super().check(study)

    def remarks(self, study: Study) -> tuple[str, ...]:
        said = told_of(base_scene(study))
        return (*super().remarks(study), *([said] if said else []))

    def variants(self, model: SceneModel, values: VariantValues, along: Along) -> dict[str, NDArray[Any]]:
        return {"frequency": coupled_frequencies(model, values, along, _count(model.study)) / (2.0 * np.pi)}

    def shapes(self, model: SceneModel, along: Along) -> dict[str, NDArray[Any]]:
        found = coupled_modes(model, VariantValues(model.study, {}, 1), along, _count(model.study))
        lines = []
        for part in model.bodies:
            rows = part.modal.shape(np.linspace(0.0, part.modal.length, BODY_PLACES))
            lines.append(np.einsum("xn,snk->skx", rows, found.shapes[0, :, part.modes]))
        shapes = {"base_frequency": found.omega[0] / (2.0 * np.pi), "mode_shape": _signed(np.stack(lines))}
        whole = in_all_directions(model)
        if whole is model:
            return shapes
        return shapes | {_WHOLE: self.variants(whole, VariantValues(model.study, {}, 1), along)["frequency"][0]}

    def unreduced(self, study: Study, model: SceneModel, positions: Array) -> dict[str, NDArray[Any]]:
        from engine.unreduced.scene import unreduced_model
        from engine.unreduced.statics import unreduced_frequencies

        found = unreduced_frequencies(unreduced_model(study), all_positions(model, positions), _count(study))
        return {"frequency": found}

    def measured(self, count: int) -> Counts:
        """Some that no mode has as its nodes, and both ends: the finer scene takes eight times as long."""
        some = (np.arange(1, MEASURED + 1) * GOLDEN) % 1.0
        return np.unique(np.concatenate([[0, count - 1], (some * count).astype(np.int64)]))

    def inner(self, model: SceneModel) -> dict[str, tuple[str, NDArray[Any]]]:
        mode = ("mode", np.arange(1, _count(model.study) + 1))
        return dict.fromkeys(("frequency", "base_frequency", "mode_shape", _WHOLE), mode)

    def findings(self, results: Results) -> list[str]:
        said = [*_left_out(results), _along(results), *_across(results), *_together(results), *_sweep(results)]
        return [*said, *_unreduced(results), *_mode_counts(results)]


KIND = Eigenfrequencies()


def _left_out(results: Results) -> list[str]:
    """What frequencies would be if masses acted in all directions; none where they do, or that changes nothing."""
    if _WHOLE not in results.dataset:
        return []
    now, then = (np.asarray(results.dataset[name].values) for name in ("base_frequency", _WHOLE))
    text = told(results.study, np.asarray(results.dataset["position"].values), now, then)
    return [f"{text[0].upper()}{text[1:]}."] if text else []


def _across(results: Results) -> list[str]:
    """Which modes do not feel what rides; none where all do."""
    still = np.flatnonzero(moves_no_track(results).all(axis=0)) + 1
    if not still.size:
        return []
    modes = f"mode{'s' * (still.size > 1)} {listed([str(number) for number in still])}"
    verb, feel = ("move", "do not feel") if still.size > 1 else ("moves", "does not feel")
    if any(carriage.pushes for carriage in results.study.carriage.values()):
        return [f"{modes[0].upper()}{modes[1:]} {verb} no track along its loads."]
    return [
        f"{modes[0].upper()}{modes[1:]} {verb} no track along its loads and {feel} {results.carriage_name}, which "
        "presses along the loads alone: its mass across them is in no frequency."
    ]


def _count(study: Study) -> int:
    """How many frequencies are asked for."""
    return question_of(study, Question).modes


def _signed(shapes: Array) -> Array:
    """(B, S, K, X) shapes with signs that do not jump along the way: like those at the position before, and at the
    first one positive where any body moves most."""
    found = shapes.copy()
    flat = np.moveaxis(found, 0, 2).reshape(*shapes.shape[1:3], -1)
    most = np.take_along_axis(flat[0], np.nanargmax(np.abs(np.nan_to_num(flat[0])), axis=1)[:, None], axis=1)[:, 0]
    sign = np.where(most < 0.0, -1.0, 1.0)
    found[:, 0] *= sign[:, None]
    for place in range(1, shapes.shape[1]):
        same = np.sum(flat[place] * flat[place - 1], axis=1)
        sign = np.where(same < 0.0, -sign, sign)
        found[:, place] *= sign[:, None]
    return found


def _along(results: Results) -> str:
    """The lowest frequencies with the carriage in the middle and at the end of its way, or where it stands."""
    base, name = results.dataset["base_frequency"], results.carriage_name
    middle, last = base.sizes["position"] // 2, base.sizes["position"] - 1
    shown = min(SHOWN, base.sizes["mode"])
    parts = [
        f"{listed([number(float(value), 4) for value in here.values[:shown]])} Hz with {name} at "
        f"{quantity(float(here.position), 'm')}"
        for here in (base.isel(position=place) for place in dict.fromkeys((middle, last)))
    ]
    many = "lowest natural frequency is" if shown == 1 else f"{_WORDS[shown]} lowest natural frequencies are"
    of_base = " in the scene without its sweep" if results.size > 1 else ""
    return f"The {many} {listed(parts)}{of_base}."


_WORDS = {2: "two", 3: "three"}


def _together(results: Results) -> list[str]:
    """Which frequency changes most along the way, and where two come closest."""
    base = np.asarray(results.dataset["base_frequency"].values)
    places = results.dataset["position"].values
    said = _changes(base, places) if places.size > 1 else []
    if base.shape[1] > 1:
        gap = np.diff(base, axis=1) / base[:, :-1]
        place = extreme(-gap)
        if place is not None:
            said.append(
                f"Frequencies {place[1] + 1} and {place[1] + 2} come closest, {percent(float(gap[place]))} apart, at "
                f"{quantity(float(places[place[0]]), 'm')}."
            )
    return said


def _changes(base: Array, places: Array) -> list[str]:
    """Which of the frequencies (position, mode) changes most along the way, and which do not."""
    change = np.ptp(base, axis=0) / base.min(axis=0)
    if not np.isfinite(change).any():
        return []
    most, still = int(np.nanargmax(change)), [k + 1 for k in range(change.size) if change[k] < STILL]
    if len(still) == change.size:
        return [f"Along the way no frequency changes by more than {percent(STILL)}."]
    low, high = (float(np.nanmin(base[:, most])), float(np.nanmax(base[:, most])))
    at = float(places[int(np.nanargmin(base[:, most]))]), float(places[int(np.nanargmax(base[:, most]))])
    said = [
        f"Along the way frequency {most + 1} changes most, by {percent(float(change[most]))}: from {number(low, 4)} Hz "
        f"at {quantity(at[0], 'm')} to {number(high, 4)} Hz at {quantity(at[1], 'm')}."
    ]
    if still:
        names = listed([str(mode) for mode in still])
        said.append(
            f"Frequenc{'y' if len(still) == 1 else 'ies'} {names} stay{'s' if len(still) == 1 else ''} within "
            f"{percent(STILL)}."
        )
    return said


def _sweep(results: Results) -> list[str]:
    """Between which values the lowest frequency moves over the sweep."""
    if results.size == 1:
        return []
    first = np.asarray(results.dataset["frequency"].isel(mode=0).values)
    ends = both_ends(first)
    if ends is None:
        return ["No variant has values."]
    places = results.dataset["position"].values
    texts = [
        f"{number(float(first[end]), 4)} Hz{in_words(results, end[:-1])} with {results.carriage_name} at "
        f"{quantity(float(places[end[-1]]), 'm')}"
        for end in ends
    ]
    return [f"Over all {results.size:,} variants the lowest frequency lies between {' and '.join(texts)}."]


def _unreduced(results: Results) -> list[str]:
    """How far the frequencies are from those of the unreduced model."""
    if "frequency_difference" not in results.dataset:
        return []
    found = results.dataset["frequency_difference"]
    worst = extreme(np.abs(found.values))
    if worst is None:
        return []
    positions, modes = found.sizes["unreduced_position"], found.sizes["mode"]
    return [
        f"Against the unreduced finite-element model at {counted(positions, 'position')}, the frequencies up to the "
        f"{ordinal(modes)} differ by at most {percent(abs(float(found.values[worst])))} (frequency {worst[1] + 1} "
        f"with {results.carriage_name} at "
        f"{quantity(float(found['unreduced_position'].values[worst[0]]), 'm')})."
    ]


def _mode_counts(results: Results) -> list[str]:
    """From how many modes on the frequencies are right, with and without the static correction."""
    if "frequency_by_mode_count" not in results.dataset:
        return []
    error, against = frequency_errors(results)
    modes = results.dataset.sizes["mode"]
    return [enough_modes(results, error, FREQUENCY_WANTED, f"frequencies up to the {ordinal(modes)} are", against)]
