"""Other methods of inverse kinematics, asked as FABRIK is."""
