"""What is allowed and yet often a mistake is remarked."""

from typing import Any

import pytest

from engine.batch.plan import make_plan
from engine.batch.plausibility import REMARKS, remarks
from engine.scene.study import Study
from tests.batch.test_plan import swept
from tests.engine.build import beam, cruise, fixed, force, mass, oscillator, shuttle, study
from tests.engine.gantries import gantry
from tests.studies.at_rest import PORTAL

WAY = cruise(0.0, 1.0, 0.5)
SWING = {"amplitude": 0.5, "frequency": 1.0}


def passing(bed: Any = None, car: Any = None, **changes: Any) -> Study:
    return study(bed or beam(), car or mass(0.1, WAY), gravity=0.1, **changes)


def on_portal(portal: dict[str, Any] | None = None, **more: Any) -> Study:
    """A mass over a portal that sways."""
    car = mass(20.0, shuttle(1.0, 3.0, 0.5, 0.2, 1), on="portal") | more
    return Study(schema_version=1, kind="passage", body={"portal": PORTAL | (portal or {})}, carriage={"car": car})


STRAIGHT = {
    **{"kind": "frame", "plane": "xz", "node": {"a": [0, 0], "b": [1, 0], "c": [2, 0]}},
    "section": {"box": {"area": 1.0, "second_moment": 0.1, "youngs_modulus": 1.0, "density": 1.0}},
    "member": {name: {"nodes": [*name], "section": "box"} for name in ("ab", "bc")},
    **{"supports": {"a": "pinned", "b": ["z"], "c": ["z"]}, "track": {"members": ["ab", "bc"]}},
}


def in_a_row(axles: int, after: float, end: float = 1.0) -> Study:
    """So many axles that cross the bed."""
    tram = mass(2e-2, WAY | {"after": after, "end": end}, axles=axles, spacing=0.1)
    return study(beam(), {}, train={"tram": tram}, gravity=0.1)


def on_wheels(**front: Any) -> Study:
    """A bar that lies across, on two wheels at its beginning and one at its end."""
    wheel = {"at": 0.0, "stiffness": 1e3}
    contacts = {
        "rear": wheel | {"offset": -0.1},
        "front": wheel | {"offset": 0.1} | front,
        "far": wheel | {"at": 0.5, "offset": 0.0},
    }
    bar = {"kind": "rigid", "length": 0.5, "mass": 0.1, "inertia": 0.01}
    car = {"kind": "body", "on": "bed", "body": "bar", "contacts": contacts, "motion": cruise(0.2, 0.8, 0.5)}
    return Study(schema_version=1, kind="passage", gravity=0.1, body={"bed": beam(), "bar": bar}, carriage={"car": car})


