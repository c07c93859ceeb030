"""Uniform beams by their numbers."""

from collections.abc import Sequence

from engine.bodies.beam.beam import Beam, Spring

NUMBERS = ("length", "area", "second_moment", "youngs_modulus", "density")
OF_SPRINGS = ("at", "stiffness", "rotational", "damping")


def uniform(
    *numbers: float, ends: tuple[str, str] = ("pinned", "pinned"), supports: Sequence[tuple[float, ...]] = ()
) -> Beam:
    """Length, area, second moment, Young's modulus and density; springs, if there are any, in place of the ends."""
    springs = tuple(Spring(**dict(zip(OF_SPRINGS, support, strict=False))) for support in supports)
    return Beam(kind="beam", supports=springs or "-".join(ends), **dict(zip(NUMBERS, numbers, strict=True)))


def unit(**how: object) -> Beam:
    """L = E I = rho A = 1."""
    return uniform(1.0, 1.0, 1.0, 1.0, 1.0, **how)  # type: ignore[arg-type]
