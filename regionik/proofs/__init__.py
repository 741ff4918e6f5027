"""What `regionik.verify` proves, one kind a file, with kinematics and bounds of its own."""
