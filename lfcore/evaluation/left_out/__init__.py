"""What scenes do not need, and what leaving it out saves, against the program with it."""
