"""The loop of a test rig and everything around it; docs/structure.md lists the packages."""
