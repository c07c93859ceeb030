"""What a study of work and precision says: from the points by plain loops, and from points made up for it."""

import re
from itertools import product

import numpy as np
import pytest
import xarray as xr

from results_schema.status import Status
from studies.precision import findings as advice
from studies.precision import pareto as trade
from studies.reporting import answers
from tests.studies import precision


def plain_choice(dataset: xr.Dataset, scene: str, quantity: str, tolerance: float) -> tuple[float, str] | None:
    """The cheapest point whose error, and that of all finer ones, is at most the tolerance, though the reference's own
    error come on top: seconds and what it is."""
    best = None
    own = float(dataset.total_reference_error.sel(scene=scene, quantity=quantity))
    for modes, c, scheme in product(dataset.mode_count.values, (1, 0), dataset.scheme.values):
        for n, steps in enumerate(dataset.step_count.values):
            good = True
            for finer in dataset.step_count.values[n:]:
                error = dataset.total_error.sel(scene=scene, mode_count=modes, correction=c, scheme=scheme)
                if not float(error.sel(step_count=finer, quantity=quantity)) + own <= tolerance:
                    good = False
            at = {"scene": scene, "mode_count": modes, "scheme": scheme, "step_count": steps}
            cost = float(dataset.total_seconds_per_variant.sel(at))
            if good and (best is None or cost < best[0]):
                best = cost, f"{advice.scheme_words(str(scheme))} with {steps:,} steps"
    return best


def least_error(dataset: xr.Dataset, scene: str, quantity: str) -> float:
    """What the best point errs at least, though the reference's own error be all against it; of each row the finest
    one that did not diverge is the worst of the finer ones."""
    own = float(dataset.total_reference_error.sel(scene=scene, quantity=quantity))
    finest = dataset.total_error.sel(scene=scene, quantity=quantity).isel(step_count=-1)
    return float(finest.min()) - own


@pytest.mark.parametrize("tolerance", [1e-1, 3e-2, 1e-3, 1e-4, 1e-6])
def test_the_sentence_follows_from_the_points(tolerance: float) -> None:
    dataset = precision.small()
    reached = []
    for scene, quantity in product(map(str, dataset.scene.values), ("history", "extremes")):
        said = advice.advice(dataset, scene, quantity, [tolerance])
        expected = plain_choice(dataset, scene, quantity, tolerance)
        if expected is not None:
            seconds, words = expected
            assert f"take {words}" in said and f": {advice.short_time(seconds)} per variant" in said
        elif least_error(dataset, scene, quantity) > tolerance:
            assert "is not reached (the best found: " in said and "judged" not in said
        else:
            assert "cannot be judged" in said and "take " not in said
        reached.append(expected is not None)
    assert any(reached) or tolerance < 1e-2


def test_findings_say_what_diverged_and_what_orders_are() -> None:
    text = "\n".join(answers.answer(precision.small()))
    gone = int((precision.small().status == int(Status.DIVERGED)).sum())
    assert f"{gone} points of {precision.small().status.size} diverged, which is an answer too" in text
    assert "a quarter of the error" in text and "a sixteenth of the error" in text and "nan" not in text
    assert re.search(
        r"one variant after another on one thread, need [\d.e]+ to [\d.e]+ times as long per variant as the march of a "
        r"batch on 1 thread ",
        text,
    )


def lead(known: tuple[float, float], best: tuple[float, float], *wanted: float) -> str:
    """The first sentence with other errors of the two references, and every point as good as said."""
    dataset = precision.small().copy(deep=True)
    dataset.total_reference_error.loc[{"quantity": "history"}] = np.array(known)
    there = dataset.total_error.sel(quantity="history").notnull()
    for scene, error in zip(dataset.scene.values, best, strict=True):
        values = dataset.total_error.sel(scene=scene, quantity="history")
        dataset.total_error.loc[{"scene": scene, "quantity": "history"}] = xr.where(
            there.sel(scene=scene), error, values
        )
    return advice.findings(dataset, wanted)[0]


def test_the_lead_judges_as_the_advice_does() -> None:
    assert "within 1e-3 of the static value cost" in lead((1e-5, 1e-5), (9e-4, 9e-4), 1e-3)
    assert lead((1e-5, 1e-5), (2e-3, 2e-3), 1e-3).startswith("No choice brings whole histories within 1e-3")
    unknown = lead((1.6e-3, 1.5e-3), (9e-4, 9e-4), 1e-3)
    assert "cost" not in unknown and "in 2 of 2 scenes it cannot be judged" in unknown
    assert "good to 0.0015 to 0.0016 only" in unknown
    mixed = lead((1.6e-3, 1.5e-3), (9e-4, 3.2e-3), 1e-3)
    assert "in 1 of 2 scenes nothing does" in mixed and "in 1 of 2 scenes it cannot be judged" in mixed
    some = lead((1e-5, 2e-3), (9e-4, 9e-4), 1e-3)
    assert "static value cost" in some and some.endswith(
        "But in 1 of 2 scenes it cannot be judged, as the reference itself is good to 0.002 only."
    )
    assert "in 1 of 2 scenes it cannot" in lead((1e-5, 2e-4), (9e-4, 9e-4), 1e-3)  # 9e-4 + 2e-4 > 1e-3


