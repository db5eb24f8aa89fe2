"""Reference pages of the site, generated from the program when the site is built."""
