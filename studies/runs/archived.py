"""What an archive says of its study, read without any other file, and compared with what it holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.modal.description import Recorded
from engine.scene.study import Study
from results_schema.errors import ArchiveError, BadInput
from results_schema.lazy_imports import xr
from results_schema.store.archive import Archive
from results_schema.validate import group_findings, root_findings
from results_schema.variables import declarations
from studies.findings.numerics_used import is_marched
from studies.findings.theory import first_omega
from studies.protocol.study import Kind, kind_named
from studies.results.formatting import listed
from studies.results.results import Results

if TYPE_CHECKING:
    from engine.scene.sweep import Axis

MODELS = "/model/"
SAME = 1e-9  # relative difference of an axis's values from those of the study: other machines round otherwise
SHOWN = 5  # findings in a message


def results_of(archive: Archive) -> Results:
    """The results of an archive with their study.

    Raises ArchiveError where what the archive says of its study is no study, or is not what it holds.
    """
    models = {path.removeprefix(MODELS): group for path, group in archive.groups.items() if path.startswith(MODELS)}
    try:
        study = _study(archive.root, models)
        found = list(findings(archive, study))
    except BadInput as error:
        from studies.runs.identity import PIECES, missing_pieces

        if gone := missing_pieces(str(archive.root.attrs.get(PIECES, ""))):
            what, remedy = f"this archive needs {listed(gone)}", "install what is not there"
            raise ArchiveError(what, where=str(archive.path), remedy=remedy) from error
        raise _refused(archive.path, str(error)) from error
    if found:
        more = f"; and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        raise _refused(archive.path, "; ".join(found[:SHOWN]) + more)
    return Results(archive.root, study, models)


def _refused(path: Path, text: str) -> ArchiveError:
    what = f"what this archive says of its study is not what it holds: {text}"
    return ArchiveError(what, where=str(path), remedy="run the study again with --overwrite")


def with_first_frequency(groups: Mapping[str, xr.Dataset], results: Results) -> dict[str, xr.Dataset]:
    """The groups of bodies; that of a body out of files, under the first carriage, with its lowest elastic frequency
    over the axes that change it, which nobody could tell later without the files."""
    name = results.carriage.on
    path, body = f"{MODELS}{name}", results.study.body[name]
    if not body.names_files:
        return dict(groups)
    (declared,) = (variable for variable in declarations(MODELS) if variable.name == "first_frequency")
    omega = xr.DataArray(first_omega(results))
    added = {declared.name: (omega.dims, omega.values / (2.0 * np.pi), declared.attributes())}
    return {**groups, path: groups[path].assign(added)}


def _study(root: xr.Dataset, models: Mapping[str, xr.Dataset]) -> Study:
    """The study of an archive, from its text alone. Raises BadInput."""
    from engine.scene.study import load_recorded

    recorded = {name: found for name, group in models.items() if (found := _recorded(group)) is not None}
    return load_recorded(str(root.attrs["study"]), recorded)


def _recorded(group: xr.Dataset) -> Recorded | None:
    from engine.bodies.modal.description import Recorded

    length = float(group["length"]) if "length" in group and group["length"].size == 1 else np.nan
    return Recorded(length) if np.isfinite(length) and length > 0.0 else None


def findings(archive: Archive, study: Study) -> Iterator[str]:
    """Every difference between what an archive says of its study and what is there, the most telling first."""
    root = archive.root
    if root.attrs.get("study_kind") != study.kind:
        yield f"study_kind: expected {study.kind!r}, received {root.attrs.get('study_kind')!r}"
        return
    kind = kind_named(study.kind)
    used = {name for carriage in study.carriage.values() for name in carriage.bodies}
    bodies = {name: body.recorded for name, body in study.body.items() if name in used and body.recorded is not None}
    missing = [name for name, recorded in bodies.items() if np.isnan(recorded.length)]
    if missing:
        yield from (f"{MODELS}{name}: expected what this body out of files is, received nothing" for name in missing)
        return
    yield from _asked_findings(root, study, kind)
    yield from _axis_findings(root, study)
    yield from _label_findings(root, study)
    yield from root_findings(root, study.kind, study.results(study.results_kind))
    variants = _variants(root)
    for path, group in archive.groups.items():
        yield from (f"{path}: {text}" for text in group_findings(group, path, variants))
    yield from _model_findings(root, study, {p: g for p, g in archive.groups.items() if p.startswith(MODELS)})


def _model_findings(root: xr.Dataset, study: Study, groups: Mapping[str, xr.Dataset]) -> Iterator[str]:
    """The bodies: they are the study's, and those out of files have all that theory asks of them."""
    for path in groups:
        if path.removeprefix(MODELS) not in study.body:
            yield f"{path}: expected a body of the study"
    if not is_marched(root) or not study.carriage:
        return
    name = next(iter(study.carriage.values())).on
    if study.body[name].recorded is None:
        return
    group = groups[f"{MODELS}{name}"]
    for needed in ("first_frequency", "mode_shape"):
        if needed not in group:
            yield f"{MODELS}{name}: expected {needed} of a body out of files, received nothing"
    sizes = dict(group["first_frequency"].sizes) if "first_frequency" in group else {}
    if any(root.sizes.get(dim) != size for dim, size in sizes.items()):
        yield f"{MODELS}{name}: expected first_frequency over axes of the sweep, received {sizes}"


