import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from results_schema.errors import ArchiveBusy, ArchiveError, BadInput, OutputFailed
from results_schema.store import files
from results_schema.store.archive import output_state, write_archive
from results_schema.store.parts import PartStore, finished_so_far
from results_schema.store.rows import Chunk, Collector, Rows
from tests.schema.samples import ATTRIBUTES, FailNth, KillNth, in_child, march


def arrays(variants):
    variants = np.asarray(variants, np.int64)
    return {
        "peak": np.sqrt(variants.astype(float)),
        "status": (variants % 7).astype(np.int8),
        "harmonic": np.outer(variants, np.arange(17.0)).astype(np.float32),
    }


def part(variants, selected=None, /, **others):
    """Name and tables of a chunk."""
    rows = Rows(np.asarray(variants, np.int64), others or arrays(variants))
    chunk = Chunk(rows, selected)
    return chunk.name, chunk.tables


def finished(store):
    return np.sort(np.concatenate([np.empty(0, np.int64), *store.finished().values()]))


def assemble(store, size):
    found = Collector(size)
    for name in store.finished():
        found.add(Chunk.of(store.read(name)))
    return found


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.nc"


def folder(path):
    return path.with_name("a.nc.parts")


def test_arrays_alike_share_a_column_and_come_back_in_their_order(path):
    numbers = {"b": np.array([1.5, 2.5]), "c": np.array([1, 2], np.int8), "variants": np.array([3.5, np.nan])}
    several = {"d": np.ones((2, 3)), "a": np.array([4.5, 5.5]), "e": np.full((2, 3), 7.0), "f": np.zeros((2, 4))}
    name, tables = part([4, 2], Rows(np.array([2]), {"f": np.ones((1, 4))}), **numbers, **several)
    assert len(tables["/"].columns) == 3 + 4 and len(tables["/selected"].columns) == 3 + 1
    with PartStore(path, "key") as store:
        store.write(name, tables)
        rows, selected = Chunk.of(store.read(name))
    assert list(rows.arrays) == [*numbers, *several] and rows.variants.tolist() == [4, 2]
    for name, array in (numbers | several).items():
        assert rows.arrays[name].dtype == array.dtype
        np.testing.assert_array_equal(rows.arrays[name], array)
    assert selected is not None and selected.variants.tolist() == [2]
    np.testing.assert_array_equal(selected.arrays["f"], np.ones((1, 4)))


def test_parts_come_back_where_they_belong(path):
    with PartStore(path, "key") as store:
        assert finished(store).size == 0
        for variants in ([5, 2, 9], [0, 1, 3, 4], [8, 7, 6]):
            store.write(*part(variants))
    with PartStore(path, "key") as store:
        np.testing.assert_array_equal(finished(store), np.arange(10))
        result = assemble(store, 10).arrays
        expected = arrays(np.arange(10))
        assert list(result) == list(expected)
        for name, array in expected.items():
            assert result[name].dtype == array.dtype
            np.testing.assert_array_equal(result[name], array, strict=True)
        store.remove()
    assert list(path.parent.iterdir()) == []


def test_histories_of_a_few_variants_travel_with_their_chunk(path):
    def rows(variants):
        return Rows(np.array(variants, np.int64), {"midspan": np.outer(variants, np.ones(5))})

    with PartStore(path, "key") as store:
        store.write(*part([3, 4, 5], rows([5, 3])))
        store.write(*part([0, 1, 2], rows([1])))
        store.write(*part([6], rows([])))
        found = assemble(store, 7).selected
    np.testing.assert_array_equal(found.variants, [1, 3, 5])
    np.testing.assert_array_equal(found.arrays["midspan"], np.outer([1, 3, 5], np.ones(5)))


def test_a_part_is_named_by_its_variants_and_written_once(path):
    with PartStore(path, "key") as store:
        first = store.write(*part([1, 2]))
        content = first.read_bytes()
        assert store.write(*part([1, 2])) == first
        assert first.read_bytes() == content
        assert store.write(*part([2, 1])) != first


