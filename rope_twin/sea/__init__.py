"""Sea states: spectra, wave components, vessel responses. Numpy only, independent of ropes."""
