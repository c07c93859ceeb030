"""Functions along a line of elements that are cubics of the place in each, or of two places in each pair of elements.

Places in an element go from -1 to 1; coefficients are those of their powers 0 to 3.
"""

from engine.kernels.jit import kernel, piece


@piece
def _element_at(places, s, near):
    """The element at s, from the right at a joint, looked for from one that may be near."""
    while near > 0 and s < places[near]:
        near -= 1
    while near < places.size - 2 and s >= places[near + 1]:
        near += 1
    return near


@piece
def _place_in(places, element, s):
    """The place of s in an element, from -1 to 1."""
    return min(max(2.0 * (s - places[element]) / (places[element + 1] - places[element]) - 1.0, -1.0), 1.0)


@piece
def _cubic(of, z):
    """The sum of coefficients (4,) times powers."""
    return of[0] + z * (of[1] + z * (of[2] + z * of[3]))


@kernel
def cubics_at(places, cubics, s, found):
    """The cubics (E, 4) of elements between places (E + 1,) at s (S,), into found (S,)."""
    element = 0
    for i in range(s.size):
        element = _element_at(places, s[i], element)
        found[i] = _cubic(cubics[element], _place_in(places, element, s[i]))


@kernel
def cubics_of_pairs(places, apart, beyond, x, s, found):
    """Cubics of two places at pairs of x and s (S,), into found (S,).

    apart (E, E, 4, 4): of x on the first and s on the second element, and on the same one of x before s;  beyond (E, 4,
    4): of x on the same one beyond s, which it is too where both are one place, but for the end of the line.
    """
    here, there = 0, 0
    end = places[places.size - 1] * (1.0 - 1e-12)
    for i in range(x.size):
        here, there = _element_at(places, x[i], here), _element_at(places, s[i], there)
        left, right = _place_in(places, here, x[i]), _place_in(places, there, s[i])
        after = here == there and (x[i] > s[i] or (x[i] == s[i] and x[i] < end))
        block = beyond[here] if after else apart[here, there]
        total = 0.0
        for k in range(3, -1, -1):
            total = total * left + _cubic(block[k], right)
        found[i] = total
