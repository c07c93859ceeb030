"""Rows of the ties along a segment, station by station: what makes `layout.Ties.rows` out of mode shapes."""

from engine.kernels.jit import kernel
from engine.kernels.layout import CLOSED, CURVE, FORCE, RATE


@kernel
def add_attachment(rows, tie, first, factor, shapes, motion):
    """Add a place where a tie holds a body to its rows p, A and B.

    rows (stations, modes, ties, 4);  first: number of the body's first mode;  factor: the force there over the tie's;
    shapes (derivatives, stations or 1, modes of the body): phi, and phi' and phi'' where motion asks for them;
    motion (4, stations, or 0 where nothing moves):  A = a phi + b phi',  B = c phi' + d phi''.
    """
    last = shapes.shape[1] - 1
    for s in range(rows.shape[0]):
        at = min(s, last)
        for k in range(shapes.shape[2]):
            rows[s, first + k, tie, FORCE] += factor * shapes[0, at, k]
    for s in range(motion.shape[1]):
        at = min(s, last)
        for k in range(shapes.shape[2]):
            rate, curve = motion[0, s] * shapes[0, at, k], 0.0
            if shapes.shape[0] > 1:
                rate += motion[1, s] * shapes[1, at, k]
                curve += motion[2, s] * shapes[1, at, k]
            if shapes.shape[0] > 2:
                curve += motion[3, s] * shapes[2, at, k]
            rows[s, first + k, tie, RATE] += factor * rate
            rows[s, first + k, tie, CURVE] += factor * curve


@kernel
def close_rows(rows, inertial, alone, first, beta, gamma, reaches):
    """w = P + gamma A + beta B, of which station 0 has P alone; P = p of the ties with inertia, else zero.

    inertial (ties);  alone (coordinates, ties): P of those from number first on;  reaches (modes, ties): set where a
    tie's rows of a mode are other than zero anywhere.
    """
    for s in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            for r in range(rows.shape[2]):
                p, rate, curve = rows[s, k, r, FORCE], rows[s, k, r, RATE], rows[s, k, r, CURVE]
                w = p if inertial[r] else 0.0
                if 0 <= k - first < alone.shape[0]:
                    w = alone[k - first, r]
                if s > 0:
                    w += gamma * rate + beta * curve
                rows[s, k, r, CLOSED] = w
                if p != 0.0 or rate != 0.0 or curve != 0.0:
                    reaches[k, r] = True
