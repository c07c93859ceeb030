"""What a study means, and the words with which a wrong one is refused."""

import copy
import pickle
import tomllib
from pathlib import Path

import pytest

from engine.scene.study import STANDARD_GRAVITY, Study, load
from results_schema.errors import BadInput
from tests.scene.sample import MINIMAL, SAMPLE

LIBRARY = Path(__file__).parents[2] / "studies" / "library"


def message(old: str, new: str, base: str = SAMPLE) -> str:
    assert old in base
    with pytest.raises(BadInput) as error:
        load(base.replace(old, new, 1))
    return str(error.value)


def test_values_and_defaults() -> None:
    study = load(SAMPLE)
    assert study.value("body.bed.youngs_modulus") == 210e9
    assert study.value("body.bed.supports.1.stiffness") == 2e8
    assert study.value("carriage.table.motion.cycles") == 3
    assert study.body["bed"].springs[0].damping == 3.0
    assert study.carriage["load"].start_time == pytest.approx(2.0 / (20 / 3.6))
    for path, known in (("body.bed.lenght", "length"), ("carriage.table.motion.x", "cycles"), ("gravity.x", "number")):
        with pytest.raises(KeyError, match=f"{path}: no .* there, but .*{known}"):
            study.value(path)
    assert study.carriage["table"].start_time == 0.5
    assert study.carriage["table"].weight(study.gravity) == pytest.approx(981.0)
    assert [c.inertial for c in study.carriage.values()] == [True, False, False, True]
    assert study.carriage["probe"].weight(9.81) == -5.0
    assert study.solver.integration.coefficients == (0.25, 0.5)
    assert study.body_of("table_moment") == "bed"
    small = load(MINIMAL)
    assert (small.gravity, small.start, small.solver.scheme) == (STANDARD_GRAVITY, "rest", "auto")
    assert small.body["bed"].ends == ("pinned", "pinned")
    assert study.start == "equilibrium"
    assert load(SAMPLE.replace('initial = "equilibrium"\n', "")).start == "equilibrium"


def test_keywords_equal_a_file(tmp_path: Path) -> None:
    file = tmp_path / "bed.toml"
    file.write_text(SAMPLE, encoding="utf-8")
    study, keywords = load(file), Study(**tomllib.loads(SAMPLE))
    assert study.source.name == str(file)
    assert study.source.text == SAMPLE
    assert keywords == study
    assert study != study.with_values({"gravity": 9.8})


@pytest.mark.parametrize("path", sorted(LIBRARY.glob("*.toml")), ids=lambda path: path.stem)
def test_a_study_of_python_becomes_a_file(path: Path, tmp_path: Path) -> None:
    """Every built-in one, from its file and from keywords; the file's text stays as it is."""
    study = load(path)
    assert study.save(tmp_path / "copy.toml").read_bytes() == path.read_bytes()
    keywords = Study(**tomllib.loads(study.toml()))
    again = keywords.save(tmp_path / "keywords.toml")
    assert study == keywords == load(again) == load(tmp_path / "copy.toml")
    assert load(again).with_values({"title": "another"}).toml() != keywords.toml()
    with pytest.raises(BadInput, match=r"copy.toml: there is a file already"):
        study.save(tmp_path / "copy.toml")
    assert study.save(again, overwrite=True).read_bytes() == path.read_bytes()


def test_copies_keep_everything() -> None:
    study = load(SAMPLE)
    for twin in (pickle.loads(pickle.dumps(study)), copy.deepcopy(study)):
        assert twin == study
        assert twin.source == study.source
    with pytest.raises(ValueError, match="frozen"):
        study.gravity = 1.0


def test_with_values() -> None:
    study = load(MINIMAL)
    other = study.with_values({"carriage.table.mass": "1 t", "solver.steps": 100, "gravity": 1})
    assert (other.value("carriage.table.mass"), other.solver.steps, other.gravity) == (1000.0, 100, 1.0)
    assert study.value("carriage.table.mass") == 100.0
    assert study.with_values([("gravity", 1.0)]).gravity == 1.0  # as dict() takes them
    assert load(other.source.text).model_dump() == other.model_dump()
    with pytest.raises(BadInput, match=r"carriage\.table\.mas.*unknown key.*mass"):
        study.with_values({"carriage.table.mas": 1.0})
    with pytest.raises(BadInput, match=r"mass: must be > 0"):
        study.with_values({"carriage.table.mass": -1.0})
    with pytest.raises(BadInput, match="off its body"):
        study.with_values({"sensor.midspan.at": 15.1})
    with pytest.raises(BadInput, match="no such key"):
        study.with_values({"carriage.table.motion.speed.x": 1.0})


