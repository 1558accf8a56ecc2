import json
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import typer

import service.cli.design as command
from identify.excitation.bounds import series_extremes
from service.designs import content_hash, read_series
from service.errors import UsageError
from service.robots import load_robot

QUICK = {"harmonics": 3, "fundamental": 0.2, "starts": 2, "jobs": 1}

FEWEST = QUICK | {"harmonics": 1, "starts": 1}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("design")


@pytest.fixture(scope="module")
def written(folder):
    """Everything that one call can write."""
    names = ("twin", "slow", "validation", "poses", "sweeps")
    paths = {name: folder / f"{name}.json" for name in names}
    command.design("ir361", folder / "excitation.json", picture=folder / "design.svg", **paths, **QUICK)
    return folder


def test_file_holds_the_contract(written):
    content = json.loads((written / "excitation.json").read_text())
    assert content["schema_version"] == 1 and content["robot"] == "ir361"
    assert content["joints"] == ["joint_1", "joint_2", "joint_3"]
    assert (content["fundamental_hz"], content["harmonics"], content["sample_rate_hz"]) == (0.2, 3, 150.0)
    assert np.shape(content["offset"]) == (3,)
    assert np.shape(content["cosine"]) == np.shape(content["sine"]) == (3, 3)
    assert content["criterion"] == "d" and content["hash"] == content_hash(content)
    expected = content["expected"]
    assert expected["std"]["joint_2.torque_constant"] > 0 and expected["std"]["joint_2.coulomb"] > 0
    assert expected["condition_number"] > 1 and expected["log_det_covariance"] < 0
    assert expected["reference"]["source"] == "nominal guess"


def test_written_motion_keeps_the_robots_limits(written):
    series, robot = read_series(written / "excitation.json"), load_robot("ir361").robot
    low, high = series_extremes(series, 0)
    for k, joint in enumerate(robot.joints):
        assert joint.limits.lower <= low[k] and high[k] <= joint.limits.upper
        assert np.max(np.abs([e[k] for e in series_extremes(series, 1)])) <= joint.limits.velocity
        assert np.max(np.abs([e[k] for e in series_extremes(series, 2)])) <= joint.limits.acceleration


def test_companions_are_whole_and_hashed(written):
    series = read_series(written / "excitation.json")
    twin, slow = read_series(written / "twin.json"), read_series(written / "slow.json")
    np.testing.assert_array_equal(twin.sine, -series.sine)
    assert slow.fundamental_hz == pytest.approx(series.fundamental_hz / 4)
    for name, count in (("validation", 20), ("poses", 30)):
        content = json.loads((written / f"{name}.json").read_text())
        assert content["kind"] == name and len(content["points"]) == count + 1
        assert content["hash"] == content_hash(content)
    assert json.loads((written / "sweeps.json").read_text())["kind"] == "sweeps"


def test_picture_is_well_formed_and_names_every_parameter(written):
    text = (written / "design.svg").read_text()
    words = [
        element.text for element in ElementTree.fromstring(text).iter("{http://www.w3.org/2000/svg}text")
    ]
    content = json.loads((written / "excitation.json").read_text())
    assert set(content["expected"]["std"]) <= set(words)


def test_same_seed_same_bytes_however_many_processes(written, tmp_path):
    command.design("ir361", tmp_path / "again.json", **(QUICK | {"jobs": 2}))
    assert (tmp_path / "again.json").read_bytes() == (written / "excitation.json").read_bytes()


def test_earlier_estimate_gives_noise_and_reference_and_json_is_alone_on_stdout(written, tmp_path, capsys):
    names = json.loads((written / "excitation.json").read_text())["expected"]["std"]
    estimate = tmp_path / "estimate.json"
    estimate.write_text(
        json.dumps(
            {
                "noise": {"joint_1": 1.0, "force.x": 2.0},
                "parameters": [{"name": n, "value": 1.5} for n in names if "constant" not in n],
            }
        )
    )
    path = tmp_path / "e.json"
    command.design("ir361", path, noise_from=estimate, reference=estimate, json=True, **FEWEST)
    printed = json.loads(capsys.readouterr().out)
    assert printed["hash"] == json.loads(path.read_text())["hash"]
    expected = json.loads(path.read_text())["expected"]
    assert expected["reference"]["source"] == "estimate" and str(estimate) in expected["noise"]


def test_workspace_file_binds_and_its_faults_are_named(tmp_path):
    file = tmp_path / "workspace.toml"
    file.write_text('floor = 1.2\n[[sphere]]\nlink = "link_3"\ncenter = [0, 0, 0.5]\nradius = 0.05\n')
    command.design("ir361", tmp_path / "e.json", workspace=file, **FEWEST)
    clearance = json.loads((tmp_path / "e.json").read_text())["limits"]["clearance"]
    assert clearance["least_m"] >= clearance["margin_m"]
    for text, words in (
        ("flor = 1.0\n", "did you mean 'floor'"),
        ('[[sphere]]\nlink = "link_9"\n', "'link_9' is not in the URDF"),
        ("floor = [\n", "not valid TOML"),
    ):
        file.write_text(text)
        with pytest.raises(UsageError, match=words):
            command.design("ir361", tmp_path / "f.json", workspace=file, **QUICK)
    assert not (tmp_path / "f.json").exists()


def test_tampered_file_is_refused(written, tmp_path):
    content = json.loads((written / "excitation.json").read_text())
    content["offset"][0] += 0.5
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(content))
    with pytest.raises(UsageError, match="hash does not match"):
        read_series(path)
    path.write_text(json.dumps({"robot": "ir361"}))
    with pytest.raises(UsageError, match="fundamental_hz"):
        read_series(path)


def test_missing_folder_is_refused_before_any_work(tmp_path):
    with pytest.raises(UsageError, match="does not exist"):
        command.design("ir361", tmp_path / "none" / "e.json", **QUICK)


def test_command_line_parses():
    app = typer.Typer()
    app.command()(command.design)
    options = {name for parameter in typer.main.get_command(app).params for name in parameter.opts}
    assert {"--harmonics", "--noise-from", "--warm-start", "--twin", "--picture", "--json", "-o"} <= options
