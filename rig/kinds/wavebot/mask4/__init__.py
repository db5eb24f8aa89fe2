"""Exchange of runs with the files of the MASK4 test."""
