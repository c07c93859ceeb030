"""Robots out of URDF files, against the file's own poses and against another program."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.robots.urdf import table_of
from engine.scene.robots import Arm
from results_schema.errors import BadInput
from studies.commands.cli import main
from tests.robots.inverse import drive_forces

TURNED = np.array([0.3, -0.2, 0.5])  # of the root on the carriage
GRAVITY = 9.81


def inertial(mass: float, xyz: str, rpy: str, *moments: float) -> str:
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    numbers = " ".join(f'{key}="{value}"' for key, value in zip(keys, moments, strict=True))
    return f'<inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="{mass}"/><inertia {numbers}/></inertial>'


def joint(name: str, kind: str, parent: str, child: str, xyz: str, rpy: str, axis: str = "1 0 0") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    limit = '<limit velocity="2" effort="9" lower="-3" upper="3"/>' if kind != "continuous" else ""
    return (
        f'<joint name="{name}" type="{kind}">{ends}<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


LINKS = {
    "base": inertial(20, "0.01 0.02 0.1", "0.1 0.2 0.3", 0.4, 0.01, 0.02, 0.5, 0.03, 0.3),
    "cabinet": inertial(5, "0 0 0", "0 0 0", 0.1, 0, 0, 0.1, 0, 0.1),
    "upper": inertial(12, "0.05 -0.02 0.2", "0.3 -0.2 0.5", 0.3, 0.02, -0.03, 0.25, 0.01, 0.1),
    "fore": inertial(8, "0.3 0.01 0.03", "0 0.4 0", 0.05, 0.01, 0.02, 0.3, -0.004, 0.28),
    "box": inertial(2, "0 0 0.1", "0 0 0", 0.02, 0, 0, 0.02, 0, 0.01),
    "rod": inertial(3, "0 0.1 0.1", "0 0 1", 0.03, 0, 0, 0.02, 0.002, 0.01),
    "tool": "",
}
JOINTS = (
    joint("stand", "fixed", "base", "cabinet", "-0.3 0 0.2", "0 0 0"),
    joint("shoulder", "revolute", "base", "upper", "0 0 0.3", "0.1 0 0.2", "0 0 1"),
    joint("elbow", "continuous", "upper", "fore", "0.1 0.05 0.4", "1.2 0.3 -0.4", "0 0.6 0.8"),
    joint("cable", "fixed", "fore", "box", "0.1 0.2 0.3", "0.3 0.2 0.1"),
    joint("reach", "prismatic", "fore", "rod", "0.6 0 0", "0 1.1 0", "0 0 1"),
    joint("flange", "fixed", "rod", "tool", "0.02 0.03 0.5", "0.3 0 0"),
)


def urdf(links: dict[str, str] = LINKS, joints: tuple[str, ...] = JOINTS) -> str:
    parts = [f'<link name="{name}">{text}</link>' for name, text in links.items()]
    return f'<robot name="odd">{"".join(parts)}{"".join(joints)}</robot>'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "odd.urdf"
    path.write_text(urdf())
    return path


def arm_of(file: Path) -> Arm:
    return Arm(**tomllib.loads(table_of(file, "tool", "odd", TURNED))["arm"]["odd"])


def standing(values: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Attitude and place of every link by the text above, read a second time: joints (3,) on the turned root."""
    from xml.etree import ElementTree

    attitude, place = {"base": Rotation.from_rotvec(TURNED).as_matrix()}, {"base": np.zeros(3)}
    moved = dict(zip(("shoulder", "elbow", "reach"), values, strict=True))
    for one in map(ElementTree.fromstring, JOINTS):
        parent, child = one.find("parent").get("link"), one.find("child").get("link")
        xyz, rpy = (np.array(one.find("origin").get(key).split(), dtype=float) for key in ("xyz", "rpy"))
        axis, value = np.array(one.find("axis").get("xyz").split(), dtype=float), moved.get(one.get("name"), 0.0)
        # rolled, pitched and yawed about axes that stay
        a, b, c = (Rotation.from_rotvec(angle * along).as_matrix() for angle, along in zip(rpy, np.eye(3), strict=True))
        own = attitude[parent] @ c @ b @ a
        slides = one.get("type") == "prismatic"
        place[child] = place[parent] + attitude[parent] @ xyz + (own @ axis * value if slides else 0.0)
        attitude[child] = own if slides else own @ Rotation.from_rotvec(axis * value).as_matrix()
    return attitude, place