def _axis_findings(root: xr.Dataset, study: Study) -> Iterator[str]:
    """The axes of the sweep against the coordinates."""
    from engine.scene.sweep import VARIANT, cells_of, expand

    if not study.sweep.axes:
        return
    if not study.output.keeps_variants:
        cells = cells_of(study, expand(study))
        if dict(root["status"].sizes) != dict(zip(cells.dims, cells.shape, strict=True)):
            yield f"status: expected the cells {dict(zip(cells.dims, cells.shape, strict=True))} of the study"
            return
        yield from _differing(root, cells.axes)
        return
    joint = study.sweep.joint
    sizes = {VARIANT if name in joint else name: axis.size for name, axis in study.sweep.axes.items()}
    # Before the axes are spread out: a text can ask for thousands of millions of variants.
    if list(root["status"].sizes.items()) != list(sizes.items()):
        yield f"status: expected the axes {sizes} of the study, received {dict(root['status'].sizes)}"
        return
    yield from _differing(root, expand(study).axes)


def _variants(root: xr.Dataset) -> int:
    """How many variants there are, of whatever statuses."""
    counts = root.get("status_count")
    return int(root["status"].size if counts is None or counts.dtype.kind != "i" else counts.sum())


def _differing(root: xr.Dataset, axes: Sequence[Axis]) -> Iterator[str]:
    """The values of axes against the coordinates."""
    for axis in axes:
        found = root.coords.get(axis.name)
        if found is None or found.dims != (axis.dim,) or found.dtype.kind not in "if":
            yield f"{axis.name}: expected the numbers of this axis along {axis.dim}"
        elif not np.allclose(found.values, axis.values, rtol=SAME, atol=0.0):
            yield f"{axis.name}: expected the values of the study's axis, received others"
        elif found.attrs.get("units") != (axis.units or "1"):
            yield f"{axis.name}: expected the unit {axis.units or '1'!r}, received {found.attrs.get('units')!r}"


def _asked_findings(root: xr.Dataset, study: Study, kind: Kind) -> Iterator[str]:
    """The coordinates of a study against what it asks for."""
    for name, wanted in kind.coordinates(study).items():
        found = root.coords.get(name)
        if found is not None and (found.shape != wanted.shape or not np.allclose(found.values, wanted, SAME, SAME)):
            yield f"{name}: expected what the study asks for, received others"
    bodies = root["on_body"].values.tolist() if "on_body" in root.coords else list(study.body)
    if not set(bodies) <= set(study.body):
        yield f"on_body: expected the bodies {list(study.body)}, received {bodies}"


def _label_findings(root: xr.Dataset, study: Study) -> Iterator[str]:
    """Names of sensors and their units."""
    for name, wanted in (("sensor", list(study.sensor)), ("sensor_unit", list(study.sensor_units.values()))):
        if name in root.coords and root[name].values.tolist() != wanted:
            yield f"{name}: expected {wanted}, received {root[name].values.tolist()}"
