"""Imports flow one way, heavy packages stay where they belong, and importing ours costs next to nothing."""

import ast
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("results_schema", "engine", "studies")

# The rooms, from the ground floor up: a module imports modules of its own room and of those before it.
ROOMS = (
    *("results_schema", "results_schema.store"),
    *("engine", "engine.study_file", "engine.kernels", "engine.kernels.stepping", "engine.kernels.floating"),
    "engine.kernels.robots",
    *("engine.bodies.modal", "engine.bodies.beam", "engine.bodies.rigid", "engine.bodies.frame"),
    *("engine.bodies.reduced", "engine.bodies.files", "engine.bodies.imported", "engine.bodies"),
    *(
        "engine.scene.motions",
        "engine.scene",
        "engine.model",
        "engine.observation",
        "engine.statics",
        "engine.march",
        "engine.accuracy",
    ),
    *("engine.floating.bodies", "engine.floating", "engine.robots"),
    *("engine.batch", "engine.methods", "engine.unreduced"),
    *("studies.results", "studies.protocol", "studies.findings", "studies.at_rest", "studies.precision"),
    *("studies.moving", "studies.robots"),
    *("studies.stability_maps", "studies.runs", "studies.pictures.common"),
    *("studies.pictures", "studies.kinds"),
    *("studies.reporting", "studies.commands", "studies"),
)
# What every room may know of those above it: the public names of a package, by which users know it.
PUBLIC = {"engine", "studies", "results_schema"}
MOST_FILES = 15  # of a folder
LONGEST_CHAIN = 16  # of files that need each other, one after the other
HEAVY = {"numba", "scipy", "xarray", "pandas", "dask", "pint", "matplotlib", "netCDF4", "jinja2", "pydantic"} | {
    "distributed", "pyyeti", "mapdl_archive", "ansys", "pyvista", "vtk",
}  # fmt: skip
# Packages that only these modules of ours may import.
ONLY_IN = {
    "dask": ("engine.batch",),
    "distributed": ("engine.batch",),
    "numba": ("engine.kernels",),
    "netCDF4": ("results_schema",),
    "click": ("studies",),
    "rich": ("studies.commands.console",),
    "matplotlib": ("studies",),
    "jinja2": ("studies",),
    "pint": ("engine.study_file.units",),
    "threadpoolctl": ("engine.linear_algebra",),
}


@cache
def modules() -> dict[str, ast.Module]:
    """All our modules by name, parsed."""
    found = {}
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts).removesuffix(".__init__")] = ast.parse(path.read_text(encoding="utf-8"))
    return found


def imports(tree: ast.AST, besides: tuple[type[ast.AST], ...] = ()) -> Iterator[str]:
    """Every module that is imported at run time, anywhere in a module ``besides`` in some sorts of statements."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, besides):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, "relative imports hide the direction"
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        yield from imports(node, besides)


@cache
def imported() -> dict[str, set[str]]:
    """What each of them imports."""
    return {name: set(imports(tree)) for name, tree in modules().items()}


def test_everything_is_found() -> None:
    assert len(modules()) > 40
    assert (
        "engine.study_file.document" in imported()["engine.scene.study"]
        and "results_schema.errors" in imported()["engine.scene.study"]
    )


def test_packages_import_downwards() -> None:
    for name, found in imported().items():
        above = PACKAGES[PACKAGES.index(name.partition(".")[0]) + 1 :]
        assert {other for other in found if other.partition(".")[0] in above} == set(), name


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_needs_itself(package: str) -> None:
    own = {name: {found for found in imported()[name] if found in modules() and found != name} for name in modules()}
    graph = {name: own[name] for name in modules() if name.partition(".")[0] == package and name != package}
    order = list(TopologicalSorter(graph).static_order())  # raises CycleError
    assert set(graph) <= set(order)


def test_chains_of_imports_are_short() -> None:
    """What is imported inside functions or for annotations alone is not needed to load a file."""

    @cache
    def floors(name: str) -> int:
        needed = set(imports(modules()[name], (ast.FunctionDef, ast.AsyncFunctionDef))) & set(modules()) - {name}
        return 1 + max(map(floors, needed), default=0)

    assert max(map(floors, modules())) <= LONGEST_CHAIN


def room(name: str) -> str:
    """The folder of a module."""
    return name if name in ROOMS else name.rpartition(".")[0]


def test_every_room_is_known() -> None:
    assert {room(name) for name in modules()} == set(ROOMS)


def test_rooms_import_downwards() -> None:
    place = {name: ROOMS.index(room(name)) for name in modules()}
    upwards = [
        f"{name} imports {other}"
        for name, found in imported().items()
        for other in found & set(modules()) - PUBLIC
        if place[other] > place[name]
    ]
    assert upwards == []


def test_no_room_is_crowded() -> None:
    files = Counter(room(name) for name in modules() if name not in ROOMS)
    files += Counter(str(path.parent) for path in (ROOT / "tests").rglob("*.py") if path.name != "__init__.py")
    assert {folder for folder, count in files.items() if count > MOST_FILES} == set()


def test_kernels_know_numbers_only() -> None:
    allowed = {"numpy", "numba", "llvmlite", *sys.stdlib_module_names}
    for name in (name for name in modules() if name.startswith("engine.kernels")):
        foreign = {found for found in imported()[name] if not found.startswith("engine.kernels")}
        assert {found.partition(".")[0] for found in foreign} <= allowed, name


@pytest.mark.parametrize("package", sorted(ONLY_IN))
def test_packages_stay_where_they_belong(package: str) -> None:
    users = [name for name, found in imported().items() if package in {other.partition(".")[0] for other in found}]
    assert users
    assert [name for name in users if not f"{name}.".startswith(tuple(f"{p}." for p in ONLY_IN[package]))] == []


@pytest.mark.parametrize("package", ["results_schema", "engine", "studies", "studies.commands.cli"])
def test_importing_is_light(package: str) -> None:
    code = f"import sys, {package}; print(*{{name.partition('.')[0] for name in sys.modules}})"
    loaded = set(python("-c", code).split())
    assert package.partition(".")[0] in loaded
    assert loaded & HEAVY == set()


def test_importing_takes_no_longer_than_numpy_and_a_fifth_of_a_second() -> None:
    assert best_seconds("-c", "import engine") < best_seconds("-c", "import numpy") + 0.2


def best_seconds(*arguments: str) -> float:
    """Processor seconds of the quickest of five runs of Python: other processes, of tests too, take none of them."""

    def seconds() -> float:
        start = os.times()
        python(*arguments)
        end = os.times()
        return end.children_user + end.children_system - start.children_user - start.children_system

    return min(seconds() for _ in range(5))


def python(*arguments: str) -> str:
    """Standard output of Python in the project's folder."""
    done = subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout
