"""Pictures from camera arrays: Isaksen's filter, Monte Carlo and quadrature thin lenses."""
