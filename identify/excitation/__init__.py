"""Design of periodic excitation: rich in information, inside every limit at every instant."""
