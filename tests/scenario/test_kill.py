"""A process killed at a random moment of a run loses at most a second, and what is left is a valid log."""

import json
import os
import random
import signal
import struct
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from daq.log_reader import read_raw, read_recording
from daq.raw_records import NO_CYCLE
from service.salvage import salvage_run

ROOT = Path(__file__).resolve().parents[2]
RATE_HZ = 50.0  # slow: the machine that tests may be busy, and a run that fails by itself cannot be killed


def write_excitation(path):
    content = {
        "joints": ["joint_1", "joint_2", "joint_3"], "fundamental_hz": 0.5, "sample_rate_hz": RATE_HZ,
        "offset": [0.0, 0.0, 0.0], "cosine": [[0.0], [0.0], [0.0]], "sine": [[0.2], [0.2], [0.2]],
    }
    path.write_text(json.dumps(content))
    return path


def kill_at_random(folder, seed, tries=4):
    """Start a run, kill it some time after its first cycle; return its log and the last cycle it had."""
    log, (ours, theirs) = folder / f"{seed}.mcap", os.pipe()
    excitation = write_excitation(folder / f"{seed}.json")
    victim = subprocess.Popen(
        [sys.executable, "-m", "tests.scenario.victim", excitation, log, str(theirs), str(seed)],
        pass_fds=[theirs], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )
    os.close(theirs)
    told = os.read(ours, 4)
    if told:
        time.sleep(random.Random(seed).uniform(1.5, 4.0))
        victim.send_signal(signal.SIGKILL)
    complaint = victim.communicate()[1].decode()
    while chunk := os.read(ours, 65536):
        told += chunk
    os.close(ours)
    assert told, complaint
    if victim.returncode != -signal.SIGKILL or log.exists():  # it was over before: too many cycles missed
        assert tries > 1, complaint
        return kill_at_random(folder, seed + 1000, tries - 1)
    return log, struct.unpack("<i", told[-4:])[0]


def check(folder, seed):
    log, last = kill_at_random(folder, seed)
    partial = Path(f"{log}.partial")
    whole = folder / f"{seed}.whole.mcap"
    salvage_run(partial, whole)
    raw = read_raw(whole, "/drive/raw")
    cycles = raw["cycle"][raw["cycle"] != NO_CYCLE].astype(np.int64)
    np.testing.assert_array_equal(cycles, np.arange(len(cycles)))
    assert (last - cycles[-1]) / RATE_HZ <= 1.0, f"seed {seed}: {last - cycles[-1]} cycles were lost"
    if cycles[-1] > 200:  # the motion proper has begun
        recording = read_recording(whole)
        assert recording.metadata["outcome"] == "interrupted"
        assert recording.wrench is not None
    return last - int(cycles[-1])


def killed(folder, seeds, together):
    with ThreadPoolExecutor(together) as pool:
        return list(pool.map(lambda seed: check(folder, seed), seeds))


def test_kill_9_loses_at_most_a_second(tmp_path):
    assert len(killed(tmp_path, range(3), 3)) == 3


@pytest.mark.slow
@pytest.mark.skipif(not os.environ.get("RESIDUUM_SLOW"), reason="takes minutes: set RESIDUUM_SLOW=1")
def test_25_kills(tmp_path):
    assert len(killed(tmp_path, range(100, 125), 2)) == 25
