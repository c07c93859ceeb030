"""Nodes whose rows stand in directions of their own, turned into those of the coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.bodies.files.model import Array, FileModel
from results_schema.errors import BadInput


def turned(model: FileModel, turns: Array, where: str) -> FileModel:
    """The model in the directions of its coordinates.

    turns (P, 3, 3): directions of the rows of a node as rows. Raises BadInput where a turned node lacks some of its
    three displacements or rotations, or holds some of them only.
    """
    from scipy.sparse import eye_array

    turn = eye_array(model.size, format="lil")
    for node in np.flatnonzero(np.abs(turns - np.eye(3)).max(axis=(1, 2)) > 1e-12):
        for rows in model.rows_of(int(node)).reshape(2, 3):
            if (rows < 0).all():
                continue
            if (rows < 0).any() or model.held[rows].any() != model.held[rows].all():
                what = f"node {model.nodes[node]} has directions of its own, and only some of them are free"
                raise BadInput(what, where=where, expected="all three, or nodes in global directions")
            turn[np.ix_(rows, rows)] = turns[node]
    turn = turn.tocsc()
    recovery = None if model.recovery is None else model.recovery @ turn
    matrices = {"stiffness": turn.T @ model.stiffness @ turn, "mass": turn.T @ model.mass @ turn}
    return replace(model, **matrices, recovery=recovery)
