"""What several models of vortex-induced vibration share."""
