"""Recordings of real machines: published figures, and honesty about what cannot be known."""

import json
from pathlib import Path

import pytest

from tests.daq.logs import shared
from tests.service.synthetic_logs import command

pytestmark = pytest.mark.shared
ROOT = Path(__file__).parents[2]


def case(capsys, folder, name, recording, robot="robot.toml", *options):
    """Import a recording as its case page says, identify it, give the estimate."""
    description, log = ROOT / "docs" / "cases" / name / robot, folder / f"{name}.mcap"
    source, mapping = shared(f"real/{recording}"), ROOT / "docs" / "maps" / f"{name}.toml"
    code, _, err = command(capsys, "import", source, "--map", mapping, "--robot", description, "-o", log)
    assert (code, err) == (0, "")
    code, out, err = command(capsys, "identify", log, "--robot", description, "--json", *options)
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert not found["simulated"]
    return found, {p["name"]: p for p in found["parameters"]}


RECIPE = ("--free", "--bandwidth", "100", "--decimate", "10", "--trim", "49")


def test_emps_symmetric(tmp_path, capsys):
    found, p = case(capsys, tmp_path, "emps", "emps.csv", "robot.toml", *RECIPE)
    assert found["relative_error_percent"]["axis"] == pytest.approx(4.083, abs=0.1)
    for name, value in (
        ("carriage.m", 95.109),
        ("axis.viscous", 203.50),
        ("axis.coulomb", 20.39),
        ("axis.offset", -3.16),
    ):
        assert p[name]["value"] == pytest.approx(value, rel=0.005), name
        assert abs(p[name]["value"] - value) < p[name]["std"]
    assert (p["carriage.m"]["unit"], p["axis.viscous"]["unit"], p["axis.coulomb"]["unit"]) == (
        "kg",
        "N.s/m",
        "N",
    )


def test_emps_asymmetric(tmp_path, capsys):
    """Published per direction: Fv+ 166.7, Fc+ 20.1, Fv- 240.4, Fc- 20.6."""
    found, p = case(capsys, tmp_path, "emps", "emps.csv", "asymmetric.toml", *RECIPE)
    assert found["relative_error_percent"]["axis"] == pytest.approx(3.112, abs=0.1)
    v, a, c, o = (
        p[f"axis.{term}"]["value"] for term in ("viscous", "asymmetric_viscous", "coulomb", "offset")
    )
    assert p["carriage.m"]["value"] == pytest.approx(95.154, rel=0.002)
    assert (v + a, v - a) == pytest.approx((166.7, 240.4), rel=0.005)
    assert (c + o, c - o) == pytest.approx((20.1, 20.6), rel=0.01)


def test_tx40_friction(tmp_path, capsys):
    options = ("--free", "--bandwidth", "100", "--decimate", "10", "--trim", "20", "--slow", "0.03")
    found, p = case(capsys, tmp_path, "tx40", "tx40.npz", "robot.toml", *options)
    published = {
        "joint_1.viscous": 8.09,
        "joint_1.coulomb": 7.01,
        "joint_2.viscous": 5.59,
        "joint_3.viscous": 1.98,
        "joint_6.viscous": 0.64,
    }
    for name, value in published.items():
        assert p[name]["value"] == pytest.approx(value, rel=0.03), name
    # the published model gives joint 5 what motors 5 and 6 share here: 1.85 against their sum
    both = p["joint_5.viscous"]["value"] + p["joint_6.viscous"]["value"]
    assert both == pytest.approx(1.85, rel=0.10)
    assert len(p) == 58
    assert all(
        k["value"] is None and "without the force plate" in k["reason"] for k in found["torque_constants"]
    )


def test_an_unloaded_motor_says_what_cannot_be_known(tmp_path, capsys):
    found, _ = case(capsys, tmp_path, "bldc_bench", "bldc_bench.npz")
    assert found["torque_constants"][0]["value"] is None
    assert "without the force plate" in found["torque_constants"][0]["reason"]
    assert any("No torque constant is known of bldc" in text for text in found["warnings"])
    assert found["lack_of_fit"]["p"] is None
    assert "does not repeat" in found["lack_of_fit"]["reason"]
    assert not found["intervals_valid"]


def test_ur10_claims_no_period(tmp_path, capsys):
    found, p = case(capsys, tmp_path, "ur10", "ur10_exciting_trajectory.db3")
    assert not found["method"]["periodic"]
    assert found["lack_of_fit"]["p"] is None
    assert any("does not repeat" in text for text in found["warnings"])
    assert len(p) == 54
    assert all(k["value"] is None for k in found["torque_constants"])


def test_ur10_names_the_joints_that_repeat_when_asked(tmp_path, capsys):
    """Joints 1 and 3 repeat at 13.76 s, the others do not: a period must not be inferred from them."""
    from dataclasses import replace

    from daq.log_reader import read_recording
    from daq.log_writer import write_recording

    case(capsys, tmp_path, "ur10", "ur10_exciting_trajectory.db3")
    log = read_recording(tmp_path / "ur10.mcap")
    metadata = {key: value for key, value in log.metadata.items() if key != "kind"}
    write_recording(replace(log, metadata=metadata), tmp_path / "silent.mcap")
    robot = ROOT / "docs" / "cases" / "ur10" / "robot.toml"
    code, out, _ = command(capsys, "identify", tmp_path / "silent.mcap", "--robot", robot, "--json")
    assert code == 0
    found = json.loads(out)
    assert not found["method"]["periodic"]
    text = " ".join(found["warnings"])
    assert "no period is inferred" in text or "no period common" in text
    stated = {**metadata, "fundamental_hz": "0.0727"}
    write_recording(replace(log, metadata=stated), tmp_path / "stated.mcap")
    code, _, err = command(capsys, "identify", tmp_path / "stated.mcap", "--robot", robot, "--json")
    assert code == 4
    assert "fundamental_hz = 0.0727" in err
