"""Figures draw with any sweep, show what they say, and are safe to put into one page."""

import re
import warnings
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Drawing

import engine
import studies
from studies.pictures.common import figures
from studies.pictures.common import sweep_view as views
from studies.reporting import answers
from studies.results.results import Results
from tests.studies import at_rest, scenes

KINDS = tuple(scenes.MOTIONS)
MASS = 'mass = { of = "carriage.table.mass", values = [200, 50, 100] }'
DAMPING = 'zeta = { of = "body.bed.damping_ratio", values = [0.01, 0.05] }'
LENGTHS = 'area = { of = "body.bed.area", from = 0.01, to = 0.02, count = 3 }'


def sweeps(kind: str) -> dict[str, str]:
    """Sweeps of every shape: none, two or three axes, without a pace, unsorted, sampled; and, which the kinds do not
    tell apart, of one value, of the body alone, zipped. Of one axis: `tests.pictures.test_report`."""
    pace = scenes.pace(kind) if scenes.PACE[kind] else LENGTHS
    sobol = [re.sub(r"from = (\S+), to = (\S+), count = \d+", r"sobol = 5, from = \1, to = \2", scenes.pace("passage"))]
    sampled = sobol[0].replace(".speed", f".{scenes.PACE[kind]}") if scenes.PACE[kind] else ""
    alike = {
        "one value": 'mass = { of = "carriage.table.mass", values = [80] }',
        "body": f"{LENGTHS}\n{MASS}",
        "zipped": f'zip = true\n{MASS}\nzeta = {{ of = "body.bed.damping_ratio", values = [0.01, 0.02, 0.03] }}',
    }
    found = {
        "none": "",
        "two axes": f"{pace}\n{MASS}",
        "three axes": f"{MASS}\n{pace}\n{DAMPING}",
        "no pace": f"{MASS}\n{DAMPING}",
        "sampled": f'{sampled}\nmass = {{ of = "carriage.table.mass", sobol = 5, from = 10, to = 50 }}',
        "mixed": f'{pace}\nmass = {{ of = "carriage.table.mass", sobol = 5, from = 10, to = 50 }}',
    }
    return found | alike if kind == "passage" else found


@pytest.mark.parametrize(
    ("kind", "shape"), [(kind, shape) for kind in KINDS for shape in sweeps(kind) if shape != "two axes"]
)
def test_any_sweep_can_be_drawn(kind: str, shape: str) -> None:
    """Of two axes: the next test."""
    dataset = scenes.run(kind, sweeps(kind)[shape])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = answers.figures(dataset)
        for figure in found:
            assert figure.title and figures.plain_name(figure.name) == figure.name
    assert found and len({figure.name for figure in found}) == len(found)


@pytest.mark.fault(18)
@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_failed_variants_are_left_out_and_counted(kind: str, every: int) -> None:
    sweep = f"{scenes.pace(kind)}\n{MASS}" if scenes.PACE[kind] else MASS
    dataset = scenes.with_failures(scenes.run(kind, sweep), every)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = answers.figures(dataset)
        texts = [figures.svg(figure) for figure in found if every == 2]  # rendering takes a second each
    for text in texts:
        ElementTree.fromstring(text)
    assert not any(re.search(r"\bnan\b", text) for text in texts)
    counted = [figure for figure in found if "diverged (left out)" in figure.caption]
    assert counted or kind == "trajectory" or every == 1  # where nothing is left there may be nothing to draw


def test_the_lag_is_drawn_with_its_theory() -> None:
    dataset = scenes.run("asymmetry", f"{scenes.pace('asymmetry', 0.2, 1.0, 5)}\n{DAMPING}")
    figure = next(figure for figure in answers.figures(dataset) if figure.name == "lag")
    axes = figure.drawing.axes[0]
    solid = [line for line in axes.get_lines() if line.get_linestyle() == "-" and len(line.get_xdata()) == 5]
    dashed = [line for line in axes.get_lines() if line.get_linestyle() == "--" and len(line.get_xdata()) == 5]
    assert len(solid) == len(dashed) == 2
    for line, theory in zip(solid, dashed, strict=True):
        assert line.get_color() == theory.get_color()
        np.testing.assert_allclose(line.get_ydata(), theory.get_ydata(), rtol=0.3)
    expected = dataset.lag.sel(sensor="midspan", zeta=0.05).values
    assert any(np.allclose(np.abs(line.get_ydata() / expected), 1e3) for line in solid)


def test_panels_without_a_lag_are_left_out() -> None:
    """Of a wheel's force, which is the same all the way at rest, a dashed line and two empty panels were drawn."""
    dataset = scenes.run("asymmetry", f"{scenes.pace('asymmetry', 0.2, 1.0, 5)}\n{DAMPING}")
    for name in ("lag", "odd_rms", "even_excess"):
        dataset[name].loc[{"sensor": "moment"}] = np.nan
    told = {figure.name: figure for figure in answers.figures(dataset)}
    for name, panels in (("lag", 1), ("odd-and-even", 2)):
        assert len(told[name].drawing.axes) == panels
        assert "Not known of moment: at rest nothing changes there on the way." in told[name].caption


