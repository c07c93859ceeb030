"""Beams: modes and statics against closed forms, travelling-wave solutions and a plain finite-element model."""
