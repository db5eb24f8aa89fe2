"""The OSWEC bench: its words, what trips it, and its part of the cycle."""
