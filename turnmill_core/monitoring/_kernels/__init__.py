"""Compiled loops of this room, each tested against its plain version (`.py_func`)."""
