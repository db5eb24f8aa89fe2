"""Wire clients: codec (pure bytes), device (conversation), link (moves bytes), one folder each."""
