"""Files that `onespp new` writes, and the function that does; each of them runs as it is."""
