"""Mistakes that people make: the exit code, and the words by which they find out what to change."""

from pathlib import Path

import pytest

from results_schema.errors import BadInput
from studies.commands.cli import main
from tests.studies.small import SMALL

SWEEP = SMALL[SMALL.index("speed = { of") : SMALL.index("[solver]")]
pytestmark = pytest.mark.usefixtures("here")
OTHER = SMALL.replace("density = 1000.0", "density = 7850.0")


def axis(text: str) -> str:
    """The study with this sweep."""
    return SMALL.replace(SWEEP, text + "\n")


def moved(keys: str) -> str:
    """The study with a point-to-point motion that has these keys."""
    limits = keys if "accel" in keys else f"acceleration = 40, {keys}"
    return SMALL.replace('"cruise"', '"point-to-point"').replace("speed = 5.0 }", f"speed = 5.0, {limits} }}")


def trained(keys: str) -> str:
    """The study with a train that has these keys in place of the carriage and what is swept."""
    train = f'[train.ice]\nkind = "force"\non = "beam"\nforce = 1.0\n{keys}\n'
    motion = 'motion = { kind = "cruise", start = 0.0, end = 1.0, speed = 5.0 }\n'
    sensor = '[sensor.middle]\nbody = "beam"\nat = 0.5\n'
    return SMALL[: SMALL.index("[carriage.trolley]")] + train + motion + sensor


