"""The page of whole jobs beside what a person would pick instead: `make bench`."""
