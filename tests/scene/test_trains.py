"""Trains: every axle is the carriage that could have been written by itself, and one key sweeps all of them."""

from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.batch.plan import make_plan
from engine.observation.contact_forces import contacts_that_react
from engine.scene.study import Study, load
from engine.scene.sweep import expand
from results_schema.errors import BadInput
from studies.commands.preview import preview
from studies.protocol.study import kind_of
from studies.reporting.drawing import page_of
from studies.reporting.summary import in_tables
from studies.results.findings_common import told_trains
from studies.results.formatting import number
from studies.results.results import Results
from tests.engine.build import aboard, beam, cruise, fixed, force, mass, oscillator, study, under

WAY = cruise(0.0, 1.0, 0.8)
TEXT = """\
schema_version = 1
kind = "passage"

[body.bed]
kind = "beam"
length = 15.0
area = 0.01
second_moment = 8.33e-6
youngs_modulus = "210 GPa"
density = 7850
supports = "pinned-pinned"

[train.tram]
on = "bed"
kind = "force"
force = "10 kN"
axles = 3
spacing = 2.0

[train.tram.motion]
kind = "cruise"
start = 0
end = 15
speed = 10

[sensor.midspan]
body = "bed"
at = 7.5

[sweep]
speed = { of = "train.tram.motion.speed", values = [5, 10] }
"""


def train(table: dict[str, Any], **changes: Any) -> Study:
    return study(beam(), {}, train={"tram": table}, **changes)


def axles(tables: list[dict[str, Any]], distances: list[float], **changes: Any) -> Study:
    """The same carriages as separate tables."""
    trailing = ({} if axle == 0 else {"headway": distance} for axle, distance in enumerate(distances))
    riding = {f"tram_{n + 1}": table | own for n, (table, own) in enumerate(zip(tables, trailing, strict=True))}
    return study(beam(), riding, **changes)


def swept(**axes: dict[str, Any]) -> dict[str, Any]:
    return {"sweep": axes, "solver": {"audit": 0}, "sensor": {"under": under("tram_2")}}


def same(one: Study, other: Study) -> None:
    """Bit for bit, whatever the sweep's keys are."""
    first, second = engine.run(one), engine.run(other)
    assert (first.status == 0).all()
    assert first.drop_attrs().identical(second.drop_attrs())


SPEED = [0.4, 0.8]
REGULAR = {"axles": 3, "spacing": 0.3}


def test_forces_with_speed_and_force_swept() -> None:
    keys = [f"carriage.tram_{n}" for n in (1, 2, 3)]
    written = swept(
        speed={"of": [f"{key}.motion.speed" for key in keys], "values": SPEED},
        force={"of": [f"{key}.force" for key in keys], "values": [1.0, 3.0]},
    )
    short = swept(
        speed={"of": "train.tram.motion.speed", "values": SPEED}, force={"of": "train.tram.force", "values": [1.0, 3.0]}
    )
    same(train(force(2.0, WAY) | REGULAR, **short), axles([force(2.0, WAY)] * 3, [0.0, 0.3, 0.6], **written))


STOPPING = {"kind": "point-to-point", "speed": 0.8, "acceleration": 2.0, "dwell": 0.2}
TURNING = {"kind": "out-and-back", "speed": 0.8, "turn": 0.2, "cycles": 2}


@pytest.mark.parametrize("motion", [STOPPING, TURNING], ids=["point-to-point", "out-and-back"])
@pytest.mark.parametrize(("start", "end"), [(0.4, 0.9), (0.6, 0.1)])
def test_axles_that_stay_on_the_bed_start_and_stop_as_far_behind(
    motion: dict[str, Any], start: float, end: float
) -> None:
    way = {key: value for key, value in motion.items() if key != "kind"}
    keys, behind = [f"carriage.tram_{n}" for n in (1, 2)], 0.3 * np.sign(end - start)
    both = [
        mass(0.2, {"kind": motion["kind"], "start": s, "end": e, **way})
        for s, e in ((start, end), (start - behind, end - behind))
    ]
    written = swept(speed={"of": [f"{key}.motion.speed" for key in keys], "values": SPEED})
    short = swept(speed={"of": "train.tram.motion.speed", "values": SPEED})
    alone = study(beam(), dict(zip(("tram_1", "tram_2"), both, strict=True)), **written)
    same(train(both[0] | {"axles": 2, "spacing": 0.3}, **short), alone)


