"""Alerts: a signed webhook for programs, e-mail for people."""

from __future__ import annotations

import hashlib
import hmac
import json
import smtplib
import time
import urllib.request
from collections.abc import Sequence
from email.message import EmailMessage
from pathlib import Path
from typing import Any

from service.config import AlertSection, EmailSection, WebhookSection
from service.errors import UsageError
from service.nightly.policy import Alarm

_TIMEOUT_S = 20.0
SIGNATURE_HEADER = "X-Residuum-Signature"


def sign(secret: bytes, at_s: int, body: bytes) -> str:
    """Signature of an alert: HMAC-SHA256 over time, a dot and the body; the time stops replays."""
    return hmac.new(secret, f"{at_s}.".encode() + body, hashlib.sha256).hexdigest()


def send_alarms(settings: AlertSection, robot: str, alarms: Sequence[Alarm], outcome: str) -> list[str]:
    """Tell whoever is configured.

    Args:
        settings: where to.
        robot: serial.
        alarms: nothing is sent when there are none.
        outcome: of the night.

    Returns:
        A sentence for every way that failed; one that fails does not keep the other from being tried.
    """
    if not alarms:
        return []
    content = {"robot": robot, "outcome": outcome, "alarms": [vars(alarm) for alarm in alarms]}
    failures = []
    for is_wanted, way, send in (
        (bool(settings.webhook.url), "webhook", lambda: _webhook(settings.webhook, content)),
        (
            bool(settings.email.host and settings.email.recipients),
            "e-mail",
            lambda: _email(settings.email, robot, alarms),
        ),
    ):
        if not is_wanted:
            continue
        try:
            send()
        except (OSError, smtplib.SMTPException, UsageError) as error:
            failures.append(f"The {way} alert could not be sent: {error}.")
    return failures


def _secret(path: Path | None, what: str) -> str:
    if path is None:
        raise UsageError(f"The {what} has no secret file; name one in the configuration.")
    return Path(path).read_text(encoding="utf-8").strip()


def _webhook(settings: WebhookSection, content: dict[str, Any]) -> None:
    body, at_s = json.dumps(content, allow_nan=False).encode(), int(time.time())
    signature = sign(_secret(settings.secret_file, "webhook").encode(), at_s, body)
    headers = {"Content-Type": "application/json", SIGNATURE_HEADER: f"t={at_s},v1={signature}"}
    request = urllib.request.Request(settings.url, body, headers, method="POST")
    with urllib.request.urlopen(request, timeout=_TIMEOUT_S):
        pass


def _email(settings: EmailSection, robot: str, alarms: Sequence[Alarm]) -> None:
    message = EmailMessage()
    kinds = ", ".join(dict.fromkeys(alarm.kind for alarm in alarms))
    message["Subject"] = f"Residuum, robot {robot}: {kinds}"
    message["From"], message["To"] = settings.sender, ", ".join(settings.recipients)
    message.set_content("\n\n".join(f"{alarm.kind}: {alarm.sentence}" for alarm in alarms) + "\n")
    with smtplib.SMTP(settings.host, settings.port, timeout=_TIMEOUT_S) as server:
        if settings.starttls:
            server.starttls()
        if settings.user:
            server.login(settings.user, _secret(settings.password_file, "e-mail account"))
        server.send_message(message)