def energies(values: np.ndarray, rates: np.ndarray) -> tuple[float, float]:
    """Kinetic and potential energy, velocities by central differences of the poses."""
    from xml.etree import ElementTree

    small, kinetic, potential = 1e-5, 0.0, 0.0
    (now, place), (before, behind), (after, ahead) = (standing(values + part * small * rates) for part in (0, -1, 1))
    for name, text in LINKS.items():
        if not text:
            continue
        of = ElementTree.fromstring(text)
        c, rpy = (np.array(of.find("origin").get(key).split(), dtype=float) for key in ("xyz", "rpy"))
        mass, tensor = float(of.find("mass").get("value")), {k: float(v) for k, v in of.find("inertia").attrib.items()}
        own = np.array([[tensor["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
        turn = Rotation.from_euler("xyz", rpy).as_matrix()
        velocity = (ahead[name] + after[name] @ c - behind[name] - before[name] @ c) / (2.0 * small)
        spin = Rotation.from_matrix(after[name] @ before[name].T).as_rotvec() / (2.0 * small)
        inertia = now[name] @ turn @ own @ turn.T @ now[name].T
        kinetic += 0.5 * mass * velocity @ velocity + 0.5 * spin @ inertia @ spin
        potential += mass * GRAVITY * (place[name] + now[name] @ c)[2]
    return kinetic, potential


def test_energies_of_the_file_are_those_of_its_drives(file: Path) -> None:
    """Gravity loads are slopes of the potential energy, half of what unit accelerations take is the kinetic one."""
    arm, random = arm_of(file), np.random.default_rng(3)
    for values, rates in random.uniform(-1.5, 1.5, (5, 2, 3)):
        state = np.zeros((1, 4, 3))
        state[0, 1:, 0] = values
        load = drive_forces(arm, state, GRAVITY)[0, 1:]
        slope = [
            (energies(values + part, rates)[1] - energies(values - part, rates)[1]) / 2e-5 for part in 1e-5 * np.eye(3)
        ]
        np.testing.assert_allclose(load, slope, atol=1e-7 * np.abs(load).max())
        state[0, 1:, 2] = rates  # as accelerations
        taken = drive_forces(arm, state, 0.0)[0, 1:] @ rates
        assert 0.5 * taken == pytest.approx(energies(values, rates)[0], rel=1e-8)


def test_the_tool_and_the_carriage_are_where_the_file_has_them(file: Path) -> None:
    arm, (attitude, place) = arm_of(file), standing(np.zeros(3))
    turn, reached = np.eye(3), np.zeros(3)
    for link in arm.links:
        reached = reached + turn @ link.place
        turn = turn @ Rotation.from_rotvec(link.turned).as_matrix()
    np.testing.assert_allclose(reached + turn @ arm.tool, place["tool"], atol=1e-12)
    centre = attitude["base"] @ (20.0 * np.array([0.01, 0.02, 0.1]) + 5.0 * np.array([-0.3, 0.0, 0.2])) / 25.0
    np.testing.assert_allclose(arm.centre, centre, atol=1e-12)
    assert arm.mass == 25.0
    assert [drive.speed for drive in arm.drives] == [1.0, 2.0, 1.0, 2.0]


@pytest.mark.extras
def test_inverse_dynamics_is_that_of_pinocchio(file: Path) -> None:
    """20 random states, to 1e-10 of the largest torque."""
    pinocchio = pytest.importorskip("pinocchio")
    model = pinocchio.buildModelFromUrdf(str(file))
    down = Rotation.from_rotvec(TURNED).inv().apply([0.0, 0.0, -GRAVITY])
    model.gravity.linear = down
    data, random = model.createData(), np.random.default_rng(5)
    states = random.uniform(-1.5, 1.5, (20, 3, 3))
    joints = np.zeros((20, 4, 3))
    joints[:, 1:] = states
    found = drive_forces(arm_of(file), joints, GRAVITY)[:, 1:]
    for own, (q, v, a) in zip(found, np.moveaxis(states, 2, 1), strict=True):
        endless = np.array([q[0], np.cos(q[1]), np.sin(q[1]), q[2]])  # a continuous joint by its cosine and sine
        wanted = pinocchio.rnea(model, data, endless, v, a)
        np.testing.assert_allclose(own, wanted, atol=1e-10 * np.abs(wanted).max())


def test_the_command_prints_a_table(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["arm", str(file), "tool", "--name", "odd", "--turned", *map(str, TURNED)]) == 0
    assert tomllib.loads(capsys.readouterr().out) == tomllib.loads(table_of(file, "tool", "odd", TURNED))


BRANCH = (*JOINTS, joint("wiper", "revolute", "upper", "blade", "0 0 0", "0 0 0"))
FAULTS = {
    urdf(LINKS | {"a&#10;b": ""}): "line breaks",
    urdf(joints=(*JOINTS[:-1], JOINTS[-1].replace("flange", "reach"))): "two joints have the same name",
    urdf(joints=tuple(one.replace('velocity="2"', 'velocity="-2"') for one in JOINTS)): "negative velocity",
    "<robot": "no XML",
    "<sdf/>": "no URDF file",
    "<!DOCTYPE robot [<!ENTITY a 'b'>]><robot/>": "entities",
    urdf(joints=BRANCH): "a link that is not there",
    urdf(LINKS | {"blade": ""}, BRANCH): "not on the way to the tool",
    urdf(LINKS | {"lost": ""}): "not one root",
    urdf(joints=(*JOINTS, joint("loop", "fixed", "rod", "upper", "0 0 0", "0 0 0"))): "two joints",
    urdf(joints=JOINTS[:4]): "not one root",
    urdf(LINKS, tuple(one.replace("continuous", "planar") for one in JOINTS)): "of a kind that drives do not move",
    urdf(LINKS, tuple(one.replace("0.6 0 0", "0.6 0 nan") for one in JOINTS)): "no number",
    urdf(LINKS, tuple(one.replace("0.6 0 0", "0.6 0") for one in JOINTS)): "no vector",
    urdf(LINKS, tuple(one.replace("0 0.6 0.8", "0 0 0") for one in JOINTS)): "axis without direction",
    urdf(LINKS, tuple(one.replace("<limit", "<mimic/><limit") for one in JOINTS)): "mimics",
    urdf(LINKS | {"rod": LINKS["rod"].replace('value="3"', 'value="-3"')}): "negative mass",
    urdf(LINKS | {"rod": inertial(3, "0 0 0", "0 0 1", 0.6, 0.3, 0, 0.6, 0, 0.2)}): "link rod .* no body can have",
}


@pytest.mark.parametrize("text", FAULTS, ids=FAULTS.values())
def test_files_that_tell_no_chain(tmp_path: Path, text: str) -> None:
    path = tmp_path / "odd.urdf"
    path.write_text(text)
    with pytest.raises(BadInput, match=FAULTS[text]) as told:
        table_of(path, "tool", "odd", TURNED)
    assert told.value.where == str(path)


def test_a_thin_plate_of_three_digits_is_a_body(file: Path) -> None:
    """Moments 1/12, 1/12 and 1/6, as a file rounds them: the last exceeds the sum of the others by 0.24 %."""
    file.write_text(urdf(LINKS | {"rod": inertial(3, "0 0 0", "0 0 1", 0.0833, 0, 0, 0.0833, 0, 0.167)}))
    assert arm_of(file).links[2].inertia == pytest.approx((0.0833, 0.0833, 0.167))


def test_limits_are_taken_and_comments_tell_what_the_file_does_not(file: Path) -> None:
    limit, guess = "limits = [-3, 3]", "the file tells no speed of elbow"
    joints = tuple(one.replace('velocity="2"', "") if 'name="reach"' in one else one for one in JOINTS)
    file.write_text(urdf(LINKS | {"upper": ""}, joints))
    carriage, upper, fore, rod = table_of(file, "tool", "odd", TURNED).split("[[arm.odd.links]]")
    assert "add the carriage that rides" in carriage and limit in upper and limit in rod
    assert [" no mass of it" in link for link in (carriage, upper, fore, rod)] == [False, True, False, False]
    assert "limits" not in fore and guess in fore and "no speed of reach" in rod and "no speed" not in upper
    file.write_text(urdf(LINKS | {"base": "", "cabinet": ""}))
    carriage = table_of(file, "tool", "odd", TURNED).split("[[arm.odd.links]]")[0]
    assert "replace this one by that of the carriage" in carriage and "add the" not in carriage


def test_links_in_a_circle_and_tools_that_are_not_there(file: Path) -> None:
    circle = (joint("a", "fixed", "one", "two", "0 0 0", "0 0 0"), joint("b", "fixed", "two", "one", "0 0 0", "0 0 0"))
    file.write_text(urdf({"root": "", "one": "", "two": ""}, circle))
    with pytest.raises(BadInput, match="in a circle"):
        table_of(file, "one", "odd", TURNED)
    file.write_text(urdf())
    for tool, name, words in (
        ("tol", "odd", 'no such link.*did you mean "tool"'),
        (None, "odd", "several ends"),
        ("tool", "o d", "no name"),
    ):
        with pytest.raises(BadInput) as told:
            table_of(file, tool, name, TURNED)
        assert re.search(words, str(told.value))
    with pytest.raises(BadInput, match="no such file"):
        table_of(file.with_name("none.urdf"), "tool", "odd", TURNED)
