"""Nightly recalibration: measure, compare with what is in force, decide, tell."""
