"""Diagnosis: locate the mismatch, name the missing physics, show the fit improve."""
