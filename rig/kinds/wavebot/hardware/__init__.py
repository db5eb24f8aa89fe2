"""The hardware mode: a rig's real devices for the loop, its I/O processes, surveys of its wires."""
