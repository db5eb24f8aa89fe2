"""The devices of a wired bench."""
