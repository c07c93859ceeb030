"""The equations of several ties at one station: their sums over the modes, and the small dense system.

See ``march`` for the equations. Ties are taken in twos, so that a row of lanes that is read is used four times; where
their number is odd the last one is taken twice, and its second copy goes unread. Modes that two ties do not share are
left out. Pieces take arrays and not the whole of ``Ties``, whose references would be counted at every step.
"""

from typing import NamedTuple

import numpy as np

from engine.kernels.jit import piece
from engine.kernels.layout import CLOSED, CURVE, FORCE, RATE, BoolArray, IntArray
from engine.kernels.stepping.record import GRAVITY, RATE_2, TIE, C, D, U, V
from engine.kernels.vector import all_lanes, lanes_at, put_lanes

FORCES = np.uint64(TIE)  # a signed and an unsigned number would add up to a float

# what a tie has to itself in a block of lanes: as in layout.Lanes, and unity
GAINS, STIFFS, LOADS, UNITY = range(4)


class Twos(NamedTuple):
    """The reactive ties two by two, and which modes meet in them, by number.

    member (2 twos): the ties, a last one without another twice;  moves, springs (twos): whether one of the two does;
    shared (twos, twos, modes), shares (twos, twos): the modes that reach both a tie of the one and a tie of the other
    two, and how many there are;  pushing (modes, reactive), pushes (modes): the reactive ties of a mode, and how many.
    """

    member: IntArray
    moves: BoolArray
    springs: BoolArray
    shared: IntArray
    shares: IntArray
    pushing: IntArray
    pushes: IntArray


