"""Every output declared once: name, dimensions, type, unit, meaning.

Checks, attributes in the archive and the table in docs/results.md derive from the declarations here (`shared`) and from
those that each kind of study adds with `declare`. Names are templates: `{sensor}`, `{carriage}` and `{envelope}` stand
for every sensor's, carriage's and envelope's name.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from results_schema.errors import BadInput
from results_schema.quantities import QUANTITIES
from results_schema.shared import MARCH
from results_schema.variable import AXES, EVERY_KIND, REGISTRY, Variable, declare

__all__ = [
    "AXES",
    "EVERY_KIND",
    "MARCH",
    "RESERVED",
    "WHERE_OR_WHEN",
    "Variable",
    "axes",
    "declarations",
    "declare",
    "expand",
    "registered",
    "sensor_unit",
]

_RESERVED_WORDS = """
    direction position phase peak sensor variant speed_ratio mass_ratio station elapsed history mode
    status fidelity_used modes_used steps_used error_estimate result tolerance work
    dynamic_amplification lag loop_area odd_rms even_excess peaks_per_cycle peak_value peak_phase odd_even_ratio
    harmonic frequency error seconds_per_variant fitted_order scheme step_count mode_count quantity critical_step
    critical_mass_ratio relative_step growth multiplier observed_error estimated_error sample
    tool_centre_point_error robot component sensor_unit diverged_step harmonic_number frequency_ratio
    tolerance_asked worst_result left_out scheme_used result_unit swept swept_unit status_name status_count percent
    smallest smallest_error smallest_variant smallest_at largest largest_error largest_variant largest_at percentile
    body_mode track_position
"""
_NONE: Mapping[str, str] = MappingProxyType({})
# Names of results, not usable for a sweep's axis, a sensor or a carriage.
RESERVED: frozenset[str] = frozenset(_RESERVED_WORDS.split())
#: Endings of results that tell where or when something was largest, which jump from one extreme to another.
WHERE_OR_WHEN = ("_position", "_max_time", "_min_time")


def registered() -> dict[str, tuple[Variable, ...]]:
    """Every kind with the declarations of its own, in the order they were made."""
    return {kind: tuple(variables.values()) for kind, variables in REGISTRY.items()}


def declarations(kind: str) -> tuple[Variable, ...]:
    """What a dataset of this kind may hold: the outputs of every kind, then its own (a group: only its own). Raises
    BadInput of a kind that nobody has declared: what is missing would count as without units."""
    if kind.startswith("/"):
        return tuple(REGISTRY.get("/" + kind.split("/")[1], {}).values())
    if kind not in REGISTRY:
        raise BadInput("no such kind of results is declared", where="results", received=repr(kind))
    shared = {} if kind in (EVERY_KIND, AXES) else REGISTRY[EVERY_KIND]
    return tuple({**shared, **REGISTRY[kind]}.values())


def axes() -> dict[str, Variable]:
    """The declared coordinates by name."""
    return dict(REGISTRY[AXES])


def expand(
    kind: str,
    sensors: Mapping[str, str] = _NONE,
    carriages: Sequence[str] = (),
    envelopes: Mapping[str, str] = _NONE,
) -> dict[str, Variable]:
    """The declarations of a kind with the names and units of one study filled in.

    sensors, envelopes: name -> unit. Raises BadInput when two outputs get the same name or a name is reserved.

    >>> expand("march", {"midspan": "m"}, ["table"])["midspan_max"].units
    'm'
    """
    for name in (*sensors, *carriages, *envelopes):
        if name in RESERVED:
            raise BadInput("this name is reserved for results", where=name, remedy="choose another name")
    found: dict[str, Variable] = {}
    for variable in declarations(kind):
        for one in _instances(variable, sensors, carriages, envelopes):
            if one.name in found or (one.name != variable.name and one.name in RESERVED):
                what = "two results would get this name"
                raise BadInput(what, where=one.name, remedy="rename the sensor, carriage or envelope")
            found[one.name] = one
    return found


def _instances(
    variable: Variable, sensors: Mapping[str, str], carriages: Sequence[str], envelopes: Mapping[str, str]
) -> Iterable[Variable]:
    if "{sensor}" in variable.name:
        return [_filled(variable, "sensor", name, unit) for name, unit in sensors.items()]
    if "{carriage}" in variable.name:
        return [_filled(variable, "carriage", name, "") for name in carriages]
    if "{envelope}" in variable.name:
        return [_filled(variable, "envelope", name, unit) for name, unit in envelopes.items()]
    if variable.units == "{sensor}":
        units = set(sensors.values())
        return [replace(variable, units=units.pop() if len(units) == 1 else None)]
    return [variable]


def _filled(variable: Variable, word: str, name: str, unit: str) -> Variable:
    mark = "{" + word + "}"
    return replace(
        variable,
        name=variable.name.replace(mark, name),
        dims=tuple(dim.replace(mark, name) for dim in variable.dims),
        long_name=variable.long_name.replace(mark, name),
        meaning=variable.meaning.replace(mark, name),
        units=None if variable.units is None else variable.units.replace(mark, unit),
    )


def sensor_unit(quantity: str) -> str:
    """The unit of a sensor's quantity; BadInput for an unknown one.

    >>> sensor_unit("bending_moment")
    'N m'
    """
    if quantity not in QUANTITIES:
        raise BadInput("unknown quantity", where="quantity", expected=" | ".join(QUANTITIES), received=repr(quantity))
    return QUANTITIES[quantity].unit
