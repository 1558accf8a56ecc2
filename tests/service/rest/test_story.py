"""From a robot to an accepted calibration over HTTP, with real fits."""

import json

import pytest

from tests.service.rest.conftest import register, upload


@pytest.fixture(scope="module")
def story(server, log_files):
    """A simulated robot with an estimate and a diagnosis; a real robot with the same simulated data."""
    found = {"server": server}
    assert register(server, simulated=True).status_code == 201
    run = upload(server, log_files / "run.mcap")
    assert (run.status_code, run.json()["simulated"]) == (201, True), run.text
    validation = upload(server, log_files / "validation.mcap").json()["id"]
    found["recording"], found["validation"] = run.json()["id"], validation
    body = {"recording_id": found["recording"], "validation_id": validation}
    runner = server.client("run")
    fit = runner.post("/v1/fits", json=body, headers={"Idempotency-Key": "the fit"})
    diagnosis = runner.post("/v1/diagnoses", json=body)
    assert (fit.status_code, diagnosis.status_code) == (202, 202), fit.text
    found["again"] = runner.post("/v1/fits", json=body, headers={"Idempotency-Key": "the fit"})
    found["fit"] = server.finished(fit.headers["Location"])
    second = runner.post("/v1/fits", json={**body, "model": "internal"})
    found["diagnosis"] = server.finished(diagnosis.headers["Location"])
    found["second"] = server.finished(second.headers["Location"])
    return found


def test_the_fit_gives_an_estimate_with_covariance(story):
    fit = story["fit"]
    assert fit["job"]["state"] == "done", fit
    found = story["server"].client("read").get(f"/v1/estimates/{fit['estimate_id']}").json()
    size = len(found["parameters"]) + len(found["torque_constants"])
    assert [len(row) for row in found["covariance"]] == [size] * size
    for constant, nominal in zip(found["torque_constants"], (0.215, 0.215, 0.155), strict=True):
        assert abs(constant["value"] - nominal) < 4 * constant["std"]
    assert found["simulated"] is True
    assert found["rms"]["validation"]


def test_files_are_those_of_the_command_line_without_paths_of_the_server(story):
    reader = story["server"].client("read")
    estimate = reader.get(f"/v1/estimates/{story['fit']['estimate_id']}/estimate.json")
    diagnosis = reader.get(f"/v1/diagnoses/{story['diagnosis']['id']}/diagnosis.json")
    for response in (estimate, diagnosis):
        assert response.json()["schema_version"] == 1
        assert str(story["server"].config.storage.folder) not in response.text
    assert estimate.json()["provenance"]["run"]["path"] == "run.mcap"


def test_the_diagnosis_has_a_verdict_and_a_report(story):
    diagnosis = story["diagnosis"]
    assert diagnosis["verdict"] in ("consistent", "explained", "partly_explained", "unexplained")
    report = story["server"].client("read").get(f"/v1/diagnoses/{diagnosis['id']}/report")
    assert report.headers["content-type"].startswith("text/html")
    assert "ir361" in report.text


def test_the_same_idempotency_key_acts_once(story):
    assert story["again"].status_code == 202
    assert story["again"].json()["id"] == story["fit"]["id"]
    other = (
        story["server"]
        .client("run")
        .post("/v1/fits", json={"recording_id": story["recording"]}, headers={"Idempotency-Key": "the fit"})
    )
    assert (other.status_code, other.json()["code"]) == (422, "idempotency_key_reused")


def test_a_recording_may_have_many_fits(story):
    reader = story["server"].client("read")
    fits = reader.get(f"/v1/fits?recording={story['recording']}").json()["items"]
    assert {fit["options"]["model"] for fit in fits} >= {None, "internal"}


def test_a_calibration_is_proposed_accepted_and_rolled_back(story):
    server = story["server"]
    operator = server.client("operator")
    for key in ("fit", "second"):
        made = operator.post(
            "/v1/calibrations", json={"estimate_id": story[key]["estimate_id"], "reason": "try"}
        )
        assert made.status_code == 201, made.text
        accepted = operator.post(f"{made.headers['Location']}/accept", json={"reason": "good"})
        assert accepted.json()["state"] == "accepted"
        again = operator.post(f"{made.headers['Location']}/accept", json={"reason": "good"})
        assert (again.status_code, again.json()["code"]) == (409, "wrong_state")
    back = operator.post("/v1/robots/VIRTUAL-1/rollback", json={"reason": "worse"})
    assert back.json()["estimate_id"] == story["fit"]["estimate_id"]
    assert operator.get("/v1/robots/VIRTUAL-1/calibration").json()["id"] == back.json()["id"]
    states = [item["state"] for item in operator.get("/v1/calibrations?robot=VIRTUAL-1").json()["items"]]
    assert sorted(states) == ["accepted", "rejected"]
    actions = [item["action"] for item in server.client("admin").get("/v1/audit").json()["items"]]
    assert {"calibration.accept", "calibration.withdraw", "calibration.restore", "recording.upload"} <= set(
        actions
    )


