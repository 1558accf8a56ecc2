"""Wrong requests: a problem with code, cause and remedy; nothing stored."""

import os

import pytest

from tests.service.rest.conftest import register, upload


@pytest.fixture(scope="module")
def robot(server):
    register(server, "R-1", simulated=True)
    return server


def problem(response, status, code):
    assert (response.status_code, response.json()["code"]) == (status, code), response.text
    assert response.headers["content-type"] == "application/problem+json"
    assert response.json()["cause"]
    assert response.json()["remedy"]
    return response.json()


def stored(server):
    return sorted(name for _, _, names in os.walk(server.lab.archive.folder) for name in names)


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "code"),
    [
        ("GET", "/v1/robots/NONE", None, 404, "not_found"),
        ("GET", "/v1/robots/..%2f..%2fetc", None, 404, "not_found"),
        ("GET", "/v1/recordings/XYZ", None, 422, "invalid_request"),
        ("GET", "/v1/recordings/abc", None, 404, "not_found"),
        ("GET", "/v1/none", None, 404, "not_found"),
        ("PATCH", "/v1/robots", None, 405, "method_not_allowed"),
        ("GET", "/v1/jobs?limit=0", None, 422, "invalid_request"),
        ("POST", "/v1/fits", {"recording_id": "abc"}, 404, "not_found"),
        ("POST", "/v1/fits", {"recording_id": "abc", "model": "best"}, 422, "invalid_request"),
        ("POST", "/v1/robots", {"serial": "../x", "preset": "ir361"}, 422, "invalid_request"),
        ("POST", "/v1/robots", {"serial": "X"}, 422, "unusable"),
        ("POST", "/v1/robots", {"serial": "X", "preset": "/etc/passwd"}, 422, "unusable"),
        ("POST", "/v1/robots", {"serial": "X", "robot_toml": "name = 1", "urdf": "<robot/>"}, 422, "usage"),
        ("POST", "/v1/robots/R-1/lease", {"minutes": 1e9}, 422, "unusable"),
        ("POST", "/v1/robots/R-1/lease", {"minutes": 5, "purpose": "a\u0000b"}, 422, "invalid_request"),
        ("POST", "/v1/calibrations", {"estimate_id": "abc"}, 404, "not_found"),
        ("POST", "/v1/robots/R-1/rollback", {}, 409, "wrong_state"),
        (
            "POST",
            "/v1/nights",
            {"robot_serial": "R-1", "outcome": "fine", "sentence": ""},
            422,
            "invalid_request",
        ),
        ("GET", "/v1/comparisons?first=a&second=b", None, 404, "not_found"),
    ],
)
def test_wrong_requests(robot, method, path, body, status, code):
    problem(robot.client("admin").request(method, path, json=body), status, code)


def test_garbage_instead_of_json(robot):
    for content in (b"{", b"\xff\xfe", b'{"serial": "\\ud800", "preset": "ir361"}', b"[" * 5000):
        response = robot.client("admin").post(
            "/v1/robots", content=content, headers={"Content-Type": "application/json"}
        )
        assert 400 <= response.status_code < 500, response.text


def test_a_body_too_long_is_refused(robot):
    response = robot.client("admin").post("/v1/robots", content=b"x" * 11_000_000)
    problem(response, 413, "too_large")


def test_an_upload_too_long_is_refused_announced_or_not(robot):
    before = stored(robot)
    client = robot.client("run")
    problem(client.post("/v1/recordings?robot=R-1", content=b"x" * 4_000_000), 413, "too_large")
    problem(
        client.post("/v1/recordings?robot=R-1", content=(b"x" * 100_000 for _ in range(40))), 413, "too_large"
    )
    assert stored(robot) == before


