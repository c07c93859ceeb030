"""The outputs that kinds of study share: coordinates, what every kind has, marches, and the groups of an archive."""

from __future__ import annotations

from dataclasses import replace

from results_schema.status import Fidelity, SchemeUsed, Status
from results_schema.variable import AXES, EVERY_KIND, Variable, axis, declare


def _planned(name: str, long_name: str, units: str = "", dtype: str = "float64") -> Variable:
    return replace(axis(name, long_name, units, dtype), planned=True)


declare(
    AXES,
    Variable(
        "speed_ratio",
        long_name="speed ratio",
        meaning="speed over omega_1 L / pi, L the length of the track",
        required=False,
    ),
    Variable("mass_ratio", long_name="mass ratio", meaning="carriage mass over body mass", required=False),
    axis("position", "position of the first carriage on its track", "m"),
    axis("phase", "phase of the last cycle", meaning="0 to 1, 0 where the motion's formula starts"),
    axis("station", "number of the recorded instant", dtype="int64"),
    Variable(
        "elapsed",
        ("position|phase|station",),
        units="s",
        long_name="time since the start",
        required=False,
        lead="history",
    ),
    axis("history", "flat number of the variant in the sweep's grid, last axis fastest", dtype="int64"),
    axis("variant", "number of the variant of a sampled or zipped sweep", dtype="int64"),
    axis("direction", "direction of travel", dtype="str", meaning="forward is from start to end"),
    axis("sensor", "sensor", dtype="str"),
    Variable("sensor_unit", ("sensor",), "str", long_name="unit of the sensor", required=False, lead="none"),
    axis("result", "reported number", dtype="str"),
    axis("peak", "number of the peak in the cycle", dtype="int64"),
    axis("mode", "number of the mode, from 1", dtype="int64"),
    axis("sample", "flat number of the variant that was run again", dtype="int64"),
    axis("scheme", "time integration scheme", dtype="str"),
    axis("step_count", "steps over one passage or cycle", dtype="int64"),
    axis("mode_count", "number of modes", dtype="int64"),
    axis("quantity", "measured quantity", dtype="str"),
    axis("relative_step", "omega_1 times the time step"),
    _planned("robot", "robot", dtype="str"),
    _planned("component", "component of the vector", dtype="str"),
)

declare(
    EVERY_KIND,
    Variable("status", (), "int8", None, "status of the variant", "the most serious that applies", Status),
    Variable("fidelity_used", (), "int8", None, "model used", "the cheapest that holds the tolerance", Fidelity),
    Variable(
        "modes_used",
        (),
        "int32",
        long_name="number of modes used",
        meaning="0 where results are static: by exact influence lines",
    ),
    Variable("steps_used", (), "int32", long_name="number of steps used", meaning="steps over one passage or cycle"),
    Variable(
        "scheme_used",
        (),
        "int8",
        None,
        "time integration scheme used",
        "of average acceleration and Fox-Goodwin the cheaper one that holds the tolerance, where it is left open",
        SchemeUsed,
        required=False,
    ),
    Variable(
        "diverged_step",
        (),
        "int64",
        long_name="first step at which the variant had diverged",
        meaning="counted from the start; -1 where it did not diverge",
        required=False,
    ),
    Variable(
        "work",
        long_name="work of the variant",
        meaning="modes x steps of its own march over one passage or cycle; 0 for statics",
        required=False,
    ),
    Variable(
        "error_estimate",
        long_name="estimated relative error",
        meaning="the largest of estimated_error over the results that are held to a tolerance; NaN where none is, or "
        "where no estimate exists",
        required=False,
        nan_allowed=True,
    ),
    Variable(
        "estimated_error",
        ("result",),
        "float32",
        long_name="estimated error of every reported number",
        meaning="over the largest static value of the sensor (velocity and acceleration: over its own largest value; "
        "contact forces: over the weight; positions and lags: over the length of the track and of the cruise; indices: "
        "as they are); of places no less than a step; NaN where no estimate exists",
        required=False,
        nan_allowed=True,
    ),
    Variable(
        "tolerance",
        ("result",),
        long_name="tolerance of every reported number",
        meaning="that of its sensor, else solver.tolerance; NaN where the error is reported, but not held",
        required=False,
        nan_allowed=True,
        lead="none",
    ),
)


