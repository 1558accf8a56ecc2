"""The REST API as the nightly run uses it: plain requests, problems as errors."""

from __future__ import annotations

import json
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path
from typing import Any, Protocol

from service.refusals import Refusal

_TIMEOUT_S = 60.0


class RemoteRefusal(Refusal):
    """The server said no; carries its problem."""

    def __init__(self, status: int, problem: dict[str, Any]) -> None:
        super().__init__(
            problem.get("cause", f"The server answered {status}"), problem.get("remedy", "see its log")
        )
        self.status, self.code = status, str(problem.get("code", "refused"))


class ServerAway(Refusal):
    """The server does not answer."""

    code, status = "server_away", 503


class Client(Protocol):
    """What a night needs of a server."""

    def call(self, method: str, path: str, body: dict[str, Any] | None = None, key: str | None = None) -> Any:
        """Send a request; ``key`` makes it act once however often it is repeated.

        Raises:
            RemoteRefusal: the server said no.
            ServerAway: it does not answer.
        """


class RestClient:
    """A server over HTTP.

    Args:
        address: such as ``http://127.0.0.1:8600``.
        token: bearer token.
    """

    def __init__(self, address: str, token: str) -> None:
        self._address, self._token = address.rstrip("/"), token

    def call(self, method: str, path: str, body: dict[str, Any] | None = None, key: str | None = None) -> Any:
        """Send a request."""
        headers = {"Authorization": f"Bearer {self._token}", "Content-Type": "application/json"}
        if key:
            headers["Idempotency-Key"] = key
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self._address + path, data, headers, method=method)
        return self._send(request)

    def stored(self, robot: str, name: str) -> str:
        """Identifier of a recording on the server; a file is uploaded first.

        Args:
            robot: serial.
            name: identifier, or path of a log.
        """
        path = Path(name)
        if not path.is_file():
            return name
        query = urllib.parse.urlencode({"robot": robot, "label": path.name})
        headers = {"Authorization": f"Bearer {self._token}", "Content-Length": str(path.stat().st_size)}
        with path.open("rb") as stream:
            request = urllib.request.Request(
                f"{self._address}/v1/recordings?{query}", stream, headers, method="POST"
            )
            return str(self._send(request)["id"])

    def _send(self, request: urllib.request.Request) -> Any:
        try:
            with urllib.request.urlopen(request, timeout=_TIMEOUT_S) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            raise RemoteRefusal(error.code, _problem(error)) from error
        except OSError as error:
            raise ServerAway(
                f"{self._address} does not answer: {error}", "start residuum serve, or correct --server"
            ) from error


def _problem(error: urllib.error.HTTPError) -> dict[str, Any]:
    try:
        found = json.load(error)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
