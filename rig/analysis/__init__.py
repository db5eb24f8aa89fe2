"""Analysis of recorded runs: row table, power surfaces, traces, summary."""
