"""Import and export of files of other laboratories and programs."""
