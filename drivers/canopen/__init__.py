"""CANopen drives (CiA 402)."""
