"""Twin experiment of the estimator: hidden truths of other kind, and what it learns of them."""
