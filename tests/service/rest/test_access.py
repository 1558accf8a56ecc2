"""Every route with every scope; guessing; what is open."""

import pytest
from starlette.routing import Route

from tests.service.rest.conftest import register

# written down once more, by hand: a route whose scope changes by mistake fails here
SCOPE_OF = {
    ("GET", "/v1/health"): None,
    ("GET", "/v1/metrics"): "read",
    ("GET", "/v1/events"): "read",
    ("GET", "/v1/me"): "read",
    ("GET", "/v1/tokens"): "admin",
    ("POST", "/v1/tokens"): "admin",
    ("DELETE", "/v1/tokens/{key}"): "admin",
    ("GET", "/v1/audit"): "admin",
    ("GET", "/v1/robots"): "read",
    ("POST", "/v1/robots"): "admin",
    ("GET", "/v1/robots/{serial}"): "read",
    ("GET", "/v1/robots/{serial}/models"): "read",
    ("GET", "/v1/robots/{serial}/model"): "read",
    ("POST", "/v1/robots/{serial}/lease"): "run",
    ("DELETE", "/v1/robots/{serial}/lease"): "run",
    ("POST", "/v1/robots/{serial}/rollback"): "accept",
    ("GET", "/v1/robots/{serial}/calibration"): "read",
    ("GET", "/v1/robots/{serial}/torque-constants"): "read",
    ("GET", "/v1/recordings"): "read",
    ("POST", "/v1/recordings"): "run",
    ("GET", "/v1/recordings/{key}"): "read",
    ("GET", "/v1/recordings/{key}/file"): "read",
    ("GET", "/v1/excitations"): "read",
    ("POST", "/v1/excitations"): "run",
    ("GET", "/v1/excitations/{key}"): "read",
    ("GET", "/v1/excitations/{key}/excitation.json"): "read",
    ("GET", "/v1/runs"): "read",
    ("POST", "/v1/runs"): "run",
    ("GET", "/v1/runs/{key}"): "read",
    ("POST", "/v1/runs/{key}/confirm"): "run",
    ("POST", "/v1/runs/{key}/abort"): "run",
    ("GET", "/v1/fits"): "read",
    ("POST", "/v1/fits"): "run",
    ("GET", "/v1/fits/{key}"): "read",
    ("GET", "/v1/diagnoses"): "read",
    ("POST", "/v1/diagnoses"): "run",
    ("GET", "/v1/diagnoses/{key}"): "read",
    ("GET", "/v1/diagnoses/{key}/diagnosis.json"): "read",
    ("GET", "/v1/diagnoses/{key}/report"): "read",
    ("GET", "/v1/jobs"): "read",
    ("GET", "/v1/jobs/{key}"): "read",
    ("POST", "/v1/jobs/{key}/cancel"): "run",
    ("GET", "/v1/estimates"): "read",
    ("GET", "/v1/estimates/{key}"): "read",
    ("GET", "/v1/estimates/{key}/estimate.json"): "read",
    ("GET", "/v1/calibrations"): "read",
    ("POST", "/v1/calibrations"): "run",
    ("GET", "/v1/calibrations/{key}"): "read",
    ("POST", "/v1/calibrations/{key}/accept"): "accept",
    ("POST", "/v1/calibrations/{key}/reject"): "accept",
    ("GET", "/v1/comparisons"): "read",
    ("GET", "/v1/nights"): "read",
    ("POST", "/v1/nights"): "run",
}
MAY = {
    "read": {"read"},
    "run": {"read", "run"},
    "accept": {"read", "accept"},
    "admin": {"read", "run", "accept", "admin"},
}


def operations(server):
    paths = server.client().get("/v1/openapi.json").json()["paths"]
    return {(method.upper(), path) for path, item in paths.items() for method in item}


def test_the_table_knows_every_route(server):
    assert operations(server) == set(SCOPE_OF)


@pytest.mark.parametrize("who", [None, *MAY])
@pytest.mark.parametrize(("method", "path"), SCOPE_OF)
def test_every_route_with_every_scope(server, method, path, who):
    scope = SCOPE_OF[(method, path)]
    address = path.replace("{key}", "abc123").replace("{serial}", "NONE")
    parameters = {"follow": "false"} if path == "/v1/events" else {}
    response = server.client(who).request(method, address, params=parameters)
    if scope is None or (who and scope in MAY[who]):
        assert response.status_code not in (401, 403), response.text
        assert response.status_code < 500, response.text
    else:
        assert response.status_code == (401 if who is None else 403), response.text
        assert response.json()["code"] == ("unauthenticated" if who is None else "forbidden")


def test_pages_hold_nothing_from_elsewhere(server):
    client = server.client()
    for path in ("/", "/docs", "/web/app.js", "/web/chart.js", "/web/docs.js", "/web/style.css"):
        page = client.get(path)
        assert page.status_code == 200
        for foreign in ("http://", "https://", "//cdn", "@import"):
            assert foreign not in page.text.replace("http://www.w3.org/2000/svg", ""), path
    assert "default-src 'self'" in client.get("/").headers["content-security-policy"]
    for path in ("/web/../config.py", "/web/%2e%2e/config.py", "/web/index.html", "/web/none.js"):
        assert client.get(path).status_code == 404


def test_an_address_that_guesses_must_wait(server):
    client = server.client()
    statuses = [
        client.get("/v1/robots", headers={"Authorization": f"Bearer guess{k}"}).status_code for k in range(7)
    ]
    assert statuses == [401] * 5 + [429] * 2
    held = server.client("admin").get("/v1/robots")
    assert held.status_code == 429
    assert 1 <= int(held.headers["Retry-After"]) <= 300
    server.lab.brake._failures.clear()


def test_a_token_is_shown_once_and_dies_when_revoked(server):
    admin = server.client("admin")
    made = admin.post("/v1/tokens", json={"name": "timer", "scopes": ["run"], "days": 30}).json()
    headers = {"Authorization": f"Bearer {made['token']}"}
    assert server.client().get("/v1/me", headers=headers).json() == {
        "name": "timer",
        "scopes": ["read", "run"],
    }
    assert made["token"] not in admin.get("/v1/tokens").text
    admin.delete(f"/v1/tokens/{made['id']}")
    assert server.client().get("/v1/me", headers=headers).status_code == 401
    server.lab.brake._failures.clear()


def test_leases_over_http(server):
    register(server, "LEASED")
    anna, ben = server.client("run"), server.client("operator")
    assert (
        anna.post("/v1/robots/LEASED/lease", json={"minutes": 5, "purpose": "run"}).json()["owner"]
        == "only-run"
    )
    held = ben.post("/v1/robots/LEASED/lease", json={"minutes": 5})
    assert (held.status_code, held.json()["code"]) == (409, "lease_held")
    assert ben.delete("/v1/robots/LEASED/lease").status_code == 409
    assert server.client("read").get("/v1/robots/LEASED").json()["lease"]["purpose"] == "run"
    assert server.client("admin").delete("/v1/robots/LEASED/lease").status_code == 200
    assert ben.post("/v1/robots/LEASED/lease", json={"minutes": 5}).status_code == 200


def test_nothing_but_the_listed_routes_exists(server):
    open_paths = {
        route.path
        for route in server.app.routes
        if isinstance(route, Route) and not route.path.startswith("/v1")
    }
    assert open_paths <= {"/", "/docs", "/web/{name}"}
