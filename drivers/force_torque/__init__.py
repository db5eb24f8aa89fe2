"""ATI six-axis load cells: Digital F/T on RS485, Net F/T on UDP."""
