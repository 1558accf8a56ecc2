"""Identification and diagnosis: pure mathematics on arrays; knows no file, bus or clock."""
