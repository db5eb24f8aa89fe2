"""Parts of all measurements: results, host, recorded ticks, runs watched from outside."""
