"""The WaveBot of the MASK4 test: a heaving point absorber."""
