"""The motion with the tool on its path, made smooth and proven anew."""
