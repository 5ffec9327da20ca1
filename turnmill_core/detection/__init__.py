"""How well does the monitor hear? A seeded corpus of labelled signals, and the monitor and its rivals on it."""
