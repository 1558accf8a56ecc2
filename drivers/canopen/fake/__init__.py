"""Fake drives that behave: CiA 402 devices with dictionary, PDOs, heartbeats, faults, in virtual or real time."""
