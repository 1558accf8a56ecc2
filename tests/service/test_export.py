"""Export: files that say what the estimate says, refusals where they could not."""

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identify.inertia import PARAMETERS, pseudo_inertia
from identify.model import build_model
from identify.parameters import unknown_rotors
from identify.urdf import read_urdf
from service.cli.main import run
from service.errors import EstimateError
from service.estimate_reading import read_estimate
from service.export_check import check_mjcf, check_urdf
from service.export_model import export_model
from service.exports import SIDECAR_SUFFIX
from service.robots import build_robot, load_robot
from tests.identify.robots import link_truth, raw_truth, true_theta

SAMPLES = Path(__file__).resolve().parents[3] / "shared/data/ir361/samples"
SLED_URDF = """<?xml version="1.0"?>
<!-- a robot on a rail -->
<robot name="sled">
  <link name="floor"><inertial><mass value="9"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="cart"/><link name="mast"/><link name="arm"/><link name="hand"/>
  <joint name="rail" type="prismatic"><parent link="floor"/><child link="cart"/>
    <origin xyz="0.1 0 0.2" rpy="0.3 -0.2 0.5"/><axis xyz="1 0.2 0"/>
    <limit lower="-1" upper="1" velocity="2" effort="500"/></joint>
  <joint name="bolt" type="fixed"><parent link="cart"/><child link="mast"/>
    <origin xyz="0 0 0.4" rpy="0 0 0.7"/></joint>
  <joint name="turn" type="continuous"><parent link="mast"/><child link="arm"/>
    <origin xyz="0.05 0.1 0.2" rpy="0.1 0.2 0.3"/><axis xyz="0 0 1"/></joint>
  <joint name="bend" type="revolute"><parent link="arm"/><child link="hand"/>
    <origin xyz="0.3 0 0" rpy="-1.2 0.4 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="2" effort="80"/>
    <dynamics damping="99" friction="99"/></joint>
</robot>
"""
SLED_TOML = """
name = "sled"
urdf = "sled.urdf"
gravity = [0.4, -0.3, -9.7]
{coupling}
[force_plate]
xyz = [0.1, -0.2, 0.05]
rpy = [0.1, 0.2, -0.3]
tared = {tared}
[[joint]]
name = "rail"
gear_ratio = 120.0
rotor_inertia = 0.0004
rotor_link = "floor"
[[joint]]
name = "turn"
gear_ratio = -50.0
rotor_link = "cart"
friction = ["coulomb", "viscous", "asymmetric_viscous"]
[[joint]]
name = "bend"
gear_ratio = 80.0
rotor_inertia = 0.0003
rotor_link = "arm"
{compensation}
"""
COUPLING = "coupling = [[120.0, 0.0, 0.0], [0.0, -50.0, 0.0], [0.0, 30.0, 80.0]]"


def sled(coupling="", tared="true", compensation="gravity_compensation = { harmonics = 2 }"):
    text = SLED_TOML.format(coupling=coupling, tared=tared, compensation=compensation)
    return build_robot(text, SLED_URDF, "sled")


def raw_of(loaded):
    """Plausible raw parameters of any of the robots here."""
    robot = loaded.robot
    raw = {
        f"{link}.{name}": value
        for link, row in zip(robot.link_names, link_truth(), strict=True)
        for name, value in zip(PARAMETERS, row, strict=True)
    }
    for k, joint in enumerate(robot.joints):
        raw |= {
            f"{joint.name}.coulomb": 4.0 + k,
            f"{joint.name}.viscous": 3.0 - k,
            f"{joint.name}.offset": 0.7 - k,
        }
        raw |= {f"{joint.name}.asymmetric_viscous": 0.3, f"{joint.name}.rotor_inertia": 4e-4}
        for order in (1, 2, 3):
            raw |= {
                f"{joint.name}.gravity_cos_{order}": 2.0 / order,
                f"{joint.name}.gravity_sin_{order}": -30.0 / order**2,
            }
    return raw | {f"plate.{c}.{a}.offset": 1.5 for c in ("force", "torque") for a in "xyz"}


