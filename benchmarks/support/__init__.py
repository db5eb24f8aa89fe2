"""What the measurements share: results, host, recorded ticks, runs watched from outside."""
