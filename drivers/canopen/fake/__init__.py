"""Fake drives that behave: CiA 402 devices with PDOs, heartbeats and faults, in virtual or real time."""
