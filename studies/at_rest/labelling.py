"""The pieces of a study at rest put together: dimensions, coordinates and declarations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from engine.model.distinct_models import base_scene
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from results_schema.variables import axes
from studies.at_rest.errors import PART
from studies.at_rest.positions import Asked, Positions, positions_of
from studies.protocol.parts import usual
from studies.protocol.study import question_of

if TYPE_CHECKING:
    from engine.scene.study import Study
    from studies.at_rest.at_rest import AtRestKind

BODY_PLACES = 101  # along every body, of its shapes

COORDINATES = outputs("""
    * | | | axis |
    on_body | | | str | body
    body_place | | | | place along the body
        over the length of its track
    checked_position | | m | | checked position
        at which numbers of modes are compared
    unreduced_position | | m | | compared position
        at which the unreduced model is computed
    correction | | | int8 | static correction
        1 with, 0 without
""")


def asked_coordinates(places: Positions, asked: Asked) -> dict[str, NDArray[Any]]:
    """The coordinates that follow from what is asked."""
    return {
        "position": places.all,
        "checked_position": places.all[places.checked],
        "unreduced_position": places.all[places.unreduced],
        "mode_count": np.array(asked.mode_counts, dtype=np.int64),
        "correction": np.array([1, 0]),
    }


class Gathering:
    """The pieces of one study with what their dimensions mean."""

    def __init__(self, kind: AtRestKind, pieces: Mapping[str, xr.Dataset], study: Study) -> None:
        from engine.scene.sweep import expand

        self.pieces, self.asked = pieces, question_of(study, kind.settings)
        self.model, self.cases, self.places = base_scene(study), expand(study), positions_of(study, self.asked)
        self.inner = kind.inner(self.model)
        self.declared = study.results(kind.name)

    def dataset(self) -> xr.Dataset:
        """Everything, labelled."""
        from engine.batch.dataset import coordinates

        variables = {**self._grid(), **self._shapes(), **self._mode_counts(), **self._unreduced()}
        found = xr.Dataset(variables, coords=coordinates(self.cases))
        return found.assign_coords({name: found_one for name, found_one in self._coordinates() if name in found.dims})

    def _coordinates(self) -> list[tuple[str, Any]]:
        known = {**axes(), **self.declared}
        values: dict[str, NDArray[Any]] = {
            **asked_coordinates(self.places, self.asked),
            "on_body": np.array([part.name for part in self.model.bodies]),
            "body_place": np.linspace(0.0, 1.0, BODY_PLACES),
            **dict(self.inner.values()),
        }
        return [(name, known[name].holding(array, (name,))) for name, array in values.items()]

    def _dims(self, name: str) -> tuple[str, ...]:
        """Dimensions of a result beyond variant and position."""
        return (self.inner[name][0],) if name in self.inner else ()

    def _grid(self) -> dict[str, Any]:
        """Results on the sweep's grid."""
        parts = [piece for name, piece in self.pieces.items() if name.startswith("variants-")]
        numbers = np.concatenate([part["number"].values for part in parts])
        order, shape = np.argsort(numbers), self.cases.shape
        whole = {
            str(name): np.concatenate([part[name].values for part in parts])[order]
            for name in parts[0].data_vars
            if name != "number"
        }
        own = {name: whole.pop(name).reshape(shape) for name in ("status", "fidelity", "modes")}
        found = dict(usual(self.cases.dims, **own, steps=np.zeros(shape)))
        errors = {name: whole.pop(name) for name in list(whole) if name.startswith(PART)}
        for name, array in whole.items():
            dims = (*self.cases.dims, "position", *self._dims(name))
            found[name] = self.declared[name].holding(array.reshape(*shape, *array.shape[1:]), dims)
        return found | self._errors(errors)

    def _errors(self, parts: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
        """Estimated errors of all reported numbers, which are held to no tolerance."""
        names, columns = list[str](), []
        for name, array in ((name.removeprefix(PART), array) for name, array in parts.items()):
            names += [f"{name} {label}" for label in self.inner[name][1]] if name in self.inner else [name]
            columns.append(array.reshape(*self.cases.shape, -1))
        none = np.full(len(names), np.nan)
        return {
            "result": axes()["result"].holding(np.array(names), ("result",)),
            "estimated_error": self.declared["estimated_error"].holding(
                np.concatenate(columns, axis=-1), (*self.cases.dims, "result")
            ),
            "tolerance": self.declared["tolerance"].holding(none, ("result",)),
        }

    def _shapes(self) -> dict[str, Any]:
        """Shapes along the bodies, and what belongs to them."""
        found = {}
        for name, array in self.pieces["shapes"].data_vars.items():
            along = ("on_body", "position", *self._dims(str(name)), "body_place")
            dims = along if array.ndim == len(along) else ("position", *self._dims(str(name)))
            found[str(name)] = self.declared[str(name)].holding(array.values, dims)
        return found

    def _mode_counts(self) -> dict[str, Any]:
        """Results over the number of modes."""
        if not self.asked.mode_counts:
            return {}
        parts = [self.pieces[f"modes-{count}"] for count in self.asked.mode_counts]
        found = {}
        for name in map(str, parts[0].data_vars):
            variable = self.declared.get(f"{name}_by_mode_count")
            if variable is not None:
                array = np.stack([part[name].values for part in parts], axis=1)
                dims = ("correction", "mode_count", "checked_position", *self._dims(name))
                found[variable.name] = variable.holding(array, dims)
        return found

    def _unreduced(self) -> dict[str, Any]:
        """Results of the unreduced model, and the relative differences of the modes' results from them."""
        if "unreduced" not in self.pieces:
            return {}
        piece, found = self.pieces["unreduced"], {}
        for name in map(str, piece.data_vars):
            if name.endswith("_reduced"):
                continue
            dims = ("unreduced_position", *self._dims(name))
            full, reduced = piece[name].values, piece[f"{name}_reduced"].values
            found[f"{name}_unreduced"] = self.declared[f"{name}_unreduced"].holding(full, dims)
            # every frequency by itself; readings change their sign on the way
            size = np.abs(full) if name == "frequency" else np.full_like(full, np.nanmax(np.abs(full), initial=0.0))
            part = np.divide(reduced - full, size, out=np.zeros_like(full), where=size > 0.0)
            found[f"{name}_difference"] = self.declared[f"{name}_difference"].holding(part, dims)
        return found