@pytest.mark.parametrize("content", [b"", b"no log", b"\x89MCAP0\r\n" + b"\0" * 100])
def test_an_upload_that_is_no_log_is_refused(robot, content):
    before = stored(robot)
    found = problem(
        robot.client("run").post("/v1/recordings?robot=R-1&label=bad.mcap", content=content), 422, "unusable"
    )
    assert str(robot.config.storage.folder) not in str(found)
    assert stored(robot) == before


def test_a_flipped_bit_is_found(robot, log_files, tmp_path):
    content = bytearray((log_files / "run.mcap").read_bytes())
    content[len(content) // 2] ^= 0x10
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    problem(upload(robot, path, "R-1"), 422, "unusable")


@pytest.mark.parametrize("label", ["../../etc/passwd", "/x", ".hidden", "a/b", 'a"b', ""])
def test_a_label_is_never_a_path(robot, label):
    response = robot.client("run").post(
        "/v1/recordings", params={"robot": "R-1", "label": label}, content=b"x"
    )
    problem(response, 422, "invalid_request")


def test_the_same_bytes_are_kept_once(robot, log_files):
    register(robot, "R-2", simulated=True)
    first = upload(robot, log_files / "run.mcap", "R-1")
    again = upload(robot, log_files / "run.mcap", "R-1")
    assert (first.status_code, again.status_code) == (201, 200)
    assert first.json()["id"] == again.json()["id"]
    problem(upload(robot, log_files / "run.mcap", "R-2"), 409, "conflict")
    assert not list(robot.lab.archive.incoming.iterdir())


def test_pages_walk_through_everything_once(robot):
    admin = robot.client("admin")
    for k in range(7):
        admin.post("/v1/nights", json={"robot_serial": "R-1", "outcome": "skipped", "sentence": f"night {k}"})
    seen, after = [], None
    while True:
        page = admin.get(
            "/v1/nights", params={"limit": 3, "robot": "R-1"} | ({"after": after} if after else {})
        ).json()
        seen += [item["sentence"] for item in page["items"]]
        after = page["next"]
        if after is None:
            break
    assert seen == [f"night {k}" for k in reversed(range(7))]
    assert admin.get("/v1/nights?outcome=failed").json()["items"] == []
    numbers, after = [], None
    while True:
        page = admin.get("/v1/audit", params={"limit": 5} | ({"after": after} if after else {})).json()
        numbers += [item["id"] for item in page["items"]]
        after = page["next"]
        if after is None:
            break
    assert numbers == sorted(set(numbers), reverse=True)


def test_a_new_description_is_a_new_version(robot):
    admin = robot.client("admin")
    model = admin.get("/v1/robots/R-1/model").json()
    changed = model["robot_toml"].replace("torque_constant = 0.155", "torque_constant = 0.156")
    assert changed != model["robot_toml"]
    body = {"serial": "R-1", "robot_toml": changed, "urdf": model["urdf"], "simulated": True}
    answer = admin.post("/v1/robots", json=body)
    assert answer.status_code == 200, answer.text
    assert len(admin.get("/v1/robots/R-1/models").json()) == 2
    other = body | {"robot_toml": changed.replace('name = "ir361"', 'name = "other"')}
    problem(admin.post("/v1/robots", json=other), 409, "conflict")


def test_every_operation_is_described(robot):
    schema = robot.client().get("/v1/openapi.json").json()
    for path, item in schema["paths"].items():
        for method, operation in item.items():
            assert operation.get("description"), (method, path)
            for parameter in operation.get("parameters", []):
                assert parameter.get("description") or parameter["name"] in ("who", "action"), (
                    path,
                    parameter["name"],
                )
    assert "application/problem+json" in str(schema["paths"]["/v1/fits"]["post"]["responses"]["404"])


def test_health_needs_no_token(robot):
    found = robot.client().get("/v1/health")
    assert (found.status_code, found.json()["status"]) == (200, "ok")


def test_a_second_server_does_not_take_the_folder(robot):
    from service.errors import UsageError
    from service.rest.lab import Lab

    with pytest.raises(UsageError, match="belongs to a server that is running"):
        Lab(robot.config)
