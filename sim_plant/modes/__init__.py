"""A rig of several coupled modes of motion, described by a BEM file and a plant file."""
