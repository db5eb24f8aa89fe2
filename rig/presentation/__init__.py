"""Frame, style and phrases that all pictures and reports share."""
