"""``residuum identify`` from log to estimate."""

import json

import numpy as np
import pytest

from daq.log_reader import read_recording
from tests.service import synthetic_logs as logs


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    logs.write(logs.recording(), folder / "run.mcap")
    free = {"kind": "validation", "fundamental_hz": None, "periods": None, "harmonics": None}
    logs.write(logs.recording(5, free, motion_seed=7), folder / "validation.mcap")
    return folder


@pytest.fixture(scope="module")
def truth():
    run = logs.clean()
    return dict(zip([p.name for p in run.model.parameters], run.theta, strict=True))


def test_estimate_from_log_to_file(folder, tmp_path, capsys, truth):
    out_file = tmp_path / "estimate.json"
    arguments = (
        "identify",
        folder / "run.mcap",
        "--robot",
        "ir361",
        "--validate",
        folder / "validation.mcap",
        "-o",
        out_file,
    )
    code, out, err = logs.command(capsys, *arguments)
    assert (code, err) == (0, "")
    for text in (
        "internal 28, external 19, combined 34",
        "joint_2.coulomb",
        "Torque constants",
        "Lack of fit",
        "[simulated]",
    ):
        assert text in out
    found = json.loads(out_file.read_text())
    std = {p["name"]: p["std"] for p in found["parameters"]}
    for p in found["parameters"]:
        assert abs(p["value"] - truth[p["name"]]) < 4.5 * std[p["name"]], p["name"]
    for constant, nominal in zip(found["torque_constants"], (0.215, 0.215, 0.155), strict=True):
        assert abs(constant["value"] - nominal) < 4 * constant["std"]
        assert constant["nominal"] == nominal
    for channel, rms in found["rms"]["validation"].items():
        assert rms == pytest.approx(found["noise"][channel], rel=0.15)


def test_json_prints_only_json(folder, capsys):
    code, out, err = logs.command(capsys, "identify", folder / "run.mcap", "--robot", "ir361", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["robot"] == "ir361"


def test_the_estimate_is_the_same_each_time(folder, capsys):
    first, second = (
        json.loads(logs.command(capsys, "identify", folder / "run.mcap", "--robot", "ir361", "--json")[1])
        for _ in range(2)
    )
    for content in (first, second):
        content["provenance"].pop("created")
    assert first == second


@pytest.mark.parametrize(("model", "count"), [("internal", 28), ("external", 25), ("combined", 40)])
def test_models_on_request(folder, capsys, model, count):
    """External and combined carry six plate offsets besides their 19 and 34."""
    code, out, _ = logs.command(
        capsys, "identify", folder / "run.mcap", "--robot", "ir361", "--model", model, "--json"
    )
    found = json.loads(out)
    assert code == 0
    assert found["model"] == model
    assert len(found["parameters"]) == count
    known = [k["value"] for k in found["torque_constants"] if k["value"] is not None]
    assert len(known) == (3 if model == "combined" else 0)
    if model != "combined":
        assert all(k["reason"] for k in found["torque_constants"])


@pytest.mark.parametrize("estimator", ["ols", "ml"])
def test_other_estimators(folder, capsys, estimator, truth):
    code, out, _ = logs.command(
        capsys, "identify", folder / "run.mcap", "--robot", "ir361", "--estimator", estimator, "--json"
    )
    assert code == 0
    for p in json.loads(out)["parameters"]:
        assert abs(p["value"] - truth[p["name"]]) < 5 * p["std"]


def test_joints_in_another_order_give_the_same(folder, tmp_path, capsys):
    plain = read_recording(folder / "run.mcap")
    states = logs.changed(
        plain.joint_states, names=logs.NAMES[::-1], position=plain.joint_states.data["position"][:, ::-1]
    )
    order = (1, 2, 0)
    currents = logs.changed(
        plain.motor_currents,
        names=tuple(logs.NAMES[k] for k in order),
        current=plain.motor_currents.data["current"][:, order],
    )
    from dataclasses import replace

    logs.write(replace(plain, joint_states=states, motor_currents=currents), tmp_path / "turned.mcap")
    found = [
        json.loads(logs.command(capsys, "identify", path, "--robot", "ir361", "--json")[1])
        for path in (folder / "run.mcap", tmp_path / "turned.mcap")
    ]
    assert found[0]["parameters"] == found[1]["parameters"]


def test_the_robot_comes_from_the_log_where_it_carries_one(tmp_path, capsys):
    from dataclasses import replace

    from service.robots import load_robot

    loaded = load_robot("ir361")
    files = {"robot.toml": loaded.toml_text.encode(), "ir361.urdf": loaded.urdf_text.encode()}
    logs.write(replace(logs.recording(), attachments=files), tmp_path / "run.mcap")
    code, out, _ = logs.command(capsys, "identify", tmp_path / "run.mcap", "--json")
    assert code == 0
    assert json.loads(out)["counts"]["combined"] == 34


def test_a_period_nobody_stated_is_inferred(tmp_path, capsys):
    silent = {"fundamental_hz": None, "harmonics": None, "periods": None, "kind": None}
    logs.write(logs.recording(metadata=silent), tmp_path / "run.mcap")
    code, out, _ = logs.command(capsys, "identify", tmp_path / "run.mcap", "--robot", "ir361", "--json")
    method = json.loads(out)["method"]
    assert code == 0
    assert method["fundamental_inferred"]
    assert method["fundamental_hz"] == pytest.approx(0.25, rel=1e-4)
    assert method["periods"] == 6


def test_irregular_stamps_are_used_and_not_the_row_number(tmp_path, capsys, truth):
    """A third of the samples is missing at random: rows taken for time would be far off."""
    from dataclasses import replace

    plain, rng = logs.recording(), np.random.default_rng(0)
    keep = rng.random(len(plain.joint_states)) > 0.33
    thinned = replace(
        plain,
        joint_states=logs.rows(plain.joint_states, keep),
        motor_currents=logs.rows(plain.motor_currents, keep),
    )
    logs.write(thinned, tmp_path / "run.mcap")
    code, out, _ = logs.command(capsys, "identify", tmp_path / "run.mcap", "--robot", "ir361", "--json")
    assert code == 0
    for p in json.loads(out)["parameters"]:
        assert abs(p["value"] - truth[p["name"]]) < 5 * p["std"], p["name"]
