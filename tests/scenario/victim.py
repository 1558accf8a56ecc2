"""A real-time run in a process of its own, to be killed: says on a pipe which cycle it has reached."""

from __future__ import annotations

import os
import struct
import sys
from pathlib import Path

from service.recordings import RecordRequest, open_session


def main() -> None:
    """Record until killed; arguments: excitation, log, file descriptor of the pipe, seed."""
    excitation, log, pipe, seed = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    request = RecordRequest(
        "ir361", excitation, log, is_virtual=True, is_real_time=True, transient_periods=0, seed=seed
    )
    session = open_session(request)
    drives, cycle = session.acquisition.drives, session.acquisition.drives.cycle

    def tell(targets):
        sample = cycle(targets)
        os.write(pipe, struct.pack("<i", sample.cycle))
        return sample

    drives.cycle = tell
    session.run()


if __name__ == "__main__":
    main()
