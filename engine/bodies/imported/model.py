"""An imported model as it stands: in SI units, held by its supports, judged, and factorised.

Which motions are rigid is judged twice: motions built from the coordinates that strain almost nothing, compared with
the diagonal of the stiffness, and among them those whose frequency is far below that of the first mode that bends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from engine.bodies.files.model import DIRECTIONS, FileModel
from engine.bodies.frame.assembly import cross_matrix
from engine.bodies.modal.flexibility import Flexibility, factorised, symmetric_lu
from engine.bodies.modal.modal_body import Array
from results_schema.arrays import Counts
from results_schema.errors import BadInput
from results_schema.lazy_imports import linalg, sparse

if TYPE_CHECKING:
    from engine.bodies.imported.imported import Imported

SMALL_STRAIN = 1e-6  # energy over that of the diagonal: motions that may be rigid ones
RIGID = 1e-7  # square of the frequency over that of the first elastic mode: motions that are
MASSLESS = 1e-12  # of the largest: a motion without mass
LOOSE = 1e-13  # pivot over the diagonal: a motion that nothing resists (a held beam of 10,000 elements has 1e-12)
_RANK = 1e-8
_NEGATIVE = 1e-9  # of the diagonal: added to the mass before its sign is judged


@dataclass(frozen=True, eq=False)
class HeldModel:
    """Matrices (n, n) on the free rows of a model.

    file: the model as read; free (n,): its rows; stiffness, mass: sparse, SI; motion (N, 6): unit translations and
    rotations (about the origin) of all its rows; all_stiffness, all_mass: of all its rows; flexibility: factorised
    stiffness; recovery (R, n): stress (Pa) of every row, None where there is none; pressure: the files' unit of stress
    in Pa, by which rows of strain are too large.
    """

    file: FileModel
    free: Any
    stiffness: Any
    mass: Any
    motion: Array
    all_stiffness: Any
    all_mass: Any
    flexibility: Flexibility
    recovery: Any = None
    pressure: float = 1.0

    @property
    def drag(self) -> Array:
        """(n, 3) inertia forces of a unit acceleration of everything along x, y, z, kg."""
        return np.asarray((self.all_mass @ self.motion[:, :3])[self.free])

    @property
    def inertia(self) -> Array:
        """(6, 6) mass matrix of the rigid motions: kg, kg m, kg m2."""
        return np.asarray(self.motion.T @ (self.all_mass @ self.motion))


def held_model(body: Imported) -> HeldModel:
    """The model of a body with its supports. Raises BadInput, with the key within the body as its place."""
    file = body.model
    stiffness, mass, recovery = _in_si(file, body.length_unit, body.force_unit)
    held = file.held | _held(body, file)
    free = np.flatnonzero(~held)
    if not len(free):
        raise BadInput("nothing is free to move", where="supports")
    inner, inertia = stiffness[free][:, free].tocsc(), mass[free][:, free].tocsc()
    _refuse_slack(file, free, inner)
    _refuse_negative_mass(inertia)
    motion = motions(file, body.length_unit)
    flexibility = _factorised(file, free, inner, inertia, motion[free])
    recovery = None if recovery is None else recovery[:, free]
    pressure = body.force_unit / body.length_unit**2
    return HeldModel(file, free, inner, inertia, motion, stiffness, mass, flexibility, recovery, pressure)


def motions(file: FileModel, unit: float) -> Array:
    """(N, 6) unit translations and rotations about the origin of every row; zero for modal coordinates."""
    found = np.zeros((file.size, 6))
    rows = np.flatnonzero(file.owner >= 0)
    owner, way = file.owner[rows], file.direction[rows]
    places = file.places[owner] * unit
    whole = np.zeros((len(rows), 6, 6))
    whole[:, range(6), range(6)] = 1.0
    whole[:, :3, 3:] = -cross_matrix(places)
    found[rows] = whole[np.arange(len(rows)), way]
    return found


def _in_si(file: FileModel, length: float, force: float) -> tuple[Any, Any, Any]:
    """Stiffness, mass and recovery in N and m: what the files measure in units of force and length (and seconds)."""
    moves = (file.owner >= 0) & (file.direction < 3)
    scale = sparse.diags_array(np.where(moves, 1.0 / length, 1.0))
    matrices = [force * length * (scale @ matrix @ scale).tocsc() for matrix in (file.stiffness, file.mass)]
    recovery = None if file.recovery is None else force / length**2 * (file.recovery @ scale).tocsc()
    return matrices[0], matrices[1], recovery


def _held(body: Imported, file: FileModel) -> Any:
    found = np.zeros(file.size, dtype=np.bool_)
    for group in body.supports:
        nodes = np.zeros(len(file.nodes) + 1, dtype=np.bool_)  # the last one: no node
        nodes[body.group(group)] = True
        ways = [DIRECTIONS.index(word) for word in body.holds(group)]
        found |= nodes[file.owner] & np.isin(file.direction, ways)
    return found


def _refuse_slack(file: FileModel, free: Counts, stiffness: Any) -> None:
    """Every free row has a stiffness."""
    slack = np.flatnonzero(stiffness.diagonal() == 0.0)
    if len(slack):
        name = file.name(int(free[slack[0]]))
        what = f"nothing holds {name}: it has no stiffness"
        more = f", and {len(slack) - 1} more" if len(slack) > 1 else ""
        remedy = f'supports = {{ all = ["{name.split(", ")[-1]}"] }}, or hold this node' if "node" in name else ""
        raise BadInput(what + more, where="supports", expected="stiffness or a support", remedy=remedy)


def _refuse_negative_mass(mass: Any) -> None:
    diagonal = mass.diagonal()
    rows = np.flatnonzero(diagonal > 0.0)
    scale = sparse.diags_array(1.0 / np.sqrt(diagonal[rows]))
    shifted = (scale @ mass[rows][:, rows] @ scale + _NEGATIVE * sparse.diags_array(np.ones(len(rows)))).tocsc()
    try:
        factor = symmetric_lu(shifted)
    except RuntimeError:
        return  # exactly singular: not negative
    if np.array_equal(factor.perm_r, factor.perm_c) and (factor.U.diagonal() < 0.0).any():
        count = int(np.count_nonzero(factor.U.diagonal() < 0.0))
        raise BadInput("the mass matrix is not positive", where="mass", received=f"{count} negative eigenvalue(s)")


def _factorised(file: FileModel, free: Counts, stiffness: Any, mass: Any, motion: Array) -> Flexibility:
    """The flexibility with the rigid-body modes that there are. Raises BadInput for other loose motions."""
    rigid = _unstrained(stiffness, motion)
    _refuse_massless(mass, rigid)
    found = _solvable(file, free, stiffness, mass, rigid)
    while rigid.shape[1]:
        omega, _ = found.modes(rigid.shape[1] + 1)
        first = min(omega[omega > 0.0] ** 2, default=np.inf)
        energy, inertia = rigid.T @ (stiffness @ rigid), rigid.T @ (mass @ rigid)
        squares, turn = linalg.eigh(0.5 * (energy + energy.T), 0.5 * (inertia + inertia.T))
        if squares[-1] < RIGID * first:
            return found
        rigid = rigid @ turn[:, :-1]
        found = _solvable(file, free, stiffness, mass, rigid)
    return found


def _unstrained(stiffness: Any, motion: Array) -> Array:
    """(n, r) motions that strain almost nothing, a basis."""
    diagonal = np.sqrt(stiffness.diagonal())[:, None]
    size = np.linalg.norm(diagonal * motion, axis=0)
    basis, values, _ = np.linalg.svd(diagonal * motion / np.where(size > 0.0, size, 1.0), full_matrices=False)
    basis = basis[:, values > _RANK * max(values.max(initial=0.0), 1e-300)] / diagonal
    energy = basis.T @ (stiffness @ basis)
    shares, turn = np.linalg.eigh(0.5 * (energy + energy.T))
    return np.asarray(basis @ turn[:, shares < SMALL_STRAIN])


def _refuse_massless(mass: Any, rigid: Array) -> None:
    if rigid.shape[1]:
        gram = rigid.T @ (mass @ rigid)
        weights = np.linalg.norm(rigid, axis=0) ** 2 * mass.diagonal().max()
        values = np.linalg.eigvalsh(gram / np.sqrt(np.outer(weights, weights)))
        if values[0] < MASSLESS * max(values[-1], 1e-300):
            what = "nothing holds the body in a motion that moves no mass"
            raise BadInput(what, where="supports", expected="supports against it")


def _solvable(file: FileModel, free: Counts, stiffness: Any, mass: Any, rigid: Array) -> Flexibility:
    """A factorisation without negative or vanishing pivots. Raises BadInput naming a node."""
    try:
        found = factorised(stiffness, mass, rigid)
    except RuntimeError:
        raise _loose("parts of the body move freely") from None
    factor = found.factor
    pivots = factor.U.diagonal()[factor.perm_c] / stiffness.diagonal()[found.kept]
    smallest = int(np.argmin(np.abs(pivots)))
    if abs(pivots[smallest]) < LOOSE:  # pivots after it are noise
        name = file.name(int(free[found.kept[smallest]]))
        raise _loose(f"nothing holds {name}: part of the body moves")
    if pivots.min() < 0.0:
        count, name = int(np.count_nonzero(pivots < 0.0)), file.name(int(free[found.kept[int(np.argmin(pivots))]]))
        what = f"the stiffness matrix is not positive: {count} negative eigenvalue(s), first seen at {name}"
        raise BadInput(what, where="stiffness")
    return found


def _loose(what: str) -> BadInput:
    return BadInput(
        f"{what} without strain, other than as one rigid body",
        where="supports",
        expected="supports or springs that hold every part",
        remedy="hold it; or are nodes in another unit than the matrices (length_unit), or freedoms exchanged?",
    )