def content_of(loaded, kind, raw, std=0.01, **changed):
    """An estimate file's content with given parameters; values of None are not identifiable."""
    model = build_model(loaded.robot, kind)
    theta = true_theta(model, raw)
    names = [p.name for p in model.parameters]
    values = {name: float(value) for name, value in zip(names, theta, strict=True)} | changed
    size, n = len(names), loaded.robot.n
    covariance = [
        [std**2 if i == j and i < size else 0.0 if max(i, j) < size else None for j in range(size + n)]
        for i in range(size + n)
    ]
    for index in [k for k, name in enumerate(names) if values[name] is None]:
        for other in range(size + n):
            covariance[index][other] = covariance[other][index] = None
    return {
        "schema_version": 1,
        "robot": loaded.name,
        "model": kind,
        "simulated": True,
        "parameters": [{"name": p.name, "value": values[p.name], "std": std} for p in model.parameters],
        "covariance": covariance,
        "torque_constants": [{"joint": name, "value": None} for name in loaded.robot.joint_names],
        "intervals_valid": True,
        "description": {"robot_toml": loaded.toml_text, "urdf": loaded.urdf_text},
    }


@pytest.fixture
def folder(tmp_path):
    return tmp_path


def write(folder, content):
    path = folder / "estimate.json"
    path.write_text(json.dumps(content))
    return path


def export(folder, content, *options, capsys=None):
    """Exit code, report and error sentence of ``residuum export --json``."""
    path = write(folder, content)
    code = run(
        [
            "export",
            str(path),
            "--urdf",
            str(folder / "o.urdf"),
            "--mjcf",
            str(folder / "o.xml"),
            "--json",
            *options,
        ]
    )
    out, error = capsys.readouterr()
    return code, json.loads(out) if code == 0 else None, error


ROBOTS = {
    "ir361": lambda: load_robot("ir361"),
    "sled": sled,
    "calibrated": lambda: sled(tared="false", compensation=""),
    "coupled": lambda: sled(coupling=COUPLING),
}


@pytest.mark.parametrize("kind", ["combined", "internal", "external"])
@pytest.mark.parametrize("name", ROBOTS)
def test_files_read_back_agree(folder, capsys, name, kind):
    loaded = ROBOTS[name]()
    raw = raw_of(loaded)
    code, report, error = export(folder, content_of(loaded, kind, raw), capsys=capsys)
    assert code == 0, error
    errors = report["agreement"]["largest_relative_error"]
    assert max(errors.values()) < 1e-10
    assert ("mjcf joint torques" in errors) == (kind != "external")
    assert ("mjcf base wrench" in errors) == (kind != "internal")
    assert sorted(p.name for p in folder.iterdir()) == [
        "estimate.json",
        "o.urdf",
        "o.xml",
        "o.xml" + SIDECAR_SUFFIX,
    ]
    assert report["simulated"] and not report["projected"]
    for file in ("o.urdf", "o.xml"):
        assert "simulated: true" in (folder / file).read_text()
    assert json.loads((folder / ("o.xml" + SIDECAR_SUFFIX)).read_text())["simulated"] is True


def test_the_urdf_has_the_estimate_s_base_parameters(folder, capsys):
    loaded = load_robot("ir361")
    raw = raw_truth(loaded.robot.__class__(**{**vars(loaded.robot), "reference_parameters": link_truth()}))
    export(folder, content_of(loaded, "combined", raw), capsys=capsys)
    chain = read_urdf((folder / "o.urdf").read_text())
    model = build_model(loaded.robot, "combined")
    assert not unknown_rotors(loaded.robot)
    base = model.basis.definitions @ chain.parameters.ravel()
    np.testing.assert_allclose(base, true_theta(model, raw)[: len(base)], rtol=1e-9, atol=1e-9)
    assert all(np.linalg.eigvalsh(pseudo_inertia(link))[0] > 0 for link in chain.parameters)


