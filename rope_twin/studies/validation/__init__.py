"""Cases that the model must meet: each a published or closed-form number beside our own."""