STOP = {"kind": "point-to-point", "start": 0.1, "end": 0.9, "speed": 1.0, "acceleration": 2.0, "dwell": 5.0}
ON_THREE = beam(supports=[{"at": at, "stiffness": 300.0} for at in (0.0, 0.45, 1.0)])
LOW = fixed(0.5, "velocity") | {"frequency_limit": "1 Hz"}
CASES = {
    "no carriage loads its body: gravity is 0": study(beam(), mass(1e-6, WAY), gravity=0.0),
    "damps its first mode by 9.87 of critical": passing(beam(damping_ratio={"rayleigh": [1e-5, 2.0]})),
    "210 GPa": passing(beam(youngs_modulus=210.0, density=7850.0)),
    "move away": passing(beam(supports="free-free")),
    "released undeformed": passing(beam(own_weight=True)),
    "leaves its body": passing(
        car=mass(0.1, {"kind": "waypoints", "times": [0.0, 2.0, 5.0], "positions": [0.1, 0.99, 0.99]})
    ),
    "critical speed": passing(car=mass(0.1, cruise(0.0, 1.0, 50.0))),
    "gravity = 0.00981 m/s2: this is a thousandth or a thousand times of what there is, expected 9.81 m/s2, or 0; did "
    'you mean "9.81 m/s^2"?': study(beam(), mass(0.1, WAY), gravity="9.81 mm/s^2"),
    "gravity = 9810 m/s2: this is a thousandth or a thousand times of what there is, expected 9.81 m/s2, or 0; did "
    'you mean "9810 mm/s^2"?': study(beam(), mass(0.1, WAY), gravity=9810.0),
    "carriage car runs at speeds up to 350 m/s (1,260 km/h): were km/h meant?": passing(
        beam(youngs_modulus=1e8),
        sweep={"speed": {"of": "carriage.car.motion.speed", "from": 100, "to": 350, "count": 2}},
    ),
    "up to 300 m/s (1,080 km/h): are the units right?": passing(
        beam(youngs_modulus=1e8), car=mass(0.1, {"kind": "waypoints", "times": [0.0, 5e-3], "positions": [0.0, 1.0]})
    ),
    "times its body": passing(car=mass(5.0, WAY)),
    "the load of carriage car presses with 0.0004 N, 0.4 % of the weight of bed, 0.1 N: were kilonewtons": passing(
        car=force(4e-4, WAY)
    ),
    "the loads of train tram together press with 0.0004 N, 0.4 % of the weight of bed, 0.1 N: are the units": study(
        beam(), {}, train={"tram": mass(2e-3, WAY, axles=2, spacing=0.1)}, gravity=0.1
    ),
    "no structure bends so far": passing(car=mass(1.9, WAY), bed=beam(youngs_modulus=0.0005)),
    "small-deflection": passing(car=mass(1.9, WAY), bed=beam(youngs_modulus=0.01)),
    "swings at 0.092 Hz on its spring: were kilonewtons per metre meant?": passing(car=oscillator(0.3, 0.1, WAY)),
    "sensor low reads 0 in some variants: the first frequency of bed, up to 1.571 Hz, is above": swept(
        "body.bed.youngs_modulus", [0.25, 1.0], force(3.0, WAY), sensor={"low": LOW}
    ),
    "sensor end reads 0: its body has no bending moment there, as at a support, a free end or by symmetry": passing(
        sensor={"end": fixed(1.0, "bending_moment")}
    ),
    "no place of envelope all is at 0.45 m of bed where bending_moment has a kink": passing(
        ON_THREE, envelope={"all": {"body": "bed", "quantity": "bending_moment", "places": 6}}
    ),
    "force that brakes car, up to 0.2 N, does not push bed along its track, nor bend it where": passing(
        car=mass(0.1, STOP), output={"residual": True}
    ),
    "acceleration of carriage car is not reached in 2 of 4 variants: it gets to 4 m/s2 there": swept(
        "carriage.car.motion.acceleration", [2.0, 4.0, 5.0, 6.0], mass(0.1, STOP | {"jerk": 16.0})
    ),
    "in a first period": passing(beam(modes=1), solver={"steps": 30}),
    "lasts 0.25 first periods of the body, so that residual": passing(
        beam(modes=1), mass(0.1, cruise(0.0, 1.0, 0.5, after=0.25)), output={"residual": True}
    ),
    "the run goes on for 1 first period of the body after the last axle of train tram has left": in_a_row(3, 1.0),
    "does not pitch, as contacts of it hold it at one place of its track: rear and front stay level": on_wheels(),
    "does not act along or across its track: if it did (carriage.car.inertia_along = true": on_portal(),
    "the track of body portal lies 250 m beside its axis, which is 4 m long: is the unit of": on_portal(
        portal={"track": PORTAL["track"] | {"offset": [0.0, 0.0, -250.0]}}
    ),
    "train tram is gone from 0.5 m on, where its cruise ends on a body of 1 m": in_a_row(3, 5.0, 0.5),
    "carriage car is gone from 0.3 m on, where its cruise ends on a body of 1 m": passing(
        car=mass(0.1, cruise(0.0, 0.3, 0.5))
    ),
    "1.01 Hz on its spring, is damped by up to 3.16 times what lets it swing: is its mass right": passing(
        car=oscillator(1.0, 40.0, WAY, damping=40.0)
    ),
    "is damped by 1.5e-05 of critical damping: its damping is in N s/m; of a damping ratio zeta it is 2 zeta": passing(
        car=oscillator(1.0, 1e6, WAY, damping=0.03)
    ),
    "loads step onto bed or off it within no time at 1 m, where it gives way, which strikes every mode": passing(
        beam(supports=[{"at": 0.0, "stiffness": 1e7}, {"at": 1.0, "stiffness": 50.0}]),
        sensor={"middle": fixed(0.5, "acceleration")},
    ),
    "car begins at 0 m of bed with its static deflection, as a study in which something stands or turns": study(
        beam(supports=[{"at": 0.0, "stiffness": 50.0}, {"at": 1.0, "stiffness": 1e7}]),
        {"car": mass(0.1, WAY), "absorber": oscillator(0.1, 2.0, {"kind": "standing", "at": 0.5})},
        sensor={"middle": fixed(0.5)},
    ),
    "body.bar.mass = 0.0001 kg: its radius of gyration is more than five times its length, expected at least": (
        on_wheels().with_values({"body.bar.mass": 1e-4})
    ),
    "carriage.car.contacts.far yields by 5 m under the weight that it bears: is its stiffness right?": (
        on_wheels().with_values({"carriage.car.contacts.far.stiffness": 1e-3})
    ),
    "body.bar.inertia = 1e-12 kg m2: next to nothing turns: on its contacts it swings so fast that no march": (
        on_wheels().with_values({"body.bar.inertia": 1e-12})
    ),
    "the force of carriage car is negative, so that it lifts: weights are positive": passing(car=force(-0.1, WAY)),
    "carriage car pulls for a part of each swing, as its amplitude, 2 N, is above its force": passing(
        car=force(1.0, WAY, pulsation={"amplitude": 2.0, "frequency": 1.0})
    ),
    "phases count from the run's start, not from when b sets off, so that persons of one pace walk in step": study(
        beam(),
        {name: force(1.0, WAY, pulsation=SWING, delay=delay) for name, delay in (("a", 0.0), ("b", 1.0))},
        sensor={"middle": fixed(0.5)},
    ),
    "settling_band of sensor place, 20 m, is more than a hundredth of bed: was a smaller unit meant?": passing(
        car=mass(0.1, STOP), output={"residual": True}, sensor={"place": fixed(0.4) | {"settling_band": 20.0}}
    ),
}


