"""Where all tools stay within a limit that a study of robots names: sentences and the line in the figure."""

from typing import Any

import numpy as np
import pytest

import studies
from results_schema.errors import BadInput
from studies.pictures.common.figures import svg
from studies.pictures.portal import pictures
from studies.protocol.study import kind_of
from studies.results.results import Results
from studies.robots.limits import told_limits
from tests.robots.scenes import scene

ACCELERATION = {"of": ["robot.portal.acceleration_scale", "robot.hanging.acceleration_scale"]}
VALUES, PAYLOADS = [0.5, 1.0, 2.0, 3.0], [0.0, 2.0]
PAYLOAD = {"of": ["robot.portal.payload_scale"], "values": PAYLOADS}


def swept(limit: Any = "0.5 mm", name: str = "error_moving", **more: Any) -> Any:
    sweep = {"acceleration": ACCELERATION | {"values": VALUES}, **more}
    return scene(solver={"tolerance": 5e-2, "steps": 400}, sweep=sweep, question={"after": 0.1, name: limit})


@pytest.fixture(scope="module")
def line() -> Any:
    return studies.run(swept())


@pytest.fixture(scope="module")
def grid() -> Any:
    return studies.run(swept(payload=PAYLOAD))


def told(found: Any, portal: Any, hanging: Any, error: float = 0.0) -> list[str]:
    """The sentences where both robots are so far off (mm) in moves."""
    own = found.copy(deep=True)
    own["error_moving"].loc[{"robot": "portal"}] = 1e-3 * np.array(portal)
    own["error_moving"].loc[{"robot": "hanging"}] = 1e-3 * np.array(hanging)
    for doing in ("working", "holding"):
        own[f"error_{doing}"][:] = 0.0
    own["estimated_error"][:] = error
    return list(told_limits(Results.of(own)))


def test_the_answer_tells_up_to_which_value_all_tools_stay_within(line: Any) -> None:
    assert told(line, [0.1, 0.2, 0.3, 0.4], [0.1, 0.45, 0.7, 0.9]) == [
        "Every tool stays within 0.5 mm of its plan in moves up to acceleration 1 (at 2 hanging is off by 0.7 mm). "
        "Beyond it: hanging up to 0.9 mm."
    ]
    assert told(line, [0.9, 0.6, 0.3, 0.4], [0.1, 0.45, 0.2, 0.1]) == [
        "Every tool stays within 0.5 mm of its plan in moves from acceleration 2 on (at 1 portal is off by 0.6 mm). "
        "Beyond it: portal up to 0.9 mm."
    ]


def test_the_answer_tells_of_limits_that_hold_always_never_and_here_and_there(line: Any) -> None:
    assert told(line, [0.1, 0.2, 0.3, 0.4], [0.1, 0.1, 0.1, 0.1]) == [
        "Every tool stays within 0.5 mm of its plan in moves in all variants: at most portal is off by 0.4 mm at "
        "acceleration 3."
    ]
    assert told(line, [0.7, 0.6, 0.8, 0.9], [0.1, 0.1, 1.0, 0.1]) == [
        "No variant keeps every tool within 0.5 mm of its plan in moves: at best portal is off by 0.6 mm at "
        "acceleration 1. Beyond it: portal up to 0.9 mm and hanging up to 1 mm."
    ]
    assert told(line, [0.1, 0.6, 0.1, 0.2], [np.nan] * 4) == [
        "Every tool stays within 0.5 mm of its plan in moves only at acceleration 0.5 and 2 to 3. "
        "Beyond it: portal up to 0.6 mm."
    ]
    assert told(line, [np.nan] * 4, [np.nan] * 4) == [
        "Whether every tool stays within 0.5 mm of its plan in moves is not known: no variant has a number."
    ]
    assert "in all 3 variants with values" in told(line, [0.1, 0.1, 0.1, np.nan], [0.1, 0.1, 0.1, np.nan])[0]
    gone = [0.1, 0.1, np.nan, 0.7]
    assert "up to acceleration 1 (at 2 no value is known). Beyond it: portal up to 0.7 mm" in told(line, gone, gone)[0]


