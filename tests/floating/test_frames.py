"""Frames that are driven, hinged and free: closed forms, conserved quantities, published numbers, another
formulation."""

import numpy as np
import pytest

from engine.floating.march import march
from engine.floating.model import build
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.errors import BadInput
from results_schema.status import Status
from tests.floating.scenes import ARM, AVERAGE_ACCELERATION, FLYER, FOX_GOODWIN, SPIN_UP, history, steps
from tests.naive.particles_in_frames import Particles, beam_in_plane


def arm(frame: dict[str, object], **body: object) -> Study:
    sensor = {"tip": {"body": "arm", "at": 10.0}}
    return Study(kind="moving-frames", gravity=0.0, body={"arm": ARM | body}, frame={"arm": frame}, sensor=sensor)


def test_spin_up_of_kane_ryan_and_banerjee() -> None:
    """Largest lag of the tip and its time, ringing after 15 s, steady extension with axial modes: within 0.2 %."""
    model, marched = steps(arm({"stiffening": True, "axial_modes": 3, "joints": [SPIN_UP]}), 20.0, 8000)
    times, tip = marched.times[0], history(model, marched, "sensors")[:, 0]
    k = int(np.argmax(tip))
    assert (tip[k], times[k]) == pytest.approx((0.57437, 6.76), rel=2e-3)
    assert np.abs(tip[times > 15.0]).max() == pytest.approx(3.65e-3, rel=5e-3)
    end = history(model, marched, "ends", 0, 3)[times > 15.0]
    assert (np.hypot(end[:, 0], end[:, 2]) - 10.0).mean() == pytest.approx(5.143e-4, rel=2e-3)


@pytest.mark.parametrize("load", [0.1, 1.0])
def test_a_smooth_start_is_marched_at_every_rate(load: float) -> None:
    """The acceleration that is given at the start is a difference of two numbers that are equal but for rounding."""
    way = {"kind": "waypoints", "times": [0, 15], "positions": [2, 8]}
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"arm": ARM},
        frame={"arm": {"stiffening": True, "joints": [SPIN_UP]}},
        carriage={"load": {"on": "arm", "kind": "mass", "mass": load, "motion": way}},
        question={"duration": 20.0},
    )
    rates = np.linspace(1.0, 6.0, 160)  # 1.094, 3.453 and 4.428 gave up in the first step
    values = VariantValues(study, {"frame.arm.joints.0.motion.rate": rates}, rates.size)
    for count in (80, 160):
        found = march(build(study), values, np.full(rates.size, 2.0), count, np.zeros(1, int), AVERAGE_ACCELERATION)
        assert (found.status == 0).all()


@pytest.mark.fault(17)
def test_spin_up_without_stiffening_diverges() -> None:
    """Above its first frequency, 3.8 rad/s, a spinning arm without stiffening has none left."""
    _, marched = steps(arm({"joints": [SPIN_UP]}), 20.0, 4000)
    assert marched.status[0] == Status.DIVERGED
    assert marched.times[0][marched.last[0]] > 8.0  # s: the rate passes 3.8 rad/s at 8.9 s


@pytest.mark.parametrize(
    ("eta", "out_of_plane"),
    [(2.0, (4.1373, 22.6149, 62.2732)), (6.0, (7.3604, 26.8091, 66.6839)), (12.0, (13.1702, 37.6031, 79.6145))],
)
def test_frequencies_of_a_rotating_cantilever(eta: float, out_of_plane: tuple[float, ...]) -> None:
    """Wright et al. (1982), out of the plane of rotation and in it (mu^2 - eta^2), by the model's matrices; 0.1 %."""
    model = build(arm({"stiffening": True, "joints": [SPIN_UP]}, modes=10))
    body = model.bodies["arm"]
    unit = np.sqrt(7e10 * 2e-7 / 1.2) / 100.0
    assert body.shortening is not None
    along = body.shortening.integrals[1][0, 0]
    stiffness = np.diag(body.omega**2) + (eta * unit) ** 2 * along
    found = np.sqrt(np.linalg.eigvalsh(stiffness)[:3]) / unit
    assert found == pytest.approx(out_of_plane, rel=1e-3)
    in_plane = np.sqrt(np.linalg.eigvalsh(stiffness - (eta * unit) ** 2 * np.eye(10))[:3]) / unit
    assert in_plane**2 == pytest.approx(np.array(out_of_plane) ** 2 - eta**2, rel=2e-3)


