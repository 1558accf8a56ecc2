"""Runs of the virtual robot over HTTP: two steps, a process of their own, abort without a lease."""

import time

import pytest

from tests.service.rest.conftest import register

OVER = ("finished", "failed", "aborted", "interrupted")


@pytest.fixture(scope="module")
def bench(server):
    """A virtual robot with an excitation, leased to the operator."""
    register(server, "V", simulated=True)
    operator = server.client("operator")
    body = {
        "robot_serial": "V",
        "harmonics": 2,
        "starts": 1,
        "refined": 1,
        "fundamental_hz": 0.25,
        "rate_hz": 100,
    }
    made = operator.post("/v1/excitations", json=body)
    server.finished(made.headers["Location"])
    server.excitation = made.json()["id"]
    return server


def previewed(server, **more):
    body = {"robot_serial": "V", "excitation_id": server.excitation, "periods": 2, **more}
    return server.client("operator").post("/v1/runs", json=body)


def ended(server, location, seconds=240):
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        found = server.client("read").get(location).json()
        if found["state"] in OVER:
            return found
        time.sleep(0.1)
    raise AssertionError(found)


def test_a_run_needs_preview_lease_and_name_and_becomes_a_recording(bench):
    operator = bench.client("operator")
    made = previewed(bench)
    assert made.status_code == 201, made.text
    assert made.json()["state"] == "previewed"
    assert made.json()["preview"]["cycles"] > 800
    place = made.headers["Location"]
    no_lease = operator.post(f"{place}/confirm", json={"robot_name": "ir361"})
    assert (no_lease.status_code, no_lease.json()["code"]) == (409, "lease_needed")
    operator.post("/v1/robots/V/lease", json={"minutes": 10})
    wrong = operator.post(f"{place}/confirm", json={"robot_name": "IR361"})
    assert (wrong.status_code, wrong.json()["code"]) == (422, "unusable")
    assert operator.get(place).json()["state"] == "previewed"
    other = bench.client("run").post(f"{place}/confirm", json={"robot_name": "ir361"})
    assert other.json()["code"] == "lease_held"
    for _ in range(2):  # the same key confirms once
        answer = operator.post(
            f"{place}/confirm", json={"robot_name": "ir361"}, headers={"Idempotency-Key": "go"}
        )
        assert answer.status_code == 202, answer.text
    found = ended(bench, place)
    assert found["state"] == "finished", found
    recording = operator.get(f"/v1/recordings/{found['recording_id']}").json()
    assert (recording["simulated"], recording["kind"]) == (True, "excitation")
    again = operator.post(f"{place}/confirm", json={"robot_name": "ir361"})
    assert again.json()["code"] == "wrong_state"


def test_an_abort_needs_no_lease_and_keeps_what_was_recorded(bench):
    bench.client("operator").post("/v1/robots/V/lease", json={"minutes": 10})
    made = previewed(bench, periods=400)
    place = made.headers["Location"]
    bench.client("operator").post(f"{place}/confirm", json={"robot_name": "ir361"})
    busy = bench.client("operator").post(
        f"{previewed(bench).headers['Location']}/confirm", json={"robot_name": "ir361"}
    )
    assert busy.json()["code"] == "wrong_state"
    deadline = time.monotonic() + 180
    while ((bench.client("read").get(place).json()["progress"] or {}).get("cycle") or 0) < 100:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    assert bench.client("run").post(f"{place}/abort").status_code == 200
    found = ended(bench, place)
    assert found["state"] == "aborted", found
    assert found["recording_id"]


def test_unattended_motion_needs_clearance(bench):
    refused = previewed(bench, unattended=True)
    assert (refused.status_code, refused.json()["code"]) == (409, "not_cleared")
    register(bench, "V", simulated=True, unattended=True)
    assert previewed(bench, unattended=True).status_code == 201


def test_a_real_robot_without_drives_is_refused_before_anything_moves(bench):
    register(bench, "REAL")
    body = {"robot_serial": "REAL", "excitation_id": bench.excitation}
    assert bench.client("operator").post("/v1/runs", json=body).json()["code"] == "unusable"