def test_a_swept_key_is_not_given_another_value() -> None:
    """Which no variant would have."""
    swept = {"sweep": {"load": {"of": "carriage.table.mass", "values": [1.0, 2.0]}}}
    study = load(MINIMAL).with_values(swept)
    with pytest.raises(BadInput, match=r"carriage\.table\.mass: sweep\.load sets this key in every variant") as error:
        study.with_values({"carriage.table.mass": 5.0})
    with pytest.raises(BadInput, match="in every variant"):  # whatever another axis is
        study.with_values({"carriage.table.mass": 5.0, "sweep.loads": {"of": "gravity", "values": [1.0]}})
    assert "without_sweep()" in str(error.value) and "values of sweep.load" in str(error.value)
    assert study.without_sweep().with_values({"carriage.table.mass": 5.0}).value("carriage.table.mass") == 5.0
    again = study.with_values({"carriage.table.mass": 5.0, "sweep.load.values": [3.0]})
    assert again.sweep.axes["load"].values == (3.0,)


def test_numbers_and_units() -> None:
    study = load(SAMPLE)
    numbers = study.numbers()
    assert numbers["carriage.gripper.motion.positions.1"] == 7.0
    assert not {"schema_version", "output.histories.every", "body.bed.own_weight"} & set(numbers)
    units = {
        "gravity": "m s-2",
        "body.bed.damping_ratio": "",
        "body.bed.supports.0.rotational": "N m rad-1",
        "body.bed.length": "m",
        "carriage.probe.motion.frequency": "Hz",
        "carriage.gripper.motion.times.1": "s",
        "carriage.load.headway": "m",
    }
    for path, symbol in units.items():
        unit = study.unit(path)
        assert unit is not None and unit.symbol == symbol
    assert study.unit("solver.steps") is None
    for path, value in numbers.items():
        assert study.value(path) == value


