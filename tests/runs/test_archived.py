"""Reports of archives alone: nothing else is opened, and what they say of their study is what they hold (fault 47)."""

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from results_schema.errors import ArchiveError
from results_schema.store.archive import Archive, open_archive, write_archive
from studies.commands.cli import main
from studies.findings import theory
from studies.reporting.answers import findings_of
from studies.results.results import Results
from studies.runs.archived import results_of
from tests.bodies.frames import LENGTH
from tests.studies import at_rest, imported, scenes
from tests.studies.small import SMALL, write

Captured = pytest.CaptureFixture[str]
pytestmark = pytest.mark.usefixtures("here")
Change = Callable[[dict[str, Any], Archive], None]

ON_THE_MOVE: dict[str, dict[str, Any]] = {
    "passage": {"kind": "cruise", "start": 0.0, "end": LENGTH, "speed": 20.0},
    "asymmetry": {"kind": "out-and-back", "start": 3.0, "end": 12.0, "speed": 5.0, "turn": 0.1, "cycles": 2},
    "double-peak": {"kind": "sinusoidal", "centre": 7.5, "amplitude": 7.4, "frequency": 0.4, "cycles": 3},
}
PICKED = 4  # numbers of a kind that are changed, each of which costs a report
AUDITED = """
import json, sys
from pathlib import Path
here, names = Path(sys.argv[1]).resolve(), sys.argv[2:]
kept = {*names, *(f"{name}-page" for name in names)}
def hook(event, arguments):
    if event in ("subprocess.Popen", "os.exec", "os.fork", "os.posix_spawn", "os.system"):
        raise SystemExit(f"started {arguments[0]}")
    if event in ("open", "os.listdir", "os.scandir") and isinstance(arguments[0], str | bytes):
        path = Path(arguments[0] if isinstance(arguments[0], str) else arguments[0].decode()).absolute()
        if path.is_relative_to(here) and path != here and path.relative_to(here).parts[0] not in kept:
            raise SystemExit(f"opened {path}")
sys.addaudithook(hook)
from studies.commands.cli import main
codes = [main(["info", name]) or main(["report", name, "-o", f"{name}-page"]) for name in names]
print("\\n" + json.dumps(codes))
"""


def audited(folder: Path, names: Sequence[str]) -> tuple[list[int], str]:
    """Exit codes of `info` and `report` of archives, and what they complain of, in a process that ends where it opens
    anything else here or starts another."""
    order = [sys.executable, "-c", AUDITED, str(folder), *names]
    done = subprocess.run(order, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1]), done.stderr


def changed(path: str, change: Change, to: str | None = None) -> None:
    """Another archive in its place, or in a place of its own, sealed as ours are."""
    archive = open_archive(path)
    datasets = {"/": archive.root, **archive.groups}
    change(datasets, archive)
    root = datasets.pop("/")
    write_archive(to or path, root, datasets)


def with_text(old: str, new: str) -> Change:
    """Another text of the study."""

    def change(datasets: dict[str, Any], archive: Archive) -> None:
        text = archive.root.attrs["study"]
        assert old in text
        datasets["/"] = archive.root.assign_attrs(study=text.replace(old, new))

    return change


ALL_OTHERS = ("asymmetry", "double-peak", "eigenfrequencies", "stability")


@pytest.mark.fault(47)
@pytest.mark.parametrize("kinds", [("passage", "influence"), pytest.param(ALL_OTHERS, marks=pytest.mark.slow)])
def test_a_report_opens_nothing_but_the_archive(kinds: tuple[str, ...], here: Path) -> None:
    """Info and report of every sort of study with the model's files gone, seen by an audit hook."""
    bed, archives = imported.matrices(here), []
    for kind in kinds:
        car = {"on": "bed", "kind": "mass", "mass": 50.0, "motion": ON_THE_MOVE.get(kind, ON_THE_MOVE["passage"])}
        imported.write(here, bed, kind, carriage={"car": car})
        archives.append(f"{kind}.nc")
        assert main(["run", "bed.toml", "-o", archives[-1]]) in (0, 3)
    for path in here.iterdir():
        if path.suffix != ".nc":
            path.unlink()
    assert set(audited(here, archives)[0]) == {0}
    assert all((here / f"{name}-page" / "report.html").stat().st_size > 10_000 for name in archives)


