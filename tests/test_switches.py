"""Things answer for themselves: nobody asks what class or kind a thing is, or whether it has something."""

import ast
from collections.abc import Iterator
from functools import cache

import pytest

from tests.test_imports import modules

# Where it is asked all the same, and of what.
ASKED = {
    "engine.study_file": "what users wrote, in whatever form, and the notes of its types",
    "engine.scene.dotted_keys": "which of nested values are tables",
    "engine.scene.study": "what users give for a study from Python",
    "engine.bodies.modal.description": "forms of the damping ratio, and what stands beside the table of a body",
    "engine.bodies.reduced": "which bodies can be saved, and errors of libraries",
    "engine.bodies.files": "what versions of foreign packages have",
    "engine.kernels": "layouts of coefficients, for which compiled code is specialised",
    "engine.methods": "the same",
    "engine.floating": "sorts of bodies, joints and schemes that its kernels know: they do not answer for it yet",
    "engine.robots": "rails and schemes that its kernels know, likewise",
    "studies.commands.planned_numerics": "which groups were chosen for before anything is marched",
    "studies.reporting.report": "what stands beside a table in a study's data",
}
FIELDS = {"kind", "quantity"}  # names of kinds, which nobody compares with words


@cache
def classes() -> set[str]:
    """Our classes but errors."""
    found = [node for tree in modules().values() for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    errors = {node.name for node in ast.walk(modules()["results_schema.errors"]) if isinstance(node, ast.ClassDef)}
    return {node.name for node in found} - errors


def names(node: ast.AST) -> set[str]:
    """Every name in an expression, the last part of a dotted one."""
    found = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    return found | {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}


def questions(tree: ast.AST) -> Iterator[str]:
    """Questions after a class, an attribute or the name of a kind."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) > 1:
            of_class = node.func.id in ("isinstance", "issubclass") and names(node.args[1]) & classes()
            of_attribute = node.func.id in ("getattr", "hasattr") and isinstance(node.args[1], ast.Constant)
            if of_class or of_attribute:
                yield ast.unparse(node)
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            named = any(isinstance(s, ast.Attribute) and s.attr in FIELDS and "dtype" not in names(s) for s in sides)
            listed = [
                part for s in sides for part in (s.elts if isinstance(s, ast.Tuple | ast.List | ast.Set) else [s])
            ]
            words = {part.value for part in listed if isinstance(part, ast.Constant)}
            if named and {word for word in words if isinstance(word, str)} - {"auto"}:
                yield ast.unparse(node)


def asked_in(name: str) -> str | None:
    """The entry of the list that a module belongs to."""
    return next((known for known in ASKED if f"{name}.".startswith(f"{known}.")), None)


@cache
def all_questions() -> dict[str, list[str]]:
    """Of every module but those of results, by its name."""
    ours = ((name, tree) for name, tree in modules().items() if name.partition(".")[0] in ("engine", "studies"))
    return {name: list(questions(tree)) for name, tree in ours}


def test_nobody_asks_of_what_kind_a_thing_is() -> None:
    assert {name: found for name, found in all_questions().items() if found and asked_in(name) is None} == {}


def test_the_list_is_no_longer_than_it_must_be() -> None:
    assert {asked_in(name) for name, found in all_questions().items() if found} - {None} == set(ASKED)


@pytest.mark.parametrize(
    "text",
    [
        "isinstance(body, Beam)",
        "isinstance(body, engine.Beam | int)",
        "hasattr(motion, 'speed')",
        "getattr(motion, 'after', 0.0)",
        "carriage.kind == 'mass'",
        "sensor.quantity in ('velocity', 'acceleration')",
        "'cruise' != carriage.motion.kind",
    ],
)
def test_such_questions_are_found(text: str) -> None:
    assert list(questions(ast.parse(text))) == [ast.unparse(ast.parse(text))]


@pytest.mark.parametrize("text", ["isinstance(error, BadInput)", "isinstance(value, str)", "array.dtype.kind == 'f'"])
def test_others_are_not(text: str) -> None:
    assert list(questions(ast.parse(text))) == []
