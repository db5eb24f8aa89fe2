"""The devices of a wired bench, and their I/O processes."""