# what was written instead of what -> exit code, words
MISTAKES = {
    "a swept scheme": (axis('scheme = { of = "solver.scheme", values = ["auto"] }'), 2, ["word cannot be swept"]),
    "swept supports": (axis('s = { of = "body.beam.supports", values = ["free-free"] }'), 2, ["word cannot be swept"]),
    "a kind with a capital": (SMALL.replace('kind = "passage"', 'kind = "Passage"'), 2, ['mean "passage"?']),
    "a row twice": (
        axis('zip = true\na = { of = "carriage.trolley.motion.speed", values = [1, 3, 2, 3] }\n'
             'b = { of = "carriage.trolley.mass", values = [0.1, 0.2, 0.2, 0.2] }'),
        2, ["sweep: zipped axes repeat a variant; received 1 repeated, first entry 4 as entry 2 of every axis"],
    ),
    "second moment in mm4": (
        OTHER.replace("= 1e-6", "= 1e6"), 2, ["body.beam.second_moment", "no beam has this", '"1e+06 mm^4"'],
    ),
    "a damper's unit run together": (
        OTHER.replace("= 1e9", '= "9 kNs/m"'), 2, ["no such unit", 'did you mean "kN s"?'],
    ),
    "the second moment in another power": (
        OTHER.replace("= 1e-6", '= "1128 cm2"'), 2, ["where a second moment", 'did you mean "1128 cm4"?'],
    ),
    "a plural of a symbol": (OTHER.replace("= 1e9", '= "9 GPas"'), 2, ["no such unit", 'did you mean "GPa"?']),
    "a limit of what nothing reads": (
        SMALL + '[question]\nstress = "100 MPa"\n',
        2, ["question.stress: a limit of stress, which nothing here reads", 'a sensor with quantity = "stress"'],
    ),
    "a limit of dynamic parts alone": (
        SMALL + "[question]\ndynamic_part = { displacement = 1e-3 }\n",
        2, ["question.dynamic_part.displacement", 'and part = "dynamic"'],
    ),
    "modulus without GPa": (OTHER.replace("= 1e9", "= 210"), 0, ["youngs_modulus = 210 Pa", '"210 GPa"']),
    "MPa in place of GPa": (
        SMALL.replace("= 1e9", "= 2.1e8").replace("= 1000.0", "= 7850"), 0, ["youngs_modulus = 2.1e+08 Pa", "denser"],
    ),
    "fibres in mm": (
        SMALL.replace("area =", "fibre_distance = 220\narea ="), 0, ["fibre_distance = 220 m", '"220 mm"'],
    ),
    "a spring in kN/m": (
        SMALL.replace('kind = "mass"', 'kind = "oscillator"\nstiffness = 0.2\ndamping = 0.04'),
        0, ["trolley swings at 0.071 Hz", "kilonewtons per metre meant?", "0.0712 to 0.225 Hz  0.0447 to 0.141"],
    ),
    "millinewtons": (
        SMALL.replace('kind = "mass"', 'kind = "oscillator"\nstiffness = "2 mN/m"'),
        0, ['carriage.trolley.stiffness = "2 mN/m"', "a thousandth of N; was MN, a million, meant?"],
    ),
    "a spring by its frequency": (
        SMALL.replace('kind = "mass"', 'kind = "oscillator"\nstiffness = "1.5 Hz"'),
        2, ["a frequency (Hz) where a stiffness (N/m) is wanted", "m (2 pi f)^2", "88.8264 N/m for each kg"],
    ),
    "millipascals": (OTHER.replace("= 1e9", '= "210000 mPa"'), 0, ["mPa is a thousandth of Pa; was MPa"]),
    "distances of axles in mm": (
        trained("spacing = [2500, 15000, 2500]").replace("speed = 5.0", "speed = 500.0"),
        0, ["axles of train ice stand up to 15000 m apart, 20000 m in all: were millimetres meant?"],
    ),
    "a length in mm that is in m": (
        SMALL.replace("length = 1.0", 'length = "1 mm"'),
        2, ["body.beam.length = 0.001", "another unit of the place or of the length"],
    ),
    "a mass by its weight": (
        SMALL.replace("\nmass = 1.0", '\nmass = "180 kN"'),
        2, ["a force (N) where a mass (kg) is wanted", '"18348.6 kg"', 'kind = "force" is a weight alone'],
    ),
    "a unit without a number": (
        SMALL.replace("at = 0.5", 'at = "mm"'), 2, ["sensor.midspan.at", 'received "mm"; remedy: "1 mm"'],
    ),
    "a place in words": (SMALL.replace("at = 0.5", 'at = "midspan"'), 2, ["sensor.midspan.at", "places are numbers"]),
    "density in g/cm3": (SMALL.replace("= 1000.0", "= 7.85"), 0, ["density = 7.85", '"7.85 g/cm^3"']),
    "length in mm": (SMALL.replace("length = 1.0", "length = 15000"), 0, ["length = 15000 m", '"15000 mm"']),
    "a way in mm": (SMALL.replace("end = 1.0", "end = 1000"), 0, ["goes from 0 to 1000 m", "units"]),
    "gravity below sweep": (axis(SWEEP + "gravity = 1.62"), 2, ["sweep.gravity", "at the top of the file"]),
    "gravity below a sensor": (SMALL.replace("at = 0.5", "at = 0.5\ngravity = 9.81"), 2, ["at the top of the file"]),
    "scheme below sweep": (axis(SWEEP + 'scheme = "auto"'), 2, ["scheme is a key of [solver]"]),
    "an axis as a list": (axis("mass = [1, 2]"), 2, ["sweep.mass", "{ of = "]),
    "two of three numbers": (
        SMALL + "[frame.beam]\nposition = [1, 2]\n",
        2, ["frame.beam.position: this list is too short; expected 3 entries, received [1, 2]"],
    ),
    "an axis of one unit": (
        axis('v = { of = "carriage.trolley.motion.speed", from = "2 km/h", to = 160, count = 3 }'),
        2, ["sweep.v", '"2 km/h" and 160', "160 needs its unit too"],
    ),
    "a value without its unit": (
        axis('m = { of = "carriage.trolley.mass", values = [1, "0.002 t"] }'),
        0, ["sweep.m lists 1 with", "is 1 kg meant?"],
    ),
    "zero beside a unit": (axis('v = { of = "gravity", from = 0, to = "1 km/s^2", count = 2 }'), 0, ["0 to 1"]),
    "random draws": (
        axis('m = { of = "carriage.trolley.mass", random = 256, from = 1, to = 2 }'),
        2, ["sweep.m.random", "sobol = N"],
    ),
    "percentiles as parts of one": (
        f"{SMALL}\n[output]\npercentiles = [0.05, 0.5, 0.95]\n", 2, ["output", "0.05, 0.5, 0.95", "percent: 5, 50, 95"],
    ),
    "an axis of half a key": (axis('v = { of = "speed", values = [1] }'), 2, ["carriage.trolley.motion.speed"]),
    "a key of another kind": (SMALL.replace("mass = 1.0\n", "mass = 1.0\nstiffness = 1e6\n"), 2, ['kind "oscillator"']),
    "a body without a name": (SMALL.replace("[body.beam]", "[body]"), 2, ["[body.NAME]"]),
    "a list of tables": (
        SMALL.replace("[sensor.midspan]", "[[sensor]]"), 2, ["sensor", "[sensor.NAME]"],
    ),
    "half of supports": (SMALL.replace("pinned-pinned", "pinned"), 2, ['did you mean "pinned-pinned"']),
    "damping in per cent": (SMALL.replace("ratio = 0.02", "ratio = 2"), 2, ["damping_ratio", '0.02 or "2 %"']),
    "damping of 70 %": (SMALL.replace("ratio = 0.02", "ratio = 0.7"), 0, ["damping_ratio = 0.7:", '"0.7 %"']),
    "a kind that no package brings": (
        SMALL.replace('kind = "cruise"', 'kind = "ramp"'), 2, ["unknown kind of motion", "is the package installed"],
    ),
    "a decimal comma in quotes": (SMALL.replace("length = 1.0", 'length = "2,5 m"'), 2, ["decimal comma", '"2.5 m"']),
    "a sensor under a train": (
        trained("axles = 3\nspacing = 0.1") + '[sensor.under]\nunder = "ice"\n',
        2, ["sensor.under.under: no such carriage", 'one of its axles: "ice_1" is in front'],
    ),
    "a key of a train's motion": (
        trained("axles = 3\nspacing = 0.1\nspeed = 5.0").replace("1.0, speed = 5.0 }", "1.0 }"),
        2, ["a key of its motion: motion.speed"],
    ),
    "a comma that may part thousands": (
        SMALL.replace("density = 1000.0", 'density = "7,850 kg/m3"'),
        2, ["density: a comma", '"7850 kg/m3" if it parts thousands, else a point: "7.850 kg/m3"'],
    ),
    "a decimal comma": (SMALL.replace("length = 1.0", "length = 2,5"), 2, ["line 7", "decimal point: 2.5"]),
    "a thousands comma": (SMALL.replace("density = 1000.0", "density = 7,850"), 2, ["7850"]),
    "a unit without quotes": (SMALL.replace("length = 1.0", "length = 2.5 m"), 2, ["line 7", '"2.5 m"']),
    "ends by another name": (SMALL.replace("pinned-pinned", "fixed-hinged"), 2, ['did you mean "clamped-pinned"']),
    "a word without quotes": (
        SMALL.replace('"pinned-pinned"', "pinned-pinned"), 2, ['quotation marks around a word: "pinned-pinned"'],
    ),
    "a beam of another program": (SMALL.replace('kind = "beam"', 'kind = "BEAM188"'), 2, ['did you mean "beam"']),
    "a motion of a drive": (SMALL.replace('kind = "cruise"', 'kind = "s-curve"'), 2, ['mean "point-to-point"']),
    "a question by another name": (SMALL.replace('"passage"', '"moving-load"'), 2, ['did you mean "passage"']),
    "E I alone": (SMALL.replace("second_moment = 1e-6", "EI = 1e3"), 2, ["write second_moment = 1, youngs_modulus"]),
    "a first frequency alone": (SMALL.replace("second_moment = 1e-6", "frequency = 3"), 2, ["4 f^2 length^4 m/pi^2"]),
    "a soft end in a word": (SMALL.replace("pinned-pinned", "pinned-elastic"), 2, ["springs at ends are a list"]),
    "a stiff end among springs": (
        SMALL.replace('"pinned-pinned"', '["pinned", { at = 1, stiffness = 5e7 }]'), 2, ["list holds springs", "1e12"],
    ),
    "the frequency of a sprung mass": (
        SMALL.replace('kind = "mass"', 'kind = "oscillator"\nstiffness = 9.0\nnatural_frequency = "1.5 Hz"'),
        2, ["carriage.trolley.natural_frequency: unknown key", "stiffness = 4 pi^2 f^2 m (N/m)"],
    ),
    "the damping ratio of an axle": (
        trained("damping_ratio = 0.1\naxles = 2\nspacing = 0.2")
        .replace('"force"', '"oscillator"')
        .replace("\nforce =", "\nmass ="),
        2, ["train.ice.damping_ratio: unknown key", "damping = 4 pi D f m (N s/m)"],
    ),
    "ends of an axis": (axis('m = { of = "gravity", start = 1, to = 2, count = 2 }'), 2, ['did you mean "from"']),
    "a limit of deflection": (f"{SMALL}\n[question]\ndeflection = 0.1\n", 2, ['did you mean "displacement"']),
    "braces over lines": (
        SMALL.replace('motion = { kind = "cruise", ', 'motion = {\nkind = "cruise", '), 2, ["[carriage.NAME.motion]"],
    ),
    "Gpa": (SMALL.replace("= 1e9", '= "210 Gpa"'), 2, ['did you mean "GPa"']),
    "MPa of steel": (
        SMALL.replace("= 1e9", '= "210 MPa"').replace("density = 1000.0", "density = 7850.0"),
        0, ["body.beam.youngs_modulus = 2.1e+08 Pa", 'did you mean "210 GPa"?'],
    ),
    "newtons per micron": (
        SMALL.replace('supports = "pinned-pinned"', 'supports = [{ at = 0.1, stiffness = "400 N/mu" }]'),
        2, ["supports.0.stiffness", 'did you mean "400 N/um"?'],
    ),
    "no limit of jerk": (moved("jerk = inf"), 2, ["motion.jerk", "leave jerk out for no limit; in a list"]),
    "no limit in words": (moved('jerk = "inf"'), 2, ["motion.jerk", "leave jerk out for no limit"]),
    "no limit in a list": (
        axis('j = { of = "carriage.trolley.motion.jerk", values = [inf, 200] }'),
        2, ["sweep.j.values.0", "a large number such as 1e6 where there is no limit"],
    ),
    "accel": (moved("accel = 6"), 2, ["accel: unknown", 'mean "acceleration"?']),
    "residual without a dwell": (
        moved("acceleration = 40") + "\n[output]\nresidual = true\n",
        2, ["output.residual", "carriage.trolley.motion.dwell > 0, a rest after trolley's stop"],
    ),
    "a body by another name": (
        SMALL.replace("[body.beam]", "[body.baem]"),
        2, ["carriage.trolley.on", 'did you mean "baem", or should [body.baem] be [body.beam]?'],
    ),
    "one slip of several": (SMALL.replace('on = "beam"', 'on = "baem"'), 2, ['on: no such body', 'mean "beam"?']),
    "a direction under a carriage": (
        f'{SMALL}\n[sensor.sway]\nunder = "trolley"\ndirection = "x"\n',
        2, ["sensor.sway", "what moves with a carriage is read along its track", 'direction = "along"'],
    ),
    "braking of a body on contacts": (
        SMALL.replace('kind = "mass"\nmass = 1.0', 'kind = "body"\nbody = "table"\ninertia_along = true'),
        2, ["trolley.inertia_along: unknown key", "braking does not act on bodies on contacts"],
    ),
    "kmh": (SMALL.replace("speed = 5.0", 'speed = "60 kmh"'), 2, ['did you mean "km/h"']),
    "True": (SMALL.replace('steps = "auto"', "static_correction = True"), 2, ["small letters: true"]),
    "a colon": (SMALL.replace("length = 1.0", "length: 1.0"), 2, ["line 7", "equals sign"]),
    "JSON": ('{\n  "kind": "passage"\n}\n', 2, ["JSON", "[body.bed]"]),
    "curly quotes": (SMALL.replace('"small"', "\u201csmall\u201d"), 2, ["straight quotation marks"]),
    "an open quote": (SMALL.replace('"small"', '"small'), 2, ["line 2", "quotation mark is missing"]),
    "a sum": (SMALL.replace("= 1e-6", "= 0.01*0.1"), 2, ["write the result"]),
    "a key twice": (SMALL.replace("length = 1.0", "length = 1.0\nlength = 2.0"), 2, ["line 8", "keep one"]),
    "nothing": ("", 2, ["empty", "wanderlast init"]),
    "UTF-16": (SMALL.encode("utf-16"), 2, ["UTF-16", "save it as UTF-8"]),
    "Latin-1": (SMALL.replace("small", "kl\u00f6ner").encode("latin-1"), 2, ["line 2", "save it as UTF-8"]),
    "a byte-order mark": (b"\xef\xbb\xbf" + SMALL.encode(), 0, ["16 = 8 speed x 2 mass"]),
}  # fmt: skip


