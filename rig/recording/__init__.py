"""Recording: rows, ring, MCAP files, run folders, calibrations."""
