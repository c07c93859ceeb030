"""Bodies of plain files of matrices, of ANSYS and of Nastran as the user describes them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field, model_validator

from engine.bodies.files.ansys_results import COMPONENTS
from engine.bodies.files.reader import Request
from engine.bodies.frame.refusals import refuse
from engine.bodies.imported.imported import FilePath, Imported, RowsOfNodes, TrackRows
from engine.study_file.spec import one_of


class Recovering(Imported):
    """Base of bodies that may have a recovery matrix: stresses and strains by the model's displacements (and modal
    coordinates).

    stress_rows, strain_rows: for each node of the track, in order, the rows (from 1) whose mean is its stress or its
    strain, one per element that meets there; linear in between.
    """

    recovery: FilePath | None = None
    stress_rows: TrackRows | None = None
    strain_rows: TrackRows | None = None

    @property
    def recovered(self) -> Mapping[str, RowsOfNodes]:
        rows = {"stress": self.stress_rows, "strain": self.strain_rows}
        return {quantity: own for quantity, own in rows.items() if own is not None}

    @model_validator(mode="after")
    def _rows(self) -> Recovering:
        if (self.recovery is None) != (not self.recovered):
            key = "recovery" if self.recovery is None else "stress_rows"
            refuse((key,), "this key is missing", expected="recovery with stress_rows or strain_rows, or none of them")
        for quantity, rows in self.recovered.items():
            if self.recorded is None:
                self._check_rows(f"{quantity}_rows", rows)
        return self

    def _check_rows(self, key: str, nodes: RowsOfNodes) -> None:
        """As many lists as the track has nodes, of rows that there are."""
        count, most = len(self.line.nodes), int(self.model.recovery.shape[0])
        if len(nodes) != count:
            expected, received = f"{count} lists, one per node of the track", str(len(nodes))
            refuse((key,), "not one list per node", expected=expected, received=received)
        for node, rows in enumerate(nodes):
            if max(rows) > most:
                expected = f"1 to {most}"
                refuse((key, node), "there is no such row", expected=expected, received=str(max(rows)))


class Matrices(Recovering):
    """A body of plain files. stiffness, mass: Matrix Market or scipy's sparse NPZ; nodes: CSV of node, x, y, z.

    freedoms: CSV of node, direction for every row of the matrices (x, y, z, rx, ry, rz, or `modal`); otherwise six or
    three per node in the order of the nodes. What a node lacks counts as held. recovery: a file as those of matrices.
    """

    roles: ClassVar[tuple[str, ...]] = ("stiffness", "mass", "nodes", "freedoms", "recovery")
    lacking = "held"

    kind: Literal["matrices"]
    stiffness: FilePath
    mass: FilePath
    nodes: FilePath
    freedoms: FilePath | None = None

    @property
    def request(self) -> Request:
        return Request("matrices", tuple(self.files.items()))


class Ansys(Imported):
    """A body of ANSYS. full: the `.full` file with stiffness and mass; nodes: a `.cdb` or `.rst` file.

    results: the `.rst` file of a modal analysis of the same model with element results; component: of its stresses and
    strains, which sensors read.
    """

    roles: ClassVar[tuple[str, ...]] = ("full", "nodes", "results")

    kind: Literal["ansys"]
    full: FilePath
    nodes: FilePath
    results: FilePath | None = None
    component: Annotated[str, AfterValidator(one_of(*COMPONENTS))] | None = None

    @property
    def request(self) -> Request:
        files = tuple(self.files.items())
        if self.results is None or self.component is None:
            return Request("ansys", files)
        return Request("ansys", files, (("component", self.component), ("track", json.dumps(self.told_track))))

    @property
    def recovered(self) -> Mapping[str, RowsOfNodes]:
        if self.results is None:
            return {}
        count = len(self.line.nodes) if self.recorded is None else 0
        return {word: tuple((q * count + t + 1,) for t in range(count)) for q, word in enumerate(("stress", "strain"))}

    @model_validator(mode="after")
    def _component_of_results(self) -> Ansys:
        if (self.results is None) != (self.component is None):
            key = "results" if self.results is None else "component"
            refuse((key,), "this key is missing", expected="results and component together, or none of them")
        return self


class Nastran(Recovering):
    """A body of Nastran. matrices: `.op4`, `.op2`, or punched DMIG; nodes: bulk data, `.asm` or `.op2`.

    stiffness, mass: names of the matrices (kaa and maa, or kxx and mxx, unless given). superelement: of an `.op2` file.
    recovery: the name of another matrix, such as mes1. A node that the matrices lack counts as held.
    """

    roles: ClassVar[tuple[str, ...]] = ("matrices", "nodes")
    lacking = "whole nodes held"

    kind: Literal["nastran"]
    matrices: FilePath
    nodes: FilePath
    stiffness: str = Field(default="", max_length=64)
    mass: str = Field(default="", max_length=64)
    superelement: int = Field(default=0, ge=0)

    @property
    def request(self) -> Request:
        names = (("stiffness", self.stiffness), ("mass", self.mass), ("recovery", self.recovery or ""))
        return Request("nastran", tuple(self.files.items()), (*names, ("superelement", self.superelement)))