@pytest.mark.fault(47)
def test_a_hostile_archive_makes_nothing_be_read(here: Path) -> None:
    """Paths in the study of an archive are words, and what it does not hold is not looked for."""
    imported.write(here, imported.matrices(here))
    assert main(["run", "bed.toml", "-o", "path.nc"]) in (0, 3)
    (here / "secret").mkdir()
    (here / "secret" / "key").write_text("secret", encoding="utf-8")
    secret = str(here / "secret" / "key")
    changed("path.nc", with_text("stiffness.mtx", secret))
    changed("path.nc", lambda datasets, _: datasets.pop("/model/bed"), "no-model.nc")
    write(here, SMALL)
    assert main(["run", "small.toml"]) == 0
    for name, table in {"reduced": "file", "nastran": 'track = { nodes = [1, 2] }\nnodes = "x"\nmatrices'}.items():
        text = SMALL.replace("[body.beam]", f'[body.more]\nkind = "{name}"\n{table} = "{secret}"\n\n[body.beam]')
        changed("small.nc", with_text(SMALL, text), f"unused-{name}.nc")
        changed(f"unused-{name}.nc", with_text('on = "beam"', 'on = "more"'), f"used-{name}.nc")
    fine, bad = (
        ["path.nc", "unused-reduced.nc", "unused-nastran.nc"],
        ["no-model.nc", "used-reduced.nc", "used-nastran.nc"],
    )
    codes, complaints = audited(here, fine + bad)
    assert codes == [0, 0, 0, 4, 4, 4] and complaints.count("what this archive says of its study") == 3


@pytest.mark.fault(47)
@pytest.mark.parametrize("kind", ON_THE_MOVE)
@pytest.mark.parametrize("sweep", ["speed", "unit"])
def test_what_is_recorded_tells_what_the_files_tell(kind: str, sweep: str, here: Path) -> None:
    """Sentences and closed forms from the archive alone, and with the model's files read again."""
    key = "frequency" if kind == "double-peak" else "speed"
    axes = {
        "speed": {"pace": {"of": f"carriage.car.motion.{key}", "values": [0.3, 0.5]}},
        "unit": {"unit": {"of": "body.bed.force_unit", "values": [1.0, 2.0]}},
    }
    car = {"car": {"on": "bed", "kind": "mass", "mass": 50.0, "motion": ON_THE_MOVE[kind]}}
    bed = imported.matrices(here) | {"damping_ratio": [0.02, 0.03, 0.03, 0.03]}
    imported.write(here, bed, kind, carriage=car, sweep=axes[sweep], solver={"steps": 2000})
    assert main(["run", "bed.toml", "-o", "out.nc"]) in (0, 3)
    archive = open_archive("out.nc")
    alone, whole = results_of(archive), Results.of(archive.root)
    assert findings_of(alone) == findings_of(whole)
    assert theory.body_mass(alone, "bed") == theory.body_mass(whole, "bed")
    omega = [np.asarray(theory.first_omega(results)) for results in (alone, whole)]
    assert omega[0].shape == (() if sweep != "unit" else (2,))
    np.testing.assert_allclose(omega[0], omega[1], rtol=1e-15)
    ratios = np.array([0.1, 0.5])
    loaded = [theory.loaded_frequency(results, ratios) for results in (alone, whole)]
    np.testing.assert_allclose(loaded[0], loaded[1], rtol=1e-6)
    assert float(np.max(theory.damping_ratio(alone))) == 0.02


def put(name: str, place: tuple[int, ...], value: Any, group: str = "/") -> Change:
    """Another number at a place of a variable, the first one unless said."""

    def change(datasets: dict[str, Any], archive: Archive) -> None:
        dataset = datasets[group].copy(deep=True)
        values = np.array(dataset[name].values)
        values[place or (0,) * values.ndim] = value
        datasets[group] = dataset.assign({name: (dataset[name].dims, values, dataset[name].attrs)})

    return change


