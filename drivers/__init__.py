"""Wire clients, one folder per device: codec (bytes), conversation (device), link (transport)."""