def test_parts_are_counted_from_outside(path):
    assert finished_so_far(path) is None
    with PartStore(path, "key") as store:
        store.write(*part([0, 2]))
        assert [found.tolist() for found in finished_so_far(path)] == [[0, 2]]
        assert assemble(store, 3).finished.tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("variants", "columns"),
    [
        ([], {"x": np.empty(0)}),
        ([-1], {"x": np.ones(1)}),
        ([1, 2], {"x": np.ones(3)}),
        ([1], {"x": np.array(["text"])}),
    ],
)
def test_arrays_that_do_not_fit_are_refused(path, variants, columns):
    with PartStore(path, "key") as store:
        with pytest.raises(ValueError, match=r"variants|x: expected"):
            store.write(*part(variants, **columns))
        assert finished(store).size == 0


def flip(part):
    content = bytearray(part.read_bytes())
    content[len(content) * 3 // 4] ^= 4
    part.write_bytes(content)


def write_text(part):
    part.write_text("not netCDF")
    files.write_sidecar(part)


DAMAGE = {
    "truncated": lambda part: os.truncate(part, part.stat().st_size // 2),
    "empty": lambda part: os.truncate(part, 0),
    "flipped": flip,
    "without sidecar": lambda part: files.sidecar(part).unlink(),
    "only sidecar": lambda part: part.unlink(),
    "text": write_text,
}


@pytest.mark.fault(29, 37)
@pytest.mark.parametrize("damage", DAMAGE.values(), ids=list(DAMAGE))
def test_damaged_parts_are_found_and_computed_again(path, damage):
    with PartStore(path, "key") as store:
        store.write(*part([0, 1]))
        damage(store.write(*part([2, 3])))
    (folder(path) / ".x.nc.1.wanderlast-tmp").write_text("left over")
    (path.parent / ".a.nc.1.wanderlast-tmp").write_text("left over")
    with PartStore(path, "key") as store:
        np.testing.assert_array_equal(finished(store), [0, 1])
        assert len(list(folder(path).iterdir())) == 3  # key, part, sidecar
        store.write(*part([2, 3]))
        np.testing.assert_array_equal(assemble(store, 4).arrays["peak"], np.sqrt(np.arange(4.0)))
    assert sorted(p.name for p in path.parent.iterdir()) == ["a.nc.parts"]


def test_damage_while_assembling_names_the_part_and_deletes_it(path):
    with PartStore(path, "key") as store:
        path_of_part = store.write(*part(np.arange(5000), x=np.random.default_rng(0).random(5000)))
        flip(path_of_part)
        with pytest.raises(ArchiveError, match=path_of_part.name) as caught:
            store.read(path_of_part.stem)
        assert caught.value.exit_code == 4
        assert finished(store).size == 0


def test_parts_of_another_study_are_refused_until_discarded(path):
    with PartStore(path, "one") as store:
        store.write(*part([0]))
    with pytest.raises(BadInput, match="expected key two, received key one"), PartStore(path, "two"):
        pass
    with PartStore(path, "one") as store:
        assert finished(store).size == 1
    with PartStore(path, "one", discard=True) as store:
        assert finished(store).size == 1
    with PartStore(path, "two", discard=True) as store:
        assert finished(store).size == 0


def test_a_folder_without_a_key_is_not_trusted(path):
    with PartStore(path, "key") as store:
        store.write(*part([0]))
    (folder(path) / "key").write_text("")
    with PartStore(path, "key") as store:
        assert finished(store).size == 0


def test_a_file_in_the_way_of_the_parts_is_refused(path):
    folder(path).write_text("mine")
    with pytest.raises(BadInput, match="in the way"), PartStore(path, "key"):
        pass
    assert folder(path).read_text() == "mine"


@pytest.mark.fault(49)
@pytest.mark.parametrize(
    ("theirs", "begun"), [("notes.txt", False), ("results.nc", False), ("notes.txt", True), ("sub/results.nc", True)]
)
def test_files_of_others_among_the_parts_are_left_alone(path, theirs, begun):
    if begun:
        with PartStore(path, "key") as store:
            store.write(*part([0]))
    found = folder(path) / theirs
    found.parent.mkdir(parents=True, exist_ok=True)
    found.write_text("mine")
    before = {entry: entry.is_file() and entry.read_bytes() for entry in folder(path).rglob("*")}
    for discard in (False, True):
        name = theirs.partition("/")[0]
        refused = pytest.raises(BadInput, match=rf"a\.nc\.parts: files that no run .* received {name}; remedy: move")
        with refused, PartStore(path, "key", discard=discard):
            pass
    assert {entry: entry.is_file() and entry.read_bytes() for entry in folder(path).rglob("*")} == before


@pytest.mark.fault(30)
def test_a_second_run_is_refused_at_once_and_the_first_goes_on(path):
    with PartStore(path, "key") as store:
        with pytest.raises(ArchiveBusy) as caught, PartStore(path, "key"):
            pass
        assert caught.value.exit_code == 75
        store.write(*part([0]))
    with PartStore(path, "key") as store:
        assert finished(store).size == 1


HOLDER = """
import sys
from results_schema.store.parts import PartStore
with PartStore(sys.argv[1], "key"):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.mark.fault(30)
def test_a_lock_held_by_another_process_ends_with_it_even_when_killed(path):
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as holder:
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(ArchiveBusy), PartStore(path, "key"):
            pass
        holder.kill()
        holder.wait()
    assert path.with_name("a.nc.lock").exists()
    with PartStore(path, "key") as store:
        assert finished(store).size == 0


@pytest.mark.fault(26)
def test_a_full_disk_at_any_operation_keeps_finished_chunks_whole(path, monkeypatch):
    for number in range(1, 100):
        monkeypatch.setattr(files, "FAULTS", FailNth(number))
        kept = []
        try:
            with PartStore(path, "key") as store:
                for first in (0, 4):
                    store.write(*part(range(first, first + 4)))
                    kept.append(first)
        except OutputFailed as error:
            assert error.free_bytes is not None
        monkeypatch.setattr(files, "FAULTS", files.Faults())
        with PartStore(path, "key") as store:
            assert set(finished(store)[::4]) >= set(kept)
            store.remove()
        if len(kept) == 2:
            assert number > 20
            return
    raise AssertionError("no clean run")


# ---- kills ----


SHAPE = (4, 3)
CHUNKS = (range(0, 7), range(7, 12))


def compute(variants):
    numbers = np.asarray(variants, float)
    return {"midspan_max": np.sin(numbers), "support_max": np.exp(-numbers)}


def run(path):
    """What the command does with a study of two chunks; returns how many chunks it had to compute."""
    with PartStore(path, "study and kernels") as store:
        if output_state(path, ATTRIBUTES["study_sha256"]) == "same study, finished":
            store.remove()
            return 0
        done = {number for variants in store.finished().values() for number in variants}
        open_chunks = [chunk for chunk in CHUNKS if not set(chunk) <= done]
        for chunk in open_chunks:
            computed = Chunk(Rows(np.array(chunk), compute(chunk)))
            store.write(computed.name, computed.tables)
        root = march(SHAPE)
        found = Collector(12)
        for name in store.finished():
            found.add(Chunk.of(store.read(name)))
        for name, array in found.arrays.items():
            root[name] = (root[name].dims, array.reshape(SHAPE), root[name].attrs)
        write_archive(path, root)
        store.remove()
    return len(open_chunks)


@pytest.mark.fault(24)
def test_a_kill_at_any_operation_is_resumed_to_the_same_bytes(tmp_path, monkeypatch):
    clean = tmp_path / "clean.nc"
    assert run(clean) == 2
    recomputed = []
    for number in range(1, 100):
        folder = tmp_path / str(number)
        folder.mkdir()
        path = folder / "clean.nc"
        monkeypatch.setattr(files, "FAULTS", KillNth(number))
        outcome = in_child(lambda path=path: run(path))
        monkeypatch.setattr(files, "FAULTS", files.Faults())
        assert outcome in (0, -signal.SIGKILL)
        recomputed.append(run(path))
        assert path.read_bytes() == clean.read_bytes()
        assert [p.name for p in folder.iterdir()] == ["clean.nc"]
        if outcome == 0:
            break
    assert outcome == 0
    assert number > 25
    # Only the chunk in flight is lost: never more to compute than before, and one chunk less at a time.
    assert recomputed[0] == 2 and recomputed[-1] == 0
    assert set(np.diff(recomputed)) == {0, -1}
