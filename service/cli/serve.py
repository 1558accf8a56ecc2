"""``residuum serve``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from service.config import Config
    from service.rest.lab import Lab


def serve(
    host: Annotated[
        str | None, typer.Option(help="Address to listen on; the configuration's when left out.")
    ] = None,
    port: Annotated[int | None, typer.Option(help="TCP port.", min=1, max=65535)] = None,
    config: Annotated[Path | None, typer.Option(help="Configuration (TOML).")] = None,
    folder: Annotated[
        Path | None, typer.Option(help="Storage folder; the configuration's when left out.")
    ] = None,
    print_config: Annotated[
        bool, typer.Option("--print-config", help="Print an example configuration and exit.")
    ] = False,
    new_token: Annotated[
        str | None, typer.Option(help="Make an admin token of this name, print it and exit.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the first lines as JSON.")] = False,
) -> None:
    """Serve the REST API and the web page until stopped; the first start prints a token once.

    Example: residuum serve --config residuum.toml
    """
    from service.config_example import example_config

    if print_config:
        typer.echo(example_config(), nl=False)
        return
    settings = _settings(config, host, port, folder)
    if new_token is not None:
        _print_token(settings, new_token, as_json)
        return
    from service.rest.lab import Lab

    lab = Lab(settings)
    try:
        _run(lab, as_json)
    finally:
        lab.close()


def _settings(path: Path | None, host: str | None, port: int | None, folder: Path | None) -> Config:
    from service.config import load_config

    settings = load_config(path)
    server = {key: value for key, value in (("host", host), ("port", port)) if value is not None}
    storage = settings.storage.model_copy(update={} if folder is None else {"folder": folder})
    return settings.model_copy(
        update={"server": settings.server.model_copy(update=server), "storage": storage}
    )


def _print_token(settings: Config, name: str, as_json: bool) -> None:
    """Works beside a running server: only the database is touched."""
    from service.cli.output import print_json
    from service.store.database import Database
    from service.tokens import make_token

    settings.storage.folder.mkdir(parents=True, exist_ok=True)
    database = Database(settings.database_url)
    database.migrate()
    with database.write() as session:
        token = make_token(session, name, ["admin"], "command line")[1]
    database.close()
    if as_json:
        print_json({"name": name, "token": token})
    else:
        typer.echo(token)


def _run(lab: Lab, as_json: bool) -> None:
    import signal

    import uvicorn

    from service.rest.app import create_app

    server = lab.config.server
    app = create_app(lab)
    sock = _socket(server.host, server.port)
    token, interrupted = lab.open()
    address = f"http://{f'[{server.host}]' if ':' in server.host else server.host}:{server.port}/"
    _announce(address, token, interrupted, as_json)
    options = uvicorn.Config(
        app, log_level="warning", access_log=False, server_header=False, timeout_graceful_shutdown=5
    )
    signal.signal(signal.SIGTERM, lambda *_: None)  # uvicorn stops on it, then raises it again: close orderly
    uvicorn.Server(options).run(sockets=[sock])


def _socket(host: str, port: int):  # noqa: ANN202  (socket is imported late)
    """A listening socket; a taken port is said before anything starts."""
    import socket

    from service.errors import UsageError

    sock = None
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        # with the protocol named, the event loop sends small answers at once (it looks for it)
        sock = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind((host, port))
    except OSError as error:
        if sock is not None:
            sock.close()
        raise UsageError(
            f"Cannot listen on {host}:{port}: {error.strerror or error}; choose another --host or --port."
        ) from error
    return sock


def _announce(address: str, token: str | None, interrupted: list[str], as_json: bool) -> None:
    from service.cli.output import print_json

    if as_json:
        print_json({"address": address, "token": token, "interrupted": interrupted})
    else:
        for sentence in interrupted:
            typer.echo(sentence)
        if token is not None:
            typer.echo(f"First start. Your admin token, shown this once: {token}")
        typer.echo(f"Serving {address} (API description at {address}docs). Ctrl-C stops.")
    import sys

    sys.stdout.flush()
