"""A whole night over the REST API with real fits: proposed, accepted by policy, skipped, failed."""

from pathlib import Path

import pytest

from service.config import NightlySection
from service.nightly.client import RemoteRefusal
from service.nightly.night import Night, NightPlan
from tests.service import synthetic_logs as logs
from tests.service.rest.conftest import Server, register, upload


class InProcess:
    """The nightly client's interface on a server in this process."""

    def __init__(self, client):
        self.client = client

    def call(self, method, path, body=None, key=None):
        answer = self.client.request(method, path, json=body, headers={"Idempotency-Key": key} if key else {})
        if answer.status_code >= 400:
            raise RemoteRefusal(answer.status_code, answer.json())
        return answer.json()


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    server = Server(tmp_path_factory.mktemp("lab"))
    register(server, "V", simulated=True)
    yield server
    server.lab.close()


@pytest.fixture(scope="module")
def recordings(lab, tmp_path_factory):
    folder: Path = tmp_path_factory.mktemp("nights")
    free = {"kind": "validation", "fundamental_hz": None, "periods": None, "harmonics": None}
    logs.write(logs.recording(50, free, motion_seed=7), folder / "validation.mcap")
    found = [upload(lab, folder / "validation.mcap", "V").json()["id"]]
    for k in range(2):
        logs.write(logs.recording((0, 3)[k]), folder / f"night{k}.mcap")
        found.append(upload(lab, folder / f"night{k}.mcap", "V").json()["id"])
    return found


def test_nights_over_the_api(lab, recordings):
    validation, first, second = recordings
    client = InProcess(lab.client("operator"))
    report = Night(client, NightlySection()).run(NightPlan("V", first, validation))
    assert report.outcome == "proposed", report
    made = client.call("GET", "/v1/calibrations?robot=V")["items"][0]
    assert made["estimate_id"] == report.estimate_id
    client.call("POST", f"/v1/calibrations/{made['id']}/accept", {"reason": "looked at it"})
    report = Night(client, NightlySection(policy="accept_if_consistent")).run(
        NightPlan("V", second, validation)
    )
    assert report.outcome == "accepted", report
    assert client.call("GET", "/v1/robots/V/calibration")["estimate_id"] == report.estimate_id
    assert client.call("GET", "/v1/robots/V")["lease"] is None
    assert [night["outcome"] for night in client.call("GET", "/v1/nights")["items"]] == [
        "accepted",
        "proposed",
    ]
    assert report.alarms == ()


def test_a_leased_robot_is_left_alone(lab, recordings):
    lab.client("run").post("/v1/robots/V/lease", json={"minutes": 5, "purpose": "someone works"})
    report = Night(InProcess(lab.client("operator")), NightlySection()).run(NightPlan("V", recordings[1]))
    assert report.outcome == "skipped"
    assert "leased to 'only-run'" in report.sentence
    lab.client("run").delete("/v1/robots/V/lease")


def test_a_night_that_fails_says_so_and_gives_the_robot_back(lab):
    client = InProcess(lab.client("operator"))
    report = Night(client, NightlySection()).run(NightPlan("V", "abc"))
    assert (report.outcome, report.fresh[0].kind) == ("failed", "failure")
    assert "no recording abc" in report.sentence
    assert client.call("GET", "/v1/robots/V")["lease"] is None
    assert client.call("GET", "/v1/nights")["items"][0]["outcome"] == "failed"


def test_the_command_says_what_is_missing(capsys, monkeypatch, tmp_path):
    monkeypatch.delenv("RESIDUUM_TOKEN", raising=False)
    code, out, err = logs.command(capsys, "nightly", "V", "--recording", "abc")
    assert (code, out) == (2, "")
    assert "--token-file" in err
    token = tmp_path / "token"
    token.write_text("x")
    arguments = (
        "nightly",
        "V",
        "--recording",
        "abc",
        "--token-file",
        token,
        "--server",
        "http://127.0.0.1:9",
    )
    code, out, err = logs.command(capsys, *arguments)
    assert code == 1
    assert "does not answer" in err


def test_a_night_records_only_a_robot_that_is_cleared(lab):
    client = InProcess(lab.client("operator"))
    body = {
        "robot_serial": "V",
        "harmonics": 2,
        "starts": 1,
        "refined": 1,
        "fundamental_hz": 0.25,
        "rate_hz": 100,
    }
    excitation = client.call("POST", "/v1/excitations", body)
    lab.finished(f"/v1/excitations/{excitation['id']}")
    settings = NightlySection(warm_up_periods=1, periods=4)
    plan = NightPlan("V", excitation=excitation["id"])
    report = Night(client, settings).run(plan)
    assert report.outcome == "skipped"
    assert "not cleared for unattended motion" in report.sentence
    assert client.call("GET", "/v1/runs")["items"] == []
    register(lab, "V", simulated=True, unattended=True)
    report = Night(client, settings).run(plan)
    runs = client.call("GET", "/v1/runs")["items"]
    assert [run["state"] for run in runs] == ["finished"] * 3, runs
    assert report.outcome in ("proposed", "kept"), report
    assert report.estimate_id