def test_comparisons_and_torque_constants(story):
    reader = story["server"].client("read")
    same = reader.get(
        "/v1/comparisons",
        params={"first": story["fit"]["estimate_id"], "second": story["fit"]["estimate_id"]},
    )
    assert same.json()["p_value"] == 1.0
    other = reader.get(
        "/v1/comparisons",
        params={"first": story["fit"]["estimate_id"], "second": story["second"]["estimate_id"]},
    )
    assert other.json()["compared"] > 10
    history = reader.get("/v1/robots/VIRTUAL-1/torque-constants").json()
    assert len(history["points"]) == 2


def test_simulated_results_are_never_accepted_for_a_real_robot(story, log_files, tmp_path):
    server = story["server"]
    register(server, "REAL-1")
    path = tmp_path / "run.mcap"
    from tests.service import synthetic_logs as logs

    logs.write(logs.recording(3), path)
    recording = upload(server, path, "REAL-1").json()
    fit = server.client("run").post("/v1/fits", json={"recording_id": recording["id"]})
    estimate = server.finished(fit.headers["Location"])["estimate_id"]
    admin = server.client("admin")
    made = admin.post("/v1/calibrations", json={"estimate_id": estimate})
    refused = admin.post(f"{made.headers['Location']}/accept", json={})
    assert (refused.status_code, refused.json()["code"]) == (409, "simulated_result")
    turned = register(server, "REAL-1", simulated=True)
    assert (turned.status_code, turned.json()["code"]) == (409, "conflict")


def test_downloads_give_back_the_bytes(story, log_files):
    found = story["server"].client("read").get(f"/v1/recordings/{story['recording']}/file")
    assert found.content == (log_files / "run.mcap").read_bytes()
    part = (
        story["server"]
        .client("read")
        .get(f"/v1/recordings/{story['recording']}/file", headers={"Range": "bytes=10-19"})
    )
    assert (part.status_code, part.content) == (206, found.content[10:20])


def test_events_are_numbered_and_can_be_continued(story):
    reader = story["server"].client("read")
    text = reader.get("/v1/events?follow=false").text
    events = [json.loads(line[6:]) for line in text.splitlines() if line.startswith("data: ")]
    kinds = [event["kind"] for event in events]
    for kind in ("job.queued", "job.running", "job.done", "recording.stored"):
        assert kind in kinds
    numbers = [event["id"] for event in events]
    assert numbers == sorted(set(numbers))
    rest = reader.get("/v1/events?follow=false", headers={"Last-Event-ID": str(numbers[-2])}).text
    assert rest.count("data: ") == 1


def test_metrics(story):
    text = story["server"].client("read").get("/v1/metrics").text
    assert 'residuum_jobs{kind="fit",state="done"}' in text
    assert "\nresiduum_recordings_bytes " in text
    for line in text.splitlines():
        assert line.startswith(("# HELP ", "# TYPE ")) or len(line.rsplit(" ", 1)) == 2


def test_an_excitation_is_designed_as_a_job(story):
    body = {
        "robot_serial": "VIRTUAL-1",
        "harmonics": 2,
        "starts": 1,
        "refined": 1,
        "fundamental_hz": 0.25,
        "rate_hz": 60,
    }
    made = story["server"].client("run").post("/v1/excitations", json=body)
    found = story["server"].finished(made.headers["Location"])
    assert found["job"]["state"] == "done", found
    content = story["server"].client("read").get(f"{made.headers['Location']}/excitation.json").json()
    assert content["joints"] == ["joint_1", "joint_2", "joint_3"]
    assert content["hash"]


def test_a_running_job_is_cancelled_within_seconds(story):
    runner = story["server"].client("run")
    body = {"robot_serial": "VIRTUAL-1", "starts": 64, "refined": 16, "harmonics": 8}
    made = runner.post("/v1/excitations", json=body).json()
    assert runner.post(f"/v1/jobs/{made['job']['id']}/cancel").status_code == 200
    assert story["server"].finished(f"/v1/excitations/{made['id']}", 20)["job"]["state"] == "cancelled"
    after = runner.post("/v1/fits", json={"recording_id": story["recording"]})
    assert story["server"].finished(after.headers["Location"])["job"]["state"] == "done"


def test_a_fit_that_fails_says_why(story, tmp_path):
    from dataclasses import replace

    from tests.service import synthetic_logs as logs

    logs.write(replace(logs.recording(4), wrench=None), tmp_path / "no_plate.mcap")
    recording = upload(story["server"], tmp_path / "no_plate.mcap").json()["id"]
    made = (
        story["server"].client("run").post("/v1/fits", json={"recording_id": recording, "model": "combined"})
    )
    job = story["server"].finished(made.headers["Location"])["job"]
    assert job["state"] == "failed"
    assert "no force-plate wrench" in job["error"]["sentence"]
    assert set(job["error"]) == {"code", "cause", "remedy", "sentence", "exit_code"}
