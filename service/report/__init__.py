"""The printed report of a diagnosis: one HTML page, nothing loaded from outside."""
