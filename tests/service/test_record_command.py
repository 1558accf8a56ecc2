"""The record command: its output, its exit codes, its refusals."""

import json

import pytest

from daq.log_reader import read_recording
from drivers.virtual.plant_file import load_plant
from service.benches import bus_config, parse_effect, plant_for
from service.cli import main
from service.errors import UsageError
from service.robots import load_robot
from tests.service.test_doctor import connected

JOINTS = ["joint_1", "joint_2", "joint_3"]


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Runs ``residuum record ir361`` with a short excitation; returns exit code, output and complaint."""
    monkeypatch.setattr(main, "COMMANDS", {"record": ("record", "")})
    excitation = tmp_path / "e.json"
    content = {
        "joints": JOINTS, "fundamental_hz": 1.0, "sample_rate_hz": 150.0, "offset": [0.1, 0.0, 0.0],
        "cosine": [[0.05]] * 3, "sine": [[0.0]] * 3,
    }

    def run(*arguments, **changes):
        excitation.write_text(json.dumps({**content, **changes}))
        code = main.run(["record", "ir361", "--excitation", str(excitation), *map(str, arguments)])
        out = capsys.readouterr()
        return code, out.out, out.err

    return run


def test_a_virtual_run_from_the_command_line(command, tmp_path):
    log = tmp_path / "run.mcap"
    code, out, err = command("-o", log, "--virtual", "--periods", 2, "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert report["state"] == "recorded"
    assert report["missing_cycles"] == []
    assert report["cycles"] == report["planned"] == report["written"]
    assert read_recording(log).metadata["simulated"] == "true"


def test_effects_reach_the_robot_and_the_log(command, tmp_path):
    logs = [tmp_path / "plain.mcap", tmp_path / "heavy.mcap"]
    command("-o", logs[0], "--virtual", "--periods", 1)
    effect = ["--effect", "payload=5"]
    code, _, err = command("-o", logs[1], "--virtual", "--periods", 1, *effect)
    assert (code, err) == (0, "")
    plain, heavy = (read_recording(log) for log in logs)
    assert heavy.wrench.data["force"][:, 2].mean() - plain.wrench.data["force"][:, 2].mean() > 40.0
    assert heavy.metadata["effects"].startswith("payload")


def test_refusals_are_sentences_with_codes(command, tmp_path):
    code, _, err = command("-o", tmp_path / "x.mcap")
    assert code == 3
    assert "--virtual" in err
    code, _, err = command("-o", tmp_path / "x.mcap", "--virtual", joints=["a", "b", "c"])
    assert code == 2
    assert "design an excitation for this robot" in err
    code, _, err = command("-o", tmp_path / "x.mcap", "--virtual", cosine=[[5.0], [0.1], [0.1]])
    assert code == 2
    assert "joint_1 reaches the position" in err
    code, _, err = command("-o", tmp_path / "no" / "x.mcap", "--virtual")
    assert code == 2
    assert "does not exist" in err
    code, _, err = command("-o", tmp_path / "x.mcap", "--virtual", "--rate", "137")
    assert code == 2
    assert "137" in err
    (tmp_path / "y.mcap.partial").touch()
    code, _, err = command("-o", tmp_path / "y.mcap", "--virtual")
    assert code == 2
    assert "recover" in err
    assert not list(tmp_path.glob("x.mcap*"))


def test_a_dry_run_writes_nothing(command, tmp_path):
    code, out, _ = command("-o", tmp_path / "x.mcap", "--dry-run", "--json")
    assert code == 0
    found = json.loads(out)
    assert found["cycles"] > 17 * 150
    assert not (tmp_path / "x.mcap").exists()


@pytest.mark.parametrize(
    ("text", "joint", "channel", "parameters"),
    [
        ("stribeck_friction:joint_2=6", "joint_2", None, {"excess_nm": 6.0}),
        ("stribeck_friction:joint_2", "joint_2", None, {}),
        ("stribeck_friction:joint_2=6,speed_rad_s=0.06", "joint_2", None,
         {"excess_nm": 6.0, "speed_rad_s": 0.06}),
        ("plate_gain_error:force.z=0.05", None, "force.z", {"share": 0.05}),
        ("payload=2", None, None, {"mass_kg": 2.0}),
    ],
)
def test_effects_are_read(text, joint, channel, parameters):
    effect = parse_effect(text)
    assert (effect.joint, effect.channel) == (joint, channel)
    assert effect.name == text.split(":")[0].split("=")[0]
    assert sorted(effect.parameters.values()) == sorted(parameters.values())


@pytest.mark.parametrize("text", ["stribeck_friction:joint_2=many", "stribeck_friction:joint_2=1,2"])
def test_bad_sizes_are_wrong_use(text):
    with pytest.raises(UsageError):
        parse_effect(text)


def test_a_bus_is_read_from_the_robot_file():
    config = bus_config(connected('[bus]\nchannel = "can7"\nbitrate_hz = 500000\n'), 150.0)
    assert config.can.channel == "can7"
    assert config.can.bitrate_hz == 500_000
    assert [(axis.name, axis.node) for axis in config.axes] == list(zip(JOINTS, (1, 2, 3), strict=True))
    assert config.axes[0].gear_ratio == pytest.approx(94.147)


def test_the_virtual_robot_stands_where_the_robot_file_says():
    plant = plant_for(load_robot("ir361"))
    assert plant.joint_names == tuple(JOINTS)
    assert plant.plate is not None
    assert plant.joints == load_plant("ir361").joints
