"""A reduced body in a netCDF-4 file: everything that the march knows of it, and nothing of its mesh."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from results_schema.arrays import Array
from results_schema.errors import ArchiveError
from results_schema.store import files
from results_schema.store.reading import check_sizes, opened, read_tables
from results_schema.store.tables import Column, Table, canonical
from results_schema.store.writing import write_tables

BODY_VERSION = 1
_VERSION = "body_version"


@dataclass(frozen=True)
class BodyVariable:
    """One array of a body: its dimensions, unit and meaning."""

    name: str
    dims: tuple[str, ...]
    units: str
    meaning: str


def _of_elements(name: str, units: str, meaning: str, *more: str) -> BodyVariable:
    return BodyVariable(name, ("element", *more), units, meaning)


VARIABLES = (
    BodyVariable("omega", ("mode",), "rad s-1", "circular frequency, 0 for rigid-body modes"),
    BodyVariable("participation", ("mode",), "kg0.5", "integral of the shape along gravity over the body's mass"),
    BodyVariable("wave_number", ("mode",), "m-1", "largest wave number on the track"),
    BodyVariable("place", ("point",), "m", "ends of the track's elements"),
    BodyVariable("shape", ("point", "mode"), "kg-0.5", "deflection of the track, unit modal mass"),
    BodyVariable("shape_slope", ("point", "mode"), "kg-0.5 m-1", "its slope"),
    BodyVariable("shape_curvature", ("element", "end", "mode"), "kg-0.5 m-2", "its curvature at the elements' ends"),
    BodyVariable("section_force", ("element", "end", "force", "mode"), "1", "N, Qy, Qz, T, My, Mz of every mode"),
    BodyVariable("section_force_change", ("element", "end", "force", "mode"), "1", "the same per metre"),
    BodyVariable("pattern", ("pattern", "freedom"), "1", "what loads on the track do to its points"),
    BodyVariable("flexibility", ("response", "load"), "1", "displacements and rotations of points per unit pattern"),
    BodyVariable("weight_response", ("response",), "1", "the same under own weight per unit gravity"),
    _of_elements("spread_weight", "kg m-1", "own weight per length and unit gravity along the axes", "axis"),
    _of_elements("axes", "1", "local axes as rows, the first along the track", "axis", "space"),
    _of_elements("element_length", "m", "length"),
    _of_elements("axial_stiffness", "N", "E A"),
    _of_elements("torsional_stiffness", "N m2", "G J"),
    _of_elements("bending_stiffness_y", "N m2", "E I of bending along y"),
    _of_elements("bending_stiffness_z", "N m2", "E I of bending along z"),
    _of_elements("shear_stiffness_y", "N", "G A_s along y, infinite without shear"),
    _of_elements("shear_stiffness_z", "N", "G A_s along z, infinite without shear"),
    _of_elements("mass_per_length", "kg m-1", "mass per length"),
    _of_elements("twist_inertia", "kg m", "rotary inertia of twist per length"),
    _of_elements("turn_inertia_y", "kg m", "rotary inertia of bending along y per length"),
    _of_elements("turn_inertia_z", "kg m", "rotary inertia of bending along z per length"),
    _of_elements("area", "m2", "cross-section"),
    _of_elements("fibre_distance", "m", "of the extreme fibres along y and z", "across"),
    BodyVariable("direction", ("space",), "1", "in which loads act"),
    BodyVariable("offset", ("space",), "m", "from the members' axis to the loads"),
)
POINT_VARIABLES = (
    BodyVariable("point_shape", ("off_track", "mode"), "1", "motion of points off the track, unit modal mass"),
    BodyVariable("point_flexibility", ("off_track", "off_track_load"), "1", "motion per unit force at points"),
    BodyVariable("point_response", ("response", "off_track_load"), "1", "of the track per unit force at points"),
    BodyVariable("point_weight", ("off_track",), "1", "motion of points under own weight per unit gravity"),
)
POINT_NAMES = "point_name"
NUMBERS = ("length", "mass", "bending_stiffness", "rigid_modes", "gravity_share")


@dataclass(frozen=True, eq=False)
class StoredBody:
    """arrays: all of VARIABLES, and all of POINT_VARIABLES where there are points; numbers: all of NUMBERS."""

    arrays: Mapping[str, Array]
    numbers: Mapping[str, float]
    points: tuple[str, ...]

    @property
    def variables(self) -> tuple[BodyVariable, ...]:
        """What the arrays are."""
        return VARIABLES + (POINT_VARIABLES if self.points else ())


def write_body(path: Path | str, body: StoredBody) -> None:
    """Write a body to a new file, whole or not at all.

    Raises BadInput and OutputFailed as archives do.
    """
    path = Path(path)
    files.check_output_place(path)
    files.check_replaceable(path)
    sizes: dict[str, int] = {}
    columns = {}
    for variable in body.variables:
        data = np.ascontiguousarray(body.arrays[variable.name], dtype=np.float64)
        sizes |= dict(zip(variable.dims, data.shape, strict=True))
        columns[variable.name] = Column(variable.dims, data, {"units": variable.units, "long_name": variable.meaning})
    if body.points:
        columns[POINT_NAMES] = Column(("off_track",), np.array(body.points, dtype=object), {"long_name": "name"})
    attributes: dict[str, Any] = {key: canonical(float(body.numbers[key])) for key in NUMBERS}
    tables = {"/": Table(sizes, columns, attributes | {_VERSION: canonical(BODY_VERSION)})}
    files.write_whole(path, partial(write_tables, tables=tables))


def read_numbers(path: Path | str) -> dict[str, float]:
    """The numbers of a body, without its arrays. Raises BadInput (no such file) and ArchiveError (no body of ours)."""
    path = Path(path)
    with opened(path) as dataset:
        return _numbers(path, dataset)


def read_body(path: Path | str) -> StoredBody:
    """A body out of a file, checked against what was written. Raises BadInput and ArchiveError."""
    path = Path(path)
    with opened(path) as dataset:
        numbers = _numbers(path, dataset)
        check_sizes(path, dataset)
        columns = read_tables(path, dataset)["/"].columns
    named = columns.get(POINT_NAMES)
    points = () if named is None else tuple(str(name) for name in named.data)
    variables = VARIABLES + (POINT_VARIABLES if points else ())
    shapes = {"off_track": len(points), "off_track_load": len(points)}
    for variable in variables:
        column = columns.get(variable.name)
        if column is None or column.dims != variable.dims or column.data.dtype != np.float64:
            raise ArchiveError("no reduced body", where=str(path), expected=f"{variable.name} over {variable.dims}")
        shapes |= dict(zip(variable.dims, column.data.shape, strict=True))
    ends = shapes["element"] + 1
    wanted = {"point": ends, "response": 6 * ends, "load": ends * shapes["pattern"], "freedom": 6, "force": 6}
    if any(shapes[dim] != size for dim, size in wanted.items()):
        raise ArchiveError("the sizes of this body do not belong together", where=str(path))
    return StoredBody({one.name: np.asarray(columns[one.name].data) for one in variables}, numbers, points)


def _numbers(path: Path, dataset: Any) -> dict[str, float]:
    version = getattr(dataset, _VERSION, None)
    if not isinstance(version, int | np.integer):
        raise ArchiveError("this file holds no reduced body", where=str(path), expected=f"an attribute {_VERSION}")
    if version > BODY_VERSION:
        expected = f"{_VERSION} up to {BODY_VERSION}"
        raise ArchiveError("written by a newer version", where=str(path), expected=expected, received=str(version))
    try:
        return {key: float(getattr(dataset, key)) for key in NUMBERS}
    except (AttributeError, TypeError, ValueError) as error:
        raise ArchiveError("no reduced body", where=str(path), expected=", ".join(NUMBERS)) from error
