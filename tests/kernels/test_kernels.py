"""The kernels themselves: no index out of range, the same numbers without the compiler, one tie as many, the cache."""

import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import engine.march.march
from engine.batch.execution import run
from engine.batch.plan import make_plan
from engine.kernels import jit
from engine.kernels.stepping.march import march_many
from engine.march.outcome import outcome
from engine.scene.study import Study
from tests.engine.build import aboard, beam, cruise, fixed, force, mass, oscillator, shuttle, study, under

ROOT = Path(__file__).parents[2]
QUANTITIES = ("displacement", "velocity", "acceleration", "bending_moment", "shear_force")
SPRINGS = [{"at": 0.0, "stiffness": 60.0}, {"at": 1.0, "stiffness": 90.0, "damping": 0.5}]


def small(name: str) -> Study:
    """Small studies that reach every branch of the kernels: one tie, three, springs, sensors of every kind, events,
    steps of one station, mode counts that are and are not multiples of four."""
    sensors = {quantity: fixed(0.31, quantity) for quantity in QUANTITIES}
    sensors |= {f"below_{quantity}": under("car", quantity) for quantity in QUANTITIES}
    sweep = {"weight": {"of": "carriage.car.mass", "from": 0.1, "to": 0.5, "count": 18}}
    given: dict[str, Any] = {"sensor": sensors, "output": {"histories": "all"}, "sweep": sweep}
    short = cruise(-0.1, 1.1, 0.9, after=0.02)
    if name == "one":
        return study(beam(modes=3), mass(0.3, short), **given, solver={"steps": 24})
    if name == "quiet":
        pushed = {"weight": sweep["weight"] | {"of": "carriage.car.force"}}
        return study(beam(modes=4), force(0.3, short), sweep=pushed, solver={"steps": 1})
    if name == "turning":
        return study(beam(modes=2), mass(0.3, shuttle(0.2, 0.8, 1.0, 0.0, 2)), **given, solver={"steps": 16})
    if name == "sprung":
        given["sensor"] = sensors | {f"on_{quantity}": aboard("car", quantity) for quantity in QUANTITIES[:3]}
        riding = {"car": oscillator(0.3, 20.0, short, wheel_mass=0.1, damping=0.6), "next": mass(0.2, short, delay=0.1)}
        return study(beam(modes=6, supports=SPRINGS, own_weight=True), riding, **given, solver={"steps": 90})
    riding = {"car": mass(0.3, short), "next": force(2.0, cruise(1.0, 0.0, 1.1), delay=0.2)}
    if name == "few":
        given["sensor"] = {name: sensors[name] for name in ("bending_moment", "below_displacement")}
    return study(beam(modes=5, supports=SPRINGS, own_weight=True), riding, **given, solver={"steps": 30})


ENDS = (("_max", "_min"), ("_min", "_max"))
NAMES = ("one", "quiet", "turning", "many", "few", "sprung")
SCRIPT = """
import json, sys
import numpy as np
sys.path.insert(0, sys.argv[1])
import engine.march.march
from tests.kernels.test_kernels import numbers_of, small
print(json.dumps({name: numbers_of(small(name)) for name in sys.argv[3:]}))
if sys.argv[2] == "break":  # histories go to a row that is not there
    sampled = engine.march.march.rows_sampled
    engine.march.march.rows_sampled = lambda *given: np.where(sampled(*given) >= 0, 10**9, -1)
    try:
        numbers_of(small("one"))
    except IndexError:
        sys.exit(0)
    sys.exit("nothing was noticed")
"""


def numbers_of(given: Study) -> dict[str, list[float]]:
    """Every floating-point number of the march that a study says, and the histories of all its signals."""
    plan = make_plan(given)
    (group,) = plan.groups
    stations = group.grid.stations(group.scene, 1)
    found = outcome(plan.asked, group.tables, plan.values(group, group.variants), stations)
    signals = {f"signal {number}": found.history[:, number] for number in range(found.history.shape[1])}
    return {
        name: array.ravel().tolist()
        for name, array in (found.numbers | signals).items()
        if array.dtype == np.float64 and "position" not in name
    }


def in_a_process(end: str, names: tuple[str, ...], **environment: str) -> dict[str, dict[str, list[float]]]:
    """Small studies in a process of its own, which at its end may "break" a kernel."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(ROOT), end, *names],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, dict[str, list[float]]] = json.loads(done.stdout)
    assert set(found) == set(names)
    return found


def assert_same(found: dict[str, dict[str, list[float]]], tolerance: float) -> None:
    """The same numbers as in this process."""
    assert sum(same_numbers(results, numbers_of(small(name)), tolerance) for name, results in found.items()) > 3000


def same_numbers(found: dict[str, list[float]], expected: dict[str, list[float]], tolerance: float) -> int:
    """How many are the same, within a part of each result's size, of extremes that of both (a moment at a free end is a
    smallest value of rounding alone); NaN in the same places."""
    assert set(found) == set(expected)
    compared = 0
    for key, values in expected.items():
        one, two = np.array(found[key]), np.array(values)
        np.testing.assert_array_equal(np.isnan(one), np.isnan(two))
        numbers = np.isfinite(two)
        ends = [expected.get(f"{key.removesuffix(end)}{other}", values) for end, other in ENDS if key.endswith(end)]
        size = np.nanmax(np.abs([values, *ends]), initial=0.0)
        np.testing.assert_allclose(one[numbers], two[numbers], rtol=0, atol=tolerance * size, equal_nan=False)
        compared += int(numbers.sum())
    return compared


@pytest.mark.fault(23)
@pytest.mark.slow
def test_no_index_out_of_range(tmp_path: Path) -> None:
    """Fault 23: compiled with checks of every index, which do find one that is out of range."""
    checked = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_OPT": "0", "WANDERLAST_CACHE": str(tmp_path)}
    assert_same(in_a_process("break", NAMES, **checked), 1e-11)


@pytest.mark.fault(23)
def test_the_same_without_the_compiler(tmp_path: Path) -> None:
    plain = {"NUMBA_DISABLE_JIT": "1", "WANDERLAST_CACHE": str(tmp_path)}
    assert_same(in_a_process("break", NAMES, **plain), 1e-11)


@pytest.fixture
def copied_cache(tmp_path: Path) -> Path:
    """A copy of this process' compiled kernels, in a cache folder of its own."""
    run(small("one"))
    run(small("many"))
    here = Path(jit._FOLDER)
    shutil.copytree(here, tmp_path / here.name, ignore=shutil.ignore_patterns("*.tmp.*"))  # another process compiles
    return tmp_path


