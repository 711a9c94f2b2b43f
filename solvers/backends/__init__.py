"""Adapters, one solver a file; each is imported at its first use."""
