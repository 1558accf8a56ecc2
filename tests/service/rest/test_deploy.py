"""What is deployed fits the program: example configuration, dashboard, units, backup and restore."""

import json
import re
import shutil
import sqlite3
import subprocess
import tomllib
from pathlib import Path

import pytest

from service.config import Config, load_config
from service.config_example import example_config
from tests.service.rest.conftest import Server, register, upload

DEPLOY = Path(__file__).parents[3] / "deploy"


def test_the_example_configuration_is_the_schema():
    assert (DEPLOY / "residuum.example.toml").read_text() == example_config()


def test_the_container_configuration_is_valid():
    assert load_config(DEPLOY / "container/residuum.toml").database_url.startswith("postgresql+psycopg://")


def test_the_dashboard_asks_for_metrics_that_exist(server):
    register(server, "V", simulated=True)
    client = server.client("admin")
    client.post("/v1/nights", json={"robot_serial": "V", "outcome": "skipped", "sentence": "none"})
    text = client.get("/v1/metrics").text
    known = set(re.findall(r"^# TYPE (residuum_\w+)", text, re.MULTILINE))
    panels = json.loads((DEPLOY / "grafana/residuum.json").read_text())["panels"]
    used = {name for panel in panels for name in re.findall(r"residuum_\w+", panel["targets"][0]["expr"])}
    assert used
    assert used <= known


def test_the_service_stops_later_than_the_server_needs():
    unit = (DEPLOY / "systemd/residuum.service").read_text()
    stop_s = int(re.search(r"TimeoutStopSec=(\d+)", unit)[1])
    from service.runs import _STOP_S

    assert stop_s > 5 + _STOP_S  # open streams, then the stop ladder


def test_options_of_the_units_exist(capsys):
    from tests.service.synthetic_logs import command

    for unit, name in (("residuum.service", "serve"), ("residuum-nightly@.service", "nightly")):
        line = re.search(r"^ExecStart=(.*)$", (DEPLOY / "systemd" / unit).read_text(), re.MULTILINE)[1]
        _, help_text, _ = command(capsys, name, "--help")
        for option in re.findall(r"--[a-z-]+", line):
            assert option in help_text


@pytest.mark.skipif(shutil.which("nginx") is None, reason="nginx is not installed")
def test_nginx_accepts_its_configuration(tmp_path):
    key = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=x"]
    subprocess.run(
        [*key, "-keyout", tmp_path / "k.pem", "-out", tmp_path / "c.pem"], check=True, capture_output=True
    )
    text = (DEPLOY / "nginx/residuum.conf").read_text()
    for place, name in (("fullchain", "c"), ("privkey", "k")):
        text = text.replace(f"/etc/ssl/residuum/{place}.pem", str(tmp_path / f"{name}.pem"))
    for port in ("80", "443"):
        text = re.sub(rf"listen (\[::\]:)?{port}\b", rf"listen \g<1>1{port}", text)
    conf = tmp_path / "nginx.conf"
    conf.write_text(f"pid {tmp_path}/pid; error_log stderr; events {{}} http {{ access_log off; {text} }}")
    found = subprocess.run(["nginx", "-t", "-c", str(conf)], capture_output=True, text=True)
    assert found.returncode == 0, found.stderr


def test_a_backup_taken_while_serving_is_restored(tmp_path, log_files):
    first = Server(tmp_path / "first")
    try:
        register(first, "V", simulated=True)
        recording = upload(first, log_files / "run.mcap", "V").json()
        copy = tmp_path / "second"
        copy.mkdir()
        source, target = (sqlite3.connect(path / "residuum.sqlite") for path in (tmp_path / "first", copy))
        source.backup(target)
        source.close()
        target.close()
        shutil.copytree(tmp_path / "first/recordings", copy / "recordings")
    finally:
        first.lab.close()
    from service.rest.lab import Lab

    config = first.config.model_copy(
        update={"storage": first.config.storage.model_copy(update={"folder": copy})}
    )
    first.lab = Lab(config)
    try:
        assert first.lab.open() == (None, [])
        first.app.state.lab = first.lab
        found = first.client("read").get(f"/v1/recordings/{recording['id']}/file")
        assert found.content == (log_files / "run.mcap").read_bytes()
    finally:
        first.lab.close()


def test_tables_of_the_configuration_are_all_in_the_example():
    assert set(tomllib.loads(example_config())) == set(Config.model_fields)
