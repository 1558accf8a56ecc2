"""Short runs of the virtual robot behind its buses, with faults."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.acquisition import Acquisition, Job
from daq.excitation import Excitation
from daq.limits import limits_of
from daq.run_report import RunReport
from daq.run_state import RunStatus
from daq.trajectory import plan_excitation
from drivers.canopen.fake.faults import Fault, FaultPlan
from drivers.virtual.bench import VirtualBench, open_bench
from drivers.virtual.plant_file import load_plant
from drivers.virtual.trajectories import joint_limits

SPEC = load_plant("ir361")
NAMES = SPEC.joint_names
LOWER, UPPER, SPEED = joint_limits(SPEC)
FREE = np.full(3, np.inf)


def excitation(fundamental_hz: float = 1.0, size_rad: float = 0.05) -> Excitation:
    cosine = size_rad * np.array([[1.0, -0.5], [0.7, 0.2], [-0.6, 0.4]])
    sine = size_rad * np.array([[0.3, 0.4], [-0.5, 0.1], [0.4, -0.3]])
    return Excitation(NAMES, fundamental_hz, np.array([0.05, -0.05, 0.1]), cosine, sine, 150.0)


def limits(**changes):
    settings = {"lower": LOWER, "upper": UPPER, "velocity": SPEED, "acceleration": FREE, "following": 0.2}
    return limits_of(NAMES, **{**settings, **changes})


@dataclass
class Outcome:
    report: RunReport
    run: Acquisition
    bench: VirtualBench
    path: Path

    @property
    def first_cause(self) -> str:
        return self.report.causes[0]


def job(path: Path, foresee=lambda targets_rad: None, periods=3, limits_of_run=None, **changes) -> Job:
    """The standard short motion."""

    def plan(start, period_s):
        made = plan_excitation(excitation(), limits(), start, period_s, periods, 1)
        foresee(made.q)
        return made

    metadata = {"schema_version": "1", "run_id": "test", "robot": "ir361", "simulated": "true"}
    return Job(path, plan, limits_of_run or limits(), metadata, patient=True, **changes)


def make(path: Path, *faults: Fault, plate_faults=(), **settings):
    """A run that is ready, and its bench."""
    bench = open_bench(SPEC, seed=4, plan=FaultPlan(faults), plate_faults=plate_faults)
    wanted = job(path, bench.drives.foresee, **settings)
    return Acquisition(wanted, bench.drives, bench.clock, bench.plate, RunStatus()), bench


def record(path: Path, *faults: Fault, **settings) -> Outcome:
    run, bench = make(path, *faults, **settings)
    return Outcome(run.execute(), run, bench, path)
