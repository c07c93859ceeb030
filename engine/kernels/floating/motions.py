"""Motions that are given in time: pieces of polynomials and sines."""

from engine.kernels.floating.layout import PIECE
from engine.kernels.jit import called
from engine.kernels.layout import LANES
from engine.kernels.sines import PI, sin_cos
from engine.kernels.vector import choose, everywhere, lanes_at, put_lanes


@called
def motions_at(pieces, t, within, piece, out):
    """Value, rate and acceleration (M, 3, LANES) of motions (M, pieces, PIECE, LANES) at the lanes' times, by the
    pieces that hold at ``within``, which lies on that side of the time from which a limit is wanted; piece (PIECE + 1,
    LANES): room."""
    put_lanes(piece, (PIECE,), within)
    for m in range(pieces.shape[0]):
        for j in range(LANES):
            number = piece_at(pieces, m, j, piece[PIECE, j])
            for k in range(PIECE):
                piece[k, j] = pieces[m, number, k, j]
        x = t - lanes_at(piece, (0,))
        x = choose(x > 0.0, x, 0.0)
        c1, c2, c3 = lanes_at(piece, (1,)), lanes_at(piece, (2,)), lanes_at(piece, (3,))
        c4, c5, c6 = lanes_at(piece, (4,)), lanes_at(piece, (5,)), lanes_at(piece, (6,))
        value = c1 + x * (c2 + x * (c3 + x * (c4 + x * (c5 + x * c6))))
        speed = c2 + x * (2.0 * c3 + x * (3.0 * c4 + x * (4.0 * c5 + x * (5.0 * c6))))
        change = 2.0 * c3 + x * (6.0 * c4 + x * (12.0 * c5 + x * (20.0 * c6)))
        amplitude, rate = lanes_at(piece, (7,)), lanes_at(piece, (8,))
        if not everywhere(amplitude * amplitude <= 0.0):
            sine, cosine = sin_cos((rate * x + lanes_at(piece, (9,))) / PI)
            value = value + amplitude * sine
            speed = speed + rate * (amplitude * cosine)
            change = change - rate * rate * (amplitude * sine)
        put_lanes(out, (m, 0), value)
        put_lanes(out, (m, 1), speed)
        put_lanes(out, (m, 2), change)


@called
def copy(one, other):
    """Motions (M, 3, LANES) into others."""
    for m in range(one.shape[0]):
        for k in range(3):
            put_lanes(other, (m, k), lanes_at(one, (m, k)))


@called
def piece_at(pieces, m, j, time):
    """The last piece of a lane's motion that begins before a time, or the first."""
    first, last = 0, pieces.shape[1]
    while last - first > 1:
        middle = (first + last) // 2
        if pieces[m, middle, 0, j] <= time:
            first = middle
        else:
            last = middle
    return first