def _extreme(which: str, word: str) -> tuple[Variable, Variable]:
    return (
        Variable(
            f"{{sensor}}_{which}",
            units="{sensor}",
            long_name=f"{word} value of {{sensor}}",
            meaning="over all step instants (asymmetry, double-peak: of the last cycle)",
        ),
        Variable(
            f"{{sensor}}_{which}_position",
            units="m",
            long_name=f"position of the first carriage at the {word} value of {{sensor}}",
            meaning="of the first one also where the sensor is under another; NaN where it was off its body, as the "
            "first axle of a train often is by then",
            nan_allowed=True,
        ),
    )


EXTREMES: tuple[Variable, ...] = (*_extreme("max", "largest"), *_extreme("min", "smallest"))
ROOT_MEAN_SQUARES: tuple[Variable, ...] = (
    Variable(
        "{sensor}_rms",
        units="{sensor}",
        long_name="root mean square of {sensor}",
        meaning="averaged over the recorded time; of sensors under a carriage, over the time that it is on the body",
        required=False,
    ),
)
CONTACT_FORCES: tuple[Variable, ...] = (
    Variable(
        "{carriage}_contact_force_max",
        units="N",
        long_name="largest contact force of {carriage}",
        meaning="over 0-98 % of the span; NaN where the carriage is never there",
        nan_allowed=True,
    ),
    Variable(
        "{carriage}_contact_force_min",
        units="N",
        long_name="smallest contact force of {carriage}",
        meaning="over 0-98 % of the span; NaN where the carriage is never there",
        nan_allowed=True,
    ),
    Variable(
        "{carriage}_contact_force_min_position",
        units="m",
        long_name="position of {carriage} at its smallest contact force",
        meaning="of its reference; NaN where that is off the body, or it never touches it",
        nan_allowed=True,
    ),
    Variable(
        "{carriage}_separation_position",
        units="m",
        long_name="first position of {carriage} with a negative contact force",
        meaning="NaN where the contact holds",
        nan_allowed=True,
        required=False,
    ),
)
HISTORIES: tuple[Variable, ...] = (
    Variable(
        "{sensor}",
        ("position|phase|station",),
        units="{sensor}",
        long_name="history of {sensor}",
        meaning="at the instants of `elapsed`; NaN where a sensor under a carriage is off the body",
        required=False,
        lead="history",
        gaps_allowed=True,
    ),
    Variable(
        "{carriage}_position",
        ("position|phase|station",),
        units="m",
        long_name="position of {carriage}",
        meaning="NaN where it is off the body",
        required=False,
        lead="history",
        gaps_allowed=True,
    ),
)
ENVELOPES: tuple[Variable, ...] = (
    *(
        Variable(
            f"{{envelope}}_envelope_{which}",
            ("{envelope}_place",),
            units="{envelope}",
            long_name=f"{word} value at each place of {{envelope}}",
            meaning="over the instants over which extremes of sensors are taken",
        )
        for which, word in (("max", "largest"), ("min", "smallest"))
    ),
    Variable(
        "{envelope}_place",
        ("{envelope}_place",),
        units="m",
        long_name="place of {envelope} along its body",
        meaning="coordinate of the envelope",
        required=False,
        lead="none",
    ),
)
MARCH: tuple[Variable, ...] = (*EXTREMES, *ROOT_MEAN_SQUARES, *CONTACT_FORCES, *HISTORIES, *ENVELOPES)

declare("march", *MARCH)

