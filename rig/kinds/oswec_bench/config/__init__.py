"""The models of a bench's configuration files."""
