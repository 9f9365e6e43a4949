"""The same scenes by POV-Ray and Mitsuba 3: export, and pictures through the same lens."""
