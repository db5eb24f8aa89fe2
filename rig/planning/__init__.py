"""Planning: campaign and session files become the table of segments that the loop executes."""
