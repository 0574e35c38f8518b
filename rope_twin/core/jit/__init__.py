"""From a kernel to machine code: one compiler for all, kept on disk, and what it is taught."""
