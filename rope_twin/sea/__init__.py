"""The sea: spectra, and the waves that they are made of. Numpy only; knows no rope."""
