"""Recordings of other sources become logs: one file a format, one map file a recording."""