def renamed(datasets: dict[str, Any], archive: Archive) -> None:
    """Another name of a sensor."""
    datasets["/"] = archive.root.assign_coords(sensor=("sensor", ["elsewhere"], archive.root.sensor.attrs))


def moved(datasets: dict[str, Any], archive: Archive) -> None:
    """Another axis."""
    speed = archive.root["speed"]
    datasets["/"] = archive.root.assign_coords(speed=("speed", speed.values + 1.0, speed.attrs))


def exchanged(datasets: dict[str, Any], archive: Archive) -> None:
    """The axes in another order."""
    datasets["/"] = archive.root.transpose("mass", "speed", ...)


def cut(datasets: dict[str, Any], archive: Archive) -> None:
    """Fewer variants than the study has."""
    datasets["/"] = archive.root.isel(speed=slice(0, 3))


def instead(text: str) -> Change:
    """Another text altogether."""
    return lambda datasets, archive: datasets.update({"/": archive.root.assign_attrs(study=text)})


def without(name: str) -> Change:
    """A variable less."""
    return lambda datasets, archive: datasets.update({"/": archive.root.drop_vars(name)})


FORGED: Mapping[str, tuple[Change, str]] = {
    "label": (renamed, "sensor: expected"),
    "axis": (moved, "speed: expected the values of the study's axis"),
    "order": (exchanged, "status: expected"),
    "cut": (cut, "expected the axes"),
    "status": (put("status", (0, 0), 99), "status: expected one of its flag_values, received 99"),
    "fidelity": (put("fidelity_used", (1, 1), -3), "fidelity_used: expected one of"),
    "large": (put("midspan_max", (2, 1), 1.7e308), "midspan_max: expected numbers below 1e+150"),
    "negative": (put("midspan_max", (2, 1), -1.7e308), "expected numbers below"),
    "infinite": (put("midspan_min", (2, 1), np.inf), "midspan_min: expected finite"),
    "nan": (put("midspan_rms", (2, 1), np.nan), "received NaN at (2, 1)"),
    "failed": (put("status", (2, 1), 5), "where the status keeps no values"),
    "missing": (without("midspan_max"), "midspan_max: expected in every passage"),
    "kind": (with_text('kind = "passage"', 'kind = "asymmetry"'), "study_kind"),
    "sensor": (with_text("[sensor.midspan]", "[sensor.other]"), "sensor: expected"),
    "huge": (with_text("count = 8", "count = 8000000"), "expected the axes"),
    "no study": (with_text("length = 1.0", "length = -1.0"), "body.beam.length"),
    "no text": (instead("nothing"), "not valid TOML"),
    "a path": (instead("small.toml"), "not valid TOML"),
    "newer": (with_text("schema_version = 1", "schema_version = 7"), "unknown version"),
    "a body": (lambda d, _: d.update({"/model/other": d["/model/beam"]}), "expected a body of the study"),
    "sample": (
        lambda d, _: d.update(
            {"/audit": d["/audit"].assign_coords(sample=("sample", [10**6], d["/audit"].sample.attrs))}
        ),
        "/audit: sample: expected different numbers from 0 to 15",
    ),
}


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of a small study with an audit."""
    folder = tmp_path_factory.mktemp("small")
    path = write(folder, SMALL.replace("audit = 2", "audit = 1"))
    assert main(["run", str(path), "-o", str(folder / "small.nc")]) == 0
    return folder / "small.nc"


@pytest.mark.fault(47)
@pytest.mark.parametrize("name", FORGED)
def test_what_an_archive_says_is_what_it_holds(name: str, small: Path, here: Path, capsys: Captured) -> None:
    """Changed labels, another axis, status 99, values 1.7e308 and indices out of range end with 4."""
    (here / "small.nc").write_bytes(small.read_bytes())
    change, words = FORGED[name]
    changed("small.nc", change)
    capsys.readouterr()
    assert main(["report", "small.nc"]) == 4
    message = capsys.readouterr().err
    assert "small.nc" in message and words in message and "what this archive says of its study" in message
    assert sorted(path.name for path in here.iterdir()) == ["small.nc"]


@pytest.mark.fault(47)
def test_histories_out_of_range(here: Path) -> None:
    """Flat numbers of variants that the study does not have."""
    write(here, SMALL.replace("count = 8", "count = 70"))
    assert main(["run", "small.toml"]) == 0

    def beyond(datasets: dict[str, Any], archive: Archive) -> None:
        history = archive.root["history"]
        datasets["/"] = archive.root.assign_coords(history=("history", history.values + 100, history.attrs))

    changed("small.nc", beyond)
    with pytest.raises(ArchiveError, match="history: expected different numbers from 0 to 139"):
        results_of(open_archive("small.nc"))


@pytest.mark.fault(47)
@pytest.mark.parametrize("name", ["correction", "mode_count", "position", "checked_position", "on_body"])
def test_coordinates_of_a_study_at_rest(name: str, here: Path) -> None:
    """Another coordinate than the study asks for."""
    write(here, at_rest.text_of("eigenfrequencies", "positions = 3\nmode_counts = [4, 8]"))
    assert main(["run", "small.toml"]) == 0
    changed("small.nc", put(name, (0,), "x" if name == "on_body" else 3))
    with pytest.raises(ArchiveError, match=f"{name}: expected"):
        results_of(open_archive("small.nc"))


def texts() -> dict[str, str]:
    """One study of every sort."""
    found = {kind: scenes.text_of(kind) for kind in scenes.MOTIONS}
    found |= {
        kind: at_rest.text_of(kind, "positions = 3\nmode_counts = [4, 8]", at_rest.MASS) for kind in at_rest.KINDS
    }
    return found


def numbers(archive: Archive) -> list[tuple[str, str, Any]]:
    """Some strange numbers with group and variable, the same ones every time."""
    found = [
        (group, str(name), value)
        for group, dataset in {"/": archive.root, **archive.groups}.items()
        for name, array in dataset.variables.items()
        if array.dtype.kind in "iuf"
        for value in ((-1.0, 0.0, 1e149, 1.7e308, np.nan, 99.0) if array.dtype.kind == "f" else (-1, 0, 99))
    ]
    picked = np.random.default_rng(47).permutation(len(found))[:PICKED]
    return [found[place] for place in picked.tolist()]


@pytest.mark.fault(47)
@pytest.mark.slow
@pytest.mark.parametrize("kind", texts())
def test_any_other_number_is_refused_or_told(kind: str, here: Path) -> None:
    """Strange numbers anywhere in an archive are no bug of ours: 4, or a report of them."""
    write(here, texts()[kind])
    assert main(["run", "small.toml"]) in (0, 3)
    whole, codes = Path("small.nc").read_bytes(), []
    for group, name, value in numbers(open_archive("small.nc")):
        Path("small.nc").write_bytes(whole)
        changed("small.nc", put(name, (), value, group))
        codes.append(((group, name, value), main(["report", "small.nc"])))
    assert len(codes) == PICKED
    assert [found for found in codes if found[1] not in (0, 4)] == []


def test_bodies_stand_along_dimensions_of_their_own(here: Path) -> None:
    """By which xarray opens all groups at once; archives of before, whose bodies had those of the results, are read."""
    write(here, at_rest.text_of("eigenfrequencies"), "rest.toml")
    assert main(["run", "rest.toml", "-o", "rest.nc"]) == 0
    with xr.open_datatree("rest.nc") as tree:
        assert tree["/model/bed"].sizes["body_mode"] == 10 and tree.sizes["mode"] == 8
    imported.write(here, imported.matrices(here))
    assert main(["run", "bed.toml", "-o", "own.nc"]) in (0, 3)
    older = {"body_mode": "mode", "track_position": "position"}
    changed(
        "own.nc", lambda datasets, _: datasets.update({"/model/bed": datasets["/model/bed"].rename(older)}), "older.nc"
    )
    own, before = (results_of(open_archive(name)) for name in ("own.nc", "older.nc"))
    assert findings_of(own) == findings_of(before) and before.models["bed"]["mode_shape"].dims == ("mode", "position")
    for one, other in zip(*(theory.elastic_modes(found, np.array([1.0, 2.0])) for found in (own, before)), strict=True):
        np.testing.assert_array_equal(one, other)