@pytest.mark.parametrize("spacing", [0.1, 0.3, 0.7])
def test_swept_spacings_are_those_of_carriages(spacing: float) -> None:
    """Of masses, one value after another, as separate carriages have no key for it."""
    short = swept(spacing={"of": "train.tram.spacing", "values": [0.1, 0.3, 0.7]})
    found = engine.run(train(mass(0.2, WAY) | REGULAR, **short, output={"histories": "none"}))
    alone = engine.run(
        axles([mass(0.2, WAY)] * 3, [0.0, spacing, 2 * spacing], sensor={"under": under("tram_2")}, solver={"audit": 0})
    )
    exact = {"under_max", "under_min", "tram_3_contact_force_max"}
    assert all(float(found[name].sel(spacing=spacing)) == float(alone[name]) for name in exact)


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.1])
def test_a_train_that_sets_off_later_starts_further_back(delay: float) -> None:
    """Against another one; both from a start as far behind as it would go meanwhile, to what is told of errors."""
    lead, late = {"lead": mass(0.3, WAY)}, mass(0.2, cruise(1.0, 0.0, 0.5)) | REGULAR
    sensor, swept = {"middle": fixed(0.5)}, {"delay": {"of": "train.tram.delay", "values": [0.0, 0.4, 1.1]}}
    found = studies.run(study(beam(), lead, train={"tram": late}, sensor=sensor, sweep=swept)).sel(delay=delay)
    behind = late | {"motion": cruise(1.0 + 0.5 * delay, 0.0, 0.5)}
    alone = studies.run(study(beam(), lead, train={"tram": behind}, sensor=sensor))
    for name in ("middle_max", "middle_min", "tram_2_contact_force_max"):
        told = [float(one["estimated_error"].sel(result=name)) for one in (found, alone)]
        scale = max(abs(float(alone["middle_max"])), abs(float(alone[name])))
        assert float(found[name]) == pytest.approx(float(alone[name]), abs=scale * sum(told) + 1e-9)


def test_lists_of_sprung_masses_and_their_scales() -> None:
    lists = {"mass": [0.2, 0.1], "wheel_mass": 0.05, "spacing": [0.25], "load_scale": 2.0, "spacing_scale": 2.0}
    table = {key: value for key, value in oscillator(1.0, 40.0, WAY).items() if key != "mass"} | lists
    written = [oscillator(kilograms, 40.0, WAY, wheel_mass=0.1) for kilograms in (0.4, 0.2)]
    sensors = {"sensor": {"body": aboard("tram_2")}, "solver": {"audit": 0}}
    same(train(table, **sensors), axles(written, [0.0, 0.5], **sensors))


@pytest.mark.parametrize(
    ("key", "targets"),
    [
        ("spacing_scale", {"tram_2.headway": 0.25, "tram_3.headway": 0.75}),
        ("load_scale", {"tram_1.mass": 3.0, "tram_2.mass": 2.0, "tram_3.mass": 1.0}),
        ("mass.1", {"tram_2.mass": 5.0}),
        ("stiffness", {f"tram_{n}.stiffness": 1.0 for n in (1, 2, 3)}),
        ("motion.start", {f"tram_{n}.motion.start": 1 for n in (1, 2, 3)}),
        ("delay", {f"tram_{n}.delay": 1 for n in (1, 2, 3)}),
        ("axles", {}),
        ("spacing.0", {}),
    ],
)
def test_what_a_key_sets(key: str, targets: dict[str, float]) -> None:
    """A wheel without mass stays one: it would count as inertia."""
    table = oscillator(1.0, 40.0, WAY) | {"mass": [3.0, 2.0, 1.0], "spacing": [0.25, 0.5], "load_scale": 5.0}
    expected = {f"carriage.{path}": factor for path, factor in targets.items()}
    assert train(table).targets(f"train.tram.{key}") == expected


