"""Slow float64 references that tests and reports trust; nothing else imports them."""
