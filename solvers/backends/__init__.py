"""Adapters, one solver a file; each is imported when first asked for."""