def test_one_variant_as_a_study_of_its_own() -> None:
    text = TEXT.replace("speed = {", 'spacing = { of = "train.tram.spacing", values = [1.5] }\nspeed = {')
    whole = load(text)
    one = expand(whole).study_of(whole, 1)
    assert one.value("carriage.tram_3.headway") == 3.0 and one.value("carriage.tram_2.motion.speed") == 10.0
    assert load(one.source.text).carriage == one.carriage
    assert list(whole.data) == ["schema_version", "kind", "body", "train", "sensor", "sweep"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("axles = 3", "axle = 3", ["train.tram.axle:", "unknown key", '"axles"']),
        ("axles = 3\n", "", ["train.tram:", "number of axles"]),
        ("axles = 3", "axles = 201", ["train.tram.axles", "<= 200"]),
        ("spacing = 2.0", "spacing = [2.0]", ["train.tram", "axles = 2", "axles = 3"]),
        ("spacing = 2.0", "spacing = [2.0, -1.0]", ["train.tram.spacing.1", "> 0"]),
        ("spacing = 2.0", 'spacing = "2 kg"', ["train.tram.spacing", "a length (m)"]),
        ('force = "10 kN"', 'force = ["10 kN", 5]', ["train.tram", "force", "3 numbers", "2 numbers"]),
        ('force = "10 kN"', 'force = ["10 kN"]', ["train.tram", "a list with one", "received a list of 1 number"]),
        ('on = "bed"', 'on = "bad"', ["train.tram.on", '"bed"']),
        ('"force"', '"body"', ["train.tram.kind", "force, mass, oscillator"]),
        ("end = 15\n", "end = 0\n", ["train.tram.motion.end", "train.tram.motion.start = 0"]),
        (
            'kind = "cruise"\nstart = 0\nend = 15\nspeed = 10',
            'kind = "sinusoidal"\ncentre = 7\namplitude = 1\nfrequency = 1\ncycles = 1',
            ["train.tram.motion", "distances", "cruise"],
        ),
        (
            'kind = "cruise"\nstart = 0\nend = 15\nspeed = 10',
            'kind = "point-to-point"\nstart = 3\nend = 15\nspeed = 10\nacceleration = 1',
            ["train.tram:", "last axle", "1 m further on"],
        ),
        (
            'kind = "cruise"\nstart = 0\nend = 15\nspeed = 10\n\n[sensor.midspan]\nbody = "bed"\nat = 7.5\n\n'
            '[sweep]\nspeed = { of = "train.tram.motion.speed"',
            'kind = "out-and-back"\nstart = 4\nend = 15\nspeed = 10\nturn = 0.1\ncycles = 1\n\n[sensor.midspan]\n'
            'body = "bed"\nat = 7.5\n\n[sweep]\nspeed = { of = "train.tram.spacing"',
            ["sweep.speed.of", "cannot be swept", "not where that begins"],
        ),
        ("train.tram.motion.speed", "train.tram.axles", ["sweep.speed.of", "cannot be swept", "spacing_scale"]),
        ("train.tram.motion.speed", "train.tram.spacin", ["sweep.speed.of", '"train.tram.spacing"']),
        (
            "[sensor.midspan]",
            '[carriage.tram_2]\non = "bed"\nkind = "mass"\n[sensor.midspan]',
            ["carriage.tram_2", "two carriages", "train.tram"],
        ),
        (
            "[sensor.midspan]",
            "[carriage]\ntram_2 = 5\n[sensor.midspan]",
            ["train.tram: a table is wanted", "received 5"],
        ),
        (
            "[sweep]",
            '[sweep]\nall = { of = "carriage.tram_2.motion.speed", values = [1] }',
            ["sweep.all.of", "moves with its train"],
        ),
        (
            "[sweep]",
            '[sweep]\nend = { of = "train.tram.motion.end", values = [0] }',
            ["train.tram.motion.end", "end entry"],
        ),
    ],
)
def test_words(old: str, new: str, words: list[str]) -> None:
    assert old in TEXT
    with pytest.raises(BadInput) as error:
        expand(load(TEXT.replace(old, new, 1)))
    assert all(word in str(error.value) for word in words), str(error.value)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        (
            "train.tram.force",
            ['"train.tram.force.0" to "train.tram.force.2"', '"train.tram.load_scale" multiplies all'],
        ),
        ("train.tram.spacing", ['"train.tram.spacing.0" to "train.tram.spacing.1"']),
    ],
)
def test_who_sweeps_a_list_is_told_of_its_numbers(path: str, words: list[str]) -> None:
    own = {"kind": "force", "on": "bed", "force": [2e4, 1e4, 1e4], "spacing": [0.2, 0.1], "motion": WAY}
    with pytest.raises(BadInput) as caught:
        expand(train(own, sweep={"load": {"of": path, "values": [1.0, 2.0]}}))
    assert all(word in str(caught.value) for word in ["sweep.load.of", *words]), str(caught.value)
    assert ("load_scale" in str(caught.value)) == (path == "train.tram.force")


