"""Inverse kinematics: FABRIK, M-FABRIK and FABRIK-R, compiled, for arms in one plane and for any chain."""
