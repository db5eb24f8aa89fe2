"""The processes of a run: supervisor, loop, logger, I/O processes; their messages and locks."""