@piece
def note_members(member, moves, springs, ties):
    """Take the reactive ties two by two."""
    for i in range(member.shape[0]):
        r = ties.reactive[min(i, ties.reactive.shape[0] - 1)]
        member[i] = r
        moves[i // 2] = moves[i // 2] or ties.moves[r]
        springs[i // 2] = springs[i // 2] or ties.springs[r]


@piece
def note_shared(shared, shares, member, reaches):
    """List the modes that reach a tie of each of two twos."""
    for one in range(shares.shape[0]):
        for other in range(shares.shape[0]):
            for k in range(reaches.shape[0]):
                here = reaches[k, member[2 * one]] or reaches[k, member[2 * one + 1]]
                if here and (reaches[k, member[2 * other]] or reaches[k, member[2 * other + 1]]):
                    shared[one, other, shares[one, other]] = k
                    shares[one, other] += 1


@piece
def note_pushing(pushing, pushes, reactive, reaches):
    """List the reactive ties that reach a mode."""
    for k in range(reaches.shape[0]):
        for r in reactive:
            if reaches[k, r]:
                pushing[k, pushes[k]] = r
                pushes[k] += 1


@piece
def load_own(own, b, ties, lanes, block):
    """What all ties have to themselves in a block of lanes; and the forces of the dead loads, which stay."""
    for r in range(own.shape[0]):
        put_lanes(own, (r, GAINS), lanes_at(lanes.coupling_mass, (block, r)))
        put_lanes(own, (r, STIFFS), lanes_at(lanes.coupling_stiffness, (block, r)))
        put_lanes(own, (r, LOADS), lanes_at(lanes.load, (block, r)))
        put_lanes(own, (r, UNITY), all_lanes(ties.unity[r]))
    for s in ties.prescribed:
        put_lanes(b, (TIE + s,), lanes_at(lanes.load, (block, s)))


@piece
def load_dead(work, b, rows, prescribed, reaches, n):
    """Take what the dead loads give at station n from c* of the modes, so that it need not be told apart any more."""
    for i in range(prescribed.shape[0]):
        r = np.uint64(prescribed[i])
        force = lanes_at(b, (FORCES + r,))
        for k in range(work.shape[0]):
            if reaches[k, r]:
                part = rows[n, k, r, FORCE] * lanes_at(work, (k, D))
                put_lanes(work, (k, C), lanes_at(work, (k, C)) - part * force)


@piece
def two(twos, one):
    """Numbers of the two ties; without a sign, so that no index is taken from the end."""
    return np.uint64(twos.member[2 * one]), np.uint64(twos.member[2 * one + 1])


@piece
def push_ties(b, work, rows, own, twos, n, beta):
    """b[TIE] += m (w.c* - A.v* - B.u*) + k p.(beta c* - u*) of every reactive tie."""
    for one in range(twos.shares.shape[0]):
        i, j = two(twos, one)
        motion_i, motion_j, gap_i, gap_j = all_lanes(0.0), all_lanes(0.0), all_lanes(0.0), all_lanes(0.0)
        moved_i, moved_j = all_lanes(0.0), all_lanes(0.0)
        if twos.moves[one]:
            for m in range(twos.shares[one, one]):
                k = np.uint64(twos.shared[one, one, m])
                c, v, u = lanes_at(work, (k, C)), lanes_at(work, (k, V)), lanes_at(work, (k, U))
                motion_i, motion_j = motion_i + rows[n, k, i, CLOSED] * c, motion_j + rows[n, k, j, CLOSED] * c
                moved_i = moved_i + rows[n, k, i, RATE] * v + rows[n, k, i, CURVE] * u
                moved_j = moved_j + rows[n, k, j, RATE] * v + rows[n, k, j, CURVE] * u
            motion_i, motion_j = motion_i - moved_i, motion_j - moved_j
        if twos.springs[one]:
            for m in range(twos.shares[one, one]):
                k = np.uint64(twos.shared[one, one, m])
                back = beta * lanes_at(work, (k, C)) - lanes_at(work, (k, U))
                gap_i, gap_j = gap_i + rows[n, k, i, FORCE] * back, gap_j + rows[n, k, j, FORCE] * back
        # both are read before either is stored, for they may be one
        force_i = lanes_at(b, (FORCES + i,)) + lanes_at(own, (i, GAINS)) * motion_i + lanes_at(own, (i, STIFFS)) * gap_i
        force_j = lanes_at(b, (FORCES + j,)) + lanes_at(own, (j, GAINS)) * motion_j + lanes_at(own, (j, STIFFS)) * gap_j
        put_lanes(b, (FORCES + i,), force_i)
        put_lanes(b, (FORCES + j,), force_j)


@piece
def load_ties(b, own, reactive, drive, level):
    """b[TIE] = load - m drive - k level of every reactive tie; drive, level: those of the station."""
    gravity = lanes_at(b, (GRAVITY,))
    for r in reactive:
        track = lanes_at(own, (r, GAINS)) * (drive[r] * gravity) + lanes_at(own, (r, STIFFS)) * (level[r] * gravity)
        put_lanes(b, (TIE + r,), lanes_at(own, (r, LOADS)) - track)


@piece
def products(work, rows, twos, n, one, other, column):
    """The column of two ties times D p of two others, summed over the modes: four rows of lanes."""
    (i, j), (s, t) = two(twos, one), two(twos, other)
    i_s, i_t, j_s, j_t = all_lanes(0.0), all_lanes(0.0), all_lanes(0.0), all_lanes(0.0)
    for m in range(twos.shares[one, other]):
        k = np.uint64(twos.shared[one, other, m])
        d = lanes_at(work, (k, D))
        of_i, of_j = rows[n, k, i, column] * d, rows[n, k, j, column] * d
        ps, pt = rows[n, k, s, FORCE], rows[n, k, t, FORCE]
        i_s, i_t = i_s + ps * of_i, i_t + pt * of_i
        j_s, j_t = j_s + ps * of_j, j_t + pt * of_j
    return i_s, i_t, j_s, j_t


@piece
def add_lanes(matrix, i, s, row):
    """matrix[i, s] += a row of lanes."""
    put_lanes(matrix, (i, s), lanes_at(matrix, (i, s)) + row)


@piece
def couple_motions(matrix, work, rows, own, twos, n):
    """matrix = unity + m w.(D p) of the reactive ties."""
    for one in range(twos.shares.shape[0]):
        i, j = two(twos, one)
        gain_i, gain_j = lanes_at(own, (i, GAINS)), lanes_at(own, (j, GAINS))
        for other in range(twos.shares.shape[0]):
            i_s, i_t, j_s, j_t = all_lanes(0.0), all_lanes(0.0), all_lanes(0.0), all_lanes(0.0)
            if twos.moves[one]:
                i_s, i_t, j_s, j_t = products(work, rows, twos, n, one, other, CLOSED)
            put_lanes(matrix, (2 * one, 2 * other), gain_i * i_s)
            put_lanes(matrix, (2 * one, 2 * other + 1), gain_i * i_t)
            put_lanes(matrix, (2 * one + 1, 2 * other), gain_j * j_s)
            put_lanes(matrix, (2 * one + 1, 2 * other + 1), gain_j * j_t)
        add_lanes(matrix, 2 * one, 2 * one, lanes_at(own, (i, UNITY)))
        add_lanes(matrix, 2 * one + 1, 2 * one + 1, lanes_at(own, (j, UNITY)))


@piece
def couple_gaps(matrix, work, rows, own, twos, n, beta):
    """matrix += k beta p.(D p) of the reactive ties; the product is symmetric, so half of them do."""
    for one in range(twos.shares.shape[0]):
        i, j = two(twos, one)
        stiff_i, stiff_j = beta * lanes_at(own, (i, STIFFS)), beta * lanes_at(own, (j, STIFFS))
        for other in range(one + 1):
            if twos.springs[one] or twos.springs[other]:
                i_s, i_t, j_s, j_t = products(work, rows, twos, n, one, other, FORCE)
                add_lanes(matrix, 2 * one, 2 * other, stiff_i * i_s)
                add_lanes(matrix, 2 * one, 2 * other + 1, stiff_i * i_t)
                add_lanes(matrix, 2 * one + 1, 2 * other, stiff_j * j_s)
                add_lanes(matrix, 2 * one + 1, 2 * other + 1, stiff_j * j_t)
                if other < one:
                    s, t = two(twos, other)
                    stiff_s, stiff_t = beta * lanes_at(own, (s, STIFFS)), beta * lanes_at(own, (t, STIFFS))
                    add_lanes(matrix, 2 * other, 2 * one, stiff_s * i_s)
                    add_lanes(matrix, 2 * other, 2 * one + 1, stiff_s * j_s)
                    add_lanes(matrix, 2 * other + 1, 2 * one, stiff_t * i_t)
                    add_lanes(matrix, 2 * other + 1, 2 * one + 1, stiff_t * j_t)


@piece
def miss(matrix, b, ties, own, n):
    """Add what the kept modes miss of the gaps: k residual/h^2, of the dead loads on the right-hand side."""
    rate = lanes_at(b, (RATE_2,))
    for i in range(ties.reactive.shape[0]):
        r = ties.reactive[i]
        if ties.springs[r]:
            coupling_stiffness = lanes_at(own, (r, STIFFS)) * rate
            for t in range(ties.reactive.shape[0]):
                add_lanes(matrix, i, t, ties.residual[n, r, ties.reactive[t]] * coupling_stiffness)
            for s in ties.prescribed:
                dead = ties.residual[n, r, s] * (coupling_stiffness * lanes_at(b, (TIE + s,)))
                put_lanes(b, (TIE + r,), lanes_at(b, (TIE + r,)) - dead)


@piece
def solve_ties(b, matrix, reactive):
    """Solve for the forces, in b from TIE on; the matrix is used up.

    Without pivoting: the matrix is unity on the diagonal, or zero for rigid ties, plus a product that is positive
    wherever the march is stable. Its lower and upper part take its place, the diagonal inverted.
    """
    count = reactive.shape[0]
    for i in range(count):
        for t in range(count):
            x = lanes_at(matrix, (i, t))
            for m in range(min(i, t)):
                x = x - lanes_at(matrix, (i, m)) * lanes_at(matrix, (m, t))
            if t < i:
                x = x * lanes_at(matrix, (t, t))
            if t == i:
                x = 1.0 / x
            put_lanes(matrix, (i, t), x)
        x = lanes_at(b, (TIE + reactive[i],))
        for m in range(i):
            x = x - lanes_at(matrix, (i, m)) * lanes_at(b, (TIE + reactive[m],))
        put_lanes(b, (TIE + reactive[i],), x)
    for i in range(count - 1, -1, -1):
        x = lanes_at(b, (TIE + reactive[i],))
        for m in range(i + 1, count):
            x = x - lanes_at(matrix, (i, m)) * lanes_at(b, (TIE + reactive[m],))
        put_lanes(b, (TIE + reactive[i],), x * lanes_at(matrix, (i, i)))


@piece
def pushed(b, rows, twos, n, k):
    """Sum over the reactive ties of p F of mode k at station n."""
    push = all_lanes(0.0)
    for i in range(twos.pushes[k]):
        r = np.uint64(twos.pushing[k, i])
        push = push + rows[n, k, r, FORCE] * lanes_at(b, (FORCES + r,))
    return push
