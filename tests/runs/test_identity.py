"""What archives and parts belong to: the study, the contents of its files, and the program (faults 41, 42 and 43)."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr
from scipy.io import mmread, mmwrite

import engine
from engine.bodies import Matrices
from engine.bodies.files import reader as import_files
from engine.bodies.files.model import FileModel, hashes_of
from engine.bodies.files.reader import Request
from engine.bodies.reduced.body import save_body
from results_schema.errors import BadInput
from results_schema.store import files
from results_schema.store.archive import FILES, open_archive
from results_schema.store.parts import PartStore
from results_schema.store.tables import Table
from studies.commands.cli import main
from studies.protocol.options import RunOptions
from studies.protocol.study import KINDS_FOLDER
from studies.runs import identity
from studies.runs.identity import PROGRAM, run_key, sources, sources_hash
from studies.runs.runner import run_to_archive
from tests.bodies.frames import PINNED, body, straight
from tests.bodies.models import Files, in_process
from tests.commands.test_cli_interrupted import interrupted
from tests.engine.build import steel
from tests.protocol.test_measuring import after_pieces
from tests.studies import at_rest, imported
from tests.studies.every_way import assert_same_results
from tests.studies.small import SCENES, SMALL, write

Captured = pytest.CaptureFixture[str]
pytestmark = pytest.mark.usefixtures("here")


def stiffen(path: Path) -> None:
    """Twice the stiffness."""
    mmwrite(path, 2.0 * mmread(path), symmetry="symmetric")


def remark(path: Path) -> None:
    """Another text of the same meaning."""
    path.write_text(path.read_text(encoding="utf-8") + "$ another revision\n", encoding="utf-8")


def lift(path: Path) -> None:
    """Another number behind the nodes, which are read as text."""
    path.write_text(path.read_text(encoding="utf-8").replace("15.0", "15.00"), encoding="utf-8")


def soften(path: Path) -> None:
    """A reduced body of other stiffness."""
    save_body(body(straight(PINNED, elements=4, section={"second_moment": 4e-6})), path)


def reduced(folder: Path) -> dict[str, object]:
    """A body that we wrote."""
    save_body(body(straight(PINNED, elements=4)), folder / "bed.nc")
    return {"kind": "reduced", "file": "bed.nc"}


@pytest.mark.fault(41)
@pytest.mark.parametrize(
    ("table", "name", "change", "kind"),
    [
        (imported.matrices, "stiffness.mtx", stiffen, "passage"),
        (imported.matrices, "nodes.csv", lift, "influence"),
        (imported.matrices, "stiffness.mtx", stiffen, "eigenfrequencies"),
        pytest.param(imported.nastran, "matrices.pch", remark, "passage", marks=pytest.mark.extras),
        pytest.param(imported.nastran, "grids.bdf", remark, "trajectory", marks=pytest.mark.extras),
        (imported.matrices, "nodes.csv", lift, "stability"),
        (reduced, "bed.nc", soften, "passage"),
    ],
)
def test_a_changed_file_of_the_model_is_another_study(
    table: Callable[[Path], dict[str, object]],
    name: str,
    change: Callable[[Path], None],
    kind: str,
    here: Path,
    capsys: Captured,
) -> None:
    """The finished archive belongs to the files as they were."""
    imported.write(here, table(here), kind)
    assert main(["run", "bed.toml", "-o", "out.nc"]) in (0, 3)
    assert main(["run", "bed.toml", "-o", "out.nc"]) in (0, 3)
    recorded, before = open_archive("out.nc").root.attrs[FILES], Path("out.nc").read_bytes()
    change(here / name)
    capsys.readouterr()
    assert main(["run", "bed.toml", "-o", "out.nc"]) == 2
    message = capsys.readouterr().err
    assert f"changed: {name};" in message and "out.nc" in message and "--overwrite" in message
    assert Path("out.nc").read_bytes() == before
    assert main(["run", "bed.toml", "-o", "out.nc", "--overwrite"]) in (0, 3)
    assert open_archive("out.nc").root.attrs[FILES] != recorded
    assert main(["run", "bed.toml", "-o", "out.nc"]) in (0, 3)


@pytest.mark.fault(41)
@pytest.mark.extras
def test_a_study_that_measures_names_its_files(here: Path) -> None:
    """The key of a study in pieces, and what its archive says, hold the files too."""
    path = imported.write(here, imported.nastran(here), "work-precision")
    before = engine.load(path)
    remark(here / "grids.bdf")
    after = engine.load(path)
    assert set(identity.files_of(after)) == {"matrices.pch", "nodes.bdf", "grids.bdf"}
    assert before.source.sha256 == after.source.sha256 and run_key(before) != run_key(after)


@pytest.mark.fault(41)
def test_an_included_file_is_read_again(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A model is remembered while all its files stay as they are, not only those that the study names."""
    files_of_bed = Files(here, straight(PINNED, elements=4))
    bed = Matrices.model_validate(files_of_bed.table())
    included = here / "included.txt"

    def read(request: Request) -> FileModel:
        model = in_process(request)
        return replace(model, hashes=(*model.hashes, *hashes_of(str(included))))

    monkeypatch.setattr(import_files, "_read", read)
    import_files._remembered.cache_clear()
    included.write_text("one", encoding="utf-8")
    found = [import_files.read_files(bed.request) for _ in range(2)]
    included.write_text("another", encoding="utf-8")
    found.append(import_files.read_files(bed.request))
    import_files._remembered.cache_clear()
    assert found[0] is found[1] and found[1].digest != found[2].digest
    assert dict(found[2].hashes)[str(included)] == hashes_of(str(included))[0][1]