def test_unsorted_axes_are_drawn_in_order() -> None:
    results = Results.of(scenes.run("passage", MASS))
    (curve,) = views.view(results).curves(results.of_sensor("dynamic_amplification", "midspan"))
    assert curve.x.tolist() == [50.0, 100.0, 200.0]
    by_mass = results.of_sensor("dynamic_amplification", "midspan")
    assert curve.y.tolist() == [float(by_mass.sel(mass=mass)) for mass in (50, 100, 200)]


def test_the_lowest_panel_of_each_column_has_the_speeds() -> None:
    """Of what has no static value there is no amplification, so that the panel above is the lowest."""
    dataset = scenes.run("passage", scenes.pace("passage"), extra='[sensor.still]\nbody = "bed"\nat = 2.0')
    dataset["dynamic_amplification"].loc[{"sensor": "still"}] = np.nan
    largest = answers.figures(dataset)[0]
    midspan, gain, *_, still, none = (axes for axes in largest.drawing.axes if axes.get_subplotspec() is not None)
    assert not none.get_visible()
    lowest = [largest.drawing.axes[place] for place in (1, 2)]
    assert all(axes.get_xlabel() == "pace (m/s)" for axes in lowest)
    assert all(axes.xaxis.get_tick_params()["labelbottom"] for axes in lowest)
    assert not midspan.get_xlabel() and gain is lowest[0] and still is lowest[1]


@pytest.mark.parametrize(("middle", "scales"), [(5.0, []), (10.0, ["speed over the critical speed ω₁ L/π"])])
def test_a_scale_of_the_critical_speed_above_one_span_alone(middle: float, scales: list[str]) -> None:
    springs = ", ".join(f"{{ at = {at}, stiffness = 1e7 }}" for at in (0.0, middle, 10.0))
    text = scenes.text_of("passage", scenes.pace("passage"), extra="[solver]\nsteps = 400")
    text = text.replace('"pinned-pinned"', f"[{springs}]")
    dataset = studies.run(engine.load(text))
    assert dataset["speed_ratio"].dims == ("pace",)
    above = answers.figures(dataset)[0].drawing.axes[0].child_axes
    assert [axes.get_xlabel() for axes in above] == scales


def test_curves_of_a_moving_force_are_of_damping_and_not_of_what_multiplies_all() -> None:
    force = 'load = { of = "carriage.table.force", values = [1e3, 1.2e3] }'
    text = scenes.text_of("passage", f"{force}\n{scenes.pace('passage')}\n{DAMPING}")
    text = text.replace('kind = "mass"\nmass = 100.0', 'kind = "force"\nforce = 1e3')
    largest = answers.figures(studies.run(engine.load(text)))[0]
    legends = [legend for axes in largest.drawing.axes if (legend := axes.get_legend()) is not None]
    assert [legend.get_title().get_text() for legend in legends] == ["zeta"]
    assert "Held at load 1.2 kN (in the study file 1 kN)." in largest.caption


def test_curves_that_are_known_loosely_are_dashed_and_the_caption_says_which() -> None:
    dataset = scenes.run("passage", f"{scenes.pace('passage', count=20)}\n{DAMPING}")
    one = dataset["estimated_error"].sel(result="midspan_max").copy()
    one[5:9] = 0.4
    dataset["estimated_error"].loc[{"result": "midspan_max"}] = one
    found = {figure.name: figure for figure in answers.figures(dataset)}
    largest, moments = (found[f"largest-{name}"] for name in ("displacement", "bending-moment"))
    panels = largest.drawing.axes[:2]
    dashed = [sum(line.get_linestyle() == "--" for line in axes.lines) for axes in (*panels, *moments.drawing.axes[:2])]
    assert dashed[0] == dashed[1] > 0 and dashed[2:] == [0, 0]
    assert "Dashed: midspan estimated to within more than 5 %." in largest.caption
    solid = next(line for line in panels[0].lines if line.get_linestyle() == "-")
    assert np.isnan(np.asarray(solid.get_ydata(), dtype=float)).nonzero()[0].tolist() == [5, 6, 7, 8]


def test_a_history_that_is_known_loosely_is_told_in_its_caption() -> None:
    found = answers.figures(scenes.with_errors(scenes.run("passage", scenes.pace("passage")), 0.4, "moment"))
    response = next(figure for figure in found if figure.name == "response")
    assert response.caption.endswith(" moment: estimated to within 40 %.")


