"""Features that a scene lacks: the savings of leaving them out of the program."""
