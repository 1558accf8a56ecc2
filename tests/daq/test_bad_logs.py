"""Damaged, unfinished and senseless logs: refused in one sentence, saved by recovery."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from daq.checks import check_recording
from daq.errors import DamagedLogError, DaqError, DataError, NotALogError, UsageError
from daq.log_reader import read_recording
from daq.log_writer import LogWriter, write_recording
from daq.recovery import recover
from tests.daq import logs


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A log of 15 chunks of a fifth of a second each."""
    path = tmp_path_factory.mktemp("logs") / "whole.mcap"
    recording = logs.recording(count=450)
    with LogWriter(path, recording.metadata, recording.attachments) as log:
        for start in range(0, 450, 30):
            log.write_streams([part(stream, start, start + 30) for stream in recording.streams])
    return path


def part(stream, start, stop):
    cut = slice(start, stop)
    return replace(
        stream,
        stamp_ns=stream.stamp_ns[cut],
        log_time_ns=stream.log_time_ns[cut],
        sequence=stream.sequence[cut],
        data={k: v[cut] for k, v in stream.data.items()},
    )


def changed(whole, tmp_path, content):
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    return path


def one_sentence(error):
    text = str(error)
    assert "\n" not in text
    assert text.endswith(".")
    assert "Traceback" not in text


@pytest.mark.parametrize("content", [b"", b"hello world, this is no log", b"\x89PNG\r\n\x1a\n" * 9])
def test_what_is_no_log_is_said_to_be_none(tmp_path, content):
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(NotALogError) as caught:
        read_recording(path)
    one_sentence(caught.value)
    assert caught.value.exit_code == 4


def test_a_missing_file_is_wrong_use(tmp_path):
    with pytest.raises(UsageError) as caught:
        read_recording(tmp_path / "none.mcap")
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("share", [0.01, 0.3, 0.7, 0.999])
def test_a_truncated_log_is_refused_and_recovered(whole, tmp_path, share):
    content = whole.read_bytes()
    path = changed(whole, tmp_path, content[: int(len(content) * share)])
    with pytest.raises(DamagedLogError, match="residuum recover") as caught:
        read_recording(path)
    one_sentence(caught.value)
    if share < 0.3:
        with pytest.raises(DataError, match="nothing can be recovered"):
            recover(path, tmp_path / "new.mcap")
        return
    found = recover(path, tmp_path / "new.mcap")
    new, old = read_recording(tmp_path / "new.mcap"), read_recording(whole)
    count = len(new.joint_states)
    assert found.topics[0].recovered == count
    assert count > 450 * (share - 0.15)
    np.testing.assert_array_equal(
        new.joint_states.data["position"], old.joint_states.data["position"][:count]
    )
    assert new.metadata == old.metadata
    assert new.attachments == old.attachments


def test_a_torn_chunk_gives_what_it_has(tmp_path):
    recording = logs.recording(count=6000)
    write_recording(recording, tmp_path / "one.mcap")
    content = (tmp_path / "one.mcap").read_bytes()
    path = changed(None, tmp_path, content[: int(len(content) * 0.3)])
    found = recover(path, tmp_path / "new.mcap")
    assert found.torn_messages > 1000
    assert not found.finished
    new = read_recording(tmp_path / "new.mcap")
    count = len(new.wrench)
    np.testing.assert_array_equal(new.wrench.data["force"], recording.wrench.data["force"][:count])


def test_a_flipped_bit_is_found_and_its_chunk_dropped(whole, tmp_path):
    content = bytearray(whole.read_bytes())
    content[len(content) // 2] ^= 1
    path = changed(whole, tmp_path, bytes(content))
    with pytest.raises(DamagedLogError, match=r"damaged at byte \d+"):
        read_recording(path)
    found = recover(path, tmp_path / "new.mcap")
    joints = found.topics[0]
    assert len(found.damaged_chunks) == 1
    assert joints.recovered == 420
    assert joints.holes == joints.largest_hole == joints.in_damaged_chunks == 30
    assert "1 damaged chunks were dropped" in found.sentence
    assert len(read_recording(tmp_path / "new.mcap").joint_states) == 420


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_no_flipped_bit_goes_unnoticed(whole, tmp_path, data):
    """Every byte lies under some checksum: a flip is refused, never read as other numbers."""
    content = bytearray(whole.read_bytes())
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] ^= 1 << data.draw(st.integers(0, 7))
    path = changed(whole, tmp_path, bytes(content))
    with pytest.raises(DaqError) as caught:
        read_recording(path)
    one_sentence(caught.value)
    assert caught.value.exit_code == 4


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_recovery_survives_any_damage_and_invents_nothing(whole, tmp_path, data):
    content = bytearray(whole.read_bytes())
    start = data.draw(st.integers(8, len(content) - 2))
    junk = data.draw(st.binary(max_size=40))
    content[start : start + data.draw(st.integers(0, 400))] = junk
    path = changed(whole, tmp_path, bytes(content))
    try:
        recover(path, tmp_path / "new.mcap")
        new = read_recording(tmp_path / "new.mcap")
    except DataError:
        return
    old = read_recording(whole).joint_states
    at = np.searchsorted(old.sequence, new.joint_states.sequence)
    np.testing.assert_array_equal(new.joint_states.data["position"], old.data["position"][at])


