"""Campaigns that judge forecasts, on seas drawn by seed and sensors with errors of known size."""
