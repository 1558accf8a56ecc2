"""Recordings on disk: stored whole under the digest of their bytes, checked before they count."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from service.refusals import TooLarge, Unusable

_DIGEST = re.compile(r"[0-9a-f]{64}")
_MEGABYTE = 1_000_000


@dataclass(frozen=True)
class Limits:
    """What an upload may take.

    Attributes:
        upload_bytes: largest file.
        free_bytes: disk space to leave.
    """

    upload_bytes: int
    free_bytes: int


class Archive:
    """The folder of recordings.

    Args:
        folder: made if missing.
        limits: for uploads.
    """

    def __init__(self, folder: Path, limits: Limits) -> None:
        self.folder, self.limits = folder, limits
        self.incoming = folder / "incoming"
        self.incoming.mkdir(parents=True, exist_ok=True)

    def path_of(self, sha256: str) -> Path:
        """Where a recording lies; only a digest can become a path."""
        if not _DIGEST.fullmatch(sha256):
            raise Unusable(f"'{sha256[:80]}' is no SHA-256 digest", "use the digest of a stored recording")
        return self.folder / sha256[:2] / f"{sha256}.mcap"

    def receive(self, is_limited: bool = True) -> Incoming:
        """Open a place for a new file; uploads are limited, the server's own recordings are not."""
        return Incoming(self, is_limited)

    def keep(self, path: Path, sha256: str) -> Path:
        """Move a checked file to its place; the same bytes twice are kept once."""
        target = self.path_of(sha256)
        target.parent.mkdir(exist_ok=True)
        os.replace(path, target)
        _sync_folder(target.parent)
        return target

    def clear_incoming(self) -> int:
        """Remove uploads that a stop cut off; returns how many."""
        left = [path for path in self.incoming.iterdir() if path.is_file()]
        for path in left:
            path.unlink()
        return len(left)


class Incoming:
    """A file that is arriving; removed unless it is kept."""

    def __init__(self, archive: Archive, is_limited: bool = True) -> None:
        self._is_limited = is_limited
        handle, name = tempfile.mkstemp(dir=archive.incoming, suffix=".mcap")
        self.path, self.size_bytes = Path(name), 0
        self._limits = archive.limits
        self._stream: IO[bytes] = os.fdopen(handle, "wb")
        self._digest = hashlib.sha256()

    def check_announced(self, size_bytes: int | None) -> None:
        """Refuse by the announced size already, before a byte is sent."""
        if size_bytes is not None:
            self._refuse_size(size_bytes)

    def write(self, block: bytes) -> None:
        """Take a block.

        Raises:
            TooLarge: above the limit, or the disk is nearly full.
        """
        self.size_bytes += len(block)
        self._refuse_size(self.size_bytes)
        self._digest.update(block)
        self._stream.write(block)

    def finish(self) -> str:
        """Force the file onto the disk and return its digest."""
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._stream.close()
        return self._digest.hexdigest()

    def discard(self) -> None:
        """Leave nothing behind; harmless after the file was kept."""
        self._stream.close()
        self.path.unlink(missing_ok=True)

    def _refuse_size(self, size_bytes: int) -> None:
        if not self._is_limited:
            return
        limit = self._limits.upload_bytes
        if size_bytes > limit:
            raise TooLarge(
                f"The upload has more than {limit / _MEGABYTE:.0f} MB, the limit of this server",
                "split the recording, or raise storage.max_upload_mb",
            )
        free = shutil.disk_usage(self.path.parent).free
        if free - (size_bytes - self.size_bytes) < self._limits.free_bytes:
            raise TooLarge(
                f"The disk has {free / _MEGABYTE:.0f} MB left, "
                f"of which {self._limits.free_bytes / _MEGABYTE:.0f} MB are kept free",
                "remove old files or give the server a larger disk",
            )


def inspect_log(path: str) -> dict[str, Any]:
    """Read a log and tell what the service must know about it; runs in a worker process.

    Args:
        path: the file.

    Returns:
        Robot name, kind, simulated mark, duration, streams, warnings.
    """
    from daq.log_reader import read_recording

    recording = read_recording(path)
    streams = {name: getattr(recording, name) for name in ("joint_states", "motor_currents", "wrench", "setpoints")}
    stamps = recording.joint_states.stamp_ns
    return {
        "robot": recording.metadata.get("robot", ""),
        "kind": recording.metadata.get("kind", "") or "free",
        "simulated": recording.metadata.get("simulated", "").lower() == "true",
        "run_id": recording.metadata.get("run_id", ""),
        "duration_s": float(stamps[-1] - stamps[0]) * 1e-9 if len(stamps) else 0.0,
        "joints": list(recording.joint_states.names),
        "samples": {name: len(stream.stamp_ns) for name, stream in streams.items() if stream is not None},
        "attachments": sorted(recording.attachments),
        "warnings": [warning.replace(path, "the log") for warning in recording.warnings],
    }


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
