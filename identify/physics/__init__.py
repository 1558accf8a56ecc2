"""The catalogue of effects, one file each."""
