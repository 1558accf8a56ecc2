"""The tests' own statistics, the policy's table, signed alerts."""

import hmac
import http.server
import json
import socketserver
import threading
from dataclasses import replace

import numpy as np
import pytest

from service.config import AlertSection, EmailSection, NightlySection, WebhookSection
from service.nightly.alerts import SIGNATURE_HEADER, send_alarms
from service.nightly.policy import Alarm, Evidence, decide
from service.nightly.shift import compare, night_scatter
from service.nightly.trend import TrendRule, fit_trend
from service.nightly.unknowns import Unknowns, unknowns_of
from tests.service.nightly.years import nights

RULE = TrendRule(1e-3, 1.0, 365)


def pairs(count, seed=0, spread=0.0):
    """Pairs of estimates of the same truth, with a nearly singular covariance."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, 6)) @ np.diag([1, 1, 1, 0.1, 1e-2, 1e-5])
    names, groups = tuple("abcdef"), ("inertial",) * 3 + ("friction",) * 3
    for _ in range(count):
        yield [
            Unknowns(names, groups, root @ rng.normal(size=6) + spread * rng.normal(size=6), root @ root.T)
            for _ in range(2)
        ]


def test_the_comparison_errs_as_often_as_its_level_says():
    errors = sum(compare(a, b, 0.05).has_moved for a, b in pairs(1500))
    assert 0.02 * 1500 < errors < 0.065 * 1500  # Bonferroni over two correlated groups: at most 5 %


def test_scatter_between_nights_is_measured_and_kept_apart_from_drift():
    quiet = night_scatter(list(nights(3, count=60, friction_scatter=0.0)), 1e-4)
    warm = night_scatter(list(nights(3, count=60, friction_scatter=0.04)), 1e-4)
    drifting = night_scatter(
        list(nights(3, count=60, friction_scatter=0.0, loss_percent=3, begin=0, days=60)), 1e-4
    )
    friction, constant = ["joint_2.coulomb"], ["joint_2.torque_constant"]
    assert warm.of(friction)[0, 0] > (0.03 * 15) ** 2 > quiet.of(friction)[0, 0]
    assert drifting.of(constant)[0, 0] < 4 * (0.0032 * 0.215) ** 2
    assert night_scatter(list(nights(3, count=5)), 1e-4) is None


def test_a_changed_base_parameter_is_not_compared_with_its_namesake():
    def content(factor):
        definition = {"link_1.Izz": 1.0, "link_2.m": factor}
        parameter = {
            "name": "link_1.Izz+...",
            "group": "inertial",
            "value": 1.0,
            "std": 0.1,
            "definition": definition,
        }
        return unknowns_of({"parameters": [parameter], "covariance": [[0.01]], "torque_constants": []})

    assert compare(content(0.2), content(0.2), 0.05).compared == 1
    assert compare(content(0.2), content(0.3), 0.05).compared == 0


def test_what_has_no_finite_variance_is_left_out():
    parameters = [{"name": name, "group": "friction", "value": 1.0} for name in "ab"]
    constants = [{"joint": "j", "value": None, "std": None}]
    covariance = [[0.01, 0.0, None], [0.0, None, None], [None, None, None]]
    found = unknowns_of({"parameters": parameters, "covariance": covariance, "torque_constants": constants})
    assert found.names == ("a",)


def test_trends():
    days = np.arange(60.0)
    rng = np.random.default_rng(1)
    std = np.full(60, 5e-4)
    noise = std * rng.normal(size=60)
    falling = fit_trend("j", days, 0.215 * (1 - 0.06 * days / 365.25) + noise, std, RULE)
    assert falling.is_alarm
    assert abs(falling.percent_per_year + 6) < 3 * falling.std_percent_per_year
    assert "losing magnetisation" in falling.sentence
    steady = fit_trend("j", days, 0.215 + noise, std, RULE)
    assert not steady.is_alarm
    few = fit_trend("j", days[:5], 0.215 + noise[:5], std[:5], RULE)
    assert (few.is_alarm, few.percent_per_year) == (False, None)
    tiny = fit_trend("j", days, 0.215 * (1 - 0.005 * days / 365.25) + noise * 1e-3, std * 1e-3, RULE)
    assert tiny.p_value < 1e-6
    assert not tiny.is_alarm


def test_nights_that_resemble_their_neighbours_do_not_make_a_trend():
    rng = np.random.default_rng(2)
    days, std, alarms = np.arange(120.0), np.full(120, 5e-4), 0
    for _ in range(200):
        noise = np.zeros(120)
        for k in range(1, 120):
            noise[k] = 0.6 * noise[k - 1] + std[0] * rng.normal()
        alarms += fit_trend("j", days, 0.215 + noise, std, replace(RULE, level=0.01)).is_alarm
    assert alarms <= 12  # white-noise statistics would raise about 40


GOOD = Evidence(True, 1.05, "consistent", {}, compare(*next(pairs(1)), 1e-9))
ACCEPTING = NightlySection(policy="accept_if_consistent")


@pytest.mark.parametrize(
    ("change", "outcome", "alarms"),
    [
        ({}, "accept", []),
        ({"is_acceptable": False}, "propose", []),
        ({"shift": None}, "propose", []),
        ({"validation_ratio": None}, "propose", []),
        ({"validation_ratio": 1.6}, "keep", []),
        ({"intervals_valid": False, "verdict": "explained"}, "propose", []),
        ({"intervals_valid": False, "verdict": "unexplained"}, "keep", []),
        ({"new_findings": {"backlash joint_2": "loose"}}, "propose", ["finding"]),
        ({"shift": replace(GOOD.shift, has_moved=True)}, "propose", ["shift"]),
    ],
)
def test_the_policy(change, outcome, alarms):
    decision = decide(replace(GOOD, **change), ACCEPTING)
    assert (decision.outcome, [alarm.kind for alarm in decision.alarms]) == (outcome, alarms)
    cautious = decide(replace(GOOD, **change), NightlySection())
    assert cautious.outcome == ("propose" if outcome == "accept" else outcome)


class Inbox(http.server.BaseHTTPRequestHandler):
    received: list = []  # noqa: RUF012

    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.received.append((self.headers[SIGNATURE_HEADER], body))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *arguments):
        pass


class Mailbox(socketserver.StreamRequestHandler):
    """Just enough of an SMTP server."""

    mails: list = []  # noqa: RUF012

    def handle(self):
        self.wfile.write(b"220 lab\r\n")
        while line := self.rfile.readline().strip().upper():
            if line.startswith(b"DATA"):
                self.wfile.write(b"354 go\r\n")
                text = b""
                while not text.endswith(b"\r\n.\r\n"):
                    text += self.rfile.readline()
                self.mails.append(text.decode())
            self.wfile.write(b"221 bye\r\n" if line.startswith(b"QUIT") else b"250 ok\r\n")
            if line.startswith(b"QUIT"):
                return


@pytest.fixture
def listen():
    servers = []

    def start(handler, kind=socketserver.TCPServer):
        server = kind(("127.0.0.1", 0), handler)
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        servers.append((server, thread))
        return server.server_address[1]

    yield start
    for server, thread in servers:
        server.shutdown()
        server.server_close()
        thread.join()


ALARM = Alarm("drift", "joint_2", "joint_2 is losing magnetisation.")


def test_alerts_are_signed_and_mailed(listen, tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("key\n")
    settings = AlertSection(
        webhook=WebhookSection(
            url=f"http://127.0.0.1:{listen(Inbox, http.server.HTTPServer)}/", secret_file=secret
        ),
        email=EmailSection(
            host="127.0.0.1", port=listen(Mailbox), starttls=False, recipients=("lab@example.org",)
        ),
    )
    assert send_alarms(settings, "IR-1", [ALARM], "proposed") == []
    ((header, body),) = Inbox.received
    at, signature = (part.split("=")[1] for part in header.split(","))
    assert hmac.compare_digest(signature, hmac.new(b"key", f"{at}.".encode() + body, "sha256").hexdigest())
    assert json.loads(body)["alarms"] == [vars(ALARM)]
    (mail,) = Mailbox.mails
    assert "Subject: Residuum, robot IR-1: drift" in mail
    assert ALARM.sentence in mail


def test_alerts_that_fail_are_said_and_do_not_stop_each_other(tmp_path):
    settings = AlertSection(
        webhook=WebhookSection(url="http://127.0.0.1:9/", secret_file=tmp_path / "none"),
        email=EmailSection(host="127.0.0.1", port=9, recipients=("lab@example.org",)),
    )
    assert len(send_alarms(settings, "IR-1", [ALARM], "failed")) == 2
    assert send_alarms(settings, "IR-1", [], "accepted") == []
    assert send_alarms(AlertSection(), "IR-1", [ALARM], "accepted") == []
