"""From log to estimate.json: 16 periods, three axes, combined model, beyond interpreter start and imports.

Run: ``.venv/bin/python -m benchmarks.bench_identify``.
"""

import contextlib
import io
import tempfile
import time
import tracemalloc
from pathlib import Path

import numpy as np

from benchmarks import virtual_runs as runs
from daq.log_writer import write_recording
from service.cli.main import run


def identify(log, estimate):
    with contextlib.redirect_stdout(io.StringIO()):
        code = run(["identify", str(log), "--robot", "ir361", "-o", str(estimate)])
    if code != 0:
        raise RuntimeError(f"residuum identify left with {code}")


def main():
    with tempfile.TemporaryDirectory() as folder:
        log, estimate = Path(folder) / "run.mcap", Path(folder) / "estimate.json"
        write_recording(runs.with_noise(runs.noise_free(), 5), log)
        identify(log, estimate)
        times = []
        for _ in range(5):
            start, cpu = time.perf_counter(), time.process_time()
            identify(log, estimate)
            times.append((time.perf_counter() - start, time.process_time() - cpu))
        wall, busy = np.median(times, axis=0)
        print(
            "identify, 16 periods of 10 s, 3 axes, combined, log to estimate.json: "
            f"{wall:.2f} s ({busy:.2f} s of processor)"
        )
        peaks = {}
        for periods in (4, 8, 16):
            write_recording(runs.with_noise(runs.noise_free(periods), 5), log)
            tracemalloc.start()
            identify(log, estimate)
            peaks[periods] = tracemalloc.get_traced_memory()[1] / 2**20
            tracemalloc.stop()
        print(
            "peak memory: "
            + ", ".join(f"{peak:.0f} MiB for {periods} periods" for periods, peak in peaks.items())
        )


if __name__ == "__main__":
    main()
