"""Acquisition: recordings, their format, time base, quality; knows no driver and no mathematics of robots."""
