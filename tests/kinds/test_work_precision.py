"""Work and precision: errors from a second source, fitted orders, fronts and sentences recomputed by plain loops."""

import re
import warnings
from itertools import product

import numpy as np
import pytest

import engine
import studies
from engine.accuracy.jobs import InTurn
from engine.accuracy.pilots import pilots_of
from engine.batch.chunk import run_chunk
from engine.batch.plan import make_plan
from engine.march.tables import SceneTables
from engine.methods.ode import ModalEquations
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.kinds.work_precision import Question
from studies.pictures.common import figures
from studies.precision import findings as advice
from studies.precision import ladders
from studies.precision import pareto as trade
from studies.precision import precision as measured
from studies.precision.variables import RESULTS
from studies.protocol.parts import Work
from studies.reporting import answers
from tests.bodies.frames import PINNED, straight
from tests.naive import ode
from tests.naive.newmark import Newmark
from tests.naive.newmark import march as naive_march
from tests.naive.scene import Load, Phase, Scene, State
from tests.studies import precision

GRAVITY = 9.80665
LIGHT = (50.0, 15.0)


def plain_scene(mass: float, speed: float, modes: int = 2) -> tuple[Scene, np.ndarray]:
    """The small study's scene by closed forms, and the mode shapes at midspan (N,)."""
    length, area = 10.0, 0.01 * 7850
    k = np.arange(1, modes + 1) * np.pi / length
    omega = k**2 * np.sqrt(210e9 * 8e-6 / area)
    size = np.sqrt(2.0 / (area * length))

    def shape(s: float, derivative: int) -> np.ndarray:
        waves = (np.sin, np.cos, lambda x: -np.sin(x))[derivative]
        return size * k**derivative * waves(k * s)

    phase = Phase(0.0, length / speed, lambda t: speed * t, lambda t: speed, lambda t: 0.0)
    load = Load((phase,), weight=mass * GRAVITY, mass=mass, convective_mass=mass)
    return Scene(phi=shape, omega=omega, zeta=np.full(modes, 0.03), loads=(load,)), shape(5.0, 0)


def histories(mass: float, speed: float, steps: int, exact: bool) -> tuple[np.ndarray, np.ndarray]:
    """Midspan deflection of the kept modes and contact force at the stations, by the naive twin."""
    scene, row = plain_scene(mass, speed)
    times = np.linspace(0.0, 10.0 / speed, steps + 1)
    rest = State(np.zeros(2), np.zeros(2))
    found = ode.solve(scene, times, rest, 1e-2) if exact else naive_march(scene, times, rest, Newmark())
    return found.q @ row, found.contact_force[:, 0]


def test_the_reference_solves_the_equations_of_the_naive_twin() -> None:
    study = engine.load(precision.TEXT).with_values({"solver.static_correction": False})
    model = measured.scene_model(study, {})
    equations = ModalEquations(model)
    tables = SceneTables(model, 40, "whole")
    counts = np.arange(41)
    found = equations.readings(tables, counts, equations.solve("DOP853", 1e-11)(counts / 40))
    deflection, force = histories(*LIGHT, 40, exact=True)
    np.testing.assert_allclose(found[:, 0], deflection, atol=1e-9 * np.abs(deflection).max())
    counted = np.arange(41) / 40 <= 0.98
    np.testing.assert_array_equal(np.isfinite(found[:, -1]), counted)
    np.testing.assert_allclose(found[counted, -1], force[counted], rtol=1e-7)


def test_errors_are_those_of_the_naive_twin() -> None:
    """Average acceleration with 80 steps, deflection without static correction and contact force."""
    study = engine.load(precision.TEXT.replace(precision.TEXT[precision.TEXT.index("[sensor.moment]") :], ""))
    study = study.with_values({"solver.static_correction": False})
    ladder = Question(schemes=("average-acceleration",), step_counts=(80,), mode_counts=(2,), reference_modes=6)
    found = ladders.steps(study, {}, ladder, Work(1))["error"].values[0, 0]
    (marched, force), (exact, true_force) = (histories(*LIGHT, 80, exact=flag) for flag in (False, True))
    static = 50.0 * GRAVITY * 10.0**3 / (48 * 210e9 * 8e-6)  # of the whole beam: the scale of every number of modes
    assert found[0] == pytest.approx(np.abs(marched - exact).max() / static, rel=1e-3)
    counted = np.arange(81) / 80 <= 0.98
    assert found[2] == pytest.approx(np.abs(force - true_force)[counted].max() / (50.0 * GRAVITY), rel=1e-3)
    scene, row = plain_scene(*LIGHT)
    around = (np.argmax(np.abs(exact)) + np.linspace(-1.0, 1.0, 201)) / 80 * 10.0 / 15.0
    fine = ode.solve(scene, [0.0, *around], State(np.zeros(2), np.zeros(2)), 1e-2).q @ row
    assert found[1] == pytest.approx(abs(np.abs(marched).max() - np.abs(fine).max()) / static, rel=1e-2)