def test_other_swept_numbers_are_told_one_by_one_where_they_decide(grid: Any) -> None:
    near = np.array([[0.1, 0.2], [0.2, 0.6], [0.7, 0.8], [0.9, 0.9]])
    assert told(grid, near, 0.0 * near) == [
        "Every tool stays within 0.5 mm of its plan in moves with payload 0 up to acceleration 1 (at 2 portal is off "
        "by 0.7 mm); with payload 2 up to acceleration 0.5 (at 1 portal is off by 0.6 mm). Beyond it: portal up to "
        "0.9 mm."
    ]
    alike = np.array([[0.1, 0.2], [0.2, 0.3], [0.7, 0.8], [0.9, 0.9]])
    assert "within 0.5 mm of its plan in moves up to acceleration 1 for every payload." in told(grid, alike, alike)[0]


def test_a_verdict_within_the_estimated_errors_is_told_as_such(line: Any) -> None:
    portal, hanging = [0.1, 0.2, 0.3, 0.4], [0.1, 0.49, 0.7, 0.9]
    assert told(line, portal, hanging, 0.02)[1:] == []  # 0.0098 mm of 0.01 mm
    assert told(line, portal, hanging, 0.03)[1:] == [
        "By its errors that is not certain at acceleration 1: hanging is off by 0.49 mm, with an estimated error of "
        "0.015 mm."
    ]


def test_limits_are_told_in_the_units_typed_and_drawn_as_a_line(line: Any) -> None:
    """At 60 % of the largest error of the run itself."""
    limit = 0.6 * float(line["error_moving"].max())
    typed = {"mm": f"{1e3 * limit:.4f} mm", "um": f"{1e6 * limit:.1f} um", "m": limit}
    for unit, text in typed.items():
        study = swept(text)
        results = Results.of(line.assign_attrs(study=study.source.text))
        (first, *_) = kind_of(study).findings(results)
        assert f" {unit} of its plan in moves" in first or unit == "m"
        shown = {figure.name: figure for figure in pictures(results)}
        assert "Dashed: the limit of" in shown["errors"].caption
        assert svg(shown["errors"]).count("stroke-dasharray") > 0
    without = Results.of(line.assign_attrs(study=swept(name="after", limit=0.1).source.text))
    plain = next(figure for figure in pictures(without) if figure.name == "errors")
    assert "stroke-dasharray" not in svg(plain) and "Dashed" not in plain.caption


def test_sampled_sweeps_tell_how_many_variants_keep_it(grid: Any) -> None:
    zipped = {"payload": {"of": ["robot.portal.payload_scale"], "values": [0.0, 1.0, 2.0, 3.0]}}
    sweep = {"zip": True, "acceleration": ACCELERATION | {"values": VALUES}, **zipped}
    own = studies.run(scene(solver={"tolerance": 5e-2, "steps": 400}, sweep=sweep, question={"error_moving": "0.5 mm"}))
    sentence = told(own, [0.1, 0.2, 0.6, 0.4], [0.1] * 4)[0]
    assert "within 0.5 mm of its plan in moves in 3 of 4 variants, in all of them up to acceleration 1." in sentence
    assert any(figure.name == "errors" for figure in pictures(Results.of(own)))


@pytest.mark.parametrize("limit", [0.0, "-1 mm", "3 kg"])
def test_what_is_no_limit_is_refused(limit: Any) -> None:
    with pytest.raises(BadInput) as caught:
        kind_of(swept(limit))
    assert caught.value.where.endswith("question.error_moving")


