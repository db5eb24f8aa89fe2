"""The drive of a winch on its CAN bus."""