@pytest.mark.fault(41)
def test_files_that_change_while_the_study_runs(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is written of a model that was exchanged half-way, and no part is kept."""
    study = engine.load(imported.write(here, imported.matrices(here)))
    write_part = PartStore.write

    def write_and_change(self: PartStore, name: str, part: Mapping[str, Table]) -> Path:
        lift(here / "nodes.csv")
        return write_part(self, name, part)

    monkeypatch.setattr(PartStore, "write", write_and_change)
    with pytest.raises(BadInput, match="has changed while the study ran") as caught:
        run_to_archive(study, Path("out.nc"), RunOptions())
    assert "nodes.csv" in caught.value.where
    assert not Path("out.nc").exists() and not Path("out.nc.parts").exists()


class Meanwhile(files.Faults):
    """Lets something happen once, before an operation on a path."""

    def __init__(self, operation: str, name: str, act: Callable[[], object]) -> None:
        self._when, self._act, self.done = (operation, name), act, False

    def before(self, operation: str, path: Path) -> None:
        if not self.done and (operation, path.name) == self._when:
            self.done = True
            self._act()


def another_archive() -> None:
    """The archive of another study, as some other program might put it there."""
    shutil.copy("other.nc", "small.nc")


def a_text() -> None:
    """Somebody's notes."""
    Path("small.nc").write_text("my notes", encoding="utf-8")


@pytest.mark.fault(42)
@pytest.mark.parametrize("kind", ["marched", "at rest"])
@pytest.mark.parametrize(
    ("act", "option", "code"),
    [(another_archive, [], 2), (a_text, [], 2), (a_text, ["--overwrite"], 2), (another_archive, ["--overwrite"], 0)],
)
def test_what_comes_there_before_the_replace_stays(
    kind: str,
    act: Callable[[], None],
    option: list[str],
    code: int,
    here: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Captured,
) -> None:
    """The target is looked at once more just before the archive takes its place; finished work is kept."""
    write(here, SMALL if kind == "marched" else at_rest.text_of("influence", "positions = 3"))
    write(here, at_rest.text_of("influence", "positions = 5"), "other.toml")
    assert main(["run", "other.toml"]) == 0
    meanwhile = Meanwhile("replace", "small.nc", act)
    monkeypatch.setattr(files, "FAULTS", meanwhile)
    assert main(["run", "small.toml", *option]) == code
    assert meanwhile.done
    if code == 2:
        assert "small.nc" in capsys.readouterr().err
        kept = Path("small.nc").read_bytes()
        assert kept == b"my notes" or kept == Path("other.nc").read_bytes()
        assert list(Path("small.nc.parts").glob("*.nc"))
    else:
        assert open_archive("small.nc").root.attrs["study"] == Path("small.toml").read_text(encoding="utf-8")


@pytest.mark.fault(42)
@pytest.mark.parametrize("kind", ["marched", "at rest"])
def test_the_target_is_looked_at_again_under_the_lock(
    kind: str, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    """Another study has finished there between the first look and the lock; no folder of parts is made."""
    write(here, SMALL if kind == "marched" else at_rest.text_of("influence", "positions = 3"))
    write(here, at_rest.text_of("influence", "positions = 5"), "other.toml")
    assert main(["run", "other.toml"]) == 0
    enter = PartStore.__enter__
    monkeypatch.setattr(PartStore, "__enter__", lambda self: (another_archive(), enter(self))[1])
    capsys.readouterr()
    assert main(["run", "small.toml"]) == 2
    assert "the archive there is of another" in capsys.readouterr().err
    assert Path("small.nc").read_bytes() == Path("other.nc").read_bytes()
    assert not Path("small.nc.parts").exists() and not Path("small.nc.lock").exists()


@pytest.mark.fault(42)
def test_the_same_study_finished_meanwhile_is_left_alone(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever comes second finds the archive and computes nothing."""
    study = engine.load(write(here))
    first = run_to_archive(study, Path("whole.nc"), RunOptions())
    enter = PartStore.__enter__
    monkeypatch.setattr(PartStore, "__enter__", lambda self: (shutil.copy("whole.nc", "small.nc"), enter(self))[1])
    second = run_to_archive(study, Path("small.nc"), RunOptions())
    assert second.was_finished and not first.was_finished
    assert Path("small.nc").read_bytes() == Path("whole.nc").read_bytes()
    assert not Path("small.nc.parts").exists()


def copied(source: str, target: str) -> int:
    """Copy parts into the folder of another run, their checksums too, but not its key."""
    found = [path for path in Path(source).iterdir() if path.name != "key"]
    for path in found:
        shutil.copy(path, Path(target) / path.name)
    return len(found)


@pytest.mark.fault(43)
def test_parts_of_another_study_are_computed_again(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    """Same variants, other damping; every part carries the key of its run."""
    write(here, SCENES)
    write(here, SCENES.replace("damping_ratio = 0.02", "damping_ratio = 0.3"), "damped.toml")
    for name, number in (("damped", 3), ("small", 1)):
        interrupted(monkeypatch, number, f"{name}.toml")
    assert copied("damped.nc.parts", "small.nc.parts") >= 6
    assert main(["info", "small.nc"]) == 2
    told = capsys.readouterr().err
    assert main(["run", "small.toml", "-o", "whole.nc"]) == 0
    found = run_to_archive(engine.load("small.toml"), Path("small.nc"), RunOptions())
    assert found.resumed < 16 and f"{found.resumed} finished variant" in told
    assert_same_results(open_archive("small.nc").root, open_archive("whole.nc").root)


def test_parts_of_a_changed_study_are_refused_by_what_changed(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    """Two keys by which nobody finds it were named; these are left where an earlier version kept no text."""
    write(here, SCENES)
    interrupted(monkeypatch, 1, "small.toml")
    write(here, SCENES.replace("damping_ratio = 0.02", "damping_ratio = 0.3"))
    for told in ("those of this very study, received body.beam.damping_ratio: 0.02, now 0.3; remedy", "received key"):
        capsys.readouterr()
        assert main(["run", "small.toml"]) == 2
        assert told in capsys.readouterr().err
        kept = Path("small.nc.parts/key")
        kept.write_text("\n".join([*kept.read_text().splitlines()[:2], ""]))


@pytest.mark.fault(43)
def test_pieces_of_another_study_are_computed_again(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The pieces of a bed with another stiffness have the same names."""
    text = at_rest.text_of("eigenfrequencies", "positions = 3\nmode_counts = [4, 8]")
    write(here, text)
    write(here, text.replace("210 GPa", "70 GPa"), "soft.toml")
    for name, number in (("soft", 3), ("small", 1)):
        with monkeypatch.context() as patch:
            after_pieces(patch, number)
            assert main(["run", f"{name}.toml"]) == 130
    assert copied("soft.nc.parts", "small.nc.parts") == 6
    assert main(["run", "small.toml", "-o", "whole.nc"]) == 0
    found = run_to_archive(engine.load("small.toml"), Path("small.nc"), RunOptions())
    assert found.resumed == 0  # the one piece of its own was overwritten by the other's
    xr.testing.assert_equal(open_archive("small.nc").root, open_archive("whole.nc").root)


LOADED = """
import json, sys
from pathlib import Path
from studies.commands.cli import main
assert all(main(["run", name, "-o", f"{name}.nc"]) in (0, 3) for name in sys.argv[1:])
names = [getattr(module, "__file__", None) for module in list(sys.modules.values())]
print("\\n" + json.dumps([name for name in names if name]))
"""


@pytest.mark.fault(43)
def test_the_key_covers_every_source_that_a_run_loads(here: Path) -> None:
    """The engine's sources and those of the studies, for marched, measuring and resting kinds alike."""
    bed = steel(15.0, modes=3, damping_ratio=0.02)
    shuttle = {"kind": "sinusoidal", "centre": 7.5, "amplitude": 3.0, "frequency": 0.3, "cycles": 2}
    car = {"car": {"on": "bed", "kind": "mass", "mass": 50.0, "motion": shuttle}}
    kinds = "double-peak", "influence", "stability"
    for kind in kinds:
        imported.write(here, bed, kind, **({"carriage": car} if kind == "double-peak" else {}))
        Path("bed.toml").rename(f"{kind}.toml")
    done = subprocess.run(
        [sys.executable, "-c", LOADED, *(f"{kind}.toml" for kind in kinds)], capture_output=True, text=True, check=True
    )
    loaded = {Path(name) for name in json.loads(done.stdout.splitlines()[-1])}
    ours = {path for path in loaded if path.is_relative_to(PROGRAM) and path.suffix == ".py"}
    ours = {path for path in ours if path.relative_to(PROGRAM).parts[0] in identity.PACKAGES}
    assert len(ours) > 60 and ours <= set(sources())


@pytest.mark.fault(43)
def test_the_key_follows_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another text of any source is another key, above all of peaks, indices and every kind of study."""
    known = {path.relative_to(PROGRAM).as_posix() for path in sources()}
    assert {
        "studies/findings/peaks.py",
        "studies/findings/indices.py",
        "studies/at_rest/at_rest.py",
        "engine/observation/cycle_reduction.py",
    } <= known
    assert {path.relative_to(PROGRAM).as_posix() for path in KINDS_FOLDER.glob("*.py")} <= known
    copy = tmp_path / "studies" / "peaks.py"
    copy.parent.mkdir()
    monkeypatch.setattr(identity, "PROGRAM", tmp_path)
    study, keys = engine.Study(kind="passage"), []
    monkeypatch.setattr(identity, "sources", lambda: [copy])
    for text in ("one = 1\n", "one = 2\n"):
        copy.write_text(text, encoding="utf-8")
        keys += [run_key(study), sources_hash([copy])]
    assert len(set(keys)) == 4
    assert run_key(study, ["a"]) != run_key(study, ["b"])


@pytest.mark.fault(43)
def test_every_part_says_whose_it_is(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The key stands in the part itself, not only in the folder's file."""
    write(here, SCENES)
    interrupted(monkeypatch, 1)
    key, name, *text = Path("small.nc.parts/key").read_text(encoding="utf-8").splitlines()
    assert name == "small.toml" and key == run_key(engine.load("small.toml")) and text == SCENES.splitlines()
    for path in Path("small.nc.parts").glob("*.nc"):
        with xr.open_dataset(path) as part:
            assert part.attrs["run_key"] == key


@pytest.mark.fault(42)
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass = 1.0", "mass = 2.0", "of another state of this study; expected no file, or the archive of this very "
         "study, received carriage.trolley.mass: 1.0, now 2.0; remedy: choose another place with -o"),
        ("audit = 2", "", "solver.audit: 2, now left out"),
        ("modes = 4", "modes = 4  # as before", "the same keys and values, with other comments"),
        ('title = "small"', 'title = "large"', 'of another study; expected no file, or the archive of this very study, '
         'received title: "small", now "large"'),
        ("1e-6\nyoungs_modulus = 1e9\ndensity = 1000.0", "2e-6\nyoungs_modulus = 2e9\ndensity = 2e3\nown_weight = true",
         "density: 1000.0, now 2000.0; 1 more; remedy"),
    ],
)  # fmt: skip
def test_what_was_edited_since_is_told(old: str, new: str, words: str, here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["run", "small.toml"]) == 0
    write(here, SMALL.replace(old, new))
    capsys.readouterr()
    assert main(["run", "small.toml"]) == 2
    assert words in capsys.readouterr().err
