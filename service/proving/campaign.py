"""A campaign of blind trials: parallel, resumable, diagnosed by processes that never see the answers."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

from service.errors import ServiceError
from service.files import to_json, write_text
from service.proving.concealed import conceal, open_seal
from service.proving.score import Score, score


def _conceal(arguments: tuple[Path, str, int, int, int]) -> tuple[int, str]:
    try:
        conceal(*arguments)
    except Exception as error:  # one trial that cannot be made must not end the campaign; it is reported
        return arguments[2], f"{type(error).__name__}: {error}"
    return arguments[2], ""


def _diagnose(trial: Path) -> str:
    """Diagnose one trial from its own folder alone."""
    from service.diagnosing import diagnose_log

    started = time.perf_counter()
    try:
        found = diagnose_log(trial / "run.mcap", None, trial / "validation.mcap")
    except Exception as error:  # likewise
        return f"{type(error).__name__}: {error}"
    seconds = time.perf_counter() - started
    write_text(trial / "diagnosis.json", to_json(found.content | {"seconds": seconds}), "the diagnosis")
    return ""


def run_campaign(
    folder: Path,
    numbers: Iterable[int],
    *,
    robot: str = "ir361",
    seed: int = 1,
    periods: int = 8,
    workers: int = 2,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> tuple[list[Score], dict[int, str]]:
    """Run or resume a campaign.

    Args:
        folder: where trials, seals and diagnoses lie; what is there already is kept.
        numbers: of the trials.
        robot: preset of the virtual robot.
        seed: of the campaign.
        periods: of every run.
        workers: processes.
        progress: told stage, trials done and total.

    Returns:
        Scores in order, and what went wrong by trial number.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _same_settings(folder, {"robot": robot, "seed": seed, "periods": periods})
    wanted = list(numbers)
    failures: dict[int, str] = {}
    trials = {number: folder / "trials" / f"{number:04d}" for number in wanted}
    missing = [n for n in wanted if not (trials[n] / "validation.mcap").exists()]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for done, (number, problem) in enumerate(pool.map(_conceal, [(folder, robot, n, seed, periods) for n in missing]), 1):
            failures |= {number: problem} if problem else {}
            progress("concealing", done, len(missing))
    open_ones = [n for n in wanted if n not in failures and not (trials[n] / "diagnosis.json").exists()]
    # a pool of its own: the processes that diagnose have never held an answer
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for done, (number, problem) in enumerate(zip(open_ones, pool.map(_diagnose, [trials[n] for n in open_ones]), strict=True), 1):
            failures |= {number: problem} if problem else {}
            progress("diagnosing", done, len(open_ones))
    scores = [_scored(folder, number) for number in wanted if number not in failures]
    write_text(folder / "scores.json", to_json([asdict(item) for item in scores]), "the scores")
    return scores, failures


def _same_settings(folder: Path, settings: dict[str, object]) -> None:
    path = folder / "campaign.json"
    if not path.exists():
        write_text(path, to_json(settings), "the campaign's settings")
        return
    old = json.loads(path.read_text())
    if old != settings:
        raise ServiceError(f"Campaign {folder} was begun with {old}, not {settings}; resume it with the same settings or choose another folder.")


def _scored(folder: Path, number: int) -> Score:
    diagnosis = json.loads((folder / "trials" / f"{number:04d}" / "diagnosis.json").read_text())
    return score(open_seal(folder, number), diagnosis, diagnosis["seconds"])
