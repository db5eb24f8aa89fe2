"""The real-time core: loop, cycle, limits and safety machine."""
