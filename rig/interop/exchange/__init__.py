"""Export of runs for other tools and import from them: MASK4 MATLAB structure, NetCDF, CSV."""
