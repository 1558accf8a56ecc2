"""A server in this process with real worker processes, and callers with every set of scopes."""

import time
import warnings
from pathlib import Path

import pytest

from service.config import AccessSection, Config, ServerSection, StorageSection
from service.rest.app import create_app
from service.rest.lab import Lab
from service.tokens import SCOPES, make_token
from tests.service import synthetic_logs as logs

with warnings.catch_warnings():  # the test client asks for a newer HTTP library
    warnings.simplefilter("ignore")
    from starlette.testclient import TestClient

OVER = ("done", "failed", "cancelled", "interrupted")


class Server:
    """A lab, its app and its tokens."""

    def __init__(self, folder: Path):
        self.config = Config(
            storage=StorageSection(folder=folder, max_upload_mb=3, keep_free_mb=1),
            access=AccessSection(failures=5),
            server=ServerSection(stream_poll_s=0.05),
        )
        self.lab = Lab(self.config)
        self.tokens = {"admin": self.lab.open()[0]}
        with self.lab.database.write() as session:
            for scope in SCOPES[:-1]:
                self.tokens[scope] = make_token(session, f"only-{scope}", [scope], "test")[1]
            self.tokens["operator"] = make_token(session, "operator", ["run", "accept"], "test")[1]
        self.app = create_app(self.lab)

    def client(self, who=None):
        headers = {"Authorization": f"Bearer {self.tokens[who]}"} if who else {}
        return TestClient(self.app, base_url="http://lab", headers=headers, raise_server_exceptions=False)

    def finished(self, location, seconds=180):
        """What a job led to."""
        anna = self.client("read")
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            found = anna.get(location).json()
            if found["job"]["state"] in OVER:
                return found
            time.sleep(0.1)
        raise AssertionError(found)


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    made = Server(tmp_path_factory.mktemp("lab"))
    yield made
    made.lab.close()


@pytest.fixture(scope="session")
def log_files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    logs.write(logs.recording(), folder / "run.mcap")
    free = {"kind": "validation", "fundamental_hz": None, "periods": None, "harmonics": None}
    logs.write(logs.recording(5, free, motion_seed=7), folder / "validation.mcap")
    return folder


def register(server, serial="VIRTUAL-1", **more):
    return server.client("admin").post("/v1/robots", json={"serial": serial, "preset": "ir361", **more})


def upload(server, path, serial="VIRTUAL-1", who="run", **more):
    return server.client(who).post(
        f"/v1/recordings?robot={serial}&label={path.name}", content=path.read_bytes(), **more
    )