@pytest.mark.fault(2, 3, 9, 10, 11)
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("length = 15.0", "lenght = 15.0", ["body.bed.lenght", "unknown key", '"length"']),
        ("length = 15.0", "length = -1.0", ["body.bed.length", "> 0", "(m)", "-1"]),
        ("length = 15.0", 'length = "15 kg"', ["body.bed.length", "a mass (kg)", "a length (m)"]),
        ("density = 7850", "density = true", ["body.bed.density", "wrong type", "true"]),
        ("mass = 100.0", "mass = 0", ["carriage.table.mass", "> 0"]),
        ("speed = 5.0", "speed = 0.0", ["carriage.table.motion.speed", "> 0"]),
        ("turn = 0.1", "turn = 0.51", ["carriage.table.motion.turn", "<= 0.5"]),
        ("cycles = 3", "cycles = 2.5", ["carriage.table.motion.cycles", "integer"]),
        ("modes = 12", "modes = 65", ["body.bed.modes", "<= 64"]),
        ("damping_ratio = 0.02", "damping_ratio = 1.0", ["body.bed.damping_ratio", "< 1"]),
        ("damping_ratio = 0.02", "damping_ratio = [0.1, -0.1]", ["body.bed.damping_ratio.1", ">= 0"]),
        ("damping_ratio = 0.02", "damping_ratio = { raleigh = [1, 2] }", ["raleigh", '"rayleigh"']),
        ('kind = "beam"', 'kind = "bem"', ["body.bed.kind", "unknown kind of body", '"beam"']),
        ('kind = "beam"', 'kind = "nastran"', ["body.bed", "unknown key", "matrices, nodes"]),
        ('kind = "beam"', 'kind = "matrices"', ["body.bed", "unknown key", "stiffness, mass"]),
        ('kind = "mass"', 'kind = "body"', ["carriage.table", "unknown key", "contacts"]),
        ('kind = "mass"', 'kind = "sprung"', ["carriage.table.kind", 'is kind = "oscillator"']),
        ("at = 14.9,", 'at = 14.9, kind = "pinned",', ["supports.1.kind", 'supports = "pinned-pinned"']),
        ('kind = "mass"', 'kind = "oscillator"\nunsprung_mass = 1', ["did you mean", '"wheel_mass"']),
        ('kind = "mass"', 'kind = "oscillator"', ["carriage.table.stiffness", "missing"]),
        ('kind = "cruise"', 'kind = "free"', ["carriage.load.motion.end", "unknown key", '"cruise"']),
        ('on = "bed"', 'on = "bad"', ["carriage.table.on", '"bed"']),
        ('under = "table"', 'under = "tabel"', ["sensor.table_moment.under", '"table"']),
        ('under = "table"', 'under = "table"\nat = 1.0', ["sensor.table_moment", "exactly one"]),
        ("at = 7.5", "at = 15.5", ["sensor.midspan.at", "15.5", "body.bed.length = 15"]),
        ("at = 14.9", "at = 15.1", ["body.bed.supports.1.at", "off the beam"]),
        ('stiffness = "200 kN/mm"', "stiffness = 0", ["body.bed.supports.1", "holds nothing", "make a frame's node"]),
        ("end = 14.7", "end = 15.1", ["carriage.table.motion.end", "stay on its body"]),
        ("end = 14.7", "end = 7.5", ["carriage.table.motion.end", "same place"]),
        ("amplitude = 7.0", "amplitude = 7.6", ["carriage.probe.motion", "stay on its body"]),
        ("start = -1.0\nend = 16.0", "start = -1.0\nend = -0.5", ["carriage.load.motion", "never touches"]),
        ("start = -1.0\nend = 16.0", "start = 16.0\nend = 15.0", ["carriage.load.motion", "never touches"]),
        ("positions = [1.0, 7.0, 5.0]", "positions = [16, 17, 18]", ["never touches"]),
        ("times = [0.0, 1.0, 3.0]", "times = [0.0, 3.0, 3.0]", ["times", "ascend"]),
        ("times = [0.0, 1.0, 3.0]", "times = [1.0, 2.0, 3.0]", ["times.0", "0"]),
        ("times = [0.0, 1.0, 3.0]", "times = [0.0, 3.0]", ["2 times, 3 positions"]),
        ("[sensor.midspan]", '[sensor."mid span"]', ["sensor.mid span", "name"]),
        ("[sensor.midspan]", "[sensor.status]", ["status", "reserved"]),
        ("speed = {", "table_contact_force_min = {", ["sweep.table_contact_force_min", "result"]),
        ('"displacement"', '"displacment"', ["sensor.midspan.quantity", '"displacement"']),
        ('scheme = "newmark"', 'scheme = "hht-alpha"', ["solver", "beta and gamma", "not for this scheme"]),
        ('scheme = "newmark"', 'scheme = "generalized-alpha"', ["solver", "beta and gamma", "not for this scheme"]),
        ('scheme = "newmark"', 'scheme = "newmark"\nalpha = -0.05', ["solver", "alpha", "not for this scheme"]),
        ('scheme = "newmark"', 'scheme = "newmark"\nrho_inf = 1.5', ["solver.rho_inf", "<= 1"]),
        ('scheme = "newmark"', 'scheme = "fox-goodwin"', ["solver", "beta and gamma", "not for this scheme"]),
        ("gamma = 0.5", "gamma = 0.4", ["solver.gamma", ">= 0.5"]),
        ('fidelity = "auto"', 'fidelity = "statics"', ["solver.fidelity", '"static"']),
        ("audit = 0", "audit = -5", ["solver.audit", ">= 0"]),
        ("steps = 500", "steps = 0", ["solver.steps", ">= 1"]),
        ("steps = 500", "steps = 1000000000", ["solver.steps", "<= 1e+08"]),
        ("schema_version = 1", "schema_version = 2", ["schema_version", "newer"]),
        ("a table on a bed", "a" * 600, ["title", "500"]),
    ],
)
def test_words(old: str, new: str, words: list[str]) -> None:
    found = message(old, new)
    assert all(word in found for word in words), found


def test_stress_needs_a_fibre() -> None:
    text = SAMPLE.replace('"bending_moment"', '"stress"')
    assert load(text).sensor["table_moment"].quantity == "stress"
    assert "fibre_distance" in message("fibre_distance = 0.1\n", "", text)


def test_any_title_of_a_sane_length() -> None:
    title = "<script>{{7*7}}$ \n ../ é"
    assert Study(kind="passage", title=title).title == title


def test_other_supports_and_damping() -> None:
    study = load(MINIMAL.replace('"pinned-pinned"', '"clamped-free"\ndamping_ratio = { rayleigh = [0.1, 1e-4] }'))
    assert study.body["bed"].ends == ("clamped", "free")
    assert study.value("body.bed.damping_ratio.rayleigh.1") == 1e-4
    listed = load(MINIMAL.replace('"pinned-pinned"', '"pinned-pinned"\ndamping_ratio = ["2 %", 0.03]\nmodes = 2'))
    assert listed.body["bed"].damping_ratio == (0.02, 0.03)


def test_study_without_a_version() -> None:
    assert "schema_version" in message("schema_version = 1\n", "", MINIMAL)
    assert Study(kind="stability").schema_version == 1
