"""The devices of a wired modular rig, and their I/O processes."""
