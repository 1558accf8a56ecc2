"""What a rigid-body, Coulomb, viscous and offset model leaves out: one effect a file."""
