"""The light field camera of CS348b's third assignment: its arrays, pictures and measurements."""
