"""Second sources for a beam on springs, L = E I = rho A = 1, that share no code with the engine.

`WaveBeam`: the exact solution, four waves between neighbouring springs. `hermite_model`: dense cubic elements.
"""

from dataclasses import dataclass

import numpy as np

from results_schema.arrays import Array

Support = tuple[float, float, float]  # place, stiffness, rotational stiffness


def wave_row(b: float, left: float, right: float, x: float, j: int) -> Array:
    """j-th derivative over b^j of exp(-b(x-left)), exp(-b(right-x)), cos b(x-left), sin b(x-left)."""
    turn = b * (x - left) + 0.5 * np.pi * j
    return np.array([(-1.0) ** j * np.exp(-b * (x - left)), np.exp(-b * (right - x)), np.cos(turn), np.sin(turn)])


@dataclass(frozen=True)
class WaveBeam:
    """A beam, free at its ends, on springs."""

    supports: tuple[Support, ...]

    @property
    def nodes(self) -> Array:
        """Ends and springs."""
        return np.unique([0.0, 1.0, *(at for at, _, _ in self.supports)])

    def matrix(self, b: float) -> Array:
        """Conditions at all nodes on the waves of all spans for omega = b^2, rows of size one."""
        nodes = self.nodes
        spans = len(nodes) - 1
        rows = []
        for i, x in enumerate(nodes):
            k = sum(one[1] for one in self.supports if one[0] == x)
            k_r = sum(one[2] for one in self.supports if one[0] == x)
            jump = np.zeros((4, 4 * spans))
            here = np.zeros((2, 4 * spans))
            for span, sign in ((i - 1, -1.0), (i, 1.0)):
                if 0 <= span < spans:
                    part = slice(4 * span, 4 * span + 4)
                    for j in range(4):
                        jump[j, part] += sign * wave_row(b, nodes[span], nodes[span + 1], x, j)
            beside = min(i, spans - 1)
            part = slice(4 * beside, 4 * beside + 4)
            here[:, part] = [wave_row(b, nodes[beside], nodes[beside + 1], x, j) for j in range(2)]
            rows += [jump[0], jump[1]] if 0 < i < spans else []
            rows += [b**3 * jump[3] + k * here[0], b * jump[2] - k_r * here[1]]
        found = np.array(rows)
        scaled: Array = found / np.abs(found).max(axis=1)[:, None]
        return scaled

    def sign(self, b: float) -> float:
        """Sign of the determinant: it changes where b^2 is a simple frequency."""
        return float(np.linalg.slogdet(self.matrix(b))[0])

    def shape(self, b: float, x: Array, j: int) -> Array:
        """j-th derivative over b^j of the mode of frequency b^2, any scale (fixed for all j)."""
        waves = np.linalg.svd(self.matrix(b))[2][-1]
        nodes = self.nodes
        span = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 2)
        rows = [wave_row(b, nodes[e], nodes[e + 1], place, j) for e, place in zip(span, x, strict=True)]
        return np.array([row @ waves[4 * e : 4 * e + 4] for e, row in zip(span, rows, strict=True)])


def hermite_model(supports: tuple[Support, ...], elements: int) -> tuple[Array, Array]:
    """Stiffness and consistent mass of cubic elements of equal length; springs must sit on nodes."""
    h = 1.0 / elements
    stiffness = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], dtype=float)
    mass = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]], dtype=float)
    scale = np.array([1.0, h, 1.0, h])
    size = 2 * elements + 2
    whole_stiffness, whole_mass = np.zeros((size, size)), np.zeros((size, size))
    for e in range(elements):
        part = slice(2 * e, 2 * e + 4)
        whole_stiffness[part, part] += stiffness * np.outer(scale, scale) / h**3
        whole_mass[part, part] += mass * np.outer(scale, scale) * h / 420.0
    for at, k, k_r in supports:
        node = round(at * elements)
        assert abs(node * h - at) < 1e-12, "a spring between nodes"
        whole_stiffness[2 * node, 2 * node] += k
        whole_stiffness[2 * node + 1, 2 * node + 1] += k_r
    return whole_stiffness, whole_mass
