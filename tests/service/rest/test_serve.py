"""The command itself: starts, survives kill -9 without losing an accepted request, leaves nobody behind."""

import json
import os
import random
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import pytest

from tests.service.synthetic_logs import command


@pytest.fixture
def port():
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


class Process:
    """`residuum serve` as a process."""

    def __init__(self, folder, port, token=None):
        program = [sys.executable, "-c", "from service.cli.main import main; main()"]
        arguments = ["serve", "--port", str(port), "--folder", str(folder), "--json"]
        self.process = subprocess.Popen(
            program + arguments, stdout=subprocess.PIPE, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"}
        )
        text = ""
        for line in self.process.stdout:
            text += line
            if line == "}\n":
                break
        self.said = json.loads(text)
        self.address, self.token = self.said["address"], token or self.said["token"]

    def call(self, method, path, body=None, key=None, seconds=20):
        headers = {"Authorization": f"Bearer {self.token}", "Content-Type": "application/json"}
        if key:
            headers["Idempotency-Key"] = key
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.address + path, data, headers, method=method)
        deadline = time.monotonic() + seconds
        while True:
            try:
                with urllib.request.urlopen(request) as answer:
                    return json.load(answer)
            except urllib.error.URLError as error:
                refused = isinstance(error.reason, ConnectionRefusedError)
                if not refused or time.monotonic() > deadline:
                    raise
                time.sleep(0.02)

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def stop(self):
        self.process.terminate()
        code = self.process.wait(20)
        self.process.stdout.close()
        return code


def workers_of(pid):
    """Processes whose parent it is."""
    found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True).stdout
    return [int(word) for word in found.split()]


def is_alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{pid}/stat") as stat:
        return stat.read().rsplit(") ", 1)[1][0] != "Z"


def test_kill_9_loses_no_accepted_request_and_leaves_nobody_behind(tmp_path, port):
    server = Process(tmp_path, port)
    server.call("POST", "v1/robots", {"serial": "V", "preset": "ir361", "simulated": True})
    body = {"robot_serial": "V", "starts": 64, "refined": 16, "harmonics": 8}
    made = server.call("POST", "v1/excitations", body, "long")
    while server.call("GET", f"v1/jobs/{made['job']['id']}")["state"] != "running":
        time.sleep(0.05)
    accepted, chance = [], random.Random(1)
    for k in range(8):
        accepted.append(
            server.call("POST", "v1/nights", {"robot_serial": "V", "outcome": "skipped", "sentence": f"{k}"})[
                "id"
            ]
        )
    time.sleep(chance.random())
    workers = workers_of(server.process.pid)
    assert workers
    server.kill()
    deadline = time.monotonic() + 15
    while any(map(is_alive, workers)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(map(is_alive, workers))

    again = Process(tmp_path, port, server.token)
    try:
        assert again.said["token"] is None
        assert len(again.said["interrupted"]) == 1
        assert "was interrupted and is now queued" in again.said["interrupted"][0]
        job = again.call("GET", f"v1/jobs/{made['job']['id']}")
        assert job["state"] in ("queued", "running")
        assert job["error"]["code"] == "interrupted"
        assert again.call("POST", "v1/excitations", body, "long")["id"] == made["id"]
        assert [item["id"] for item in again.call("GET", "v1/nights")["items"]] == accepted[::-1]
    finally:
        code = again.stop()
    assert code == 0


def test_kill_9_in_a_run_stops_the_robot_and_salvages_the_log(tmp_path, port):
    server = Process(tmp_path, port)
    server.call("POST", "v1/robots", {"serial": "V", "preset": "ir361", "simulated": True})
    body = {
        "robot_serial": "V",
        "starts": 1,
        "refined": 1,
        "harmonics": 2,
        "fundamental_hz": 0.25,
        "rate_hz": 100,
    }
    design = server.call("POST", "v1/excitations", body)
    while server.call("GET", f"v1/excitations/{design['id']}")["job"]["state"] != "done":
        time.sleep(0.1)
    server.call("POST", "v1/robots/V/lease", {"minutes": 5})
    run = server.call(
        "POST", "v1/runs", {"robot_serial": "V", "excitation_id": design["id"], "periods": 2000}
    )
    server.call("POST", f"v1/runs/{run['id']}/confirm", {"robot_name": "ir361"})
    while ((server.call("GET", f"v1/runs/{run['id']}")["progress"] or {}).get("cycle") or 0) < 100:
        time.sleep(0.1)
    acquisition = workers_of(server.process.pid)
    server.kill()
    again = Process(tmp_path, port, server.token)
    try:
        assert f"Run {run['id']} of robot V was interrupted." in again.said["interrupted"]
        assert not any(map(is_alive, acquisition))
        found = again.call("GET", f"v1/runs/{run['id']}")
        assert (found["state"], found["error"]["code"]) == ("interrupted", "interrupted")
        recording = again.call("GET", f"v1/recordings/{found['recording_id']}")
        assert recording["simulated"]
        assert recording["facts"]["duration_s"] > 0.5
    finally:
        again.stop()


def test_the_example_configuration_is_printed(capsys):
    code, out, err = command(capsys, "serve", "--print-config")
    assert (code, err) == (0, "")
    assert "[nightly]" in out


def test_a_taken_port_is_one_sentence(tmp_path, port, capsys):
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", port))
        sock.listen()
        code, out, err = command(capsys, "serve", "--port", str(port), "--folder", tmp_path)
    assert (code, out) == (2, "")
    assert f"Cannot listen on 127.0.0.1:{port}" in err


def test_a_lost_token_is_replaced_from_the_command_line(tmp_path, capsys):
    code, out, _ = command(capsys, "serve", "--folder", tmp_path, "--new-token", "second")
    assert code == 0
    assert out.startswith("residuum_")
