"""What a variant is computed with is a value beside the study, which stays as it is."""

from pathlib import Path
from typing import Any

import pytest

from engine.bodies.build import build_body
from engine.bodies.modal.description import MAX_MODES, Body
from engine.bodies.reduced.body import save_body
from engine.model.numerics import Numerics, open_bodies
from engine.model.scene_model import build_model, with_numerics
from engine.scene.study import Study
from tests.accuracy.passages import passages
from tests.bodies.frames import PINNED, body, straight
from tests.bodies.models import Files
from tests.engine.bodies_on_contacts import FLEXIBLE, THREE, riding
from tests.engine.build import beam, cruise, fixed
from tests.unreduced.test_unreduced import frame


def test_building_with_it_leaves_the_study_as_it_is() -> None:
    given = passages()
    model, text = build_model(given, {}, {}), given.model_dump_json()
    other = with_numerics(model, model.numerics._replace(fidelity="force", modes=3, static_correction=False))
    assert other.study is model.study is given and given.model_dump_json() == text
    assert (other.body_modes, other.fidelity < model.fidelity) == (3, True)
    assert model.body_modes != 3 and model.numerics == Numerics.of(given)


def test_bodies_that_carry_loads_and_name_no_modes_are_open() -> None:
    assert open_bodies(passages()) == ("bed",)
    assert open_bodies(passages(bed=beam(modes=5))) == ()
    assert open_bodies(riding(cruise(0.3, 0.7, 0.8), THREE, FLEXIBLE, beam(modes="auto"))) == ("bed",)


def only_body(table: dict[str, Any]) -> Body:
    tables: dict[str, Any] = {"schema_version": 1, "kind": "passage", "sensor": {"middle": fixed(0.5)}}
    return Study(body={"bed": table}, **tables).body["bed"]


def modes_of(found: Body) -> int:
    """Modes of a body as it is built."""
    return int(build_body(found).omega.size)


def test_modes_of_a_beam() -> None:
    two = only_body(beam(modes=2))
    assert [modes_of(two.with_modes(count)) for count in (1, 5)] == [1, 5]
    assert modes_of(only_body(beam(modes=40)).with_more_modes(8)) == MAX_MODES
    assert modes_of(two) == 2


def test_modes_of_a_frame_are_as_many_as_it_has() -> None:
    found = only_body(frame(16, modes=6))
    assert [modes_of(found.with_more_modes(times)) for times in (1, 2, 16)] == [6, 12, 3 * 17 - 3]


def test_a_reduced_frame_is_compared_with_the_whole_one() -> None:
    table = straight(PINNED, elements=8) | {"interface": ["a", "b"], "fixed_interface_modes": 3}
    found = only_body(table)
    more = found.with_more_modes(2)
    assert more.model_dump()["interface"] == () and modes_of(more) > modes_of(found) + 3
    few = only_body(table | {"modes": 4})
    assert [modes_of(few), modes_of(few.with_more_modes(2))] == [4, 8]


def test_modes_of_a_body_in_a_file(tmp_path: Path) -> None:
    save_body(body(straight(PINNED, modes=8)), tmp_path / "body.nc")
    few, whole = (
        only_body({"kind": "reduced", "file": str(tmp_path / "body.nc")} | more) for more in ({"modes": 3}, {})
    )
    assert [modes_of(few.with_more_modes(times)) for times in (1, 2, 9)] == [3, 6, 8]
    assert whole.with_more_modes(2) == whole and modes_of(whole) == 8


def test_modes_of_an_imported_body(tmp_path: Path) -> None:
    files = Files(tmp_path, straight(PINNED, elements=16))
    found = only_body(files.table(modes=4))
    assert [modes_of(found.with_more_modes(times)) for times in (1, 3)] == [4, 12]


@pytest.mark.parametrize(("modes", "more", "kept"), [(0, 1, 10), (3, 1, 3), (3, 4, 3)])
def test_open_bodies_take_its_modes_and_others_more_of_their_own(modes: int, more: int, kept: int) -> None:
    given = riding(cruise(0.3, 0.7, 0.8), THREE, FLEXIBLE, beam(modes="auto"))
    model = build_model(given, {}, {})
    found = with_numerics(model, model.numerics._replace(modes=modes, more=more))
    sizes = {part.name: part.modal.omega.size for part in model.bodies}
    again = {part.name: part.modal.omega.size for part in found.bodies}
    assert again["bed"] == (modes or sizes["bed"])
    assert (again["table"] > sizes["table"]) == (more > 1)