@pytest.mark.parametrize(
    ("own", "words"),
    [
        (
            {"kind": "force", "force": [2e4, 1e4, 1e4], "spacing": [3.0, 1.5]},
            "3 axles, 4.5 m from first to last, 40 kN",
        ),
        ({"kind": "force", "force": 1e3, "axles": 11, "spacing": 2.0}, "11 axles, 20 m from first to last, 11 kN"),
        (
            {"kind": "oscillator", "mass": 80.0, "wheel_mass": 20.0, "stiffness": 1e4, "spacing": [1.0]}
            | {"load_scale": 2.0, "spacing_scale": 3.0},
            "2 axles, 3 m from first to last, 400 kg",
        ),
    ],
)
def test_a_train_is_told_with_its_axles_length_and_load(own: dict[str, Any], words: str) -> None:
    """One number too many in a list of spacings is seen before anything is run."""
    assert told_trains(train({"on": "bed", "motion": WAY} | own)) == [("train tram", words)]


def test_check_and_draw_tell_the_trains() -> None:
    given = train(force(1e4, WAY) | REGULAR, solver={"steps": 200, "audit": 0})
    (told,) = told_trains(given)
    assert told in preview(kind_of(given).parts(given), 1).tables[0].rows
    assert told in [(row.name, row.value) for row in page_of(given, ()).facts]


def test_tables_show_the_axles_with_the_largest_and_the_smallest_contact_force() -> None:
    sweep = {"speed": {"of": "train.tram.motion.speed", "values": SPEED}}
    results = Results.of(studies.run(train(mass(0.2, WAY) | REGULAR, kind="passage", sweep=sweep)))
    forces = {f"tram_{n}_contact_force_{end}" for n in (1, 2, 3) for end in ("min", "max")}
    assert forces <= set(results.dataset.data_vars)
    values = {name: results.dataset[name].values for name in forces}
    largest = max((name for name in forces if name.endswith("max")), key=lambda name: values[name].max())
    smallest = min((name for name in forces if name.endswith("min")), key=lambda name: values[name].min())
    assert {one.name for one in in_tables(results)} & forces == {largest, smallest}


def test_forces_press_as_they_are_written() -> None:
    """From the end of the body on that they come from; no march observes it."""
    whole = train(force(2.0, cruise(-0.3, 1.4, 0.8)) | REGULAR)
    found, (grid,) = engine.run(whole), make_plan(whole).grids
    for name in ("tram_1", "tram_2", "tram_3"):
        assert float(found[f"{name}_contact_force_max"]) == float(found[f"{name}_contact_force_min"]) == 2.0
        assert float(found[f"{name}_contact_force_min_position"]) == pytest.approx(0.0, abs=1e-12)
        assert np.isnan(found[f"{name}_separation_position"])
    assert not contacts_that_react(grid.scene)


def test_check_tells_speeds_at_which_axles_push_in_step() -> None:
    """Near f d of the first frequency pi/2 sqrt(E I/(rho A))/L^2, where it swings most as its half-wave is crossed so,
    in the unit of the sweep, the strongest marked; the second mode does not move the middle, and others hardly. Not
    where all axles come within one period."""
    whole = load(TEXT.replace("[5, 10]", '["7 km/h", "130 km/h"]').replace("spacing = 2.0", "spacing = 4.0"))
    tables = preview(kind_of(whole).parts(whole), 1).tables
    (table,) = [table for table in tables if "in step" in table.title]
    assert table.headings == ("speed", "frequency", "way in a period", "part of its load", "swing of its mode")
    first = np.pi / 2.0 * np.sqrt(210e9 * 8.33e-6 / (7850.0 * 0.01)) / 15.0**2
    parts = whole.train["tram"].in_step(np.array([8.0, 4.0, 8.0 / 3.0]))
    assert parts.tolist() == pytest.approx([1.0 / 3.0, 1.0, 1.0 / 3.0])
    ways = np.geomspace(7.0 / 3.6 / first, 12.0, 200_000)
    k = 2.0 * np.pi / ways
    share = np.abs(1.0 + 2.0 * np.cos(4.0 * k)) / 3.0
    swing = share * np.abs((1.0 + np.exp(15j * k)) * np.pi / 15.0 / ((np.pi / 15.0) ** 2 - k**2)) * k
    most = 1 + np.flatnonzero((swing[1:-1] > swing[:-2]) & (swing[1:-1] > swing[2:]) & (share[1:-1] > 0.3))[::-1]
    assert [row[1] for row in table.rows] == [f"{number(first)} Hz"] * most.size
    told = np.array([[float(word.split(" ")[0]) for word in (row[0], *row[2:4])] for row in table.rows])
    np.testing.assert_allclose(
        told[:, 0], 3.6 * first * ways[most], rtol=6e-3
    )  # three digits, in which percents have two
    np.testing.assert_allclose(told[:, 1], ways[most], rtol=6e-3)
    np.testing.assert_allclose(told[:, 2], 100.0 * share[most], atol=1.0)
    assert ways[most].max() < 8.0 and np.abs(ways[most] - 4.0).min() < 0.25
    assert [", the strongest" in row[4] for row in table.rows] == [
        place == np.argmax(swing[most]) for place in range(most.size)
    ]


