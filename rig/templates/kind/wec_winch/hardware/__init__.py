"""The drive of the rig on its CAN bus."""
