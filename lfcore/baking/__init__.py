"""Light that is computed once for all rays: irradiance on the surfaces that the camera sees."""
