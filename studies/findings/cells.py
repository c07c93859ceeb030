"""What an archive of cells of variants says: extremes of sensors and contact forces, and how many variants it is of."""

from studies.results.cells import CellRange, End, cell_ranges, words_of
from studies.results.findings_common import told_statuses
from studies.results.formatting import counted, listed, quantity
from studies.results.results import Results

MOST_TOLD = 3


def findings_of_cells(results: Results) -> list[str]:
    """The answer in sentences."""
    ranges = list(cell_ranges(results))
    shown = [name for sensor in results.sensors for name in (f"{sensor}_max", f"{sensor}_min")]
    shown += [f"{name}_contact_force_min" for name, one in results.study.carriage.items() if one.inertial]
    told = [_told(results, one) for one in ranges if one.name in shown][:MOST_TOLD]
    kept = ["the extremes of every result", "the variants that have them", "the numbers of variants by status"]
    kept += ["percentiles"] if results.study.output.percentiles else []
    cells = f" of each of {counted(results.size, 'cell')} ({listed(results.dims)})" if results.dims else ""
    return [
        *told,
        f"Of {counted(results.variants, 'variant')} the archive keeps {listed(kept)}{cells}.",
        *told_statuses(results),
    ]


def _told(results: Results, found: CellRange) -> str:
    """The range of a result and the variants at its ends."""
    ends = (f"{_value(found, end)}{_where(results, end)}" for end in (found.smallest, found.largest))
    return f"{found.name}: from {' to '.join(ends)}."


def _value(found: CellRange, end: End) -> str:
    size = max(abs(found.smallest.value), abs(found.largest.value))
    return quantity(end.value, found.units, beside=size)


def _where(results: Results, end: End) -> str:
    words = (f"{name.replace('_', ' ')} {word}" for name, word in words_of(results, end.at).items())
    return f" at {', '.join(words)} (variant {end.variant:,})"
