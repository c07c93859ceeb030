import os
import subprocess
import sys

import numpy as np
import pytest

from results_schema.errors import ArchiveBusy, ArchiveError, BadInput, OutputFailed
from results_schema.store import files
from results_schema.store.parts import PartStore, Rows
from tests.schema.samples import FailNth


def chunk(variants):
    variants = np.asarray(variants, np.int64)
    return variants, {
        "peak": np.sqrt(variants.astype(float)),
        "status": (variants % 7).astype(np.int8),
        "harmonic": np.outer(variants, np.arange(17.0)).astype(np.float32),
    }


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.nc"


def folder(path):
    return path.with_name("a.nc.parts")


def test_parts_come_back_where_they_belong(path):
    with PartStore(path, "key") as store:
        assert store.finished().size == 0
        for variants in ([5, 2, 9], [0, 1, 3, 4], [8, 7, 6]):
            store.write(*chunk(variants))
    with PartStore(path, "key") as store:
        np.testing.assert_array_equal(store.finished(), np.arange(10))
        result = store.assemble(10)
        _, expected = chunk(np.arange(10))
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
        store.write(*chunk([3, 4, 5]), rows([5, 3]))
        store.write(*chunk([0, 1, 2]), rows([1]))
        store.write(*chunk([6]), rows([]))
        found = store.assemble_selected()
    np.testing.assert_array_equal(found.variants, [1, 3, 5])
    np.testing.assert_array_equal(found.arrays["midspan"], np.outer([1, 3, 5], np.ones(5)))
    with PartStore(path.with_name("b.nc"), "key") as store:
        assert store.assemble_selected().variants.size == 0


def test_a_part_is_named_by_its_variants_and_written_once(path):
    with PartStore(path, "key") as store:
        first = store.write(*chunk([1, 2]))
        content = first.read_bytes()
        assert store.write(*chunk([1, 2])) == first
        assert first.read_bytes() == content
        assert store.write(*chunk([2, 1])) != first


def test_what_is_not_computed_yet_is_not_assembled(path):
    with PartStore(path, "key") as store:
        store.write(*chunk([0, 2]))
        with pytest.raises(ArchiveError, match="expected 3 finished variants, received 2"):
            store.assemble(3)
        with pytest.raises(ArchiveError, match="does not have"):
            store.assemble(2)


def test_parts_with_other_results_are_refused(path):
    with PartStore(path, "key") as store:
        store.write(*chunk([0]))
        store.write(np.array([1]), {"peak": np.ones(1)})
        with pytest.raises(ArchiveError, match="different results"):
            store.assemble(2)


@pytest.mark.parametrize(
    ("variants", "arrays"),
    [
        ([], {"x": np.empty(0)}),
        ([-1], {"x": np.ones(1)}),
        ([1, 2], {"x": np.ones(3)}),
        ([1], {"x": np.array(["text"])}),
        ([1], {"variants": np.ones(1)}),
    ],
)
def test_arrays_that_do_not_fit_are_refused(path, variants, arrays):
    with PartStore(path, "key") as store:
        with pytest.raises(ValueError, match=r"variants|x: expected"):
            store.write(np.array(variants, np.int64), arrays)
        assert store.finished().size == 0


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


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=list(DAMAGE))
def test_damaged_parts_are_found_and_computed_again(path, damage):
    with PartStore(path, "key") as store:
        store.write(*chunk([0, 1]))
        damage(store.write(*chunk([2, 3])))
    (folder(path) / ".x.nc.1.wanderlast-tmp").write_text("left over")
    (path.parent / ".a.nc.1.wanderlast-tmp").write_text("left over")
    with PartStore(path, "key") as store:
        np.testing.assert_array_equal(store.finished(), [0, 1])
        assert len(list(folder(path).iterdir())) == 3  # key, part, sidecar
        store.write(*chunk([2, 3]))
        np.testing.assert_array_equal(store.assemble(4)["peak"], np.sqrt(np.arange(4.0)))
    assert sorted(p.name for p in path.parent.iterdir()) == ["a.nc.parts"]


def test_damage_while_assembling_names_the_part_and_deletes_it(path):
    with PartStore(path, "key") as store:
        part = store.write(np.arange(5000), {"x": np.random.default_rng(0).random(5000)})
        store.finished()
        flip(part)
        with pytest.raises(ArchiveError, match=part.name) as caught:
            store.assemble(5000)
        assert caught.value.exit_code == 4
        assert store.finished().size == 0


def test_parts_of_another_study_are_refused_until_discarded(path):
    with PartStore(path, "one") as store:
        store.write(*chunk([0]))
    with pytest.raises(BadInput, match="expected key two, received key one"), PartStore(path, "two"):
        pass
    with PartStore(path, "one") as store:
        assert store.finished().size == 1
    with PartStore.discard_foreign(path, "one") as store:
        assert store.finished().size == 1
    with PartStore.discard_foreign(path, "two") as store:
        assert store.finished().size == 0


def test_a_folder_without_a_key_is_not_trusted(path):
    with PartStore(path, "key") as store:
        store.write(*chunk([0]))
    (folder(path) / "key").write_text("")
    with PartStore(path, "key") as store:
        assert store.finished().size == 0


def test_a_file_in_the_way_of_the_parts_is_refused(path):
    folder(path).write_text("mine")
    with pytest.raises(BadInput, match="in the way"), PartStore(path, "key"):
        pass
    assert folder(path).read_text() == "mine"


def test_a_second_run_is_refused_at_once_and_the_first_goes_on(path):
    with PartStore(path, "key") as store:
        with pytest.raises(ArchiveBusy) as caught, PartStore(path, "key"):
            pass
        assert caught.value.exit_code == 75
        store.write(*chunk([0]))
    with PartStore(path, "key") as store:
        assert store.finished().size == 1


HOLDER = """
import sys
from results_schema.store.parts import PartStore
with PartStore(sys.argv[1], "key"):
    print("held", flush=True)
    sys.stdin.read()
"""


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
        assert store.finished().size == 0


def test_a_full_disk_at_any_operation_keeps_finished_chunks_whole(path, monkeypatch):
    for number in range(1, 100):
        monkeypatch.setattr(files, "FAULTS", FailNth(number))
        kept = []
        try:
            with PartStore(path, "key") as store:
                for first in (0, 4):
                    store.write(*chunk(range(first, first + 4)))
                    kept.append(first)
        except OutputFailed as error:
            assert error.free_bytes is not None
        monkeypatch.setattr(files, "FAULTS", files.Faults())
        with PartStore(path, "key") as store:
            finished = store.finished()
            assert set(finished[::4]) >= set(kept)
            store.remove()
        if len(kept) == 2:
            assert number > 20
            return
    raise AssertionError("no clean run")