# key that was written instead of another, in the small study
OTHER_WORDS = [
    ("E = 1e9", "youngs_modulus = 1e9"),
    ("I = 1e-6", "second_moment = 1e-6"),
    ("inertia = 1e-6", "second_moment = 1e-6"),
    ("rho = 1000.0", "density = 1000.0"),
    ("damping = 0.02", "damping_ratio = 0.02"),
    ("L = 1.0", "length = 1.0"),
    ("load = 1.0", "mass = 1.0"),
    ("weight = 1.0", "mass = 1.0"),
    ("Axle_Load = 1.0", "mass = 1.0"),
    ("velocity = 5.0", "speed = 5.0"),
    ("v = 5.0", "speed = 5.0"),
    ("vmax = 5.0", "speed = 5.0"),
    ("position = 0.5", "at = 0.5"),
]


def told(capsys: pytest.CaptureFixture[str], code: int, *arguments: str) -> str:
    """What a command that ends with this code says."""
    capsys.readouterr()
    assert main(list(arguments)) == code
    output = capsys.readouterr()
    assert code == 0 or (output.out == "" and output.err.startswith("wanderlast: "))
    return output.out + output.err


@pytest.mark.fault(1, 2, 3)
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_a_study_file(mistake: str, capsys: pytest.CaptureFixture[str]) -> None:
    text, code, words = MISTAKES[mistake]
    Path("study.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    message = told(capsys, code, "check", "study.toml")
    assert all(word in message for word in words), message


@pytest.mark.parametrize(("middle", "told"), [(0.5, False), (1.0, True)])
def test_speeds_over_the_critical_one_on_one_span_alone(
    middle: float, told: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    springs = ", ".join(f"{{ at = {at}, stiffness = 1e8 }}" for at in (0.0, middle, 1.0))
    Path("study.toml").write_text(SMALL.replace('"pinned-pinned"', f"[{springs}]"))
    assert main(["check", "study.toml"]) == 0
    output = capsys.readouterr().out
    assert ("top speed over the critical speed omega_1 L/pi" in output) is told
    assert "mass over the body's mass" in output


@pytest.mark.fault(2)
@pytest.mark.parametrize(("written", "meant"), OTHER_WORDS)
def test_keys_by_other_words(written: str, meant: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("study.toml").write_text(SMALL.replace(meant, written, 1))
    message = told(capsys, 2, "check", "study.toml")
    assert f"{written.split(maxsplit=1)[0]}: unknown key" in message
    assert message.endswith(f'remedy: did you mean "{meant.split(maxsplit=1)[0]}"?\n')


def test_a_swept_key_by_another_word(capsys: pytest.CaptureFixture[str]) -> None:
    Path("study.toml").write_text(axis('e = { of = "body.beam.E", values = [1e9] }'))
    assert 'did you mean "body.beam.youngs_modulus"?' in told(capsys, 2, "check", "study.toml")


def test_a_kind_that_is_not_built_says_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    Path("study.toml").write_text(SMALL.replace('kind = "mass"', 'kind = "pendulum"'))
    message = told(capsys, 2, "check", "study.toml")
    assert 'is kind = "oscillator"' in message and "swings on a rope is a link of a robot" in message


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("length", "touches its track at one point: axles at distances are a table [train.NAME], a body on shoes"),
        ("axles", "touches its track at one point"),
        ("rope", 'a hanging mass that goes up and down is kind = "oscillator"'),
        ("speed", "[carriage.trolley.motion]"),
    ],
)
def test_a_carriage_with_a_key_of_something_else(key: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The beam has its length: nobody is to write it there once more."""
    Path("study.toml").write_text(SMALL.replace("mass = 1.0", f"mass = 1.0\n{key} = 2.0"))
    message = told(capsys, 2, "check", "study.toml")
    assert f"carriage.trolley.{key}: unknown key" in message and words in message and "of [body" not in message


def test_what_looks_wrong_stands_before_all_tables(capsys: pytest.CaptureFixture[str]) -> None:
    Path("study.toml").write_text(
        SMALL.replace("= 1000.0", "= 7.85").replace("modes = 4", "modes = 4\nown_weight = true")
    )
    message = told(capsys, 0, "check", "study.toml")
    assert message.startswith("Is this meant?\n- body.beam.density = 7.85 kg/m3")
    assert message.count("7.85 kg/m3") == 1
    assert message.index("Worth knowing\n- body beam is released") > message.index("Bodies")


def test_a_run_asks_before_it_computes(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def compute(*_: object) -> None:
        assert "is this meant? body.beam.density = 7.85 kg/m3" in capsys.readouterr().err
        raise BadInput("enough")

    monkeypatch.setattr("studies.protocol.parts.Variants.compute", compute)
    Path("study.toml").write_text(SMALL.replace("= 1000.0", "= 7.85"))
    told(capsys, 2, "run", "study.toml")


def test_an_option_that_the_study_file_says_is_told_where(capsys: pytest.CaptureFixture[str]) -> None:
    assert "tolerance = ... below [solver]" in told(capsys, 2, "run", "passage", "--tolerance", "1e-2")


def test_no_file_is_proposed_for_its_ending_alone(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("59_cells.toml", "b.toml"):
        Path(name).write_text(SMALL)
    assert "did you mean" not in told(capsys, 2, "check", "a9.toml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["report", "xx.nc"], ["no such file", 'did you mean "x.nc"?']),
        (["run", "x.nc"], ["archive of results", "wanderlast report x.nc"]),
        (["check", "x.nc"], ["archive of results", "wanderlast info x.nc"]),
        (["check", "folder"], ["this is a folder"]),
        (["check", "smal.toml"], ["no such file", 'did you mean "small.toml"']),
        (["check", "small"], ['did you mean "small.toml"']),
        (["report", "small.toml"], ["study file", "wanderlast run small.toml", "small.nc"]),
        (["info", "small.toml"], ["study file", "wanderlast run small.toml"]),
        (["run", "small.toml", "-o", "x.csv"], ["the name of a table", "-o x.nc, then wanderlast export x.nc x.csv"]),
        (["report", "passage"], ["built-in study", "wanderlast run passage", "passage.nc"]),
    ],
    ids=" ".join,
)
def test_a_file_of_another_sort(arguments: list[str], words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    Path("small.toml").write_text(SMALL)
    Path("x.nc").write_bytes(b"\x89HDF\r\n\x1a\n")
    Path("folder").mkdir()
    message = told(capsys, 2, *arguments)
    assert all(word in message for word in words), message
