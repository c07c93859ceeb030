"""What findings and figures of studies at rest share: errors over the number of modes, and whether contacts vary."""

import numpy as np

from results_schema.arrays import Array, Mask
from studies.results.formatting import listed, percent
from studies.results.results import Results

FREQUENCY_WANTED = 0.002  # relative error of frequencies for which the sentences name a number of modes
READING_WANTED = 1e-4  # the same of readings, over the largest reading
STILL = 1e-6  # of the largest motion of all modes
ROUNDING = 1e-9  # of the largest: what differs by less is the same


def frequency_errors(results: Results) -> tuple[Array, str]:
    """Largest relative error over the frequencies (correction, mode_count, checked_position), and against what; NaN
    where modes are too few to have them all."""
    reference, against = _reference(results, "frequency")
    found = results.dataset["frequency_by_mode_count"].values
    known = np.isfinite(reference)  # of a scene that has fewer than were asked for
    return np.max(np.where(known, np.abs(found / reference - 1.0), 0.0), axis=-1), against


def reading_errors(results: Results, sensor: str) -> tuple[Array, str]:
    """Error of a sensor (correction, mode_count, checked_position) over its largest reading, and against what."""
    reference, against = _reference(results, sensor)
    size = float(np.nanmax(np.abs(reference), initial=0.0))
    found = results.dataset[f"{sensor}_by_mode_count"].values
    nothing = np.isnan(found) & np.isnan(reference)  # under an axle that is off the body
    error = np.where(nothing, 0.0, np.abs(found - reference))
    return error / (size if size > 0.0 else 1.0), against


def _reference(results: Results, name: str) -> tuple[Array, str]:
    """What is right, over the checked positions: the unreduced model where it was computed at all of them, else the
    largest number of modes."""
    found = results.dataset[f"{name}_by_mode_count"]
    here = found["checked_position"].values.tolist()
    full = results.dataset.get(f"{name}_unreduced")
    if full is not None and set(here) <= set(full["unreduced_position"].values.tolist()):
        return np.asarray(full.sel(unreduced_position=here).values), "the unreduced model"
    return np.asarray(found.sel(correction=1).isel(mode_count=-1).values), "the largest number of modes"


def enough_modes(results: Results, error: Array, wanted: float, what: str, against: str) -> str:
    """From how many modes on errors (correction, mode_count, checked_position) stay within what is wanted."""
    counts, texts = results.dataset["mode_count"].values, []
    whole = np.nan_to_num(error, nan=np.inf).max(axis=2)
    for row, words in zip(whole, ("with static correction", "without it"), strict=True):
        worst = np.maximum.accumulate(row[::-1])[::-1]
        enough = [int(count) for count, rest in zip(counts, worst, strict=True) if rest <= wanted]
        texts.append(f"{words} from {enough[0]} modes of every body on" if enough else f"{words} with none of them")
    within = [f"body.{name}.{body.modes_within}" for name, body in results.study.body.items() if body.modes_within]
    limited = whole[0].min() > wanted and bool(within)
    return (
        f"Of {counts[0]} to {counts[-1]} modes of every body, {what} within {percent(wanted)} of {against}: "
        f"{listed(texts)}.{f' All of them lie within {listed(within)}: more of these help.' if limited else ''}"
    )


def moves_no_track(results: Results) -> Mask:
    """(positions, modes) which modes of the scene without sweep move no track along its loads: others sway or twist."""
    shapes = results.dataset["mode_shape"].transpose("position", "mode", "on_body", "body_place").values
    sizes = np.max(np.abs(np.nan_to_num(shapes)), axis=(2, 3))
    return np.asarray(~(sizes > STILL * sizes.max()))


def contacts_vary(results: Results) -> bool:
    """Whether any contact force depends on the position: that of a single mass or force is its weight."""
    found = results.dataset["contact_force"]
    span = (found.max("position") - found.min("position")).values
    return bool(np.nanmax(span, initial=0.0) > ROUNDING * np.nanmax(np.abs(found.values), initial=0.0))
