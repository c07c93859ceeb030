"""What a run of a study of frames that move will take, from some of its pieces, which are computed as it does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from engine.kernels.compiling import clock_without_compiling
from engine.march.stepper import Halted
from results_schema.status import Status, label
from studies.moving.parts import AUDIT_SECONDS, again, pieces, scenes, seconds_of_marches
from studies.protocol.parts import Foreseen, Piece, TextTable, Work, unlabelled
from studies.protocol.stopping import AskedElsewhere
from studies.results.formatting import counted, listed, number, scientific, spanned
from studies.results.places import spread

if TYPE_CHECKING:
    import xarray as xr

    from engine.scene.study import Study
    from results_schema.arrays import Array, Mask
    from studies.moving.parts import Scene

Clock = Callable[[], float]

PATIENCE = 10.0  # s of measuring, in which one piece is to be finished
MEASURED = 3  # pieces
#: s after which no further piece is measured, nor an audited variant: built-in studies are foreseen within 1.35 by the
#: first piece alone.
ENOUGH = 1.0
UNFINISHED = 2.0  # times the seconds in which a piece was not done that it takes
MODES_TOGETHER, SHOWN = 8, 6  # of bending, where these are open; lowest frequencies of all together
HEADINGS = ("variants", "modes of all bodies", "steps", "estimated error", "status")


def foreseen(
    study: Study, duration: Callable[[Mapping[str, Array], int], Array], threads: int, audited: int
) -> Foreseen:
    """What a run takes, by some of its pieces and one audited variant; duration: (V,) s of variants by columns."""
    from engine.scene.sweep import expand

    everything, own = pieces(study, duration), scenes(study, expand(study))
    _compile(own[0])
    with clock_without_compiling() as clock:
        begun = clock()
        found = _computed(everything, threads, clock)
        took = clock() - begun
        audited = 0 if study.solver.audit == "auto" and _audits_are_too_dear(everything, found) else audited
        each = _audit(study, duration, own[0], threads, clock) if found and audited and took < ENOUGH else None
    share = _share(everything, found)
    seconds = (took if found else UNFINISHED * took) / share
    if audited:
        at_once = np.ceil(min(audited, len(own)) / threads)
        seconds += at_once * each if each else AUDIT_SECONDS * audited * seconds / expand(study).size
    less = "" if found else f"{PATIENCE:.0f} seconds were not enough for a piece of it: this may take longer"
    title = f"What {counted(len(found), 'piece')} of {len(everything):,} took, as in a run"
    rows = [_row(part, _held(study)) for part in found.values()]
    size = sum(part.nbytes for part in found.values()) / share
    return Foreseen(study, TextTable(title, HEADINGS, rows), float(seconds), int(size), audited, less)


def _share(everything: Sequence[Piece], found: Mapping[int, xr.Dataset]) -> float:
    """The part of all pieces that some of them are; of the first where there are none."""
    known = [everything[number] for number in found] or everything[:1]
    return sum(piece.seconds for piece in known) / sum(piece.seconds for piece in everything)


def _audits_are_too_dear(everything: Sequence[Piece], found: Mapping[int, xr.Dataset]) -> bool:
    """Whether a run audits nothing, by what the variants of some pieces were computed with."""
    if not found:
        return False
    used = (np.concatenate([part[name].values for part in found.values()]) for name in ("modes_used", "steps_used"))
    some = seconds_of_marches(*used)
    return some._replace(whole=some.whole / _share(everything, found)).too_dear


def _compile(scene: Scene) -> None:
    """A march of two steps, stored as a piece is, so that what is measured begins with kernels and libraries."""
    from engine.floating.converge import levels
    from engine.floating.model_choice import FIRST_MODES
    from engine.scene.variants import VariantValues

    level = next(iter(levels(scene.study, 1.0, FIRST_MODES)))
    values = VariantValues(scene.study, {}, 1)
    found = replace(level, steps=2, every=1).march(values, np.full(1, 2.0 / level.steps))
    unlabelled({"history": found.history})


def _computed(everything: Sequence[Piece], threads: int, clock: Clock) -> dict[int, xr.Dataset]:
    """Some pieces by their numbers, as far as there is time."""
    begun, found = clock(), dict[int, "xr.Dataset"]()
    work = Work(threads, AskedElsewhere(lambda: clock() > begun + PATIENCE))
    for place in spread(len(everything), MEASURED):
        if found and clock() > begun + ENOUGH:
            break
        try:
            found[place] = everything[place].compute(work)
        except Halted:
            break
    return found


def _audit(
    study: Study, duration: Callable[[Mapping[str, Array], int], Array], scene: Scene, threads: int, clock: Clock
) -> float | None:
    """Seconds of one audited variant; None where there is no time for it."""
    begun = clock()
    work = Work(threads, AskedElsewhere(lambda: clock() > begun + PATIENCE))
    try:
        again(study, duration, scene.variants[:1], work)
    except Halted:
        return None
    return clock() - begun


def _held(study: Study) -> Mask:
    """(R,) results that are held to a tolerance."""
    from engine.floating.model import build
    from engine.floating.results import results_of

    return np.isfinite([result.tolerance for result in results_of(build(study.without_sweep(), 2))])


def _row(part: xr.Dataset, held: Mask) -> tuple[str, ...]:
    """What the variants of a piece were marched with; held: results (R,) that count."""
    error, status = part["estimated_error"].values[:, held], np.unique(part["status"].values)
    worst = scientific(float(np.nanmax(error))) if np.isfinite(error).any() else ""
    words = listed([label(Status(int(one))) for one in status])
    variants = f"{int(part['number'].values[0]):,} to {int(part['number'].values[-1]):,}"
    modes = spanned(part["modes_used"].values.astype(float))
    return variants, modes, spanned(part["steps_used"].values.astype(float)), worst, words


def together(study: Study) -> Iterator[TextTable]:
    """The lowest natural frequencies of all bodies and carriages of a scene together, where these say more than those
    of each body."""
    from engine.floating.frequencies import natural_vibrations
    from engine.floating.model import build

    if len(study.body) + len(study.carriage) < 2:
        return
    found = natural_vibrations(build(study.without_sweep(), MODES_TOGETHER))
    if found is not None:
        frequencies = [number(float(one) / (2.0 * np.pi)) for one in found.omega[:SHOWN]]
        ratios = [number(float(one), 2) for one in found.damping_ratio[:SHOWN]]
        more = " ..." if found.omega.size > SHOWN else ""
        title = "All together at time 0, driven joints held, without gravity"
        row = tuple(", ".join(one) + more for one in (frequencies, ratios))
        yield TextTable(title, ("frequencies (Hz)", "damping ratios"), [row])