def test_check_tells_a_resonance_just_beyond_the_sweep() -> None:
    """Which is not the strongest within it."""
    first = np.pi / 2.0 * np.sqrt(210e9 * 8.33e-6 / (7850.0 * 0.01)) / 15.0**2
    whole = load(TEXT.replace("[5, 10]", f"[3, {0.95 * 4.0 * first}]").replace("spacing = 2.0", "spacing = 4.0"))
    (table,) = [table for table in preview(kind_of(whole).parts(whole), 1).tables if "in step" in table.title]
    beyond, *within = table.rows
    assert ", beyond" in beyond[0] and "strongest" not in beyond[4]
    assert within and not any("beyond" in row[0] for row in within)
    assert sum("the strongest" in row[4] for row in within) == 1


def test_equal_trains_push_in_step_at_equal_speeds() -> None:
    """The second one sets off further back, so that its way is longer."""
    second = TEXT.replace("train.tram", "train.other").split("[train.other]")[1].split("[sensor")[0]
    speeds = 'speed = { of = ["train.tram.motion.speed", "train.other.motion.speed"], values = [1, 60] }'
    text = TEXT.replace("[sensor", f"[train.other]{second.replace('start = 0', 'start = -12')}[sensor")
    both = load(text.replace('speed = { of = "train.tram.motion.speed", values = [5, 10] }', speeds))
    first, other = (t for t in preview(kind_of(both).parts(both), 1).tables if "in step" in t.title)
    assert first.rows and first.rows == other.rows


@pytest.mark.parametrize(
    ("path", "meant"),
    [
        ("carriage.tram.motion.speed", "train.tram.motion.speed"),
        ("carriage.tram_2.motion.speed", "train.tram.motion.speed"),
        ("carriage.tram_2.headway", "train.tram.spacing"),
    ],
)
def test_no_axle_is_swept_away_from_its_train(path: str, meant: str) -> None:
    """Neither is it proposed to somebody who names the train a carriage."""
    train = {"on": "bed", "kind": "force", "force": 2.0, "axles": 2, "spacing": 0.2, "motion": WAY}
    swept = {"speed": {"of": path, "values": [0.5, 0.8]}}
    with pytest.raises(BadInput) as caught:
        expand(Study(kind="passage", body={"bed": beam()}, train={"tram": train}, sweep=swept))
    assert meant in str(caught.value)


@pytest.mark.parametrize("way", [cruise(0.0, 1.0, 0.8), cruise(1.0, 0.0, 0.8), STOPPING | {"start": 0.4, "end": 0.9}])
def test_at_rest_axles_stand_behind_the_first(way: dict[str, Any]) -> None:
    """Readings of a train are those of its forces one by one, also of axles that are not on the bed yet."""
    start, end, places = way["start"], way["end"], [0.1, 0.35, 0.6, 0.95]
    train = {"on": "bed", "kind": "force", "force": [2.0, 3.0], "axles": 2, "spacing": 0.3, "motion": way}
    sensor = {"midspan": {"body": "bed", "at": 0.5}}
    common: dict[str, Any] = {"kind": "influence", "body": {"bed": beam()}, "sensor": sensor}
    found = studies.run(Study(train={"tram": train}, question={"positions": places}, **common))
    behind = [place - 0.3 * np.sign(end - start) for place in places]
    on = [place for place in behind if 0.0 <= place <= 1.0]
    load = {"on": "bed", "kind": "force", "force": 1.0, "motion": way}
    single = studies.run(Study(carriage={"car": load}, question={"positions": sorted({*places, *on})}, **common))
    line = single["midspan"] if "midspan" in single else single["reading"].sel(sensor="midspan")
    told = found["midspan"] if "midspan" in found else found["reading"].sel(sensor="midspan")
    for row, (place, last) in enumerate(zip(places, behind, strict=True)):
        expected = 2.0 * line.sel(position=place) + (3.0 * line.sel(position=last) if last in on else 0.0)
        assert float(told[row]) == pytest.approx(float(expected), rel=1e-9)