def test_a_crash_leaves_a_partial_log(tmp_path):
    with pytest.raises(RuntimeError), LogWriter(tmp_path / "run.mcap") as log:
        for i in range(10):
            log.write_joint_states(logs.START_NS + i, logs.START_NS + i, i, ("a",), [float(i)])
        log.flush()
        raise RuntimeError("the process dies")
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap.partial"]
    with pytest.raises(UsageError, match="unfinished log"):
        LogWriter(tmp_path / "run.mcap")
    recover(tmp_path / "run.mcap.partial", tmp_path / "whole.mcap")
    assert len(read_recording(tmp_path / "whole.mcap").joint_states) == 10


def test_kill_9_loses_nothing_that_was_flushed(tmp_path):
    import subprocess
    import sys

    script = (
        "import os, signal\nfrom daq.log_writer import LogWriter\n"
        f"log = LogWriter({str(tmp_path / 'run.mcap')!r})\n"
        "for i in range(500):\n"
        f"    log.write_joint_states({logs.START_NS} + i, i, i, ('a',), [float(i)])\n"
        "    if i == 399: log.flush()\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=False)
    recover(tmp_path / "run.mcap.partial", tmp_path / "whole.mcap")
    assert len(read_recording(tmp_path / "whole.mcap").joint_states) >= 400


def test_an_unwritable_place_is_wrong_use(tmp_path):
    with pytest.raises(UsageError, match="cannot write") as caught:
        write_recording(logs.recording(count=5), tmp_path / "no" / "such" / "run.mcap")
    assert caught.value.exit_code == 2


def test_values_that_do_not_fit_are_wrong_use(tmp_path):
    with LogWriter(tmp_path / "x.mcap") as log:
        with pytest.raises(UsageError, match="cannot be written"):
            log.write_joint_states(logs.START_NS, logs.START_NS, 0, ("a", "b"), [1.0])
        with pytest.raises(UsageError, match="takes exactly"):
            log.write_raw("/clock_sync", logs.START_NS, logs.START_NS, 0, device="d")
        log.write_joint_states(logs.START_NS, logs.START_NS, 0, ("a",), [1.0])


def spoiled(how, where=100):
    recording = logs.recording()
    joints = recording.joint_states
    stamp, position = joints.stamp_ns.copy(), joints.data["position"].copy()
    how(stamp, position, where)
    return replace(recording, joint_states=replace(joints, stamp_ns=stamp, data={"position": position}))


def put(value):
    return lambda stamp, position, i: position.__setitem__((i, 1), value)


def shift(stop, by_ns):
    return lambda stamp, position, i: stamp.__setitem__(
        slice(i, stop and i + stop), stamp[i : stop and i + stop] + by_ns
    )


@pytest.mark.parametrize(
    ("code", "how"),
    [
        ("not_finite", put(np.nan)),
        ("not_finite", put(-np.inf)),
        ("absurd", put(1e306)),
        ("repeated", lambda stamp, position, i: stamp.__setitem__(i, stamp[i - 1])),
        ("backward", lambda stamp, position, i: stamp.__setitem__(i, stamp[i - 2])),
        ("backward", shift(None, -(10**9))),
        ("jump", shift(None, 10**9)),
        ("epoch", lambda stamp, position, i: stamp.__setitem__(i, 12345)),
        ("epoch", lambda stamp, position, i: stamp.__isub__(logs.START_NS)),
    ],
)
def test_senseless_data_are_named(code, how):
    problems = check_recording(spoiled(how))
    found = {problem.code: problem for problem in problems}
    assert code in found
    one_sentence(found[code])
    assert found[code].row in (0, 100)
    assert "/joint_states" in found[code].sentence


def test_sane_data_have_no_problem_and_losses_are_no_jump():
    recording = logs.recording()
    assert check_recording(recording) == []
    keep = np.ones(600, bool)
    keep[200:280] = False
    joints = recording.joint_states
    lossy = replace(
        joints,
        stamp_ns=joints.stamp_ns[keep],
        log_time_ns=joints.log_time_ns[keep],
        sequence=joints.sequence[keep],
        data={"position": joints.data["position"][keep]},
    )
    assert check_recording(replace(recording, joint_states=lossy)) == []


def test_streams_of_other_times_are_named():
    recording = logs.recording()
    late = replace(recording.wrench, stamp_ns=recording.wrench.stamp_ns + 10**12)
    assert [p.code for p in check_recording(replace(recording, wrench=late))] == ["apart"]
