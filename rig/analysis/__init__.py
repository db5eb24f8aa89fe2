"""What a run means: row table, power surfaces, traces, summary."""