@pytest.mark.fault(36)
@pytest.mark.slow
def test_a_damaged_cache_is_rebuilt(copied_cache: Path) -> None:
    """Fault 36: every compiled kernel and one index replaced by garbage; the next process finds a whole cache."""
    data, index = list(copied_cache.rglob("*.nbc")), list(copied_cache.rglob("*.nbi"))
    assert len(data) >= 2
    for file in (*data, index[0]):
        file.write_bytes(b"not a kernel")
    assert_same(in_a_process("end", ("one",), WANDERLAST_CACHE=str(copied_cache)), 0.0)
    whole = [file for file in copied_cache.rglob("*.nbc") if file.read_bytes() != b"not a kernel"]
    assert len(whole) >= 2


def save_all(folder: Path, name: str) -> None:
    """Put a hundred entries into one index."""
    index = jit.Index(str(folder), "kernel", "source")
    for number in range(100):
        index.save((name, number), f"{name} {number}")


@pytest.mark.fault(36)
def test_two_processes_compile_into_one_cache(tmp_path: Path) -> None:
    fork = multiprocessing.get_context("fork")
    writers = [fork.Process(target=save_all, args=(tmp_path, name)) for name in ("one", "two")]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    index = jit.Index(str(tmp_path), "kernel", "source")
    for name in ("one", "two"):
        assert [index.load((name, number)) for number in range(100)] == [f"{name} {n}" for n in range(100)]


CACHE_SCRIPT = """
import sys
sys.path.insert(0, sys.argv[1])
sys.path.insert(0, sys.argv[2])
from engine.kernels import jit
import a_kernel
print(a_kernel.twice(3.0), jit._FOLDER, sep="\\n")
"""


@pytest.mark.fault(36)
def test_a_kernel_that_cannot_be_kept_is_no_error(tmp_path: Path) -> None:
    """In a folder that is there, and in one that another process has thrown away meanwhile."""
    for folder in (tmp_path, tmp_path / "gone"):
        index = jit.Index(str(folder), "a_kernel", "stamp of its source")
        index.save("signature", "code")
        assert index.load("signature") == ("code" if folder == tmp_path else None)


@pytest.mark.fault(36)
@pytest.mark.parametrize("place", ["/dev/null/kernels", "a file", "a link"])
def test_an_unwritable_cache_folder(tmp_path: Path, place: str) -> None:
    """Another private folder takes its place, and kernels compile."""
    root = tmp_path / "cache"
    if place == "a file":
        root.write_text("in the way")
    elif place == "a link":
        root.mkdir()
        (tmp_path / "elsewhere").mkdir()
        (root / jit.cache_folder().name).symlink_to(tmp_path / "elsewhere")
    else:
        root = Path(place)
    source = """
        from engine.kernels.jit import kernel

        @kernel
        def twice(x):
            return 2.0 * x
        """
    (tmp_path / "a_kernel.py").write_text(textwrap.dedent(source))
    done = subprocess.run(
        [sys.executable, "-c", CACHE_SCRIPT, str(ROOT), str(tmp_path)],
        env=os.environ | {"WANDERLAST_CACHE": str(root)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    value, folder = done.stdout.split()
    assert float(value) == 6.0
    assert not Path(folder).is_relative_to(root)
    assert list((tmp_path / "elsewhere").glob("*") if place == "a link" else []) == []
    shutil.rmtree(folder, ignore_errors=True)


@pytest.mark.parametrize("name", ["one", "quiet", "turning"])
def test_one_tie_is_many_with_one(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = numbers_of(small(name))
    monkeypatch.setattr(engine.march.march, "march_one", march_many)
    assert same_numbers(numbers_of(small(name)), expected, 1e-11) > 100


def test_policy() -> None:
    """Contract-only fastmath, no parallel loops, and no name of a kernel that the policy does not know; the compiler is
    named where the policy and where the rows of lanes are made, and where people are told that it works."""
    for source in sorted(Path(jit.__file__).parent.rglob("*.py")):
        text = source.read_text()
        assert "prange" not in text
        assert "parallel=True" not in text
        if source.name not in ("jit.py", "vector.py", "compiling.py"):
            assert "numba" not in text.replace("numba's", "")
    options = march_many.targetoptions  # type: ignore[attr-defined]
    assert options["fastmath"] == {"contract"}
    assert options["nogil"]
    assert isinstance(march_many._cache._cache_file, jit.Index)  # type: ignore[attr-defined]


@pytest.mark.fault(36)
def test_kernel_hash_is_of_the_sources(monkeypatch: pytest.MonkeyPatch) -> None:
    before = jit.kernel_hash()
    assert before == jit.kernel_hash()
    read = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda self: read(self) + (b" " if self.name == "march.py" else b""))
    assert jit.kernel_hash() != before
