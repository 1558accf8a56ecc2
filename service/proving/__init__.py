"""Blind trials: conceal physics in a virtual robot, diagnose without knowing, open the seal, score."""
