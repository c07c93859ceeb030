"""Tests; `naive` and `reference` are a second source that shares no code with the engine."""