def test_a_steadily_turning_beam_stretches_as_in_statics() -> None:
    """u(L) = rho w^2 L^3/(3 E) of a rod, within what its axial modes leave."""
    steady = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "spin-up", "rate": 5.0, "time": 2.0}}
    model, marched = steps(
        arm({"stiffening": True, "axial_modes": 12, "joints": [steady]}, damping_ratio=0.2), 30.0, 60000, 60000
    )
    end = history(model, marched, "ends", 0, 3)[-1]
    assert np.hypot(end[0], end[2]) - 10.0 == pytest.approx(3000.0 * 25.0 * 1000.0 / (3.0 * 7e10), rel=2e-3)


def test_a_free_body_with_a_carriage_keeps_its_momentum() -> None:
    """Linear and angular momentum over 10 s to 1e-4 with 350 steps per first period; order 2."""
    frame = {
        "lateral_second_moment": 3e-5,
        "lateral_modes": 2,
        "turned": [0.1, -0.2, 0.3],
        "joints": [{"kind": "free", "rate": [0.5, 0.3, -0.4], "velocity": [0.1, 0.0, 0.2]}],
    }
    motion = {"kind": "waypoints", "times": [0, 4, 10], "positions": [1, 8, 2]}
    cart = {"kind": "mass", "on": "hull", "mass": 20.0, "inertia": [1.0, 2.0, 1.5], "height": 0.3, "motion": motion}
    study = Study(
        kind="moving-frames", gravity=0.0, body={"hull": FLYER}, frame={"hull": frame}, carriage={"cart": cart}
    )
    period = 2.0 * np.pi / build(study).first_omega
    drifts = []
    for per_period in (350, 700):
        count = int(10.0 / period * per_period)
        model, marched = steps(study, 10.0, count, 5)
        whole = history(model, marched, "whole", 2, 6)
        gone = np.abs(whole - whole[0])
        drifts.append([gone[:, :3].max() / np.abs(whole[0, :3]).max(), gone[:, 3:].max() / np.abs(whole[0, 3:]).max()])
    assert np.max(drifts[0]) < 1e-4
    assert np.log2(np.array(drifts[0]) / drifts[1]) == pytest.approx(2.0, abs=0.2)


def sines(x: np.ndarray, modes: int, length: float, mass: float) -> np.ndarray:
    k = np.arange(1, modes + 1) * np.pi / length
    return np.sqrt(2.0 / mass) * np.sin(np.multiply.outer(x, k))


@pytest.mark.parametrize("held", ["driven", "hinged", "free"])
def test_another_formulation(held: str) -> None:
    """A pinned beam in the plane with a mass that slides on it, its frame driven, hinged or free: particles over the
    ground and SciPy, to 1e-6."""
    joint: dict[str, object] = {"kind": "revolute", "axis": [0, 1, 0]}
    given = {}
    if held == "driven":
        joint["motion"] = {"kind": "swing", "amplitude": 0.4, "frequency": 0.25}
        rate = 0.5 * np.pi
        given = {
            2: lambda t: (0.4 * np.sin(rate * t), 0.4 * rate * np.cos(rate * t), -0.4 * rate**2 * np.sin(rate * t))
        }
    joints = [joint] if held != "free" else [{"kind": "prismatic", "axis": a} for a in ([1, 0, 0], [0, 0, 1])] + [joint]
    frames: dict[str, object] = {"hull": {"joints": joints}}
    bodies = {}
    if held == "driven":  # in a cradle, as what is driven holds the directions of tracks
        frames = {"cradle": {"joints": joints}, "hull": {"on": "cradle", "at": 0.0}}
        bodies = {"cradle": {"kind": "rigid", "length": 10.0, "mass": 7.0, "inertia": 3.0, "own_weight": True}}
    if held != "free":
        given |= {0: lambda t: (0.0, 0.0, 0.0), 1: lambda t: (0.0, 0.0, 0.0)}
    beam = FLYER | {"supports": "pinned-pinned", "modes": 2, "second_moment": 4e-6, "own_weight": True}
    load = {"kind": "mass", "on": "hull", "mass": 40.0, "motion": {"kind": "free", "start": 4.0, "speed": 0.5}}
    study = Study(
        kind="moving-frames",
        gravity=9.81,
        body={"hull": beam | {"damping_ratio": 0.01}} | bodies,
        frame=frames,
        carriage={"load": load},
    )
    duration, count = 1.2, 4800
    found = []
    for scheme in (FOX_GOODWIN,):
        model, marched = steps(study, duration, count, 48, scheme)
        end = history(model, marched, "ends", 3 * list(model.bodies).index("hull"), 3)
        found.append(np.column_stack([end[:, [0, 2]], history(model, marched, "carriages")]))
    times, mass, modes = marched.times[0], 120.0, 2
    x, dm = np.polynomial.legendre.leggauss(24)
    places, masses = beam_in_plane(lambda s: sines(s, modes, 10.0, mass), 5.0 * (x + 1.0), 0.5 * mass * dm, 40.0, modes)
    omega = (np.arange(1, modes + 1) * np.pi / 10.0) ** 2 * np.sqrt(7e9 * 4e-6 / 12.0)
    none = np.zeros(3)
    twin = Particles(
        places,
        masses,
        np.concatenate([none, omega**2, [0.0]]),
        np.concatenate([none, 0.02 * omega, [0.0]]),
        9.81,
        given,
    )
    y, u = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 4.0]), np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5])
    for k, motion in given.items():
        y[k], u[k], _ = motion(0.0)
    other = twin.march(y, u, times)
    angle = other[:, 2]
    ends = np.column_stack([other[:, 0] + 10.0 * np.cos(angle), other[:, 1] - 10.0 * np.sin(angle)])
    assert found[0][:, :2] == pytest.approx(ends, abs=1e-5)
    assert found[0][:, 2] == pytest.approx(other[:, -1], abs=1e-5)


