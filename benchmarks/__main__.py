"""Runs every benchmark and prints its figures: ``make bench``, or ``python -m benchmarks [NAME ...]``."""

import importlib
import sys
import time
from pathlib import Path


def names():
    """Every ``bench_*`` module, then the paper's tables."""
    return [*sorted(path.stem for path in Path(__file__).parent.glob("bench_*.py")), "paper_tables"]


def run(name):
    """Run one benchmark; what is not installed skips it with the reason."""
    print(f"\n=== {name}", flush=True)
    start = time.perf_counter()
    try:
        module = importlib.import_module(f"benchmarks.{name}")
        print((module.__doc__ or "").strip().splitlines()[0], flush=True)
        module.main()
    except ModuleNotFoundError as error:
        print(f"skipped: {error.name} is not installed (benchmarks/requirements-bench.txt)")
        return
    print(f"({time.perf_counter() - start:.0f} s)", flush=True)


def main():
    chosen, sys.argv[1:] = sys.argv[1:] or names(), []
    unknown = [name for name in chosen if name not in names()]
    if unknown:
        sys.exit(f"Unknown benchmark {unknown[0]}; there are {', '.join(names())}.")
    for name in chosen:
        run(name)


if __name__ == "__main__":
    main()
