"""Computing the simulated robot in blocks changes nothing, with effects and with broken scripts too."""

import numpy as np
import pytest

from daq.acquisition import Acquisition
from daq.log_reader import read_recording
from drivers.canopen.fake.faults import Fault, FaultKind, FaultPlan
from drivers.virtual.bench import open_bench
from service.benches import parse_effect
from tests.scenario.benches import SPEC, job

EFFECTS = ("presliding_friction:joint_2", "backlash:joint_3", "thermal_friction:joint_1", "plate_high_pass")


@pytest.mark.parametrize("effects", [(), EFFECTS], ids=["plain", "effects"])
@pytest.mark.parametrize(
    "faults", [(), (Fault(FaultKind.LOST_RPDO, node=2, at=410),)], ids=["script kept", "script broken"]
)
def test_blocks_are_step_by_step(tmp_path, effects, faults):
    logs = []
    for name in ("blocks", "steps"):
        specs = [parse_effect(text) for text in effects]
        bench = open_bench(SPEC, seed=4, effects=specs, plan=FaultPlan(faults))
        known = {"foresee": bench.drives.foresee} if name == "blocks" else {}
        wanted = job(tmp_path / f"{name}.mcap", periods=2, **known)
        Acquisition(wanted, bench.drives, bench.clock, bench.plate).execute()
        logs.append(read_recording(tmp_path / f"{name}.mcap"))
    for one, other in zip(logs[0].streams, logs[1].streams, strict=True):
        np.testing.assert_array_equal(one.stamp_ns, other.stamp_ns)
        for key in ("position", "current"):
            if key in one.data:
                np.testing.assert_allclose(one.data[key], other.data[key], atol=1e-9)
