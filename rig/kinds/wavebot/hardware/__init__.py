"""The devices of a wired WaveBot, and their I/O processes."""
