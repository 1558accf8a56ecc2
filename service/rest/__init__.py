"""The service over HTTP: thin handlers over the functions that the command line uses too."""
