"""Built-in studies and files to start from: valid, commented, and refused for the right reason when a key is spoilt."""

import tomllib

import pytest

import engine
from engine.scene.sweep import Cases, expand
from results_schema.errors import BadInput
from studies.commands import catalogue
from studies.protocol.library import find_study
from studies.protocol.parts import Pieces, Variants
from studies.protocol.study import kind_named, kind_names, kind_of
from tests.kinds.test_at_rest import COMPARED
from tests.kinds.test_envelopes import EXTRA
from tests.scene.mutations import HOW, How, accepted, distinct
from tests.studies import at_rest, scenes

BUILT_IN = catalogue.built_in()
TEXTS = {name: path.read_text(encoding="utf-8") for name, path in BUILT_IN.items()}
STARTS = {kind: catalogue.start_text(kind) for kind in catalogue.starts()}
AT_LEAST = {"asymmetry": 2000, "double-peak": 2000, "passage": 384}


def read(text: str) -> Cases:
    """Everything that is checked before a plan is made."""
    study = engine.load(text)
    kind_of(study)
    return expand(study)


def test_the_contract_is_there() -> None:
    assert {"asymmetry", "double-peak"} <= set(BUILT_IN)
    assert {"passage", "asymmetry", "double-peak", "trajectory"} <= set(STARTS) <= set(kind_names())


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_studies_are_planned_without_a_complaint(name: str) -> None:
    study = engine.load(BUILT_IN[name])
    parts = kind_of(study).parts(study)
    if isinstance(parts, Pieces):
        pieces = parts.pieces
        assert len({piece.name for piece in pieces}) == len(pieces) >= (1 if study.sweep.axes else 2)
        assert sum(piece.seconds for piece in pieces) < 180.0
    else:
        assert isinstance(parts, Variants)
        plan = parts.plan
        assert plan.size >= AT_LEAST.get(name, 3)
        assert plan.seconds < 20.0
    assert not any("?" in remark for remark in parts.remarks)  # whether something is meant
    assert len(study.title) > 10
    assert find_study(name) == BUILT_IN[name]


@pytest.mark.fault(2, 3, 4)
@pytest.mark.parametrize("how", HOW)
def test_every_key_of_every_built_in_study(how: How) -> None:
    """And of keys that none of these has: of questions of kinds at rest, and of envelopes."""
    more = [at_rest.text_of(kind, COMPARED, at_rest.MASS) for kind in at_rest.KINDS]
    tried = distinct(*TEXTS.values(), *more, scenes.text_of("passage", extra=EXTRA))
    assert len(tried) > 800
    for mutation in accepted(how, tried, read):
        of_frame = mutation.path[0] in ("frame", "arm")  # where these keys have a default
        needed = ("kind", "length", "on", "start", "end", "of", "centre")
        assert how != "drop" or of_frame or mutation.path[-1] not in needed


@pytest.mark.parametrize("text", [*TEXTS.values(), *STARTS.values()], ids=[*TEXTS, *STARTS])
def test_every_file_is_commented(text: str) -> None:
    lines = text.splitlines()
    assert lines[0].startswith("# ") and sum("#" in line for line in lines) > 10
    assert all(len(line) <= 120 for line in lines)


@pytest.mark.parametrize("kind", STARTS)
def test_starts_are_valid(kind: str) -> None:
    found = kind_named(kind)
    assert read(STARTS[kind]).size > 1 if found.sweeps else read(STARTS[kind]).size == 1
    assert engine.load(STARTS[kind]).kind == kind


@pytest.mark.parametrize("kind", STARTS)
def test_every_commented_key_of_a_start_is_one(kind: str) -> None:
    """Each line behind a # that reads like a key is accepted in its table, or belongs to another form of it."""
    lines, table = STARTS[kind].splitlines(), ""
    tried = 0
    for number, line in enumerate(lines):
        if line.startswith("["):
            table = line.partition("#")[0].strip()
        key = line.removeprefix("# ").partition(" = ")[0]
        if not line.startswith("# ") or " = " not in line or not key.isidentifier() or table == "[output]":
            continue
        tried += 1
        try:
            read("\n".join(_with_line(lines, number, key)))
        except BadInput as error:
            assert "unknown key" not in str(error) and "not valid TOML" not in str(error), error
    assert tried >= 5


def _with_line(lines: list[str], number: int, key: str) -> list[str]:
    """The file with a comment turned into its key, and the same key of the same table taken out."""
    tops = ("gravity", "expected", "initial")
    changed = list(lines)
    added = [lines[number].removeprefix("# ")]
    end = number + 1
    if added[0].rstrip().endswith("["):
        while not changed[end - 1].startswith("# ]"):
            added.append(changed[end].removeprefix("# "))
            end += 1
    start = max((i for i in range(number) if lines[i].startswith("[")), default=0)
    stop = next((i for i in range(end, len(lines)) if lines[i].startswith("[")), len(lines))
    kept = [
        line
        for i, line in enumerate(changed)
        if not (number <= i < end) and not (start < i < stop and line.startswith(f"{key} = "))
    ]
    place = 0 if key in tops else next(i for i, line in enumerate(kept) if line == lines[start]) + 1
    return [*kept[:place], *added, *kept[place:]]


def test_commented_examples_at_the_end_are_valid_too() -> None:
    """The examples of carriages, motions, sensors and axes, each put into a study."""
    examples = [line.removeprefix("# ") for line in STARTS["passage"].splitlines() if line.startswith("# ")]
    motions = [line for line in examples if line.startswith("motion = ")]
    axes = [line for line in examples if " = { of = " in line]
    assert {tomllib.loads(line)["motion"]["kind"] for line in motions} == {
        "cruise",
        "out-and-back",
        "sinusoidal",
        "waypoints",
        "point-to-point",
    }
    assert len(axes) >= 4
    base = STARTS["passage"].partition("[sweep]")
    rest = base[2].partition("[body.bed]")
    second = "[carriage.second]\non = 'bed'\nkind = 'mass'\nmass = 5.0\n"
    for motion in motions:
        for axis in axes:
            text = f"{base[0]}{second}{motion}\n[sweep]\n{axis}\n[body.bed]{rest[2]}"
            assert expand(engine.load(text)).size > 1


def test_unknown_names_are_refused_with_the_nearest() -> None:
    with pytest.raises(BadInput, match='did you mean "double-peak"'):
        find_study("doublepeak")
    with pytest.raises(BadInput, match='did you mean "trajectory"'):
        catalogue.start_text("trajectori")


def test_a_built_in_study_can_be_copied() -> None:
    assert catalogue.start_text("machine-bed-run") == TEXTS["machine-bed-run"]
    assert catalogue.start_text("passage") == STARTS["passage"]  # the kind, where a study has the same name
