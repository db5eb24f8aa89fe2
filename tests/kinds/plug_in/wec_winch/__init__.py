"""A winch that holds a float at one height after the other: a kind of rig outside the tree."""
