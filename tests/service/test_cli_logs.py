"""The commands about logs: their output, their JSON, their exit codes."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from typer import Typer
from typer.main import get_command

from daq.errors import DaqError
from daq.log_reader import read_recording
from daq.log_writer import write_recording
from service.cli.import_ import import_
from service.cli.inspect import inspect
from service.cli.recover import recover
from tests.daq import logs

COMMANDS = {"inspect": inspect, "recover": recover, "import": import_}


def run(*arguments):
    """Exit code, stdout and the error's sentence, as the program's entry point maps them."""
    app = Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command()(COMMANDS[arguments[0]])
    result = CliRunner().invoke(get_command(app), [str(item) for item in arguments[1:]])
    if isinstance(result.exception, DaqError):
        return result.exception.exit_code, result.stdout, str(result.exception)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, ""


@pytest.fixture
def log(tmp_path):
    write_recording(logs.recording(count=1500, fundamental_hz="1.0"), tmp_path / "run.mcap")
    return tmp_path / "run.mcap"


def test_inspect_says_what_it_is_fit_for(log):
    code, out, _ = run("inspect", log)
    assert code == 0
    assert "fit for periodic identification" in out
    assert "/force_plate/wrench" in out
    assert "1.000000 s" in out


def test_inspect_json(log):
    code, out, _ = run("inspect", log, "--json")
    assert code == 0
    found = json.loads(out)
    assert found["verdict"] == "fit for periodic identification"
    assert found["streams"][0]["samples"] == 1500


def test_inspect_refuses_the_unfit_in_one_sentence(tmp_path):
    recording = logs.recording()
    recording.joint_states.data["position"][7, 0] = np.nan
    write_recording(recording, tmp_path / "nan.mcap")
    code, out, sentence = run("inspect", tmp_path / "nan.mcap", "--json")
    assert code == 4
    assert json.loads(out)["problems"][0]["code"] == "not_finite"
    assert "NaN" in sentence
    assert "\n" not in sentence


@pytest.mark.parametrize("content", [b"", b"not a log at all"])
def test_inspect_refuses_what_is_no_log(tmp_path, content):
    (tmp_path / "x.mcap").write_bytes(content)
    code, out, sentence = run("inspect", tmp_path / "x.mcap")
    assert (code, out) == (4, "")
    assert "is not an MCAP log" in sentence


def test_a_truncated_log_is_refused_then_recovered(log, tmp_path):
    log.write_bytes(log.read_bytes()[:-3000])
    code, _, sentence = run("inspect", log)
    assert code == 4
    assert "residuum recover" in sentence
    code, out, _ = run("recover", log, "-o", tmp_path / "whole.mcap")
    assert code == 0
    assert "/joint_states" in out
    assert run("inspect", tmp_path / "whole.mcap")[0] == 0
    code, out, _ = run("recover", log, "-o", tmp_path / "again.mcap", "--json")
    assert code == 0
    assert json.loads(out)["topics"][0]["topic"] == "/joint_states"


def test_recover_never_overwrites_its_source(log):
    before = log.read_bytes()
    code, _, sentence = run("recover", log, "-o", log)
    assert code == 2
    assert "another name" in sentence
    assert log.read_bytes() == before


def test_unwritable_outputs_are_wrong_use(log, tmp_path):
    code, _, sentence = run("recover", log, "-o", tmp_path / "no" / "w.mcap")
    assert code == 2
    assert "cannot write" in sentence


def test_import_a_table(tmp_path):
    rows = [f"{0.01 * i:.2f},{np.sin(i / 10):.6f},{i % 7}" for i in range(100)]
    (tmp_path / "r.csv").write_text("t,q,f\n" + "\n".join(rows) + "\n0.5,1\n")
    (tmp_path / "m.toml").write_text(
        '[time]\ncolumn = "t"\n[position]\ncolumn = "q"\nunit = "m"\n[effort]\ncolumn = "f"\nunit = "N"\n'
    )
    arguments = ("import", tmp_path / "r.csv", "--map", tmp_path / "m.toml", "-o", tmp_path / "run.mcap")
    code, _, sentence = run(*arguments)
    assert code == 4
    assert "row 102" in sentence
    assert not (tmp_path / "run.mcap").exists()
    code, out, _ = run(*arguments, "--drop-bad-rows", "--json")
    assert code == 0
    assert json.loads(out)["dropped_rows"] == 1
    assert len(read_recording(tmp_path / "run.mcap").joint_states) == 100


@pytest.mark.shared
def test_import_for_a_robot_carries_its_files(tmp_path):
    sample = logs.shared("ir361/samples/plain.validation.mcap")
    (tmp_path / "m.toml").write_text('[metadata]\nkind = "validation"\n')
    robot = logs.shared("ir361/robot.toml")
    code, out, _ = run(
        "import", sample, "--map", tmp_path / "m.toml", "--robot", robot, "-o", tmp_path / "v.mcap"
    )
    assert code == 0, out
    recording = read_recording(tmp_path / "v.mcap")
    assert recording.attachments["robot.toml"] == robot.read_bytes()
    assert recording.metadata["robot"] == "ir361"
    logs.assert_same(recording, read_recording(sample))
