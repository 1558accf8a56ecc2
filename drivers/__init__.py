"""Drivers: real and fake hardware behind the same interfaces."""