def test_a_simulated_step_obeys_the_estimate_s_equation_of_motion(folder, capsys):
    loaded = sled(compensation="")
    raw = raw_of(loaded) | {
        f"{j}.{t}": 0.0 for j in ("rail", "turn", "bend") for t in ("coulomb", "offset", "asymmetric_viscous")
    }
    export(folder, content_of(loaded, "internal", raw), capsys=capsys)
    model = mujoco.MjModel.from_xml_path(str(folder / "o.xml"))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = (0.2, -0.7, 0.9), (0.5, -1.0, 0.8), (30.0, 4.0, -6.0)
    mujoco.mj_forward(model, data)
    identified = build_model(loaded.robot, "internal")
    q, qd, qdd = (x.copy()[:, None] for x in (data.qpos, data.qvel, data.qacc))
    rows = identified.drive_rows(q, qd, qdd)
    torque = np.tensordot(rows.columns, true_theta(identified, raw), axes=([1], [0])) + rows.known
    rest = rotor_cross_terms(loaded.robot, raw, q, qd, qdd)
    np.testing.assert_allclose(torque[:, 0] - rest, data.ctrl, rtol=1e-6)


def rotor_cross_terms(robot, raw, q, qd, qdd):
    """What the rotors do to the joints beyond armature."""
    from identify.regressor import rigid_columns

    columns = rigid_columns(robot, q, qd, qdd, external=False).rotor_internal[:, :, 0]
    inertia = np.array([j.drive.rotor_inertia or raw[f"{j.name}.rotor_inertia"] for j in robot.joints])
    ratio = np.array([j.drive.gear_ratio for j in robot.joints])
    return columns @ inertia - ratio**2 * inertia * qdd[:, 0]


def test_an_impossible_estimate_is_refused_or_projected(folder, capsys):
    loaded = load_robot("ir361")
    content = content_of(
        loaded, "combined", raw_of(loaded), **{"link_3.Iyy": -0.02, "joint_1.coulomb": -0.02}
    )
    code, _, error = export(folder, content, capsys=capsys)
    assert code == 4
    assert "std" in error and "--project" in error and error.count("\n") == 1
    assert [p.name for p in folder.iterdir()] == ["estimate.json"]
    code, report, _ = export(folder, content, "--project", capsys=capsys)
    assert code == 0 and report["projected"]
    assert max(report["agreement"]["largest_relative_error"].values()) < 1e-8
    assert report["consistency"]["distance"] > 2.0
    for file in ("o.urdf", "o.xml"):
        assert "(projected)" in (folder / file).read_text()
    model = mujoco.MjModel.from_xml_path(str(folder / "o.xml"))
    assert model.dof_frictionloss[0] == pytest.approx(0.0, abs=1e-6)


def test_a_file_that_says_something_else_is_not_kept(folder, capsys):
    loaded = load_robot("ir361")
    content = content_of(loaded, "combined", raw_of(loaded))
    export(folder, content, capsys=capsys)
    estimate = read_estimate(folder / "estimate.json")
    model = export_model(estimate, estimate.consistency())
    sidecar = folder / ("o.xml" + SIDECAR_SUFFIX)
    for file, attribute in (
        ("o.xml", "mass"),
        ("o.xml", "damping"),
        ("o.xml", "frictionloss"),
        ("o.xml", "springref"),
    ):
        root = ElementTree.parse(folder / file).getroot()
        element = next(e for e in root.iter() if attribute in e.attrib and e.tag != "geom")
        element.set(attribute, repr(float(element.get(attribute)) * (1 + 1e-4)))
        (folder / "wrong").write_text(ElementTree.tostring(root, encoding="unicode"))
        with pytest.raises(EstimateError, match="differ from the estimate"):
            check_mjcf(model, folder / "wrong", sidecar)
    held = json.loads(sidecar.read_text())
    held["joints"][1]["offset"] += 0.01
    (folder / "wrong").write_text(json.dumps(held))
    with pytest.raises(EstimateError, match="joint torques differ"):
        check_mjcf(model, folder / "o.xml", folder / "wrong")
    text = (folder / "o.urdf").read_text().replace('<mass value="', '<mass value="1')
    (folder / "wrong").write_text(text)
    with pytest.raises(EstimateError, match="base parameters differ"):
        check_urdf(model, folder / "wrong")


