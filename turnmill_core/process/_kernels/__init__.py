"""Compiled loops of this room, each tested against its plain version."""
