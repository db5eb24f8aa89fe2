"""The processes of a run, and what they hand each other."""
