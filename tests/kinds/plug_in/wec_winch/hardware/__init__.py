"""A winch has no wired devices."""
