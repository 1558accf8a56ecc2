"""What a worker process does: an order of plain values in, results of plain values out."""

from __future__ import annotations

import json
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

Tell = Callable[[str, float], None]
_WATCH_S = 0.5  # the kernel's own death signal follows the parent's thread, which may end long before it


def prepare_worker() -> None:
    """Start of a worker: stopping belongs to the server, arithmetic stays on one thread."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a stop of the whole service reaches workers as well
    die_with_parent()
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    os.nice(5)  # a recording in progress goes first


def perform(kind: str, order: Mapping[str, Any], progress_path: str) -> dict[str, Any]:
    """Carry out an order.

    Args:
        kind: fit, diagnosis or design.
        order: robot texts, paths of recordings, options.
        progress_path: file that tells how far it is.

    Returns:
        ``{"content": ...}`` with further members, or ``{"fault": ...}``; errors never cross as exceptions,
        which need not survive the way between processes.
    """
    from service.faults import fault_of

    def tell(stage: str, share: float) -> None:
        _write_progress(Path(progress_path), stage, share)

    try:
        with tempfile.TemporaryDirectory(prefix="residuum-job-") as folder:
            return _ORDERS[kind](order, _robot_path(order, Path(folder)), tell)
    except Exception as error:
        return {"fault": fault_of(error)}


def die_with_parent() -> None:
    """End this process soon after the server has died, however it died: nobody could use its result."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, name="parent watch", daemon=True).start()


def _write_progress(path: Path, stage: str, share: float) -> None:
    temporary = path.with_suffix(".new")
    temporary.write_text(json.dumps({"stage": stage, "share": share}))
    os.replace(temporary, path)


def read_progress(path: Path) -> tuple[str, float] | None:
    """How far a worker says it is; None before it says anything."""
    try:
        content = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    return str(content["stage"]), float(content["share"])


def _robot_path(order: Mapping[str, Any], folder: Path) -> str:
    from service.registry import write_model
    from service.store.assets import RobotModel

    texts = {key: order[key] for key in ("robot_serial", "toml_text", "urdf_text")}
    return str(write_model(RobotModel(**texts), folder))


def _fit(order: Mapping[str, Any], robot: str, tell: Tell) -> dict[str, Any]:
    from service.identification import identify_log

    tell("reading and fitting", 0.1)
    options = dict(order["options"])
    project = bool(options.pop("project", False))
    found = identify_log(
        order["recording"], robot, fit_options(options), order["validation"], project=project
    )
    tell("writing", 0.95)
    return {"content": _without_paths(found.content, order)}


def _diagnosis(order: Mapping[str, Any], robot: str, tell: Tell) -> dict[str, Any]:
    from service.diagnosing import diagnose_log
    from service.report.page import report_html

    tell("reading, fitting and searching", 0.1)
    found = diagnose_log(order["recording"], robot, order["validation"], fit_options(order["options"]))
    tell("writing the report", 0.95)
    content = _without_paths(found.content, order)
    return {"content": content, "report": report_html(content)}


def _design(order: Mapping[str, Any], robot: str, tell: Tell) -> dict[str, Any]:
    from identify.excitation.design import DesignOptions
    from service.designs import design_excitation, excitation_content
    from service.robots import load_robot

    loaded = load_robot(robot)
    options = DesignOptions(noise=loaded.file.noise, **order["options"])
    tell("searching", 0.05)
    made = design_excitation(
        loaded, options, 0, lambda step: tell("searching", 0.05 + 0.9 * step.done / max(step.total, 1))
    )
    return {"content": excitation_content(made)}


def fit_options(options: Mapping[str, Any]) -> Any:
    """Fit options of a request: model, estimator, periodic, nominal constants."""
    from identify.fit import FitOptions

    return FitOptions(
        kind=options.get("model"),
        estimator=options.get("estimator") or "markov",
        periodic=options.get("periodic"),
        nominal_constants=bool(options.get("nominal_constants", False)),
    )


def _without_paths(content: dict[str, Any], order: Mapping[str, Any]) -> dict[str, Any]:
    """Name recordings by what clients know them by, not by where they lie on the server."""
    text = json.dumps(content)
    for path, label in (
        (order["recording"], order["label"]),
        (order["validation"], order["validation_label"]),
    ):
        if path:
            text = text.replace(json.dumps(path)[1:-1], json.dumps(label)[1:-1])
    return json.loads(text)


_ORDERS: Mapping[str, Callable[[Mapping[str, Any], str, Tell], dict[str, Any]]] = {
    "fit": _fit,
    "diagnosis": _diagnosis,
    "design": _design,
}
