"""One target looked at as closely as it takes: a configuration found, or the proof that there is none."""
