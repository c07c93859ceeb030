"""A plane frame of Euler-Bernoulli beams assembled by hand: dense, with a node wherever something stands."""

from itertools import pairwise

import numpy as np

from results_schema.arrays import Array


class PlaneFrame:
    """Beams of one section in the x-z plane, cut at places of interest; z upwards, three freedoms per node."""

    def __init__(self, axial: float, bending: float, mass: float = 0.0) -> None:
        self.axial, self.bending, self.mass = axial, bending, mass
        self.nodes: list[tuple[float, float]] = []
        self.elements: list[tuple[int, int]] = []
        self.held: set[int] = set()

    def node(self, x: float, z: float) -> int:
        """Number of the node there, a new one if need be."""
        for number, (a, b) in enumerate(self.nodes):
            if np.hypot(a - x, b - z) < 1e-9:
                return number
        self.nodes.append((x, z))
        return len(self.nodes) - 1

    def member(self, start: tuple[float, float], end: tuple[float, float], cuts: list[float]) -> None:
        """A straight beam, with nodes at metres from its start."""
        (a, b), (c, d) = start, end
        length = float(np.hypot(c - a, d - b))
        places = sorted({0.0, length, *(round(cut, 12) for cut in cuts)})
        line = [self.node(a + (c - a) * s / length, b + (d - b) * s / length) for s in places]
        self.elements += list(pairwise(line))

    def hold(self, x: float, z: float, *ways: int) -> None:
        self.held |= {3 * self.node(x, z) + way for way in ways}

    def matrices(self) -> tuple[Array, Array]:
        """Stiffness, and force of the weight of a unit gravity, on all freedoms (x, z, turn from x to z)."""
        size = 3 * len(self.nodes)
        stiffness, weight = np.zeros((size, size)), np.zeros(size)
        for one, other in self.elements:
            (a, b), (c, d) = self.nodes[one], self.nodes[other]
            length = np.hypot(c - a, d - b)
            cos, sin = (c - a) / length, (d - b) / length
            turn = np.kron(np.eye(2), np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]))
            local = np.zeros((6, 6))
            local[np.ix_([0, 3], [0, 3])] = self.axial / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
            bend = np.array(
                [[12.0, 6.0, -12.0, 6.0], [6.0, 4.0, -6.0, 2.0], [-12.0, -6.0, 12.0, -6.0], [6.0, 2.0, -6.0, 4.0]]
            )
            scale = np.array([1.0, length, 1.0, length])
            local[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = self.bending / length**3 * bend * np.outer(scale, scale)
            across = -self.mass * cos  # of weight per length, along the element's own z
            load = np.zeros(6)
            load[[0, 3]] = -0.5 * self.mass * sin * length
            load[[1, 2, 4, 5]] = across * length * np.array([0.5, length / 12.0, 0.5, -length / 12.0])
            at = np.r_[3 * one : 3 * one + 3, 3 * other : 3 * other + 3]
            stiffness[np.ix_(at, at)] += turn.T @ local @ turn
            weight[at] += turn.T @ load
        return stiffness, weight

    def moved(self, x: float, z: float, force: float, gravity: float = 0.0) -> Array:
        """(nodes, 3) displacements under a force downwards at a node, and own weight."""
        stiffness, weight = self.matrices()
        load = gravity * weight
        load[3 * self.node(x, z) + 1] -= force
        free = np.setdiff1d(np.arange(len(load)), list(self.held))
        found = np.zeros(len(load))
        found[free] = np.linalg.solve(stiffness[np.ix_(free, free)], load[free])
        return found.reshape(-1, 3)
