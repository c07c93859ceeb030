"""A run killed in its N-th operation, for every N, goes on and gives the bytes of an uninterrupted one."""

import signal

import numpy as np
import pytest

from results_schema.store import files
from results_schema.store.archive import output_state, write_archive
from results_schema.store.parts import PartStore
from results_schema.store.rows import Chunk, Collector, Rows
from tests.schema.samples import ATTRIBUTES, KillNth, in_child, march

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
