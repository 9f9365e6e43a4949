"""Error against run time: dB against the true picture over core seconds, for all methods."""
