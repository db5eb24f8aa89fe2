"""What records: rows, ring, logger, run folders, calibrations."""
