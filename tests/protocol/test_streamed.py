"""Archives of studies whose results stay on the disk against those of the same studies put together in memory."""

import tracemalloc
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.batch import plan
from results_schema import blocks
from results_schema.errors import ArchiveError, BadInput
from results_schema.store import arrays_on_disk, files, parts, reading, rows, tables
from results_schema.store.archive import open_archive
from results_schema.store.rows import Rows, RowsOnDisk
from results_schema.store.tables import Column, Table
from results_schema.store.writing import write_tables
from studies.commands.cli import main as command
from studies.protocol.parts import Variants
from studies.protocol.study import kind_of
from studies.reporting import tabulated
from tests.protocol.test_named import KINDS, swept
from tests.schema.samples import FailNth
from tests.studies.every_way import assert_same_archives

BLOCK = 3000  # bytes, of some of a hundred variants


def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (blocks, rows, tables):
        monkeypatch.setattr(module, "BLOCK_BYTES", BLOCK)
    monkeypatch.setattr(blocks, "CHUNK_BYTES", BLOCK // 2)


def on_disk_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is small enough for memory."""
    small_blocks(monkeypatch)
    monkeypatch.setattr(parts, "IN_MEMORY", 0)
    monkeypatch.setattr(tabulated, "ROWS_AT_ONCE", 40)
    monkeypatch.setattr(reading, "IN_MEMORY", 0)
    monkeypatch.setattr(reading, "CHUNK_BYTES", 700)


def many_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine.batch.plan.SHOWN", 4)
    monkeypatch.setattr("results_schema.store.rows.SECONDS_PER_PART", 0.0)


def ran(kind: str, path: Path, *options: str) -> Path:
    study = path.with_suffix(".toml")
    study.write_text(swept(kind, KINDS[kind]).source.text, encoding="utf-8")
    assert command(["run", str(study), "-o", str(path), *options]) in (0, 3)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_the_archive_is_the_same(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    many_parts(monkeypatch)
    whole = open_archive(ran(kind, tmp_path / "whole.nc"))
    on_disk_alone(monkeypatch)
    path = ran(kind, tmp_path / "streamed.nc", "--threads", "1")
    assert_same_archives(whole, open_archive(path))
    assert sorted(tmp_path.iterdir()) == [path, path.with_suffix(".toml"), whole.path, whole.path.with_suffix(".toml")]


def told(kind: str, path: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> Sequence[str]:
    """What the report of a kind and a command, which knows no kinds, make of an archive."""
    folder.mkdir()
    said = []
    beside = {"passage": ("info", "--all"), "asymmetry": ("compare", path), "double-peak": ("export", folder / "a.csv")}
    for arguments in (beside[kind], ("report", "-o", folder / "r")):
        assert command([arguments[0], str(path), *map(str, arguments[1:])]) == 0
        said.append(capsys.readouterr().out.replace(folder.name, ""))
    written = [file.read_text(encoding="utf-8") for file in (*folder.glob("*.csv"), folder / "r/report.html")]
    assert len(written) == 1 + (kind == "double-peak")
    return [*said, *written]


def test_what_stays_on_the_disk_takes_no_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    given = swept("passage", KINDS["passage"])
    small = kind_of(given).parts(given)
    assert isinstance(small, Variants) and small.plan.gathered_bytes == small.plan.disk_bytes
    needed = small.plan.memory_bytes
    monkeypatch.setattr(plan, "IN_MEMORY", 0)
    large = kind_of(given).parts(given)
    assert isinstance(large, Variants)
    assert needed - large.plan.memory_bytes == 3 * large.plan.numbers_bytes > 3 * 100 * 8 * 15
    assert large.disk_bytes - small.disk_bytes == large.plan.numbers_bytes
    monkeypatch.setattr(plan, "MOST_MEMORY", large.plan.memory_bytes)
    kind_of(given).parts(given)
    for run in (engine.run, studies.run):  # whose datasets are in memory
        with pytest.raises(BadInput, match="does not fit into memory"):
            run(given)


@pytest.mark.fault(26)
def test_a_disk_that_is_full_then_is_code_74(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where results are put between parts and archive, the second time."""
    many_parts(monkeypatch)
    whole = open_archive(ran("passage", tmp_path / "whole.nc"))
    on_disk_alone(monkeypatch)
    on_the_way = FailNth(2, lambda operation, path: path.name.endswith(".parts") and operation == "write")
    monkeypatch.setattr(files, "FAULTS", on_the_way)
    assert command(["run", str(tmp_path / "whole.toml"), "-o", str(tmp_path / "a.nc")]) == 74
    said = capsys.readouterr().err
    assert "a.nc.parts" in said and "bytes free there" in said
    assert {path.name for path in tmp_path.iterdir()} == {"whole.nc", "whole.toml", "a.nc.parts"}
    monkeypatch.setattr(files, "FAULTS", files.Faults())
    assert_same_archives(whole, open_archive(ran("passage", tmp_path / "a.nc")))


@pytest.mark.parametrize(
    "kind", ["passage", *(pytest.param(kind, marks=pytest.mark.slow) for kind in KINDS if kind != "passage")]
)
def test_commands_read_the_same(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    path = ran(kind, tmp_path / "a.nc")
    capsys.readouterr()
    expected = told(kind, path, tmp_path / "one", capsys)
    on_disk_alone(monkeypatch)
    assert told(kind, path, tmp_path / "two", capsys) == expected


def test_rows_come_back_in_the_order_of_variants(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small_blocks(monkeypatch)
    order, expected = np.random.default_rng(3).permutation(1000), {"a": np.arange(1000.0), "b": np.empty((1000, 3, 2))}
    expected["b"][:] = np.arange(6.0).reshape(3, 2) + np.arange(1000.0)[:, None, None]
    expected["c"] = (np.arange(1000) % 7).astype(np.int8)
    expected["apart"] = np.arange(4000.0).reshape(1000, 4)
    with (tmp_path / "scratch").open("w+b") as file:
        found = RowsOnDisk(file, tmp_path, 1000)
        for variants in np.array_split(order, 13):
            assert not found.finished.all()
            found.add(Rows(variants, {name: array[variants] for name, array in expected.items()}))
        assert found.finished.all()
        for name, array in expected.items():
            for first, end in ((0, 1000), (17, 18), (100, 700), (999, 1000)):
                np.testing.assert_array_equal(found.read(name, first, end), array[first:end])
            on_grid = found.array(name, (10, 20, 5))
            np.testing.assert_array_equal(np.asarray(on_grid), array.reshape(10, 20, 5, *array.shape[1:]))
        np.testing.assert_array_equal(found.read("apart", 100, 700, [3, 1]), expected["apart"][100:700, [3, 1]])
        grid, numbers = tables.xr.Variable(("x", "y", "z"), found.array("apart", (50, 20))), expected["apart"]
        for key in ((..., 2), (slice(4, 9), 3, 1), (slice(None), slice(None), slice(3, None, -2))):
            np.testing.assert_array_equal(grid[key].values, numbers.reshape(50, 20, 4)[key])
        with pytest.raises(AssertionError, match="comes twice"):
            found.add(Rows(order[:1], {name: array[order[:1]] for name, array in expected.items()}))


@pytest.mark.parametrize("shape", [(5000,), (40, 70), (3, 900), (7, 2, 2000)])
def test_blocks_give_the_bytes_of_the_whole(
    shape: tuple[int, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = np.random.default_rng(1).normal(size=shape)
    dims = tuple(f"d{axis}" for axis in range(len(shape)))
    table = {"/": Table(dict(zip(dims, shape, strict=True)), {"a": Column(dims, data, {})})}
    monkeypatch.setattr(blocks, "CHUNK_BYTES", BLOCK // 2)
    written = []
    for size in (2**24, BLOCK, 1):
        monkeypatch.setattr(blocks, "BLOCK_BYTES", size)
        write_tables(tmp_path / "a.nc", table)
        written.append((tmp_path / "a.nc").read_bytes())
    assert written[0] == written[1] == written[2]


def test_slices_of_what_is_on_the_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers, asked = np.arange(120.0).reshape(10, 4, 3), list[tuple[slice, tuple[int | slice, ...]]]()

    def read(rows: slice, at: tuple[int | slice, ...]) -> np.ndarray:
        asked.append((rows, at))
        return numbers[(rows, *at)].copy()

    for most in (0, 2**20):
        monkeypatch.setattr(arrays_on_disk, "RECENT_BYTES", most)
        array = arrays_on_disk.OnDisk(numbers.shape, numbers.dtype, read)
        variable = tables.xr.Variable(("x", "y", "z"), arrays_on_disk.indexing.LazilyIndexedArray(array))
        for key in (
            (slice(2, 5),),
            (7, 1, 2),
            (slice(8, 1, -3), slice(None), 0),
            ([3, 1], slice(1, 3)),
            (slice(4, 4),),
        ):
            np.testing.assert_array_equal(variable[key].values, numbers[key])
        np.testing.assert_array_equal(variable.transpose("z", "x", "y").values, numbers.transpose(2, 0, 1))
    assert asked[:2] == [(slice(2, 5), (slice(None), slice(None))), (slice(7, 8), (1, 2))]
    # transposed, once as it is and once from what was read as a whole
    assert [at for rows, at in asked if rows == slice(0, 10)] == [(slice(0, 4), slice(0, 3)), ()]


def test_what_was_asked_for_longest_ago_is_forgotten_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays, and columns of few numbers, of which two of 80 bytes have room."""
    asked = list[str]()

    def on_disk(name: str, numbers: np.ndarray) -> Any:
        def read(rows: slice, at: tuple[int | slice, ...]) -> np.ndarray:
            asked.append(name)
            return numbers[(rows, *at)].copy()

        array = arrays_on_disk.OnDisk(numbers.shape, numbers.dtype, read)
        return tables.xr.Variable(("x", "y")[: numbers.ndim], arrays_on_disk.indexing.LazilyIndexedArray(array))

    monkeypatch.setattr(arrays_on_disk, "RECENT_BYTES", 160)
    numbers = np.arange(30.0).reshape(10, 3)
    a, b, columns = on_disk("a", numbers[:, 0]), on_disk("b", numbers[:, 1]), on_disk("columns", numbers)
    for variable, wanted in ((a, numbers[:, 0]), (b, numbers[:, 1]), (a[2:4], numbers[2:4, 0])):
        assert np.array_equal(variable.values, wanted)
    assert asked == ["a", "b"]
    assert np.array_equal(columns[:, 2].values, numbers[:, 2]) and np.array_equal(columns[4:, 2].values, numbers[4:, 2])
    assert np.array_equal(a.values, numbers[:, 0]) and asked == ["a", "b", "columns"]
    assert np.array_equal(b.values, numbers[:, 1]) and asked[3:] == ["b"]
    assert np.array_equal(columns.values, numbers) and asked[4:] == ["columns"]  # more than there is room for


def test_an_archive_that_is_replaced_while_it_is_read_is_no_mixture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = ran("passage", tmp_path / "a.nc")
    on_disk_alone(monkeypatch)
    monkeypatch.setattr(arrays_on_disk, "RECENT_BYTES", 0)
    root = open_archive(path).root
    assert root["midspan_max"].values.size == 100
    files.write_whole(path, lambda temporary: temporary.write_bytes(path.read_bytes()))
    with pytest.raises(ArchiveError, match="has changed while it was read"):
        root["midspan_max"].load()


def test_memory_holds_a_few_arrays_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """24 arrays of 4 MB through a file into an archive, and out of it: less than 24 MB at any time."""
    monkeypatch.setattr(reading, "IN_MEMORY", 0)
    monkeypatch.setattr(arrays_on_disk, "RECENT_BYTES", 2**23)
    monkeypatch.setattr(tables, "BLOCK_BYTES", 2**20)
    for module in (blocks, rows):
        monkeypatch.setattr(module, "BLOCK_BYTES", 2**21)
    count, names = 2**19, [f"a{number}" for number in range(24)]
    tracemalloc.start()
    with (tmp_path / "scratch").open("w+b") as file:
        found = RowsOnDisk(file, tmp_path, count)
        for variants in np.array_split(np.random.default_rng(3).permutation(count), 32):
            found.add(Rows(variants, {name: variants.astype(float) for name in names}))
        columns = {name: tables.xr.Variable(("variant",), found.array(name, (count,))) for name in names}
        root = tables.from_dataset(tables.xr.Dataset(columns, attrs={"schema_version": 2, "study_kind": "passage"}))
        write_tables(tmp_path / "a.nc", {"/": root})
    with reading.opened(tmp_path / "a.nc") as dataset:
        read = tables.to_dataset(reading.read_small_tables(tmp_path / "a.nc", dataset)["/"])
    for name in names:
        assert np.array_equal(read[name].values, np.arange(float(count)))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 24 * 2**20
