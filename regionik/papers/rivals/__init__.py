"""Other methods of inverse kinematics with the interface of FABRIK."""
