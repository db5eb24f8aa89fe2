"""Runs for other tools and from them: the MASK4 MATLAB structure, NetCDF, CSV."""
