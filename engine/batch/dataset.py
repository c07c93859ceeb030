"""From flat arrays of results to a labelled dataset: the sweep's grid, units, coordinates, histories."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.results import results_of, tolerances
from engine.batch.plan import Plan
from engine.march.envelopes import envelope_places
from engine.model.lane_table import moving_mass
from engine.model.scene_model import SceneModel
from engine.scene.sweep import Cases
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.store.rows import Rows
from results_schema.variables import axes, declarations

Arrays = dict[str, NDArray[Any]]

SHAPE_STATIONS = 201  # of the mode shapes in the archive


def build(plan: Plan, arrays: Arrays, selected: Rows | None) -> xr.Dataset:
    """The dataset of a study's results; variables that are not declared are left out, except those that the study's
    own summary is made of (`<sensor>_static`)."""
    dataset = results_over(plan, plan.cases, arrays)
    if selected is not None:
        dataset = with_histories(plan, dataset, selected)
    return with_ratios(plan, dataset)


def results_over(plan: Plan, cases: Cases, arrays: Arrays) -> xr.Dataset:
    """The results of some cases of a study, without histories and ratios."""
    study, declared = plan.study, plan.declared
    reduction, results = plan.asked.reduction, results_of(plan.asked)
    labels = coordinates(cases) | {"sensor": ("sensor", list(study.sensor), {"long_name": "sensor"})}
    for name, places in envelope_places(plan.base).items():
        labels[f"{name}_place"] = (f"{name}_place", places, declared[f"{name}_place"].attributes())
    labels["result"] = ("result", [result.name for result in results], axes()["result"].attributes())
    extra = {} if reduction is None else dict(reduction.outputs(study))
    extra["estimated_error"] = ("result",)
    extra |= {f"{name}_envelope_{end}": (f"{name}_place",) for name in study.envelope for end in ("max", "min")}
    found: dict[str, Any] = {"tolerance": ("result", tolerances(results), declared["tolerance"].attributes())}
    for name, array in arrays.items():
        dims = (*cases.dims, *extra.get(name, ()))
        shape = (*cases.shape, *array.shape[1:])
        variable = declared.get(name)
        attributes = variable.attributes() if variable is not None else _own_attributes(name, study.sensor_units)
        found[name] = (dims, array.reshape(shape), attributes)
    # All at once: every variable that is added to a dataset costs a millisecond, and chunks are reduced in this form.
    return xr.Dataset(found, labels, {"study_kind": study.kind, "title": study.title})


def model_groups(model: SceneModel) -> dict[str, xr.Dataset]:
    """The bodies of an unswept scene, by group: frequencies, damping and mode shapes on the track, length and mass."""
    values = VariantValues(model.study, {}, 1)
    declared = {variable.name: variable for variable in declarations("/model")}
    found = {}
    for part in model.bodies:
        x = np.linspace(0.0, part.modal.length, SHAPE_STATIONS)
        omega = part.modal.omega
        rates = values.damping_rates(part.name, omega)[:, 0]
        ratio = np.divide(rates, 2.0 * omega, out=np.full_like(omega, np.nan), where=omega > 0.0)
        arrays = {
            "frequency": ("body_mode", omega / (2.0 * np.pi)),
            "damping_ratio": ("body_mode", np.where(omega > 0.0, ratio, 0.0)),
            "mode_shape": (("body_mode", "track_position"), part.modal.shape(x).T),
            "length": ((), part.modal.length),
            "mass": ((), part.modal.mass),
        }
        found[f"/model/{part.name}"] = xr.Dataset(
            {name: (dims, array, declared[name].attributes()) for name, (dims, array) in arrays.items()},
            coords={
                "body_mode": ("body_mode", np.arange(1, omega.size + 1), axes()["body_mode"].attributes()),
                "track_position": ("track_position", x, axes()["track_position"].attributes()),
            },
        )
    return found


def _own_attributes(name: str, sensors: Mapping[str, str]) -> dict[str, str]:
    sensor = name.removesuffix("_static")
    if sensor in sensors:
        return {"units": sensors[sensor], "long_name": f"largest absolute static value of {sensor}"}
    return {"long_name": name.replace("_", " ")}


def coordinates(cases: Cases) -> dict[str, Any]:
    """The sweep's axes with units; zipped or sampled parameters stand along ``variant``."""
    found: dict[str, Any] = {}
    for axis in cases.axes:
        words = {"long_name": axis.name.replace("_", " "), "comment": f"of {', '.join(axis.of)}"}
        attributes = {"units": axis.units or "1", **words}
        found[axis.name] = (axis.dim, axis.values, attributes)
    if "variant" in cases.dims:
        count = cases.shape[cases.dims.index("variant")]
        found["variant"] = ("variant", np.arange(count, dtype=np.int64), axes()["variant"].attributes())
    return found


