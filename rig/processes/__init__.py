"""The processes of a run: supervisor, loop, I/O processes, and the data they exchange."""
