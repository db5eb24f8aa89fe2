"""Emulated devices as a process: addresses, control line, faults, start-up."""
