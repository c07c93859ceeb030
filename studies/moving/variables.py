"""What studies of bodies in moving frames report, declared once."""

from dataclasses import replace

from engine.floating.results import ENDS, OF_CARRIAGES
from results_schema.quantities import AFTER_STOP
from results_schema.variable import outputs
from results_schema.variables import Variable

UNITS = {"position": "m", "speed": "m s-1", "contact_force": "N"}
WORDS = {
    "position": "place",
    "speed": "speed",
    "acceleration_along": "acceleration along the track",
    "acceleration_x": "acceleration along x",
    "acceleration_y": "acceleration along y",
    "acceleration_z": "acceleration along z",
    "contact_force": "contact force",
}
TOUCHED = "of the point that it touches, in the axes of the frame of its body"
MEANT = {
    "position": "along its track",
    "speed": "along its track",
    "contact_force": "positive where it presses",
} | {f"acceleration_{axis}": TOUCHED for axis in "xyz"}
WORD_OF = {"max": "largest", "min": "smallest"}
AT_STATIONS, BETWEEN = "over all stations", "over all stations and, by parabolas, between them"
SLIDING = "over all stations and, where it slides by itself, by parabolas between them"
OF_STOPS = (
    "of a position error, from then on where all joints that carry it, and what goes along their bodies to an end, "
    "have come to it; NaN where that is not within the time"
)
OF_SENSORS = f"{BETWEEN} (of velocities and accelerations at stations alone)"


def _ends(name: str, units: str, words: str, meaning: str) -> list[Variable]:
    found = []
    for end in ENDS:
        word = WORD_OF[end]
        found.append(Variable(f"{name}_{end}", units=units, long_name=f"{word} {words}", meaning=meaning))
        when = f"time of the {word} {words}"
        found.append(Variable(f"{name}_{end}_time", units="s", long_name=when, required=False))
    return found


def _history(name: str, dims: tuple[str, ...], units: str, words: str, meant: str = "") -> Variable:
    gone = "NaN from the moment on at which a carriage is over an end of its track"
    return Variable(
        name,
        ("station", *dims),
        units=units,
        long_name=words,
        meaning=f"{meant}; {gone}" if meant else gone,
        required=False,
        lead="history",
        gaps_allowed=True,
    )


def _of_carriages() -> list[Variable]:
    found = []
    for end, _, _ in OF_CARRIAGES:
        units = UNITS.get(end, "m s-2")
        words = f"{WORDS[end]} of {{carriage}}"
        meant = MEANT.get(end, "")
        where = "; ".join(text for text in (meant, SLIDING if end == "position" else AT_STATIONS) if text)
        name = f"{{carriage}}_{end}"
        found += [*_ends(name, units, words, where), _history(name, (), units, words, meant)]
    return [
        *found,
        Variable(
            "{carriage}_period",
            units="s",
            long_name="period of the motion of {carriage} along its track",
            meaning="mean over the recorded time, between passes of the middle of its way; NaN where it passes that "
            "less than three times",
            required=False,
            nan_allowed=True,
        ),
    ]


RESULTS = (
    Variable(
        "estimated_error",
        ("result",),
        "float32",
        long_name="estimated error of every reported number",
        meaning="of a signal over its own largest value, also of what it is after a stop; of places over the length of "
        "the track; NaN where no estimate exists",
        required=False,
        nan_allowed=True,
    ),
    Variable("steps_used", (), "int32", long_name="number of steps used", meaning="over the whole time"),
    *_ends("{sensor}", "{sensor}", "value of {sensor}", OF_SENSORS),
    Variable("{sensor}_rms", units="{sensor}", long_name="root mean square of {sensor}", meaning="over the whole time"),
    _history("{sensor}", (), "{sensor}", "history of {sensor}"),
    *(
        replace(variable, required=False, nan_allowed=True)
        for variable in _ends(f"{{sensor}}{AFTER_STOP}", "{sensor}", "value of {sensor} after the stop", OF_STOPS)
    ),
    Variable(
        "{sensor}_settling_time",
        units="s",
        long_name="settling time of {sensor}",
        meaning="after the stop, until it stays within its settling_band of where it comes to rest; NaN where that is "
        "less than two longest periods before the end, or no equilibrium is found",
        required=False,
        nan_allowed=True,
    ),
    Variable(
        "{sensor}_move_and_settle_time",
        units="s",
        long_name="time of move and settling of {sensor}",
        meaning="from time 0 until then; NaN as that",
        required=False,
        nan_allowed=True,
    ),
    *_of_carriages(),
    *(
        Variable(
            f"end_{end}",
            ("frame", "component"),
            units="m",
            long_name=f"{WORD_OF[end]} coordinate over the ground of the far end of a track",
        )
        for end in ENDS
    ),
    Variable(
        "energy_change",
        units="J",
        long_name="largest change of the energy of everything",
        meaning="kinetic, elastic, of springs and height; by damping, friction and what is driven, else by the steps",
    ),
    Variable(
        "duration", units="s", long_name="time that was marched", meaning="less where a carriage went over an end"
    ),
    *(
        Variable(
            name,
            ("frame",),
            units="s",
            long_name=f"time at which a body begins to {words}",
            meaning="the first of the recorded ones, also of variants that diverge later; NaN where none is",
            required=False,
            nan_allowed=True,
        )
        for name, words in (
            ("unstiffened_time", "lack 5 % of its stiffness, as it turns fast without `stiffening`"),
            ("bent_time", "bend by more than a tenth of its length"),
        )
    ),
    Variable(
        "buckling_ratio",
        ("frame",),
        long_name="weight that stands on a body at time 0 over that under which it buckles",
        meaning="its own and that of all it carries, by its modes; NaN below a twentieth, and where it is not known",
        required=False,
        nan_allowed=True,
    ),
    _history("end_place", ("frame", "component"), "m", "place over the ground of the far end of a track"),
    _history("frame_place", ("frame", "component"), "m", "place over the ground of the frame of a body"),
    _history("frame_attitude", ("frame", "quaternion"), "", "attitude of the frame of a body, as a unit quaternion"),
    _history("frame_velocity", ("frame", "component"), "m s-1", "velocity over the ground of the frame of a body"),
    _history("frame_rate", ("frame", "component"), "rad s-1", "angular velocity of a body's frame in its axes"),
    _history("kinetic_energy", (), "J", "kinetic energy of everything"),
    _history("potential_energy", (), "J", "elastic energy, that of springs and of height"),
    _history("momentum", ("component",), "kg m s-1", "momentum of everything over the ground"),
    _history("angular_momentum", ("component",), "kg m2 s-1", "angular momentum about the ground's origin"),
    *outputs("""
        * | | | axis str |
        frame | | | | body whose frame it is
        component | | | | component of the vector
        quaternion | | | | part of the quaternion
            w is the scalar one
    """),
)
