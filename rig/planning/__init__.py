"""From the files that people write to the table that the loop executes."""