def test_a_caption_tells_what_is_held_beside_what_the_study_file_has() -> None:
    results = Results.of(scenes.run("passage", f"{scenes.pace('passage')}\n{MASS}\n{DAMPING}"))
    damping = results.axis(".damping_ratio")
    assert damping is not None
    ends = [views.view(results, y=(".mass",), at=(0, 0, place)).words for place in range(len(damping.values))]
    assert [text.removesuffix(".").partition(" (")[0] for text in ends] == [
        f"Held at {damping.at(place)}" for place in range(len(damping.values))
    ]
    own = np.isclose(damping.values, 0.03)
    assert ["in the study file 0.03" in text for text in ends] == (~own).tolist()


def test_svg_has_no_script_and_identifiers_of_its_own() -> None:
    dataset = scenes.run("passage", scenes.pace("passage"))
    found = answers.figures(dataset)
    identifiers = [set(re.findall(r'\bid="([^"]+)"', figures.svg(figure))) for figure in found]
    assert len(identifiers) > 1 and not set.intersection(*identifiers)
    for figure in found:
        text = figures.svg(figure)
        used = re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', text)
        defined = set(re.findall(r'\bid="([^"]+)"', text))
        assert used and all((first or second) in defined for first, second in used)
        assert text == figures.svg(figure)
        assert "<script" not in text and "<!--" not in text and "DOCTYPE" not in text


def test_every_file_takes_one_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing is what takes the time of a report."""
    figure, drawn, draw = answers.figures(scenes.run("passage"))[0], [], Drawing.draw
    monkeypatch.setattr(Drawing, "draw", lambda own, renderer: (drawn.append(own), draw(own, renderer)))
    first = figures.svg(figure), figures.png(figure)
    assert len(drawn) == 2
    assert (figures.svg(figure), figures.png(figure)) == first
    assert figure.drawing.dpi == 100.0 and isinstance(figure.drawing.canvas, FigureCanvasAgg)


@pytest.mark.fault(39)
def test_no_text_is_mathematics() -> None:
    """A label such as $\\frac{1}{0$ would raise, and $x$ would lose its dollars."""

    def fill(drawing: figures.Drawing) -> None:
        axes = drawing.subplots()
        axes.set_title(r"$\frac{1}{0$ <script>")
        axes.plot([1e-3, 1.0], [1e-3, 1e3], label="$x$")
        figures.logarithmic(axes.yaxis)
        axes.legend()

    figure = figures.draw("../../etc/passwd", "t", "c", 2.0, fill)
    assert figure.name == "etc-passwd"
    text = figures.svg(figure)
    assert "<script" not in text and "mathdefault" not in text
    assert len(figures.png(figure)) > 1000
    for label in figure.drawing.axes[0].get_yticklabels():
        assert "$" not in label.get_text()


@pytest.mark.parametrize(("times", "coarse"), [("[0, 1, 3]", False), ("[0, 100, 300]", True)])
def test_histories_with_too_few_instants_for_the_vibration_say_so(times: str, coarse: bool) -> None:
    text = scenes.text_of("trajectory").replace("times = [0, 1, 3]", f"times = {times}")
    sensors, *_ = answers.figures(studies.run(engine.load(text)))
    assert ("is not drawn as it is" in sensors.caption) == coarse


def test_directions_of_sensors_stand_on_axes_and_in_titles() -> None:
    """Named axes and vectors; moments are about them; what names none is along gravity."""
    way = {"kind": "cruise", "start": 0.0, "end": 4.0, "speed": 1.0}
    sensor = {
        "sway": {"body": "portal", "node": "left", "direction": "x"},
        "skew": {"body": "portal", "member": "column", "at": 1.0, "direction": [1, 0, -0.5]},
        "middle": {"body": "portal", "at": 2.0},
        "clamping": {"body": "portal", "node": "foot", "direction": "y", "quantity": "support_moment"},
    }
    dataset = studies.run(
        engine.Study(
            kind="passage",
            body={"portal": at_rest.PORTAL | {"damping_ratio": 0.02}},
            carriage={"car": {"on": "portal", "kind": "mass", "mass": 100.0, "motion": way}},
            sensor=sensor,
            sweep={"speed": {"of": "carriage.car.motion.speed", "values": [1.0, 2.0, 4.0]}},
            solver={"steps": 400, "audit": 0},
        )
    )
    results = Results.of(dataset)
    places = {"sway": "at left along x", "skew": "at 1 m of column along (1, 0, -0.5)", "middle": "at 2 m of portal"}
    assert {name: results.place(name) for name in sensor} == places | {"clamping": "at foot about y"}
    shown = next(one for one in answers.figures(dataset) if one.name == "largest-displacement")
    labels = {axes.get_ylabel().replace("\n", " ") for axes in shown.drawing.axes}
    assert any(label.startswith("largest displacement at 1 m of column along (1, 0, -0.5) (") for label in labels)
    assert results.label("sway", "mm", "largest").replace("\n", " ") == "largest displacement at left along x (mm)"
