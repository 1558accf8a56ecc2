"""The fake plate in virtual time: whole runs in seconds, every fault by name."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.force_plate.errors import PlateSettingError
from drivers.force_plate.fake import FakePlate
from drivers.force_plate.faults import Fault
from drivers.force_plate.parser import PlateParser
from drivers.force_plate.protocols.protocol import sample_period_s, wire_time_s
from drivers.force_plate.wrench_source import ConstantLoad, SwingingLoad
from tests.drivers.force_plate.streams import NAMES, SINGLE

COUNTED = ("bota", "dynpick", "optoforce")
LOAD = SwingingLoad()


def run(name: str, duration_s: float, *faults: Fault, **settings):
    plate = FakePlate(SINGLE[name], LOAD, faults=faults, **settings)
    parser = PlateParser(SINGLE[name])
    emissions = list(plate.emissions(duration_s))
    samples = []
    for emission in emissions:
        samples += parser.feed(emission.data, 1 + round(emission.due_s * 1e9))
    return emissions, samples + parser.flush(), parser


@pytest.mark.parametrize("name", NAMES)
def test_a_whole_calm_run_arrives(name):
    emissions, samples, parser = run(name, 20.0)
    assert len(samples) == len(emissions) == pytest.approx(20.0 / sample_period_s(SINGLE[name]), abs=1)
    assert (parser.lost, parser.counts.skipped_bytes) == (0, 0)
    load = np.array([LOAD.sample(e.taken_s) for e in emissions])
    wrenches = np.array([s.wrench for s in samples])
    np.testing.assert_allclose(wrenches, load, atol=0.06)


def test_delay_is_the_wire_and_the_clock_drifts():
    emissions, *_ = run("bota", 10.0, drift=1e-3)
    period_s = emissions[1].taken_s - emissions[0].taken_s
    assert period_s == pytest.approx(sample_period_s(SINGLE["bota"]) * 1.001)
    assert emissions[5].due_s - emissions[5].taken_s == pytest.approx(wire_time_s(SINGLE["bota"]))


@pytest.mark.parametrize("name", COUNTED)
@pytest.mark.parametrize("kind", ["drop", "bit_flip"])
def test_lost_frames_are_counted_exactly(name, kind):
    """A flipped bit loses a frame only where a check sees it: then the count must say so."""
    emissions, samples, parser = run(name, 10.0, Fault(kind, 0.5, 9.5, 0.03), seed=5)
    taken = round(10.0 / sample_period_s(SINGLE[name]) + 0.5)
    assert len(samples) < taken
    if kind == "drop" or name == "bota":
        assert len(samples) == sum(e.is_intact for e in emissions)
        assert len(samples) + parser.lost == emissions[-1].index + 1


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", ["split", "garbage", "clump"])
def test_harmless_faults_lose_nothing(name, kind):
    emissions, samples, parser = run(name, 5.0, Fault(kind, probability=0.2), seed=2)
    assert len(samples) == len({e.index for e in emissions})
    assert parser.lost == 0
    assert [e.due_s for e in emissions] == sorted(e.due_s for e in emissions)


@pytest.mark.parametrize("name", COUNTED)
def test_a_stall_is_a_hole_of_known_size(name):
    emissions, samples, parser = run(name, 6.0, Fault("stall", 2.0, 3.0))
    gap = sum(not e.is_intact for e in emissions)
    assert gap == pytest.approx(1.0 / sample_period_s(SINGLE[name]), abs=1)
    assert parser.lost == gap == sum(s.lost for s in samples)


def test_unplug_ends_the_stream_and_overload_is_flagged():
    emissions, samples, _ = run("bota", 10.0, Fault("overload", 1.0, 2.0), Fault("unplug", 3.0))
    assert emissions[-1].is_end and emissions[-1].due_s == pytest.approx(3.0, abs=0.01)
    flagged = [e.taken_s for e, s in zip(emissions, samples, strict=False) if s.is_overloaded]
    assert min(flagged) >= 1.0 and max(flagged) <= 2.0 and len(flagged) == pytest.approx(150, abs=1)


def test_the_same_seed_gives_the_same_bytes():
    faults = (Fault("garbage", probability=0.1), Fault("bit_flip", probability=0.1))
    plate = FakePlate(SINGLE["bota"], ConstantLoad(), faults=faults, noise=(1.0,) * 6, seed=9)
    assert list(plate.emissions(3.0)) == list(plate.emissions(3.0))


def test_unknown_faults_are_refused():
    with pytest.raises(PlateSettingError, match="bit_flip"):
        Fault("explode")