# ---- the archive ----


def test_orders_of_the_small_study() -> None:
    order = precision.small().fitted_order.sel(quantity="history", scene="light")
    for scheme, expected in (("average-acceleration", 2), ("richardson", 4), ("lagged-convective", 1)):
        assert float(order.sel(scheme=scheme)) == pytest.approx(expected, abs=0.3), scheme
    error = precision.small().error.sel(quantity="history", scene="light", step_count=[160, 320, 640])
    assert (error.sel(scheme="fox-goodwin") < 0.5 * error.sel(scheme="average-acceleration")).all()


@pytest.mark.fault(17)
def test_what_blows_up_is_diverged_and_has_no_numbers() -> None:
    """Lagged inertia where m phi.phi > 1: 1500 kg on a beam of 785 kg. A few steps of another only begin to grow."""
    dataset = precision.small()
    gone = dataset.status == int(Status.DIVERGED)
    assert float(dataset.error.sel(scene="heavy and slow", scheme="fox-goodwin", step_count=8, quantity="history")) > 10
    assert gone.sel(scene="heavy and slow", scheme="lagged-inertia", step_count=[160, 320, 640]).all()
    assert not gone.sel(scheme="average-acceleration").any()
    assert np.isnan(dataset.error.where(gone, drop=True)).all()
    assert np.isfinite(dataset.error.where(~gone)).any("quantity").equals(~gone)
    assert (dataset.seconds_per_variant.where(~gone).notnull() == ~gone).all()