@pytest.mark.parametrize("words", CASES)
def test_remarked(words: str) -> None:
    assert any(words in sentence for sentence in remarks(make_plan(CASES[words])))


def test_an_ordinary_study_is_not_remarked() -> None:
    for quantity in ("displacement", "acceleration"):
        assert remarks(make_plan(passing(sensor={"middle": fixed(0.5, quantity)}))) == []
    assert remarks(make_plan(passing(car=mass(0.1, WAY | {"after": 1.0}), output={"residual": True}))) == []
    quick = passing(beam(youngs_modulus=1e8), car=mass(0.1, cruise(0.0, 1.0, 145.0)))
    assert not any("at speeds up to" in remark for remark in remarks(make_plan(quick)))
    assert remarks(make_plan(in_a_row(2, 1.0))) == remarks(make_plan(in_a_row(3, 5.0))) == []
    both = on_portal(inertia_along=True, inertia_across=True)
    assert remarks(make_plan(both)) == []
    assert remarks(make_plan(on_wheels(at=0.2))) == []
    assert remarks(make_plan(passing(car=mass(0.1, cruise(0.0, 0.9, 0.5))))) == []


@pytest.mark.parametrize("direction", [None, "x"])
def test_what_moves_along_a_straight_bridge_alone_is_not_remarked(direction: str | None) -> None:
    """Unless a sensor reads that way: a mass that acted along it would lower frequencies of these shapes alone."""
    sensor = {"end": {"body": "straight", "member": "ab", "at": 0.5} | ({"direction": direction} if direction else {})}
    car = mass(0.1, cruise(0.0, 2.0, 0.1), on="straight")
    found = Study(schema_version=1, kind="passage", body={"straight": STRAIGHT}, carriage={"car": car}, sensor=sensor)
    told = [text for text in remarks(make_plan(found)) if "does not act along its track" in text]
    assert len(told) == (direction is not None)


@pytest.mark.parametrize("speed", [145.0, "720 km/h"], ids=["not so fast", "with its unit"])
def test_speeds_are_not_always_remarked(speed: float | str) -> None:
    fast = passing(beam(youngs_modulus=1e8), car=mass(0.1, WAY | {"speed": speed}))
    assert not any("runs at speeds" in sentence for sentence in remarks(make_plan(fast)))


BRAKING = "the force that brakes car"
ON_CONTACTS = {
    **{"on": "bed", "kind": "body", "body": "table", "motion": STOP | {"start": 0.3, "end": 0.7}},
    "contacts": {"a": {"at": 0.0, "stiffness": 50.0}, "b": {"at": 0.2, "stiffness": 50.0}},
}
TABLE = beam(length=0.2, supports="free-free")


