"""Python API: what `import rig` offers, and the bodies of commands that it shares."""
