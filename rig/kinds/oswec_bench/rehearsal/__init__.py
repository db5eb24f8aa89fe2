"""The simulated bench: in the loop's process, and as emulated devices on its wires."""
