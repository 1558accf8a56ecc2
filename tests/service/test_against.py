"""``residuum diagnose --against``: changes since, what a simulator lacks; recordings that prove nothing."""

import json

import numpy as np
import pytest

from daq.log_reader import read_recording
from identify.diagnosis.diagnose import DiagnoseOptions
from identify.fit import FitOptions
from service.diagnosing import diagnose_log
from service.errors import EstimateError, LogError
from service.saturation import saturated
from tests.service import changed_logs as changed
from tests.service import synthetic_logs as logs

QUICK = DiagnoseOptions(effects=("stribeck_friction", "load_dependent_friction"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A reference run with its combined and internal estimates."""
    from service.cli.main import run

    folder = tmp_path_factory.mktemp("against")
    logs.write(logs.recording(), folder / "reference.mcap")
    for kind in ("combined", "internal"):
        out = str(folder / f"{kind}.json")
        arguments = ["identify", str(folder / "reference.mcap"), "--robot", "ir361", "--model", kind]
        assert run([*arguments, "-o", out]) == 0
    free = logs.recording(5, changed.VALIDATION, **changed.OTHER_MOTION)
    logs.write(free, folder / "free.mcap")
    return folder


def diagnose(folder, recording, **how):
    path = logs.write(recording, folder / "now.mcap")
    return diagnose_log(path, "ir361", options=QUICK, **how).content


def only(content):
    assert content["verdict"] == "explained", content["against"]["sentence"]
    (finding,) = content["findings"]
    return finding, {p["name"]: (p["value"], p["std"]) for p in finding["parameters"]}


@pytest.mark.parametrize("kind", ["combined", "internal"])
def test_nothing_has_changed(folder, kind):
    content = diagnose(folder, logs.recording(1), against=folder / f"{kind}.json")
    assert content["verdict"] == "consistent"
    assert content["findings"] == []
    assert content["against"]["kind"] == "estimate"
    assert content["against"]["p_value"] > 1e-3
    assert "Nothing has changed" in content["against"]["sentence"]


@pytest.mark.parametrize("kind", ["combined", "internal"])
def test_a_payload_is_named_with_mass_and_place(folder, kind):
    loaded = changed.with_payload(logs.recording(2), 3.0, (0.05, 0.0, 0.3))
    finding, values = only(diagnose(folder, loaded, against=folder / f"{kind}.json"))
    assert (finding["effect"], finding["joint"]) == ("payload", None)
    for name, truth in (("m", 3.0), ("mx", 0.15), ("mz", 0.9)):
        assert abs(values[name][0] - truth) < 4 * values[name][1], name
    assert values["m"][1] < 0.5
    assert "carries a load that the reference did not" in finding["sentence"]


def test_a_demagnetised_motor_is_named(folder):
    weak = changed.with_scaled_current(logs.recording(3), (1.0, 1 / 0.96, 1.0))
    finding, values = only(diagnose(folder, weak, against=folder / "combined.json"))
    assert (finding["effect"], finding["joint"]) == ("torque_constant_error", "joint_2")
    assert abs(values["e"][0] + 0.04) < 4 * values["e"][1]
    assert values["e"][1] < 0.01
    assert "demagnetised" in finding["sentence"]


def test_without_a_plate_a_weaker_motor_bends_the_parameters_in_its_own_way(folder):
    """Half a per cent: too little to see in the residual, plain beside the reference."""
    weak = changed.with_scaled_current(logs.recording(3), (1.0, 1 / 0.995, 1.0))
    finding, values = only(diagnose(folder, weak, against=folder / "internal.json"))
    assert (finding["effect"], finding["joint"]) == ("torque_constant_error", "joint_2")
    assert abs(values["e"][0] + 0.005) < 4 * values["e"][1]


def test_a_dragging_brake_is_named(folder):
    def drag(q, qd, qdd):
        return np.stack([0 * qd[0], 0 * qd[1], 4.0 * np.sign(qd[2])])

    worn = changed.with_torque(logs.recording(4), drag)
    finding, values = only(diagnose(folder, worn, against=folder / "combined.json"))
    assert (finding["effect"], finding["joint"]) == ("friction_change", "joint_3")
    assert abs(values["coulomb"][0] - 4.0) < 4 * values["coulomb"][1]
    assert abs(values["viscous"][0]) < 4 * values["viscous"][1]


def test_two_changes_at_once(folder):
    both = changed.with_scaled_current(changed.with_payload(logs.recording(6)), (1 / 0.95, 1.0, 1.0))
    content = diagnose(folder, both, against=folder / "combined.json")
    named = {(f["effect"], f["joint"]) for f in content["findings"]}
    assert named == {("payload", None), ("torque_constant_error", "joint_1")}


def edited(folder, change):
    content = json.loads((folder / "combined.json").read_text())
    toml = content["description"]["robot_toml"]
    content["description"]["robot_toml"] = change(toml)
    (folder / "edited.json").write_text(json.dumps(content))
    return folder / "edited.json"


def test_the_estimate_of_another_robot_is_refused(folder, capsys):
    other = edited(folder, lambda text: text.replace('name = "ir361"', 'name = "other"'))
    arguments = ("diagnose", folder / "reference.mcap", "--robot", "ir361", "--against", other)
    assert "'other'" in logs.refused(capsys, 4, *arguments)


def test_a_reference_with_another_gear_is_refused(folder, capsys):
    other = edited(folder, lambda text: text.replace("94.147", "96.0"))
    arguments = ("diagnose", folder / "reference.mcap", "--robot", "ir361", "--against", other)
    assert "gear ratio" in logs.refused(capsys, 4, *arguments)


def test_a_reference_of_another_kind_is_refused(folder):
    with pytest.raises(EstimateError, match="combined model"):
        diagnose_log(
            folder / "reference.mcap",
            "ir361",
            fit_options=FitOptions(kind="internal"),
            against=folder / "combined.json",
        )


@pytest.fixture(scope="module")
def simulated(folder):
    """The plain model's own version of a run with sticking in joint 2."""
    from service.cli.main import run

    sticky = changed.with_torque(logs.recording(8), changed.sticking(8.0, 0.2))
    logs.write(sticky, folder / "sticky.mcap")
    arguments = ["simulate", "ir361", "--model", str(folder / "combined.json")]
    arguments += ["--like", str(folder / "sticky.mcap"), "-o", str(folder / "simulated.mcap")]
    assert run(arguments) == 0
    return folder / "simulated.mcap"


def test_what_a_simulator_lacks_is_split_into_parts(folder, simulated):
    content = diagnose_log(folder / "sticky.mcap", "ir361", options=QUICK, against=simulated).content
    found = content["against"]
    assert found["kind"] == "simulation"
    assert found["same_motion"]
    assert found["effects"] == ["stribeck_friction"]
    for channel, item in found["channels"].items():
        assert sum(item["shares"].values()) == pytest.approx(1.0), channel
        assert item["rest"] == pytest.approx(item["noise"], rel=0.15), channel
        assert abs(item["shares"]["rest"]) < 0.2, channel
    joint = found["channels"]["joint_2"]
    assert joint["effects"] > 0.5
    assert joint["difference"] > 1.2 * joint["noise"]


def test_a_simulators_wrong_parameters_show_as_such(folder, simulated):
    """The same simulation with 10 % too much current in joint 1 throughout."""
    wrong = changed.with_scaled_current(read_recording(simulated), (1.1, 1.0, 1.0))
    logs.write(wrong, folder / "wrong.mcap")
    path = folder / "sticky.mcap"
    found = diagnose_log(path, "ir361", options=QUICK, against=folder / "wrong.mcap").content["against"]
    joint = found["channels"]["joint_1"]
    assert joint["shares"]["parameters"] > 0.8
    assert joint["rest"] == pytest.approx(joint["noise"], rel=0.15)


def test_a_simulation_on_another_motion_is_compared_through_the_model(folder, simulated):
    from service.cli.main import run

    out = folder / "elsewhere.mcap"
    arguments = ["simulate", "ir361", "--model", str(folder / "combined.json")]
    assert run([*arguments, "--like", str(folder / "free.mcap"), "-o", str(out)]) == 0
    path = folder / "sticky.mcap"
    found = diagnose_log(path, "ir361", options=QUICK, against=out).content["against"]
    assert not found["same_motion"]
    assert "motions differ" in found["sentence"]
    assert found["channels"]["joint_2"]["effects"] > 0.5
    assert found["channels"]["joint_1"]["parameters"] < 3 * found["channels"]["joint_1"]["noise"]


def test_a_held_out_recording_of_this_robot_counts(folder):
    content = diagnose(folder, logs.recording(1), validate_path=folder / "free.mcap")
    assert content["fit"]["validation"]["rejected"] == []
    assert set(content["fit"]["validation"]["before"]) > {"joint_1", "force.x"}


def test_another_load_in_the_held_out_recording_is_said_and_not_averaged_in(folder):
    free = logs.recording(5, changed.VALIDATION, **changed.OTHER_MOTION)
    logs.write(changed.with_payload(free, 4.0, **changed.OTHER_MOTION), folder / "loaded.mcap")
    content = diagnose(folder, logs.recording(1), validate_path=folder / "loaded.mcap")
    (reason,) = content["fit"]["validation"]["rejected"]
    assert reason["kind"] == "payload"
    assert content["fit"]["validation"]["before"] == {}
    assert any("another load" in text for text in content["warnings"])
    assert content["findings"] == []


def test_a_moved_plate_is_said_and_its_channels_left_out(folder):
    free = logs.recording(5, changed.VALIDATION, **changed.OTHER_MOTION)
    logs.write(changed.with_moved_plate(free), folder / "moved.mcap")
    content = diagnose(folder, logs.recording(1), validate_path=folder / "moved.mcap")
    (reason,) = content["fit"]["validation"]["rejected"]
    assert reason["kind"] == "plate_moved"
    assert "about z +10" in reason["sentence"]
    assert set(content["fit"]["validation"]["before"]) == {"joint_1", "joint_2", "joint_3"}


def test_clipped_currents_are_left_out_and_said(folder):
    clipped, limit = changed.with_clipped_current(logs.recording(1))
    content = diagnose(folder, clipped)
    assert any("is clipped at" in text and f"{limit:.4g}" in text for text in content["warnings"])
    assert content["verdict"] == "consistent", "what is beyond the range must not look like physics"


def test_a_channel_clipped_most_of_the_time_is_refused(folder):
    clipped, _ = changed.with_clipped_current(logs.recording(1), share=0.4)
    with pytest.raises(LogError, match="widen the sensor's range"):
        diagnose(folder, clipped)


def test_noise_and_constants_are_not_taken_for_clipping():
    rng = np.random.default_rng(0)
    coarse = np.round(np.sin(np.arange(4000) / 90) * 50 + rng.normal(size=4000))
    assert not saturated(rng.normal(size=4000))[0].any()
    assert not saturated(np.zeros(4000))[0].any()
    assert saturated(coarse)[0].mean() < 0.01
    assert saturated(np.clip(coarse, -45, 45))[0].mean() > 0.1


def test_less_than_two_periods_is_refused(folder, capsys):
    short = logs.recording(1, {"periods": None})
    keep = (short.joint_states.stamp_ns - logs.START_NS) * 1e-9 < 7.0
    states = logs.rows(short.joint_states, keep)
    currents = logs.rows(short.motor_currents, keep)
    wrench = logs.rows(short.wrench, (short.wrench.stamp_ns - logs.START_NS) * 1e-9 < 7.0)
    from dataclasses import replace

    logs.write(replace(short, joint_states=states, motor_currents=currents, wrench=wrench), folder / "s.mcap")
    err = logs.refused(capsys, 4, "diagnose", folder / "s.mcap", "--robot", "ir361")
    assert "two" in err
    assert "period" in err
