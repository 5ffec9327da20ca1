"""Compiled loops of the collocation solver, each tested against its plain version.

See :mod:`turnmill_core.stability.collocation` for the method. Angles are tool rotation in rad; local
element coordinates run from 0 to 1. Everything that the solver calls in a loop is here; nothing else is.
"""