def test_a_frame_sits_where_shapes_vanish() -> None:
    with pytest.raises(BadInput, match=r"body\.arm\.supports"):
        build(arm({"joints": [SPIN_UP]}, supports="free-clamped"))


@pytest.mark.parametrize("holds", [{"stiffness": 800.0}, {"damping": 5.0}])
def test_what_turns_about_a_pin_has_no_spring_or_damper_there(holds: dict[str, float]) -> None:
    """Its torque never bent pinned shapes, which turn by themselves: 1e-9 nm were told where 11 mm are true."""
    hinge = {"kind": "revolute", "axis": [0, 1, 0]}
    with pytest.raises(BadInput, match="no joint lets it turn without a motion, a spring or a damper"):
        build(arm({"joints": [hinge | holds]}, supports="pinned-free"))
    build(arm({"joints": [hinge]}, supports="pinned-free"))


def test_a_pin_on_a_slide_needs_a_hinge() -> None:
    """It would swing freely, and was told to bend by a fortieth of a clamped one."""
    slide = {"kind": "prismatic", "axis": [0, 0, 1], "motion": {"kind": "minimum-jerk", "end": 1.0, "time": 0.6}}
    with pytest.raises(BadInput, match="it turns about its pin, and no joint"):
        build(arm({"joints": [slide]}, supports="pinned-free"))
    build(arm({"joints": [slide]}, supports="pinned-pinned"))
    build(arm({"joints": [slide, {"kind": "revolute", "axis": [0, 1, 0]}]}, supports="pinned-free"))


@pytest.mark.parametrize("controlled", [False, True])
def test_what_is_driven_holds_the_direction_of_its_track(controlled: bool) -> None:
    """Pinned shapes turn where a motion turns them; about another axis, or behind a free hinge, nothing holds them."""
    joint = SPIN_UP | ({"stiffness": 1.0} if controlled else {})
    with pytest.raises(BadInput, match="holds the track's direction") as refused:
        build(arm({"joints": [joint]}, supports="pinned-pinned"))
    assert "a rigid body on the joint" in str(refused.value)
    build(arm({"joints": [joint | {"axis": [0, 0, 1]}]}, supports="pinned-pinned"))
    build(arm({"joints": [joint, {"kind": "revolute", "axis": [0, 1, 0]}]}, supports="pinned-pinned"))
    with pytest.raises(BadInput, match="holds the track's direction"):
        build(arm({"joints": [joint, {"kind": "prismatic", "axis": [0, 1, 0]}]}, supports="pinned-pinned"))


def test_closed_loops_are_refused() -> None:
    body = {"kind": "rigid", "length": 1.0, "mass": 1.0, "inertia": 1.0}
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"one": body, "two": body},
        frame={"one": {"on": "two"}, "two": {"on": "one"}},
    )
    with pytest.raises(BadInput, match="closed loops"):
        build(study)


@pytest.mark.parametrize("modes", [1, 3])
def test_kernels_are_compiled_once_for_all_models(modes: int) -> None:
    """Their tables are rows after rows, however many there are: another order is another type."""
    model = build(arm({"stiffening": True, "joints": [SPIN_UP]}, modes=modes))
    own = {name: part for name, part in model.system._asdict().items() if isinstance(part, np.ndarray)}
    assert len(own) > 20 and [name for name, part in own.items() if not part.flags.c_contiguous] == []
