"""The path of real hardware, from the robot file on: python-can by name, a serial port, the host's clock."""

import json

from daq.log_reader import read_recording
from daq.run_state import RunState
from drivers.canopen.fake.axis import InertiaAxis, InertiaPlant
from drivers.canopen.fake.contents import DriveData
from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.fake.realtime import RealTimeFleet
from drivers.force_plate.fake import FakePlate
from drivers.force_plate.fake_port import FakePort
from drivers.force_plate.protocols import protocol_named
from drivers.force_plate.wrench_source import ConstantLoad
from service.errors import RunFailedError
from service.recordings import RecordRequest, open_session
from service.robots import load_robot
from tests.service.test_doctor import connected

RATE_HZ = 25.0
BUS = """[bus]
interface = "virtual"
channel = "real-path"
heartbeat_ms = 100
heartbeat_patience = 10.0
rate_hz = 25.0
[limits]
following_error = 0.5
"""


def write_robot(folder, port):
    loaded = connected(BUS, port)
    (folder / "robot.toml").write_text(loaded.toml_text)
    (folder / loaded.file.urdf).write_text(load_robot("ir361").urdf_text)
    content = {
        "joints": ["joint_1", "joint_2", "joint_3"], "fundamental_hz": 1.0, "offset": [0.1, 0.0, 0.0],
        "cosine": [[0.02]] * 3, "sine": [[0.0]] * 3,
    }
    (folder / "e.json").write_text(json.dumps(content))


def test_a_run_by_the_robot_file_alone(tmp_path):
    plate = FakePlate(protocol_named("bota"), ConstantLoad((0.0, 0.0, 900.0, 0.0, 0.0, 0.0)))
    with FakePort(plate) as port:
        write_robot(tmp_path, port.port)
        request = RecordRequest(
            str(tmp_path / "robot.toml"), tmp_path / "e.json", tmp_path / "run.mcap", periods=2
        )
        session = open_session(request)
        gears = [axis.gear_ratio for axis in session.bench.drives.config.axes]
        nameplates = [DriveData(node=i + 1, gear_ratio=gear) for i, gear in enumerate(gears)]
        plant = InertiaPlant([InertiaAxis(period_s=1.0 / RATE_HZ) for _ in nameplates])
        with RealTimeFleet(Fleet(nameplates, plant), "real-path"):
            try:
                report = session.run()
            except RunFailedError as error:  # a busy machine may stall the fakes: then it must say where
                report = error.report
                assert report.missing or report.torn or report.causes
    recording = read_recording(tmp_path / "run.mcap")
    facts = recording.metadata
    assert facts["simulated"] == "false"
    assert facts["proof"] == report.proof
    expected = set(range(session.acquisition.plan.first, min(report.cycles, session.acquisition.plan.stop)))
    assert expected - set(recording.joint_states.sequence.tolist()) == expected & set(report.missing_cycles)
    if report.state is RunState.RECORDED:
        assert abs(recording.wrench.data["force"][:, 2].mean() - 900.0) < 1e-3
        assert len(recording.joint_states) == 3 * RATE_HZ
