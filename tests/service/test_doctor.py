"""The doctor's findings on machines of paper: every fault comes with its fix."""

import json

import pytest

from service import doctor
from service.cli import main
from service.robots import build_robot, load_robot


def interface(root, name, state="up", queue=128, errors=0, kind=280):
    place = root / name
    (place / "statistics").mkdir(parents=True)
    (place / "type").write_text(str(kind))
    (place / "operstate").write_text(state)
    (place / "tx_queue_len").write_text(str(queue))
    (place / "statistics" / "tx_errors").write_text(str(errors))


@pytest.fixture
def net(tmp_path, monkeypatch):
    root = tmp_path / "net"
    root.mkdir()
    monkeypatch.setattr(doctor, "_NET", root)
    return root


def buses(loaded=None):
    return [finding for finding in doctor.examine(loaded) if finding.area == "bus"]


def test_a_machine_without_can(net):
    interface(net, "eth0", kind=1)
    (found,) = buses()
    assert found.level == "warning"
    assert "slcand" in found.fix


def test_an_interface_that_is_down_gets_its_command(net):
    interface(net, "can0", state="down")
    (found,) = buses()
    assert found.level == "error"
    assert found.fix.startswith("sudo ip link set can0 up type can bitrate 1000000")


def test_a_short_queue_and_errors_are_warnings(net):
    interface(net, "can0", queue=10, errors=7)
    assert [finding.level for finding in buses()] == ["warning", "warning", "ok"]


def connected(bus='[bus]\nchannel = "can7"\n', port="/dev/ttyNONE"):
    plain = load_robot("ir361")
    connection = f'[force_plate.connection]\nprotocol = "bota"\nport = "{port}"\n\n[noise]'
    text = plain.toml_text.replace("[noise]", connection, 1)
    text = text.replace("[force_plate]", f"{bus}\n[force_plate]", 1)
    for node in (1, 2, 3):
        text = text.replace(f'name = "joint_{node}"', f'name = "joint_{node}"\nnode = {node}', 1)
    return build_robot(text, plain.urdf_text, "paper/robot.toml")


def test_the_robots_own_channel_and_port_are_looked_for(net):
    found = {finding.area: finding for finding in doctor.examine(connected()) if finding.level == "error"}
    assert "no CAN interface can7" in found["bus"].sentence
    assert "/dev/ttyNONE does not exist" in found["plate"].sentence


def test_other_adapters_are_python_cans(net):
    assert buses(connected('[bus]\ninterface = "slcan"\n'))[0].level == "ok"
    assert buses(connected('[bus]\ninterface = "semaphore"\n'))[0].level == "error"


def test_a_long_latency_timer_gets_the_rule(tmp_path, net, monkeypatch):
    port = tmp_path / "ttyUSB9"
    port.touch()
    timer = tmp_path / "sys" / "ttyUSB9" / "latency_timer"
    timer.parent.mkdir(parents=True)
    timer.write_text("16\n")
    monkeypatch.setattr(doctor, "SYSFS_ROOT", tmp_path / "sys")
    found = [finding for finding in doctor.examine(connected(port=str(port))) if finding.area == "plate"]
    assert found[0].level == "warning"
    assert "16 ms" in found[0].sentence
    assert "deploy/udev/99-residuum.rules" in found[0].fix


def test_every_fault_has_a_fix(net):
    interface(net, "can0", state="down")
    for finding in doctor.examine(connected()):
        assert finding.sentence.endswith(".")
        assert bool(finding.fix) == (finding.level != "ok")


def test_the_command_exits_with_hardware(net, monkeypatch, capsys):
    monkeypatch.setattr(main, "COMMANDS", {"doctor": ("doctor", "")})
    interface(net, "can0", state="down")
    assert main.run(["doctor", "--json"]) == 3
    content = json.loads(capsys.readouterr().out)
    assert content["fit"] is False
    assert {finding["area"] for finding in content["findings"]} >= {"bus", "plate", "clock", "disk"}
