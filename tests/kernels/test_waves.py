"""Sines, cosines and exponentials of our own: against long doubles, exact identities, themselves in other company."""

import ast
from pathlib import Path

import numpy as np
import pytest

from engine import kernels
from engine.kernels.shapes import Span, beam_shapes
from engine.kernels.sines import decay, sin_cos
from results_schema.arrays import Array

LONG_PI = np.longdouble("3.14159265358979323846264338327950288")
TURNS = np.concatenate([np.random.default_rng(1).uniform(-300.0, 300.0, 20_000), np.linspace(-2.0, 2.0, 4001)])
PATHS = np.concatenate([np.random.default_rng(2).uniform(0.0, 60.0, 20_000), np.linspace(0.0, 700.0, 7001)])
LIBRARIES_HAVE = {"sin", "cos", "tan", "arctan", "arctan2", "exp", "sinh", "cosh", "tanh", "log", "pow", "power"}
AMPLITUDES = {"sine": 0, "cosine": 1, "near": 2, "far": 3}


def plain(function: object) -> object:
    """A piece without the compiler."""
    return getattr(function, "py_func", function)


def wave(kind: str, turns: Array, x: float | Array, order: int = 0) -> Array:
    """(S, N) one of the four waves of N modes at places x (S,) of a span, by the compiled kernel."""
    places = np.atleast_1d(np.asarray(x, dtype=np.float64))
    amplitudes = np.zeros((turns.size, 4))
    amplitudes[:, AMPLITUDES[kind]] = 1.0
    span = Span(np.zeros((4, 1, 0)), turns, np.pi * turns, amplitudes, np.full(turns.size, 2.0))
    found = np.empty((1, places.size, turns.size))
    beam_shapes(places, np.arange(places.size), span, np.array([order]), np.ones(1), found)
    return np.asarray(found[0])


def test_kernels_ask_no_library_for_waves() -> None:
    """Whose bits differ from machine to machine."""
    folder, found, looked_at = Path(kernels.__path__[0]), set[str](), 0
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.decorator_list:
                calls = (one.func for one in ast.walk(node) if isinstance(one, ast.Call))
                names = {ast.unparse(one).rpartition(".")[2] for one in calls}
                found |= {f"{path.name}: {node.name}: {name}" for name in names & LIBRARIES_HAVE}
                looked_at += 1
    assert looked_at > 200 and not found


def test_sine_and_cosine() -> None:
    sine, cosine = plain(sin_cos)(TURNS)  # type: ignore[operator]
    angle = LONG_PI * TURNS.astype(np.longdouble)
    np.testing.assert_allclose(sine, np.sin(angle).astype(np.float64), rtol=0, atol=2.5e-16)
    np.testing.assert_allclose(cosine, np.cos(angle).astype(np.float64), rtol=0, atol=2.5e-16)
    small = 2.0 ** np.arange(-60.0, -2.0)
    np.testing.assert_allclose(plain(sin_cos)(small)[0], np.sin(np.pi * small), rtol=5e-16)  # type: ignore[operator]


def test_quarters_of_a_turn_are_exact() -> None:
    halves = np.arange(-200.0, 200.0)
    sine, cosine = plain(sin_cos)(0.5 * halves)  # type: ignore[operator]
    assert np.array_equal(sine, np.array([0.0, 1.0, 0.0, -1.0])[halves.astype(int) % 4])
    assert np.array_equal(cosine, np.array([1.0, 0.0, -1.0, 0.0])[halves.astype(int) % 4])


def test_decay() -> None:
    expected = np.exp(-PATHS.astype(np.longdouble)).astype(np.float64)
    np.testing.assert_allclose(plain(decay)(PATHS), expected, rtol=5e-16)  # type: ignore[operator]
    far = np.array([708.5, 1000.0, 1e6])
    assert np.all(plain(decay)(far) < 1e-307) and np.all(plain(decay)(far) >= 0.0)  # type: ignore[operator]


@pytest.mark.parametrize("kind", AMPLITUDES)
@pytest.mark.parametrize("order", range(4))
def test_derivatives_follow_each_other(kind: str, order: int) -> None:
    """Of wave number 2: a sine becomes a cosine, the wave from the left end changes its sign."""
    x, turns = np.linspace(-1.0, 1.0, 100), np.array([1.5, 4.0])
    turned = wave({"sine": "cosine", "cosine": "sine"}.get(kind, kind) if order % 2 else kind, turns, x)
    sign = {"sine": 1 - 2 * (order // 2), "cosine": -1 if order in (1, 2) else 1, "near": (-1) ** order, "far": 1}[kind]
    np.testing.assert_allclose(wave(kind, turns, x, order), sign * 2.0**order * turned, rtol=1e-15)
