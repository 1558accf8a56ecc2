"""``residuum simulate`` and the augmented estimate it can run."""

import json

import numpy as np
import pytest

from daq.log_reader import read_recording
from identify.diagnosis.diagnose import DiagnoseOptions
from service.diagnosing import diagnose_log
from service.files import to_json, write_text
from tests.service import changed_logs as changed
from tests.service import synthetic_logs as logs

SIZE_NM, SPEED = 8.0, 0.2


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run with sticking in joint 2, its plain estimate and its diagnosis."""
    folder = tmp_path_factory.mktemp("simulate")
    sticky = changed.with_torque(logs.recording(), changed.sticking(SIZE_NM, SPEED))
    logs.write(sticky, folder / "run.mcap")
    other = logs.recording(5, changed.VALIDATION, **changed.OTHER_MOTION)
    logs.write(
        changed.with_torque(other, changed.sticking(SIZE_NM, SPEED), **changed.OTHER_MOTION),
        folder / "free.mcap",
    )
    options = DiagnoseOptions(effects=("stribeck_friction", "load_dependent_friction"))
    found = diagnose_log(folder / "run.mcap", "ir361", options=options)
    write_text(folder / "diagnosis.json", to_json(found.content), "the diagnosis")
    return folder


@pytest.fixture(scope="module")
def estimate(folder):
    from service.cli.main import run

    path = folder / "estimate.json"
    assert run(["identify", str(folder / "run.mcap"), "--robot", "ir361", "-o", str(path)]) == 0
    return path


def simulate(capsys, folder, model, like, out="simulated.mcap"):
    arguments = ("simulate", "ir361", "--model", model, "--like", folder / like, "-o", folder / out, "--json")
    code, printed, err = logs.command(capsys, *arguments)
    assert (code, err) == (0, "")
    return json.loads(printed), read_recording(folder / out)


def test_the_augmented_estimate_carries_its_effect(folder):
    content = json.loads((folder / "diagnosis.json").read_text())["estimate"]
    (effect,) = content["effects"]
    assert (effect["effect"], effect["joint"], effect["channel"]) == ("stribeck_friction", "joint_2", None)
    value, std = effect["coefficients"]["fs_minus_fc"], effect["std"]["fs_minus_fc"]
    assert abs(value - SIZE_NM) < 4 * std
    assert abs(effect["shape"]["vs"] - SPEED) < 4 * effect["shape_std"]["vs"]
    assert effect["units"] == {"fs_minus_fc": "N.m", "vs": "rad/s"}


def test_the_joint_covariance_holds_parameters_constants_and_effects(folder):
    content = json.loads((folder / "diagnosis.json").read_text())["estimate"]
    joint = content["joint_covariance"]
    names = [p["name"] for p in content["parameters"]]
    constants = [f"joint_{k}.torque_constant" for k in (1, 2, 3)]
    effects = ["stribeck_friction@joint_2.fs_minus_fc", "stribeck_friction@joint_2.vs"]
    assert joint["order"] == names + constants + effects
    matrix = np.array(joint["matrix"], dtype=float)
    size = len(names) + 3
    assert np.allclose(matrix[:size, :size], np.array(content["covariance"], dtype=float))
    assert np.allclose(matrix, matrix.T, rtol=1e-6)
    std = np.sqrt(np.diag(matrix))
    correlation = matrix[names.index("joint_2.coulomb"), -2] / (std[names.index("joint_2.coulomb")] * std[-2])
    assert abs(correlation) > 0.1, "sticking trades against Coulomb friction: leaving that out would be wrong"


def test_parameters_are_refitted_with_the_effect_in(folder, estimate):
    truth = logs.clean()
    index = [p.name for p in truth.model.parameters].index("joint_2.coulomb")
    augmented = json.loads((folder / "diagnosis.json").read_text())["estimate"]
    entry = next(p for p in augmented["parameters"] if p["name"] == "joint_2.coulomb")
    assert abs(entry["value"] - truth.theta[index]) < 4 * entry["std"]
    plain = next(p for p in json.loads(estimate.read_text())["parameters"] if p["name"] == "joint_2.coulomb")
    assert abs(plain["value"] - truth.theta[index]) > 5 * entry["std"], "without the effect it is biased"


def test_a_simulation_has_the_recordings_topics_and_instants(folder, capsys):
    printed, made = simulate(capsys, folder, folder / "diagnosis.json", "run.mcap")
    like = read_recording(folder / "run.mcap")
    assert [s.topic for s in made.streams] == [s.topic for s in like.streams]
    for a, b in zip(made.streams, like.streams, strict=True):
        assert np.array_equal(a.stamp_ns, b.stamp_ns)
        assert np.array_equal(a.log_time_ns, b.log_time_ns)
        assert np.array_equal(a.sequence, b.sequence)
        assert a.frame_id == b.frame_id
    assert made.metadata["simulated"] == "true"
    assert made.metadata["run_id"] == f"{like.metadata['run_id']}-simulated"
    assert made.metadata["fundamental_hz"] == like.metadata["fundamental_hz"]
    assert "robot.toml" in made.attachments
    assert printed["effects"] == ["stribeck_friction"]


def test_with_its_effect_only_noise_is_left(folder, capsys, estimate):
    full, _ = simulate(capsys, folder, folder / "diagnosis.json", "run.mcap")
    plain, _ = simulate(capsys, folder, estimate, "run.mcap", "plain.mcap")
    for joint in ("joint_1", "joint_2", "joint_3"):
        assert full["rms_difference"][joint] == pytest.approx(logs.NOISE["torque"], rel=0.06)
    for k, channel in enumerate(("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")):
        assert full["rms_difference"][channel] == pytest.approx(logs.NOISE["wrench"][k], rel=0.06)
    assert plain["rms_difference"]["joint_2"] > 1.05 * full["rms_difference"]["joint_2"]


def test_a_motion_that_does_not_repeat(folder, capsys):
    found, _ = simulate(capsys, folder, folder / "diagnosis.json", "free.mcap", "free_simulated.mcap")
    for joint in ("joint_1", "joint_2", "joint_3"):
        assert found["rms_difference"][joint] < 1.15 * logs.NOISE["torque"]


def test_efforts_without_a_plate(folder, capsys):
    logs.write(changed.as_effort(read_recording(folder / "run.mcap")), folder / "effort.mcap")
    found, made = simulate(capsys, folder, folder / "diagnosis.json", "effort.mcap", "effort_simulated.mcap")
    assert [s.topic for s in made.streams] == ["/joint_states"]
    assert set(made.joint_states.data) == {"position", "effort"}
    assert found["rms_difference"]["joint_2"] == pytest.approx(logs.NOISE["torque"], rel=0.06)


def test_what_a_model_does_not_predict_is_left_out_and_said(folder, capsys, tmp_path):
    arguments = ("identify", folder / "run.mcap", "--robot", "ir361", "--model", "internal")
    assert logs.command(capsys, *arguments, "-o", tmp_path / "internal.json")[0] == 0
    found, made = simulate(capsys, folder, tmp_path / "internal.json", "run.mcap", "inside.mcap")
    assert made.wrench is None
    assert "wrench is left out" in found["notes"][0]


def test_the_model_of_another_robot_is_refused(folder, capsys, estimate):
    content = json.loads(estimate.read_text())
    content["description"]["robot_toml"] = content["description"]["robot_toml"].replace(
        'name = "ir361"', 'name = "other"'
    )
    (folder / "other.json").write_text(json.dumps(content))
    arguments = ("simulate", "ir361", "--model", folder / "other.json", "--like", folder / "run.mcap")
    err = logs.refused(capsys, 4, *arguments, "-o", folder / "never.mcap")
    assert "'other'" in err
    assert not (folder / "never.mcap").exists()


def test_the_recording_is_never_overwritten(folder, capsys, estimate):
    before = (folder / "run.mcap").read_bytes()
    arguments = ("simulate", "ir361", "--model", estimate, "--like", folder / "run.mcap")
    logs.refused(capsys, 2, *arguments, "-o", folder / "run.mcap")
    assert (folder / "run.mcap").read_bytes() == before


def test_an_effect_nobody_knows_is_refused(folder, capsys):
    content = json.loads((folder / "diagnosis.json").read_text())
    content["estimate"]["effects"][0]["effect"] = "stribeck_frction"
    (folder / "odd.json").write_text(json.dumps(content))
    arguments = ("simulate", "ir361", "--model", folder / "odd.json", "--like", folder / "run.mcap")
    err = logs.refused(capsys, 2, *arguments, "-o", folder / "never.mcap")
    assert "did you mean 'stribeck_friction'" in err
