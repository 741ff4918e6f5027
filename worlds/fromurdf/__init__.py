"""The parts of a URDF file, read with care."""