def test_what_was_not_identifiable_is_named(folder, capsys):
    loaded = load_robot("ir361")
    gaps = {"joint_3.viscous": None, "joint_3.offset": None, "link_3.Iyz": None}
    code, report, error = export(
        folder, content_of(loaded, "combined", raw_of(loaded), **gaps), capsys=capsys
    )
    assert code == 0, error
    text = " ".join(report["notes"])
    assert "taken as zero: joint_3.viscous, joint_3.offset" in text
    assert "12 directions" in text


def test_the_original_document_is_kept(folder, capsys):
    loaded = sled()
    export(folder, content_of(loaded, "combined", raw_of(loaded)), capsys=capsys)
    root = ElementTree.parse(folder / "o.urdf").getroot()
    links = {link.get("name"): link for link in root.findall("link")}
    assert links["floor"].find("inertial/mass").get("value") == "9"
    assert links["cart"].find("inertial") is not None and links["mast"].find("inertial") is None
    dynamics = root.find("joint[@name='bend']/dynamics")
    assert float(dynamics.get("damping")) == pytest.approx(1.0)
    assert float(dynamics.get("friction")) == pytest.approx(6.0)
    assert root.find("joint[@name='bolt']/dynamics") is None
    sidecar = json.loads((folder / ("o.xml" + SIDECAR_SUFFIX)).read_text())
    assert sidecar["joints"][1]["rotor"]["carrier"] == "cart"
    assert sidecar["joints"][2]["mjcf_spring"]["largest_torque_left_over"] >= 0.0


def test_wrong_use_is_refused_with_one_sentence(folder, capsys):
    loaded = load_robot("ir361")
    path = str(write(folder, content_of(loaded, "internal", raw_of(loaded))))
    target = str(folder / "o.urdf")
    cases = [
        (["export", str(folder / "absent.json"), "--urdf", target], "does not exist"),
        (["export", path], "Nothing to export to"),
        (["export", path, "--urdf", str(folder / "no" / "o.urdf")], "does not exist"),
        (["export", path, "--mjcf", str(folder)], "is a folder"),
        (["export", path, "--urdf", target, "--mjcf", target], "two names"),
    ]
    for command, words in cases:
        assert run(command) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1
    assert [p.name for p in folder.iterdir()] == ["estimate.json"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema_version": 7}, "schema_version"),
        ({"description": None}, "lacks"),
        ({"parameters": []}, "not those of the internal model"),
        ({"covariance": [[1.0]]}, "shape"),
        ({"model": "magic"}, "unknown"),
    ],
)
def test_a_malformed_estimate_is_refused(folder, capsys, change, words):
    loaded = load_robot("ir361")
    content = content_of(loaded, "internal", raw_of(loaded)) | change
    code, _, error = export(folder, content, capsys=capsys)
    assert code == 2
    assert words in error


@pytest.mark.shared
@pytest.mark.skipif(not SAMPLES.is_dir(), reason="the shared sample logs are not beside the repository")
def test_from_log_to_simulator(folder, capsys):
    estimate = folder / "estimate.json"
    log = str(SAMPLES / "plain.run.mcap")
    assert run(["identify", log, "--robot", "ir361", "-o", str(estimate), "--project", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["consistency"]["within_uncertainty"]
    assert {p["name"] for p in content["projected"]} >= {
        p["name"] for p in content["parameters"] if p["value"] is not None
    }
    assert run(["export", str(estimate), "--mjcf", str(folder / "arm.xml"), "--project", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert max(report["agreement"]["largest_relative_error"].values()) < 1e-10
    # the sidecar holds offsets and rotor cross terms only: small against the hundreds of N.m of this arm
    assert max(report["beyond_mjcf"].values()) < 5.0
