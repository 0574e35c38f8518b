"""Messages -> rerun: the live window, .rrd files, pictures. Needs the extra `viz` (rerun-sdk)."""