def with_ratios(plan: Plan, dataset: xr.Dataset) -> xr.Dataset:
    """Speed and mass ratios of the first carriage, along those dimensions only on which they depend."""
    for name, ratio in (("speed_ratio", _speed_ratio(plan)), ("mass_ratio", _mass_ratio(plan))):
        if ratio is not None:
            dims, values = _narrowed(plan, ratio)
            dataset = dataset.assign_coords({name: (dims, values, axes()[name].attributes())})
    return dataset


def _speed_ratio(plan: Plan) -> Array | None:
    """Top speed over omega_1 L/pi, for motions with a speed of their own."""
    if next(iter(plan.study.carriage.values())).motion.pace != "speed":
        return None
    found = np.empty(plan.size)
    for grid, members in zip(plan.grids, plan.members, strict=True):
        scene = grid.scene
        speed = grid.values.speed(scene.carriages[0].name)
        found[members] = speed * np.pi / (scene.first_omega * scene.leading_body.modal.length)
    return found


def _mass_ratio(plan: Plan) -> Array | None:
    """Mass of the first carriage over its body's, where that has one."""
    first = next(iter(plan.study.carriage))
    if not plan.study.carriage[first].inertial:
        return None
    if not all(grid.scene.leading_body.modal.mass > 0.0 for grid in plan.grids):  # of matrices without one that way
        return None
    found = np.empty(plan.size)
    for grid, members in zip(plan.grids, plan.members, strict=True):
        found[members] = moving_mass(grid.scene, grid.values, 0) / grid.scene.leading_body.modal.mass
    return found


def _narrowed(plan: Plan, values: Array) -> tuple[tuple[str, ...], Array]:
    """Values of all variants without the dimensions along which they are constant."""
    grid = values.reshape(plan.cases.shape)
    dims = list(plan.cases.dims)
    for dim in tuple(dims):
        place = dims.index(dim)
        first = np.take(grid, [0], axis=place)
        if np.array_equal(np.broadcast_to(first, grid.shape), grid):
            grid = np.take(grid, 0, axis=place)
            dims.remove(dim)
    return tuple(dims), grid


def with_histories(plan: Plan, dataset: xr.Dataset, selected: Rows) -> xr.Dataset:
    """The dataset with histories: on the whole grid where every variant has one, else along ``history``."""
    declared = plan.declared
    stations = selected.arrays["elapsed"].shape[1]
    whole = selected.variants.size == plan.size
    lead = plan.cases.dims if whole else ("history",)
    shape = plan.cases.shape if whole else (selected.variants.size,)
    along, coordinate = _stations(plan, stations)
    dataset = dataset.assign_coords({along: coordinate})
    if not whole:
        dataset = dataset.assign_coords(history=("history", selected.variants, axes()["history"].attributes()))
    for name, array in selected.arrays.items():
        if name == "elapsed":
            dataset = dataset.assign_coords(
                elapsed=((*lead, along), array.reshape(*shape, stations), axes()["elapsed"].attributes())
            )
        elif name in declared:
            dataset[name] = ((*lead, along), array.reshape(*shape, stations), declared[name].attributes())
    return dataset


def _stations(plan: Plan, stations: int) -> tuple[str, tuple[str, NDArray[Any], dict[str, Any]]]:
    """The dimension of histories: the phase of the cycle where all have the same, else a number."""
    phases = plan.phases_shown
    if phases is not None:
        return "phase", ("phase", phases, axes()["phase"].attributes())
    return "station", ("station", np.arange(stations, dtype=np.int64), axes()["station"].attributes())
