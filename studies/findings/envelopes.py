"""What envelopes say: the largest value anywhere along a body, and where it is beyond the limit of a question."""

import numpy as np

from results_schema.arrays import Array
from studies.findings.absolute_errors import uncertainty
from studies.findings.beyond import largest_size, limits_of, told_limit
from studies.results.formatting import quantity
from studies.results.places import extreme
from studies.results.results import Results


def sizes_along(results: Results, name: str) -> Array:
    """The largest absolute value of an envelope along its body, in the sweep's shape."""
    return np.asarray(np.maximum(*(np.abs(results.envelope(name, end)).max(axis=-1) for end in ("max", "min"))))


def nearest_to_limits(results: Results) -> list[str]:
    """Envelopes by the part of a limit that they reach, those without a limit last, in the order of the file."""
    part = {name: size / limit for name, (size, limit) in _beside_limits(results).items()}
    return sorted(results.envelopes, key=lambda name: -part.get(name, -1.0))


def beyond_sensors(results: Results) -> list[str]:
    """Envelopes with a limit that are larger somewhere than at every sensor of their quantity, by the part of it."""
    size = {name: found for name, (found, _) in _beside_limits(results).items()}
    return [name for name in nearest_to_limits(results) if name in size and size[name] > _at_sensors(results, name)]


def _at_sensors(results: Results, name: str) -> float:
    """The largest absolute value of sensors of bodies that read what an envelope is of."""
    read, sensors = results.study.envelope[name].quantity, results.study.sensor.items()
    own = [key for key, sensor in sensors if sensor.quantity == read and sensor.carriage is None]
    return max(0.0, *(largest_size(results, key) for key in own)) if own else 0.0


def _beside_limits(results: Results) -> dict[str, tuple[float, float]]:
    """The largest absolute value of every envelope that has a limit, and that."""
    limits, found = limits_of(results.study), dict[str, tuple[float, float]]()
    for name, envelope in results.study.envelope.items():
        if (limit := limits.limit(envelope.quantity)) is not None:
            found[name] = (float(np.nanmax(sizes_along(results, name)[results.with_values], initial=0.0)), limit)
    return found


def told_envelopes(results: Results) -> list[str]:
    """A sentence on every envelope."""
    return [told_along(results, name) for name in results.envelopes]


def told_along(results: Results, name: str) -> str:
    """The largest value anywhere along the body of an envelope, and where its limit is exceeded."""
    limit = limits_of(results.study).limit(results.study.envelope[name].quantity)
    units, said = results.envelopes[name], f"{name}: {largest_along(results, name)}."
    return said if limit is None else f"{said}{told_limit(results, sizes_along(results, name), limit, units)}"


def largest_along(results: Results, name: str) -> str:
    """The value of largest size anywhere along a body, where and in which variant, without its full stop."""
    ends, envelope = [results.envelope(name, end) for end in ("max", "min")], results.study.envelope[name]
    upper = np.abs(ends[0]) >= np.abs(ends[1])
    values = np.where(upper, *ends)
    place = extreme(np.where(results.with_values[..., None], np.abs(values), np.nan))
    if place is None:
        return "no variant has values"
    result = f"{name}_envelope_{'max' if upper[place] else 'min'}"
    value = f"{quantity(float(values[place]), results.envelopes[name])}{uncertainty(results, result, place[:-1])}"
    at = quantity(float(results.dataset[f"{name}_place"].values[place[-1]]), "m")
    held = "while the contact holds, " if not results.held.all() and results.held.any() else ""
    which = results.at(place[:-1])
    return (
        f"{held}the largest {results.noun_along(name)} along {envelope.body} is {value}, at {at} of its track"
        f"{f' ({which})' if which else ''}"
    )
