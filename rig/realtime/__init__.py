"""What ticks: the loop, its cycle, limits and the safety machine."""