def answered(found: Any, holding: list[float], works: bool = False, **changes: Any) -> list[str]:
    """The answer where tools are so far off (mm) while they hold, and whether any of them works."""
    own = found.copy(deep=True)
    own["error_holding"].values[:] = 1e-3 * np.array(holding)[:, None]
    if not works:
        for name in ("error_working", "beyond_rest_working"):
            own[name].values[:] = np.nan
    for name, values in changes.items():
        own[name].values[:] = values
    results = Results.of(own.assign_attrs(study=swept(name="after", limit=0.1).source.text))
    return kind_of(results.study).findings(results)


def test_the_answer_begins_with_what_leaves_least_after_the_last_move(line: Any) -> None:
    """Where no robot works; behind what tools are off at work where one does."""
    least = (
        "While holding, as after the last move, tools are least off their plan at acceleration 1: by up to 200 µm. "
        "Most they are at acceleration 3: 900 µm."
    )
    said = answered(line, [0.4, 0.2, 0.7, 0.9])
    assert said[0] == least and "is both faster and nearer to rest in moves" in said[1]
    working = answered(line, [0.4, 0.2, 0.7, 0.9], works=True)
    assert working[working.index(least) - 1].startswith("The tool of ") and "faster" in working[0]
    assert (
        ": by up to 200 µm, and as little within 1 % in 2 other variants. Most"
        in answered(line, [0.2, 0.2001, 0.2, 0.9])[0]
    )
    assert answered(line, [0.4, 0.4, 0.4, 0.401])[0].endswith("by up to 401 µm in every variant within 1 %.")


def test_where_every_variant_is_a_trade_it_is_said_so(line: Any) -> None:
    said = answered(line, [0.4] * 4, beyond_rest_moving=1e-3 * np.array([1.0, 2.0, 3.0, 4.0])[:, None])
    assert "Each of the 4 variants trades time for accuracy: none is both faster and nearer to rest" in " ".join(said)
    assert "4 of 4" not in " ".join(said)


def test_nothing_is_told_of_work_where_nobody_works(line: Any) -> None:
    statics = "Statics alone would do"
    assert "at work" not in next(text for text in answered(line, [0.4] * 4, at_rest=0.5) if text.startswith(statics))
    assert "at work" in next(text for text in answered(line, [0.4] * 4, True, at_rest=0.5) if text.startswith(statics))


def test_figures_have_no_panels_of_rounding_and_the_numbers_of_the_archive(line: Any) -> None:
    own = line.copy(deep=True)
    own["tool_centre_point_error"].values[..., 1] = 1e-9
    own["error_moving"].values[:] = 7e-3
    own["deflection_largest"].values[:] = 8e-3
    shown = {figure.name: figure for figure in pictures(Results.of(own))}
    labels = [axes.get_ylabel() for axes in shown["over-time"].drawing.axes]
    assert len(labels) == 4 and not any(" y " in text for text in labels)
    assert "Errors of y are less than 0.01 % of the largest." in shown["over-time"].caption
    assert shown["worst-move"].title.endswith("its tool is off by up to 7 mm")
    assert shown["rails"].title == "The rails bend by up to 8 mm"
    assert len(next(f for f in pictures(Results.of(line)) if f.name == "over-time").drawing.axes) == 6


def test_errors_while_holding_are_drawn_where_nobody_works(line: Any) -> None:
    for works, panel in ((True, "off plan at work"), (False, "off plan while holding")):
        own = line.copy(deep=True)
        own["error_working"].values[:] = 1e-3 if works else np.nan
        own["error_holding"].values[:] = 1e-3
        figure = next(f for f in pictures(Results.of(own)) if f.name == "errors")
        assert figure.drawing.axes[1].get_ylabel().startswith(panel)


def test_what_holds_of_the_variants_with_values_is_said_of_no_others(line: Any) -> None:
    none = np.nan
    assert answered(line, [0.4, none, 0.4, none])[0].endswith(
        "by up to 400 µm in all 2 variants with values within 1 %."
    )
    assert answered(line, [none, none, 0.4, none])[0].endswith("off their plan by up to 400 µm at acceleration 2.")
