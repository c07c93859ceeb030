"""Measurements that set constants of the engine; each runs as `python -m tests.calibration.<name>`."""