@pytest.mark.parametrize(
    ("braked", "words"),
    [
        (swept("carriage.car.motion.acceleration", [2.0, 4.0], mass(0.1, STOP), output={"residual": True}), "0.4 N"),
        (
            passing(car=mass(0.1, STOP), output={"residual": True}),
            "frames and imported models that sway, takes inertia_along = true",
        ),
        (
            study(beam(), ON_CONTACTS, body={"bed": beam(), "table": TABLE}, output={"residual": True}),
            "bodies on contacts never push along",
        ),
        (passing(car=mass(0.1, STOP)), ""),
        (passing(car=force(0.1, STOP), output={"residual": True}), ""),
        (passing(car=mass(0.1, STOP), output={"residual": True}, solver={"fidelity": "force"}), ""),
    ],
    ids=["swept", "on a beam", "a body on contacts", "no residual", "a plain force", "loads alone"],
)
def test_forces_that_brake_and_do_not_push_are_remarked(braked: Study, words: str) -> None:
    """Where residual vibration is asked for: it would be larger by what rings along the track."""
    told = [sentence for sentence in remarks(make_plan(braked)) if sentence.startswith(BRAKING)]
    assert len(told) == bool(words) and all(words in sentence for sentence in told)


def test_what_a_gantry_carries_is_braked_with_it() -> None:
    """The girder alone was told, and one of its two tracks."""
    crane = gantry(motion=STOP | {"start": 0.3, "end": 0.7}, output={"residual": True})
    (told,) = (sentence for sentence in remarks(make_plan(crane)) if "brakes crane" in sentence)
    assert "up to 2.2 N, does not push left and right along their tracks" in told  # (0.8 + 0.3) kg, 2 m/s2


def test_braking_on_frames_is_remarked_once() -> None:
    """Where frequencies would be lower that is told; on a straight bridge held along the key is named."""

    def told(body: Any, end: float, **more: Any) -> list[str]:
        car = mass(20.0, STOP | {"start": 0.5, "end": end}, on="frame") | more
        sensor = {"end": {"under": "car"}}
        tables = {"body": {"frame": body}, "carriage": {"car": car}, "sensor": sensor, "output": {"residual": True}}
        return remarks(make_plan(Study(schema_version=1, kind="passage", **tables)))

    (whole,) = (text for text in told(PORTAL, 3.0) if "its track" in text)
    assert f"; {BRAKING}, up to 40 N, does not push along it either" in whole
    (alone,) = (text for text in told(STRAIGHT, 1.5) if BRAKING in text)
    assert "carriage.car.inertia_along = true brings it" in alone
    assert not any(BRAKING in text for text in told(STRAIGHT, 1.5, inertia_along=True))


@pytest.mark.parametrize(
    ("key", "values", "jerk", "words"),
    [
        ("acceleration", [1.0, 4.0], 16.0, ""),
        ("acceleration", [1.0, 900.0], None, ""),
        ("jerk", [1.0, 4.0], 4.0, ""),
        ("speed", [0.5, 2.0, 3.0], None, "of carriage car is not reached in 2 of 3 variants: it gets to 1.265"),
    ],
)
def test_swept_limits_that_are_not_reached_are_remarked(
    key: str, values: list[float], jerk: float | None, words: str
) -> None:
    """0.8 m from rest to rest: the speed gets to sqrt(a d), the acceleration to sqrt(v j) with a jerk alone."""
    given = swept(f"carriage.car.motion.{key}", values, mass(0.1, STOP | ({"jerk": jerk} if jerk else {})))
    told = [sentence for sentence in remarks(make_plan(given)) if "is not reached" in sentence]
    assert len(told) == bool(words) and all(words in sentence for sentence in told)


SWEPT_LOAD = {"of": "carriage.car.force"}


@pytest.mark.parametrize(
    "light",
    [
        passing(car=force(0, WAY) | {"force": "0.4 mN"}),
        passing(car=force(4e-4, WAY), sweep={"load": SWEPT_LOAD | {"values": [4e-4, 0.02]}}),
        passing(car=force(4e-4, WAY), sweep={"load": SWEPT_LOAD | {"from": "0.1 mN", "to": "0.4 mN", "count": 2}}),
    ],
    ids=["with its unit", "heavier in another variant", "swept with its unit"],
)
def test_light_loads_are_not_always_remarked(light: Study) -> None:
    assert remarks(make_plan(light)) == []


def test_every_remark_has_its_case() -> None:
    assert len(CASES) > len(REMARKS)
