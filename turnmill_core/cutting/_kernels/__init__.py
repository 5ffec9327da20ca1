"""Loops that the profiler blamed: forces over a tool revolution; what the tool swept on its way.

Each is tested against a plain version.
"""
