"""A finished dataset together with the study it came from: axes, parameters, statuses and histories by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array, Mask
from results_schema.lazy_imports import xr
from results_schema.status import LOST, Status, label
from studies.results.axes import PACES, VARIANT, Axis
from studies.results.cells import counts_of
from studies.results.checks import check_whole, taken
from studies.results.formatting import number, quantity, typed_unit
from studies.results.places import Index

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.scene.carriages import Carriage
    from engine.scene.sensors import Envelope, Sensor
    from engine.scene.study import Study

LETTERS = 26  # of a line beside a panel: as many are as high as one of four panels of a figure


class Trace(NamedTuple):
    """History of one sensor in one variant: values (T,) over `along` (T,), whose name is `over`; elapsed s or None."""

    over: str
    along: Array
    values: Array
    elapsed: Array | None

    @property
    def times(self) -> Array:
        """Seconds where they are known, else the stations."""
        return self.along if self.elapsed is None else self.elapsed

    @property
    def end(self) -> float:
        """The last of the times."""
        return float(np.nanmax(self.times))


@dataclass(frozen=True, eq=False)
class Results:
    """A study's dataset, from memory or from its archive, and the study; models: the archive's bodies by name."""

    dataset: xr.Dataset
    study: Study
    models: Mapping[str, xr.Dataset] = field(default_factory=dict)

    @classmethod
    def of(cls, dataset: xr.Dataset, study: Study | None = None) -> Results:
        """The results of a dataset that carries its study's text, which need not be read where the study is at hand.
        Raises BadInput where the text is no study, or the dataset none of its results, or a part of them."""
        import engine

        dataset = taken(dataset)
        if study is None:
            text = str(dataset.attrs["study"])
            study = engine.load(text if "\n" in text else f"{text}\n")
        check_whole(dataset, study)
        return cls(dataset, study)

    @cached_property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of the sweep."""
        return tuple(map(str, self.dataset["status"].dims))

    @property
    def shape(self) -> tuple[int, ...]:
        """Their lengths."""
        return self.dataset["status"].shape

    @property
    def size(self) -> int:
        """Number of variants, or of cells of them."""
        return int(self.dataset["status"].size)

    @property
    def variants(self) -> int:
        """Number of variants."""
        return sum(self.status_counts.values())

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """The swept numbers along which there are results, in the order of the file."""
        found = []
        for name, axis in self.study.sweep.axes.items():
            if name not in self.dataset:
                continue
            coordinate = self.dataset[name]
            values = np.asarray(coordinate.values, dtype=np.float64)
            units = str(coordinate.attrs.get("units", "1"))
            unit = "" if units == "1" else units
            targets = {target: factor for path in axis.of for target, factor in self.study.targets(path).items()}
            found.append(Axis(name, str(coordinate.dims[0]), targets, values, unit, typed_unit(self.study, name)))
        return tuple(found)

    def axis(self, *endings: str) -> Axis | None:
        """The first axis of more than one value that sets a key with one of these endings, tried in their order."""
        varied = [axis for axis in self.axes if len(axis.values) > 1]
        return next((axis for ending in endings for axis in varied if axis.sets(ending)), None)

    def written(self, axis: Axis) -> float | None:
        """What the scene without sweep has in place of an axis; None where that is no one number."""
        found = [(self.study.value(path), factor) for path, factor in axis.targets.items()]
        values = [value / factor for value, factor in found if isinstance(value, int | float)]
        return values[0] if len(values) == len(found) and np.allclose(values, values[0], atol=0.0) else None

    @cached_property
    def sensors(self) -> dict[str, str]:
        """Name and unit of every sensor."""
        return self.study.sensor_units

    @property
    def percentiles(self) -> tuple[float, ...]:
        """Those that are told of every result: over all variants, or over those of the one cell."""
        output = self.study.output
        return output.percentiles if output.keeps_variants or self.size == 1 else ()

    def noun(self, sensor: str) -> str:
        """What a sensor measures, in words."""
        return " ".join(self._words(f"sensor.{sensor}", self.study.sensor[sensor])).strip()

    def noun_along(self, envelope: str) -> str:
        """What an envelope is of, in words."""
        return " ".join(self._words(f"envelope.{envelope}", self.study.envelope[envelope])).strip()

    def _words(self, here: str, own: Sensor | Envelope) -> tuple[str, str]:
        """The quantity of what has its table ``here``, and of which modes where it says so."""
        swept = any(f"{here}.frequency_limit" in axis.paths for axis in self.axes)
        counted = f"of modes up to {number(own.frequency_limit)} Hz" if own.frequency_limit and not swept else ""
        return own.words, counted

    def place(self, sensor: str) -> str:
        """Where a sensor reads, and in which direction where it names one, in words."""
        own = self.study.sensor[sensor]
        if own.rides is not None:
            spot = f"at {own.contact} " if own.contact else ""
            sprung = own.reads.of_mass and self.study.carriage[own.rides].suspension is not None
            of = "of the sprung mass of" if sprung else "of"
            return f"{spot}{'under' if own.under else of} {own.rides}{own.way_in_words}"
        if own.reads.at_joint:
            return f"of {own.body}" if own.joint is None else f"of joint {own.joint} of {own.body}"
        if own.at is None:
            numbered = "node " if str(own.node).isdecimal() else ""  # of a body out of files
            return f"at {numbered}{own.node or own.point}{own.way_in_words}"
        swept = any(f"sensor.{sensor}.at" in axis.paths for axis in self.axes)
        where = f"at {'the swept place' if swept else quantity(own.at, 'm')} of {own.member or own.body}"
        return f"{where}{own.way_in_words}"

    def hangs(self, sensor: str) -> bool:
        """Whether it reads a displacement along gravity, which points down as the body hangs."""
        own, body = self.study.sensor[sensor], self.study.body[self.study.body_of(sensor)]
        along_gravity = own.node is not None or own.member is not None or body.deflects_down(own.point)
        return self.sensors[sensor] == "m" and own.direction is None and along_gravity and not own.reads.of_tree

    def hangs_along(self, envelope: str) -> bool:
        """The same of an envelope."""
        return self.envelopes[envelope] == "m" and self.study.body[self.study.envelope[envelope].body].deflects_down()

    def label(self, sensor: str, unit: str, of: str = "") -> str:
        """Quantity, place and unit of a sensor as on a figure's axis, in lines that fit beside a panel."""
        words, counted = self._words(f"sensor.{sensor}", self.study.sensor[sensor])
        parts = (f"{of} {words}".strip(), counted, f"{self.place(sensor)}{f' ({unit})' if unit else ''}")
        return "\n".join(line for part in parts for line in wrap(part, LETTERS))

    @property
    def carriage(self) -> Carriage:
        """The first carriage."""
        return next(iter(self.study.carriage.values()))

    @property
    def carriage_name(self) -> str:
        """Name of the first carriage."""
        return next(iter(self.study.carriage))

    def recorded(self, body: str) -> xr.Dataset | None:
        """What the archive holds of a body out of files, whose model cannot be built without them; else None."""
        return None if self.study.body[body].recorded is None else self.models[body]

    @cached_property
    def base_model(self) -> SceneModel:
        """The scene without its sweep, as it is marched."""
        from engine.model.scene_model import build_model

        return build_model(self.study.without_sweep(), {}, {})

    @cached_property
    def envelopes(self) -> dict[str, str]:
        """Name and unit of every envelope."""
        return self.study.envelope_units

    @cached_property
    def kept(self) -> xr.DataArray:
        """Where the status keeps values."""
        return ~self.dataset["status"].isin(LOST)

    @cached_property
    def held(self) -> Mask:
        """Where values are kept and the contact holds, in the sweep's shape: beyond, the equations say no more."""
        opened = self.dataset["status"].values == int(Status.SEPARATED)
        for carriage in self.study.carriage:  # a status that comes before this one hides it
            if (name := f"{carriage}_separation_position") in self.dataset:
                opened = opened | np.isfinite(self.dataset[name].transpose(*self.dims).values)
        return np.asarray(self.kept.values & ~opened)

    @cached_property
    def with_values(self) -> Mask:
        """Which variants speak for all, in the sweep's shape: those whose contact holds, or all with values if none."""
        return self.held if self.held.any() else np.asarray(self.kept.values)

    def envelope(self, name: str, end: str) -> Array:
        """An envelope's "max" or "min", in the sweep's shape and over its places."""
        values = self.dataset[f"{name}_envelope_{end}"].transpose(*self.dims, f"{name}_place")
        return np.asarray(values.values, dtype=np.float64)

    @cached_property
    def status_counts(self) -> dict[Status, int]:
        """Number of variants per status, those that occur."""
        return counts_of(self.dataset)

    def parameter(self, path: str) -> xr.DataArray | float:
        """A number of the scene by its dotted key: over the sweep where an axis sets it, else as in the file."""
        axis = next((axis for axis in self.axes if path in axis.paths), None)
        if axis is None:
            return float(self.study.value(path))
        return self.dataset[axis.name].astype(np.float64) * axis.targets[path]

    def everywhere(self, values: Any) -> Array:
        """Values that depend on some of the sweep's axes, or on none, for every variant, in the sweep's shape."""
        own = xr.as_variable(values)  # without coordinates, of which xarray would make copies
        found = np.asarray(own.transpose(*(dim for dim in self.dims if dim in own.dims)).values, dtype=np.float64)
        return np.broadcast_to(found.reshape([own.sizes.get(dim, 1) for dim in self.dims]), self.shape)

    def along(self, axis: Axis, values: NDArray[Any], place: Index) -> NDArray[Any]:
        """(n,) values (in the sweep's shape) along a swept number, through a place of the sweep; ascending with it."""
        own = (slice(None) if dim == axis.dim else entry for dim, entry in zip(self.dims, place, strict=True))
        return np.asarray(values[tuple(own)][np.argsort(axis.values)])

    def deciding_axis(self, variable: str, sensor: str) -> Axis | None:
        """The axis, other than the pace of the motion, along which a result changes most; the mass in doubt."""
        values, pace = self.of_sensor(variable, sensor), self.axis(*PACES)
        axes = [axis for axis in self.axes if axis is not pace and len(axis.values) > 1]
        if not axes or VARIANT in self.dims:
            return self.axis(".mass")
        axes.sort(key=lambda axis: not axis.sets(".mass"))
        return max(axes, key=lambda axis: float((values.max(axis.dim) - values.min(axis.dim)).fillna(0.0).mean()))

    def holds_up_to(self, axis: Axis, holds: Mask, known: Mask) -> float | None:
        """The largest value of an axis up to which something holds in every known variant; None if nowhere.

        holds, known: in the sweep's shape.
        """
        values = self.everywhere(self.dataset[axis.name])
        broken = values[known & ~holds]
        fine = values[known & holds & (values < broken.min() if broken.size else True)]
        return float(fine.max()) if fine.size else None

    def index_of(self, flat: int) -> Index:
        """Place of a variant in the sweep from its flat number."""
        return tuple(int(i) for i in np.unravel_index(flat, self.shape)) if self.dims else ()

    def at(self, index: Index) -> str:
        """The swept parameters of one variant in words; "" without a sweep.

        They read like "speed 5 m/s, mass 100 kg".
        """
        place = dict(zip(self.dims, index, strict=True))
        return ", ".join(axis.at(place[axis.dim]) for axis in self.axes if len(axis.values) > 1)

    def values_at(self, index: Index) -> dict[str, float]:
        """Swept numbers of one variant by dotted key."""
        place = dict(zip(self.dims, index, strict=True))
        return {path: value for axis in self.axes for path, value in axis.columns(place[axis.dim]).items()}

    def carriage_at(self, index: Index) -> Carriage:
        """The first carriage of one variant."""
        own = {path: value for path, value in self.values_at(index).items() if path.startswith("carriage.")}
        whole = {path: int(v) if isinstance(self.study.value(path), int) else v for path, v in own.items()}
        return self.study.without_sweep().with_values(whole).carriage[self.carriage_name]

    def of_sensor(self, variable: str, sensor: str) -> xr.DataArray:
        """A result over sensors, or robots or bodies, for one of them."""
        array = self.dataset[variable]
        others = [dim for dim in array.dims if dim not in self.dims]
        return array.sel({"sensor" if "sensor" in others else others[0]: sensor})

    def numbers(self, variable: str, sensor: str) -> Array:
        """The same as plain numbers."""
        return np.asarray(self.of_sensor(variable, sensor).values, dtype=np.float64)

    def counting(self, variable: str, sensor: str) -> Array:
        """The same of the variants that speak for all, NaN of others."""
        return np.where(self.with_values, self.numbers(variable, sensor), np.nan)

    def estimated_error(self, result: str) -> Array:
        """The estimated error of a reported number, in the sweep's shape; NaN where none is known."""
        if "estimated_error" not in self.dataset or result not in self.dataset["result"].values:
            return np.full(self.shape, np.nan)
        error = self.dataset["estimated_error"].sel(result=result).transpose(*self.dims)
        return np.asarray(error.values, dtype=np.float64)

    def each_within_tolerance(self, which: Mask) -> bool:
        """Whether all estimated errors of some variants are within what is asked of their results."""
        asked = zip(self.dataset["result"].values, self.dataset["tolerance"].values, strict=True)
        return all(not np.nanmax(self.estimated_error(str(name))[which], initial=0.0) > most for name, most in asked)

    def error_at(self, result: str, index: Index) -> float:
        """The same of one variant."""
        if "estimated_error" not in self.dataset or result not in self.dataset["result"].values:
            return np.nan
        place = dict(zip(self.dims, index, strict=True))
        return float(self.dataset["estimated_error"].sel(result=result).isel(place))

    def traced(self) -> list[Index]:
        """The variants whose values and histories are kept, in the order of their flat numbers."""
        traces = (
            *self.sensors,
            *(f"{name}_position" for name in self.study.carriage),
            "end_place",
            "tool_centre_point_error",
        )
        names = [name for name in traces if name in self.dataset]
        if not names:
            return []
        stored = self.dataset[names[0]]
        flat = stored["history"].values if "history" in stored.dims else range(self.size)
        kept = self.kept.values.ravel()
        return [self.index_of(int(number)) for number in flat if kept[int(number)]]

    def trace(self, sensor: str, index: Index) -> Trace:
        """The stored history of one variant."""
        stored = self.dataset[sensor]
        over = str(stored.dims[-1])
        elapsed = self.dataset.coords.get("elapsed")
        along = np.asarray(self.dataset[over].values, dtype=np.float64)
        times = None if elapsed is None else np.asarray(self.row(elapsed, index))
        return Trace(over, along, np.asarray(self.row(stored, index)), times)

    def row(self, stored: xr.DataArray, index: Index) -> Array:
        """One variant's row of an array over histories, or over the sweep, or over neither."""
        if "history" in stored.dims:
            flat = int(np.ravel_multi_index(index, self.shape)) if self.dims else 0
            return np.asarray(stored.sel(history=flat).values, dtype=np.float64)
        places = {dim: i for dim, i in zip(self.dims, index, strict=True) if dim in stored.dims}
        return np.asarray(stored.isel(places).values, dtype=np.float64)


def statuses(counts: Mapping[Status, int]) -> str:
    """Statuses other than ok in words, "" where there are none.

    >>> statuses({Status.OK: 5, Status.SEPARATED: 2, Status.DIVERGED: 1})
    '2 separated (values kept), 1 diverged (left out)'
    """
    others = [(status, count) for status, count in counts.items() if status != Status.OK]
    return ", ".join(
        f"{count} {label(status)} ({'values kept' if status.values_kept else 'left out'})" for status, count in others
    )
