"""The kinds of rig: one package for each, and their registry."""