declare(
    "/model",
    Variable("frequency", ("mode",), units="Hz", long_name="natural frequency of the body", lead="none"),
    Variable("damping_ratio", ("mode",), long_name="damping ratio of the mode", lead="none", required=False),
    Variable(
        "mode_shape",
        ("mode", "position"),
        units="kg-0.5",
        long_name="mode shape on the track",
        meaning="unit modal mass",
        lead="none",
        required=False,
    ),
    Variable("length", units="m", long_name="length of the track", lead="none"),
    Variable("mass", units="kg", long_name="mass of the body", lead="none"),
    Variable(
        "first_frequency",
        units="Hz",
        long_name="lowest elastic natural frequency of the body",
        meaning="of a body out of files, over the axes of the sweep that change it",
        lead="some",
        required=False,
    ),
)


def _history(name: str, words: str, meaning: str = "") -> Variable:
    dims = ("sample", "sensor", "station")
    return Variable(name, dims, units=None, long_name=words, meaning=meaning, lead="none", nan_allowed=True)


def _gap(name: str, words: str, meaning: str) -> Variable:
    return Variable(name, ("sample", "sensor"), long_name=words, meaning=meaning, lead="none", nan_allowed=True)


_SAMPLED = ("sample", "station")
declare(
    "/unreduced",
    _history("marched", "history by the march of modes", "in the unit of its sensor"),
    _history("marched_static", "static response by the modes at the same places"),
    _history("unreduced", "history by the unreduced finite-element model"),
    _history("unreduced_static", "static response by the unreduced model at the same places"),
    Variable("elapsed", _SAMPLED, units="s", long_name="time since the start", lead="none", nan_allowed=True),
    Variable(
        "position",
        _SAMPLED,
        units="m",
        long_name="position of the first carriage",
        meaning="NaN where it is off its body",
        lead="none",
        nan_allowed=True,
    ),
    _gap(
        "difference",
        "largest difference of both models",
        "of their histories, over the range of the unreduced model's; NaN where that does not vary",
    ),
    _gap(
        "dynamic_difference",
        "largest difference of the dynamic parts",
        "history less static response at the same places, each model with its own; over the range of the unreduced "
        "model's dynamic part",
    ),
    _gap(
        "static_difference",
        "largest difference of the static responses",
        "of both models at the same places, over the range of the unreduced model's",
    ),
    _gap("dynamic_range", "range of the unreduced model's dynamic part", "of that part, over the range of its history"),
    Variable("sensor_quantity", ("sensor",), "str", long_name="quantity of the sensor", lead="none"),
    Variable(
        "degrees_of_freedom",
        ("sample",),
        "int64",
        long_name="degrees of freedom of the unreduced model",
        lead="none",
    ),
    Variable(
        "unreduced_steps",
        ("sample",),
        "int64",
        long_name="steps of the unreduced model over the whole way",
        lead="none",
    ),
)


def _audited(name: str, words: str, meaning: str, dims: tuple[str, ...] = ("sample", "result")) -> Variable:
    return Variable(name, dims, long_name=words, meaning=meaning, lead="none", nan_allowed=True)


declare(
    "/audit",
    _audited(
        "observed_error",
        "observed error of every reported number",
        "difference from the same variant marched with all terms, more modes and more steps until nothing that is held "
        "changes, and one level beyond; over what estimated_error is divided by; NaN where it could not be compared",
    ),
    _audited("estimated_error", "estimated error of every reported number", "that of the archive"),
    _audited("tolerance", "tolerance of every reported number", "NaN where none is held", ("result",)),
    _audited("tolerance_asked", "solver.tolerance of the variant over that of the study", "", ("sample",)),
    Variable(
        "variant_status",
        ("sample",),
        "int8",
        long_name="status of the variant",
        meaning="that of the study: no tolerance is promised but to those that are ok",
        flags=Status,
        lead="none",
    ),
    Variable(
        "left_out",
        (),
        "int64",
        long_name="variants that were picked for the audit and could not be compared",
        meaning="not among the samples: no values, no reference, or none but the very march of the archive",
        lead="none",
    ),
)
