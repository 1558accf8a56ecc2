"""Any foreign recording becomes a recording of the project."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from daq.errors import DataError, UsageError
from daq.imports.csv import read_csv
from daq.imports.mapping import ImportMap, read_map
from daq.imports.npz import read_npz
from daq.imports.rosbag_db3 import open_bag
from daq.imports.tabular import table_streams
from daq.imports.topics import topic_recording
from daq.mcap_file import open_log
from daq.messages import CURRENTS_TOPIC, JOINT_STATES_TOPIC, SETPOINTS_TOPIC, WRENCH_TOPIC
from daq.recording import Recording

KINDS = ("excitation", "validation", "free")


@dataclass(frozen=True)
class Import:
    """A foreign recording, read.

    Attributes:
        recording: the result.
        dropped: samples left out as unusable.
    """

    recording: Recording
    dropped: int


def import_recording(
    source: str | Path, map_path: str | Path, drop_bad_rows: bool = False, joints: tuple[str, ...] = (),
) -> Import:
    """Read a foreign recording as a map file describes it.

    Args:
        source: a ``.csv``, ``.npz``, ``.db3`` or ``.mcap`` file.
        map_path: what its columns, arrays or topics mean.
        drop_bad_rows: leave unusable rows out instead of refusing.
        joints: names for tables whose map gives none.

    Returns:
        The recording, and how many samples were left out.

    Raises:
        DataError: the recording is unusable.
        UsageError: the map or the file's kind is wrong.
    """
    path, plan = Path(source), read_map(map_path)
    _check_file(path)
    kind = path.suffix.lower()
    if kind in (".csv", ".npz"):
        table = read_csv(path, plan) if kind == ".csv" else read_npz(path, plan)
        streams, dropped = table_streams(table, plan, plan.rename or plan.joints or joints, drop_bad_rows)
        recording = Recording(
            str(path), streams[JOINT_STATES_TOPIC], streams.get(CURRENTS_TOPIC), streams.get(WRENCH_TOPIC),
            streams.get(SETPOINTS_TOPIC), {}, {}, hashlib.sha256(path.read_bytes()).hexdigest(), (),
        )
    elif kind in (".db3", ".mcap"):
        log = open_bag(path) if kind == ".db3" else open_log(path)
        recording, dropped = topic_recording(log, plan, drop_bad_rows)
    else:
        raise UsageError(f"{path} cannot be imported: its name must end in .csv, .npz, .db3 or .mcap.")
    return Import(replace(recording, metadata=_metadata(plan, recording, dropped)), dropped)


def _check_file(path: Path) -> None:
    if not path.is_file():
        raise UsageError(f"cannot read {path}: there is no such file; give the path of the recording.")
    if not path.stat().st_size:
        raise DataError(f"{path} is empty: there is nothing to import.")


def _metadata(plan: ImportMap, recording: Recording, dropped: int) -> Mapping[str, str]:
    """The run's record: what the map states, and where the data came from."""
    given = {**recording.metadata, **plan.metadata}
    if given.get("kind", "free") not in KINDS:
        raise UsageError(f"{plan.source}: [metadata] kind must be one of {', '.join(KINDS)}, not "
                         f"{given['kind']!r}.")
    if given.get("simulated", "false") not in ("true", "false"):
        raise UsageError(f"{plan.source}: [metadata] simulated must be true or false, not "
                         f"{given['simulated']!r}.")
    name = Path(recording.source).name
    return {"schema_version": "1", "run_id": Path(name).stem, "kind": "free", "simulated": "false", **given,
            "imported_from": name, "source_sha256": recording.sha256, "dropped_rows": str(dropped)}