def test_the_total_error_is_that_against_a_reference_of_more_modes_and_steps() -> None:
    """A plain run of the engine with 6 modes and many steps as the second source."""
    bare = engine.load(precision.TEXT.partition("[question]")[0].replace("work-precision", "trajectory"))
    runs = [
        engine.run(
            bare.with_values(
                {"body.bed.modes": modes, "solver.steps": steps, "output.histories": {"every": steps // 80}}
            )
        )
        for modes, steps in ((2, 640), (6, 20_480))
    ]
    weight, bending = 50.0 * GRAVITY, 210e9 * 8e-6
    scales = {"midspan": weight * 10.0**3 / (48 * bending), "moment": weight * 10.0 / 4}
    apart = max(float(abs(runs[0][name] - runs[1][name]).max()) / scale for name, scale in scales.items())
    point = {"scene": "light", "scheme": "average-acceleration", "step_count": 640, "mode_count": 2, "correction": 1}
    assert float(precision.small().total_error.sel(point | {"quantity": "history"})) == pytest.approx(apart, rel=0.05)


def test_the_automatic_choice_is_in_the_archive() -> None:
    dataset = precision.small()
    for variable in (one for one in RESULTS if one.name.startswith("automatic")):
        assert dataset[variable.name].dims == ("scene", "asked_tolerance")
    assert (dataset.automatic_error > 0.0).all() and (dataset.automatic_error <= dataset.asked_tolerance).all()
    assert (dataset.automatic_seconds_per_variant > 0.0).all() and (dataset.automatic_steps >= 32).all()
    assert (dataset.automatic_modes >= 2).all()
    told = [text for text in answers.answer(dataset) if text.startswith("The automatic choice at ")]
    assert [text.split()[4] for text in told] == ["0.1", "0.01"]


def test_the_automatic_choice_is_that_of_a_sweep_around_the_scene() -> None:
    study = engine.load(precision.TEXT)
    plan = make_plan(ladders.around(study, 0.1))
    assert plan.size == 2048 and not plan.converges and 0 not in pilots_of(plan.cases, plan.members)
    own = {"carriage.table.mass": 50.0, "carriage.table.motion.speed": 15.0, "body.bed.damping_ratio": 0.03}
    assert plan.cases.values_of(0) == own
    for path, value in own.items():
        column = plan.cases.column(path) / value
        assert 0.5 <= column.min() < 0.51 and 1.98 < column.max() <= 2.0
    plan.choose(InTurn())
    group = next(group for group in plan.groups if 0 in group.variants)
    flat, _ = run_chunk(plan, group, np.array([0]))
    taken = precision.small().sel(scene="light", asked_tolerance=0.1)
    assert flat["modes_used"][0] == taken.automatic_modes and flat["steps_used"][0] == taken.automatic_steps


def test_there_is_no_automatic_choice_where_the_modes_are_given() -> None:
    study = engine.load(precision.TEXT).with_values({"body.bed": straight(PINNED, interface=["a"])})
    assert not ladders.leaves_modes_open(study) and ladders.leaves_modes_open(engine.load(precision.TEXT))
    names = [piece.name for piece in studies.kind_named("work-precision").pieces(study)]
    assert names and not any(name.startswith("automatic") for name in names)


@pytest.mark.extras
def test_jax_marches_the_same() -> None:
    study = engine.load(precision.TEXT)
    ladder = Question(schemes=("average-acceleration",), step_counts=(80,), mode_counts=(2,), reference_modes=6)
    by_jax, own = ladders.by_jax(study, {}, ladder, Work(1)), ladders.steps(study, {}, ladder, Work(1))
    assert float(by_jax["error"][0]) == pytest.approx(float(own["error"][0, 0, 0]), rel=1e-6)


# ---- fits and fronts ----


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
def test_fitted_order_of_clean_and_spoilt_errors(order: float) -> None:
    steps = np.array([50 * 2**k for k in range(9)])
    clean = 5e-3 * (50 / steps) ** order
    assert trade.fitted_order(steps, clean, 1e-15, order) == pytest.approx(order, abs=1e-9)
    spoilt = clean + 1e-13  # rounding
    spoilt[:2] = [0.03, 0.025]  # not resolved yet
    assert trade.fitted_order(steps, spoilt, 3e-12, order) == pytest.approx(order, abs=0.1)
    spoilt[:3] = np.nan  # diverged
    assert trade.fitted_order(steps, spoilt, 3e-12, order) == pytest.approx(order, abs=0.1)


def test_no_order_is_invented() -> None:
    steps = np.array([50, 100, 200, 400, 800])
    for errors in (
        np.full(5, np.nan),
        np.full(5, 1e-3),
        np.array([1e-2, 1e-5, 5e-3, 1e-6, 3e-3]),
        np.array([0.3, 0.2, 0.1, 1e-3, 2.5e-4]),
        np.array([1e-6, 2e-6, 4e-6, 8e-6, 2e-5]),
    ):
        for formal in (1, 2, 4):
            assert np.isnan(trade.fitted_order(steps, errors, 1e-9, formal)), errors


def test_the_front_is_what_no_other_point_beats() -> None:
    random = np.random.default_rng(1)
    errors, seconds = random.uniform(size=60), random.uniform(size=60)
    errors[:5] = np.inf
    beaten = {
        i
        for i, j in product(range(60), range(60))
        if (errors[j] <= errors[i] and seconds[j] < seconds[i]) or (errors[j] < errors[i] and seconds[j] <= seconds[i])
    }
    assert set(trade.front(errors, seconds)) == set(range(60)) - beaten - set(range(5))


def test_the_front_of_the_archive() -> None:
    dataset = precision.small()
    for scene, quantity in product(dataset.scene.values, dataset.quantity.values):
        marked = dataset.on_front.sel(scene=scene, quantity=quantity)
        points = trade.choices(dataset, scene, quantity)
        assert 0 < int(marked.sum()) <= len(points)
        best = np.inf
        for point in points:
            place = {"mode_count": point.modes, "correction": int(point.corrected), "scheme": point.scheme}
            on_it = bool(marked.sel(place | {"step_count": point.steps}))
            assert on_it == (point.error < best)
            best = min(best, point.error)


def test_a_point_that_was_not_timed_is_no_choice() -> None:
    """One that diverged with the static correction has no time, and may have an error without it."""
    dataset = precision.small().copy(deep=True)
    scene, quantity = dataset.scene.values[0], "history"
    before = trade.choices(dataset, scene, quantity)
    for place, name in enumerate(("seconds_per_variant", "total_seconds_per_variant")):
        dataset[name].loc[{"scene": scene, "scheme": "fox-goodwin", "step_count": 640}] = np.nan
        points = (trade.step_choices, trade.choices)[place](dataset, scene, quantity)
        assert points == sorted(points, key=lambda point: point.seconds)
        assert all((point.scheme, point.steps) != ("fox-goodwin", 640) for point in points)
    assert set(points) == {point for point in before if (point.scheme, point.steps) != ("fox-goodwin", 640)}


# ---- figures ----


def test_figures_are_drawn_with_what_there_is() -> None:
    nothing = precision.small().copy(deep=True)
    for name in ("error", "seconds_per_variant", "fitted_order", "total_error", "total_seconds_per_variant"):
        nothing[name].values[:, 1:] = np.nan
    for dataset in (precision.small(), nothing):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = answers.figures(dataset)
            assert not any(re.search(r"\bnan\b", figures.svg(figure)) for figure in found[:2])
        assert len({figure.name for figure in found}) == len(found) == 6
        none = dataset.assign(fitted_order=dataset.fitted_order.where(False))
        assert "orders" not in {figure.name for figure in answers.figures(none)}
        (legend,) = next(one for one in found if one.name == "cost").drawing.legends
        drawn = {text.get_text() for text in legend.get_texts()}
        for scheme in map(str, dataset.scheme.values):
            has_points = bool(dataset.error.sel(scheme=scheme, quantity="history").notnull().any())
            assert (advice.scheme_words(scheme) in drawn) == has_points
        (legend,) = next(one for one in found if one.name == "trade").drawing.legends
        assert any("automatic choice" in text.get_text() for text in legend.get_texts())
        for scene in dataset.scene.values:
            assert any(axes.get_title(loc="left") == scene for axes in found[0].drawing.axes)


# ---- what is refused ----


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('schemes = ["average"]', r"question.schemes.0: unknown name.*one of average-acceleration"),
        ('schemes = ["rk4", "rk4"]', r"question.schemes: an entry stands here twice"),
        ('schemes = ["rk4"]', r"question.schemes: .*at least one scheme of the march"),
        ("step_counts = [51]", r"question.step_counts.0: a Richardson pair halves.*an even number.*51"),
        ("step_counts = [100, 50]", r"question.step_counts: a list in ascending order"),
        ("step_counts = []", r"question.step_counts: a list of at least 1"),
        ("mode_counts = [0]", r"question.mode_counts.0: must be >= 1"),
        ("mode_counts = [65]", r"question.mode_counts.0: must be <= 64"),
        ("reference_modes = 3", r"question.reference_modes: must be >= 4"),
        ("mode_counts = [1, 8]\nreference_modes = 8", r"question.reference_modes: .*more than 8"),
        ("wanted = [2.0]", r"question.wanted.0: must be < 1"),
        ("tolerances = [1e-2, 1e-3]", r"question.tolerances: a list in ascending order"),
        ("mode_count = [1]", r'question.mode_count: unknown key.*did you mean "mode_counts"'),
        ("[question.scenes.a]\n'carriage.table.mas' = 3", r'question.scenes.a: .*table.mas: unknown key.*"mass"'),
        ("[question.scenes.a]\n'body.bed.modes' = 'few'", r"question.scenes.a: .*body.bed.modes"),
        (
            "[question.scenes.a]\n'carriage.tabel.mass' = 3",
            r'question.scenes.a.carriage.tabel.mass: no such carriage.*"table"',
        ),
        ("[question.scenes.a]\n'body.bad.length' = 3", r'question.scenes.a.body.bad.length: no such body.*"bed"'),
        ("[question.scenes.a]\n'sensor.midspam.at' = 3", r'question.scenes.a.sensor.midspam.at: no such .*"midspan"'),
        ("[question.scenes.a]\n'solver.steps' = 30", r"question.scenes.a.solver.steps: .*question.step_counts"),
        ("[solver]\nscheme = 'fox-goodwin'", r"solver.scheme: .*question.schemes"),
        ("[solver]\nscheme = 'hht-alpha'\nalpha = -0.3", r"solver.scheme: a study of work and precision varies this"),
        ("[solver]\nsteps = 400", r"solver.steps: .*question.step_counts"),
        ("[question.scenes.'!']", r"question.scenes.!: not a usable name"),
        ("[question.scenes.'a b']\n[question.scenes.a-b]", r"question.scenes.a b: not a usable name"),
        (
            "[question.scenes.a]\n'carriage.table.motion' = {kind='cruise', start=0, end=10, speed=1, after=2}",
            r"question.scenes.a: .*one smooth motion",
        ),
        (
            "[question.scenes.a]\n'carriage.table' = {on='bed', kind='force', force=1, "
            "motion={kind='cruise', start=0, end=10, speed=1}}",
            r"question.scenes.a: .*a mass with all of its terms",
        ),
        ("[question.scenes.a]\n'sensor.midspan.quantity' = 'velocity'", r"question.scenes.a: .*displacement"),
        ("[question.scenes.a]\n'body.bed.own_weight' = true", r"question.scenes.a: .*own weight"),
    ],
)
def test_bad_questions_are_refused(lines: str, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        studies.run(engine.load(precision.with_question(lines)))


def test_a_study_without_options_has_one_scene_and_everything() -> None:
    study = engine.load(precision.with_question(""))
    kind = studies.kind_named("work-precision")
    names = [piece.name for piece in kind.pieces(study)]
    automatic = [f"automatic-{tolerance}-the-scene" for tolerance in ("0-0001", "0-001", "0-01")]
    assert names == ["steps-the-scene", "solvers-the-scene", "modes-the-scene", *automatic]


def test_nothing_measured_is_refused() -> None:
    text = precision.TEXT
    start, end = text.index("[sensor.midspan]"), text.index("[question]")
    with pytest.raises(BadInput, match="nothing is measured"):
        studies.run(engine.load(text[:start] + text[end:]))
