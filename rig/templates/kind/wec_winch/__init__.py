"""The rig winch: a motor keeps a float at one height after the other."""