def with_automatic(dataset: xr.Dataset, tolerance: float, factors: tuple[float, ...], errors: tuple[float, ...]) -> str:
    """What is said of automatic choices that cost so many times the front, and err so many times the tolerance."""
    for scene, factor, error in zip(map(str, dataset.scene.values), factors, errors, strict=True):
        place = {"scene": scene, "asked_tolerance": tolerance}
        best = plain_choice(dataset, scene, "history", tolerance)
        dataset.automatic_seconds_per_variant.loc[place] = factor * (best[0] if best else 1.0)
        dataset.automatic_error.loc[place] = error * tolerance
    return advice._automatic(trade.automatic_choices(dataset, tolerance), tolerance)


def test_the_automatic_choice_is_compared_with_the_front() -> None:
    dataset = precision.small().copy(deep=True)
    assert with_automatic(dataset, 0.1, (1.8, 0.5), (0.25, 0.9)) == (
        "The automatic choice at 0.1 costs at most 1.8 times the front at the error asked (light), in all 2 scenes. "
        "Its histories err 0.25 to 0.9 times what was asked."
    )
    assert with_automatic(dataset, 0.1, (0.4, 3.5), (0.25, 1.5)) == (
        "The automatic choice at 0.1 costs at most 3.5 times the front at the error asked (heavy and slow), in all 2 "
        "scenes. Its histories err 0.25 to 1.5 times what was asked, too much in heavy and slow."
    )
    diverged = with_automatic(dataset, 0.1, (0.4, 3.5), (0.25, np.nan))
    assert diverged.endswith("err 0.25 to infinitely many times what was asked, too much in heavy and slow.")


def point(error: float) -> trade.Choice:
    return trade.Choice(3, True, "fox-goodwin", 100, error, 1e-6)


def test_the_best_found_stands_where_it_belongs() -> None:
    def said(error: float, known: float, *wanted: float) -> str:
        return advice._advised([point(error)], known, wanted, lambda choice: "P")

    assert said(2e-4, 1e-6, 1e-5, 1e-3) == (
        "for 1e-3 take P: 1 µs per variant; 1e-5 is not reached (the best found: 0.0002, P)"
    )
    assert said(9e-4, 1.6e-3, 1e-3, 1e-6) == (
        "1e-3 and 1e-6 cannot be judged, as the reference itself is good to 0.0016 only (nearer to it than that is P)"
    )
    assert said(1.3e-3, 1.2e-3, 1e-3, 1e-6) == (
        "1e-3 cannot be judged, as the reference itself is good to 0.0012 only (the best found: 0.0013, P); "
        "1e-6 is not reached"
    )


def test_the_automatic_choice_is_not_compared_with_what_is_not_there() -> None:
    dataset = precision.small().copy(deep=True)
    heavy = dataset.total_error.sel(scene="heavy and slow")
    dataset.total_error.loc[{"scene": "heavy and slow"}] = heavy.where(heavy.isnull() | (heavy > 0.05), 0.05)
    assert with_automatic(dataset, 0.01, (1.0, 1.0), (0.5, 0.5)) == (
        "The automatic choice at 0.01 cannot be compared with the front, where no point surely errs so little. "
        "Its histories err 0.5 times what was asked."
    )
    light = dataset.total_error.sel(scene="light")
    dataset.total_error.loc[{"scene": "light"}] = light.where(light.isnull(), 1e-3)
    said = with_automatic(dataset, 0.01, (1.2, 1.0), (0.5, 0.5))
    assert "1.2 times the front at the error asked (light), in 1 of 2 scenes; in the others no point" in said
    dataset.automatic_steps.loc[{"scene": "heavy and slow"}] = 0
    assert with_automatic(dataset, 0.01, (1.2, 1.0), (0.5, 0.5)) == (
        "The automatic choice at 0.01 costs 1.2 times the front at the error asked. "
        "Its histories err 0.5 times what was asked."
    )
    without = dataset.drop_vars([name for name in dataset if str(name).startswith("automatic_")])
    assert advice.automatic(without) == []
    assert not any("automatic" in text for text in advice.findings(without, [1e-3]))
